"""The subproblem's solution satisfies the optimality conditions, whatever its rows."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.problem import LinearRows
from mdstopo.optimizer.subproblem import solve
from tests.tiers import examples

POWERS = [1.0, 0.9, 0.5, 0.0, -1.0, -2.0]


def random_model(rng, n, n_obj, n_con, power, kappa, sign_rule=False):
    x = rng.uniform(0.2, 0.8, n)
    slopes = rng.normal(size=(n_obj + n_con, n)) * rng.uniform(0.0, 2.0, n)
    values = np.r_[rng.uniform(1.0, 1.1, n_obj), rng.uniform(-0.5, 0.5, n_con)]
    return Approximation(
        x,
        rng.uniform(0.5, 2.0, n),
        rng.uniform(0.5, 2.0, n),
        values,
        slopes,
        n_obj,
        power,
        sign_rule,
        np.full(n, kappa),
    )


def jacobian(model, x):
    """The rows' derivatives from their formula, written out independently of the solver."""
    below, above = model.x - model.below, model.x + model.above
    falling = ((x - below) / (model.x - below)) ** (model.power - 1)
    rising = ((x - above) / (model.x - above)) ** (model.power - 1) if not model.linear_above else np.ones_like(x)
    return np.where(model.slopes < 0, model.slopes * falling, model.slopes * rising)


def residuals(model, lower, upper, linear, penalty, found):
    """Projected stationarity, row complementarity and multiplier sums, relative to the largest slope."""
    x, y, lam = found.x, found.multipliers, found.linear_multipliers
    n_obj = model.n_objective
    J = jacobian(model, x)
    gradient = J.T @ y + linear.A.T @ lam + model.kappa * (x - model.x)
    size = np.abs(model.slopes).max()
    stationarity = np.abs(x - np.clip(x - gradient / size, lower, upper)).max()
    rows = model.rows(x)
    gap = np.abs(y[:n_obj] * (rows[:n_obj].max() - rows[:n_obj])).max(initial=0.0) / size
    c = rows[n_obj:]
    held = np.abs(np.where(c < 0, y[n_obj:] * c, np.minimum(c, penalty - y[n_obj:]))).max(initial=0.0) / size
    slack = np.abs(np.where(linear.equal, 0, lam * linear.excess(x))).max(initial=0.0) / size
    return {
        "stationarity": stationarity,
        "gap": gap,
        "held": held,
        "slack": slack,
        "sum": abs(y[:n_obj].sum() - 1),
    }


@pytest.mark.parametrize("power", POWERS)
@pytest.mark.parametrize(
    ("n_obj", "n_con", "m", "kappa"), [(1, 0, 1, 0.0), (1, 0, 1, 0.3), (3, 0, 1, 0.1), (4, 2, 3, 0.1)]
)
def test_optimality_conditions_hold_to_rounding(power, n_obj, n_con, m, kappa):
    rng = np.random.default_rng([n_obj, n_con, m, int(100 * (power + 3))])
    n = 60
    model = random_model(rng, n, n_obj, n_con, power, kappa)
    lower, upper = np.maximum(model.x - 0.3, 0.05), np.minimum(model.x + 0.3, 1.0)
    A = rng.uniform(0.0, 1.0, (m, n))
    linear = LinearRows(A, A @ model.x + np.r_[0.0, rng.uniform(0, 0.3, m - 1)], np.arange(m) == 0)
    penalty = np.full(n_con, 3.0)
    found = solve(model, lower, upper, linear, penalty)
    assert found.converged
    assert np.all(found.x >= lower)
    assert np.all(found.x <= upper)
    excess = linear.excess(found.x)
    assert abs(excess[0]) < 1e-13 * n
    assert excess.max() < 1e-13 * n
    assert np.all(found.multipliers >= 0)
    assert np.all(found.linear_multipliers[1:] >= 0)
    if n_con:
        assert np.all(found.multipliers[n_obj:] <= penalty * (1 + 1e-9))
    for name, value in residuals(model, lower, upper, linear, penalty, found).items():
        assert value < 2e-8, name


@hypothesis_settings(max_examples=examples(20, 60), deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 12),
    n_obj=st.integers(1, 4),
    m=st.integers(0, 3),
    power=st.sampled_from(POWERS),
    sign_rule=st.booleans(),
)
def test_no_feasible_design_beats_the_solution(seed, n, n_obj, m, power, sign_rule):
    """The problem is convex: no feasible point found at random may lie below the solution."""
    rng = np.random.default_rng(seed)
    model = random_model(rng, n, n_obj, 0, power, 0.05, sign_rule)
    lower, upper = np.maximum(model.x - 0.3, 0.05), np.minimum(model.x + 0.3, 1.0)
    A = rng.uniform(0.0, 1.0, (m, n)) * (rng.uniform(size=(m, n)) < 0.7)
    linear = LinearRows(A, A @ model.x, np.zeros(m, dtype=bool))
    found = solve(model, lower, upper, linear, np.zeros(0))
    best = model.model(found.x)[0]
    others = rng.uniform(lower, upper, (200, n))
    for other in others:
        shrink = 1.0
        while linear.excess(model.x + shrink * (other - model.x)).max(initial=0.0) > 0 and shrink > 1e-3:
            shrink *= 0.7
        candidate = model.x + shrink * (other - model.x)
        if linear.excess(candidate).max(initial=0.0) <= 0:
            assert model.model(candidate)[0] >= best - 1e-9


