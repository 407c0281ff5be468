"""Several independent runs from different designs: these problems are multimodal.

Start 0 is the problem's own initial design, the others are random feasible designs that depend on the seed and their
number alone, so that a run is the same whatever process does it (`session.workers`).
"""

from collections.abc import Sequence

import numpy as np

from mdstopo.optimizer.problem import Floats, Problem
from mdstopo.optimizer.projection import project
from mdstopo.optimizer.state import State

SHARPNESS = 4


def random_feasible(problem: Problem, seed: int, index: int) -> Floats:
    """The design of random start `index` >= 1: few thick members and many thin ones, projected on the linear rows.

    The shares of the range are powers of uniform numbers. Good designs are nearly 0/1, and such starts find the better
    basins more often than uniform or sparser ones (measured on the two-body scenes). The last `even` variables of a
    problem that has such are uniform: there is no reason for a parameter of a law to be near its lower bound.
    """
    drawn = np.random.default_rng([seed, index]).uniform(size=len(problem.lower))
    share = drawn**SHARPNESS
    even = getattr(problem, "even", 0)
    if even:
        share[-even:] = drawn[-even:]
    draw = problem.lower + share * (problem.upper - problem.lower)
    return project(draw, problem.lower, problem.upper, problem.linear)


def best_run(runs: Sequence[State | None], tolerance: float) -> int:
    """The index of the best run: feasible before infeasible, then by violation, then by objective, then the first."""

    def key(item: tuple[int, State | None]) -> tuple[bool, float, float, int]:
        index, state = item
        if state is None or not np.isfinite(state.best_objective):
            return True, float("inf"), float("inf"), index
        infeasible = state.best_violation > tolerance
        return infeasible, state.best_plain if infeasible else 0.0, state.best_objective, index

    return min(enumerate(runs), key=key)[0]
