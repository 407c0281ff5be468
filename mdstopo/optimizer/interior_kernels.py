"""Compiled passes over the variables for the interior point of `interior.py`; see there for what is solved.

Arrays that the passes share:

    bounds (4, N)  distances to the lower and the upper bound, and their multipliers
    work (5, N)    D^-1 (D: the diagonal left when the bounds are eliminated); the right side rho;
                   the step of the variables; for each bound the target of its complementarity,
                   then the step of its multiplier
    B (K, N)       Jacobian of the function rows (first R) over that of the linear rows
    rows (6, K)    slack, multiplier, elastic variable and its multiplier, penalty; the size that
                   residuals are relative to
    aims (4, K)    target of slack times multiplier; target of the elastic pair, then the step of its
                   multiplier; steps of the slack and of the elastic variable

Every pass goes through the variables in blocks that stay in cache and adds block sums in
order, in one thread: results do not depend on the number of threads. Inner loops run over views that start at
zero, which is what lets the compiler vectorise them. Numba's own linear algebra would import scipy, hence the
small elimination at the end.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, member_kernel, vector_entry
from mdstopo.optimizer.powers import powers
from mdstopo.optimizer.problem import Floats, Ints

BLOCK = 1024
HUGE = 1e300
OBJECTIVE, ELASTIC, LIMIT, EQUAL = 0, 1, 2, 3


@member_kernel
def _terms(
    step: Floats, sign: float, reach: Floats, power: float, value: Floats, first: Floats, second: Floats, room: Ints
) -> None:  # fmt: skip
    """Unit terms of the approximation after steps away from where it was made.

    In:
      step (n,): steps of the variables, with sign * step > -reach.
      sign: 1 where the shifts lie below the variables, -1 where they lie above.
      reach (n,): distances of the shifts.
      power: the exponent xi.
    Out:
      value (n,): the primitive of the first derivative, 0 at no step.
      first (n,): the derivative by the step, t^(xi-1) with t = 1 + sign step/reach.
      second (n,): the size of the second derivative.
      room (3, n): overwritten.

    Arrays that are filled may be longer.
    """
    n = len(step)
    if power == 1.0:
        for i in range(n):
            value[i] = step[i]
            first[i] = 1.0
            second[i] = 0.0
        return
    if power == -1.0:
        for i in range(n):
            t = 1.0 + sign * step[i] / reach[i]
            first[i] = 1.0 / (t * t)
    else:
        for i in range(n):
            second[i] = 1.0 + sign * step[i] / reach[i]
        powers(second[:n], power - 1.0, first, room)
    for i in range(n):
        t = 1.0 + sign * step[i] / reach[i]
        second[i] = (1.0 - power) * first[i] / (t * reach[i])
        if power != 0.0:
            value[i] = sign * reach[i] * (t * first[i] - 1.0) / power
    if power == 0.0:
        for i in range(n):
            value[i] = sign * reach[i] * np.log(1.0 + sign * step[i] / reach[i])


@member_kernel
def _function_row(
    f: Floats, weight: float, low: Floats, high: Floats, jacobian: Floats, gradient: Floats, diagonal: Floats
) -> float:
    """Add a function row, times its multiplier, to the gradient and the diagonal of the Lagrangian.

    In:
      f (n,): the row's slopes at the iterate.
      weight: its multiplier.
      low, high (3, n): primitive, first and size of the second derivative of the terms with shifts below and above.
    Out:
      jacobian (n,): the row's derivatives.
      gradient, diagonal (n,): weight times its first and second derivatives, added to.

    Only n entries are used where arrays are longer. Returns the change of the row.
    """
    total = 0.0
    for i in range(len(f)):
        falling = min(f[i], 0.0)
        rising = f[i] - falling
        total += falling * low[0, i] + rising * high[0, i]
        d = falling * low[1, i] + rising * high[1, i]
        jacobian[i] = d
        gradient[i] += weight * d
        diagonal[i] += weight * (rising * high[2, i] - falling * low[2, i])
    return total


@member_kernel
def add(total: Floats, weight: float, row: Floats) -> None:
    """total += weight * row, of the first one's length."""
    for i in range(len(total)):
        total[i] += weight * row[i]


