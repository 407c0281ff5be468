"""Vectors of numbers as values in kernels, for loops that the compiler's own vectoriser leaves slow.

A loop in steps of `lanes()` works on vectors as another would on numbers: `load`, `store`, the operators + - * between
vectors and floats, `inverse_root`, `total` and their like. The arrays' length must be a multiple of `lanes()`, as the
padding of blocks of members is.

The processor decides what becomes of it: eight lanes, and an instruction that begins 1/sqrt, where there is AVX-512;
four elsewhere, with a square root and a division. Run as Python (`py_func`), these functions work on NumPy arrays.
"""

import numpy as np
from numpy.typing import NDArray

from mdstopo.compiler.kernel import when_compiling

Floats = NDArray[np.float64]

#: lanes of the widest vectors, and of the others
WIDE, NARROW = 8, 4


def lanes() -> int:
    """How many numbers a vector has."""
    return WIDE


def zero() -> Floats:
    """A vector of zeros."""
    return np.zeros(lanes())


def load(array: Floats, i: int) -> Floats:
    """The numbers of a contiguous array from i on; fast where the address is a multiple of 64."""
    return array[i : i + lanes()].copy()


def store(array: Floats, i: int, vector: Floats) -> None:
    """Write a vector into a contiguous array from i on."""
    array[i : i + len(vector)] = vector


def total(vector: Floats) -> float:
    """The sum of a vector's numbers, halves added to halves."""
    while len(vector) > 1:
        half = len(vector) // 2
        vector = vector[:half] + vector[half:]
    return float(vector[0])


def inverse_root(vector: Floats, floor: float) -> Floats:
    """1/sqrt(x) to rounding where x > floor, else 0; floor is at least the smallest normal number."""
    with np.errstate(all="ignore"):
        return where_larger(vector, floor, 1.0 / np.sqrt(vector))


def where_larger(vector: Floats, floor: float | Floats, value: Floats) -> Floats:
    """The value where x > floor, else 0; floor is a number, or one for each lane."""
    return np.where(vector > floor, value, 0.0)


def magnitude(vector: Floats) -> Floats:
    """|x|."""
    return np.abs(vector)


def larger(one: Floats, other: Floats) -> Floats:
    """The larger of two numbers in each lane; the other where one is NaN."""
    return np.where(one > other, one, other)


def largest(vector: Floats) -> float:
    """The largest of a vector's finite numbers."""
    return float(vector.max())


def unmarked(vector: Floats, bits: int) -> Floats:
    """The numbers in lanes whose bits are clear, 0 in the others."""
    return np.where((bits >> np.arange(len(vector))) & 1, 0.0, vector)


def fetch(array: Floats, i: int) -> None:
    """Have what lies at array[i] brought near, because it will be asked for; i may be behind the end."""


def negative(vector: Floats) -> int:
    """Bit k is set where the number in lane k is below zero."""
    return int(((vector < 0.0) << np.arange(len(vector))).sum())


@when_compiling
def _register() -> None:
    """Make the functions of this module known to Numba."""
    import mdstopo.compiler.vector_lowering  # noqa: F401
