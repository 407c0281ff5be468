"""Single passes over very many variables, as Python calls them; NumPy's where the variables are few."""

from math import gcd, isfinite

import numpy as np

from mdstopo.compiler.threads import allowed
from mdstopo.optimizer.problem import Floats
from mdstopo.optimizer.wide_passes import wide_largest, wide_sum

#: variables from which on memory counts: single passes are compiled too, no cuts are kept, what is alike is not read
#: again
VERY_MANY_VARIABLES = 10_000
#: variables from which on threads share a pass
SHARED = 200_000
#: the same of a pass that does so little that making threads would cost as much
LIGHT = 400_000
#: numbers up to which Python is faster than NumPy
FEW_NUMBERS = 8


def steepest(gradients: Floats) -> Floats:
    """The largest size of an entry of each row (R,) of gradients (R, N); NaN where one is NaN."""
    if gradients.shape[1] < VERY_MANY_VARIABLES:
        return np.asarray(np.abs(gradients).max(axis=1, initial=0.0))
    return np.array([_largest(np.ascontiguousarray(row)) for row in gradients])


def finite(numbers: Floats) -> bool:
    """Whether all numbers are finite."""
    if numbers.size <= FEW_NUMBERS:
        return all(map(isfinite, numbers.ravel().tolist()))
    if numbers.size < VERY_MANY_VARIABLES or not numbers.flags.c_contiguous:
        return bool(np.isfinite(numbers).all())
    return isfinite(_largest(numbers.reshape(-1)))


def _largest(x: Floats) -> float:
    """max |x| of very many; NaN where one is NaN."""
    return wide_largest(x, threads_for(len(x), LIGHT))


def total(a: Floats, x: Floats) -> float:
    """a x of very many variables, summed in a fixed order."""
    return wide_sum(a, x, threads_for(len(x), LIGHT))


def stride(n: int, sample: int) -> int:
    """The step between the variables of a sample of about `sample` out of n.

    It has no common factor with n, so that the sample does not keep step with rows of a grid.
    """
    found = max(1, n // sample)
    while gcd(found, n) != 1:
        found += 1
    return found


def threads_for(n: int, enough: int | None = None) -> int:
    """How many threads share a pass over n variables, where sharing pays from `enough` on."""
    return allowed() if n >= (SHARED if enough is None else max(enough, SHARED)) else 1
