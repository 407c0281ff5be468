"""Candidates that are priced: which of them would pay at the optimum of those that are built."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.candidates import Pairs
from mdstopo.case.model import Case, MemberGroup, VolumeRow
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import FeasibleSet, multipliers
from mdstopo.optimizer.problem import Sample
from mdstopo.optimizer.wide import ranges
from mdstopo.starts.evaluator_interface import Engine
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.design_problem import DesignProblem
    from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]

#: candidates that enter at once, at most: those that gain, and neighbours that may once these have entered
MOST = 500
#: what a violation costs in the search for multipliers, in largest gradient entries, to begin with; and until when it
#: grows: multipliers must be smaller
PENALTY, HIGHEST = 1e3, 1e12


@dataclass(frozen=True)
class Prices:
    """What pricing has found at a design.

    seen: candidates. best: the largest gain of one, together: how much all of them may gain, relative to the
    objective, to first order. pairs: those that are to enter, by group. built (N,): dL/dalpha of the members that are
    built, with the multipliers of rows and limits. residual: of the optimality conditions of these members.
    """

    seen: int
    best: float
    together: float
    pairs: dict[str, Pairs]
    built: Floats
    residual: float


def price(case: Case, engine: Engine, x: Floats, count: int | None = None) -> Prices | None:
    """The prices of candidates of a case at a design (N,) of its members; None where it cannot be evaluated.

    count: of about so many candidates of each group, evenly spread; None: of all.
    """
    problem = cast("DesignProblem", engine.problem())
    evaluator = cast("Evaluator", engine)
    evaluation = problem.evaluation(x)
    if evaluation.status is not Status.OK:
        return None
    sample = problem.sample_of(evaluation)
    residual, rows, linear = _multipliers(problem, sample, x)
    asked = problem.asked_of_members(evaluation, rows[: len(sample.rows)])
    built = rows[: len(sample.rows)] @ sample.gradients + linear @ problem.linear.A
    scale = abs(sample.objective) or 1.0
    seen, best, together = 0, 0.0, 0.0
    pairs: dict[str, Pairs] = {}
    for group in case.priced_groups:
        found = evaluator.candidates_of(group, count).go_through(asked, _worth(case, group, linear), MOST)
        seen += found.seen + (len(group) if count is None else 0)
        best = max(best, found.best / scale)
        material = _material(case, group)
        together += (found.together if material is None else min(found.together, found.ratio * material)) / scale
        pairs[group.name] = found.i, found.j
    return Prices(seen, best, together, pairs, built, residual)


def _multipliers(problem: "DesignProblem", sample: Sample, x: Floats) -> tuple[float, Floats, Floats]:
    """The residual at x, and the multipliers of the rows (R + C,) and of the linear rows (m,)."""
    space = FeasibleSet(problem.lower, problem.upper, problem.linear, ranges(problem.lower, problem.upper))
    own = Bundle.of(sample, np.arange(len(sample.rows)))
    steepest = float(np.abs(sample.gradients).max())
    count = len(sample.constraint_levels)
    penalty = PENALTY * steepest
    while True:
        residual, rows, linear = multipliers(own, x, space, np.full(count, penalty), steepest)
        if rows[len(sample.rows) :].sum() <= 0.5 * penalty or penalty > HIGHEST * steepest:
            return residual, rows, linear
        penalty *= PENALTY


def _worth(case: Case, group: MemberGroup, linear: Floats) -> float:
    """What a unit of the group's cost is worth: the multipliers of the volume rows that cover it."""
    rows = [row for row in case.constraints if isinstance(row, VolumeRow)]
    signs = [-1.0 if row.sense == "at_least" else 1.0 for row in rows]
    covers = [float(group.name in row.groups) for row in rows]
    return float(np.array(signs) @ (linear * np.array(covers)))


def _material(case: Case, group: MemberGroup) -> float | None:
    """How much members of the group may cost together; None where nothing limits that, or they cost nothing."""
    rows = [row for row in case.constraints if isinstance(row, VolumeRow) and row.sense != "at_least"]
    if group.candidates is None or group.candidates.cost == 0.0:
        return None
    return min((row.bound for row in rows if group.name in row.groups), default=None)
