"""Where the variables that a bracket of the multiplier leaves undecided go: the root of the volume row's sum.

Arrays, one column for each such variable:

    slots (10, n)  coefficient in the row, ends of the box, iterate, slope, distance of the shifts, kappa, the
                   multipliers between which the variable is inside its box, and, once `_exactly` has found it, how
                   fast it falls with the multiplier
    place (n,)     which variable it is
    x (n,)         where it is
"""

import numpy as np

from mdstopo.compiler.jit import inline, kernel, member_kernel
from mdstopo.compiler.padding import whole_vectors
from mdstopo.compiler.vector import lanes, load, negative
from mdstopo.optimizer.powers import largest, primitives
from mdstopo.optimizer.problem import Floats, Ints

BLOCK = 1024
#: how long rows of room are, in whole vectors: rows that begin at like places of pages stand in each other's way
ROW = BLOCK + 40
SLOTS = 10
COST, LOW, HIGH, ITERATE, SLOPE, REACH, KAPPA, FIRST, LAST, RATE = range(SLOTS)
#: rows of the rooms that the passes below need, each of `ROW` numbers
ROOM, WHOLE = 13, 4
#: larger than any multiplier, small enough to be multiplied
BEYOND_MULTIPLIERS = 1e200
MAX_STEPS = 200
#: the last step of Newton's iteration, relative to the width of the variable's box: what the next would correct is
#: about its square; and the same where the result only tells where to begin
LAST_STEP, ROUGH_LAST_STEP = 3e-7, 0.03
#: smaller than any width that counts
LEAST_WIDTH = 1e-300


@inline
def box(
    alpha: float, lower: float, upper: float, shift: float, move: float, trust: float, share: float
) -> tuple[float, float, float, float]:
    """Ends of the box of a variable, distance of its shifts, and its range.

    alpha: the iterate.
    lower, upper: its bounds.
    shift: distance of its shifts, in ranges.
    move: the longest step.
    trust: half width of the trust box, in ranges.
    share: of the distance of the shifts, how far a step may go; infinite where terms are linear. Those do without
      shifts, which are put out of reach then: nothing is to be divided by what is left to one.
    """
    span = upper - lower if upper > lower else 1.0
    reach = shift * span if share <= 1.0 else 2.0 * span
    most = min(min(move, trust * span), share * reach)
    return max(lower, alpha - most), min(upper, alpha + most), reach, span


@member_kernel
def chosen(mark: Floats, n: int, listed: Ints) -> int:
    """Write into `listed` which of the first n marks are below zero, in order; how many.

    Both have room for n rounded up to vectors. The list is filled up to whole vectors with the last of it.
    """
    for k in range(n, whole_vectors(n)):
        mark[k] = 0.0
    count: int = np.int64(0)  # type: ignore[assignment]  # as written a 0 is of another type
    for k in range(0, n, lanes()):
        bits = negative(load(mark, k))
        if bits:
            for j in range(lanes()):
                listed[count] = k + j
                count += (bits >> j) & 1
    for k in range(count, whole_vectors(count)):
        listed[k] = listed[count - 1]
    return count


@kernel
def enter_slot(
    slots: Floats, place: Ints, k: int, i: int, alpha: float, slope: float, cost: float, low: float, high: float,
    reach: float, kappa: float,
) -> None:  # fmt: skip
    """Copy a variable into a column of the slots, which hold the variables that are still undecided.

    In:
      k: the column.
      i: the variable.
      alpha: the iterate.
      slope: the row's derivative there.
      cost: its coefficient in the volume row.
      low, high: ends of its box.
      reach: distance of its shifts.
      kappa: of the convex term.
    Out:
      slots (SLOTS, n): column k, but for what the passes below find.
      place (n,): place[k].
    """
    place[k] = i
    slots[COST, k], slots[LOW, k], slots[HIGH, k], slots[ITERATE, k] = cost, low, high, alpha
    slots[SLOPE, k], slots[REACH, k], slots[KAPPA, k] = slope, reach, kappa