@pytest.mark.parametrize("power", POWERS)
def test_every_row_of_the_approximation_is_convex_and_first_order_exact(power):
    rng = np.random.default_rng(5)
    model = random_model(rng, 8, 3, 0, power, 0.0)
    np.testing.assert_allclose(model.rows(model.x), model.values, rtol=1e-14)
    a, b = rng.uniform(-0.3, 0.3, (2, 50, 8)) + model.x
    for u, v in zip(a, b, strict=True):
        middle = model.rows(0.5 * (u + v))
        assert np.all(middle <= 0.5 * (model.rows(u) + model.rows(v)) + 1e-13)
    for i in range(8):
        step = np.zeros(8)
        step[i] = 1e-6
        slope = (model.rows(model.x + step) - model.rows(model.x - step)) / 2e-6
        np.testing.assert_allclose(slope, model.slopes[:, i], atol=1e-8)


def test_tied_identical_rows_share_their_multiplier():
    rng = np.random.default_rng(2)
    model = random_model(rng, 20, 1, 0, 0.8, 0.1)
    twice = Approximation(
        model.x,
        model.below,
        model.above,
        np.repeat(model.values, 2),
        np.repeat(model.slopes, 2, axis=0),
        2,
        model.power,
        False,
        model.kappa,
    )
    lower, upper = model.x - 0.1, model.x + 0.1
    none = LinearRows.none(20)
    one, two = (solve(m, lower, upper, none, np.zeros(0)) for m in (model, twice))
    np.testing.assert_allclose(one.x, two.x, atol=1e-9)
    assert two.multipliers.sum() == pytest.approx(1.0, abs=1e-10)


def test_redundant_rows_change_nothing():
    rng = np.random.default_rng(3)
    model = random_model(rng, 30, 2, 0, 0.8, 0.1)
    lower, upper = model.x - 0.1, model.x + 0.1
    A = rng.uniform(0, 1, (1, 30))
    b = A @ model.x
    single = solve(model, lower, upper, LinearRows(A, b, np.array([True])), np.zeros(0))
    stacked = LinearRows(
        np.r_[A, 2 * A, np.zeros((1, 30)), A],
        np.r_[b, 2 * b, 0.0, b + 5.0],
        np.array([True, True, True, False]),
    )
    many = solve(model, lower, upper, stacked, np.zeros(0))
    assert many.converged
    np.testing.assert_allclose(many.x, single.x, atol=1e-8)


def test_a_row_with_zero_coefficients_leaves_its_variables_free_of_it():
    model = Approximation(
        np.full(4, 0.5),
        np.ones(4),
        np.ones(4),
        np.ones(1),
        np.array([[-1.0, -2.0, -1.0, 1.0]]),
        1,
        0.8,
        False,
        np.full(4, 0.01),
    )
    linear = LinearRows(np.array([[1.0, 1.0, 0.0, 0.0]]), np.array([1.0]), np.array([False]))
    found = solve(model, np.full(4, 0.3), np.full(4, 0.7), linear, np.zeros(0))
    np.testing.assert_allclose(found.x, [0.3, 0.7, 0.7, 0.3], atol=1e-9)


def test_fixed_variables_stay_and_all_fixed_is_solved():
    rng = np.random.default_rng(4)
    model = random_model(rng, 10, 2, 0, 0.8, 0.1)
    lower, upper = model.x - 0.1, model.x + 0.1
    lower[:5] = upper[:5] = model.x[:5]
    linear = LinearRows(np.ones((1, 10)), np.array([model.x.sum()]), np.array([True]))
    found = solve(model, lower, upper, linear, np.zeros(0))
    assert np.array_equal(found.x[:5], model.x[:5])
    assert not np.array_equal(found.x[5:], model.x[5:])
    still = solve(model, model.x, model.x, linear, np.zeros(0))
    assert np.array_equal(still.x, model.x)
    assert still.converged


def test_zero_gradient_moves_nothing():
    zero = Approximation(
        np.full(5, 0.4), np.ones(5), np.ones(5), np.ones(2), np.zeros((2, 5)), 2, 0.8, False, np.full(5, 0.1)
    )
    found = solve(zero, np.zeros(5), np.ones(5), LinearRows.none(5), np.zeros(0))
    np.testing.assert_allclose(found.x, 0.4, atol=1e-6)


def test_many_variables_are_solved_in_bounded_memory():
    import tracemalloc

    n = 200_000
    rng = np.random.default_rng(6)
    model = random_model(rng, n, 4, 0, 0.9, 0.1)
    lower, upper = np.maximum(model.x - 0.2, 0.01), np.minimum(model.x + 0.2, 1.0)
    linear = LinearRows(np.ones((1, n)), np.array([model.x.sum()]), np.array([True]))
    solve(random_model(rng, 5, 4, 0, 0.9, 0.1), np.zeros(5), np.ones(5), LinearRows.none(5), np.zeros(0))
    tracemalloc.start()
    found = solve(model, lower, upper, linear, np.zeros(0))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found.converged
    assert peak < 60 * 8 * n
