"""Which variables a bracket of the volume row's multiplier decides: compiled passes over all of them.

Most of very many variables rest: they sit on a bound, and every multiplier of the bracket keeps them there. Of those
nothing is computed but the test; the others, often a few per cent, are gathered first.

Costs and bounds whose numbers are all alike may be given as the first few of them (`wide_passes`). Threads share pieces
of variables; sums of the pieces are added in order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.compiler.jit import inline, kernel, member_kernel
from mdstopo.compiler.padding import whole_vectors
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.vector import fetch, lanes, larger, load, magnitude, negative, store, total, unmarked, zero
from mdstopo.optimizer.powers import primitives
from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.optimizer.wide_passes import PIECE, RUN, part, pieces
from mdstopo.optimizer.wide_slots import BLOCK, ROW, WHOLE, box, enter_slot

#: variables that move and from which on threads share what is done with them
CROWD = 50_000
#: how many variables ahead of a pass their numbers are fetched
FETCHED_AHEAD = 256
#: rows of room, each of `ROW` numbers
_ROOM = 9


@inline
def one(x: Floats, n: int, i: int) -> float:
    """The entry x[i] of an array of n numbers, or of a shorter one whose numbers are all alike."""
    return float(x[i if len(x) == n else 0])


@kernel
def fix_by_bracket(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    near: float, far: float, threads: int, out: Floats, slots: Floats, place: Ints, listed: Ints, counts: Ints,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Decide the variables for which all multipliers of a bracket give the same end of the box; slots for the others.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
      shift (N,): distances of the shifts, in ranges.
      limits (5,): exponent xi; longest step; trust box in ranges; share of a shift's distance; kappa times range.
    In:
      alpha (N,): the iterate.
      near, far: ends of the bracket.
      threads: how many work.
    Out:
      out (N,): where the decided variables end.
      slots (SLOTS, n), place (n,): the variables in doubt, as in `wide_slots`; room for N.
      listed (N,): from each piece's place on, its variables in doubt, then the others that do not rest.
      counts (2, pieces): how many are in doubt, and how many do not rest.

    Returns how many slots there are and, over the decided variables, the sums of a x and |a x| and the change of the
    model.
    """
    count = pieces(len(alpha))
    sums = np.empty((count, 3))
    begin = np.empty(count + 1, np.int64)
    counter = np.zeros(2, np.int64)
    shared(
        _sort_pieces, threads,
        (counter[:1], alpha, slope, cost, shift, lower, upper, limits, near, far, out, listed, sums, counts),
    )  # fmt: skip
    n: int = np.int64(0)  # type: ignore[assignment]  # a 0 as written has its callees compiled once more, for that type
    held, size, change = 0.0, 0.0, 0.0
    for piece in range(count):
        change += sums[piece, 0]
        held += sums[piece, 1]
        size += sums[piece, 2]
        begin[piece] = n
        n += counts[0, piece]
    begin[count] = n
    shared(
        _slot_pieces, threads if n > CROWD else 1,
        (counter[1:], alpha, slope, cost, shift, lower, upper, limits, listed, begin, slots, place),
    )  # fmt: skip
    return n, held, size, change


@kernel
def _sort_pieces(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, near: float, far: float, out: Floats, listed: Ints, sums: Floats, counts: Ints,
) -> None:  # fmt: skip
    """What `fix_by_bracket` does with the pieces of variables that this thread takes, before there are slots.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
      shift (N,): distances of the shifts, in ranges.
      limits (5,): exponent xi; longest step; trust box in ranges; share of a shift's distance; kappa times range.
    In:
      alpha (N,): the iterate.
      near, far: ends of the bracket.
    Out:
      counter (1,): the next piece that nobody has taken.
      out (N,): where the decided variables end.
      listed (N,): from each piece's place on, its variables in doubt, then the others that do not rest.
      sums (pieces, 3): of each piece's decided variables the change of the model, the sum of a x and that of |a x|.
      counts (2, pieces): how many are in doubt, and how many do not rest.
    """
    room, whole = np.empty((_ROOM, ROW)), np.empty((WHOLE, ROW), dtype=np.int64)
    which = np.empty(PIECE + BLOCK, dtype=np.int64)
    N = len(alpha)
    piece = taken(counter)
    while piece < len(sums):
        start, stop = piece * PIECE, min((piece + 1) * PIECE, N)
        c, s, a, y = alpha[start:stop], slope[start:stop], part(cost, N, start, stop), out[start:stop]
        low, high = part(lower, N, start, stop), part(upper, N, start, stop)
        moving = _moving(c, s, a, shift[start:stop], low, high, near, far, y, which, sums[piece])
        places = np.array([0, moving])
        for k in range(0, moving, BLOCK):
            _sort_block(
                c, s, a, shift[start:stop], low, high, limits, near, far, which[k : k + BLOCK], min(moving - k, BLOCK),
                room, whole, y, start, listed[start:stop], places, sums[piece],
            )  # fmt: skip
        counts[0, piece], counts[1, piece] = places[0], moving
        piece = taken(counter)


