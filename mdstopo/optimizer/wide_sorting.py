"""Which variables a bracket of the volume row's multiplier decides: compiled passes over all of them.

Most of very many variables rest: they sit on a bound, and every multiplier of the bracket keeps them there. Of those
nothing is computed but the test; the others of a block, often a few per cent, are gathered first.

Costs and bounds whose numbers are all alike may be given as the first few of them (`wide_passes`). Threads share blocks
of variables; sums of the blocks are added in order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.jit import inline, kernel, member_kernel
from mdstopo.native.threads import shared, taken
from mdstopo.optimizer.powers import primitives
from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.optimizer.wide_passes import part
from mdstopo.optimizer.wide_slots import BLOCK, WHOLE, box, chosen, enter_slot, whole_vectors

#: blocks that a thread takes at once
GROUP = 8
#: variables that move and from which on threads share what is done with them
CROWD = 50_000
#: rows of the room of a block
_ROOM = 9


@inline
def one(x: Floats, n: int, i: int) -> float:
    """x[i] of an array of n, or of one whose numbers are alike."""
    return float(x[i if len(x) == n else 0])


@kernel
def sort_out(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    near: float, far: float, threads: int, out: Floats, slots: Floats, place: Ints, found: Ints, counts: Ints,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Fill `out` with the ends of the box where a multiplier in [near, far] leaves no doubt; slots for the others.

    found, from each block's place on: those in doubt, then the others that do not rest; counts (2, blocks): of those in
    doubt and of both. Returns how many slots there are and, over the decided variables, the sums of a x and |a x| and
    the change of the model.
    """
    blocks = (len(alpha) + BLOCK - 1) // BLOCK
    sums = np.empty((blocks, 3))
    begin = np.empty(blocks + 1, np.int64)
    counter = np.zeros(2, np.int64)
    shared(
        _sort_blocks, threads,
        (counter[:1], alpha, slope, cost, shift, lower, upper, limits, near, far, out, found, sums, counts),
    )  # fmt: skip
    n: int = np.int64(0)  # type: ignore[assignment]  # a 0 as written has its callees compiled once more, for that type
    total, rest, size, change = 0.0, 0.0, 0.0, 0.0
    for b in range(blocks):
        change += sums[b, 0]
        size += sums[b, 2]
        # with what the addition loses: of a thousand blocks that were more than the row may be missed by
        before = total
        total += sums[b, 1]
        rest += (before - (total - (total - before))) + (sums[b, 1] - (total - before))
        begin[b] = n
        n += counts[0, b]
    begin[blocks] = n
    shared(
        _slot_blocks, threads if n > CROWD else 1,
        (counter[1:], alpha, slope, cost, shift, lower, upper, limits, found, begin, slots, place),
    )  # fmt: skip
    return n, total + rest, size, change


@kernel
def _sort_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, near: float, far: float, out: Floats, found: Ints, sums: Floats, counts: Ints,
) -> None:  # fmt: skip
    """What `sort_out` does with the blocks that are taken; sums: (blocks, 3) change, a x, |a x|."""
    room = np.empty((_ROOM, BLOCK))
    whole = np.empty((WHOLE, BLOCK), dtype=np.int64)
    N = len(alpha)
    group = taken(counter)
    while group * GROUP * BLOCK < N:
        for b in range(group * GROUP, min((group + 1) * GROUP, len(sums))):
            start, stop = b * BLOCK, min((b + 1) * BLOCK, N)
            c, s, a, y = alpha[start:stop], slope[start:stop], part(cost, N, start, stop), out[start:stop]
            low, high = part(lower, N, start, stop), part(upper, N, start, stop)
            moving = _moving(c, s, a, low, high, near, far, room[0], whole[3], y, sums[b])
            doubt = 0
            if moving:
                doubt = _sort_block(
                    c, s, a, shift[start:stop], low, high, limits, near, far, moving, room, whole, y, start,
                    found[start:stop], sums[b],
                )  # fmt: skip
            counts[0, b], counts[1, b] = doubt, moving
        group = taken(counter)


