"""Single passes over very many variables, shared by threads: results do not depend on the number of threads."""

import numpy as np

from mdstopo.jit import kernel, member_kernel, vector_entry
from mdstopo.native.threads import shared, taken
from mdstopo.optimizer.problem import Floats, Ints

#: variables that a thread takes at once
PIECE = 8192


@vector_entry
def wide_residual(
    alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float, steepest: float,
    threads: int,
) -> float:  # fmt: skip
    """max |x - clip(x - (slope + multiplier cost)/steepest)|, at most what a step along -gradient moves."""
    most = np.zeros(_pieces(len(alpha)))
    counter = np.zeros(1, np.int64)
    shared(_residuals, threads, (counter, alpha, slope, cost, lower, upper, multiplier, steepest, most))
    return float(most.max())


@member_kernel
def _residuals(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float,
    steepest: float, out: Floats,
) -> None:  # fmt: skip
    piece = taken(counter)
    while piece < len(out):
        most = 0.0
        for i in range(piece * PIECE, min((piece + 1) * PIECE, len(alpha))):
            moved = alpha[i] - (slope[i] + multiplier * cost[i]) / steepest
            most = max(most, abs(alpha[i] - max(lower[i], min(upper[i], moved))))
        out[piece] = most
        piece = taken(counter)


@vector_entry
def wide_adapt(
    shift: Floats, last: Floats, trial: Floats, alpha: Floats, grow: float, shrink: float, least: float, most: float,
    threads: int, steps: Floats, shifts: Floats,
) -> None:  # fmt: skip
    """In one pass what follows an accepted step: `steps` (2, N), the last one and this one, and the new `shifts`."""
    counter = np.zeros(1, np.int64)
    shared(_adapted, threads, (counter, shift, last, trial, alpha, grow, shrink, least, most, steps, shifts))


@member_kernel
def _adapted(
    counter: Ints, shift: Floats, last: Floats, trial: Floats, alpha: Floats, grow: float, shrink: float,
    least: float, most: float, steps: Floats, shifts: Floats,
) -> None:  # fmt: skip
    piece = taken(counter)
    while piece * PIECE < len(shift):
        for i in range(piece * PIECE, min((piece + 1) * PIECE, len(shift))):
            step = trial[i] - alpha[i]
            agreement = last[i] * step
            factor = grow if agreement > 0.0 else (shrink if agreement < 0.0 else 1.0)
            steps[0, i] = last[i]
            steps[1, i] = step
            shifts[i] = min(max(shift[i] * factor, least), most)
        piece = taken(counter)


@vector_entry
def wide_change(x: Floats, y: Floats, unit: Floats, threads: int) -> tuple[float, float]:
    """max |x - y|, and the largest in its unit."""
    plain, scaled = np.zeros(_pieces(len(x))), np.zeros(_pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_changes, threads, (counter, x, y, unit, plain, scaled))
    return float(plain.max()), float(scaled.max())


@member_kernel
def _changes(counter: Ints, x: Floats, y: Floats, unit: Floats, plain: Floats, scaled: Floats) -> None:
    piece = taken(counter)
    while piece < len(plain):
        most, largest = 0.0, 0.0
        for i in range(piece * PIECE, min((piece + 1) * PIECE, len(x))):
            change = abs(x[i] - y[i])
            most = max(most, change)
            largest = max(largest, change / unit[i])
        plain[piece], scaled[piece] = most, largest
        piece = taken(counter)


@kernel
def _pieces(n: int) -> int:
    return (n + PIECE - 1) // PIECE
