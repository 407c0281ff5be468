"""What is drawn of bodies that have no outline, and of those that have one; symbols; areas as triangles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.reader import read_case
from mdstopo.plots.body_shapes import Shape, followed, planar_shapes
from mdstopo.plots.scenery import start_state
from mdstopo.plots.solids import solid
from mdstopo.plots.symbols import placed, symbols
from mdstopo.plots.triangles import triangles

VAN = """\
format: 1
gravity: [0, -9.8]
time: {end: 0.1}
bodies:
  van: {mass: 2000, inertia: 3000, position: [0, 0]VAN}
  torso: {mass: 60, inertia: 2, position: [0.2, 0.5]}
  link: {mass: 1, inertia: 0.1, position: [2.5, 0]}
joints:
  - {type: revolute, bodies: [link, ground], at: [2, 0]}
  - {type: prismatic, bodies: [ground, van], at: [0, 0], axis: [1, 0]}
points:
  chest: {body: torso, grid: {rectangle: {center: [0.2, 0.5], size: [0.4, 0.6], count: 8}}}
  anchors: {body: van, grid: {list: [[-1, 0], [1.5, 0], [0, 1.6]]}}
  tip: {body: link, grid: {list: [[3, 0]]}}
members:
  belts: {from: chest, to: anchors, law: {type: spring, stiffness: 1e4}}
  cord: {from: tip, to: anchors, law: {type: spring, stiffness: 1e4}, design: false}
loads:
  - {body: torso, force: {table: [[0, 0, 0], [0.05, 30, 40], [0.1, 0, 0]]}}
  - {body: link, moment: -2}
  - {body: link, force: [0, 25], frame: body, at: [0.5, 0]}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, fraction: 0.2}
"""


def shapes(body: str, outline: str = "") -> list[Shape]:
    return planar_shapes(read_case(VAN.replace("VAN", outline)), body)


def test_a_body_around_another_is_no_triangle_through_it() -> None:
    (van,) = shapes("van")
    assert not van.areas
    assert not van.thin_arms  # they are all there is of it
    assert sorted(arm[1].tolist() for arm in van.arms) == [[-1, 0], [0, 1.6], [1.5, 0]]


def test_the_points_of_a_body_span_its_area_where_nothing_else_is_in_it() -> None:
    (torso,) = shapes("torso")
    ((corners,),) = (torso.areas,)
    assert np.abs(corners).max(axis=0) == pytest.approx([0.2, 0.3])


def test_a_link_between_two_points_is_drawn() -> None:
    (link,) = shapes("link")
    assert sorted(arm[1].tolist() for arm in link.arms) == [[-0.5, 0], [0.5, 0]]


def test_an_outline_is_drawn_instead() -> None:
    van, wheel, reaching = shapes("van", ", outline: [{rectangle: {size: [3, 2]}}, {circle: {radius: 0.3}}]")
    assert [len(area) for area in (*van.areas, *wheel.areas)] == [4, 64]
    # an anchor above the roof hangs on it; those inside and on the border are seen as they are
    (arm,) = reaching.arms
    assert arm.tolist() == [[0.0, 1.0], [0.0, 1.6]]
    assert not reaching.areas
    assert reaching.thin_arms


def test_lines_follow_evenly_spaced_points() -> None:
    sides = [
        np.linspace([-1, -0.8], [-1, 0.8], 17),
        np.linspace([-0.8, -1], [0.8, -1], 17),
        np.linspace([1, -0.8], [1, 0.8], 17),
    ]
    lines = followed(np.concatenate(sides))
    assert [len(line) for line in lines] == [17, 17, 17]
    for line, side in zip(lines, sides, strict=True):
        np.testing.assert_array_equal(line, side)
    angle = 2 * np.pi * np.arange(12) / 12
    (ring,) = followed(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert len(ring) == 13  # closed
    assert followed(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])) == []


def test_symbols_stand_where_joints_are_and_arrows_follow_the_loads() -> None:
    case = read_case(VAN.replace("VAN", ""))
    q = start_state(case)
    found = {each.kind: placed(case, each, q) for each in symbols(case)}
    assert found["revolute"][0].tolist() == [2, 0]
    assert found["prismatic"][1].tolist() == [1, 0]
    largest = [each for each in symbols(case) if each.kind == "load"]
    assert [each.size for each in largest] == [1.0, 0.5]
    assert largest[0].way == pytest.approx([0.6, 0.8])
    assert [each.size for each in symbols(case) if each.kind == "moment"] == [-1.0]  # clockwise
    assert [each.size for each in symbols(case, None, 0.025) if each.kind == "load"] == [0.5, 0.5]
    assert [each.body for each in symbols(case, None, 0.1) if each.kind == "load"] == ["link"]
    q[8] = np.pi / 2  # the force rides on the link, which has turned
    follower = next(each for each in symbols(case) if each.body == "link" and each.kind == "load")
    at, way, _ = placed(case, follower, q)
    assert at == pytest.approx([2.5, 0.5])
    assert way == pytest.approx([-1, 0])


@settings(max_examples=60, deadline=None)
@given(radii=st.lists(st.floats(0.2, 3), min_size=3, max_size=14), turned=st.booleans(), tilt=st.floats(-3, 3))
def test_triangles_fill_an_area_exactly(radii: list[float], turned: bool, tilt: float) -> None:
    """By their areas, each positive, against the shoelace formula of the whole."""
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    corners = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners = corners[::-1] if turned else corners
    x, y = corners.T
    whole = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    turn = np.array([[1, 0, 0], [0, np.cos(tilt), np.sin(tilt)]])
    for place in (corners, corners @ turn):
        cut = triangles(place)
        assert len(cut) == len(radii) - 2
        parts = [np.linalg.det(corners[[b, c]] - corners[a]) / 2 for a, b, c in cut]
        assert sum(parts) == pytest.approx(whole, rel=1e-9)
        assert all(part * np.sign(whole) >= -1e-12 for part in parts)


def test_in_space_a_frame_around_another_body_is_lines() -> None:
    text = """\
format: 1
dimension: 3
time: {end: 1}
bodies:
  frame: {mass: 5, inertia: [1, 1, 1], position: [0, 0, 0]}
  core: {mass: 5, inertia: [1, 1, 1], position: [0.1, 0, 0]}
points:
  corners: {body: frame, grid: {box: {from: [-1, -1, -1], to: [1, 1, 1], count: [2, 2, 2]}}}
  inner: {body: core, grid: {box: {from: [-0.2, -0.2, -0.2], to: [0.4, 0.2, 0.2], count: [2, 2, 2]}}}
members:
  cords: {from: corners, to: inner, law: {type: spring, stiffness: 100}}
objectives:
  G: {response: energy}
"""
    case = read_case(text)
    assert not solid(case, "frame").faces
    assert len(solid(case, "core").faces) == 6
    drawn = read_case(
        text.replace(
            "position: [0, 0, 0]", "position: [0, 0, 0], outline: [{box: {size: [2, 2, 2]}}, {sphere: {radius: 1}}]"
        )
    )
    assert len(solid(drawn, "frame").faces) == 6 + 12 * 24


def test_few_points_are_a_line_only_where_they_are_straight() -> None:
    posts = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    assert followed(posts) == []
    assert len(followed(np.linspace([0.0, 0.0], [3.0, 1.0], 4))) == 1
