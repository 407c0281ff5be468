"""Compiled passes of `wide.py`: one row, one volume row, very many variables.

Arrays that the passes share, one column for each variable that the multiplier's bracket leaves undecided:

    slots (9, n)  coefficient in the row, ends of the box, iterate, slope, distance of the shifts, kappa, and the
                  multipliers between which the variable is inside its box; ends[:, k]
    place (n,)    which variable it is
    x (n,)        where it is

Costs and bounds whose numbers are all alike may be given as the first few of them (`wide_passes`).

Sums are added in a fixed order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.jit import inline, kernel, member_kernel, vector_entry
from mdstopo.native.threads import shared, taken
from mdstopo.optimizer.powers import largest, primitives
from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.optimizer.wide_passes import part

BLOCK = 1024
#: blocks that a thread takes at once
GROUP = 8
SLOTS = 9
COST, LOW, HIGH, ITERATE, SLOPE, REACH, KAPPA, FIRST, LAST = range(SLOTS)
#: larger than any multiplier, small enough to be multiplied
BEYOND = 1e200
#: variables of the sample from which the first bracket comes, and its half width in standard deviations
SAMPLE = 4096
SPREAD = 4.0
MAX_STEPS = 200
#: brackets that are tried, the last of them without ends
ATTEMPTS = 6
#: smaller than any width that counts
TINY = 1e-300


@inline
def _box(
    alpha: float, lower: float, upper: float, shift: float, move: float, trust: float, share: float
) -> tuple[float, float, float, float]:
    """Ends of the box, distance of the shifts, range."""
    span = upper - lower if upper > lower else 1.0
    reach = shift * span
    most = min(min(move, trust * span), share * reach)
    return max(lower, alpha - most), min(upper, alpha + most), reach, span


@member_kernel
def _derivative(
    x: Floats, iterate: Floats, slope: Floats, reach: Floats, kappa: Floats, power: float, first: Floats, z: Floats,
    out: Floats, whole: Ints,
) -> None:  # fmt: skip
    """The model's derivative by each variable; first: t^(power - 1), z = t - 1, where t is how far it is stretched."""
    n = len(x)
    for i in range(n):
        step = x[i] - iterate[i]
        z[i] = (step if slope[i] < 0.0 else -step) / reach[i]
    primitives(z[:n], power, out[:n], whole)
    for i in range(n):
        first[i] = (1.0 + power * out[i]) / (1.0 + z[i])
    for i in range(n):
        out[i] = slope[i] * first[i] + kappa[i] * (x[i] - iterate[i])


@member_kernel
def _enter(slots: Floats, n: int, power: float) -> None:
    """The multipliers between which the variables of the slots are inside their boxes."""
    room, whole = np.empty((4, BLOCK)), np.empty((3, BLOCK), dtype=np.int64)
    first, z, low, high = room[0], room[1], room[2], room[3]
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        a, c, s = slots[COST, start:stop], slots[ITERATE, start:stop], slots[SLOPE, start:stop]
        d, k = slots[REACH, start:stop], slots[KAPPA, start:stop]
        _derivative(slots[LOW, start:stop], c, s, d, k, power, first, z, low, whole)
        _derivative(slots[HIGH, start:stop], c, s, d, k, power, first, z, high, whole)
        begin, end = slots[FIRST, start:stop], slots[LAST, start:stop]
        for i in range(stop - start):
            if a[i] == 0.0:  # always inside: the multiplier does not move it
                begin[i], end[i] = -BEYOND, BEYOND
            else:
                begin[i] = min(-low[i] / a[i], -high[i] / a[i])
                end[i] = max(-low[i] / a[i], -high[i] / a[i])


