"""Compiled passes of `wide.py`: one row, one volume row, very many variables.

Arrays that the passes share, one column for each variable that the multiplier's bracket leaves undecided:

    slots (9, n)  coefficient in the row, ends of the box, iterate, slope, distance of the shifts, kappa, and the
                  multipliers between which the variable is inside its box; ends[:, k]
    place (n,)    which variable it is
    x (n,)        where it is

Sums are added in a fixed order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.jit import inline, kernel, member_kernel, vector_entry
from mdstopo.native.threads import shared, taken
from mdstopo.optimizer.powers import powers
from mdstopo.optimizer.problem import Floats, Ints, Truths

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
#: the power that is taken if none is stated; its terms need no logarithms
RECIPROCAL = -1.0


@inline
def _steepness(x: float, iterate: float, slope: float, reach: float, kappa: float, power: float) -> tuple[float, float]:
    """The model's derivative by one variable, and its slope."""
    side = 1.0 if slope < 0.0 else -1.0
    t = 1.0 + side * (x - iterate) / reach
    first = 1.0 / (t * t)
    if power != RECIPROCAL:
        first = 1.0 if power == 1.0 else np.exp((power - 1.0) * np.log(t))
    return slope * first + kappa * (x - iterate), kappa + side * slope * (power - 1.0) * first / (t * reach)


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
def _enter(slots: Floats, k: int, power: float) -> None:
    """The multipliers between which the variable of a slot is inside its box."""
    a = slots[COST, k]
    slots[FIRST, k], slots[LAST, k] = -BEYOND, BEYOND
    if a == 0.0:
        return  # always inside: the multiplier does not move it
    x, s, d, kappa = slots[ITERATE, k], slots[SLOPE, k], slots[REACH, k], slots[KAPPA, k]
    low, _ = _steepness(slots[LOW, k], x, s, d, kappa, power)
    high, _ = _steepness(slots[HIGH, k], x, s, d, kappa, power)
    slots[FIRST, k] = min(-low / a, -high / a)
    slots[LAST, k] = max(-low / a, -high / a)


@member_kernel
def _inside(slots: Floats, k: int, x: float, pressure: float, power: float) -> tuple[float, float]:
    """Where the derivative of a slot's variable is minus the pressure, from x on: a safeguarded Newton iteration."""
    low, high = slots[LOW, k], slots[HIGH, k]
    enough = 1e-9 * (high - low)  # what the next step would correct is that, squared
    c, s, d, kappa = slots[ITERATE, k], slots[SLOPE, k], slots[REACH, k], slots[KAPPA, k]
    curvature = 1.0
    x = min(max(x, low), high)
    for _ in range(60):
        value, curvature = _steepness(x, c, s, d, kappa, power)
        value += pressure
        if value > 0.0:
            high = x
        else:
            low = x
        following = x - value / curvature
        if not low <= following <= high:
            following = 0.5 * (low + high)
        moved = abs(following - x)
        x = following
        if moved <= enough:
            break
    return x, curvature


@member_kernel
def _total(
    slots: Floats, live: Ints, count: int, x: Floats, multiplier: float, power: float
) -> tuple[float, float]:
    """Sum of a x over the live slots for a multiplier, and its slope; fills x."""
    total, slope = 0.0, 0.0
    for j in range(count):
        k = live[j]
        a = slots[COST, k]
        if multiplier <= slots[FIRST, k]:
            x[k] = slots[HIGH, k] if a > 0.0 else slots[LOW, k]
        elif multiplier >= slots[LAST, k]:
            x[k] = slots[LOW, k] if a > 0.0 else slots[HIGH, k]
        else:
            share = (multiplier - slots[FIRST, k]) / (slots[LAST, k] - slots[FIRST, k])
            begin = slots[HIGH, k] if a > 0.0 else slots[LOW, k]
            end = slots[LOW, k] if a > 0.0 else slots[HIGH, k]
            x[k], curvature = _inside(slots, k, begin + share * (end - begin), multiplier * a, power)
            slope -= a * a / curvature
        total += a * x[k]
    return total, slope


