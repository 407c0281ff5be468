"""Measures of a random sample with intervals of confidence: what a fresh sample says of a design.

    mean              m +- t s / sqrt(n), t of Student's distribution with n - 1 degrees of freedom
    mean_deviation    the same with the deviation of the influences (y - m) + k ((y - m)^2 - s^2) / (2 s) for s
    quantile          between two order statistics whose places the binomial distribution gives: holds for any
                      distribution of y (David and Nagaraja 2003, section 7.1)

The worst of n points is not a property of the distribution, but one more point exceeds it with probability 1/(n + 1).
So it is compared with the quantile of level 1 - 1/(n + 1) = n/(n + 1).
"""

import math
from dataclasses import dataclass

import numpy as np

from mdstopo.evaluation import FloatArray

CONFIDENCE = 0.95
#: by how much, relatively, sums of the same numbers may differ
ROUNDING = 1e-12


@dataclass(frozen=True)
class Estimate:
    """A measure of a sample, and the interval that holds that of the distribution with the probability CONFIDENCE.

    An end that the sample is too small for is infinite.
    """

    value: float
    low: float
    high: float

    def holds(self, value: float) -> bool:
        """Whether a value lies within the interval, or outside by no more than the rounding of sums."""
        slack = ROUNDING * abs(value)
        return self.low - slack <= value <= self.high + slack


def student(degrees: int, confidence: float = CONFIDENCE) -> float:
    """How many deviations to each side hold the share `confidence` of Student's distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + 0.5 * confidence))


def order_statistics(rising: FloatArray, level: float) -> tuple[float, float]:
    """The values between which the quantile is, from n rising values."""
    n = len(rising)
    tail = 0.5 * (1.0 - CONFIDENCE)
    # P(B <= k), B binomial: how many of n values are at most the quantile
    logs = [
        math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1) + k * math.log(level) + _rest(n - k, level)
        for k in range(n + 1)
    ]
    below = np.cumsum(np.exp(logs))
    low = int(np.searchsorted(below, tail, side="right"))  # the first k with P(B <= k) > tail
    high = int(np.searchsorted(below, 1.0 - tail, side="left")) + 1  # the first k with P(B <= k - 1) >= 1 - tail
    least = float(rising[low - 1]) if low >= 1 else -math.inf
    most = float(rising[high - 1]) if high <= n else math.inf
    return least, most


def _rest(count: int, level: float) -> float:
    """count log(1 - level)."""
    if count == 0:
        return 0.0
    return count * math.log1p(-level) if level < 1.0 else -math.inf
