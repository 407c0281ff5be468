"""Tiles of a grid from a few of their candidates, with functions of which every value is known."""

import numpy as np
import pytest

from mdstopo.compiler.vector import WIDE
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    COLUMN_NODE,
    COLUMN_NODES,
    COLUMNS,
    LEVELS,
    PLACES,
    PRICED,
    ROW_NODE,
    ROW_NODES,
    ROWS,
    SHORT,
    TALL,
    begin_tile,
    fill_lengths,
    make_scratch,
    next_candidates,
    smooth_parts,
    smoothness,
    take_prices,
)
from tests.space.in_python import in_python  # noqa: F401  (a fixture)

ERROR = 1e-12
#: rows of a tile that are tried first
FEWEST = int(ROW_NODES[0])


def line(begin, end, count):
    """Points on a line, (count, 2)."""
    return np.linspace(begin, end, count)


def dense(columns=BROAD):
    """A tile whose points are a hundredth as far from each other as the two grids are."""
    return line([0, 0], [0.01, 0.005], TALL), line([0.2, 1], [0.22, 1.01], columns)


def distance(p, q):
    """A function as smooth as its arguments are far apart, of the size 1."""
    return np.hypot(*(q - p).T)


def tile(grids, function, chosen=None, error=ERROR):
    """All values of the first tile, of one that is worth `error`; and how many were computed."""
    chosen = chosen or (np.arange(len(grids[0])), np.arange(len(grids[1])))
    known = smoothness(grids, chosen)
    scratch = make_scratch.py_func()
    plan, _, rows, columns, _, found, _ = scratch
    price = np.full(PLACES, np.inf)
    begin_tile(error, scratch)
    while next_candidates(known, 0, 0, scratch):
        i, j = np.repeat(rows[: plan[ROWS]], plan[COLUMNS]), np.tile(columns[: plan[COLUMNS]], plan[ROWS])
        found[: len(i)] = function(grids[0][i], grids[1][j])
        take_prices(known, 0, 0, error, scratch, price)
    return price.reshape(TALL, BROAD), int(plan[PRICED])


def every(grids, function):
    """All values of a tile, computed one by one; infinite where there is none."""
    found = np.full((TALL, BROAD), np.inf)
    n, m = (len(grid) for grid in grids)
    found[:n, :m] = function(np.repeat(grids[0], m, axis=0), np.tile(grids[1], (n, 1))).reshape(n, m)
    return found


def assert_equal(found, wanted, error=ERROR):
    assert np.array_equal(np.isinf(found), np.isinf(wanted))
    there = np.isfinite(wanted)
    assert np.abs(found[there] - wanted[there]).max() <= error


@pytest.mark.usefixtures("in_python")
def test_a_smooth_tile_follows_from_a_few_of_its_candidates():
    found, computed = tile(dense(), distance)
    assert computed == FEWEST * COLUMN_NODES
    assert_equal(found, every(dense(), distance))


@pytest.mark.usefixtures("in_python")
def test_where_nothing_may_be_off_all_are_computed():
    found, computed = tile(dense(), distance, error=0.0)
    assert computed == PLACES
    assert np.array_equal(found, every(dense(), distance))


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("reach", [0.3, 0.5, 1.0, 4.0])
def test_a_tile_that_is_large_is_halved_or_computed(reach):
    grids = line([0, 0], [reach / 8, 0], TALL), line([0, 1], [reach, 1], BROAD)
    found, computed = tile(grids, distance)
    assert_equal(found, every(grids, distance))
    assert FEWEST * COLUMN_NODES < computed <= PLACES + 2 * LEVELS * TALL * COLUMN_NODES


@pytest.mark.usefixtures("in_python")
def test_rows_that_are_far_apart_are_computed_at_the_nodes_of_columns():
    grids = line([-1, 0], [1, 0], TALL), line([0, 1], [0.02, 1.01], BROAD)
    found, computed = tile(grids, distance)
    assert computed == (int(ROW_NODES.sum()) + TALL) * COLUMN_NODES
    assert_equal(found, every(grids, distance))


