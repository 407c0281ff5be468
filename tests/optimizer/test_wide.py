"""The step of many variables against the interior point, and what it promises."""

import numpy as np
import pytest

from mdstopo.native.threads import VARIABLE
from mdstopo.optimizer import driver, wide
from mdstopo.optimizer.driver import Gsao
from mdstopo.optimizer.powers import powers
from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.safeguards import next_shift

N = 12_000
SIZES = [wide.MANY, 1_020, N]


class Many:
    """A sum of reciprocal and rising terms over a volume row."""

    def __init__(self, seed: int, equal: bool, n: int = N) -> None:
        rng = np.random.default_rng(seed)
        self.falling = np.exp(rng.normal(-1.0, 2.0, n))
        self.rising = np.where(rng.random(n) < 0.3, np.exp(rng.normal(0.0, 1.0, n)), 0.0)
        self.initial = np.full(n, 0.3)
        self.lower = np.where(rng.random(n) < 0.1, 0.3, 1e-3)
        self.upper = np.where(rng.random(n) < 0.1, 0.3, 1.0)
        cost = np.where(rng.random(n) < 0.1, 0.0, rng.uniform(0.5, 2.0, n))
        self.linear = LinearRows(cost[None], np.array([0.3 * cost.sum()]), np.array([equal]))

    def evaluate(self, x, gradient=True):
        terms = self.falling / (x + 0.1) + self.rising * x
        slope = -self.falling / (x + 0.1) ** 2 + self.rising
        value = np.array([terms.sum()])
        return Sample(float(value[0]), value, slope[None], np.zeros(0), np.zeros((0, len(x))))


def states(problem, steps, monkeypatch=None, **options):
    if monkeypatch is not None:
        monkeypatch.setattr(wide, "MANY", 10**9)
        for module in (driver, wide):
            monkeypatch.setattr(module, "WIDE", 10**9)
    optimizer = Gsao(problem, settings("default", options, max_iterations=100))
    found = [optimizer.start()]
    while found[-1].running and len(found) < steps:
        found.append(optimizer.step(found[-1]))
    return found


@pytest.mark.parametrize("equal", [False, True])
@pytest.mark.parametrize("options", [{}, {"power": -1.0}, {"power": 1.0}, {"move_limit": 0.05}, {"convex_start": 1.0}])
@pytest.mark.parametrize("n", SIZES)
def test_a_step_is_that_of_the_interior_point(n, equal, options, monkeypatch):
    problem = Many(1, equal, n)
    chosen = settings("default", options)
    for state in states(problem, 5, monkeypatch, **options):
        new = wide.propose(state, 0, problem.lower, problem.upper, problem.linear, chosen)
        size = abs(state.objective)
        assert new.predicted == pytest.approx(state.predicted, rel=1e-7, abs=1e-10 * size)
        assert new.predicted >= state.predicted - 1e-12 * size
        assert new.kkt == pytest.approx(state.kkt, rel=1e-5, abs=1e-8)
        assert np.abs(new.trial - state.trial).max() < 1e-3
        assert np.abs(new.trial - state.trial).mean() < 1e-6


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("equal", [False, True])
def test_the_row_holds_to_rounding_and_the_box_is_kept(n, equal):
    problem = Many(2, equal, n)
    for state in states(problem, 12):
        excess = float(problem.linear.excess(state.trial)[0])
        scale = 2.0 * float(problem.linear.b[0])
        assert excess <= 1e-14 * scale
        assert not equal or abs(excess) <= 1e-14 * scale
        assert np.all(state.trial >= problem.lower)
        assert np.all(state.trial <= problem.upper)


def test_the_same_state_gives_the_same_bits():
    problem = Many(3, True)
    one, other = states(problem, 5)[-1], states(problem, 5)[-1]
    assert np.array_equal(one.trial, other.trial)
    assert one.predicted == other.predicted
    assert one.kkt == other.kkt


def test_any_number_of_threads_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(wide, "SHARED", 1)
    found = []
    for threads in (1, 2, 3):
        monkeypatch.setenv(VARIABLE, str(threads))
        found.append(states(Many(3, True, 50_000), 6)[-1])
    one, *others = found
    for other in others:
        assert other.kkt == one.kkt
        assert other.predicted == one.predicted
        for name in ("trial", "alpha", "steps", "shift"):
            assert np.array_equal(getattr(other, name), getattr(one, name))


def test_a_row_that_is_far_from_its_limit_has_no_price():
    problem = Many(4, False)
    problem.linear = LinearRows(problem.linear.A, 100.0 * problem.linear.b, problem.linear.equal)
    state = states(problem, 2)[-1]
    moved = np.clip(state.trial, problem.lower, problem.upper)
    assert np.array_equal(moved, state.trial)
    assert state.predicted > 0.0
    # where nothing rises a variable goes to the end of its box
    falls = (problem.rising == 0.0) & (problem.upper > state.alpha)
    assert np.all(state.trial[falls] > state.alpha[falls])


def test_a_run_ends_where_the_interior_point_ends(monkeypatch):
    monkeypatch.setattr("mdstopo.optimizer.safeguards.CUT_TRUST", 0.0)  # with so many variables there are no cuts
    problem = Many(5, True)
    new = states(problem, 100)[-1]
    old = states(problem, 100, monkeypatch)[-1]
    assert new.status == old.status
    assert new.best_objective == pytest.approx(old.best_objective, rel=1e-6)


def test_shifts_and_steps_are_those_of_the_plain_rule():
    chosen = settings()
    state = states(Many(6, True), 5)[-1]
    steps, shifts = wide.adapt(state, chosen)
    assert np.array_equal(steps, np.stack([state.steps[1], state.trial - state.alpha]))
    assert np.array_equal(shifts, next_shift(state.shift, steps, chosen))


@pytest.mark.parametrize("exponent", [-6.0, -2.0, -0.1, 0.5, 1.0])
def test_powers_are_right_to_rounding(exponent):
    t = np.random.default_rng(0).uniform(0.05, 20.0, 500)
    out = np.empty_like(t)
    powers.py_func(t, exponent, out, np.empty((3, len(t)), dtype=np.int64))
    assert np.allclose(out, t**exponent, rtol=1e-14, atol=0.0)
