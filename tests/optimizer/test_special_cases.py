"""Each special case of GSAO against the textbook update it is named after, computed here independently."""

import numpy as np
import pytest
from scipy.optimize import brentq, linprog

from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.problem import LinearRows
from mdstopo.settings.optimizer_presets import settings

from .toys import Toy, volume


def wavy(n, seed):
    """A function with slopes of both signs and strong curvature."""
    rng = np.random.default_rng(seed)
    w, k, c = rng.uniform(0.1, 2.0, n), rng.uniform(-3.0, 3.0, n), rng.uniform(0.5, 2.0, n)

    def functions(x):
        return np.array([np.sum(w / (x + 0.2) + k * x + np.sin(c * x))]), (-w / (x + 0.2) ** 2 + k + c * np.cos(c * x))[
            None, :
        ]

    return functions


def first_steps(problem, preset, count, **overrides):
    """Iterates x_0 .. x_count of a preset, and the gradients there."""
    optimizer = Gsao(problem, settings(preset, overrides, max_iterations=100))
    state = optimizer.start()
    iterates, gradients = [state.alpha], [state.gradients[0]]
    for _ in range(count):
        state = optimizer.step(state)
        iterates.append(state.alpha)
        gradients.append(state.gradients[0])
    return iterates, gradients


@pytest.mark.parametrize("seed", range(4))
def test_oc_is_the_optimality_criteria_update(seed):
    n, bound = 40, 8.0
    rng = np.random.default_rng(seed)
    cost = rng.uniform(0.5, 1.5, n)
    initial = np.full(n, bound / cost.sum())
    problem = Toy(wavy(n, seed), initial, 1e-3, 1.0, volume(n, bound, True, cost))
    iterates, gradients = first_steps(problem, "oc", 6)
    for x, slope, following in zip(iterates[:-1], gradients[:-1], iterates[1:], strict=True):
        low, high = np.maximum(1e-3, x - 0.2), np.minimum(1.0, x + 0.2)

        def update(multiplier, x=x, slope=slope, low=low, high=high):
            return np.clip(x * np.sqrt(np.maximum(-slope, 0.0) / (multiplier * cost)), low, high)

        a, b = 1e-12, 1e12
        for _ in range(300):
            middle = np.sqrt(a * b)
            a, b = (middle, b) if cost @ update(middle) > bound else (a, middle)
        np.testing.assert_allclose(following, update(a), rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_mma_is_svanberg_1987(seed):
    """Asymptotes, move limits and terms of the 1987 paper, the linear row kept linear; dual by Brent."""
    n, bound, s = 25, 8.0, 0.7
    problem = Toy(wavy(n, seed), np.full(n, bound / n), 1e-3, 1.0, volume(n, bound, True))
    iterates, gradients = first_steps(problem, "mma", 6)
    width = np.full(n, 1.0 - 1e-3)
    for k in range(6):
        x, slope = iterates[k], gradients[k]
        if k < 2:
            low_asymptote, high_asymptote = x - width, x + width
        else:
            trend = (x - iterates[k - 1]) * (iterates[k - 1] - iterates[k - 2])
            factor = np.where(trend > 0, 1 / s, np.where(trend < 0, s, 1.0))
            below = np.clip(factor * (iterates[k - 1] - low_asymptote), 0.01 * width, 10 * width)
            above = np.clip(factor * (high_asymptote - iterates[k - 1]), 0.01 * width, 10 * width)
            low_asymptote, high_asymptote = x - below, x + above
        p = (high_asymptote - x) ** 2 * np.maximum(slope, 0.0)
        q = (x - low_asymptote) ** 2 * np.maximum(-slope, 0.0)
        low = np.maximum(1e-3, 0.9 * low_asymptote + 0.1 * x)
        high = np.minimum(1.0, 0.9 * high_asymptote + 0.1 * x)

        def minimiser(multiplier, p=p, q=q, L=low_asymptote, U=high_asymptote, low=low, high=high):
            def derivative(t):
                return p / (U - t) ** 2 - q / (t - L) ** 2 + multiplier

            a, b = low.copy(), high.copy()
            for _ in range(60):
                t = 0.5 * (a + b)
                up = derivative(t) > 0.0
                a, b = np.where(up, a, t), np.where(up, t, b)
            return 0.5 * (a + b)

        multiplier = brentq(lambda m, f=minimiser: f(m).sum() - bound, -1e3, 1e3, xtol=1e-14, rtol=1e-14)
        np.testing.assert_allclose(iterates[k + 1], minimiser(multiplier), rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_conlin_is_reciprocal_where_the_function_falls_and_linear_where_it_rises(seed):
    n, bound = 30, 9.0
    problem = Toy(wavy(n, seed), np.full(n, bound / n), 0.05, 1.0, volume(n, bound))
    iterates, gradients = first_steps(problem, "conlin", 1)
    x, slope, following = iterates[0], gradients[0], iterates[1]

    def update(multiplier):
        with np.errstate(divide="ignore"):
            falling = x * np.sqrt(np.maximum(-slope, 0.0) / multiplier)
        return np.clip(np.where(slope < 0.0, falling, np.where(slope + multiplier > 0.0, 0.05, 1.0)), 0.05, 1.0)

    a, b = 1e-12, 1e12
    for _ in range(300):
        middle = np.sqrt(a * b)
        a, b = (middle, b) if update(middle).sum() > bound else (a, middle)
    np.testing.assert_allclose(following, update(b), rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_slp_solves_the_linear_programme(seed):
    """Several peaks, several volume rows, trust box: against HiGHS."""
    rng = np.random.default_rng(seed)
    n, r = 15, 3
    values, slopes = rng.uniform(1.0, 1.05, r), rng.normal(size=(r, n))
    values[::-1].sort()
    A = rng.uniform(0.2, 1.0, (2, n))
    x0 = np.full(n, 0.4)
    linear = LinearRows(A, A @ x0 + np.array([0.0, 0.1]), np.array([True, False]))

    def functions(x):
        return values + slopes @ (x - x0), slopes

    problem = Toy(functions, x0, 0.0, 1.0, linear)
    state = Gsao(problem, settings("slp")).start()
    cost = np.r_[np.zeros(n), 1.0]
    rows = np.c_[np.r_[slopes, A[1:]], np.r_[-np.ones(r), 0.0]]
    right = np.r_[slopes @ x0 - values, linear.b[1]]
    box = [(0.2, 0.6)] * n + [(None, None)]
    best = linprog(cost, rows, right, np.r_[A[0], 0.0][None, :], linear.b[:1], box)
    promised = np.max(values + slopes @ (state.trial - x0))
    assert promised == pytest.approx(best.fun, abs=1e-9)
    np.testing.assert_allclose(state.trial, best.x[:n], atol=1e-7)


def test_slp_with_one_peak_and_one_row_fills_up_the_steepest():
    slopes = np.array([-3.0, -1.0, -2.0, 1.0])
    problem = Toy(lambda x: (np.array([slopes @ x]), slopes[None, :]), np.full(4, 0.5), 0.0, 1.0, volume(4, 2.0, True))
    state = Gsao(problem, settings("slp", {"trust_start": 0.4})).start()
    np.testing.assert_allclose(state.trial, [0.9, 0.1, 0.9, 0.1], atol=1e-12)
