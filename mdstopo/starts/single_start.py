"""One start of the optimiser, from its first design (or its last state) to its end."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.case.text.errors import CaseError
from mdstopo.optimizer.interface import Optimizer, make, reopen, run
from mdstopo.optimizer.nearest_feasible import InfeasibleRows, project
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.start_families import SOFT_STRENGTH, Family, design_of_family
from mdstopo.optimizer.state import State
from mdstopo.settings.optimizer_presets import Settings, settings

NOTHING_VARIES = "an optimisation needs members with `design: true`, or `design.variables`"

#: iterations with a quarter of the strengths at most
SOFT_ITERATIONS = 30

#: the first trust box of random designs: long steps lead to other optima than the stated ones do, which follow the
#: slopes into what is near
LONG_FIRST_STEPS = 0.5

Floats = NDArray[np.float64]
Keep = Callable[[int, State], None]
Stop = Callable[[], bool]


def make_optimizer(
    case: Case, problem: Problem, family: Family = Family.STATED, max_iterations: int | None = None
) -> Optimizer:
    """The optimiser of the case, with the first steps of a family of starts. max_iterations: None takes the case's."""
    chosen = case.optimizer
    own = {"trust_start": LONG_FIRST_STEPS} if family is Family.RANDOM else {}
    return make(
        problem,
        settings(
            chosen.preset,
            own | dict(chosen.options),
            max_iterations=chosen.max_iterations if max_iterations is None else max_iterations,
            tolerance=chosen.tolerance,
            optimizer=chosen.name,
        ),
    )


def first_design(case: Case, problem: Problem, initial: Floats | None) -> tuple[Floats, Floats]:
    """The x at which the first start is to begin, and the nearest x to it that keeps bounds and volume rows.

    initial: a design (alpha, or with the values of variables), whose nearest x is taken. Raises CaseError where there
    is none.
    """
    stated = problem.initial if initial is None else case.space.reduce(case.whole(initial))
    try:
        return stated, project(stated, problem.lower, problem.upper, problem.linear)
    except InfeasibleRows as error:
        raise CaseError([case.marks.mistake("constraints", str(error))], str(case.path or case.name)) from error


def is_moved(stated: Floats, nearest: Floats) -> bool:
    """Whether the first x is another than the stated one by more than the rounding of the rows' sums."""
    return float(np.abs(nearest - stated).max()) > 1e-12


def replaced(stated: Floats, nearest: Floats) -> str:
    """The notice that the first x is not the stated one."""
    moved = float(np.abs(nearest - stated).max())
    return (
        "the initial design violates bounds or volume rows: it is replaced by the nearest one that does not "
        f"(largest change of alpha {moved:.3g})"
    )


def unshared(case: Case, initial: Floats | None) -> str:
    """A notice that the first design has different alphas where the case has one; empty where it has not."""
    space = case.space
    if not (case.shared or case.mirrored):
        return ""
    design = case.start if initial is None else case.whole(initial)
    moved = float(np.abs(space.expand(space.reduce(design)) - design)[: case.n_design].max(initial=0.0))
    if moved <= 1e-12:
        return ""
    return (
        "the initial design has different alphas where the case has one (`shared`, `mirrored`): their mean is taken "
        f"(largest change of alpha {moved:.3g})"
    )


@dataclass(frozen=True, slots=True)
class StartTask:
    """A part of a start's way. index: which start; family: where it begins; quota: iterations after which it pauses,
    None: it goes on to its end; best: the best design of all starts so far (N,), for families that begin there."""

    index: int
    family: Family
    quota: int | None = None
    best: Floats | None = None


def run_start(
    case: Case, problem: Problem, task: StartTask, state: State | None, initial: Floats | None, keep: Keep, stop: Stop
) -> State | None:
    """Step until the optimiser ends, the start's quota is used or it is to stop.

    case: the design problem.
    problem: what the optimiser sees of it.
    task: which start, where it begins and how far it goes.
    state: where it goes on; None begins.
    initial (N,) or (N + P,): a design to begin the first start with.
    keep: is given the start's number and every state.
    stop: asked after each iteration whether to stop.

    Returns the last state; None where the start was stopped before it had one.
    """
    optimizer = make_optimizer(case, problem, task.family)
    if state is None:
        own = None if initial is None else case.space.reduce(case.whole(initial))
        first = design_of_family(problem, case.optimizer.seed, task.index, task.family, task.best)
        first = own if first is None else first
        before = 0
        if task.family is Family.SOFTENED and hasattr(problem, "softened"):
            soft = soften(optimizer.settings, problem, first, stop)
            if soft is None:
                return None
            first, before = soft.best_alpha, soft.evaluations
        state = with_evaluations_before(optimizer.start(first), before)
        keep(task.index, state)
    elif not state.dropped:
        state = reopen(optimizer, state)
    latest = state

    def reached(new: State) -> None:
        nonlocal latest
        latest = new
        keep(task.index, new)

    def paused() -> bool:
        return stop() or (task.quota is not None and latest.iteration >= task.quota)

    if latest.dropped:
        return latest
    return run(optimizer, latest, on_iteration=reached, stop_requested=paused)


def soften(settings: Settings, problem: Problem, first: Floats | None, stop: Stop) -> State | None:
    """The end of a short run with a quarter of the members' strength, after which a start goes on; None where it was
    stopped.

    The run ends, too, where members so weak cannot keep the limits.
    """
    optimizer = make(problem.softened(SOFT_STRENGTH), settings)  # type: ignore[attr-defined]
    state = optimizer.start(first)
    while state.running and not state.is_restoring and state.iteration < SOFT_ITERATIONS:
        if stop():
            return None
        state = optimizer.step(state)
    return state


def with_evaluations_before(state: State, before: int) -> State:
    """The first state of a start, changed: to its evaluations those are added that another problem took before."""
    if before:
        state.evaluations += before
        state.history.evaluations[:] = [count + before for count in state.history.evaluations]
    return state
