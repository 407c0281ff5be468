"""What becomes of an integral over time: formulas of the reductions that follow from one (`case.methods.over_time`).

Each is called with the integral of the response, or of its square, and the simulated time (s). It returns the value and
its derivative by the integral.
"""

import functools
import math
from pkgutil import resolve_name

from mdstopo.case.methods.over_time import ReductionKind

_function = functools.cache(resolve_name)


def value_of_integral(reduction: ReductionKind, total: float, span: float) -> tuple[float, float]:
    """The value of a reduction, and its derivative by the integral; total, span: as above."""
    value, slope = _function(reduction.formula)(total, span)
    return value, slope


def integral(total: float, span: float) -> tuple[float, float]:
    """The reduction that is the integral itself."""
    return total, 1.0


def mean(total: float, span: float) -> tuple[float, float]:
    """The reduction that is the integral divided by the time."""
    return total / span, 1.0 / span


def root_mean_square(total: float, span: float) -> tuple[float, float]:
    """The root of the mean of the squares; where that is 0, its infinite derivative counts as 0."""
    value = math.sqrt(max(total / span, 0.0))
    return value, 0.5 / (span * value) if value > 0.0 else 0.0
