"""Banded elimination with pivoting."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.integrators.banded import factorise, half_width, solve
from tests.tiers import examples


@settings(max_examples=examples(15, 40), deadline=None)
@given(st.integers(1, 14), st.integers(0, 6), st.integers(0, 10_000))
def test_solves_what_dense_elimination_solves(n, half, seed):
    rng = np.random.default_rng(seed)
    gap = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    dense = np.where(gap <= half, rng.standard_normal((n, n)), 0.0)
    b = rng.standard_normal(n)
    if np.linalg.cond(dense) > 1e8:
        return
    band, pivots, x = np.zeros((n, 3 * half + 1)), np.zeros(n, np.int64), b.copy()
    for i in range(n):
        for j in range(max(0, i - half), min(n, i + half + 1)):
            band[i, j - i + half] = dense[i, j]
    assert factorise.py_func(band, half, pivots)
    solve.py_func(band, half, pivots, x)
    assert np.allclose(x, np.linalg.solve(dense, b), rtol=1e-7, atol=1e-7 * np.abs(x).max())


def test_a_singular_matrix_is_said_to_be_singular():
    band, pivots = np.zeros((2, 4)), np.zeros(2, np.int64)
    assert not factorise.py_func(band, 1, pivots)


def test_bodies_that_are_held_do_not_widen_the_band():
    inv_mass = np.array([1.0] * 9 + [0.0] * 3)
    chain = np.array([[0, 1], [1, 2], [0, 3], [2, 3]])
    assert half_width.py_func(chain, inv_mass) == 5
