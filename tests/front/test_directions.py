"""Weights and anchors as the user writes them."""

import numpy as np
import pytest

from mdstopo.front.directions import lattice, parse_range, weights_of_first


def test_a_range_is_inclusive_and_even_to_rounding():
    values = parse_range("0:1:0.05")
    assert len(values) == 21
    assert values == np.linspace(0, 1, 21).tolist()
    assert parse_range("1:0:-0.5") == [1.0, 0.5, 0.0]
    assert parse_range("0.3:0.3:1") == [0.3]
    assert parse_range("0,0.1,0.5") == [0.0, 0.1, 0.5]
    assert parse_range("2") == [2.0]


@pytest.mark.parametrize("text", ["0:1", "0:1:0", "0:1:-0.1", "a:b:c", "0:1:0.3", "", "0,,1", "0:1:1e-9", "nan,1"])
def test_what_is_no_range_is_refused_with_what_was_found(text):
    with pytest.raises(ValueError, match=r"step|allowed|finite") as caught:
        parse_range(text)
    assert repr(text) in str(caught.value)


def test_weights_of_two_objectives_sum_to_one():
    weights = weights_of_first([0.0, 0.25, 1.0])
    assert weights.tolist() == [[0.0, 1.0], [0.25, 0.75], [1.0, 0.0]]
    with pytest.raises(ValueError, match=r"1\.2 is not between"):
        weights_of_first([0.0, 1.2])
    with pytest.raises(ValueError, match="twice"):
        weights_of_first([0.5, 0.5])


@pytest.mark.parametrize(("m", "points", "count"), [(2, 21, 21), (3, 10, 10), (3, 11, 15), (4, 5, 10)])
def test_a_lattice_covers_the_simplex_evenly_with_its_corners(m, points, count):
    rows = lattice(m, points)
    assert rows.shape == (count, m)
    assert np.abs(rows.sum(axis=1) - 1.0).max() <= 1e-15
    assert (rows >= 0.0).all()
    assert len({tuple(row) for row in rows.tolist()}) == count
    for i in range(m):
        assert (rows == np.eye(m)[i]).all(axis=1).any()


def test_fewer_points_than_objectives_are_no_front():
    with pytest.raises(ValueError, match="at least 3 points"):
        lattice(3, 2)
    with pytest.raises(ValueError, match="two objectives"):
        lattice(1, 5)
