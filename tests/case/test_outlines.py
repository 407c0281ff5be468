"""What is drawn of bodies: shapes of the plane and of space, paths of drawings, files; what is refused, and where."""

from __future__ import annotations

import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.geometry.mesh_files import MeshError, surface
from mdstopo.case.geometry.svg_areas import PathError, areas
from mdstopo.case.model import Case
from mdstopo.case.reader import load_case, read_case
from mdstopo.finalize.document import content_of
from mdstopo.finalize.lift_case import lifted

from .scenes import SMALL, SPACE, changed, mistakes

BODY = "a: {mass: 2, inertia: 3, position: [0, 0]}"
NUMBER = st.floats(-10, 10)


def drawn(outline: str, more: str = "") -> Case:
    return read_case(changed(SMALL, (BODY, f"a: {{mass: 2, inertia: 3, position: [3, 4]{more}, outline: {outline}}}")))


def told(outline: str) -> list[str]:
    text = changed(SMALL, (BODY, f"a: {{mass: 2, inertia: 3, position: [3, 4], outline: {outline}}}"))
    return [f"{each.path_key}: {each.message}" for each in mistakes(text)]


def in_space(outline: str) -> Case:
    return read_case(changed(SPACE, ("\n  a: {", f"\n  a: {{outline: {outline}, ")))


def test_shapes_in_the_plane_become_corners_in_body_coordinates() -> None:
    (box,) = drawn("{rectangle: {size: [2, 1]}}").bodies[0].outline
    assert box.corners.tolist() == [[-1, -0.5], [1, -0.5], [1, 0.5], [-1, 0.5]]
    (moved,) = drawn("{rectangle: {center: [4, 4], size: [2, 1]}}").bodies[0].outline
    np.testing.assert_array_equal(moved.corners, box.corners + np.array([1, 0]))
    (own,) = drawn("{rectangle: {center: [4, 4], size: [2, 1]}, frame: body}").bodies[0].outline
    np.testing.assert_array_equal(own.corners, box.corners + np.array([4, 4]))
    (turned,) = drawn("{polygon: [[3, 4], [4, 4], [3, 5]]}", ", angle: 1.5707963267948966").bodies[0].outline
    np.testing.assert_allclose(turned.corners, [[0, 0], [0, -1], [1, 0]], atol=1e-15)
    (disc,) = drawn("{circle: {radius: 2}}").bodies[0].outline
    np.testing.assert_allclose(np.hypot(*disc.corners.T), 2, rtol=1e-15)


def test_several_shapes_and_holes() -> None:
    shapes = drawn("[{circle: {radius: 1}}, {path: {d: 'M0 0h4v4h-4z M1 1h2v2h-2z', scale: 0.5}}]").bodies[0].outline
    assert [each.shape for each in shapes] == ["circle", "path"]
    assert [len(face) for face in shapes[1].faces] == [4, 4]
    assert shapes[1].corners.min(axis=0).tolist() == [0, -2]  # y of a drawing points down


def test_an_outline_changes_nothing_but_the_picture() -> None:
    plain, shown = read_case(SMALL), read_case(changed(SMALL, (BODY, BODY[:-1] + ", outline: {circle: {radius: 1}}}")))
    assert shown.bodies[0].outline
    assert not plain.bodies[0].outline
    for name in ("members", "points", "joints", "objectives", "solver"):
        assert getattr(plain, name) == getattr(shown, name)
    bodies = tuple(replace(body, outline=()) for body in shown.load_cases[0].bodies)
    assert replace(shown.load_cases[0], bodies=bodies) == plain.load_cases[0]


