"""Compiled passes over very many variables for the subproblem of `wide_rows`: where the rows' multipliers send each.

With multipliers theta (R,) of rows Q (R, N) the derivative by a variable's step d_i is r_i + h_i d_i, r = Q' theta: the
step ends at the lower or the upper end of the box, or is -r_i / h_i. Multipliers that are not exact leave those in
doubt whose derivative is near zero at an end, relative to sum_k spread_k |Q_ki|.

Rows are some of those of one matrix, `pool` (S, N). limits: the trust box, in ranges; the longest step; h, over the
range's square if the next is not 0; the doubt, relative to that sum. Bounds and ranges whose numbers are all alike may
be given as the first few of them (`wide_passes`). Threads share pieces of variables; sums of the pieces are added in
order, so that results do not depend on the number of threads.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, member_kernel, vector_entry
from mdstopo.compiler.threads import shared, taken
from mdstopo.optimizer.interior_kernels import _dot3, add, dot
from mdstopo.optimizer.problem import Bools, Floats, Ints
from mdstopo.optimizer.wide_passes import PIECE, part, pieces

BLOCK = 1024
TRUST, LONGEST, H, SCALED, DOUBT = range(5)
#: what a variable does, in two truths: it is inside its box or in doubt; it is at the upper end, or in doubt
INSIDE, BEYOND = 0, 1


@member_kernel
def _boxes(
    x: Floats, lower: Floats, upper: Floats, unit: Floats, limits: Floats, low: Floats, high: Floats, h: Floats
) -> None:
    """The ends of the box in which the step of each variable has to stay, and its curvature.

    In:
      x (n,): the iterate.
      lower, upper, unit (n,): bounds and ranges.
      limits (5,): trust box in ranges; longest step; h; whether h is over the range's square; the doubt, not used.
    Out:
      low, high (n,): ends of the box, relative to x; low <= 0 <= high.
      h (n,): the curvature.

    Only n entries are used where arrays are longer.
    """
    trust, longest, own, scaled = limits[TRUST], limits[LONGEST], limits[H], limits[SCALED]
    for i in range(len(x)):
        reach = min(longest, trust * unit[i])
        low[i] = min(max(lower[i], x[i] - reach) - x[i], 0.0)
        high[i] = max(min(upper[i], x[i] + reach) - x[i], 0.0)
        h[i] = own / (unit[i] * unit[i]) if scaled != 0.0 else own


@member_kernel
def _weighted(
    pool: Floats, rows: Ints, theta: Floats, spread: Floats, start: int, stop: int, r: Floats, size: Floats
) -> None:  # fmt: skip
    """Two weighted sums of rows over some variables: sum_k theta_k Q_k and sum_k spread_k |Q_k|.

    In:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      theta, spread (R,): the weights of the two sums.
      start, stop: the variables from start to stop - 1.
    Out:
      r (stop - start,): sum_k theta_k Q_k; may be longer.
      size (stop - start,): sum_k spread_k |Q_k|; may be longer.
    """
    for i in range(stop - start):
        r[i] = 0.0
        size[i] = 0.0
    for k in range(len(rows)):
        weight, wide = theta[k], spread[k]
        if (weight != 0.0) | (wide != 0.0):
            row = pool[rows[k], start:stop]
            for i in range(len(row)):
                r[i] += weight * row[i]
                size[i] += wide * abs(row[i])


@vector_entry
def sort(
    pool: Floats, rows: Ints, theta: Floats, spread: Floats, x: Floats, lower: Floats, upper: Floats, unit: Floats,
    limits: Floats, threads: int, classes: Bools, listed: Ints, counts: Ints, sums: Floats, products: Floats,
) -> None:  # fmt: skip
    """Decide for each variable whether given multipliers move it to an end of its box or inside; in doubt where they
    are too uncertain.

    Constant:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      lower, upper, unit (N,): bounds and ranges, or the first few of them where all are alike.
      limits (5,): trust box in ranges; longest step; h; whether h is over the range's square; the doubt.
    In:
      theta (R,): multipliers of the rows.
      spread (R,): by how much they may be wrong, divided by the doubt.
      x (N,): the iterate.
      threads: how many work.
    Out:
      classes (2, N): what each variable does, as `INSIDE` and `BEYOND` have it.
      listed (N,): from each piece's place on, its variables in doubt.
      counts (pieces,): how many these are.
      sums (R,): Q d over the variables at an end of their box, d their steps.
      products (R, R): Q diag(1/h) Q' over those inside.
    """
    R = len(rows)
    count = pieces(len(x))
    every_sum, every_product = np.zeros((count, R)), np.zeros((count, R, R))
    counter = np.zeros(1, np.int64)
    shared(
        _sorted, threads,
        (counter, pool, rows, theta, spread, x, lower, upper, unit, limits, classes, listed, counts, every_sum,
         every_product),
    )  # fmt: skip
    sums.fill(0.0)
    products.fill(0.0)
    for piece in range(count):
        for a in range(R):
            sums[a] += every_sum[piece, a]
            for b in range(R):
                products[a, b] += every_product[piece, a, b]


@kernel
def _sorted(
    counter: Ints, pool: Floats, rows: Ints, theta: Floats, spread: Floats, x: Floats, lower: Floats, upper: Floats,
    unit: Floats, limits: Floats, classes: Bools, listed: Ints, counts: Ints, sums: Floats, products: Floats,
) -> None:  # fmt: skip
    """What `sort` does with the pieces of variables that this thread takes.

    Constant:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      lower, upper, unit (N,): bounds and ranges, or the first few of them where all are alike.
      limits (5,): trust box in ranges; longest step; h; whether h is over the range's square; the doubt.
    In:
      theta (R,): multipliers of the rows.
      spread (R,): by how much they may be wrong, divided by the doubt.
      x (N,): the iterate.
    Out:
      counter (1,): the next piece that nobody has taken.
      classes (2, N): what each variable does, as `INSIDE` and `BEYOND` have it.
      listed (N,): from each piece's place on, its variables in doubt.
      counts (pieces,): how many these are.
      sums (pieces, R): of each piece, Q d over the variables at an end of their box, added to.
      products (pieces, R, R): of each piece, Q diag(1/h) Q' over those inside, added to.
    """
    N = len(x)
    low, high, h, r, size = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    which, columns = np.empty(BLOCK, dtype=np.int64), np.empty((len(rows), BLOCK))
    piece = taken(counter)
    while piece < len(sums):
        place = piece * PIECE
        for start in range(piece * PIECE, min((piece + 1) * PIECE, N), BLOCK):
            stop = min(start + BLOCK, (piece + 1) * PIECE, N)
            n = stop - start
            _boxes(
                x[start:stop], part(lower, N, start, stop), part(upper, N, start, stop), part(unit, N, start, stop),
                limits, low, high, h,
            )  # fmt: skip
            _weighted(pool, rows, theta, spread, start, stop, r, size)
            inside = 0
            for i in range(n):
                doubt = limits[DOUBT] * size[i]
                least, most = r[i] + h[i] * low[i], r[i] + h[i] * high[i]
                step, slack, within, beyond = 0.0, 0.0, False, False
                if low[i] == high[i]:
                    step = low[i]
                elif size[i] == 0.0:  # nothing pushes: it stays
                    slack, within = (1.0 / h[i], True) if low[i] < 0.0 < high[i] else (0.0, False)
                    beyond = low[i] < 0.0 and high[i] <= 0.0
                elif least > doubt:
                    step = low[i]
                elif most < -doubt:
                    step, beyond = high[i], True
                elif least < -doubt and most > doubt:
                    slack, within = 1.0 / h[i], True
                else:
                    within, beyond = True, True
                    listed[place] = start + i
                    place += 1
                classes[INSIDE, start + i] = within
                classes[BEYOND, start + i] = beyond
                r[i] = step
                if slack > 0.0:
                    which[inside], size[inside] = i, slack
                    inside += 1
            for a in range(len(rows)):
                row, column = pool[rows[a], start:stop], columns[a, :inside]
                sums[piece, a] += dot(row, r[:n])
                for k in range(inside):
                    column[k] = row[which[k]]
                for b in range(a + 1 if inside > 0 else 0):
                    products[piece, a, b] += _dot3(column, size[:inside], columns[b, :inside])
                    products[piece, b, a] = products[piece, a, b]
        counts[piece] = place - piece * PIECE
        piece = taken(counter)


@vector_entry
def finish(
    pool: Floats, rows: Ints, theta: Floats, x: Floats, lower: Floats, upper: Floats, unit: Floats, limits: Floats,
    threads: int, classes: Bools, trial: Floats, listed: Ints, counts: Ints, sums: Floats,
) -> float:  # fmt: skip
    """Move all variables to where the final multipliers have them, and find those that contradict what was assumed
    of them.

    Constant:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      lower, upper, unit (N,): bounds and ranges, or the first few of them where all are alike.
      limits (5,): trust box in ranges; longest step; h; whether h is over the range's square; the doubt, not used.
    In:
      theta (R,): multipliers of the rows.
      x (N,): the iterate.
      threads: how many work.
      classes (2, N): what each variable was assumed to do, as `INSIDE` and `BEYOND` have it.
    Out:
      trial (N,): the designs; that of variables in doubt is read, not changed.
      listed (N,): from each piece's place on, its variables that do something else than `classes` say.
      counts (pieces,): how many these are.
      sums (R,): Q d, d the steps.

    Returns sum_i h_i d_i^2.
    """
    count = pieces(len(x))
    every = np.zeros((count, len(rows) + 1))
    counter = np.zeros(1, np.int64)
    shared(
        _finished, threads,
        (counter, pool, rows, theta, x, lower, upper, unit, limits, classes, trial, listed, counts, every),
    )  # fmt: skip
    sums.fill(0.0)
    curved = 0.0
    for piece in range(count):
        for a in range(len(rows)):
            sums[a] += every[piece, a]
        curved += every[piece, len(rows)]
    return curved


@kernel
def _finished(
    counter: Ints, pool: Floats, rows: Ints, theta: Floats, x: Floats, lower: Floats, upper: Floats, unit: Floats,
    limits: Floats, classes: Bools, trial: Floats, listed: Ints, counts: Ints, sums: Floats,
) -> None:  # fmt: skip
    """What `finish` does with the pieces of variables that this thread takes.

    Constant:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      lower, upper, unit (N,): bounds and ranges, or the first few of them where all are alike.
      limits (5,): trust box in ranges; longest step; h; whether h is over the range's square; the doubt, not used.
    In:
      theta (R,): multipliers of the rows.
      x (N,): the iterate.
      classes (2, N): what each variable was assumed to do, as `INSIDE` and `BEYOND` have it.
    Out:
      counter (1,): the next piece that nobody has taken.
      trial (N,): the designs; that of variables in doubt is read, not changed.
      listed (N,): from each piece's place on, its variables that do something else than `classes` say.
      counts (pieces,): how many these are.
      sums (pieces, R + 1): of each piece, Q d and sum_i h_i d_i^2, added to.
    """
    N, R = len(x), len(rows)
    low, high, h, r, size = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    spread = np.empty(R)
    for k in range(R):
        spread[k] = abs(theta[k])
    piece = taken(counter)
    while piece < len(sums):
        place = piece * PIECE
        for start in range(piece * PIECE, min((piece + 1) * PIECE, N), BLOCK):
            stop = min(start + BLOCK, (piece + 1) * PIECE, N)
            n = stop - start
            at, y = x[start:stop], trial[start:stop]
            first, last = part(lower, N, start, stop), part(upper, N, start, stop)
            _boxes(at, first, last, part(unit, N, start, stop), limits, low, high, h)
            _weighted(pool, rows, theta, spread, start, stop, r, size)
            for i in range(n):
                within, beyond = classes[INSIDE, start + i], classes[BEYOND, start + i]
                if within and beyond:
                    r[i] = y[i] - at[i]
                    continue
                least, most = r[i] + h[i] * low[i], r[i] + h[i] * high[i]
                if low[i] == high[i]:
                    step = low[i]
                elif least >= 0.0:
                    step, other = low[i], within or beyond
                    listed[place] = start + i
                    place += 1 if other else 0
                elif most <= 0.0:
                    step, other = high[i], within or not beyond
                    listed[place] = start + i
                    place += 1 if other else 0
                else:
                    step = -r[i] / h[i]
                    listed[place] = start + i
                    place += 0 if within else 1
                y[i] = min(max(at[i] + step, first[i]), last[i])
                r[i] = step
            for a in range(R):
                sums[piece, a] += dot(pool[rows[a], start:stop], r[:n])
            sums[piece, R] += _dot3(h[:n], r[:n], r[:n])
        counts[piece] = place - piece * PIECE
        piece = taken(counter)


@vector_entry
def projected(
    pool: Floats, rows: Ints, theta: Floats, x: Floats, lower: Floats, upper: Floats, steepest: float, threads: int
) -> float:
    """max |x - clip(x - Q' theta / steepest)|: what a step along the Lagrangian's negative gradient moves.

    pool (S, N): all rows.
    rows (R,): which of them are Q.
    theta (R,): their multipliers.
    x (N,): the iterate.
    lower, upper (N,): bounds, or the first few of them where all are alike.
    steepest: the largest gradient entry.
    threads: how many work.
    """
    most = np.zeros(pieces(len(x)))
    counter = np.zeros(1, np.int64)
    shared(_projected, threads, (counter, pool, rows, theta, x, lower, upper, 1.0 / steepest, most))
    found = 0.0
    for piece in range(len(most)):
        found = max(found, most[piece])
    return found


@kernel
def _projected(
    counter: Ints, pool: Floats, rows: Ints, theta: Floats, x: Floats, lower: Floats, upper: Floats, unit: float,
    most: Floats,
) -> None:  # fmt: skip
    """What `projected` does with the pieces of variables that this thread takes.

    Constant:
      pool (S, N): all rows.
      rows (R,): which of them are Q.
      lower, upper (N,): bounds, or the first few of them where all are alike.
    In:
      theta (R,): multipliers of the rows.
      x (N,): the iterate.
      unit: what the gradient is multiplied by, 1 over its largest entry.
    Out:
      counter (1,): the next piece that nobody has taken.
      most (pieces,): of each piece, the largest |x - clip(x - unit Q' theta)|; 0 before.
    """
    N = len(x)
    r, size = np.empty(BLOCK), np.empty(BLOCK)
    piece = taken(counter)
    while piece < len(most):
        for start in range(piece * PIECE, min((piece + 1) * PIECE, N), BLOCK):
            stop = min(start + BLOCK, (piece + 1) * PIECE, N)
            _weighted(pool, rows, theta, theta, start, stop, r, size)
            first, last, at = part(lower, N, start, stop), part(upper, N, start, stop), x[start:stop]
            for i in range(stop - start):
                moved = min(max(at[i] - r[i] * unit, first[i]), last[i])
                most[piece] = max(most[piece], abs(at[i] - moved))
        piece = taken(counter)


@vector_entry
def gram(pool: Floats, rows: Ints, unit: Floats, threads: int, plain: Floats, scaled: Floats) -> None:
    """The products of rows with each other, plain and weighted with the ranges' squares.

    In:
      pool (S, N): all rows.
      rows (R,): which of them are multiplied.
      unit (N,): ranges, or the first few of them where all are alike.
      threads: how many work.
    Out:
      plain (R, R): Q Q'.
      scaled (R, R): Q diag(unit^2) Q'.
    """
    R = len(rows)
    count = pieces(pool.shape[1])
    every = np.zeros((count, 2, R, R))
    counter = np.zeros(1, np.int64)
    shared(_grams, threads, (counter, pool, rows, unit, every))
    plain.fill(0.0)
    scaled.fill(0.0)
    for piece in range(count):
        for a in range(R):
            for b in range(R):
                plain[a, b] += every[piece, 0, a, b]
                scaled[a, b] += every[piece, 1, a, b]


@kernel
def _grams(counter: Ints, pool: Floats, rows: Ints, unit: Floats, products: Floats) -> None:
    N = pool.shape[1]
    weight = np.empty(BLOCK)
    piece = taken(counter)
    while piece < len(products):
        for start in range(piece * PIECE, min((piece + 1) * PIECE, N), BLOCK):
            stop = min(start + BLOCK, (piece + 1) * PIECE, N)
            wide = part(unit, N, start, stop)
            for i in range(stop - start):
                weight[i] = wide[i] * wide[i]
            for a in range(len(rows)):
                one = pool[rows[a], start:stop]
                for b in range(a + 1):
                    other = pool[rows[b], start:stop]
                    products[piece, 0, a, b] += dot(one, other)
                    products[piece, 1, a, b] += _dot3(one, other, weight[: stop - start])
                    products[piece, 0, b, a] = products[piece, 0, a, b]
                    products[piece, 1, b, a] = products[piece, 1, a, b]
        piece = taken(counter)


@vector_entry
def combined(pool: Floats, rows: Ints, theta: Floats, threads: int, out: Floats) -> None:
    """A sum of rows with weights: out = sum_k theta_k Q_k."""
    counter = np.zeros(1, np.int64)
    shared(_combined, threads, (counter, pool, rows, theta, out))


@kernel
def _combined(counter: Ints, pool: Floats, rows: Ints, theta: Floats, out: Floats) -> None:
    N = len(out)
    piece = taken(counter)
    while piece * PIECE < N:
        for start in range(piece * PIECE, min((piece + 1) * PIECE, N), BLOCK):
            stop = min(start + BLOCK, (piece + 1) * PIECE, N)
            out[start:stop] = 0.0
            for k in range(len(rows)):
                add(out[start:stop], theta[k], pool[rows[k], start:stop])
        piece = taken(counter)