@member_kernel
def _moving(
    c: Floats, s: Floats, a: Floats, shift: Floats, lower: Floats, upper: Floats, near: float, far: float, y: Floats,
    which: Ints, sums: Floats,
) -> int:  # fmt: skip
    """Which variables of a piece do not rest; those beyond its last whole vector are among them.

    In, all (m,) of the piece:
      c, s, a: the iterate, the row's gradient, the coefficients of the volume row.
      shift: distances of the shifts; fetched for those that do not rest, because `_sort_block` asks for it next.
      lower, upper: the bounds.
      near, far: ends of the bracket of the multiplier.
    Out:
      y (m,): the iterate, as far as whole vectors go.
      which (PIECE + BLOCK,): the variables that do not rest, counted from the piece's first.
      sums (3,): 0, then the sum of a x and that of |a x| over those that rest.

    Returns how many do not rest.
    """
    n = len(c) // lanes() * lanes()
    count: int = np.int64(0)  # type: ignore[assignment]  # as in `fix_by_bracket`
    sums[0], sums[1], sums[2] = 0.0, 0.0, 0.0
    for start in range(0, n, RUN):
        held, weight = zero(), zero()
        for i in range(start, min(start + RUN, n), lanes()):
            fetch(c, i + FETCHED_AHEAD)
            fetch(s, i + FETCHED_AHEAD)
            fetch(y, i + FETCHED_AHEAD)
            at, cost, push = load(c, i), load(a, i), load(s, i)
            one, other = near * cost, far * cost
            most, least = push + larger(one, other), larger(-1.0 * one, -1.0 * other) - push
            store(y, i, at)
            # one that rises rests at its upper end, one that falls at its lower: neither of two differences is above 0
            rising, falling = larger(most, load(upper, i) - at), larger(least, at - load(lower, i))
            moving = negative(larger(-1.0 * rising, -1.0 * falling))
            spent = cost * at
            if moving:
                spent = unmarked(spent, moving)
                fetch(shift, i)
                for k in range(lanes()):
                    which[count] = i + k
                    count += (moving >> k) & 1
            held += spent
            weight += magnitude(spent)
        sums[1] += total(held)
        sums[2] += total(weight)
    for i in range(n, len(c)):
        which[count] = i
        count += 1
    return count


@member_kernel
def _sort_block(
    c: Floats, s: Floats, a: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats, near: float,
    far: float, which: Ints, moving: int, room: Floats, whole: Ints, y: Floats, start: int, listed: Ints, places: Ints,
    sums: Floats,
) -> None:  # fmt: skip
    """Decide a block of those variables of a piece that do not rest.

    In, c to upper (m,) of the piece:
      c, s, a: the iterate, the row's gradient, the coefficients of the volume row.
      shift: distances of the shifts, in ranges.
      lower, upper: the bounds.
      limits (5,): exponent xi; longest step; trust box in ranges; share of a shift's distance; kappa times range.
      near, far: ends of the bracket of the multiplier.
      moving: how many variables the block has.
      start: the piece's first variable.
    Out:
      which (BLOCK,): the block's variables, counted from the piece's first; filled up to whole vectors with the last.
      room (_ROOM, ROW), whole (WHOLE, ROW): numbers and integers to work with.
      y (m,): the end of the box to which each of them would go.
      listed (m,): the variables in doubt from the front, the decided ones from behind.
      places (2,): where in `listed` the next one in doubt goes, and one more than where the next decided one goes.
      sums (3,): of the decided ones the change of the model, the sum of a x and that of |a x|, added to.
    """
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    slope, cost, reach, kappa, step = room[0], room[1], room[2], room[3], room[4]
    end, z, value, known = room[5], room[6], room[7], room[8]
    n = whole_vectors(moving)
    for k in range(moving, n):
        which[k] = which[moving - 1]
    for k in range(n):
        i = which[k]
        low, high, reach[k], span = box(c[i], lower[i], upper[i], shift[i], move, trust, share)
        slope[k], cost[k], kappa[k] = s[i], a[i], convex / span
        end[k] = high if s[i] + max(near * a[i], far * a[i]) < 0.0 else low
        step[k] = end[k] - c[i]
    for k in range(n):
        z[k] = (step[k] if slope[k] < 0.0 else -step[k]) / reach[k]
    primitives(z[:n], power, value[:n], whole)
    for k in range(n):
        # the derivative there, times 1 + z, towards its sign where the slope leaves no doubt
        most = slope[k] + max(near * cost[k], far * cost[k])
        least = slope[k] + min(near * cost[k], far * cost[k])
        t = 1.0 + z[k]
        more = slope[k] * (power * value[k] - z[k]) + kappa[k] * step[k] * t
        up, down = -(more + most * t), more + least * t
        ahead = down if least > 0.0 else -1.0
        known[k] = 1.0 if (up if most < 0.0 else ahead) >= 0.0 else 0.0
    change, held, weight = 0.0, 0.0, 0.0
    for k in range(moving):
        change += known[k] * (0.5 * kappa[k] * step[k] * step[k] - abs(slope[k]) * reach[k] * value[k])
    for k in range(moving):
        spent = known[k] * cost[k] * end[k]
        held += spent
        weight += abs(spent)
    doubt, others = places[0], places[1]
    for k in range(moving):
        i = which[k]
        y[i] = end[k]
        # written at both ends, of which one is kept: a branch here would often be taken wrongly
        listed[doubt], listed[others - 1] = start + i, start + i
        doubt += 1 if known[k] == 0.0 else 0
        others -= 0 if known[k] == 0.0 else 1
    places[0], places[1] = doubt, others
    sums[0] += change
    sums[1] += held
    sums[2] += weight