@member_kernel
def put(out: Floats, row: Floats) -> None:
    """out = row, of the first one's length. (`out[:] = row` compiles for ten times as long.)"""
    for i in range(len(out)):
        out[i] = row[i]


@member_kernel
def dot(a: Floats, b: Floats) -> float:
    """The inner product of two vectors, of the first one's length."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total


@member_kernel
def _dot3(a: Floats, b: Floats, c: Floats) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i] * c[i]
    return total


@member_kernel
def expand(
    F: Floats,
    B: Floats,
    dual: Floats,
    frame: Floats,
    power: float,
    linear_above: bool,
    bounds: Floats,
    work: Floats,
    S: Floats,
    rhs: Floats,
    values: Floats,
) -> tuple[float, float]:
    """Rows, Jacobian, diagonal, Schur complement and the predictor's right side at the current point.

    Constant:
      F (R, N): slopes of the function rows at the iterate.
      frame (4, N): the iterate, the distances of its shifts below and above, kappa.
      power: the exponent xi.
      linear_above: whether terms with shifts above are linear.
    In:
      dual (K,): multipliers of the rows.
      bounds (4, N): distances to the bounds and their multipliers.
    Out:
      B (K, N): B[:R], the Jacobian of the function rows; the linear rows in B[R:] are read.
      work (5, N): D^-1; rho, minus the gradient of the Lagrangian without the bounds' part; the targets of the bounds'
        complementarity, minus their multipliers. The row of steps is left alone.
      S (K, K): B D^-1 B^T.
      rhs (K,): B D^-1 rho.
      values (K,): the change of the function rows, and A v of the linear ones.

    Returns the sum of the bounds' complementarity products and the largest entry of the dual residual.
    """
    R, N = F.shape
    K = B.shape[0]
    S.fill(0.0)
    rhs.fill(0.0)
    values.fill(0.0)
    gap, worst = 0.0, 0.0
    low, high = np.empty((3, BLOCK)), np.empty((3, BLOCK))
    v, step, diagonal = np.empty(BLOCK), np.empty(BLOCK), np.empty(BLOCK)
    room = np.empty((3, BLOCK), dtype=np.int64)
    for start in range(0, N, BLOCK):
        stop = min(start + BLOCK, N)
        n = stop - start
        bl, bu, ml, mu = (
            bounds[0, start:stop],
            bounds[1, start:stop],
            bounds[2, start:stop],
            bounds[3, start:stop],
        )
        inv, g, kl, ku = work[0, start:stop], work[1, start:stop], work[3, start:stop], work[4, start:stop]
        c, k = frame[0, start:stop], frame[3, start:stop]
        for i in range(n):
            v[i] = bl[i] if bl[i] < bu[i] else 1.0 - bu[i]
            step[i] = v[i] - c[i]
            g[i] = k[i] * step[i]
            diagonal[i] = k[i] + ml[i] / bl[i] + mu[i] / bu[i]
        for side in range(2 if R > 0 else 0):
            out = low if side == 0 else high
            power_here = 1.0 if side == 1 and linear_above else power
            _terms(step[:n], 1.0 - 2.0 * side, frame[1 + side, start:stop], power_here, out[0], out[1], out[2], room)
        for a in range(K):
            row = B[a, start:stop]
            if a < R:
                values[a] += _function_row(F[a, start:stop], dual[a], low, high, row, g, diagonal)
            else:
                values[a] += dot(row, v)
                add(g, dual[a], row)
        for i in range(n):
            gap += ml[i] * bl[i] + mu[i] * bu[i]
            worst = max(worst, abs(g[i] - ml[i] + mu[i]))
            g[i] = -g[i]
            inv[i] = 1.0 / diagonal[i]
            kl[i] = -ml[i]
            ku[i] = -mu[i]
        for a in range(K):
            row = B[a, start:stop]
            rhs[a] += _dot3(row, inv, g)
            for b in range(a + 1):
                S[a, b] += _dot3(row, inv, B[b, start:stop])
                S[b, a] = S[a, b]
    return gap, worst


@member_kernel
def direct(B: Floats, change: Floats, bounds: Floats, work: Floats) -> tuple[float, float, float, float, float]:
    """The steps of variables and of their bounds' multipliers, for the rows' multiplier steps `change`.

    Returns the largest -dw/w and -dz/z (w a distance to a bound, z its multiplier), and the sums of z dw, w
    dz and dw dz over both bounds.
    """
    K, N = B.shape
    primal, multiplier, zdw, wdz, dwdz = 0.0, 0.0, 0.0, 0.0, 0.0
    for start in range(0, N, BLOCK):
        stop = min(start + BLOCK, N)
        bl, bu, ml, mu = (
            bounds[0, start:stop],
            bounds[1, start:stop],
            bounds[2, start:stop],
            bounds[3, start:stop],
        )
        inv, g, d = work[0, start:stop], work[1, start:stop], work[2, start:stop]
        kl, ku = work[3, start:stop], work[4, start:stop]
        for i in range(len(d)):
            d[i] = g[i]
        for a in range(K):
            add(d, -change[a], B[a, start:stop])
        for i in range(len(d)):
            d[i] *= inv[i]
            lower = d[i] / bl[i]
            upper = d[i] / bu[i]
            kl[i] -= ml[i] * lower
            ku[i] += mu[i] * upper
            primal = max(primal, max(-lower, upper))
            multiplier = max(multiplier, max(-kl[i] / ml[i], -ku[i] / mu[i]))
            zdw += (ml[i] - mu[i]) * d[i]
            wdz += bl[i] * kl[i] + bu[i] * ku[i]
            dwdz += (kl[i] - ku[i]) * d[i]
    return primal, multiplier, zdw, wdz, dwdz


@member_kernel
def correct(B: Floats, bounds: Floats, work: Floats, target: float, rhs: Floats) -> None:
    """From the predictor's steps, the corrector's targets, rho and rhs, for complementarity products of
    `target`."""
    K, N = B.shape
    rhs.fill(0.0)
    for start in range(0, N, BLOCK):
        stop = min(start + BLOCK, N)
        bl, bu, ml, mu = (
            bounds[0, start:stop],
            bounds[1, start:stop],
            bounds[2, start:stop],
            bounds[3, start:stop],
        )
        inv, g, d = work[0, start:stop], work[1, start:stop], work[2, start:stop]
        kl, ku = work[3, start:stop], work[4, start:stop]
        for i in range(len(d)):
            kl[i] = (target - d[i] * kl[i]) / bl[i] - ml[i]
            ku[i] = (target + d[i] * ku[i]) / bu[i] - mu[i]
            g[i] += kl[i] - ku[i] + ml[i] - mu[i]
        for a in range(K):
            rhs[a] += _dot3(B[a, start:stop], inv, g)


@member_kernel
def move(bounds: Floats, work: Floats, primal: float, dual: float) -> None:
    """Move the distances from the bounds and their multipliers along the step, by the primal and the dual length."""
    wl, wu, zl, zu = bounds[0], bounds[1], bounds[2], bounds[3]
    d, dl, du = work[2], work[3], work[4]
    for i in range(len(d)):
        wl[i] += primal * d[i]
        wu[i] -= primal * d[i]
        zl[i] += dual * dl[i]
        zu[i] += dual * du[i]


@member_kernel
def eliminate(matrix: Floats, right: Floats, solution: Floats) -> bool:
    """solution = matrix^-1 right for a small dense matrix, by elimination with partial pivoting; False if
    singular."""
    n = len(right)
    M = np.empty((n, n))
    for r in range(n):
        solution[r] = right[r]
        for k in range(n):
            M[r, k] = matrix[r, k]
    for c in range(n):
        p = c
        for r in range(c + 1, n):
            if abs(M[r, c]) > abs(M[p, c]):
                p = r
        if not abs(M[p, c]) > 0.0:
            return False
        if p != c:
            for k in range(n):
                M[c, k], M[p, k] = M[p, k], M[c, k]
            solution[c], solution[p] = solution[p], solution[c]
        for r in range(c + 1, n):
            factor = M[r, c] / M[c, c]
            for k in range(c, n):
                M[r, k] -= factor * M[c, k]
            solution[r] -= factor * solution[c]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            solution[c] -= M[c, k] * solution[k]
        solution[c] /= M[c, c]
    return True


@kernel
def centred_gap(gap: float, share: float) -> float:
    """The gap that a corrector aims for (Mehrotra): gap times the cube of the share of it that the predictor leaves.

    In a `member_kernel` LLVM may order the factors, which it does otherwise in some processes: last bits would differ.
    """
    return (share * share) * (share * gap)


@kernel
def corrector_gap(gap: float, total: float, after: float) -> float:
    """`centred_gap` for sums of all products before and after the predictor's step, of which `gap` is the mean."""
    return centred_gap(gap, min(1.0, max(0.0, after / total)))