def test_what_is_wrong_is_told_with_its_place() -> None:
    assert told("{}") == ["bodies.a.outline: found none, needed is exactly one of polygon, rectangle, circle, path"]
    assert told("{polygon: [[0, 0], [1, 0]]}") == ["bodies.a.outline.polygon: found 2 rows, needed are at least 3"]
    assert told("{sphere: {radius: 1}}") == [
        "bodies.a.outline.sphere: unknown key 'sphere': it is for a case with `dimension: 3`; in the plane it is "
        "`polygon`, `rectangle`, `circle`, `path`"
    ]
    assert told("[{circle: {radius: 0}}]") == ["bodies.a.outline[0].circle.radius: found 0, allowed is a number > 0"]
    assert told("{path: {d: 'M0 0 L1 1'}}") == [
        "bodies.a.outline.path.d: the path has no area: needed are three corners at least"
    ]
    assert told("{circle: {radius: 1e200}}") == [
        "bodies.a.outline: a coordinate is not below 1e+150 m: too large to compute with"
    ]
    space = changed(SPACE, ("\n  a: {", "\n  a: {outline: {circle: {radius: 1}}, "))
    assert "it is for a case in the plane" in mistakes(space)[0].message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("L 1 1", "found 'L' at character 1 of the path, a path begins with M"),
        ("M 0 0 X 1", "found 'X' at character 7 of the path, allowed are M, L"),
        ("M 0 0 L 1", "character 10 of the path; L needs 2 numbers at a time"),
        ("M 0 0 A 1 1 0 2 0 3 3", "A needs 7 numbers at a time"),
        ("M 0 0 L 1e999 0 L 0 1 Z", "a coordinate of the path is too large"),
        ("", "the path has no area"),
    ],
)
def test_a_text_that_is_no_path_is_refused(text: str, words: str) -> None:
    with pytest.raises(PathError) as refused:
        areas(text)
    assert words in str(refused.value)


def test_absolute_and_relative_commands_draw_the_same() -> None:
    absolute = areas("M1 1 L3 1 V4 H1 Z M2 2 C2 3 3 3 3 2 S4 1 4 2 Q4.5 4 5 2 T6 2 Z")
    relative = areas("m1 1l2,0v3h-2z m1 1c0 1 1 1 1 0s1-1 1 0q.5 2 1 0t1 0z")
    for one, other in zip(absolute, relative, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-14)


