"""What is told of estimates, beside closed forms: straight lines need no motion."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import optimize, stats

from mdstopo.case.methods.losses import LOSSES
from mdstopo.case.sections.measurements import Measured
from mdstopo.fit.least_squares import Minimum, deviation_of
from mdstopo.fit.loss_functions import for_scipy, loss
from mdstopo.fit.statistics import statistics


def line(x: np.ndarray, y: np.ndarray, deviation: float | None, extra: np.ndarray | None = None) -> tuple[Any, Minimum]:
    """A straight line through points by least squares, as a problem and its minimum; extra: a third column."""
    columns = [np.ones_like(x), x] + ([] if extra is None else [extra])
    slopes = np.stack(columns, axis=1)
    found = np.linalg.lstsq(slopes, y, rcond=None)[0]
    p = len(found)
    misfit = slopes @ found - y
    sigma = deviation if deviation is not None else float(np.sqrt(np.sum(misfit**2) / (len(x) - p)))
    measured = [Measured(SimpleNamespace(), x, y, None if deviation is None else np.full(len(x), deviation))]  # type: ignore[arg-type]
    problem = SimpleNamespace(
        names=("a", "b", "c")[:p], lower=np.full(p, -10.0), upper=np.full(p, 10.0), count=len(x), measured=measured,
        fit=SimpleNamespace(loss="linear", confidence=0.95), parts=[slice(0, len(x))],
    )  # fmt: skip
    return problem, Minimum(found, misfit, slopes, np.full(len(x), sigma), 0.0, 0.0, "converged", "", 1)


def test_intervals_of_a_straight_line_are_those_of_regression() -> None:
    random = np.random.default_rng(1)
    x = np.linspace(0.0, 3.0, 12)
    y = 1.0 + 2.0 * x + 0.1 * random.normal(size=12)
    problem, found = line(x, y, None)
    told = statistics(problem, found)
    known = stats.linregress(x, y)
    assert told.deviation[1] == pytest.approx(known.stderr, rel=1e-10)
    assert told.deviation[0] == pytest.approx(known.intercept_stderr, rel=1e-10)
    half = stats.t.ppf(0.975, 10) * known.stderr
    assert told.high[1] - told.low[1] == pytest.approx(2.0 * half, rel=1e-10)
    mean, square = x.mean(), np.mean(x**2)
    assert told.correlation[0, 1] == pytest.approx(-mean / np.sqrt(square), rel=1e-10)
    assert told.directions == []


def test_with_known_deviations_residuals_do_not_widen_the_interval() -> None:
    x = np.linspace(0.0, 3.0, 12)
    problem, found = line(x, 1.0 + 2.0 * x, 0.1)
    told = statistics(problem, found)
    assert told.deviation[1] == pytest.approx(0.1 / np.sqrt(12 * np.var(x)), rel=1e-10)
    assert told.factor == pytest.approx(stats.norm.ppf(0.975), rel=1e-12)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_an_estimate_is_held_by_a_bound_only_where_the_cost_falls_beyond_it(side: float) -> None:
    x = np.linspace(0.0, 3.0, 12)
    y = 1.0 + 2.0 * x
    problem, found = line(x, y, 0.1)
    bounds = problem.upper if side > 0.0 else problem.lower
    bounds[1] = found.x[1]
    # the measured values ask for a slope beyond the bound, then for one within it
    beyond = replace(found, misfit=found.misfit - side * 0.01 * x)
    assert statistics(problem, beyond).at_bound[1] == side
    within = replace(found, misfit=found.misfit + side * 0.01 * x)
    assert statistics(problem, within).at_bound[1] == 0.0


@pytest.mark.parametrize("name", ["linear", "huber"])
def test_an_estimated_deviation_is_that_of_the_errors_though_the_fit_has_followed_some_of_them(name: str) -> None:
    random = np.random.default_rng(3)
    n, p = 60, 20
    slopes = random.normal(size=(n, p))
    rest = np.eye(n) - slopes @ np.linalg.pinv(slopes)
    problem: Any = SimpleNamespace(names=range(p), count=n, fit=SimpleNamespace(loss=name))
    sizes = [deviation_of(problem, rest @ random.normal(size=n), np.ones(n)) for _ in range(1000)]
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.03)


def test_a_column_that_is_another_ones_multiple_leaves_the_third_known() -> None:
    x = np.linspace(0.0, 3.0, 12)
    problem, found = line(x, 1.0 + 2.0 * x, 0.1, extra=2.0 * x)
    told = statistics(problem, found)
    (direction,) = told.directions
    assert direction.is_unknown
    assert direction.shares["b"] / direction.shares["c"] == pytest.approx(-2.0, rel=1e-9)
    assert set(direction.shares) == {"b", "c"}
    assert np.isnan(told.deviation[1:]).all()
    mean, square = x.mean(), np.mean(x**2)
    assert told.deviation[0] == pytest.approx(0.1 * np.sqrt(square / (12 * (square - mean**2))), rel=1e-6)


def test_a_direction_that_the_data_hardly_tell_is_named_and_keeps_its_wide_interval() -> None:
    x = np.linspace(0.0, 3.0, 12)
    problem, found = line(x, 1.0 + 2.0 * x, 500.0)
    told = statistics(problem, found)
    values = np.linalg.svd(found.slopes * 20.0 / 500.0, compute_uv=False)
    assert values[0] < 1.0
    assert [each.change for each in told.directions] == pytest.approx(values[::-1], rel=1e-9)
    assert not any(each.is_unknown for each in told.directions)
    assert told.deviation[1] == pytest.approx(500.0 / np.sqrt(12 * np.var(x)), rel=1e-9)


@pytest.mark.parametrize("name", LOSSES)
def test_influence_and_its_slope_are_the_derivatives_of_a_loss(name: str) -> None:
    r = np.array([-3.1, -1.4, -0.6, 0.0, 0.3, 0.9, 1.2, 4.0])
    h = 1e-5
    rho, influence, slope = loss(name, r)
    up, down = loss(name, r + h), loss(name, r - h)
    np.testing.assert_allclose(influence, (up[0] - down[0]) / (4.0 * h), atol=1e-9)
    np.testing.assert_allclose(slope, (up[1] - down[1]) / (2.0 * h), atol=1e-9)
    assert np.all(rho >= 0.0)


@pytest.mark.parametrize("name", LOSSES)
def test_a_loss_of_squares_as_scipy_takes_it_has_its_derivatives(name: str) -> None:
    found = for_scipy(name)
    if isinstance(found, str):
        assert not LOSSES[name].is_robust
        return
    z = np.array([0.0, 0.04, 0.5, 1.7, 9.0])
    rho, first, second = found(z)
    np.testing.assert_allclose(rho, loss(name, np.sqrt(z))[0])
    assert np.all(np.isfinite(second))
    inside, h = z[1:], 1e-5
    up, down = found(inside + h), found(inside - h)
    np.testing.assert_allclose(first[1:], (up[0] - down[0]) / (2.0 * h), atol=1e-8)
    np.testing.assert_allclose(second[1:], (up[1] - down[1]) / (2.0 * h), atol=1e-8)


@pytest.mark.parametrize("name", ["huber", "soft_l1", "cauchy"])
def test_a_line_with_outliers_is_fitted_as_by_scipys_loss_of_that_name(name: str) -> None:
    x = np.linspace(0.0, 3.0, 12)
    y = 1.0 + 2.0 * x + 0.1 * np.sin(9.0 * x)
    y[[3, 8]] += 4.0
    ours, theirs = (
        optimize.least_squares(lambda p: p[0] + p[1] * x - y, [0.0, 0.0], loss=each, xtol=1e-12)
        for each in (for_scipy(name), name)
    )
    np.testing.assert_allclose(ours.x, theirs.x, rtol=1e-7)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-12)
