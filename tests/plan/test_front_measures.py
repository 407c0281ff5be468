"""What is dominated, hypervolume, spacing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.reader import read_case
from mdstopo.front.front_content import front_part, quality
from mdstopo.plan.front_measures import dominated, hypervolume, neighbour_gaps, repeated, scaled, spacing
from mdstopo.plan.front_plan import Front
from mdstopo.plan.solve_task import Found
from mdstopo.status import RunStatus
from tests.front.support import CASE
from tests.tiers import examples

sets = st.integers(1, 4).flatmap(
    lambda m: st.lists(st.lists(st.integers(0, 6), min_size=m, max_size=m), min_size=1, max_size=9)
).map(lambda rows: np.array(rows, dtype=np.float64))  # fmt: skip


def cells(points, reference):
    """The hypervolume of points with whole coordinates: unit cells that one of them dominates, counted."""
    grids = np.meshgrid(*(np.arange(int(r)) for r in reference), indexing="ij")
    corners = np.stack([grid.ravel() for grid in grids], axis=1)
    return int((points[None] <= corners[:, None]).all(axis=2).any(axis=1).sum())


@settings(max_examples=examples(50, 150), deadline=None)
@given(sets)
def test_hypervolume_is_the_number_of_unit_cells_that_are_dominated(points):
    reference = np.full(points.shape[1], 5.0)
    assert hypervolume(points, reference) == pytest.approx(cells(points, reference), abs=1e-9)


@settings(max_examples=examples(40, 100), deadline=None)
@given(sets)
def test_exactly_the_points_that_another_is_better_than_are_dominated(points):
    marked = dominated(points)
    for j, point in enumerate(points):
        assert marked[j] == any((other <= point).all() and (other < point).any() for other in points)
        assert repeated(points)[j] == any((other == point).all() for other in points[:j])
    assert not marked.all()


@pytest.mark.parametrize("size", [1e-12, 1.0, 3e9])
def test_nobody_is_beaten_by_the_last_bit(size):
    least = np.nextafter(size, 0.0)
    ends = np.array([[size, 5.0 * size], [least, 5.0 * size], [size, 5.0 * size], [3.0 * size, least]])
    for points in (ends, ends[::-1], -ends[:, ::-1]):
        assert not dominated(points).any()
        assert repeated(points).sum() == 2
    worse = np.array([[size, 5.0 * size], [least, 4.9 * size], [size, 4.8 * size]])
    assert dominated(worse).tolist() == [True, False, False]


def test_a_front_whose_points_repeat_is_as_good_as_one_without():
    case = read_case(CASE)
    once = np.array([[1.0, 5.0], [2.0, 3.0], [4.0, 1.0]])
    twice = np.concatenate([once, once * (1.0 + 1e-15)])
    one, two = (quality(case, front_of(points)) for points in (once, twice))
    assert two.numbers() == pytest.approx(one.numbers(), rel=1e-12)
    assert two.spacing == pytest.approx(spacing(once / [3.0, 4.0]), rel=1e-9)


def front_of(points):
    """A front with these objectives (W, 2)."""
    nothing = np.zeros(0)
    found = tuple(
        Found(
            point=j,
            key="k",
            alpha=nothing,
            objectives=row,
            combined=0.0,
            status=RunStatus.CONVERGED,
            reason="",
            evaluations=1,
            kkt=0.0,
            violation=0.0,
            visited=row[None],
        )
        for j, row in enumerate(points)
    )
    return Front(found, (found[0], found[2]), points.min(axis=0), points.max(axis=0))


def test_an_end_that_others_equal_is_not_called_dominated():
    case = read_case(CASE)
    points = np.array([[1.0, 5.0], [np.nextafter(1.0, 0.0), 5.0], [4.0, 1.0], [4.0, 1.0], [4.0, 2.0]])
    directions = np.array([[1.0, 0.0], [0.9, 0.1], [0.0, 1.0], [0.1, 0.9], [0.5, 0.5]])
    front = front_of(points)
    designs = tuple(replace(each, alpha=np.full(case.space.size, 0.1)) for each in front.points)
    part = front_part(case, directions, replace(front, points=designs, ends=(designs[0], designs[2])), ())
    assert part["pareto/dominated"].tolist() == [False, False, False, False, True]


def test_what_is_not_finite_is_dominated_and_adds_no_volume():
    points = np.array([[np.nan, 0.0], [1.0, 1.0]])
    assert dominated(points).tolist() == [True, False]
    assert hypervolume(points, np.array([2.0, 3.0])) == pytest.approx(2.0)
    assert hypervolume(np.full((2, 2), np.inf), np.ones(2)) == 0.0


def test_a_textbook_front_of_three_objectives():
    """Three unit points of the corners (0 1 1), (1 0 1), (1 1 0) below (2 2 2): 3 boxes of 4, less their overlaps."""
    points = np.array([[0.0, 1, 1], [1, 0, 1], [1, 1, 0]])
    assert hypervolume(points, np.full(3, 2.0)) == pytest.approx(3 * 2 - 3 * 1 + 1)


def test_even_points_have_no_spacing_and_a_gap_shows():
    even = np.stack([np.linspace(0, 1, 5), np.linspace(1, 0, 5)], axis=1)
    assert spacing(even) == pytest.approx(0.0, abs=1e-12)
    assert neighbour_gaps(even) == pytest.approx(np.full(4, np.sqrt(2) / 4))
    assert spacing(even[[0, 1, 4]]) > 0.1
    assert spacing(even[:1]) == 0.0


def test_scaling_by_ideal_and_nadir_survives_a_width_of_nothing():
    out = scaled(np.array([[1.0, 5.0], [3.0, 5.0]]), np.array([1.0, 5.0]), np.array([3.0, 5.0]))
    assert out.tolist() == [[0.0, 0.0], [1.0, 0.0]]