@settings(max_examples=40, deadline=None)
@given(points=st.lists(st.tuples(NUMBER, NUMBER), min_size=4, max_size=4, unique=True))
def test_curves_are_those_of_bernsteins_polynomials(points: list[tuple[float, float]]) -> None:
    p = np.array(points)
    cubic = areas("M{} C{} {} {} L 100 100 L 100 -100".format(*(f"{x!r},{y!r}" for x, y in points)))[0]
    t = np.linspace(0, 1, 17)[:, None]
    wanted = (1 - t) ** 3 * p[0] + 3 * t * (1 - t) ** 2 * p[1] + 3 * t**2 * (1 - t) * p[2] + t**3 * p[3]
    np.testing.assert_allclose(cubic[:17], wanted, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    radii=st.tuples(st.floats(0.5, 5), st.floats(0.5, 5)),
    turn=st.floats(-180, 180),
    flags=st.tuples(st.booleans(), st.booleans()),
    end=st.tuples(st.floats(0.1, 4), st.floats(-4, 4)),
)
def test_arcs_lie_on_an_ellipse_and_go_the_stated_way(
    radii: tuple[float, float], turn: float, flags: tuple[bool, bool], end: tuple[float, float]
) -> None:
    large, positive = flags
    text = f"M0 0 A {radii[0]!r} {radii[1]!r} {turn!r} {int(large)} {int(positive)} {end[0]!r} {end[1]!r} L 50 50"
    arc = areas(text)[0][:-1]
    assert arc[0].tolist() == [0, 0]
    assert arc[-1].tolist() == list(end)
    # the circle through three of its places where the ellipse is one, by its equation x^2 + y^2 + d x + e y + f = 0
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    u = np.stack([(c * arc[:, 0] + s * arc[:, 1]) / radii[0], (c * arc[:, 1] - s * arc[:, 0]) / radii[1]], axis=1)
    some = u[[0, len(u) // 2, -1]]
    d, e, f = np.linalg.solve(np.column_stack([some, np.ones(3)]), -(some**2).sum(axis=1))
    np.testing.assert_allclose((u**2).sum(axis=1) + d * u[:, 0] + e * u[:, 1] + f, 0, atol=1e-6 * (1 + abs(d) + abs(e)))
    radius = math.sqrt(d * d / 4 + e * e / 4 - f)
    half = math.hypot(*(u[-1] - u[0])) / 2
    assert radius == pytest.approx(max(1.0, half), rel=1e-6)
    way = np.cumsum(np.arctan2(*_turns(u + np.array([d / 2, e / 2]))))[-1]
    assert (way > 0) == positive
    if half < 0.99:
        assert (abs(way) > math.pi) == large


def _turns(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b = u[:-1], u[1:]
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1)


@pytest.mark.parametrize(
    ("shape", "volume", "rel"),
    [
        ("{box: {size: [1, 2, 3]}}", 6.0, 1e-14),
        ("{sphere: {radius: 2}}", 32 * math.pi / 3, 0.04),
        ("{cylinder: {from: [0, 0, 0], to: [1, 2, 2], radius: 0.5}}", 0.75 * math.pi, 0.02),
    ],
)
def test_surfaces_in_space_are_closed_and_look_outwards(shape: str, volume: float, rel: float) -> None:
    """By Gauss's theorem the volume within; every edge is passed once each way."""
    (outline,) = in_space(shape).bodies[0].outline
    inside, passed = 0.0, set()
    for face in outline.faces:
        corners = outline.corners[list(face)]
        for k in range(1, len(face) - 1):
            inside += float(np.linalg.det(corners[[0, k, k + 1]])) / 6
        for edge in zip(face, (*face[1:], face[0]), strict=True):
            assert edge not in passed
            passed.add(edge)
    assert inside == pytest.approx(volume, rel=rel)
    assert {(b, a) for a, b in passed} == passed
    assert {(min(edge), max(edge)) for edge in outline.edges} <= {(min(edge), max(edge)) for edge in passed}


def test_a_polygon_in_space_is_flat() -> None:
    (flat,) = in_space("{polygon: [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]}").bodies[0].outline
    assert len(flat.faces) == 1
    text = changed(SPACE, ("\n  a: {", "\n  a: {outline: {polygon: [[0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]]}, "))
    assert [each.message for each in mistakes(text)] == ["the corners of the polygon do not lie in a plane"]


CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + (
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf -7 -3 -1 -5\n"
)


def test_files_give_faces_and_the_edges_where_they_meet_at_an_angle(tmp_path: Path) -> None:
    corners, faces, edges = surface("cube.obj", CUBE.encode())
    assert (len(corners), len(faces), len(edges)) == (8, 6, 12)
    triangles = [corners[[f[0], f[k], f[k + 1]]] for f in faces for k in (1, 2)]
    data = bytes(80) + struct.pack("<I", 12)
    data += b"".join(struct.pack("<12fH", 0, 0, 0, *each.ravel().tolist(), 0) for each in triangles)
    again, pieces, sharp = surface("cube.stl", data)
    assert (len(again), len(pieces), len(sharp)) == (8, 12, 12)  # diagonals of sides are no edges
    (tmp_path / "cube.obj").write_text(CUBE)
    (tmp_path / "case.yaml").write_text(
        changed(SPACE, ("\n  a: {", "\n  a: {outline: {file: cube.obj, frame: body}, "))
    )
    case = load_case(tmp_path / "case.yaml")
    np.testing.assert_array_equal(case.bodies[0].outline[0].corners, corners)
    assert content_of(case)["bodies"]["a"]["outline"] == {"file": "cube.obj", "frame": "body"}


@pytest.mark.parametrize(
    ("data", "words"),
    [("v 0 0 0\n", "has no faces"), ("v 0 0 0\nf 1 2 3\n", "line 2: found 'f 1 2 3'"), ("v 0 0 0\nf a\n", "line 2")],
)
def test_files_without_faces_are_refused(data: str, words: str) -> None:
    with pytest.raises(MeshError, match=words):
        surface("a.obj", data.encode())


def test_lift_takes_outlines_along() -> None:
    planar = drawn("[{circle: {radius: 1}}, {rectangle: {size: [2, 1]}}]", ", angle: 0.3")
    spatial = read_case(lifted(planar))
    for flat, shape in zip(planar.bodies[0].outline, spatial.bodies[0].outline, strict=True):
        np.testing.assert_allclose(shape.corners[:, :2], flat.corners, atol=1e-15)
        assert not shape.corners[:, 2].any()
