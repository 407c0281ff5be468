"""What is dominated, hypervolume, spacing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.front.measures import dominated, hypervolume, neighbour_gaps, scaled, spacing

sets = st.integers(1, 4).flatmap(
    lambda m: st.lists(st.lists(st.integers(0, 6), min_size=m, max_size=m), min_size=1, max_size=9)
).map(lambda rows: np.array(rows, dtype=np.float64))  # fmt: skip


def cells(points, reference):
    """The hypervolume of points with whole coordinates: unit cells that one of them dominates, counted."""
    grids = np.meshgrid(*(np.arange(int(r)) for r in reference), indexing="ij")
    corners = np.stack([grid.ravel() for grid in grids], axis=1)
    return int((points[None] <= corners[:, None]).all(axis=2).any(axis=1).sum())


@settings(max_examples=150, deadline=None)
@given(sets)
def test_hypervolume_is_the_number_of_unit_cells_that_are_dominated(points):
    reference = np.full(points.shape[1], 5.0)
    assert hypervolume(points, reference) == pytest.approx(cells(points, reference), abs=1e-9)


@settings(max_examples=100, deadline=None)
@given(sets)
def test_exactly_the_points_that_add_nothing_are_dominated(points):
    marked = dominated(points)
    for j, point in enumerate(points):
        others = [k for k in range(len(points)) if k != j]
        beaten = any((points[k] <= point).all() and ((points[k] < point).any() or k < j) for k in others)
        assert marked[j] == beaten
    assert not marked.all()


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
