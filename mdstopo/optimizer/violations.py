"""By how much a design misses limits, and how designs compare that do."""

import numpy as np

from mdstopo.optimizer.problem import Floats, Sample
from mdstopo.optimizer.state import State
from mdstopo.optimizer.wide_numbers import steepest


def scaled_violation(sample: Sample) -> float:
    """The largest constraint violation: c itself, or in the unit of alpha, c over the largest entry of its gradient,
    whichever is larger."""
    if not len(sample.constraint_rows):
        return 0.0
    slope = steepest(sample.constraint_gradients)
    unit = np.where(slope > 0.0, np.minimum(slope, 1.0), 1.0)
    return float(np.max(np.maximum(sample.constraint_rows, 0.0) / unit))


def plain_violation(sample: Sample) -> float:
    """The largest constraint violation c itself, relative to the bound: what a user is told."""
    if not len(sample.constraint_rows):
        return 0.0
    return float(np.maximum(sample.constraint_rows, 0.0).max(initial=0.0))


def merit(objective: float, levels: Floats, penalty: Floats) -> float:
    """What a step must decrease: the objective, and penalty (J,) times the largest violation of each constraint."""
    if not len(penalty):
        return objective
    return objective + float(np.einsum("i,i->", penalty, np.maximum(levels, 0.0)))


def better(objective: float, violation: float, plain: float, state: State, tolerance: float) -> bool:
    """Whether a design beats the best so far: feasible before infeasible, among feasible ones by objective, else by the
    plain violation. The scaled one is large where gradients vanish, as they do where a limit is missed by the least."""
    feasible = violation <= tolerance
    if feasible != (state.best_violation <= tolerance):
        return feasible
    return objective < state.best_objective if feasible else plain < state.best_plain