@member_kernel
def _rows_right(kind: Ints, rhs: Floats, miss: Floats, rows: Floats, aims: Floats, rz: float, right: Floats) -> None:
    """The right side of the system for the steps of the rows' multipliers and of z, for the present targets.

    In:
      kind (K,): what each row is, OBJECTIVE, ELASTIC, LIMIT or EQUAL.
      rhs (K,): B D^-1 rho.
      miss (K,): residuals of the rows, their slacks included.
      rows (6, K), aims (4, K): as the module has them; of `aims` the first two.
      rz: residual of the condition that multipliers of the objective's rows add up to 1.
    Out:
      right (K + 1,): the right side, that of z last.
    """
    for a in range(len(kind)):
        right[a] = rhs[a] + miss[a] + aims[0, a]
        if kind[a] == ELASTIC:
            right[a] -= rows[2, a] / rows[3, a] * aims[1, a]
    right[len(kind)] = rz


@member_kernel
def _rows_direct(kind: Ints, change: Floats, rows: Floats, aims: Floats) -> tuple[float, float, float, float, float]:
    """The rows' own steps for their multiplier steps `change`; returns what `direct` returns."""
    primal, multiplier, zdw, wdz, dwdz = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(len(kind)):
        if kind[a] == EQUAL:
            aims[2, a] = 0.0
            continue
        s, y, dy = rows[0, a], rows[1, a], change[a]
        ds = aims[0, a] - s / y * dy
        aims[2, a] = ds
        primal = max(primal, -ds / s)
        multiplier = max(multiplier, -dy / y)
        zdw += y * ds
        wdz += s * dy
        dwdz += ds * dy
        if kind[a] == ELASTIC:
            # y + ze = penalty holds from the start: the difference would be all rounding where ze is small.
            e, ze = rows[2, a], rows[3, a]
            de = e / ze * (dy + aims[1, a])
            dze = -dy
            aims[1, a], aims[3, a] = dze, de
            primal = max(primal, -de / e)
            multiplier = max(multiplier, -dze / ze)
            zdw += ze * de
            wdz += e * dze
            dwdz += de * dze
    return primal, multiplier, zdw, wdz, dwdz