@member_kernel
def _derivative(
    x: Floats, iterate: Floats, slope: Floats, reach: Floats, kappa: Floats, power: float, first: Floats, z: Floats,
    out: Floats, whole: Ints,
) -> None:  # fmt: skip
    """The model's derivative by each variable.

    In:
      x, iterate (n,): where the variables are, and where the model was made.
      slope, reach, kappa (n,): the row's derivatives there, distances of the shifts, coefficients of the convex term.
      power: the exponent xi.
    Out:
      out (n,): the derivatives.
      first, z (n,): t^(xi-1) and t - 1, where t is how far a variable's term is stretched.
      whole (3, n): integers to work with.

    Arrays that are filled may be longer.
    """
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
def bracket_slots(slots: Floats, n: int, power: float, room: Floats, whole: Ints) -> tuple[float, float]:
    """The multipliers between which the variables of the slots are inside their boxes; the least and the largest."""
    first, z, low, high = room[0], room[1], room[2], room[3]
    least, most = BEYOND_MULTIPLIERS, -BEYOND_MULTIPLIERS
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        a, c, s = slots[COST, start:stop], slots[ITERATE, start:stop], slots[SLOPE, start:stop]
        d, k = slots[REACH, start:stop], slots[KAPPA, start:stop]
        _derivative(slots[LOW, start:stop], c, s, d, k, power, first, z, low, whole)
        _derivative(slots[HIGH, start:stop], c, s, d, k, power, first, z, high, whole)
        begin, end = slots[FIRST, start:stop], slots[LAST, start:stop]
        for i in range(stop - start):
            if a[i] == 0.0:  # always inside: the multiplier does not move it
                begin[i], end[i] = -BEYOND_MULTIPLIERS, BEYOND_MULTIPLIERS
            else:
                one, other = -low[i] / a[i], -high[i] / a[i]
                begin[i], end[i] = min(one, other), max(one, other)
                least, most = min(least, begin[i]), max(most, end[i])
    return least, most


@member_kernel
def _evenly(slots: Floats, n: int, x: Floats, multiplier: float, room: Floats) -> tuple[float, float]:
    """Sum of a x over the slots for a multiplier, and its slope, as if variables moved evenly from one end of their box
    to the other; fills x."""
    total, slope = 0.0, 0.0
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        a, low, high = slots[COST, start:stop], slots[LOW, start:stop], slots[HIGH, start:stop]
        first, last, y, share = slots[FIRST, start:stop], slots[LAST, start:stop], x[start:stop], room[0]
        m = stop - start
        for i in range(m):
            share[i] = min(max((multiplier - first[i]) / max(last[i] - first[i], LEAST_WIDTH), 0.0), 1.0)
        for i in range(m):
            up = share[i] if a[i] < 0.0 else 1.0 - share[i]
            y[i] = high[i] if up >= 1.0 else (low[i] if up <= 0.0 else low[i] + up * (high[i] - low[i]))
        for i in range(m):
            within = share[i] * (1.0 - share[i]) > 0.0
            slope -= abs(a[i]) * (high[i] - low[i]) / max(last[i] - first[i], LEAST_WIDTH) if within else 0.0
        for i in range(m):
            total += a[i] * y[i]
    return total, slope


@member_kernel
def _exactly(
    slots: Floats, n: int, x: Floats, multiplier: float, power: float, enough: float, room: Floats, whole: Ints
) -> tuple[float, float]:
    """Sum of a x over the slots for a multiplier, and its slope, where each variable minimises the model.

    In:
      n: how many slots are used.
      multiplier: of the volume row.
      power: the exponent xi.
      enough: the last step of the iteration that leaves a variable good enough, relative to its box.
    Out:
      slots (SLOTS, n): the row of rates, how fast variables fall with the multiplier; the others are read.
      x (n,): where the variables go, from a point that is near.
      room (ROOM, ROW), whole (WHOLE, ROW): numbers and integers to work with.
    """
    total, slope = 0.0, 0.0
    mark, inside = room[0], whole[3]
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        a, low, high = slots[COST, start:stop], slots[LOW, start:stop], slots[HIGH, start:stop]
        first, last, y, rate = slots[FIRST, start:stop], slots[LAST, start:stop], x[start:stop], slots[RATE, start:stop]
        m = stop - start
        for i in range(m):
            mark[i] = max(first[i] - multiplier, multiplier - last[i])
        for i in range(m):
            p, q, between = low[i], high[i], y[i]
            before, rises = multiplier <= first[i], a[i] >= 0.0
            end = q if before == rises else p
            y[i] = between if mark[i] < 0.0 else end
        for i in range(m):
            rate[i] = 0.0
        count = chosen(mark, m, inside)
        if count:
            slope += _solved(slots, start, multiplier, power, enough, y, inside, count, room, whole)
        for i in range(m):
            total += a[i] * y[i]
    return total, slope