@pytest.mark.usefixtures("in_python")
def test_rows_that_are_somewhat_apart_follow_from_more_of_them():
    grids = line([0, 0], [0.15, 0], TALL), line([0, 1], [0.02, 1.01], BROAD)
    found, computed = tile(grids, distance)
    assert computed == int(ROW_NODES.sum()) * COLUMN_NODES
    assert_equal(found, every(grids, distance))


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("place", [0.3, 0.5, 0.93])
def test_a_kink_is_found_wherever_it_runs(place):
    grids = dense()
    at = place * (grids[0][0] + grids[0][-1]) + (1 - place) * (grids[1][0] + grids[1][-1])

    def kinked(p, q):
        return distance(p, q) + 1e-3 * np.maximum((p + q - at) @ np.array([3.0, 1.0]), 0.0)

    found, computed = tile(grids, kinked)
    assert_equal(found, every(grids, kinked), 20 * ERROR)
    assert computed < PLACES


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize(("rows", "columns"), [(TALL, 100), (5, BROAD), (1, 1), (3, SHORT + 3), (TALL, 7)])
def test_tiles_at_the_edge_of_a_grid_have_all_their_candidates(rows, columns):
    grids = tuple(grid[:n] for grid, n in zip(dense(), (rows, columns), strict=True))
    found, computed = tile(grids, distance)
    assert_equal(found, every(grids, distance))
    # 100 are 64, 32, and four that are priced one by one
    parts = [BROAD >> level for level in range(LEVELS) if columns & (BROAD >> level)]
    left = -(-(columns - sum(parts)) // WIDE) * WIDE
    assert computed == (FEWEST if rows == TALL else rows) * COLUMN_NODES * len(parts) + rows * left


@pytest.mark.usefixtures("in_python")
def test_grids_with_corners_and_arcs_and_parts_of_grids():
    t = np.linspace(0, 0.05, BROAD)
    arc = 1.5 * np.stack([np.cos(t), np.sin(t)], axis=1)
    corner = np.concatenate([line([1, 1], [1, 1.02], 90), line([1.0005, 1.02], [1.02, 1.02], 38)])
    for second, most in ((arc, FEWEST * COLUMN_NODES), (corner, PLACES // 3)):
        found, computed = tile((dense()[0], second), distance)
        assert_equal(found, every((dense()[0], second), distance))
        assert computed <= most
    chosen = np.arange(TALL) * 37 // TALL, np.arange(BROAD) * 200 // BROAD
    whole = line([0, 0], [0.01, 0.005], 37), line([0.2, 1], [0.22, 1.01], 200)
    grids = whole[0][chosen[0]], whole[1][chosen[1]]
    found, computed = tile(grids, distance, chosen)
    assert computed == FEWEST * COLUMN_NODES
    assert_equal(found, every(grids, distance))


def test_parts_are_smooth_whose_places_are_polynomials():
    rng = np.random.default_rng(2)
    straight, numbers = line([3, 4], [5, -2], 3 * TALL + 5), np.arange(3 * TALL + 5)
    assert smooth_parts(straight, numbers, TALL, ROW_NODE[0, :FEWEST]).tolist() == [1, 1, 1]
    bent = straight.copy()
    bent[TALL + 3 :, 0] += 1e-9
    assert smooth_parts(bent, numbers, TALL, ROW_NODE[0, :FEWEST]).tolist() == [1, 0, 1]
    spread = np.sort(rng.choice(10**6, 3 * TALL, replace=False))
    assert smooth_parts(straight[0] + spread[:, None] * [1e-6, 2e-6], spread, TALL, ROW_NODE[0, :FEWEST]).all()
    assert not smooth_parts(
        straight[0] + spread[:, None] * [1e-6, 2e-6], np.arange(3 * TALL), TALL, ROW_NODE[0, :FEWEST]
    ).any()
    assert not smooth_parts(rng.normal(size=(200, 3)), np.arange(200), BROAD, COLUMN_NODE[0]).any()


@pytest.mark.usefixtures("in_python")
def test_lengths_of_a_tile():
    first, second = np.random.default_rng(1).normal(size=(3, 20)), np.random.default_rng(2).normal(size=(3, 270))
    for i, j in ((0, 0), (1, 2)):
        length = np.zeros(PLACES)
        fill_lengths(first, second, i, j, length)
        own, other = first[:, i * TALL :][:, :TALL], second[:, j * BROAD :][:, :BROAD]
        wanted = np.linalg.norm(own[:, :, None] - other[:, None, :], axis=0)
        got = length.reshape(TALL, BROAD)[: own.shape[1], : other.shape[1]]
        assert np.abs(got - wanted).max() <= 1e-15 * 8
