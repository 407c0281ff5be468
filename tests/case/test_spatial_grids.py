"""Point grids in space: where their points are, in which order, and what is refused."""

from __future__ import annotations

import itertools
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mdstopo.case.geometry.mesh_files import MeshError, vertices
from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from tests.tiers import examples

from .scenes import SPACE, changed, mistakes

LIST = "{list: [[0, 0, 0], [0, 1, 0]]}"
END = ("from: p", "from: {body: a, at: [9, 9, 9]}")
NUMBER = st.floats(-10, 10)
POINT = st.tuples(NUMBER, NUMBER, NUMBER)
DIRECTION = POINT.filter(lambda v: np.linalg.norm(v) > 0.1)


def grid(text: str) -> NDArray[np.float64]:
    return read_case(changed(SPACE, (LIST, text), END)).points["p"].world


def told(text: str) -> list[str]:
    return [f"{each.path_key}: {each.message}" for each in mistakes(changed(SPACE, (LIST, text), END))]


def flow(**keys: object) -> str:
    """Keys in YAML; tuples are lists."""
    return "{" + ", ".join(f"{key}: {value}" for key, value in keys.items()).replace("(", "[").replace(")", "]") + "}"


def test_line_and_lattice_include_both_ends() -> None:
    line = grid("{line: {from: [0, 0, 1], to: [1, 2, 0], count: 3}}")
    assert line.tolist() == [[0, 0, 1], [0.5, 1, 0.5], [1, 2, 0]]
    lattice = grid("{lattice: {from: [0, 0, 0], to: [1, 2, 3], count: [2, 3, 2]}}")
    assert lattice.tolist() == [[x, y, z] for z in (0, 3) for y in (0, 1, 2) for x in (0, 1)]