@member_kernel
def _between(slots: Floats, start: int, stop: int, multiplier: float, stay: bool, share: Floats, x: Floats) -> None:
    """Where the variables are for a multiplier if they moved evenly from one end of their box to the other; the share
    of the way. Inside they stay where they are if `stay`."""
    a, low, high = slots[COST, start:stop], slots[LOW, start:stop], slots[HIGH, start:stop]
    first, last = slots[FIRST, start:stop], slots[LAST, start:stop]
    n = stop - start
    for i in range(n):
        share[i] = min(max((multiplier - first[i]) / max(last[i] - first[i], TINY), 0.0), 1.0)
    for i in range(n):
        p, q = low[i], high[i]
        up = share[i] if a[i] < 0.0 else 1.0 - share[i]
        between = x[i] if stay else p + up * (q - p)
        x[i] = q if up >= 1.0 else (p if up <= 0.0 else between)


@member_kernel
def _total(
    slots: Floats, n: int, x: Floats, multiplier: float, power: float, exact: bool, room: Floats, whole: Ints
) -> tuple[float, float]:
    """Sum of a x over the slots for a multiplier, and its slope; fills x.

    Exact from an x that is near; otherwise as if they moved evenly.
    """
    total, slope = 0.0, 0.0
    share, first, z, g, h = room[0], room[1], room[2], room[3], room[4]
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        m = stop - start
        a, low, high = slots[COST, start:stop], slots[LOW, start:stop], slots[HIGH, start:stop]
        y = x[start:stop]
        _between(slots, start, stop, multiplier, exact, share, y)
        if not exact:
            begin, end = slots[FIRST, start:stop], slots[LAST, start:stop]
            for i in range(m):
                inside = share[i] * (1.0 - share[i]) > 0.0
                slope -= abs(a[i]) * (high[i] - low[i]) / max(end[i] - begin[i], TINY) if inside else 0.0
        else:
            c, s = slots[ITERATE, start:stop], slots[SLOPE, start:stop]
            d, k = slots[REACH, start:stop], slots[KAPPA, start:stop]
            # the derivative is convex or concave: Newton's iteration ends on one side, or in the box's corner
            for _ in range(MAX_STEPS):
                _derivative(y, c, s, d, k, power, first, z, g, whole)
                for i in range(m):
                    h[i] = k[i] + abs(s[i]) * (1.0 - power) * first[i] / ((1.0 + z[i]) * d[i])
                for i in range(m):
                    inside = share[i] * (1.0 - share[i]) > 0.0
                    z[i] = (g[i] + multiplier * a[i]) / h[i] if inside else 0.0
                for i in range(m):
                    z[i] = min(max(y[i] - z[i], low[i]), high[i]) - y[i]
                for i in range(m):
                    y[i] += z[i]
                for i in range(m):
                    z[i] /= max(high[i] - low[i], TINY)
                if not largest(z[:m]) > 1e-9:  # what the next step would correct is that, squared
                    break
            for i in range(m):
                slope -= a[i] * a[i] / h[i] if share[i] * (1.0 - share[i]) > 0.0 else 0.0
        for i in range(m):
            total += a[i] * y[i]
    return total, slope


@member_kernel
def _root(
    slots: Floats, n: int, x: Floats, goal: float, near: float, guess: float, far: float, power: float,
    rounding: float, exact: bool, room: Floats, whole: Ints,
) -> tuple[float, float, int]:  # fmt: skip
    """The multiplier in [near, far] for which the sum of a x is `goal`, or an end that comes as near as any.

    Returns it with what is left of the difference, and whether the root must lie further on (1) or back (-1); x is
    filled for it. The sum falls with the multiplier.
    """
    first, last = BEYOND, -BEYOND
    for k in range(n):
        if slots[COST, k] != 0.0:
            first, last = min(first, slots[FIRST, k]), max(last, slots[LAST, k])
    near, far = max(near, min(first, far)), min(far, max(last, near))
    multiplier = guess if near <= guess <= far else 0.5 * (near + far)
    near_tried, far_tried = False, False
    miss, width = 0.0, far - near
    for step in range(MAX_STEPS):
        total, slope = _total(slots, n, x, multiplier, power, exact, room, whole)
        miss = total - goal
        if abs(miss) <= rounding:
            break
        if miss > 0.0 and multiplier >= far:
            return multiplier, miss, 1
        if miss < 0.0 and multiplier <= near:
            return multiplier, miss, -1
        if miss > 0.0:
            near, near_tried = multiplier, True
        else:
            far, far_tried = multiplier, True
        following = multiplier - miss / slope if slope < 0.0 else (far if miss > 0.0 else near)
        if near_tried and far_tried:
            lags = step % 3 == 2 and far - near > 0.25 * width
            if lags or not near < following < far:
                following = 0.5 * (near + far)
            if not near < following < far:
                break
        else:
            following = min(max(following, near), far)
        width = far - near if step % 3 == 2 else width
        multiplier = following
    return multiplier, miss, 0


