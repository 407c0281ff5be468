"""What a fit tells of its estimates: intervals, correlations, and what the data cannot tell apart.

Near its minimum the cost is a parabola. With A the sum of the products of the residuals' slopes, estimates vary by the
covariance A^-1; with a robust loss by A^-1 B A^-1, with the loss's own first and second derivatives in B and A (Huber
1981). Scaled by the bounds, the singular values of the slopes say by how many standard deviations predictions change
along a direction, from bound to bound; where that is nothing, no measurement knows the direction.
"""

from dataclasses import dataclass

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.methods.losses import LOSSES
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.least_squares import Minimum, stated_deviations
from mdstopo.fit.loss_functions import loss

#: singular values below this share of the largest are none
NEGLIGIBLE_SINGULAR_VALUE = 1e-6
#: an estimate takes part in a direction with this share of its way between the bounds, or more
TAKES_PART = 0.02
#: an estimate is at a bound that is as near as this share of the way between both
AT_BOUND = 1e-7


@dataclass(frozen=True)
class Direction:
    """A combination of estimates that the data do not determine, or hardly: shares of each way between the bounds.

    change: by how many standard deviations all predictions change, from bound to bound.
    """

    shares: dict[str, float]
    change: float
    is_unknown: bool


@dataclass(frozen=True)
class Statistics:
    """deviation, low, high (p,): of the estimates; NaN where the data do not know, or an estimate is at a bound.

    correlation (p, p); at_bound (p,): -1 lower, 1 upper, else 0. freedom: values less directions that the data know.
    factor: how many deviations the interval reaches to each side. chi_square: sum of the squares of all residuals.
    """

    deviation: FloatArray
    low: FloatArray
    high: FloatArray
    correlation: FloatArray
    at_bound: FloatArray
    directions: list[Direction]
    freedom: int
    factor: float
    chi_square: float


def statistics(problem: FitProblem, found: Minimum) -> Statistics:
    """The statistics of a minimum."""
    p = len(problem.names)
    width = problem.upper - problem.lower
    at_bound = _bounds(problem, found)
    free = np.flatnonzero(at_bound == 0)
    _, influence, slope = loss(problem.fit.loss, found.residuals)
    scaled = found.jacobian[:, free] * width[free]
    directions, known = _directions(problem, scaled, free)
    middle = _inverse(scaled.T @ (slope[:, None] * scaled), known)
    if LOSSES[problem.fit.loss].is_robust:
        middle = middle @ (scaled.T @ (influence[:, None] ** 2 * scaled)) @ middle
    # what a direction without any value takes part in is not known
    lost = np.sum(known**2, axis=1) < 1.0 - TAKES_PART**2 if len(free) else np.zeros(0, dtype=bool)
    covariance = np.full((p, p), np.nan)
    covariance[np.ix_(free, free)] = middle * np.outer(width[free], width[free])
    covariance[free[lost], :] = covariance[:, free[lost]] = np.nan
    deviation = np.sqrt(np.diag(covariance))
    freedom = problem.count - known.shape[1]
    factor = quantile(problem)
    return Statistics(
        deviation, found.x - factor * deviation, found.x + factor * deviation,
        covariance / np.outer(deviation, deviation), at_bound, directions, freedom, factor,
        float(np.sum(found.residuals**2)),
    )  # fmt: skip


def quantile(problem: FitProblem) -> float:
    """Half the width of the interval in deviations: of Student's distribution where deviations are estimated.

    With the degrees of freedom by which they are estimated (`least_squares.deviation_of`).
    """
    from scipy.stats import norm, t

    level = 0.5 + 0.5 * problem.fit.confidence
    estimated = bool(np.any(np.isnan(stated_deviations(problem))))
    freedom = max(problem.count - len(problem.names), 1)
    return float(t.ppf(level, freedom) if estimated else norm.ppf(level))


def _bounds(problem: FitProblem, found: Minimum) -> FloatArray:
    """(p,) which estimates are held by a bound, from which the cost falls no more: -1 lower, 1 upper, else 0."""
    near = AT_BOUND * (problem.upper - problem.lower)
    _, influence, _ = loss(problem.fit.loss, found.residuals)
    slope = found.jacobian.T @ influence
    at_bound = np.zeros(len(found.x))
    at_bound[(found.x - problem.lower <= near) & (slope > 0.0)] = -1.0
    at_bound[(problem.upper - found.x <= near) & (slope < 0.0)] = 1.0
    return at_bound


def _directions(problem: FitProblem, scaled: FloatArray, free: IndexArray) -> tuple[list[Direction], FloatArray]:
    """Directions that the data hardly know, the least known first; and (free, known) those that they know at all."""
    if not len(free):
        return [], np.zeros((0, 0))
    _, values, vectors = np.linalg.svd(scaled, full_matrices=False)
    unknown = values <= NEGLIGIBLE_SINGULAR_VALUE * values[0] if values[0] > 0.0 else np.ones(len(values), dtype=bool)
    poorly_known = []
    for value, vector, nothing in zip(values[::-1], vectors[::-1], unknown[::-1], strict=True):
        if nothing or value < 1.0:
            vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
            shares = {
                problem.names[i]: float(share)
                for i, share in zip(free, vector, strict=True)
                if abs(share) >= TAKES_PART
            }
            poorly_known.append(Direction(shares, float(value), bool(nothing)))
    return poorly_known, vectors[~unknown].T


def _inverse(matrix: FloatArray, known: FloatArray) -> FloatArray:
    """The inverse of a symmetric matrix in the space that some directions (p, k) span, zero beside it."""
    return known @ np.linalg.pinv(known.T @ matrix @ known, hermitian=True) @ known.T