@member_kernel
def _moving(
    c: Floats, s: Floats, a: Floats, lower: Floats, upper: Floats, near: float, far: float, mark: Floats, which: Ints,
    y: Floats, sums: Floats,
) -> int:  # fmt: skip
    """Which variables of a block do not rest, in whole vectors; how many. y: the iterate; sums: of those that rest."""
    m = len(c)
    for i in range(m):
        most, least = s[i] + max(near * a[i], far * a[i]), s[i] + min(near * a[i], far * a[i])
        rests = ((most < 0.0) & (c[i] == upper[i])) | ((least > 0.0) & (c[i] == lower[i]))
        mark[i] = 0.0 if rests else -1.0
    for i in range(m):
        y[i] = c[i]
    held, weight = 0.0, 0.0
    for i in range(m):
        spent = (1.0 + mark[i]) * (a[i] * c[i])
        held += spent
        weight += abs(spent)
    sums[0], sums[1], sums[2] = 0.0, held, weight
    return chosen(mark, m, which)


@member_kernel
def _sort_block(
    c: Floats, s: Floats, a: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats, near: float,
    far: float, moving: int, room: Floats, whole: Ints, y: Floats, start: int, found: Ints, sums: Floats,
) -> int:  # fmt: skip
    """One block of `_sort_blocks`, of which whole[3] tells who does not rest; how many are in doubt."""
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    which = whole[3]
    slope, cost, reach, kappa, step = room[0], room[1], room[2], room[3], room[4]
    end, z, value, known = room[5], room[6], room[7], room[8]
    n = whole_vectors(moving)
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
    doubt = 0
    for k in range(moving):
        if known[k] == 0.0:
            found[doubt] = start + which[k]
            doubt += 1
    others = doubt
    for k in range(moving):
        if known[k] != 0.0:
            found[others] = start + which[k]
            others += 1
            y[which[k]] = end[k]
    sums[0] += change
    sums[1] += held
    sums[2] += weight
    return doubt


@kernel
def _slot_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, found: Ints, begin: Ints, slots: Floats, place: Ints,
) -> None:  # fmt: skip
    """Slots for the variables in doubt, of the blocks that are taken; begin (blocks + 1): their first slots."""
    move, trust, share, convex = limits[1], limits[2], limits[3], limits[4]
    blocks, N = len(begin) - 1, len(alpha)
    group = taken(counter)
    while group * GROUP < blocks:
        for b in range(group * GROUP, min((group + 1) * GROUP, blocks)):
            for n in range(begin[b], begin[b + 1]):
                i = found[b * BLOCK + n - begin[b]]
                end, other, a = one(lower, N, i), one(upper, N, i), one(cost, N, i)
                low, high, reach, span = box(alpha[i], end, other, shift[i], move, trust, share)
                enter_slot(slots, place, n, i, alpha[i], slope[i], a, low, high, reach, convex / span)
        group = taken(counter)


@kernel
def measure(
    alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float, steepest: float,
    threads: int, out: Floats, found: Ints, counts: Ints,
) -> tuple[float, float, float]:  # fmt: skip
    """Of the variables that do not rest, which are all that can tell: max |x - clip(x - (slope + multiplier
    cost)/steepest)|, at most what a step along -gradient moves; max |out - alpha|, and the largest in its range."""
    blocks = counts.shape[1]
    most = np.empty((blocks, 3))
    moving = 0
    for b in range(blocks):
        moving += counts[1, b]
    counter = np.zeros(1, np.int64)
    shared(
        _measure_blocks, threads if moving > CROWD else 1,
        (counter, alpha, slope, cost, lower, upper, multiplier, 1.0 / steepest, out, found, counts, most),
    )  # fmt: skip
    residual, plain, scaled = 0.0, 0.0, 0.0
    for b in range(blocks):
        residual, plain, scaled = max(residual, most[b, 0]), max(plain, most[b, 1]), max(scaled, most[b, 2])
    return residual, plain, scaled


@kernel
def _measure_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, lower: Floats, upper: Floats, multiplier: float,
    unit: float, out: Floats, found: Ints, counts: Ints, most: Floats,
) -> None:  # fmt: skip
    blocks, N = len(most), len(alpha)
    group = taken(counter)
    while group * GROUP < blocks:
        for b in range(group * GROUP, min((group + 1) * GROUP, blocks)):
            residual, plain, scaled = 0.0, 0.0, 0.0
            for k in range(b * BLOCK, b * BLOCK + counts[1, b]):
                i = found[k]
                x, low, high = alpha[i], one(lower, N, i), one(upper, N, i)
                moved = x - (slope[i] + multiplier * one(cost, N, i)) * unit
                change = abs(out[i] - x)
                residual = max(residual, abs(x - max(low, min(high, moved))))
                plain = max(plain, change)
                scaled = max(scaled, change / (high - low if high > low else 1.0))
            most[b, 0], most[b, 1], most[b, 2] = residual, plain, scaled
        group = taken(counter)
