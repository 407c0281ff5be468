"""One start of the optimiser, from its first design (or its last state) to its end."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.errors import CaseError
from mdstopo.case.model import Case
from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.projection import InfeasibleRows, project
from mdstopo.optimizer.starts import random_feasible
from mdstopo.optimizer.state import State

NOTHING_VARIES = "an optimisation needs members with `design: true`, or `design.variables`"

Floats = NDArray[np.float64]
Keep = Callable[[int, State], None]
Stop = Callable[[], bool]


def make_optimizer(case: Case, problem: Problem) -> Gsao:
    """The optimiser that the case asks for."""
    chosen = case.optimizer
    return Gsao(
        problem,
        settings(
            chosen.preset,
            dict(chosen.options),
            max_iterations=chosen.max_iterations,
            tolerance=chosen.tolerance,
        ),
    )


def first_design(case: Case, problem: Problem, initial: Floats | None) -> tuple[Floats, Floats]:
    """The x at which the first start begins, and the nearest one to it that keeps bounds and volume rows.

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
    """The notice that alphas which are one in the case differ in the first design; empty where they do not."""
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


def run_start(
    case: Case,
    problem: Problem,
    index: int,
    state: State | None,
    initial: Floats | None,
    keep: Keep,
    stop: Stop,
) -> State:
    """Step until the optimiser ends or `stop` says so; `keep` gets every state. Returns the last one.

    initial: a design to begin the first start with.
    """
    optimizer = make_optimizer(case, problem)
    if state is None:
        own = None if initial is None else case.space.reduce(case.whole(initial))
        first = own if index == 0 else random_feasible(problem, case.optimizer.seed, index)
        state = optimizer.start(first)
        keep(index, state)
    else:
        state = optimizer.reopen(state)
    return run(optimizer, state, on_iteration=lambda reached: keep(index, reached), stop_requested=stop)