@member_kernel
def _root(
    slots: Floats, n: int, live: Ints, x: Floats, goal: float, near: float, guess: float, far: float, power: float,
    rounding: float,
) -> tuple[float, float]:  # fmt: skip
    """The multiplier in [near, far] for which the sum of a x is `goal`, or the end that comes nearest to it.

    Returns it with what is left of the difference; x is filled for it. The sum falls with the multiplier.
    """
    first, last = BEYOND, -BEYOND
    for k in range(n):
        live[k] = k
        if slots[COST, k] != 0.0:
            first, last = min(first, slots[FIRST, k]), max(last, slots[LAST, k])
    near, far = max(near, min(first, far)), min(far, max(last, near))
    multiplier = guess if near <= guess <= far else 0.5 * (near + far)
    near_tried, far_tried = False, False
    count, settled, miss, width = n, 0.0, 0.0, far - near
    for step in range(MAX_STEPS):
        total, slope = _total(slots, live, count, x, multiplier, power)
        miss = settled + total - goal
        if abs(miss) <= rounding or (miss > 0.0 and multiplier >= far) or (miss < 0.0 and multiplier <= near):
            break
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
        # what the bracket decides needs no further look
        kept = 0
        for j in range(count):
            k = live[j]
            a = slots[COST, k]
            if a != 0.0 and (far <= slots[FIRST, k] or near >= slots[LAST, k]):
                x[k] = slots[HIGH, k] if (far <= slots[FIRST, k]) == (a > 0.0) else slots[LOW, k]
                settled += a * x[k]
            else:
                live[kept] = k
                kept += 1
        count = kept
    return multiplier, miss


@member_kernel
def _slot(
    slots: Floats, place: Ints, k: int, i: int, alpha: float, slope: float, cost: float, low: float, high: float,
    reach: float, kappa: float, power: float,
) -> None:  # fmt: skip
    place[k] = i
    slots[COST, k], slots[LOW, k], slots[HIGH, k], slots[ITERATE, k] = cost, low, high, alpha
    slots[SLOPE, k], slots[REACH, k], slots[KAPPA, k] = slope, reach, kappa
    _enter(slots, k, power)


@member_kernel
def _estimate(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    gap: float, least: float, stride: int, slots: Floats, place: Ints, live: Ints, x: Floats,
) -> tuple[float, float, float]:  # fmt: skip
    """A bracket that probably holds the multiplier, the likeliest in its middle, from every stride-th variable.

    gap: b - a x at the iterate.
    """
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    N = len(alpha)
    n = 0
    goal = 0.0
    for i in range(0, N, stride):
        low, high, reach, span = _box(alpha[i], lower[i], upper[i], shift[i], move, trust, share)
        _slot(slots, place, n, i, alpha[i], slope[i], cost[i], low, high, reach, convex / span, power)
        x[n] = alpha[i]
        goal += cost[i] * alpha[i]
        n += 1
    goal += gap * n / N
    rounding = 1e-6 * abs(goal)
    guess, _ = _root(slots, n, live, x, goal, least, BEYOND, BEYOND, power, rounding)
    mean, square = 0.0, 0.0
    for k in range(n):
        moved = slots[COST, k] * (x[k] - slots[ITERATE, k])
        mean += moved / n
        square += moved * moved
    spread = SPREAD * np.sqrt(max(square - n * mean * mean, 0.0))
    near, _ = _root(slots, n, live, x, goal + spread, least, guess, BEYOND, power, rounding)
    far, _ = _root(slots, n, live, x, goal - spread, least, guess, BEYOND, power, rounding)
    return near, guess, far


