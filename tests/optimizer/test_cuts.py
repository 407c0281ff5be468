"""What rejected trials have shown is not forgotten: many pieces that compete, few of which are seen at a time."""

import numpy as np
import pytest
from scipy.optimize import linprog

from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import Floats, LinearRows, Sample
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus


class Pieces:
    """max_j (a_j . x + b_j), of which a sample shows the highest `seen`."""

    def __init__(self, count: int, n: int, seen: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.a, self.b = rng.normal(size=(count, n)), rng.uniform(1.0, 1.2, count)
        self.seen = seen
        self.initial, self.lower, self.upper = np.full(n, 0.5), np.zeros(n), np.ones(n)
        self.linear = LinearRows(np.ones((1, n)), np.array([0.5 * n]), np.array([True]))

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        values = self.a @ x + self.b
        order = np.argsort(-values, kind="stable")[: self.seen]
        none = np.zeros((0, len(x)))
        return Sample(float(values.max()), values[order], self.a[order], np.zeros(0), none)

    @property
    def least(self) -> float:
        """The minimum, by linear programming."""
        count, n = self.a.shape
        found = linprog(
            np.r_[np.zeros(n), 1.0],
            A_ub=np.c_[self.a, -np.ones(count)],
            b_ub=-self.b,
            A_eq=np.r_[np.ones(n), 0.0][None],
            b_eq=[0.5 * n],
            bounds=[*((0.0, 1.0) for _ in range(n)), (None, None)],
        )
        return float(found.fun)


def best(problem: Pieces) -> float:
    return float(run(Gsao(problem, settings(max_iterations=150))).best_objective)


@pytest.mark.parametrize("seed", range(4))
def test_a_minimum_at_which_more_pieces_meet_than_are_seen_is_reached(seed: int) -> None:
    problem = Pieces(count=40, n=12, seen=2, seed=seed)
    assert best(problem) == pytest.approx(problem.least, rel=1e-4)


def test_rejected_trials_leave_cuts_in_the_state_which_a_stored_state_keeps() -> None:
    problem = Pieces(count=40, n=12, seen=1, seed=0)
    optimizer = Gsao(problem, settings())
    state = optimizer.start()
    rejected = met = 0
    while state.running:
        before, state = state, optimizer.step(state)
        assert len(state.cuts) == len(state.cut_gradients)
        assert np.all(state.cuts <= state.objective)
        if not state.history.accepted[-1]:
            assert len(state.cuts) <= min(len(before.cuts) + 1, 24)
            met += len(state.cuts) > 0
            rejected += 1
            again = optimizer.step(State.from_arrays(state.to_arrays())) if state.running else state
            assert not state.running or np.array_equal(again.trial, optimizer.step(state).trial)
    assert rejected > 3
    assert met > 1


def test_a_preset_of_one_peak_keeps_no_cuts() -> None:
    state = run(Gsao(Pieces(40, 12, 2, 0), settings(overrides={"peaks": 1}, max_iterations=30)))
    assert not len(state.cuts)
    assert not all(state.history.accepted)


class Waves:
    """A sum of waves, which bends both ways."""

    def __init__(self, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.waves, self.phases = 6.0 * rng.normal(size=(6, n)), rng.uniform(0.0, 7.0, 6)
        self.sizes = rng.normal(size=6)
        self.initial, self.lower, self.upper = np.full(n, 0.5), np.zeros(n), np.ones(n)
        self.linear = LinearRows(np.ones((1, n)), np.array([0.7 * n]), np.array([False]))

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        angle = self.waves @ x + self.phases
        value = 5.0 + float(self.sizes @ np.sin(angle))
        slopes = (self.sizes * np.cos(angle)) @ self.waves
        return Sample(value, np.array([value]), slopes[None], np.zeros(0), np.zeros((0, len(x))))


@pytest.mark.parametrize(("n", "seed"), [(1, 16), (1, 30), (1, 47)])
def test_a_slope_of_a_rejected_trial_is_no_second_peak_where_the_function_bends_downwards(n: int, seed: int) -> None:
    """The slopes of iterate and trial oppose each other, and the run ended as converged where it could go on."""
    problem = Waves(n, seed)
    state = run(Gsao(problem, settings(max_iterations=100)))
    x, slopes = state.best_alpha, problem.evaluate(state.best_alpha).gradients[0]
    assert state.status is RunStatus.CONVERGED
    assert problem.linear.A[0] @ x < problem.linear.b[0] - 1e-3
    inside = (x > problem.lower + 1e-9) & (x < problem.upper - 1e-9)
    assert np.abs(slopes[inside]).max(initial=0.0) <= 1e-3
    assert np.all(np.where(x <= problem.lower + 1e-9, slopes, -slopes)[~inside] >= 0.0)