@member_kernel
def _solved(
    slots: Floats, start: int, multiplier: float, power: float, enough: float, x: Floats, inside: Ints, count: int,
    room: Floats, whole: Ints,
) -> float:  # fmt: skip
    """Where the multiplier sends those of a block's variables that are inside their boxes, by Newton's iteration.

    In:
      start: the block's first slot.
      multiplier: of the volume row.
      power: the exponent xi.
      enough: the last step of the iteration that leaves a variable good enough, relative to its box.
      inside (count,): which of the block's variables they are, filled up to whole vectors.
      count: how many.
    Out:
      slots (SLOTS, n): their rates, how fast they fall with the multiplier; the other rows are read.
      x (m,): where the block's variables are; those inside begin there and are moved.
      room (ROOM, ROW), whole (3, ROW): numbers and integers to work with; all of `room` is free.

    Returns the slope of their sum of a x. The derivative is that of `_derivative`, with its divisions taken out of the
    iteration.
    """
    width, bend, z, g, h, a = room[0], room[1], room[2], room[3], room[4], room[5]
    low, high, c, s, unit, k, y = room[6], room[7], room[8], room[9], room[10], room[11], room[12]
    n = whole_vectors(count)
    for i in range(n):
        at = start + inside[i]
        a[i], low[i], high[i], c[i] = slots[COST, at], slots[LOW, at], slots[HIGH, at], slots[ITERATE, at]
        s[i], unit[i], k[i], y[i] = slots[SLOPE, at], slots[REACH, at], slots[KAPPA, at], x[inside[i]]
    for i in range(n):
        width[i] = 1.0 / max(high[i] - low[i], LEAST_WIDTH)
    for i in range(n):
        unit[i] = (1.0 if s[i] < 0.0 else -1.0) / unit[i]
    for i in range(n):
        bend[i] = abs(s[i] * unit[i]) * (1.0 - power)
    # the derivative is convex or concave: Newton's iteration ends on one side, or in the box's corner
    for _ in range(MAX_STEPS):
        for i in range(n):
            z[i] = (y[i] - c[i]) * unit[i]
        primitives(z[:n], power, g[:n], whole)
        for i in range(n):
            z[i] = 1.0 / (1.0 + z[i])
        for i in range(n):
            g[i] = (1.0 + power * g[i]) * z[i]
        for i in range(n):
            h[i] = k[i] + bend[i] * g[i] * z[i]
        for i in range(n):
            gradient = s[i] * g[i] + k[i] * (y[i] - c[i]) + multiplier * a[i]
            z[i] = min(max(y[i] - gradient / h[i], low[i]), high[i]) - y[i]
        for i in range(n):
            y[i] += z[i]
        for i in range(n):
            z[i] *= width[i]
        if not largest(z[:n]) > enough:
            break
    slope = 0.0
    for i in range(n):
        h[i] = a[i] / h[i]
    for i in range(count):
        slope -= a[i] * h[i]
    for i in range(n):
        x[inside[i]] = y[i]
        slots[RATE, start + inside[i]] = h[i]
    return slope


@member_kernel
def _followed(slots: Floats, n: int, x: Floats, change: float, room: Floats) -> tuple[float, float]:
    """Where variables go, at the rates of `_exactly`, with a change of the multiplier; the largest step in a box, and
    the sum of a x."""
    total, most = 0.0, 0.0
    step = room[0]
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        a, low, high = slots[COST, start:stop], slots[LOW, start:stop], slots[HIGH, start:stop]
        rate, y = slots[RATE, start:stop], x[start:stop]
        m = stop - start
        for i in range(m):
            step[i] = rate[i] * change / max(high[i] - low[i], LEAST_WIDTH)
        for i in range(m):
            y[i] = min(max(y[i] - rate[i] * change, low[i]), high[i])
        for i in range(m):
            total += a[i] * y[i]
        most = max(most, largest(step[:m]))
    return most, total


@member_kernel
def _passed(slots: Floats, n: int, one: float, other: float) -> bool:
    """Whether a variable comes to an end of its box, or leaves one, between two multipliers."""
    least, most, passed = min(one, other), max(one, other), 0
    for k in range(n):
        first, last = slots[FIRST, k], slots[LAST, k]
        passed += 1 if ((first >= least) & (first <= most)) | ((last >= least) & (last <= most)) else 0
    return passed > 0


