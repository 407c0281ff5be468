"""Single passes over very many variables, shared by threads: results do not depend on the number of threads.

Of an array whose numbers are all alike the first `PIECE` may be given: what is not read from memory costs nothing.
"""

import numpy as np

from mdstopo.jit import kernel, member_kernel, vector_entry
from mdstopo.native.threads import shared, taken
from mdstopo.optimizer.powers import largest
from mdstopo.optimizer.problem import Floats, Ints

#: variables that a thread takes at once
PIECE = 8192


@kernel
def pieces(n: int) -> int:
    """How many pieces n variables are."""
    return (n + PIECE - 1) // PIECE


@member_kernel
def part(x: Floats, n: int, start: int, stop: int) -> Floats:
    """x[start:stop] of an array of n, or of one whose numbers are alike."""
    return x[start:stop] if len(x) == n else x[: stop - start]


@vector_entry
def wide_shift(
    shift: Floats, last: Floats, before: Floats, trial: Floats, alpha: Floats, grow: float, shrink: float, least: float,
    most: float, threads: int, shifts: Floats,
) -> None:  # fmt: skip
    """The new `shifts` after the step from alpha to the trial, which followed the one from `before` to `last`."""
    counter = np.zeros(1, np.int64)
    shared(_shifted, threads, (counter, shift, last, before, trial, alpha, grow, shrink, least, most, shifts))


@member_kernel
def _shifted(
    counter: Ints, shift: Floats, last: Floats, before: Floats, trial: Floats, alpha: Floats, grow: float,
    shrink: float, least: float, most: float, shifts: Floats,
) -> None:  # fmt: skip
    piece = taken(counter)
    while piece * PIECE < len(shift):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, len(shift))
        was, far, to, origin = shift[start:stop], shifts[start:stop], last[start:stop], before[start:stop]
        y, x = trial[start:stop], alpha[start:stop]
        for i in range(stop - start):
            agreement = (to[i] - origin[i]) * (y[i] - x[i])
            factor = grow if agreement > 0.0 else (shrink if agreement < 0.0 else 1.0)
            far[i] = min(max(was[i] * factor, least), most)
        piece = taken(counter)


@vector_entry
def wide_change(x: Floats, y: Floats, unit: Floats, threads: int) -> tuple[float, float]:
    """max |x - y|, and the largest in its unit."""
    plain, scaled = np.zeros(pieces(len(x))), np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_changes, threads, (counter, x, y, unit, plain, scaled))
    return largest(plain), largest(scaled)


@member_kernel
def _changes(counter: Ints, x: Floats, y: Floats, unit: Floats, plain: Floats, scaled: Floats) -> None:
    room = np.empty(PIECE)
    piece = taken(counter)
    while piece < len(plain):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, len(x))
        one, other, wide, n = x[start:stop], y[start:stop], part(unit, len(x), start, stop), stop - start
        for i in range(n):
            room[i] = one[i] - other[i]
        plain[piece] = largest(room[:n])
        for i in range(n):
            room[i] /= wide[i]
        scaled[piece] = largest(room[:n])
        piece = taken(counter)


@vector_entry
def wide_largest(x: Floats, threads: int) -> float:
    """max |x|; NaN where one is NaN."""
    most = np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_sizes, threads, (counter, x, most))
    return largest(most)


@member_kernel
def _sizes(counter: Ints, x: Floats, out: Floats) -> None:
    piece = taken(counter)
    while piece < len(out):
        out[piece] = largest(x[piece * PIECE : min((piece + 1) * PIECE, len(x))])
        piece = taken(counter)


@vector_entry
def wide_sum(a: Floats, x: Floats, threads: int) -> float:
    """sum of a x, of pieces and these in their order."""
    sums = np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_sums, threads, (counter, a, x, sums))
    total = 0.0
    for piece in range(len(sums)):
        total += sums[piece]
    return total


@member_kernel
def _sums(counter: Ints, a: Floats, x: Floats, out: Floats) -> None:
    piece = taken(counter)
    while piece < len(out):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, len(x))
        one, other, total = part(a, len(x), start, stop), x[start:stop], 0.0
        for i in range(stop - start):
            total += one[i] * other[i]
        out[piece] = total
        piece = taken(counter)
