"""First designs of several independent runs: these problems are multimodal.

Start 0 is the problem's own initial design. The others belong to families that take turns; each depends on the seed,
its number and, for neighbours, on the best design so far alone: a run is the same whatever process does it.
"""

import enum
from collections.abc import Sequence

import numpy as np

from mdstopo.optimizer.nearest_feasible import project
from mdstopo.optimizer.problem import Floats, Problem
from mdstopo.optimizer.state import State

#: the power of the uniform numbers of a random design: the higher, the fewer thick members
SHARPNESS = 4
#: share of the members that a sparse design has, and of those that a neighbour exchanges
SPARSE, EXCHANGED = 0.1, 0.15


class Family(enum.StrEnum):
    """The ways to choose the design with which a start begins."""

    STATED = "the stated design"
    SOFTENED = "the stated design, optimised with a quarter of the strengths"
    RANDOM = "a random design of few thick members and many thin ones"
    SPARSE = "a few whole members"
    UNIFORM = "a random design"
    NEIGHBOUR = "near the best design so far"
    OTHER_FROM = "the best design so far, its members' ends exchanged on the bodies they come from"
    OTHER_TO = "the best design so far, its members' ends exchanged on the bodies they go to"


#: the families that take turns after the first two starts
TURNS = (Family.RANDOM, Family.SPARSE, Family.UNIFORM)
#: the families that begin at the best design of the others, with how many starts there have to be for one of each; the
#: first of them is the last start
FROM_BEST = ((Family.OTHER_TO, 4), (Family.OTHER_FROM, 6), (Family.NEIGHBOUR, 8))
#: the share of the strengths with which a softened start begins
SOFT_STRENGTH = 0.25


def family_of(index: int, starts: int, softens: bool = True) -> Family:
    """The family of start `index` of so many. softens: whether there are members whose strengths vary."""
    if index == 0:
        return Family.STATED
    for place, (family, least) in enumerate(FROM_BEST, start=1):
        if starts >= least and index == starts - place:
            return family
    return Family.SOFTENED if index == 1 and softens else TURNS[(index - 2) % len(TURNS)]


def begins_at_best(family: Family) -> bool:
    """Whether a start of this family begins at the best design that other starts have found."""
    return any(family is each for each, _ in FROM_BEST)


def design_of_family(
    problem: Problem, seed: int, index: int, family: Family, best: Floats | None = None
) -> Floats | None:
    """The design (N,) with which a start begins; None for the problem's own. best: of all starts so far."""
    if family in (Family.STATED, Family.SOFTENED):
        return None
    if family is Family.SPARSE:
        return sparse(problem, seed, index)
    if family is Family.UNIFORM:
        return uniform(problem, seed, index)
    if begins_at_best(family) and best is not None:
        return elsewhere(problem, seed, index, family, best)
    return random_feasible(problem, seed, index)


def random_feasible(problem: Problem, seed: int, index: int) -> Floats:
    """The design of random start `index` >= 1: few thick members and many thin ones, projected on the linear rows.

    The shares of the range are powers of uniform numbers. Good designs are nearly 0/1, and such starts find the better
    basins more often than uniform or sparser ones (measured on the two-body scenes). The last `even` variables of a
    problem that has such are uniform: there is no reason for a parameter of a law to be near its lower bound.
    """
    drawn = np.random.default_rng([seed, index]).uniform(size=len(problem.lower))
    return _feasible(problem, drawn**SHARPNESS, drawn)


def sparse(problem: Problem, seed: int, index: int) -> Floats:
    """The design of a start with a few whole members and no others, projected on the linear rows; parameters of laws
    uniform."""
    drawn = np.random.default_rng([seed, index]).uniform(size=len(problem.lower))
    return _feasible(problem, (drawn < SPARSE).astype(np.float64), drawn)


def uniform(problem: Problem, seed: int, index: int) -> Floats:
    """The design of a start with uniform random shares of the ranges, projected on the linear rows."""
    drawn = np.random.default_rng([seed, index]).uniform(size=len(problem.lower))
    return _feasible(problem, drawn, drawn)


def neighbour(problem: Problem, seed: int, index: int, best: Floats) -> Floats:
    """The design of a start that is the best one with some of its values exchanged, projected on the linear rows."""
    rng = np.random.default_rng([seed, index])
    out = best.copy()
    some = np.flatnonzero(rng.uniform(size=len(out)) < EXCHANGED)
    width = problem.upper - problem.lower
    share = np.divide(best - problem.lower, width, out=np.zeros(len(out)), where=width > 0.0)
    out[some] = problem.lower[some] + rng.permutation(share[some]) * width[some]
    return project(out, problem.lower, problem.upper, problem.linear)


def elsewhere(problem: Problem, seed: int, index: int, family: Family, best: Floats) -> Floats:
    """The best design with its members' ends exchanged, projected on the linear rows; a neighbour where it has none."""
    exchange = getattr(problem, "exchange_ends", None)
    if family is not Family.NEIGHBOUR and exchange is not None:
        side = "to" if family is Family.OTHER_TO else "from"
        other = exchange(best, side, np.random.default_rng([seed, index]))
        if not np.array_equal(other, best):
            return project(other, problem.lower, problem.upper, problem.linear)
    return neighbour(problem, seed, index, best)


def _feasible(problem: Problem, share: Floats, uniform: Floats) -> Floats:
    """The design at these shares (N,) of the ranges, the last `even` ones uniform, projected on the linear rows."""
    share = share.copy()
    even = getattr(problem, "even", 0)
    if even:
        share[-even:] = uniform[-even:]
    draw = problem.lower + share * (problem.upper - problem.lower)
    return project(draw, problem.lower, problem.upper, problem.linear)


def best_run(runs: Sequence[State | None], tolerance: float) -> int:
    """The index of the best run: feasible before infeasible, then by violation, then by objective, then the first."""

    return min(range(len(runs)), key=lambda index: (*rank(runs[index], tolerance), index))


def rank(run: State | None, tolerance: float) -> tuple[bool, float, float]:
    """The key by which runs are ordered, the best first: whether infeasible, by how much, the objective; inf of a
    failed run."""
    if run is None or not np.isfinite(run.best_objective):
        return True, float("inf"), float("inf")
    infeasible = run.best_violation > tolerance
    return infeasible, run.best_plain if infeasible else 0.0, run.best_objective