def test_circle_and_arc_go_right_handed_about_the_normal() -> None:
    circle = grid("{circle: {center: [1, 0, 0], radius: 2, normal: [0, 0, 3], start: [0, 5, 7], count: 4}}")
    np.testing.assert_allclose(circle, [[1, 2, 0], [-1, 0, 0], [1, -2, 0], [3, 0, 0]], atol=1e-15)
    arc = grid(
        "{arc: {center: [0, 0, 0], radius: 1, normal: [0, -1, 0], start: [1, 0, 0], from: 0, to: 1.5707963267948966, "
        "count: 2}}"
    )
    np.testing.assert_allclose(arc, [[1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_the_rectangle_starts_at_its_corner_and_goes_along_the_first_axis() -> None:
    points = grid("{rectangle: {center: [0, 0, 5], axes: [[0, 1, 0], [0, 0, 2]], size: [2, 4], count: 6}}")
    expected = [[0, -1, 3], [0, 1, 3], [0, 1, 5], [0, 1, 7], [0, -1, 7], [0, -1, 5]]
    np.testing.assert_allclose(points, expected, atol=1e-15)


def test_the_plane_is_a_lattice_on_a_parallelogram() -> None:
    points = grid("{plane: {corner: [1, 0, 0], edges: [[2, 0, 0], [1, 1, 0]], count: [3, 2]}}")
    assert points.tolist() == [[1, 0, 0], [2, 0, 0], [3, 0, 0], [2, 1, 0], [3, 1, 0], [4, 1, 0]]


def test_the_cylinder_is_circles_from_end_to_end() -> None:
    points = grid("{cylinder: {from: [0, 0, 0], to: [0, 0, 4], radius: 1, start: [1, 0, 9], count: [4, 3]}}")
    circle = [[1, 0], [0, 1], [-1, 0], [0, -1]]
    np.testing.assert_allclose(points, [[x, y, z] for z in (0, 2, 4) for x, y in circle], atol=1e-15)


@given(n=st.tuples(*[st.integers(1, 5)] * 3), start=POINT, end=POINT)
@settings(max_examples=examples(20, 40), deadline=None, derandomize=True)
def test_the_box_is_what_of_the_lattice_is_on_its_surface(
    n: tuple[int, int, int], start: tuple[float, ...], end: tuple[float, ...]
) -> None:
    keys = flow(**{"from": start, "to": end, "count": n})
    lattice, box = grid(f"{{lattice: {keys}}}"), grid(f"{{box: {keys}}}")
    nx, ny, nz = n
    places = [(i, j, k) for k, j, i in itertools.product(range(nz), range(ny), range(nx))]
    outer = [any(at in (0, count - 1) for at, count in zip(place, n, strict=True)) for place in places]
    np.testing.assert_array_equal(box, lattice[outer])


@given(center=POINT, normal=DIRECTION, start=DIRECTION, radius=st.floats(0.1, 10), n=st.integers(1, 12))
@settings(max_examples=examples(25, 60), deadline=None, derandomize=True)
def test_points_of_a_circle_have_its_radius_lie_in_its_plane_and_are_evenly_spaced(
    center: tuple[float, ...], normal: tuple[float, ...], start: tuple[float, ...], radius: float, n: int
) -> None:
    along = np.array(normal) / np.linalg.norm(normal)
    if np.linalg.norm(np.cross(along, start)) < 1e-2:
        return
    points = grid(f"{{circle: {flow(center=center, radius=radius, normal=normal, start=start, count=n)}}}")
    arms = points - np.array(center)
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), radius, rtol=1e-12)
    np.testing.assert_allclose(arms @ along, 0, atol=1e-12 * radius)
    assert arms[0] @ np.array(start) > 0
    np.testing.assert_allclose(np.cross(along, start) @ arms[0], 0, atol=1e-11 * radius)
    for one, two in itertools.pairwise(arms):
        turned = math.atan2(np.cross(one, two) @ along, one @ two)
        assert turned == pytest.approx(2 * math.pi / n if n > 2 else math.pi, abs=1e-9) or n == 2


def test_grids_of_a_list_follow_each_other_and_ride_on_the_body() -> None:
    text = "[{list: [[5, 6, 7]]}, {line: {from: [0, 0, 0], to: [0, 0, 1], count: 2}}]"
    assert grid(text).tolist() == [[5, 6, 7], [0, 0, 0], [0, 0, 1]]
    case = read_case(changed(SPACE, (f"grid: {LIST}", f"frame: body, grid: {text}"), END))
    assert case.points["p"].local.tolist() == [[5, 6, 7], [0, 0, 0], [0, 0, 1]]
    assert case.points["p"].world.tolist() == [[6, 8, 10], [1, 2, 3], [1, 2, 4]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{circle: {center: [0, 0, 0], radius: 1, count: 3}}", "points.p.grid.circle: the key 'normal' is missing"),
        (
            "{circle: {center: [0, 0, 0], radius: 1, normal: [0, 0, 1], start: [0, 0, -2], count: 3}}",
            "points.p.grid.circle.start: is along the normal",
        ),
        (
            "{arc: {center: [0, 0, 0], radius: 1, normal: [0, 0, 1], start: [0, 0, 2], from: 0, to: 1, count: 3}}",
            "points.p.grid.arc.start: is along the normal",
        ),
        (
            "{rectangle: {center: [0, 0, 0], axes: [[1, 0, 0], [1, 1, 0]], size: [1, 1], count: 4}}",
            "points.p.grid.rectangle.axes: the two axes are not perpendicular",
        ),
        (
            "{plane: {corner: [0, 0, 0], edges: [[1, 0, 0], [2, 0, 0]], count: [2, 2]}}",
            "points.p.grid.plane.edges: the two edges are parallel",
        ),
        (
            "{cylinder: {from: [0, 0, 0], to: [0, 0, 0], radius: 1, start: [1, 0, 0], count: [3, 2]}}",
            "points.p.grid.cylinder.to: is where the cylinder begins",
        ),
        (
            "{cylinder: {from: [0, 0, 0], to: [0, 0, 1], radius: 1, start: [0, 0, 1], count: [3, 2]}}",
            "points.p.grid.cylinder.start: is along the axis",
        ),
        (
            "{box: {from: [0, 0, 0], to: [1, 1, 1], count: [1000000, 1000000, 1000000]}}",
            "points are more than memory holds",
        ),
        (
            "{lattice: {from: [0, 0, 0], to: [1, 1, 1], count: [3, 2]}}",
            "points.p.grid.lattice.count: found a list of 2, allowed is a list of 3",
        ),
        ("{list: [[0, 0, 1e200]]}", "too large to compute with"),
        ("{file: part.step}", "points.p.grid.file: there is no file 'part.step'"),
    ],
)
def test_grids_that_cannot_be_are_refused(text: str, message: str) -> None:
    lines = told(text)
    assert any(message in line for line in lines), lines