@member_kernel
def root(
    slots: Floats, n: int, ends: tuple[float, float], x: Floats, goal: float, near: float, guess: float, far: float,
    power: float, rounding: float, exact: bool, room: Floats, whole: Ints,
) -> tuple[float, float, int, float]:  # fmt: skip
    """The multiplier in [near, far] for which the sum of a x is `goal`, or an end that comes as near as any.

    In:
      n: how many slots are used.
      ends: the least and the largest multiplier that moves a variable, as `bracket_slots` finds them.
      goal: what the sum is to be.
      near, guess, far: the ends of the bracket, and where to begin.
      power: the exponent xi.
      rounding: by how much the sum may differ.
      exact: whether variables minimise the model, from an x that is near; else they move evenly with the multiplier.
    Out:
      slots (SLOTS, n): if `exact`, the row of rates; the others are read.
      x (n,): the variables for the multiplier.
      room (ROOM, ROW), whole (WHOLE, ROW): numbers and integers to work with.

    Returns the multiplier, what is left of the difference, whether the root must lie further on (1) or back (-1), and
    the slope of the sum, which falls with the multiplier.
    """
    first, last = ends
    if first > last:  # no multiplier moves any of them: the least that the others allow
        near = far = min(max(0.0, near), far)
    near, far = max(near, min(first, far)), min(far, max(last, near))
    multiplier = guess if near <= guess <= far else 0.5 * (near + far)
    if exact:  # a rough look first, from which nothing is concluded but where to begin
        total, slope = _exactly(slots, n, x, multiplier, power, ROUGH_LAST_STEP, room, whole)
        if slope < 0.0:
            following = min(max(multiplier - (total - goal) / slope, near), far)
            _followed(slots, n, x, following - multiplier, room)
            multiplier = following
    near_tried, far_tried = False, False
    miss, slope, width = 0.0, 0.0, far - near
    for step in range(MAX_STEPS):
        if exact:
            total, slope = _exactly(slots, n, x, multiplier, power, LAST_STEP, room, whole)
        else:
            total, slope = _evenly(slots, n, x, multiplier, room)
        miss = total - goal
        if abs(miss) <= rounding:
            break
        if miss > 0.0 and multiplier >= far:
            return multiplier, miss, 1, slope
        if miss < 0.0 and multiplier <= near:
            return multiplier, miss, -1, slope
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
        if exact:
            moved, total = _followed(slots, n, x, following - multiplier, room)
            close = moved <= LAST_STEP and abs(total - goal) <= rounding
            if close and not _passed(slots, n, multiplier, following):  # to look again would move them by that, squared
                return following, total - goal, 0, slope
        multiplier = following
    return multiplier, miss, 0, slope


@member_kernel
def settle(slots: Floats, n: int, x: Floats, goal: float, equal: bool, rounding: float) -> float:
    """Move the variables inside their boxes until the sum has its goal, as far as possible.

    In:
      slots (SLOTS, n): the variables; n: how many are used.
      goal: what the sum of a x is to be.
      equal: whether a sum that is too small is to be raised too.
      rounding: by how much the sum may differ.
    Out:
      x (n,): the variables, moved.

    Returns what is left of the difference.
    """
    a, low, high = slots[COST, :n], slots[LOW, :n], slots[HIGH, :n]
    miss = 0.0
    for _ in range(20):
        total, square = 0.0, 0.0
        for k in range(n):
            total += a[k] * x[k]
        miss = total - goal
        if abs(miss) <= rounding or (miss < 0.0 and not equal):
            break
        for k in range(n):
            square += a[k] * a[k] if (x[k] > low[k]) & (x[k] < high[k]) else 0.0
        if square == 0.0:
            break
        push = miss / square
        for k in range(n):
            moved = min(max(x[k] - push * a[k], low[k]), high[k])
            x[k] = moved if (x[k] > low[k]) & (x[k] < high[k]) else x[k]
    return miss


@member_kernel
def promise(slots: Floats, n: int, x: Floats, power: float, room: Floats, whole: Ints) -> float:
    """By how much the model changes over the variables in the slots; negative where it falls.

    In:
      slots (SLOTS, n): the variables; n: how many are used.
      x (n,): where they are.
      power: the exponent xi.
    Out:
      room (ROOM, ROW), whole (WHOLE, ROW): numbers and integers to work with.
    """
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
