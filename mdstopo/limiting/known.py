"""Known functions of time that are cubic within segments: prescribed motions, and what known loads do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Cubics:
    """n functions of time. times (S + 1,): ends of the segments, s.

    coefficients (S, n, 4): of the powers of t - times[k] in segment k. A function may jump between segments.
    """

    times: Floats
    coefficients: Floats

    def mapped(self, matrix: Floats) -> Cubics:
        """matrix (m, n) times the functions: m functions."""
        return Cubics(self.times, np.einsum("ij,sjk->sik", matrix, self.coefficients))

    def plus(self, other: Cubics) -> Cubics:
        """The sum of the functions and others over the same segments."""
        return Cubics(self.times, self.coefficients + other.coefficients)

    def minus(self, constants: Floats) -> Cubics:
        """The functions, less constants (n,)."""
        coefficients = self.coefficients.copy()
        coefficients[:, :, 0] -= constants
        return Cubics(self.times, coefficients)

    def segment(self, t: Floats) -> NDArray[np.intp]:
        """(T,) the segment that begins at or before each time; the last one at the end."""
        return np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, len(self.times) - 2)

    def at(self, t: Floats, order: int = 0) -> Floats:
        """(T, n) values (order 0), or derivatives of order 1 or 2; where a function jumps, the value after the jump."""
        return self._within(self.segment(t), t, order)

    def at_ends(self, left: Floats, right: Floats, order: int) -> tuple[Floats, Floats]:
        """(C, n) twice: at the ends of cells that do not reach beyond a segment, as seen from within the cell."""
        segment = self.segment(0.5 * (left + right))
        return self._within(segment, left, order), self._within(segment, right, order)

    def _within(self, segment: NDArray[np.intp], t: Floats, order: int) -> Floats:
        s = (t - self.times[segment])[:, None]
        c = np.moveaxis(self.coefficients[segment], 2, 0)
        if order == 0:
            values = c[0] + s * (c[1] + s * (c[2] + s * c[3]))
        elif order == 1:
            values = c[1] + s * (2.0 * c[2] + 3.0 * s * c[3])
        else:
            values = 2.0 * c[2] + 6.0 * s * c[3]
        return np.asarray(values, dtype=np.float64)


def with_second_derivative(times: Floats, values: Floats, start: Floats, rate: Floats) -> Cubics:
    """The functions whose second derivative is linear in each segment.

    values (S, n, 2): the second derivative after each segment's start, and its slope; start, rate (n,): the functions
    and their first derivatives at times[0].
    """
    count, n = len(times) - 1, values.shape[1]
    coefficients = np.empty((count, n, 4))
    position, velocity = np.array(start, dtype=np.float64), np.array(rate, dtype=np.float64)
    for k in range(count):
        h = times[k + 1] - times[k]
        c2, c3 = 0.5 * values[k, :, 0], values[k, :, 1] / 6.0
        coefficients[k] = np.stack([position, velocity, c2, c3], axis=1)
        position = position + h * (velocity + h * (c2 + h * c3))
        velocity = velocity + h * (2.0 * c2 + 3.0 * h * c3)
    return Cubics(times, coefficients)