@kernel
def _slot_pieces(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, listed: Ints, begin: Ints, slots: Floats, place: Ints,
) -> None:  # fmt: skip
    """Slots for the variables in doubt, of the pieces that this thread takes.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
      shift (N,): distances of the shifts, in ranges.
      limits (5,): exponent xi; longest step; trust box in ranges; share of a shift's distance; kappa times range.
    In:
      alpha (N,): the iterate.
      listed (N,): from each piece's place on, its variables in doubt.
      begin (pieces + 1,): the first slot of each piece, and how many there are in all.
    Out:
      counter (1,): the next piece that nobody has taken.
      slots (SLOTS, n), place (n,): the variables in doubt, as in `wide_slots`.
    """
    move, trust, share, convex = limits[1], limits[2], limits[3], limits[4]
    N = len(alpha)
    piece = taken(counter)
    while piece < len(begin) - 1:
        for n in range(begin[piece], begin[piece + 1]):
            i = listed[piece * PIECE + n - begin[piece]]
            end, other, a = one(lower, N, i), one(upper, N, i), one(cost, N, i)
            low, high, reach, span = box(alpha[i], end, other, shift[i], move, trust, share)
            enter_slot(slots, place, n, i, alpha[i], slope[i], a, low, high, reach, convex / span)
        piece = taken(counter)


@kernel
def measure(
    alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float, steepest: float,
    threads: int, out: Floats, listed: Ints, counts: Ints,
) -> tuple[float, float, float]:  # fmt: skip
    """The KKT residual and the largest changes, of the variables that do not rest, which are all that can tell.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
    In:
      alpha (N,): the iterate.
      multiplier: of the volume row.
      steepest: the largest gradient entry.
      threads: how many work.
      out (N,): the new design.
      counts (2, pieces): in the second row, how many variables of each piece do not rest.
    Out:
      listed (N,): from each piece's place on, these variables; becomes four times each, and 1 if it rises, 2 if it
        falls.

    Returns max |x - clip(x - (slope + multiplier cost)/steepest)|, at most what a step along -gradient moves, x being
    the iterate; max |out - alpha|; and the same in ranges.
    """
    count = counts.shape[1]
    most = np.empty((count, 3))
    moving = 0
    for piece in range(count):
        moving += counts[1, piece]
    counter = np.zeros(1, np.int64)
    shared(
        _measure_pieces, threads if moving > CROWD else 1,
        (counter, alpha, slope, cost, lower, upper, multiplier, 1.0 / steepest, out, listed, counts, most),
    )  # fmt: skip
    residual, plain, scaled = 0.0, 0.0, 0.0
    for piece in range(count):
        residual = max(residual, most[piece, 0])
        plain, scaled = max(plain, most[piece, 1]), max(scaled, most[piece, 2])
    return residual, plain, scaled


@kernel
def _measure_pieces(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float,
    unit: float, out: Floats, listed: Ints, counts: Ints, most: Floats,
) -> None:  # fmt: skip
    """What `measure` does with the pieces of variables that this thread takes.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
    In:
      alpha (N,): the iterate.
      multiplier: of the volume row.
      unit: what the gradient is multiplied by, 1 over its largest entry.
      out (N,): the new design.
      counts (2, pieces): in the second row, how many variables of each piece do not rest.
    Out:
      counter (1,): the next piece that nobody has taken.
      listed (N,): from each piece's place on, these variables; becomes four times each, and 1 if it rises, 2 if it
        falls.
      most (pieces, 3): of each piece, the residual, the largest change, and that in ranges.
    """
    N = len(alpha)
    piece = taken(counter)
    while piece < len(most):
        residual, plain, scaled = 0.0, 0.0, 0.0
        for k in range(piece * PIECE, piece * PIECE + counts[1, piece]):
            i = listed[k]
            x, low, high = alpha[i], one(lower, N, i), one(upper, N, i)
            moved = x - (slope[i] + multiplier * one(cost, N, i)) * unit
            step = out[i] - x
            change = abs(step)
            listed[k] = 4 * i + (1 if step > 0.0 else (2 if step < 0.0 else 0))
            residual = max(residual, abs(x - max(low, min(high, moved))))
            plain = max(plain, change)
            scaled = max(scaled, change / (high - low if high > low else 1.0))
        most[piece, 0], most[piece, 1], most[piece, 2] = residual, plain, scaled
        piece = taken(counter)
