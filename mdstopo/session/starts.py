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
    """Where the first start begins, and the nearest design to it that keeps bounds and volume rows.

    Raises CaseError where there is none.
    """
    stated = problem.initial if initial is None else initial
    try:
        return stated, project(stated, problem.lower, problem.upper, problem.linear)
    except InfeasibleRows as error:
        raise CaseError([case.marks.mistake("constraints", str(error))], str(case.path or case.name)) from error


def is_moved(stated: Floats, nearest: Floats) -> bool:
    """Whether the first design is another than the stated one by more than the rounding of the rows' sums."""
    return float(np.abs(nearest - stated).max()) > 1e-12


def replaced(stated: Floats, nearest: Floats) -> str:
    """The notice that the first design is not the stated one."""
    moved = float(np.abs(nearest - stated).max())
    return (
        "the initial design violates bounds or volume rows: it is replaced by the nearest one that does not "
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
    """Step until the optimiser ends or `stop` says so; `keep` gets every state. Returns the last one."""
    optimizer = make_optimizer(case, problem)
    if state is None:
        first = initial if index == 0 else random_feasible(problem, case.optimizer.seed, index)
        state = optimizer.start(first)
        keep(index, state)
    else:
        state = optimizer.reopen(state)
    return run(optimizer, state, on_iteration=lambda reached: keep(index, reached), stop_requested=stop)
