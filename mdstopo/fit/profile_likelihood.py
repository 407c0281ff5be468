"""Profile likelihood: how the best fit gets worse as one estimate is held elsewhere, which is no parabola far away.

With the estimate held at a value and all others fitted anew, the cost rises by t^2/2; where t is the quantile that the
interval has, are its ends (Venzon and Moolgavkar 1988).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.least_squares import Minimum, minimum
from mdstopo.fit.statistics import Statistics

#: how far the points reach, in half widths of the interval
REACH = 1.6


@dataclass(frozen=True)
class Profile:
    """values (k,), rising, where the estimate was held, and t (k,) there, with the side's sign; NaN: no motion there.

    Where the fit with the estimate held is better than the minimum, t has the other side's sign.
    low, high: the ends of the interval, NaN where the points do not reach them.
    """

    values: FloatArray
    t: FloatArray
    low: float
    high: float


def profile(
    problem: FitProblem, found: Minimum, at_best: Statistics, i: int, points: int, stop: Callable[[], bool]
) -> Profile:
    """The profile of one estimate, on both sides of a minimum.

    problem: what is fitted.
    found, at_best: its minimum, and the statistics there.
    i: which estimate; one that is neither at a bound nor unknown.
    points: how many on each side.
    stop: is asked before each motion; where it says yes, `least_squares.StoppedError` is raised.
    """
    half = at_best.factor * at_best.deviation[i]
    held = np.array([i])
    sides = []
    for way, bound in ((-1.0, problem.lower[i]), (1.0, problem.upper[i])):
        x, side = found.x.copy(), []
        reach = min(REACH * half, abs(bound - found.x[i]))
        for k in range(1, points + 1):
            x[i] = found.x[i] + way * reach * k / points
            there = minimum(problem, x, found.deviation, held=held, stop=stop)
            if there.status == "failed":
                side.append((float(x[i]), np.nan))
                continue
            worse = there.cost - found.cost
            side.append((float(x[i]), way * float(np.copysign(np.sqrt(2.0 * abs(worse)), worse))))
            x = there.x.copy()
        sides.append(side)
    rows = np.array([*sides[0][::-1], (found.x[i], 0.0), *sides[1]])
    low, high = (
        _end(np.array([(found.x[i], 0.0), *side]) * (1.0, way), at_best.factor)
        for way, side in zip((-1.0, 1.0), sides, strict=True)
    )
    return Profile(rows[:, 0], rows[:, 1], low, high)


def _end(side: FloatArray, factor: float) -> float:
    """Where t, with the side's sign taken off, reaches a factor along one side (k, 2) of values and t, outwards; NaN
    where it does not."""
    side = side[np.isfinite(side[:, 1])]
    t = side[:, 1]
    beyond = np.flatnonzero(t >= factor)
    if not len(beyond):
        return float("nan")
    k = int(beyond[0])
    share = (factor - t[k - 1]) / (t[k] - t[k - 1])
    return float(side[k - 1, 0] + share * (side[k, 0] - side[k - 1, 0]))
