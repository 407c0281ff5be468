"""Compiled passes of `wide.py`: one row, one volume row, very many variables.

A sample, and of very many a coarser one before it, brackets the volume row's multiplier, `wide_sorting` decides what
the bracket decides, `wide_slots` has the others. Costs and bounds whose numbers are all alike may be given as the first
few of them (`wide_passes`).

Sums are added in a fixed order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.compiler.jit import member_kernel, vector_entry
from mdstopo.compiler.vector import fetch
from mdstopo.optimizer.powers import primitives
from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.optimizer.wide_passes import FETCHED_AHEAD, part
from mdstopo.optimizer.wide_slots import (
    BEYOND_MULTIPLIERS,
    BLOCK,
    COST,
    ITERATE,
    LEAST_WIDTH,
    ROOM,
    ROW,
    WHOLE,
    box,
    bracket_slots,
    enter_slot,
    promise,
    root,
    settle,
)
from mdstopo.optimizer.wide_sorting import fix_by_bracket, measure, one

#: variables of the sample from which the first bracket comes, and its half width in standard deviations: a wider one
#: leaves more in doubt, a narrower one misses more often
SAMPLE, SPREAD = 4096, 2.2
#: what may be left of a sample's row, relative to what its variables can move, and to the half width
ENOUGH_OF_RANGE, ENOUGH_OF_SPREAD = 1e-3, 0.1
#: a sample that takes about every COARSER-th of those is solved first, where it has at least FEWEST_SAMPLED variables
FEWEST_SAMPLED, COARSER = 128, 8
#: by how much its bracket is widened, relative to the multiplier
BRACKET_WIDER = 0.15
#: brackets that are tried, the last of them without ends
ATTEMPTS = 6
#: what may be left of the row where it is solved, and after it is settled, relative to the size of its sums
ROW_SOLVED, ROW_SETTLED = 1e-9, 1e-15


@member_kernel
def _estimate(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    gap: float, near: float, guess: float, far: float, stride: int, slots: Floats, place: Ints, x: Floats, room: Floats,
    whole: Ints,
) -> tuple[float, float, float]:  # fmt: skip
    """A bracket that probably holds the volume row's multiplier, from a sample of the variables.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost, lower, upper (N,): coefficients of the volume row and bounds, or the first few of them where all are alike.
      shift (N,): distances of the shifts, in ranges.
      limits (5,): exponent xi; longest step; trust box in ranges; share of a shift's distance; kappa times range.
    In:
      alpha (N,): the iterate.
      gap: b - a x there.
      near, guess, far: the multiplier is in [near, far], likely at guess. Nothing more is asked of variables that rest
        for all multipliers in between.
      stride: the sample is every stride-th variable.
    Out, all overwritten:
      slots (SLOTS, N), place (N,), x (N,): in the first columns, the variables of the sample that do not rest.
      room (ROOM, ROW), whole (WHOLE, ROW): numbers and integers to work with.

    Returns the lower end, the likeliest multiplier and the upper end.
    """
    power, move, trust, share, convex = limits[0], limits[1], limits[2], limits[3], limits[4]
    N = len(alpha)
    n: int = np.int64(0)  # type: ignore[assignment]  # a 0 as written has its callees compiled once more, for that type
    sampled = (N + stride - 1) // stride
    goal, extent = gap * sampled / N, 0.0
    for i in range(0, N, stride):
        later = i + FETCHED_AHEAD * stride
        fetch(alpha, later)
        fetch(slope, later)
        fetch(shift, later)
        at, push, a, end, other = alpha[i], slope[i], one(cost, N, i), one(lower, N, i), one(upper, N, i)
        most, least = push + max(near * a, far * a), push + min(near * a, far * a)
        if ((at >= other) & (most <= 0.0)) | ((at <= end) & (least >= 0.0)):
            continue
        low, high, reach, span = box(at, end, other, shift[i], move, trust, share)
        enter_slot(slots, place, n, i, at, push, a, low, high, reach, convex / span)
        goal += a * at
        extent += abs(a) * (high - low)
        n += 1
    ends = bracket_slots(slots, n, power, room, whole)
    if ends[0] > ends[1]:  # none that the multiplier moves
        return near, guess, far
    enough = ENOUGH_OF_RANGE * extent
    guess, _, _, falling = root(slots, n, ends, x, goal, near, guess, far, power, enough, bool(0), room, whole)
    mean, square = 0.0, 0.0
    for k in range(n):
        moved = slots[COST, k] * (x[k] - slots[ITERATE, k])
        mean += moved / sampled
        square += moved * moved
    spread = SPREAD * np.sqrt(max(square - sampled * mean * mean, 0.0))
    enough, apart = max(enough, ENOUGH_OF_SPREAD * spread), spread / max(-falling, LEAST_WIDTH)
    more, less = goal + spread, goal - spread
    first = root(slots, n, ends, x, more, near, guess - apart, far, power, enough, bool(0), room, whole)[0]
    last = root(slots, n, ends, x, less, near, guess + apart, far, power, enough, bool(0), room, whole)[0]
    return first, guess, last


@vector_entry
def wide_minimum(
    alpha: Floats, slope: Floats, cost: Floats, shift: Floats, lower: Floats, upper: Floats, limits: Floats,
    bound: float, at_iterate: float, equal: bool, steepest: float, stride: int, rounding: float, threads: int,
    out: Floats, slots: Floats, place: Ints, listed: Ints, counts: Ints, x: Floats,
) -> tuple[float, float, float, float, float, float, float, int]:  # fmt: skip
    """Minimise the approximation of one row in its box under a x <= bound or a x = bound.

    Constant:
      slope (N,): the row's gradient at the iterate.
      cost (N,): a, or the first few of its numbers where all are alike.
      shift (N,): distances of the shifts, in ranges.
      lower, upper (N,): bounds, or the first few of them where all are alike.
      limits (5,): the exponent xi; the longest step; the trust box in ranges; the share of a shift's distance that a
        step may go; what over the range gives kappa of the convex term.
      bound: b of the volume row.
      equal: whether it is an equality.
    In:
      alpha (N,): the iterate.
      at_iterate: a x there.
      steepest: the largest gradient entry by the scale of the variables (`problem.scale_of`), unit of the residual.
      stride: every how many variables one is in the sample.
      rounding: what may be left of the row.
      threads: how many work.
    Out:
      out (N,): the minimiser.
      slots (SLOTS, N), place (N,), x (N,): the variables that were not decided at once, in the first columns.
      listed (N,): from each piece's place on, who does not rest, as `measure` tells it.
      counts (2, pieces): how many of each piece were in doubt, and how many do not rest.

    Returns the multiplier, what is left of the row, the size of its sums, the change of the model, what `measure`
    finds, and how many columns of `slots` and `place` hold variables that may still be touched up.
    """
    power = limits[0]
    room, whole = np.empty((ROOM, ROW)), np.empty((WHOLE, ROW), dtype=np.int64)
    least = -BEYOND_MULTIPLIERS if equal else 0.0
    near, guess, far, gap, coarse = least, 0.0, BEYOND_MULTIPLIERS, bound - at_iterate, COARSER * stride + 1
    if len(alpha) >= FEWEST_SAMPLED * coarse:
        near, guess, far = _estimate(
            alpha, slope, cost, shift, lower, upper, limits, gap, near, guess, far, coarse, slots, place, x, room, whole
        )
        # of so few very few move: a bracket that is too wide costs less than a wrong one
        wider = 0.5 * (far - near) + BRACKET_WIDER * abs(guess)
        near, far = max(least, near - wider), min(BEYOND_MULTIPLIERS, far + wider)
    near, guess, far = _estimate(
        alpha, slope, cost, shift, lower, upper, limits, gap, near, guess, far, stride, slots, place, x, room, whole
    )
    multiplier, miss, total, size, change, n = 0.0, 0.0, 0.0, 0.0, 0.0, 0
    for attempt in range(ATTEMPTS):
        if attempt == ATTEMPTS - 1:
            near, far = least, BEYOND_MULTIPLIERS
        n, total, size, change = fix_by_bracket(
            alpha, slope, cost, shift, lower, upper, limits, near, far, threads, out, slots, place, listed, counts
        )
        ends = bracket_slots(slots, n, power, room, whole)
        goal = bound - total
        guess = root(slots, n, ends, x, goal, near, guess, far, power, 1e-6 * abs(bound), bool(0), room, whole)[0]
        multiplier, miss, way = root(
            slots, n, ends, x, goal, near, guess, far, power, rounding, bool(1), room, whole
        )[:3]  # fmt: skip
        # something is left at an end of the bracket: the sample has misled
        width = far - near + 1e-3 * abs(far)
        if way > 0:
            near, far = far, far + 8.0 * width
        elif way < 0 and near > least:
            near, far = max(least, near - 8.0 * width), near
        else:
            multiplier = 0.0 if way < 0 and not equal else multiplier
            break
    size += abs(bound)
    for k in range(n):
        size += abs(slots[COST, k] * x[k])
    if abs(miss) <= ROW_SOLVED * size:
        miss = settle(slots, n, x, bound - total, equal, ROW_SETTLED * size)
    for k in range(n):
        out[place[k]] = x[k]
    change += promise(slots, n, x, power, room, whole)
    residual, plain, scaled = measure(
        alpha, slope, cost, lower, upper, multiplier, steepest, threads, out, listed, counts
    )
    return multiplier, miss, size, change, residual, plain, scaled, n


@vector_entry
def wide_rows(
    slopes: Floats, alpha: Floats, trial: Floats, shift: Floats, lower: Floats, upper: Floats, power: float, out: Floats
) -> None:
    """What the approximations of rows change from the iterate to the trial.

    In:
      slopes (R, N): the rows' gradients at the iterate.
      alpha, trial (N,): the two designs.
      shift (N,): distances of the shifts, in ranges.
      lower, upper (N,): bounds, or the first few of them where all are alike.
      power: the exponent xi.
    Out:
      out (R,): the changes, added to.
    """
    room, whole = np.empty((4, ROW)), np.empty((3, ROW), dtype=np.int64)
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
