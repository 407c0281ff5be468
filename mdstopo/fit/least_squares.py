"""Least squares within bounds by SciPy's trust-region method, with our derivatives; and deviations not known before.

A series whose standard deviation is not stated gets that of its own residuals: fit and deviation are found in turns,
which ends at the most likely of both. Estimates are scaled by their bounds.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.methods.losses import LOSSES
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.loss_functions import for_scipy, loss
from mdstopo.fit.predictions import MotionError

#: relative change of the cost, of the estimates, and the slope at which a fit has come to its end
COST, STEP, SLOPE = 1e-12, 1e-8, 1e-10
#: the same of the cost, while deviations are not known well, and how far they change then, relative
LOOSE, LOOSELY_SETTLED = 1e-5, 1e-3
#: evaluations of a fit at most
MOST_EVALUATIONS = 300
#: turns of fit and deviations at most, and how far deviations may still change, relative
TURNS, DEVIATIONS_SETTLED = 40, 1e-6
#: a deviation that is estimated is at least this share of the largest value, or of a unit where all are zero
LEAST_DEVIATION = 1e-12
#: standard deviations that a value may be off at the start: squares of more are soon too large for numbers
MOST_DEVIATIONS = 1e100
#: how many standard deviations the median of magnitudes is, of normal residuals
MEDIAN = 0.6744897501960817
#: why SciPy's least_squares has ended, by its status
REASONS = {
    1: "the slope of the sum of squares is zero to rounding",
    2: "the sum of squares changes no more",
    3: "the estimates change no more",
    4: "neither the sum of squares nor the estimates change any more",
}


class StoppedError(Exception):
    """The user wants the fit to end."""


@dataclass(frozen=True)
class Minimum:
    """Where a fit has ended.

    x (p,): the estimates. misfit (n,): predicted less measured, slopes (n, p): its derivatives. deviation (n,): of each
    value. cost: half the sum of the squares (or of what the loss makes of them) of misfit over deviation. level: the
    negative log-likelihood without its constant, by which fits with different estimated deviations are compared.
    status: converged | max_iterations | failed; reason: in words. evaluations: of the misfit.
    """

    x: FloatArray
    misfit: FloatArray
    slopes: FloatArray
    deviation: FloatArray
    cost: float
    level: float
    status: str
    reason: str
    evaluations: int

    @property
    def residuals(self) -> FloatArray:
        """(n,) in standard deviations."""
        return self.misfit / self.deviation

    @property
    def jacobian(self) -> FloatArray:
        """(n, p): derivatives of the residuals."""
        return self.slopes / self.deviation[:, None]


#: is told of what the fit has evaluated
Seen = Callable[["Evaluated"], None]


class Evaluated(NamedTuple):
    """An evaluation: x (p,), the misfit (n,) there, and the deviation (n,) of each value that counts at the time."""

    x: FloatArray
    misfit: FloatArray
    deviation: FloatArray


def stated_deviations(problem: FitProblem) -> FloatArray:
    """(n,) the deviations that are known; NaN where they are not."""
    return np.concatenate(
        [np.full(len(each.t), np.nan) if each.deviation is None else each.deviation for each in problem.measured]
    )


def fitted(
    problem: FitProblem,
    start: FloatArray,
    stop: Callable[[], bool] = lambda: False,
    seen: Seen = lambda _: None,
) -> Minimum:
    """The fit from a start (p,), with its deviations. Raises StoppedError.

    stop: as of `minimum`. seen: is given every evaluation that has a motion.
    """
    known = stated_deviations(problem)
    unknown = [s for s, part in enumerate(problem.parts) if np.isnan(known[part.start])]
    deviation = known.copy()
    for s in unknown:
        deviation[problem.parts[s]] = _spread(problem.measured[s].y)
    evaluations = 0
    x = start
    # while deviations still change much, the minimum need not be found closely
    cost = LOOSE if unknown else COST
    for _ in range(TURNS):
        found = minimum(problem, x, deviation, stop=stop, precision=cost, seen=seen)
        evaluations += found.evaluations
        if found.status == "failed":
            return replace(found, evaluations=evaluations)
        if not unknown:
            break
        before = deviation.copy()
        for s in unknown:
            part = problem.parts[s]
            deviation[part] = deviation_of(problem, found.misfit[part], problem.measured[s].y)
        found = replace(found, deviation=deviation.copy())
        # one series alone, or all of equal deviations: the deviation does not change where the minimum is
        alone = len(problem.parts) == 1 and not LOSSES[problem.fit.loss].is_robust
        change = float(np.max(np.abs(deviation / before - 1.0)))
        if cost == COST and (alone or change < DEVIATIONS_SETTLED):
            break
        cost = COST if alone or change < LOOSELY_SETTLED else cost
        x = found.x
    else:
        found = replace(found, status="max_iterations", reason=f"deviations still change after {TURNS} turns")
    cost = _cost(problem, found.residuals)
    logs = sum(len(problem.measured[s].t) * float(np.log(deviation[problem.parts[s].start])) for s in unknown)
    return replace(found, cost=cost, level=cost + logs, evaluations=evaluations)


def deviation_of(problem: FitProblem, misfit: FloatArray, y: FloatArray) -> float:
    """The standard deviation of a series from its residuals; with a robust loss from the median of their magnitudes."""
    share = max(1.0 - len(problem.names) / problem.count, 1.0 / problem.count)
    if LOSSES[problem.fit.loss].is_robust:
        size = float(np.median(np.abs(misfit)) / (MEDIAN * np.sqrt(share)))
    else:
        size = float(np.sqrt(np.mean(misfit**2) / share))
    return max(size, _least_deviation(y))


def _least_deviation(y: FloatArray) -> float:
    """The smallest deviation that is estimated of values y (n,)."""
    return max(LEAST_DEVIATION * (float(np.abs(y).max()) or 1.0), np.finfo(float).tiny)


def minimum(
    problem: FitProblem,
    start: FloatArray,
    deviation: FloatArray,
    held: IndexArray | None = None,
    stop: Callable[[], bool] = lambda: False,
    precision: float = COST,
    seen: Seen = lambda _: None,
) -> Minimum:
    """The nearest minimum with known deviations.

    problem: what is fitted.
    start (p,): where it begins.
    deviation (n,): of each value.
    held: estimates that stay where they are.
    stop: is asked before each motion; where it says yes, StoppedError is raised.
    precision: relative change of the cost at which it ends.
    seen: is given every evaluation that has a motion.
    """
    from scipy.optimize import least_squares

    free = np.setdiff1d(np.arange(len(start)), [] if held is None else held)
    low, width = problem.lower[free], (problem.upper - problem.lower)[free]
    evaluations = 0

    def whole(u: FloatArray) -> FloatArray:
        x = start.copy()
        x[free] = np.clip(low + width * u, problem.lower[free], problem.upper[free])
        return x

    def residuals(u: FloatArray) -> FloatArray:
        nonlocal evaluations
        if stop():
            raise StoppedError
        evaluations += 1
        trouble, misfit = problem.misfit(whole(u))
        trouble = trouble or _too_large(problem, misfit, deviation)
        if trouble and evaluations == 1:
            raise MotionError(trouble)
        if trouble:
            return np.full_like(misfit, np.inf)  # SciPy takes that for a step too long, and tries a shorter one
        seen(Evaluated(whole(u), misfit, deviation))
        return misfit / deviation

    def jacobian(u: FloatArray) -> FloatArray:
        out: FloatArray = problem.slopes(whole(u))[:, free] * width / deviation[:, None]
        return out

    try:
        if not len(free):
            misfit = residuals(np.zeros(0)) * deviation
            return _at(problem, start, misfit, deviation, "converged", "nothing is free", evaluations)
        found = least_squares(
            residuals, np.clip((start[free] - low) / width, 0.0, 1.0), jacobian, (0.0, 1.0), method="trf",
            ftol=precision, xtol=STEP, gtol=SLOPE, x_scale="jac", loss=for_scipy(problem.fit.loss),
            max_nfev=MOST_EVALUATIONS,
        )  # fmt: skip
    except MotionError as error:
        nan = np.full(problem.count, np.nan)
        slopes = np.full((problem.count, len(start)), np.nan)
        return Minimum(start, nan, slopes, deviation, np.inf, np.inf, "failed", str(error), evaluations)
    status = "max_iterations" if found.status == 0 else "converged"
    reason = REASONS.get(found.status, found.message)
    x = whole(found.x)
    return _at(problem, x, problem.misfit(x)[1], deviation, status, reason, evaluations)


def _too_large(problem: FitProblem, misfit: FloatArray, deviation: FloatArray) -> str:
    """Which series is so many deviations (n,) off by a misfit (n,) that nothing can be computed of it; empty: none."""
    for each, part in zip(problem.measured, problem.parts, strict=True):
        if not np.all(np.abs(misfit[part]) < MOST_DEVIATIONS * deviation[part]):
            return (
                f"{each.series.name} is more than {MOST_DEVIATIONS:.0e} of its deviations off, too many to compute with"
                ": look at deviation, value_scale and offset"
            )
    return ""


def _at(
    problem: FitProblem,
    x: FloatArray,
    misfit: FloatArray,
    deviation: FloatArray,
    status: str,
    reason: str,
    evaluations: int,
) -> Minimum:
    """What is known of a minimum at x.

    problem: what is fitted. x (p,): where the fit has ended, and misfit (n,) there. deviation (n,): of each value.
    status, reason: how it has ended. evaluations: how many of the misfit it took.
    """
    cost = _cost(problem, misfit / deviation)
    return Minimum(x, misfit, problem.slopes(x), deviation, cost, cost, status, reason, evaluations)


def _cost(problem: FitProblem, residuals: FloatArray) -> float:
    """Half the sum of what the loss makes of the squares of residuals."""
    return 0.5 * float(np.sum(loss(problem.fit.loss, residuals)[0]))


def _spread(y: FloatArray) -> float:
    """A first guess of a deviation."""
    return max(float(np.std(y)), _least_deviation(y))


def starts(problem: FitProblem) -> list[FloatArray]:
    """The starts: the stated one, then random ones that spread over the bounds, the same for the same seed."""
    count = problem.fit.starts - 1
    if not count:
        return [problem.initial]
    from scipy.stats import qmc

    sample = qmc.LatinHypercube(len(problem.names), seed=problem.fit.seed).random(count)
    wide = (problem.lower > 0.0) & (problem.upper > 100.0 * problem.lower)
    low = np.where(wide, np.log(np.where(wide, problem.lower, 1.0)), problem.lower)
    high = np.where(wide, np.log(np.where(wide, problem.upper, 1.0)), problem.upper)
    points = low + sample * (high - low)
    return [problem.initial, *np.where(wide, np.exp(np.where(wide, points, 0.0)), points)]
