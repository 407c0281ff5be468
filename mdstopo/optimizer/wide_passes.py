"""Single passes over very many variables, shared by threads: results do not depend on the number of threads.

Of an array whose numbers are all alike the first `PIECE` may be given: what is not read from memory costs nothing.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, member_kernel, vector_entry
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.vector import fetch, lanes, load, total, zero
from mdstopo.optimizer.powers import largest
from mdstopo.optimizer.problem import Floats, Ints

#: variables that a thread takes at once, and how many are summed in vectors before these are: long sums of like terms
#: are all rounded to one side
PIECE, RUN = 8192, 512

#: how many variables ahead of a loop over some of them their numbers are fetched
FETCHED_AHEAD = 32


@kernel
def pieces(n: int) -> int:
    """Into how many pieces n variables are divided."""
    return (n + PIECE - 1) // PIECE


@member_kernel
def part(x: Floats, n: int, start: int, stop: int) -> Floats:
    """The part x[start:stop] of an array of n numbers, or of a shorter one whose numbers are all alike."""
    return x[start:stop] if len(x) == n else x[: stop - start]


@vector_entry
def wide_shift(
    shift: Floats, last: Floats, before: Floats, trial: Floats, alpha: Floats, rule: Floats, threads: int,
    shifts: Floats,
) -> None:  # fmt: skip
    """Adapt the distances of the shifts after a step: larger where it goes on as the last one, smaller where it turns.

    In:
      shift (N,): the distances so far, in ranges.
      last, before (N,): the designs to which and from which the last step led.
      trial, alpha (N,): those of this step.
      rule (4,): factors where the steps agree and oppose each other, smallest and largest distance.
      threads: how many work.
    Out:
      shifts (N,): the new distances.
    """
    counter = np.zeros(1, np.int64)
    shared(_shifted, threads, (counter, shift, last, before, trial, alpha, rule, shifts))


@member_kernel
def _shifted(
    counter: Ints, shift: Floats, last: Floats, before: Floats, trial: Floats, alpha: Floats, rule: Floats,
    shifts: Floats,
) -> None:  # fmt: skip
    """What `wide_shift` does with the pieces of variables that this thread takes.

    In:
      shift (N,): the distances so far, in ranges.
      last, before (N,): the designs to which and from which the last step led.
      trial, alpha (N,): those of this step.
      rule (4,): factors where the steps agree and oppose each other, smallest and largest distance.
    Out:
      counter (1,): the next piece that nobody has taken.
      shifts (N,): the new distances.
    """
    grow, shrink, least, most = rule[0], rule[1], rule[2], rule[3]
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
def wide_shift_few(
    shift: Floats, moves: Ints, counts: Ints, signs_before: Ints, signs: Ints, known: bool, rule: Floats, places: Ints,
    before: Floats, count: Ints,
) -> None:  # fmt: skip
    """Adapt the distances as `wide_shift` does, in place, of those variables alone that have moved.

    In:
      moves (N,): from each piece's place on, who has moved: four times the variable, and 1 if it rose, 2 if it fell.
      counts (2, pieces): in the second row, how many entries of `moves` each piece has.
      signs_before (N/32,): of the last step, two bits a variable as in `moves`; read if `known`.
      known: whether it is known who moved in the last step; else only `signs` is filled.
      rule (4,): factors where the steps agree and oppose each other, smallest and largest distance.
    Out:
      shift (N,): the distances, in ranges, changed in place if `known`.
      signs (N/32,): of this step, as `signs_before`.
      places, before (most,): which distances were changed, and what they were, as `Shifts.following` wants it.
      count (1,): how many of these there are, which grows.
    """
    grow, shrink, least, most = rule[0], rule[1], rule[2], rule[3]
    signs[:] = 0
    n = count[0]
    for piece in range(counts.shape[1]):
        begin, end = piece * PIECE, piece * PIECE + counts[1, piece]
        for k in range(begin, end):
            i, sign = moves[k] >> 2, moves[k] & 3
            word, bit = i >> 5, 2 * (i & 31)
            signs[word] |= sign << bit
            if known:
                fetch(shift, moves[min(k + FETCHED_AHEAD, end - 1)] >> 2)
                was, other = shift[i], (signs_before[word] >> bit) & 3
                found = min(max(was * (grow if sign == other else shrink), least), most)
                found = found if (sign != 0) & (other != 0) else was
                # written always, and counted if it is a change: a branch would wait for memory
                places[n], before[n], count[0] = i, was, n + 1
                shift[i] = found
                n += 1 if found != was else 0
    count[0] = n


@vector_entry
def wide_change(x: Floats, y: Floats, unit: Floats, threads: int) -> tuple[float, float]:
    """The largest change max |x - y|, and the largest in units of each variable, on several threads."""
    plain, scaled = np.zeros(pieces(len(x))), np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_changes, threads, (counter, x, y, unit, plain, scaled))
    return largest(plain), largest(scaled)


@member_kernel
def _changes(counter: Ints, x: Floats, y: Floats, unit: Floats, plain: Floats, scaled: Floats) -> None:
    """What `wide_change` does with the pieces of variables that this thread takes.

    In:
      x, y (N,): the designs.
      unit (N,): ranges, or the first few of them where all are alike.
    Out:
      counter (1,): the next piece that nobody has taken.
      plain (pieces,): of each piece, max |x - y|.
      scaled (pieces,): of each piece, max |x - y| / unit.
    """
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
    """The largest magnitude max |x|, on several threads; NaN where one is NaN."""
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
    """The sum of a x, the same to the bit as `wide_steepest_and_sum` finds it."""
    sums = np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_sums, threads, (counter, a, x, sums))
    return _in_order(sums)


@kernel
def _sums(counter: Ints, a: Floats, x: Floats, out: Floats) -> None:
    piece = taken(counter)
    while piece < len(out):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, len(x))
        out[piece] = _product(part(a, len(x), start, stop), x[start:stop])
        piece = taken(counter)


@vector_entry
def wide_steepest_and_sum(gradient: Floats, a: Floats, x: Floats, threads: int) -> tuple[float, float]:
    """The largest magnitude of a gradient, NaN where one is NaN, and the sum of a x, in one pass."""
    most, sums = np.zeros(pieces(len(x))), np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_steepest_and_sums, threads, (counter, gradient, a, x, most, sums))
    return largest(most), _in_order(sums)


@kernel
def _steepest_and_sums(counter: Ints, gradient: Floats, a: Floats, x: Floats, most: Floats, sums: Floats) -> None:
    """What `wide_steepest_and_sum` does with the pieces of variables that this thread takes.

    In:
      gradient (N,): of which the largest size is wanted.
      a (N,): coefficients, or the first few of them where all are alike.
      x (N,): the design.
    Out:
      counter (1,): the next piece that nobody has taken.
      most (pieces,): of each piece, max |gradient|; NaN where one is NaN.
      sums (pieces,): of each piece, the sum of a x.
    """
    piece = taken(counter)
    while piece < len(most):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, len(x))
        most[piece] = largest(gradient[start:stop])
        sums[piece] = _product(part(a, len(x), start, stop), x[start:stop])
        piece = taken(counter)


@kernel
def _product(a: Floats, x: Floats) -> float:
    """sum of a x of a piece, in an order that no compiler changes: what one pass finds another may have to."""
    n = len(x) // lanes() * lanes()
    whole = 0.0
    for start in range(0, n, RUN):
        one, other = zero(), zero()
        stop = min(start + RUN, n)
        for i in range(start, stop - lanes(), 2 * lanes()):
            one += load(a, i) * load(x, i)
            other += load(a, i + lanes()) * load(x, i + lanes())
        if (stop - start) // lanes() % 2:
            one += load(a, stop - lanes()) * load(x, stop - lanes())
        whole += total(one + other)
    for i in range(n, len(x)):
        whole += a[i] * x[i]
    return whole


@kernel
def _in_order(x: Floats) -> float:
    whole = 0.0
    for i in range(len(x)):
        whole += x[i]
    return whole
