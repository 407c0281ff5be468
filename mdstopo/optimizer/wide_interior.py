"""A convex quadratic program with few rows and some thousand variables, by a compiled primal-dual interior point.

    minimise   e_0 + sum_j penalty_j e_j + sum_i h_i (v_i - c_i)^2 / 2 - w' M^-1 w / 2
    subject to Q_k v + f_k <= e_g                 a line of group g
               Q_k v + f_k <= 0  or  = 0          a linear row
               w_k = Q_k v + f_k                  a row of the curvature
               e_j >= 0 (j >= 1),  0 <= v_i <= 1 of all variables but the last few, which have no bounds

theta (R,) are the rows' multipliers; of a row of the curvature -M^-1 w. Bounds are eliminated variable by variable;
each step of Mehrotra's predictor and corrector solves one dense system of the size of the rows and the groups. Arrays
are those of `interior_kernels`; there a variable without bounds has both `NO_BOUND`.
"""

import numpy as np

from mdstopo.compiler.jit import member_kernel, vector_entry
from mdstopo.optimizer.interior_kernels import _dot3, add, correct, corrector_gap, direct, dot, eliminate, move
from mdstopo.optimizer.problem import Floats, Ints

BLOCK = 1024
#: what a row is
LINE, LIMIT, EQUAL, CURVED = 0, 1, 2, 3
#: the distance to a bound that there is not, and its multiplier
NO_BOUND, NO_MULTIPLIER = 1e150, 1e-300
#: steps without halving what is missing after which rounding is all that is left
PATIENCE = 4


