"""A second optimiser: a record and a class with three functions, and runs, files and refusals know it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.optimizer.interface import known_at_first, make, reopen, run
from mdstopo.optimizer.state import State
from mdstopo.scene.refusals import refusals
from mdstopo.settings.optimizer_presets import settings
from mdstopo.settings.optimizers import OPTIMIZERS, OptimizerKind
from mdstopo.status import RunStatus
from tests.optimizer.toys import Toy

CASE = """
format: 1
gravity: [0, -9.81]
time: {end: 0.2}
bodies: {load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [1, 0]}}
points:
  corners: {body: load, grid: {rectangle: {center: [0, 0], size: [0.4, 0.4], count: 4}}}
  hooks: {body: ground, grid: {list: [[-1, 1], [1, 1]]}}
members: {straps: {from: corners, to: hooks, law: {type: spring, stiffness: 800}}}
design: {initial: 0.5}
objectives: {G: {response: energy}}
optimizer: {name: descent, max_iterations: 6, MORE}
"""


def bowl():
    """sum w (x - c)^2 over a box, the bottom inside for some variables and outside for others."""
    w, c = np.array([1.0, 2.0, 4.0]), np.array([0.3, 0.7, 1.4])
    return Toy(lambda x: (np.array([w @ (x - c) ** 2]), (2.0 * w * (x - c))[None]), np.full(3, 0.5), 0.0, 1.0)


@dataclass(slots=True)
class DescentState(State):
    """What steepest descent remembers beside its design: the slope there, and the length of the next step."""

    optimizer: ClassVar[str] = "descent"

    gradient: np.ndarray
    length: float


class Descent:
    """Steepest descent along the highest row within the bounds."""

    def __init__(self, problem, settings):
        self.problem, self.settings = problem, settings

    def start(self, initial=None):
        first = self.problem.initial if initial is None else initial
        alpha = np.clip(np.asarray(first, dtype=np.float64), self.problem.lower, self.problem.upper)
        sample = self.problem.evaluate(alpha)
        state = DescentState(**known_at_first(alpha, sample), gradient=sample.gradients[0], length=0.1)
        return self._finish(self._propose(state), sample, True)

    def step(self, state):
        state = state.copy()
        state.iteration += 1
        state.evaluations += 1
        sample = self.problem.evaluate(state.trial)
        better = sample.objective < state.objective
        if better:
            state.alpha = state.best_alpha = state.trial
            state.objective = state.best_objective = sample.objective
            state.gradient = sample.gradients[0]
        state.length *= 1.5 if better else 0.3
        return self._finish(self._propose(state), sample, better)

    def terminate(self, state):
        if state.kkt <= self.settings.tolerance:
            return RunStatus.CONVERGED, "the gradient is small"
        if state.iteration >= self.settings.max_iterations:
            return RunStatus.MAX_ITERATIONS, "all iterations are used"
        return RunStatus.RUNNING, ""

    def _propose(self, state):
        slope = state.gradient / max(np.abs(state.gradient).max(), 1e-300)
        state.trial = np.clip(state.alpha - state.length * slope, self.problem.lower, self.problem.upper)
        state.kkt = float(np.abs(state.trial - state.alpha).max())
        return state

    def _finish(self, state, sample, accepted):
        excess = self.problem.linear.excess(state.alpha)
        state.history = state.history.extended(sample, excess, 0.0, state.evaluations, 0.0, state.kkt, accepted)
        state.status, state.reason = self.terminate(state)
        return state


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The optimiser as a distribution would have entered it."""
    kind = OptimizerKind("descent", "steepest descent", f"{__name__}:Descent", f"{__name__}:DescentState")
    monkeypatch.setitem(OPTIMIZERS, "descent", kind)


def case_of(more=""):
    return read_case(CASE.replace(", MORE", f", {more}" if more else ""))


def test_it_finds_the_minimum_of_a_toy():
    problem = bowl()
    optimizer = make(problem, settings(max_iterations=200, tolerance=1e-5, optimizer="descent"))
    assert isinstance(optimizer, Descent)
    state = run(optimizer)
    assert state.status is RunStatus.CONVERGED
    best = run(make(problem, settings(max_iterations=200)))
    assert state.best_objective == pytest.approx(best.best_objective, rel=1e-4, abs=1e-6)


def test_a_case_names_it_and_a_resumed_run_is_the_straight_one(tmp_path):
    straight = mdstopo.optimize(case_of(), path=tmp_path / "straight.h5")
    assert straight.iterations == 6
    short = read_case(CASE.replace(", MORE", "").replace("max_iterations: 6", "max_iterations: 3"))
    mdstopo.optimize(short, path=tmp_path / "parts.h5")
    resumed = mdstopo.optimize(case_of(), path=tmp_path / "parts.h5", resume=True)
    assert resumed.alpha.tobytes() == straight.alpha.tobytes()
    begun = mdstopo.evaluate(case_of()).objectives["G"]
    assert straight.objectives["G"] < begun


def test_a_state_survives_its_arrays_and_a_moved_limit():
    optimizer = make(bowl(), settings(max_iterations=3, optimizer="descent"))
    state = run(optimizer)
    assert state.status is RunStatus.MAX_ITERATIONS
    longer = make(bowl(), settings(max_iterations=9, optimizer="descent"))
    again = reopen(longer, State.from_arrays(state.to_arrays()))
    assert isinstance(again, DescentState)
    assert again.running
    straight = run(longer)
    assert run(longer, again).best_alpha.tobytes() == straight.best_alpha.tobytes()


def test_what_it_does_not_tell_of_its_own_part_is_not_known():
    state = make(bowl(), settings(optimizer="descent")).start()
    assert not state.is_restoring
    assert np.isnan(state.foreseen())
    assert not state.slope().any()
    assert not len(state.row_shares()[0])


def test_a_state_of_an_optimiser_that_is_not_known_is_refused(monkeypatch):
    arrays = make(bowl(), settings(optimizer="descent")).start().to_arrays()
    monkeypatch.delitem(OPTIMIZERS, "descent")
    with pytest.raises(KeyError, match="descent"):
        State.from_arrays(arrays)


def test_settings_that_it_does_not_take_are_mistakes():
    with pytest.raises(CaseError, match=r"optimizer\.power: descent has no such setting"):
        case_of("power: 0.5")
    with pytest.raises(CaseError, match=r"optimizer\.preset: descent has default"):
        case_of("preset: mma")


def test_limits_that_it_does_not_take_are_refused():
    text = CASE.replace(", MORE", "")
    volume = read_case(f"{text}constraints: [{{volume: all, fraction: 0.5}}]\n")
    (mistake,) = refusals(volume)
    assert mistake.message == "the optimiser descent takes no limits on volumes; gsao does"
    limit = read_case(f"{text}constraints: [{{response: energy, limit: 100}}]\n")
    (mistake,) = refusals(limit)
    assert "takes no limits on responses" in mistake.message
