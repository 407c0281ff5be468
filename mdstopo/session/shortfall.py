"""Warnings about runs that stalled, before their optimality conditions held: the residual, what holds the design, what
to try."""

from collections.abc import Sequence

import numpy as np

from mdstopo.case.model import Case, ResponseRow
from mdstopo.case.responses.response_units import constrained
from mdstopo.design_problem import SIGNS
from mdstopo.optimizer.state import State
from mdstopo.status import RunStatus

TRY = (
    "try more starts (`--starts 8`), a tighter solver.tolerance where gradients have too few digits, "
    "or a looser optimizer.tolerance where that is good enough"
)
JUMPS = (
    "; objectives jump where the start comes to rest at another place than with a design beside it: look at where it "
    "has settled, and choose bounds that keep it where it should be"
)
#: constraints that are named, and the least share of the Lagrangian's gradient that one has
MOST_NAMED, LEAST_SHARE = 3, 1e-2


def stalled_run(case: Case, state: State) -> tuple[str, ...]:
    """The warning about a stalled run whose limits hold; none about others."""
    if state.status is not RunStatus.STALLED or state.best_violation > case.optimizer.tolerance:
        return ()
    held = holders(case, state)
    by = f"; it is held by {', '.join(held)}" if held else ""
    return (
        f"stalled at a KKT residual of {residual(state.kkt)} where optimizer.tolerance asks for "
        f"{case.optimizer.tolerance:.2g}{by}: {TRY}{JUMPS if case.solver.settle else ''}",
    )


def stalled_runs(ends: Sequence[tuple[RunStatus, float]], noun: str, tolerance: float | None = None) -> tuple[str, ...]:
    """The warning about those of several runs that stalled, by status and residual. noun: what they are, plural."""
    stalled = [kkt for status, kkt in ends if status is RunStatus.STALLED]
    if not stalled:
        return ()
    known = [kkt for kkt in stalled if np.isfinite(kkt)]
    up_to = f" at KKT residuals up to {residual(max(known))}" if known else ""
    asked = f" where optimizer.tolerance asks for {tolerance:.2g}" if up_to and tolerance is not None else ""
    return (f"{len(stalled)} of {len(ends)} {noun} stalled{up_to}{asked}: {TRY}",)


def residual(kkt: float) -> str:
    """A KKT residual in words."""
    return f"{kkt:.2g}" if np.isfinite(kkt) else "unknown size"


def holders(case: Case, state: State) -> list[str]:
    """The objective and the constraints that hold the iterate, by their share of the Lagrangian's gradient, the
    largest first.

    Empty where the optimiser does not tell.
    """
    groups, weights = state.row_shares()
    if not len(groups):
        return []
    whose = [-1]
    for index, row in enumerate(case.constraints):
        if isinstance(row, ResponseRow):
            whose += [index] * len(SIGNS[row.sense])
    shares: dict[int, float] = {}
    for group, weight in zip(groups.tolist(), weights.tolist(), strict=True):
        if group < len(whose):
            shares[whose[group]] = shares.get(whose[group], 0.0) + weight
    total = sum(shares.values())
    order = sorted((index for index in shares if index >= 0), key=lambda index: (-shares[index], index))
    named = [index for index in order if shares[index] > LEAST_SHARE * total][:MOST_NAMED]
    competing = int(np.count_nonzero((groups == 0) & (weights > LEAST_SHARE * total)))
    peaks = f" ({competing} rows compete)" if competing > 1 else ""
    return [f"the objective{peaks}", *(f"constraints[{i}] ({constrained(case, case.constraints[i])})" for i in named)]
