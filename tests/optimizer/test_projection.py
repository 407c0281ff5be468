"""The projection is the nearest feasible design."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from mdstopo.optimizer.nearest_feasible import InfeasibleRows, project, satisfied
from mdstopo.optimizer.problem import LinearRows
from tests.tiers import examples

from .toys import volume


@hypothesis_settings(max_examples=examples(40, 100), deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 40), equal=st.booleans(), mixed=st.booleans())
def test_one_row_agrees_with_bisection(seed, n, equal, mixed):
    rng = np.random.default_rng(seed)
    a = rng.uniform(-1 if mixed else 0.1, 1, n)
    lower, upper = rng.uniform(0, 0.3, n), rng.uniform(0.5, 1, n)
    inside = rng.uniform(lower, upper)
    x = rng.normal(size=n)
    b = a @ inside
    found = project(x, lower, upper, volume(n, b, equal, a))
    clipped = np.clip(x, lower, upper)
    if not equal and a @ clipped <= b:
        expected = clipped
    else:
        low, high = -1e3, 1e3
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if a @ np.clip(x - middle * a, lower, upper) > b else (low, middle)
        expected = np.clip(x - high * a, lower, upper)
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.all(found >= lower)
    assert np.all(found <= upper)
    assert satisfied(found, volume(n, b, equal, a))


@pytest.mark.parametrize("seed", range(6))
def test_several_rows_agree_with_a_quadratic_programme(seed):
    rng = np.random.default_rng(seed)
    n = 12
    A = rng.uniform(0, 1, (3, n)) * (rng.uniform(size=(3, n)) < 0.6)
    inside = rng.uniform(0.2, 0.8, n)
    linear = LinearRows(A, A @ inside - np.array([0.0, 0.3, 0.0]), np.array([True, False, False]))
    x = rng.uniform(0, 1.5, n)
    found = project(x, np.zeros(n), np.ones(n), linear)
    constraints = [
        {"type": "eq" if e else "ineq", "fun": lambda t, r=r, c=c: c - r @ t, "jac": lambda t, r=r: -r}
        for r, c, e in zip(A, linear.b, linear.equal, strict=True)
    ]
    best = minimize(
        lambda t: 0.5 * np.sum((t - x) ** 2),
        inside,
        jac=lambda t: t - x,
        bounds=[(0, 1)] * n,
        constraints=constraints,
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    np.testing.assert_allclose(found, best.x, atol=1e-6)
    assert satisfied(found, linear, 1e-13)


def test_a_feasible_design_stays_to_the_bit():
    x = np.array([0.1, 0.2, 0.3])
    assert np.array_equal(project(x, np.zeros(3), np.ones(3), volume(3, 1.0)), x)


def test_fixed_variables_and_empty_rows_are_no_trouble():
    lower, upper = np.array([0.5, 0.0, 0.0]), np.array([0.5, 1.0, 1.0])
    linear = LinearRows(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0]]), np.array([1.5, 0.0]), np.array([True, True]))
    np.testing.assert_allclose(project(np.zeros(3), lower, upper, linear), [0.5, 0.5, 0.5], atol=1e-12)


@pytest.mark.parametrize("bound", [-1.0, 4.0])
def test_rows_that_no_design_satisfies_are_named(bound):
    with pytest.raises(InfeasibleRows, match="volume row"):
        project(np.full(3, 0.5), np.zeros(3), np.ones(3), volume(3, bound, True))


def test_rows_that_contradict_one_another_are_named():
    linear = LinearRows(np.ones((2, 3)), np.array([1.0, 2.0]), np.array([True, True]))
    with pytest.raises(InfeasibleRows):
        project(np.full(3, 0.5), np.zeros(3), np.ones(3), linear)


@pytest.mark.parametrize(("slope", "least"), [(0.25, 2.95), (1.0, 2.75), (0.5, 2.5), (0.5, 1.25)])
def test_rows_that_are_out_of_reach_are_refused_without_an_overflow(slope, least):
    """x is at least 1.25 or more by its row, and at most 1 by its bound: multipliers grew until they overflowed."""
    rows = LinearRows(np.array([[slope, 1], [-slope, -1]]), np.array([5, -least * slope]), np.zeros(2, dtype=np.bool_))
    lower, upper = np.array([0.8, 0.0]), np.array([1.0, 0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InfeasibleRows):
            project(np.array([1.0, 0.0]), lower, upper, rows)