@inline
def _one(x: Floats, n: int, i: int) -> float:
    """x[i] of an array of n, or of one whose numbers are alike."""
    return float(x[i if len(x) == n else 0])


@member_kernel
def _slot(
    slots: Floats, place: Ints, k: int, i: int, alpha: float, slope: float, cost: float, low: float, high: float,
    reach: float, kappa: float,
) -> None:  # fmt: skip
    place[k] = i
    slots[COST, k], slots[LOW, k], slots[HIGH, k], slots[ITERATE, k] = cost, low, high, alpha
    slots[SLOPE, k], slots[REACH, k], slots[KAPPA, k] = slope, reach, kappa


@member_kernel
def _estimate(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    gap: float, least: float, stride: int, slots: Floats, place: Ints, x: Floats, room: Floats, whole: Ints,
) -> tuple[float, float, float]:  # fmt: skip
    """A bracket that probably holds the multiplier, the likeliest in its middle, from every stride-th variable.

    gap: b - a x at the iterate.
    """
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    N = len(alpha)
    n: int = np.int64(0)  # type: ignore[assignment]  # a 0 as written has its callees compiled once more, for that type
    goal = 0.0
    for i in range(0, N, stride):
        a = _one(cost, N, i)
        low, high, reach, span = _box(alpha[i], _one(lower, N, i), _one(upper, N, i), shift[i], move, trust, share)
        _slot(slots, place, n, i, alpha[i], slope[i], a, low, high, reach, convex / span)
        goal += a * alpha[i]
        n += 1
    _enter(slots, n, power)
    goal += gap * n / N
    rounding = 1e-6 * abs(goal)
    guess, _, _ = _root(slots, n, x, goal, least, BEYOND, BEYOND, power, rounding, bool(0), room, whole)
    mean, square = 0.0, 0.0
    for k in range(n):
        moved = slots[COST, k] * (x[k] - slots[ITERATE, k])
        mean += moved / n
        square += moved * moved
    spread = SPREAD * np.sqrt(max(square - n * mean * mean, 0.0))
    near, _, _ = _root(slots, n, x, goal + spread, least, guess, BEYOND, power, rounding, bool(0), room, whole)
    far, _, _ = _root(slots, n, x, goal - spread, least, guess, BEYOND, power, rounding, bool(0), room, whole)
    return near, guess, far


