"""A start in stages: one optimum after another while the powers rise, each begun at the best design of the last.

Which stage an iterate belongs to is a column of the optimiser's history, `stage`, beside what the engine reports. So a
state knows its stage wherever it is kept or sent, and a run that is resumed goes on in the stage that it had reached.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.catalogue import has_catalogue
from mdstopo.case.design.stages import stage_case, stage_count
from mdstopo.case.model import Case
from mdstopo.optimizer.problem import Problem, Sample
from mdstopo.optimizer.state import History, State
from mdstopo.starts.evaluator_interface import MakeEngine
from mdstopo.starts.single_start import StartTask, make_optimizer, run_start
from mdstopo.status import RunStatus

Floats = NDArray[np.float64]

#: the columns that say which stage, and which round of pricing, an iterate belongs to
STAGE, ROUND = "stage", "round"


def stage_of(state: State) -> int:
    """The number of the stage that a state is in, from 0."""
    column = state.history.info.get(STAGE)
    return int(column[-1]) if column else 0


def first_row(state: State, before: int = 0) -> int:
    """The row of the history with which the state's stage begins, or one so many stages before it."""
    column = state.history.info.get(STAGE)
    return int(np.searchsorted(np.array(column), column[-1] - before)) if column else 0


def iterations_of(state: State) -> int:
    """Iterations of all stages, or rounds of pricing; `State.iteration` counts those of the last one."""
    column = state.history.info.get(ROUND)
    if column:
        return state.iteration + int(np.searchsorted(np.array(column), column[-1])) - int(column[-1])
    return state.iteration + first_row(state) - stage_of(state)


def is_done(case: Case, state: State) -> bool:
    """Whether nothing is left to do: the last stage has ended, or one has failed, or others go on instead."""
    last = state.status is RunStatus.FAILED or stage_of(state) >= stage_count(case) - 1
    return last and not state.running


def has_sizes(case: Case, state: State) -> bool:
    """Whether sizes from the case's catalogue have been chosen in this state: that is one more stage, behind the
    last."""
    return has_catalogue(case) and stage_of(state) >= stage_count(case)


def furthest(states: "list[State | None]") -> "list[State | None]":
    """The states that may be compared with each other; None in the place of those in an earlier stage.

    Objectives of different powers are different functions.
    """
    stages = [stage_of(each) for each in states if each is not None and np.isfinite(each.best_objective)]
    last = max(stages, default=-1)
    return [None if each is None or (last >= 0 and stage_of(each) != last) else each for each in states]


def run_stages(
    case: Case,
    make: MakeEngine,
    problem: Problem,
    task: StartTask,
    state: State | None,
    initial: Floats | None,
    keep: Callable[[int, State], None],
    stop: Callable[[], bool],
) -> State | None:
    """Go through all stages of a case with one start, each from the best design of the one before.

    case: the design problem, with its stages.
    make: makes the evaluator of a stage's case.
    problem: that of the last stage.
    task: which start, where it begins and how far it goes.
    state: where it goes on; None begins.
    initial (N,) or (N + P,): a design to begin the first start with.
    keep: is given the start's number and every state.
    stop: asked after each iteration whether to stop.

    Returns the last state; None where the start was stopped before it had one.
    """
    if state is not None and has_sizes(case, state):
        return state
    count = stage_count(case)
    if count == 1:
        # where sizes are chosen afterwards the history says from the start which stage an iterate belongs to
        only = Marked(problem, STAGE, 0) if has_catalogue(case) else problem
        return run_start(case, only, task, state, initial, keep, stop)

    def problem_at(stage: int) -> Problem:
        return Marked(problem if stage == count - 1 else make(stage_case(case, stage)).problem(), STAGE, stage)

    here = problem_at(0 if state is None else stage_of(state))
    while True:
        state = run_start(case, here, task, state, initial, keep, stop)
        if state is None or state.running or is_done(case, state) or stop():
            return state
        here = problem_at(stage_of(state) + 1)
        state = continued(state, make_optimizer(case, here).start(state.best_alpha))
        keep(task.index, state)


def continued(before: State, fresh: State) -> State:
    """The first state of a stage, or of a round of pricing, with the history of all that came before it."""
    old, new = before.history, fresh.history
    info = {name: [*rows, *_like(rows[0], new.info.get(name, [None]))] for name, rows in old.info.items()}
    history = History(
        [*old.objective, *new.objective],
        [*old.constraints, *new.constraints],
        [*old.nonlinear, *_like(old.nonlinear[0], new.nonlinear)],
        [*old.change, *new.change],
        [*old.evaluations, *(before.evaluations + each for each in new.evaluations)],
        [*old.seconds, *(before.seconds + each for each in new.seconds)],
        [*old.kkt, *new.kkt],
        [*old.accepted, *new.accepted],
        [*old.failure, *new.failure],
        info,
    )
    evaluations, seconds = before.evaluations + fresh.evaluations, before.seconds + fresh.seconds
    return replace(fresh, history=history, evaluations=evaluations, seconds=seconds)


def _like(pattern: Floats, rows: "list[Any]") -> list[Floats]:
    """Rows in the shape of earlier ones; NaN where an evaluation failed and has left nothing of that shape."""
    return [row if np.shape(row) == np.shape(pattern) and row is not None else np.full_like(pattern, np.nan)
            for row in rows]  # fmt: skip


class Marked:
    """A problem whose samples say which stage they belong to, or which round."""

    def __init__(self, problem: Problem, column: str, number: int) -> None:
        self.initial, self.linear = problem.initial, problem.linear
        self.lower, self.upper = problem.lower, problem.upper
        self._problem = problem
        self._column, self._number = column, float(number)

    def __getattr__(self, name: str) -> Any:
        """What only some problems have."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._problem, name)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        sample = self._problem.evaluate(x, gradient)
        return replace(sample, info={**sample.info, self._column: self._number})