@member_kernel
def _expand(
    Q: Floats, theta: Floats, frame: Floats, v: Floats, bounds: Floats, work: Floats, S: Floats, rhs: Floats,
    values: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Rows Q v, the Schur complement and the predictor's right side at the current point.

    Constant:
      Q (R, n): the rows.
      frame (2, n): c and h of the quadratic terms.
    In:
      theta (R,): multipliers of the rows.
      v (n,): the variables.
      bounds (4, n): distances to the bounds and their multipliers.
    Out:
      work (5, n): D^-1, rho, and minus the bounds' multipliers, as in `interior_kernels`; the row of steps is left
      alone. S (R, R): Q D^-1 Q'.
      rhs (R,): Q D^-1 rho.
      values (R,): Q v.

    Returns the sum of the bounds' complementarity products and the largest entry of the dual residual.
    """
    R, n = Q.shape
    S.fill(0.0)
    rhs.fill(0.0)
    values.fill(0.0)
    gap, worst = 0.0, 0.0
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        bl, bu, ml, mu = bounds[0, start:stop], bounds[1, start:stop], bounds[2, start:stop], bounds[3, start:stop]
        inv, g, kl, ku = work[0, start:stop], work[1, start:stop], work[3, start:stop], work[4, start:stop]
        c, h, y = frame[0, start:stop], frame[1, start:stop], v[start:stop]
        for i in range(stop - start):
            g[i] = h[i] * (y[i] - c[i])
        for a in range(R):
            row = Q[a, start:stop]
            values[a] += dot(row, y)
            add(g, theta[a], row)
        for i in range(stop - start):
            gap += ml[i] * bl[i] + mu[i] * bu[i]
            worst = max(worst, abs(g[i] - ml[i] + mu[i]))
            g[i] = -g[i]
            inv[i] = 1.0 / (h[i] + ml[i] / bl[i] + mu[i] / bu[i])
            kl[i] = -ml[i]
            ku[i] = -mu[i]
        for a in range(R):
            row = Q[a, start:stop]
            rhs[a] += _dot3(row, inv, g)
            for b in range(a + 1):
                S[a, b] += _dot3(row, inv, Q[b, start:stop])
                S[b, a] = S[a, b]
    return gap, worst


@member_kernel
def _refined(matrix: Floats, right: Floats, scale: Floats, out: Floats, room: Floats) -> bool:
    """out = matrix^-1 right, scaled to a diagonal of ones and refined once; False if singular. room: (3, n), scale."""
    n = len(right)
    scaled = np.empty((n, n))
    for a in range(n):
        for b in range(n):
            scaled[a, b] = matrix[a, b] * scale[a] * scale[b]
        room[0, a] = right[a] * scale[a]
    if not eliminate(scaled, room[0], room[1]):
        return False
    for a in range(n):
        left = room[0, a]
        for b in range(n):
            left -= scaled[a, b] * room[1, b]
        room[2, a] = left
    if not eliminate(scaled, room[2], room[0]):
        return False
    for a in range(n):
        out[a] = (room[1, a] + room[0, a]) * scale[a]
    return True


@member_kernel
def _rows_direct(
    kind: Ints, group: Ints, change: Floats, rows: Floats, levels: Floats, aims: Floats, level_aims: Floats
) -> tuple[float, float, float, float, float]:
    """The steps of slacks and of the levels' multipliers, for the steps of the rows' multipliers and of the levels.

    Constant:
      kind (R,): what each row is, LINE, LIMIT, EQUAL or CURVED.
      group (R,): whose line each is; not used.
    In:
      change (R + J + 1,): steps of the rows' multipliers, then of the levels e.
      rows (2, R): slacks and multipliers.
      levels (2, J + 1): the levels e and their multipliers.
    Out:
      aims (2, R): targets of the slacks, which are read, and the slacks' steps.
      level_aims (2, J + 1): targets of the levels' multipliers, which are read, and these multipliers' steps.

    Returns the largest -dw/w and -dz/z (w a slack or a level, z its multiplier), and the sums of z dw, w dz and dw dz.
    """
    R = len(kind)
    primal, multiplier, zdw, wdz, dwdz = 0.0, 0.0, 0.0, 0.0, 0.0
    for a in range(R):
        aims[1, a] = 0.0
        if kind[a] > LIMIT:
            continue
        s, y, dy = rows[0, a], rows[1, a], change[a]
        ds = aims[0, a] - s / y * dy
        aims[1, a] = ds
        primal = max(primal, -ds / s)
        multiplier = max(multiplier, -dy / y)
        zdw += y * ds
        wdz += s * dy
        dwdz += ds * dy
    for j in range(1, levels.shape[1]):
        e, ze, de = levels[0, j], levels[1, j], change[R + j]
        dze = level_aims[0, j] - ze / e * de
        level_aims[1, j] = dze
        primal = max(primal, -de / e)
        multiplier = max(multiplier, -dze / ze)
        zdw += ze * de
        wdz += e * dze
        dwdz += de * dze
    return primal, multiplier, zdw, wdz, dwdz


@vector_entry
def interior(
    Q: Floats, f: Floats, kind: Ints, group: Ints, M: Floats, frame: Floats, bounded: int, penalty: Floats,
    size: Floats, v: Floats, bounds: Floats, rows: Floats, levels: Floats, settings: Floats,
) -> tuple[int, float, float]:  # fmt: skip
    """Solve the program from a point inside; what moves ends at the best point that was met.

    Constant:
      Q (R, n): the rows.
      f (R,): what is added to Q v.
      kind (R,): what each row is, LINE, LIMIT, EQUAL or CURVED.
      group (R,): the group of each line.
      M (R, R): 0 but of rows of the curvature.
      frame (2, n): c and h of the quadratic terms.
      bounded: how many of the variables, the first ones, are in [0, 1].
      penalty (J + 1,): of the objective 1, or 0 where it has no rows, then of the constraints.
      size (R,): what residuals of rows are relative to.
      settings (3,): mean complementarity product and residual to be reached, most steps.
    Out, moved from where they start to the best point:
      v (n,): the variables.
      bounds (4, n): distances to the bounds and their multipliers, as in `interior_kernels`.
      rows (2, R): slacks and multipliers.
      levels (2, J + 1): the levels e and their multipliers.

    Returns steps, mean product and largest residual.
    """
    R, n = Q.shape
    G = levels.shape[1]
    wanted_gap, wanted, most = settings[0], settings[1], settings[2]
    work = np.empty((5, n))
    S, system = np.empty((R, R)), np.empty((R + G, R + G))
    rhs, values, miss = np.empty(R), np.empty(R), np.empty(R)
    right, change, scale, room = np.empty(R + G), np.zeros(R + G), np.empty(R + G), np.empty((3, R + G))
    aims, level_aims, missing = np.zeros((2, R)), np.zeros((2, G)), np.empty(G)
    best_v, best_bounds, best_rows, best_levels = v.copy(), bounds.copy(), rows.copy(), levels.copy()
    s, y, e, ze = rows[0], rows[1], levels[0], levels[1]
    count = 2 * bounded + G - 1
    for a in range(R):
        count += 1 if kind[a] <= LIMIT else 0
    step, lately, best, best_gap, best_worst = 0, 0, np.inf, np.inf, np.inf
    while True:
        total, worst = _expand(Q, y, frame, v, bounds, work, S, rhs, values)
        for j in range(G):
            missing[j] = penalty[j] - (ze[j] if j > 0 else 0.0)
            total += e[j] * ze[j] if j > 0 else 0.0
        for a in range(R):
            miss[a] = values[a] + f[a]
            if kind[a] == LINE:
                miss[a] += s[a] - e[group[a]]
                missing[group[a]] -= y[a]
            elif kind[a] == LIMIT:
                miss[a] += s[a]
            elif kind[a] == CURVED:
                for b in range(R):
                    miss[a] += M[a, b] * y[b]
            if kind[a] <= LIMIT:
                total += s[a] * y[a]
            worst = max(worst, abs(miss[a]) / size[a])
        for j in range(G):
            worst = max(worst, abs(missing[j]) / max(1.0, penalty[j]))
        score = max(total / count / wanted_gap, worst / wanted)
        if not score < np.inf:
            break
        lately = step if score < 0.5 * best else lately
        if score < best:
            best, best_gap, best_worst = score, total / count, worst
            best_v[:] = v
            best_bounds[:] = bounds
            best_rows[:] = rows
            best_levels[:] = levels
        if score <= 1.0 or step >= most or step - lately >= (PATIENCE if best <= 1e3 else 5 * PATIENCE):
            break
        step += 1

        system.fill(0.0)
        for a in range(R):
            for b in range(R):
                system[a, b] = S[a, b] - M[a, b]
            aims[0, a] = -s[a]
            if kind[a] <= LIMIT:
                system[a, a] += s[a] / y[a]
            elif kind[a] == EQUAL:
                system[a, a] *= 1.0 + 1e-14  # an equality that others imply would make the system singular
            if kind[a] == LINE:
                system[a, R + group[a]] = system[R + group[a], a] = 1.0
        for j in range(1, G):
            system[R + j, R + j] = -ze[j] / e[j]
            level_aims[0, j] = -ze[j]
        for a in range(R + G):
            scale[a] = abs(system[a, a])
            if scale[a] == 0.0:
                for b in range(R + G):
                    scale[a] = max(scale[a], abs(system[a, b]))
            if scale[a] == 0.0:  # a level without rows stays
                system[a, a] = scale[a] = 1.0
            scale[a] = 1.0 / np.sqrt(scale[a])
        ap, target, solved = 0.0, 0.0, True
        for corrector in range(2):
            if corrector == 1:
                correct(Q, bounds, work, target, rhs)
                for a in range(R):
                    if kind[a] <= LIMIT:
                        aims[0, a] = (target - aims[1, a] * change[a]) / y[a] - s[a]
                for j in range(1, G):
                    level_aims[0, j] = (target - level_aims[1, j] * change[R + j]) / e[j] - ze[j]
            for a in range(R):
                right[a] = rhs[a] + miss[a] + (aims[0, a] if kind[a] <= LIMIT else 0.0)
            for j in range(G):
                right[R + j] = missing[j] - (level_aims[0, j] if j > 0 else 0.0)
            solved = _refined(system, right, scale, change, room)
            if not solved:
                break
            p, q, zdw, wdz, dwdz = direct(Q, change[:R], bounds, work)
            p_rows, q_rows, u1, u2, u3 = _rows_direct(kind, group, change, rows, levels, aims, level_aims)
            keep = 1.0 if corrector == 0 else max(0.99, 1.0 - total / count)
            # one length for both: the program is quadratic
            ap = keep / max(keep, max(max(p, p_rows), max(q, q_rows)))
            after = total + ap * (zdw + u1 + wdz + u2) + ap * ap * (dwdz + u3)
            target = corrector_gap(total / count, total, after)
        if not (solved and ap > 1e-14):
            break
        move(bounds, work, ap, ap)
        for i in range(n):
            v[i] += ap * work[2, i]
        for i in range(bounded):  # the nearer bound tells the place
            v[i] = bounds[0, i] if bounds[0, i] < bounds[1, i] else 1.0 - bounds[1, i]
        for a in range(R):
            s[a] += ap * aims[1, a]
            y[a] += ap * change[a]
        for j in range(G):
            e[j] += ap * change[R + j]
            ze[j] += ap * level_aims[1, j] if j > 0 else 0.0
    v[:] = best_v
    bounds[:] = best_bounds
    rows[:] = best_rows
    levels[:] = best_levels
    return step, best_gap, best_worst
