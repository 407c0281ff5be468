"""Candidates that are priced: which of them would pay at the optimum of those that are built."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, MemberGroup, VolumeRow
from mdstopo.case.scene.candidates import Pairs, mirrored_groups, with_members
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import FeasibleSet, multipliers
from mdstopo.optimizer.problem import Problem, Sample
from mdstopo.optimizer.wide import ranges
from mdstopo.plan.priced_designs import in_case, packed
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.design_problem import DesignProblem

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

#: candidates that enter at once, at most: those that gain, and neighbours that may once these have entered
MOST_ENTERING = 500
#: candidates of each group that are built to confirm that none would gain
CONFIRMED = 100
#: what a violation costs in the search for multipliers, in largest gradient entries, to begin with; and until when it
#: grows: multipliers must be smaller
PENALTY, HIGHEST_PENALTY = 1e3, 1e12


@dataclass(frozen=True)
class Prices:
    """The result of pricing candidates at one design.

    seen: candidates. best: the largest gain of one, together: how much all of them may gain, relative to the
    objective, to first order. pairs: those that are to enter, by group; gains: of these, the largest first; left: the
    largest gain of any other one, -inf where there is none. built (n,): dL/dx of the members that are built, with the
    multipliers of rows and limits. residual: of the optimality conditions of these members; unsettled: what one of them
    would gain by its slope, relative to the objective. rows (R + C,), linear (m,): these multipliers; gradients
    (R + C, n): of the rows.
    """

    seen: int
    best: float
    together: float
    pairs: dict[str, Pairs]
    gains: dict[str, Floats]
    left: dict[str, float]
    built: Floats
    residual: float
    unsettled: float
    rows: Floats
    linear: Floats
    gradients: Floats


@dataclass(frozen=True, slots=True)
class Pricing:
    """The result of the last round of pricing.

    candidates: how many there are. rounds: so far. best: by how much one of them would lower the objective (or raise
    it, where it is maximised) with alpha at its upper bound, together: by how much all of them at most; relative to the
    objective, and to first order. NaN before the first round has ended.
    """

    candidates: int
    rounds: int
    best: float
    together: float


def price(case: Case, of: Problem, x: Floats, count: int | None = None) -> Prices | None:
    """The prices of candidates of a case at a design, the optimiser's x (n,); None where it cannot be evaluated.

    of: what the optimiser sees of it.
    count: of about so many candidates of each group, evenly spread; None: of all.
    """
    problem = cast("DesignProblem", of)
    evaluation = problem.evaluation(x)
    if not evaluation.status.usable:
        return None
    sample = problem.sample_of(evaluation)
    residual, rows, linear = _multipliers(problem, sample, x)
    states = problem.pricing_states(evaluation, rows)
    gradients = gradients_of(sample)
    built = rows @ gradients + linear @ problem.linear.A
    scale = abs(sample.objective) or 1.0
    way = np.where(built < 0.0, problem.upper - x, x - problem.lower)
    unsettled = float((np.abs(built) * way).max(initial=0.0)) / scale
    seen, best, together = 0, 0.0, 0.0
    pairs: dict[str, Pairs] = {}
    gains: dict[str, Floats] = {}
    left: dict[str, float] = {}
    for groups in mirrored_groups(case):
        worth = sum(_worth(case, group, linear) for group in groups)
        found = problem.candidates_of(groups[0], count).go_through(states, worth, MOST_ENTERING)
        seen += len(groups) * found.seen + (sum(map(len, groups)) if count is None else 0)
        best = max(best, found.best / scale)
        material = _material(case, groups)
        together += (found.together if material is None else min(found.together, found.ratio * material)) / scale
        for group in groups:
            pairs[group.name], gains[group.name] = (found.i, found.j), found.gain / scale
            left[group.name] = found.left / scale
    return Prices(seen, best, together, pairs, gains, left, built, residual, unsettled, rows, linear, gradients)


def confirmed(case: Case, of: Problem, x: Floats, prices: Prices) -> Prices:
    """The prices at a design, x (n,), with the largest gain as it is once the best candidates are built.

    Members of laws that switch have steps end at their switches where they are built; prices know no such steps, and so
    differ a little. CONFIRMED of each group are built. Of all others the best one counts with its price and the largest
    difference that was found. Where the built ones cannot be evaluated, prices stay as they are.
    """
    problem = cast("DesignProblem", of)
    chosen = {name: (i[:CONFIRMED], j[:CONFIRMED]) for name, (i, j) in prices.pairs.items()}
    more = {}
    for group in case.priced_groups:
        width = len(group.to_local)
        here = group.from_index * width + group.to_index
        more[group.name] = np.divmod(np.union1d(here, chosen[group.name][0] * width + chosen[group.name][1]), width)
    larger = with_members(case, more)
    same = in_case(larger, packed(case, x))
    other = cast("DesignProblem", make_engine(larger).problem(problem.scalarisation))
    sample = other.evaluate(same)
    if sample.status is not Status.OK:
        return prices
    slopes = slopes_with(prices, gradients_of(sample), _places(case, larger)) + prices.linear @ other.linear.A
    scale = abs(sample.objective) or 1.0
    best = 0.0
    for groups in mirrored_groups(larger):
        group = groups[0]
        i, j = chosen[group.name]
        known = group.from_index * len(group.to_local) + group.to_index
        of_group = slopes[larger.space.slots[larger.group_slices[group.name]]]
        slope = of_group[np.searchsorted(known, i * len(group.to_local) + j)]
        exact, told = -min(each.upper for each in groups) * slope / scale, prices.gains[group.name]
        best = max(best, float(exact.max(initial=0.0)))
        others = max(float(told[len(exact) :].max(initial=-np.inf)), prices.left[group.name])
        best = max(best, others + float(np.abs(exact - told[: len(exact)]).max(initial=0.0)))
    return replace(prices, best=best)


def gradients_of(sample: Sample) -> Floats:
    """(R + C, N) of the rows of U, then of those of constraints on responses."""
    limits = sample.constraint_gradients
    return np.concatenate([sample.gradients, limits]) if len(limits) else sample.gradients


def slopes_with(prices: Prices, gradients: Floats, places: Ints) -> Floats:
    """The weighted sum (M,) of rows of a case with more members, (K, M), with the multipliers of prices.

    Each row that carries one is taken for the row with the most similar gradient by the variables that both have;
    places (N,): of these among the M. Rows that are as high as each other may change places.
    """
    total = np.zeros(gradients.shape[1])
    for weight, row in zip(prices.rows.tolist(), prices.gradients, strict=True):
        if weight != 0.0:
            apart = np.abs(gradients[:, places] - row).sum(axis=1)
            total += weight * gradients[int(np.argmin(apart))]
    return total


def _places(case: Case, larger: Case) -> Ints:
    """(n,): where the optimiser's variables of a case are among those of one that has its members and more."""
    pieces = []
    for group in case.design_groups:
        part, width = larger.group_slices[group.name], len(group.to_local)
        own = np.arange(len(group))
        if group.candidates is not None:
            every = next(each for each in larger.members if each.name == group.name)
            known = every.from_index * width + every.to_index
            own = np.searchsorted(known, group.from_index * width + group.to_index)
        pieces.append(part.start + own)
    found = np.empty(case.space.size, dtype=np.intp)
    found[case.space.slots] = larger.space.slots[np.concatenate(pieces)]
    return found