@kernel
def _sort_out(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    near: float, far: float, threads: int, out: Floats, slots: Floats, place: Ints, x: Floats,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Fill `out` with the ends of the box where a multiplier in [near, far] leaves no doubt; slots for the others.

    Returns how many slots there are and, over the decided variables, the sums of a x and |a x| and the change of the
    model. Threads share the blocks; sums of the blocks are added, and slots follow each other, in order.
    """
    blocks = (len(alpha) + BLOCK - 1) // BLOCK
    doubted = np.empty(len(alpha), dtype=np.bool_)
    sums = np.empty((blocks, 3))
    begin = np.empty(blocks + 1, np.int64)
    counter = np.zeros(2, np.int64)
    shared(
        _sort_blocks, threads,
        (counter[:1], alpha, slope, cost, shift, lower, upper, limits, near, far, out, doubted, sums, begin),
    )  # fmt: skip
    n = 0
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
        (counter[1:], alpha, slope, cost, shift, lower, upper, limits, out, doubted, begin, slots, place, x),
    )  # fmt: skip
    return n, total, size, change


@kernel
def _sort_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, near: float, far: float, out: Floats, doubted: Truths, sums: Floats, counts: Ints,
) -> None:  # fmt: skip
    """What `_sort_out` does with the blocks that are taken: sums (blocks, 3) change, a x, |a x|; counts of doubts."""
    room = np.empty((8, BLOCK))
    whole = np.empty((3, BLOCK), dtype=np.int64)
    N = len(alpha)
    group = taken(counter)
    while group * GROUP * BLOCK < N:
        for b in range(group * GROUP, min((group + 1) * GROUP, len(sums))):
            start, stop = b * BLOCK, min((b + 1) * BLOCK, N)
            counts[b] = _sort_block(
                alpha[start:stop], slope[start:stop], cost[start:stop], shift[start:stop], lower[start:stop],
                upper[start:stop], limits, near, far, room, whole, out[start:stop], doubted[start:stop], sums[b],
            )  # fmt: skip
        group = taken(counter)


@member_kernel
def _sort_block(
    c: Floats, s: Floats, a: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats, near: float,
    far: float, room: Floats, whole: Ints, y: Floats, doubted: Truths, sums: Floats,
) -> int:  # fmt: skip
    """One block of `_sort_blocks`; how many variables are in doubt."""
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    low, high, reach, kappa = room[0], room[1], room[2], room[3]
    least, most, t, first = room[4], room[5], room[6], room[7]
    m = len(c)
    for i in range(m):
        low[i], high[i], reach[i], span = _box(c[i], lower[i], upper[i], shift[i], move, trust, share)
        kappa[i] = convex / span
        p, q = near * a[i], far * a[i]
        least[i], most[i] = min(p, q), max(p, q)
        y[i] = high[i] if s[i] + most[i] < 0.0 else low[i]
        step = y[i] - c[i]
        t[i] = 1.0 + (step if s[i] < 0.0 else -step) / reach[i]
    if power == 1.0:
        for i in range(m):
            first[i] = 1.0
    elif power == RECIPROCAL:
        for i in range(m):
            first[i] = 1.0 / (t[i] * t[i])
    else:
        powers(t[:m], power - 1.0, first, whole)
    part, held, weight, count = 0.0, 0.0, 0.0, 0
    for i in range(m):
        step = y[i] - c[i]
        pull = kappa[i] * step
        g = s[i] * first[i] + pull
        up_there = s[i] + most[i] < 0.0 and g + most[i] <= 0.0
        down_there = s[i] + least[i] > 0.0 and g + least[i] >= 0.0
        known = up_there or down_there
        doubted[i] = not known
        count += not known
        # s < 0: d (t f - 1)/xi; else that of the other side, with its sign
        term = (reach[i] if s[i] < 0.0 else -reach[i]) * (t[i] * first[i] - 1.0) / power
        part += s[i] * term + 0.5 * pull * step if known else 0.0
        spent = a[i] * y[i] if known else 0.0
        held += spent
        weight += abs(spent)
    sums[0], sums[1], sums[2] = part, held, weight
    return count


@kernel
def _slot_blocks(
    counter: Ints, alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats,
    limits: Floats, out: Floats, doubted: Truths, begin: Ints, slots: Floats, place: Ints, x: Floats,
) -> None:  # fmt: skip
    """Slots for the variables in doubt, of the blocks that are taken; begin (blocks + 1): their first slots."""
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    blocks = len(begin) - 1
    group = taken(counter)
    while group * GROUP < blocks:
        for b in range(group * GROUP, min((group + 1) * GROUP, blocks)):
            n = begin[b]
            if begin[b + 1] == n:
                continue
            for i in range(b * BLOCK, min((b + 1) * BLOCK, len(alpha))):
                if doubted[i]:
                    low, high, reach, span = _box(alpha[i], lower[i], upper[i], shift[i], move, trust, share)
                    _slot(slots, place, n, i, alpha[i], slope[i], cost[i], low, high, reach, convex / span, power)
                    x[n] = out[i]
                    n += 1
        group = taken(counter)


@member_kernel
def _promise(slots: Floats, n: int, x: Floats, power: float) -> float:
    """The model's change over the slots."""
    change = 0.0
    if power == RECIPROCAL:
        for k in range(n):
            step, s, d = x[k] - slots[ITERATE, k], slots[SLOPE, k], slots[REACH, k]
            side = 1.0 if s < 0.0 else -1.0
            change += s * step / (1.0 + side * step / d) + 0.5 * slots[KAPPA, k] * step * step
        return change
    for k in range(n):
        step, s, d = x[k] - slots[ITERATE, k], slots[SLOPE, k], slots[REACH, k]
        side = 1.0 if s < 0.0 else -1.0
        term = step if power == 1.0 else side * d * (np.exp(power * np.log(1.0 + side * step / d)) - 1.0) / power
        change += s * term + 0.5 * slots[KAPPA, k] * step * step
    return change


@vector_entry
def wide_minimum(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    bound: float, at_iterate: float, equal: bool, stride: int, rounding: float, threads: int, out: Floats,
    slots: Floats, place: Ints, live: Ints, x: Floats,
) -> tuple[float, float, float, float, int]:  # fmt: skip
    """Minimise one row in its box under a x <= bound or = bound.

    limits: power, move limit, trust, share of the shifts' distance, convex term over the range's unit. at_iterate: a x
    of the iterate. out (N,): the minimiser. slots, place, live, x: room for N. Returns the multiplier, what is left of
    the row, the sum of |a x|, the change of the model, and how many columns of `slots` and `place` hold variables that
    may still be touched up.
    """
    power = limits[0]
    least = -BEYOND if equal else 0.0
    near, guess, far = _estimate(
        alpha, slope, cost, shift, lower, upper, limits, bound - at_iterate, least, stride, slots, place, live, x
    )
    multiplier, miss, size, change, n = 0.0, 0.0, 0.0, 0.0, 0
    for attempt in range(4):
        if attempt == 3:
            near, far = least, BEYOND
        n, total, size, change = _sort_out(
            alpha, slope, cost, shift, lower, upper, limits, near, far, threads, out, slots, place, x
        )
        multiplier, miss = _root(slots, n, live, x, bound - total, near, guess, far, power, rounding)
        # an end of the bracket with something left: the sample has misled
        width = far - near + 1e-3 * abs(far)
        if miss > rounding and multiplier >= far:
            near, far = far, far + 8.0 * width
        elif miss < -rounding and multiplier <= near and near > least:
            near, far = max(least, near - 8.0 * width), near
        else:
            break
    for k in range(n):
        out[place[k]] = x[k]
        size += abs(slots[COST, k] * x[k])
    return multiplier, miss, size, change + _promise(slots, n, x, power), n