# Files.

TETRAHEDRON = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.5)]
FACETS = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
IN_ORDER = [TETRAHEDRON[i] for i in (0, 2, 1, 3)]


def ascii_stl() -> bytes:
    lines = ["solid part"]
    for facet in FACETS:
        corners = [f"vertex {' '.join(format(v, 'e') for v in TETRAHEDRON[i])}" for i in facet]
        lines += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part"]).encode()


def binary_stl() -> bytes:
    """With a head that begins like a file in ASCII, as some programs write it."""
    facets = [struct.pack("<12fH", 0, 0, 0, *(v for i in facet for v in TETRAHEDRON[i]), 0) for facet in FACETS]
    return b"solid in fact binary".ljust(80) + struct.pack("<I", len(facets)) + b"".join(facets)


def obj() -> bytes:
    points = "".join(f"v {x} {y} {z} 1.0\n" for x, y, z in [*IN_ORDER, IN_ORDER[1], (-0.0, 0.0, 0.0)])
    return f"# a tetrahedron\no part\n{points}vn 0 0 1\nvt 0 0\nf 1/1/1 2 3\n".encode()


@pytest.mark.parametrize(("name", "data"), [("a.stl", ascii_stl()), ("a.STL", binary_stl()), ("a.obj", obj())])
def test_the_vertices_of_a_file_are_its_points_each_once_in_order(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    (tmp_path / "case.yaml").write_text(changed(SPACE, (LIST, f"{{file: {name}}}")))
    case = load_case(tmp_path / "case.yaml")
    assert case.points["p"].world.tolist() == [list(point) for point in IN_ORDER]
    assert list(case.files) == [name]


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.stl", b"", "the file 'a.stl' has no vertices"),
        ("a.stl", b"vertex 1 2", "a.stl, line 1: found 'vertex 1 2', allowed are three finite numbers"),
        ("a.obj", b"v 1 2 nan", "a.obj, line 1: found 'v 1 2 nan', allowed are three finite numbers"),
        (
            "a.stl",
            binary_stl()[:-1].replace(b"solid", b"\xff\xff\xff\xff\xff"),
            "neither text in UTF-8 nor a whole binary",
        ),
        ("a.ply", b"ply", "found 'a.ply', allowed is a file that ends in .stl or .obj"),
    ],
)
def test_files_that_are_no_mesh_are_refused(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    with pytest.raises(MeshError, match=message.replace(".", r"\.")):
        vertices(name, data)
    (tmp_path / name).write_bytes(data)
    (tmp_path / "case.yaml").write_text(changed(SPACE, (LIST, f"{{file: {name}}}")))
    with pytest.raises(CaseError, match=r"points\.p\.grid\.file: "):
        load_case(tmp_path / "case.yaml")


@given(points=st.lists(st.tuples(*[st.floats(-1e3, 1e3, width=32)] * 3), min_size=3, max_size=12))
@settings(max_examples=examples(20, 40), deadline=None, derandomize=True)
def test_binary_and_ascii_files_have_the_same_vertices(points: list[tuple[float, float, float]]) -> None:
    points = points[: len(points) - len(points) % 3]
    facets = [points[i : i + 3] for i in range(0, len(points), 3)]
    binary = b"".join(struct.pack("<12fH", 0, 0, 0, *(v for p in facet for v in p), 0) for facet in facets)
    head = bytes(80) + struct.pack("<I", len(facets))
    text = "\n".join(f"  vertex {x!r} {y!r} {z!r}" for x, y, z in points)
    expected = list(dict.fromkeys((x + 0.0, y + 0.0, z + 0.0) for x, y, z in points))
    assert vertices("a.stl", head + binary).tolist() == [list(point) for point in expected]
    assert vertices("a.stl", text.encode()).tolist() == [list(point) for point in expected]
