"""Grids, frames, groups and their filters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.model import MemberGroup
from mdstopo.case.reader import read_case

from .scenes import SMALL, changed, mistakes, small


def grid(text: str, frame: str = "global", body: str = "position: [0, 0]") -> np.ndarray:
    changes = (
        ("grid: {list: [[0, 0], [0, 1]]}", f"frame: {frame}, grid: {text}"),
        ("position: [0, 0]", body),
    )
    case = read_case(
        changed(SMALL, *changes, ("from: p", "from: {body: a, at: [9, 9]}")).replace("equals: 3", "limit: 3")
    )
    return case.points["p"].world


def test_line_lattice_and_arc_include_both_ends() -> None:
    assert grid("{line: {from: [-1, 0.3], to: [1, 0.7], count: 5}}").tolist() == pytest.approx(
        np.array([[-1, 0.3], [-0.5, 0.4], [0, 0.5], [0.5, 0.6], [1, 0.7]])
    )
    assert grid("{lattice: {from: [0, 0], to: [1, 2], count: [2, 3]}}").tolist() == [
        [0, 0], [1, 0], [0, 1], [1, 1], [0, 2], [1, 2],
    ]  # fmt: skip
    arc = grid("{arc: {center: [1, 0], radius: 2, from: 3.141592653589793, to: 0, count: 3}}")
    np.testing.assert_allclose(arc, [[-1, 0], [1, 2], [3, 0]], atol=1e-15)


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("{line: {from: [2, 3], to: [5, 5], count: 1}}", [2, 3]),
        ("{arc: {center: [0, 0], radius: 2, from: 0, to: 3, count: 1}}", [2, 0]),
        ("{lattice: {from: [2, 3], to: [5, 5], count: [1, 1]}}", [2, 3]),
        ("{circle: {center: [0, 0], radius: 2, count: 1}}", [2, 0]),
        ("{rectangle: {center: [0, 0], size: [2, 4], count: 1}}", [-1, -2]),
    ],
)
def test_a_count_of_one_is_the_first_point(text: str, first: list[float]) -> None:
    assert grid(text).tolist() == [first]


def test_the_circle_walks_counter_clockwise_from_angle_zero_without_repeating() -> None:
    np.testing.assert_allclose(
        grid("{circle: {center: [1, 1], radius: 1, count: 4}}"), [[2, 1], [1, 2], [0, 1], [1, 0]], atol=1e-15
    )


def test_the_rectangle_walks_counter_clockwise_from_the_lower_left_corner() -> None:
    points = grid("{rectangle: {center: [0, 0], size: [0.5, 0.5], count: 20}}")
    steps = np.diff(np.vstack([points, points[:1]]), axis=0)
    np.testing.assert_allclose(np.hypot(*steps.T), 0.1, rtol=1e-12)
    assert points[0].tolist() == [-0.25, -0.25]
    assert points[[5, 10, 15]].tolist() == [[0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]]


@given(w=st.floats(0.01, 100), h=st.floats(0.01, 100), n=st.integers(1, 60))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_rectangle_points_lie_on_the_perimeter_evenly_spaced_along_it(w: float, h: float, n: int) -> None:
    x, y = grid(f"{{rectangle: {{center: [0, 0], size: [{w!r}, {h!r}], count: {n}}}}}").T
    scale = w + h
    on_side = np.isclose(np.abs(x), w / 2, atol=1e-12 * scale) | np.isclose(np.abs(y), h / 2, atol=1e-12 * scale)
    assert on_side.all()
    near = 1e-9 * scale
    walked = np.where(
        np.abs(y + h / 2) < near,
        x + w / 2,
        np.where(
            np.abs(x - w / 2) < near,
            w + y + h / 2,
            np.where(np.abs(y - h / 2) < near, 2 * w + h - x - w / 2, 2 * w + 2 * h - y - h / 2),
        ),
    )
    walked[0] = 0.0
    np.testing.assert_allclose(walked, 2 * scale * np.arange(n) / n, atol=1e-8 * scale)


def test_a_list_of_grids_concatenates() -> None:
    both = grid("[{list: [[0, 1], [2, 3]]}, {line: {from: [4, 5], to: [6, 7], count: 2}}]")
    assert both.tolist() == [[0, 1], [2, 3], [4, 5], [6, 7]]


def test_points_from_a_file_take_one_header_line(tmp_path: object) -> None:
    with open(f"{tmp_path}/p.csv", "w") as file:
        file.write("\ufeffx [m], y [m]\n0, 0\n\n 0,1e0\n")
    text = changed(SMALL, ("[[0, 0], [0, 1]]", "{file: p.csv}"))
    case = read_case(text, path=f"{tmp_path}/x.yaml")
    assert case.points["p"].world.tolist() == [[0, 0], [0, 1]]
    assert list(case.files) == ["p.csv"]
    assert len(case.files["p.csv"]) == 64


@pytest.mark.parametrize(
    ("content", "line"),
    [
        ("0,0\nx,y\n", 2),
        ("x,y\nx,y\n0,0", 2),
        ("0,0\n1,2,3\n", 2),
        ("0,nan\n", 1),
        ("a,b\n1,\n", 2),
        ("0;1e999\n", 1),
    ],
)
def test_a_wrong_line_of_a_file_is_named(tmp_path: object, content: str, line: int) -> None:
    with open(f"{tmp_path}/p.csv", "w") as file:
        file.write(content)
    text = changed(SMALL, ("[[0, 0], [0, 1]]", f"{{file: {tmp_path}/p.csv}}"))
    (mistake,) = mistakes(text)
    assert mistake.path_key == "points.p.grid.list.file"
    assert f"p.csv, line {line}: " in mistake.message


def test_a_turned_body_keeps_world_and_local_consistent() -> None:
    body = "position: [3, -2], angle: 0.7"
    world = grid("{list: [[0, 0], [0, 1]]}", body=body)
    assert world.tolist() == [[0, 0], [0, 1]]
    from_body = grid("{list: [[1, 0], [0, 1]]}", frame="body", body=body)
    c, s = math.cos(0.7), math.sin(0.7)
    np.testing.assert_allclose(from_body, [[3 + c, -2 + s], [3 - s, -2 + c]])
    case = small(("position: [0, 0]", body))
    local = case.points["p"].local
    turned = local @ np.array([[c, s], [-s, c]]) + [3, -2]
    np.testing.assert_allclose(turned, world, atol=1e-15)


def group(*changes: tuple[str, str]) -> MemberGroup:
    return small(*changes, ("equals: 3", "limit: 100")).members[0]


def test_members_run_p_slow_and_q_fast() -> None:
    g = group()
    assert g.from_index.tolist() == [0, 0, 0, 1, 1, 1]
    assert g.to_index.tolist() == [0, 1, 2, 0, 1, 2]
    assert g.is_product
    np.testing.assert_allclose(g.length, np.hypot(*(g.q_world - g.p_world).T))
    np.testing.assert_allclose(g.q_local, g.q_world - [2, 0])


def test_pairs_join_first_with_first() -> None:
    g = group(("[2, 1], [2, 2]", "[3, 1]"), ("to: q", "to: q, connect: pairs"))
    assert (g.from_index.tolist(), g.to_index.tolist()) == ([0, 1], [0, 1])
    assert not g.is_product


def test_filters_include_their_limits_in_spite_of_rounding() -> None:
    # 0.1 + 0.2 is a little more than 0.3.
    points = ("[[2, 0], [2, 1], [2, 2]]", "[[0.30000000000000004, 0], [0.3, 1], [0.5, 0]]")
    g = group(("[[0, 0], [0, 1]]", "[[0, 0]]"), points, ("to: q", "to: q, max_length: 0.3"))
    assert g.to_index.tolist() == [0]
    g = group(("[[0, 0], [0, 1]]", "[[0, 0]]"), points, ("to: q", "to: q, min_length: 0.5"))
    assert g.to_index.tolist() == [1, 2]


@pytest.mark.parametrize("least", ["1e-6", "1e-300"])  # the latter is below the rounding of coordinates
def test_min_length_drops_coinciding_points(least: str) -> None:
    g = group(("[[2, 0], [2, 1]", "[[0, 0], [2, 1]"), ("to: q", f"to: q, min_length: {least}"))
    assert len(g) == 5


def test_cost_is_a_number_or_the_length() -> None:
    assert group(("to: q", "to: q, cost: 0")).cost.tolist() == [0.0] * 6
    g = group(("to: q", "to: q, cost: length"))
    np.testing.assert_array_equal(g.cost, g.length)


def test_more_points_or_members_than_memory_holds_are_refused_with_the_count() -> None:
    huge = "{lattice: {from: [0, 0], to: [1, 1], count: [10000000, 10000000]}}"
    (mistake,) = mistakes(changed(SMALL, ("{list: [[0, 0], [0, 1]]}", huge)))
    assert mistake.path_key == "points.p.grid"
    assert "100,000,000,000,000 points" in mistake.message
    line = "{line: {from: [0, 0], to: [1, 1], count: 1000000}}"
    far = "{line: {from: [2, 0], to: [3, 1], count: 1000000}}"
    text = changed(SMALL, ("{list: [[0, 0], [0, 1]]}", line), ("{list: [[2, 0], [2, 1], [2, 2]]}", far))
    (mistake,) = mistakes(text)
    assert mistake.path_key == "members.belts"
    assert "1,000,000,000,000 members" in mistake.message
    (mistake,) = mistakes(changed(text, ("to: q", "to: q, max_length: 2")))
    assert "1,000,000,000,000 members" in mistake.message


def test_a_million_members_are_read_in_bounded_time_and_memory() -> None:
    import time
    import tracemalloc

    a = "{lattice: {from: [0, 0], to: [1, 1], count: [100, 10]}}"
    b = "{lattice: {from: [2, 0], to: [3, 1], count: [100, 10]}}"
    text = changed(
        SMALL,
        ("{list: [[0, 0], [0, 1]]}", a),
        ("{list: [[2, 0], [2, 1], [2, 2]]}", b),
        ("equals: 3", "fraction: 0.1"),
    )
    tracemalloc.start()
    start = time.perf_counter()
    case = read_case(text)
    seconds, peak = time.perf_counter() - start, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert case.n_design == 1_000_000
    assert seconds < 5.0
    assert peak < 200e6