@vector_entry
def interior_loop(
    F: Floats,
    B: Floats,
    offsets: Floats,
    kind: Ints,
    frame: Floats,
    power: float,
    linear_above: bool,
    bounds: Floats,
    rows: Floats,
    mu: float,
    max_steps: int,
    gap: float,
    residual: float,
) -> tuple[int, bool]:
    """Mehrotra's predictor and corrector, from the point in `bounds` and the multipliers in `rows`.

    Constant:
      F (R, N): slopes of the function rows at the iterate.
      offsets (K,): the value of a function row at the iterate, -b of a linear one.
      kind (K,): what each row is: OBJECTIVE (f - z <= 0), ELASTIC (f - e <= 0), LIMIT or EQUAL.
      frame (4, N): the iterate, the distances of its shifts below and above, kappa.
      power: the exponent xi.
      linear_above: whether terms with shifts above are linear.
    In:
      mu: complementarity to start the slacks from.
      max_steps: steps after which it gives up.
      gap, residual: it stops when the mean complementarity product is at most `gap` and every residual at most
        `residual`.
    Out:
      B (K, N): B[:R], the Jacobian of the function rows; the linear rows in B[R:] are read.
      bounds (4, N): distances to the bounds and their multipliers, moved to the last point.
      rows (6, K): multipliers, moved from those given; slacks and elastic variables with their multipliers, which are
        started here; penalties and sizes are read.

    Returns the steps taken and whether it stopped as it should.
    """
    K, N = B.shape
    work = np.empty((5, N))
    S, system = np.empty((K, K)), np.empty((K + 1, K + 1))
    rhs, right, change = np.empty(K), np.empty(K + 1), np.empty(K + 1)
    values, miss, aims = np.empty(K), np.empty(K), np.empty((4, K))
    s, y, e, ze, penalty, size = rows[0], rows[1], rows[2], rows[3], rows[4], rows[5]
    z = 0.0
    count = 2 * N
    for a in range(K):
        count += 2 if kind[a] == ELASTIC else (0 if kind[a] == EQUAL else 1)
    step = 0
    while True:
        total, worst = expand(F, B, y, frame, power, linear_above, bounds, work, S, rhs, values)
        if step == 0:
            # Slacks that satisfy the rows where they can, and stay clear of zero where they cannot.
            for a in range(K):
                f = values[a] + offsets[a]
                if kind[a] == OBJECTIVE:
                    z = f + mu if a == 0 else max(z, f + mu)
                e[a] = max(f, 0.0) + mu
                ze[a] = penalty[a] - y[a]
            for a in range(K):
                f = values[a] + offsets[a]
                top = z if kind[a] == OBJECTIVE else (e[a] if kind[a] == ELASTIC else 0.0)
                s[a] = 0.0 if kind[a] == EQUAL else max(top - f, mu)
        rz = 0.0
        for a in range(K):
            miss[a] = values[a] + offsets[a] + s[a]
            if kind[a] == OBJECTIVE:
                miss[a] -= z
                rz = 1.0 - y[a] if a == 0 else rz - y[a]
            elif kind[a] == ELASTIC:
                miss[a] -= e[a]
                total += e[a] * ze[a]
            worst = max(worst, abs(miss[a]) / size[a])
            total += s[a] * y[a]
        worst = max(worst, abs(rz))
        tight = total <= 1e-4 * gap * count and worst <= 1e3 * residual
        if tight or (total <= gap * count and worst <= residual):
            return step, True
        if step == max_steps or not worst + total < HUGE:
            return step, False
        step += 1

        system[K, K] = 1.0
        for a in range(K):
            for b in range(K):
                system[a, b] = S[a, b]
            system[a, K] = system[K, a] = 0.0
            aims[0, a], aims[1, a] = -s[a], -ze[a]
            if kind[a] == EQUAL:
                # An equality that others already imply would make the system singular.
                system[a, a] *= 1.0 + 1e-14
                continue
            system[a, a] += s[a] / y[a]
            if kind[a] == OBJECTIVE:
                system[a, K] = system[K, a] = 1.0
                system[K, K] = 0.0
            elif kind[a] == ELASTIC:
                system[a, a] += e[a] / ze[a]
        ap, ad, target = 0.0, 0.0, 0.0
        for corrector in range(2):
            if corrector == 1:
                correct(B, bounds, work, target, rhs)
                for a in range(K):
                    if kind[a] != EQUAL:
                        aims[0, a] = (target - aims[2, a] * change[a]) / y[a] - s[a]
                    if kind[a] == ELASTIC:
                        aims[1, a] = (target - aims[3, a] * aims[1, a]) / e[a] - ze[a]
            _rows_right(kind, rhs, miss, rows, aims, rz, right)
            if not eliminate(system, right, change):
                return step, False
            p, q, zdw, wdz, dwdz = direct(B, change, bounds, work)
            p_rows, q_rows, u1, u2, u3 = _rows_direct(kind, change, rows, aims)
            keep = 1.0 if corrector == 0 else max(0.99, 1.0 - total / count)
            ap, ad = keep / max(keep, p, p_rows), keep / max(keep, q, q_rows)
            after = total + ap * (zdw + u1) + ad * (wdz + u2) + ap * ad * (dwdz + u3)
            target = corrector_gap(total / count, total, after)
        move(bounds, work, ap, ad)
        z += float(ap * change[K])
        for a in range(K):
            s[a] += ap * aims[2, a]
            y[a] += ad * change[a]
            if kind[a] == ELASTIC:
                e[a] += ap * aims[3, a]
                ze[a] += ad * aims[1, a]