def _multipliers(problem: "DesignProblem", sample: Sample, x: Floats) -> tuple[float, Floats, Floats]:
    """The residual at x, and the multipliers of the rows (R + C,) and of the linear rows (m,)."""
    space = FeasibleSet(problem.lower, problem.upper, problem.linear, ranges(problem.lower, problem.upper))
    own = Bundle.of(sample, np.arange(len(sample.rows)))
    steepest = float(np.abs(sample.gradients).max())
    count = len(sample.constraint_levels)
    penalty = PENALTY * steepest
    while True:
        residual, rows, linear = multipliers(own, x, space, np.full(count, penalty), steepest)
        if rows[len(sample.rows) :].sum() <= 0.5 * penalty or penalty > HIGHEST_PENALTY * steepest:
            return residual, rows, linear
        penalty *= PENALTY


def _worth(case: Case, group: MemberGroup, linear: Floats) -> float:
    """What a unit of the group's cost is worth: the multipliers of the volume rows that cover it."""
    rows = [row for row in case.constraints if isinstance(row, VolumeRow)]
    signs = [-1.0 if row.sense == "at_least" else 1.0 for row in rows]
    covers = [float(group.name in row.groups) for row in rows]
    return float(np.array(signs) @ (linear * np.array(covers)))


def _material(case: Case, groups: tuple[MemberGroup, ...]) -> float | None:
    """How much members of a group, each with its mirror images in others, may cost there; None where nothing limits
    that, or they cost nothing."""
    rows = [row for row in case.constraints if isinstance(row, VolumeRow) and row.sense != "at_least"]
    if any(group.candidates is None or group.candidates.cost == 0.0 for group in groups):
        return None
    covered = [(row.bound, sum(group.name in row.groups for group in groups)) for row in rows]
    return min((bound / count for bound, count in covered if count), default=None)