@kernel
def _sort_out(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    near: float, far: float, threads: int, out: Floats, slots: Floats, place: Ints, found: Ints,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Fill `out` with the ends of the box where a multiplier in [near, far] leaves no doubt; slots for the others.

    Returns how many slots there are and, over the decided variables, the sums of a x and |a x| and the change of the
    model. Threads share the blocks; sums of the blocks are added, and slots follow each other, in order.
    """
    blocks = (len(alpha) + BLOCK - 1) // BLOCK
    sums = np.empty((blocks, 3))
    begin = np.empty(blocks + 1, np.int64)
    counter = np.zeros(2, np.int64)
    shared(
        _sort_blocks, threads,
        (counter[:1], alpha, slope, cost, shift, lower, upper, limits, near, far, out, found, sums, begin),
    )  # fmt: skip
    n: int = np.int64(0)  # type: ignore[assignment]  # a 0 as written has its callees compiled once more, for that type
    total, size, change = 0.0, 0.0, 0.0
    for b in range(blocks):
        change += sums[b, 0]
        total += sums[b, 1]
        size += sums[b, 2]
        count = begin[b]
        begin[b] = n
        n += count
    begin[blocks] = n
    shared(
        _slot_blocks, threads,
        (counter[1:], alpha, slope, cost, shift, lower, upper, limits, found, begin, slots, place),
    )  # fmt: skip
    return n, total, size, change


@kernel
def _sort_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, near: float, far: float, out: Floats, found: Ints, sums: Floats, counts: Ints,
) -> None:  # fmt: skip
    """What `_sort_out` does with the blocks that are taken.

    sums: (blocks, 3) change, a x, |a x|; counts: of variables in doubt; found: which they are, from their block's place
    on.
    """
    room = np.empty((7, BLOCK))
    whole = np.empty((3, BLOCK), dtype=np.int64)
    N = len(alpha)
    group = taken(counter)
    while group * GROUP * BLOCK < N:
        for b in range(group * GROUP, min((group + 1) * GROUP, len(sums))):
            start, stop = b * BLOCK, min((b + 1) * BLOCK, N)
            counts[b] = _sort_block(
                alpha[start:stop], slope[start:stop], part(cost, N, start, stop), shift[start:stop],
                part(lower, N, start, stop), part(upper, N, start, stop), limits, near, far, room, whole,
                out[start:stop], start, found[start:stop], sums[b],
            )  # fmt: skip
        group = taken(counter)


@member_kernel
def _sort_block(
    c: Floats, s: Floats, a: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats, near: float,
    far: float, room: Floats, whole: Ints, y: Floats, start: int, found: Ints, sums: Floats,
) -> int:  # fmt: skip
    """One block of `_sort_blocks`; how many variables are in doubt."""
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    span, most, least, kappa = room[0], room[1], room[2], room[3]
    z, value, known = room[4], room[5], room[6]
    m = len(c)
    for i in range(m):
        wide = upper[i] - lower[i]
        span[i] = wide if wide > 0.0 else 1.0
    for i in range(m):
        most[i] = s[i] + max(near * a[i], far * a[i])
    for i in range(m):
        least[i] = s[i] + min(near * a[i], far * a[i])
    for i in range(m):
        away = min(min(move, trust * span[i]), share * (shift[i] * span[i]))
        low, high = max(lower[i], c[i] - away), min(upper[i], c[i] + away)
        y[i] = high if most[i] < 0.0 else low
    for i in range(m):
        step = y[i] - c[i]
        z[i] = (step if s[i] < 0.0 else -step) / (shift[i] * span[i])
    primitives(z[:m], power, value[:m], whole)
    for i in range(m):
        kappa[i] = convex / span[i]
    for i in range(m):
        # the derivative there, times 1 + z, towards its sign where the slope leaves no doubt
        t = 1.0 + z[i]
        more = s[i] * (power * value[i] - z[i]) + kappa[i] * (y[i] - c[i]) * t
        up, down = -(more + most[i] * t), more + least[i] * t
        ahead = down if least[i] > 0.0 else -1.0
        known[i] = 1.0 if (up if most[i] < 0.0 else ahead) >= 0.0 else 0.0
    part, held, weight = 0.0, 0.0, 0.0
    for i in range(m):
        step = y[i] - c[i]
        part += known[i] * (0.5 * kappa[i] * step * step - abs(s[i]) * (shift[i] * span[i]) * value[i])
    for i in range(m):
        spent = known[i] * a[i] * y[i]
        held += spent
        weight += abs(spent)
    count = 0
    for i in range(m):
        if known[i] == 0.0:
            found[count] = start + i
            count += 1
    sums[0], sums[1], sums[2] = part, held, weight
    return count


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
                end, other, a = _one(lower, N, i), _one(upper, N, i), _one(cost, N, i)
                low, high, reach, span = _box(alpha[i], end, other, shift[i], move, trust, share)
                _slot(slots, place, n, i, alpha[i], slope[i], a, low, high, reach, convex / span)
        group = taken(counter)


@member_kernel
def _promise(slots: Floats, n: int, x: Floats, power: float, room: Floats, whole: Ints) -> float:
    """The model's change over the slots."""
    change = 0.0
    z, value = room[0], room[1]
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        c, s, d = slots[ITERATE, start:stop], slots[SLOPE, start:stop], slots[REACH, start:stop]
        k, y = slots[KAPPA, start:stop], x[start:stop]
        m = stop - start
        for i in range(m):
            step = y[i] - c[i]
            z[i] = (step if s[i] < 0.0 else -step) / d[i]
        primitives(z[:m], power, value[:m], whole)
        for i in range(m):
            step = y[i] - c[i]
            change += 0.5 * k[i] * step * step - abs(s[i]) * d[i] * value[i]
    return change


@vector_entry
def wide_minimum(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    bound: float, at_iterate: float, equal: bool, stride: int, rounding: float, threads: int, out: Floats,
    slots: Floats, place: Ints, found: Ints, x: Floats,
) -> tuple[float, float, float, float, int]:  # fmt: skip
    """Minimise one row in its box under a x <= bound or = bound.

    limits: power, move limit, trust, share of the shifts' distance, convex term over the range's unit. at_iterate: a x
    of the iterate. out (N,): the minimiser. slots, place, found, x: room for N. Returns the multiplier, what is left of
    the row, the sum of |a x|, the change of the model, and how many columns of `slots` and `place` hold variables that
    may still be touched up.
    """
    power = limits[0]
    room, whole = np.empty((5, BLOCK)), np.empty((3, BLOCK), dtype=np.int64)
    least = -BEYOND if equal else 0.0
    near, guess, far = _estimate(
        alpha, slope, cost, shift, lower, upper, limits, bound - at_iterate, least, stride, slots, place, x, room, whole
    )
    multiplier, miss, size, change, n = 0.0, 0.0, 0.0, 0.0, 0
    for attempt in range(ATTEMPTS):
        if attempt == ATTEMPTS - 1:
            near, far = least, BEYOND
        n, total, size, change = _sort_out(
            alpha, slope, cost, shift, lower, upper, limits, near, far, threads, out, slots, place, found
        )
        _enter(slots, n, power)
        goal = bound - total
        guess, _, _ = _root(slots, n, x, goal, near, guess, far, power, 1e-6 * abs(bound), bool(0), room, whole)
        multiplier, miss, way = _root(slots, n, x, goal, near, guess, far, power, rounding, bool(1), room, whole)
        # something is left at an end of the bracket: the sample has misled
        width = far - near + 1e-3 * abs(far)
        if way > 0:
            near, far = far, far + 8.0 * width
        elif way < 0 and near > least:
            near, far = max(least, near - 8.0 * width), near
        else:
            multiplier = 0.0 if way < 0 and not equal else multiplier
            break
    for k in range(n):
        out[place[k]] = x[k]
        size += abs(slots[COST, k] * x[k])
    return multiplier, miss, size, change + _promise(slots, n, x, power, room, whole), n


@vector_entry
def wide_rows(
    slopes: Floats, alpha: Floats, trial: Floats, shift: Floats, lower: Floats, upper: Floats, power: float, out: Floats
) -> None:
    """out (R,): what the approximations of rows with these slopes (R, N) change from alpha to the trial."""
    room, whole = np.empty((4, BLOCK)), np.empty((3, BLOCK), dtype=np.int64)
    reach, z, falling, rising = room[0], room[1], room[2], room[3]
    for start in range(0, len(alpha), BLOCK):
        stop = min(start + BLOCK, len(alpha))
        x, y, far = alpha[start:stop], trial[start:stop], shift[start:stop]
        low, high = part(lower, len(alpha), start, stop), part(upper, len(alpha), start, stop)
        m = stop - start
        for i in range(m):
            wide = high[i] - low[i]
            reach[i] = far[i] * (wide if wide > 0.0 else 1.0)
        for i in range(m):
            z[i] = (y[i] - x[i]) / reach[i]
        primitives(z[:m], power, falling[:m], whole)
        for i in range(m):
            z[i] = -z[i]
        primitives(z[:m], power, rising[:m], whole)
        for r in range(len(out)):
            row = slopes[r, start:stop]
            change = 0.0
            for i in range(m):
                change += reach[i] * (min(row[i], 0.0) * falling[i] - max(row[i], 0.0) * rising[i])
            out[r] += change
