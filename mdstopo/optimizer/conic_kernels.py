"""The steps of the interior point of `conic`, compiled; see there for what is solved.

A point is three arrays, and so is a step:

    pair (2, T)     slacks and multipliers of scalar inequalities: of the lower bounds (N), the upper bounds (N), the
                    lines (L), the limits among the linear rows, the elastic variables (J), in this order
    cone (2, K, 3)  slacks and multipliers of the norms
    free (1 + q,)   the objective's level, and the multipliers of the q linear rows that are equalities, the last ones
"""

from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import member_kernel, vector_entry
from mdstopo.optimizer import cones
from mdstopo.optimizer.interior_kernels import add, centred_gap, dot, put
from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.optimizer.reduced import Curved, Factored, Rows, factor, solve, times

MAX_STEPS = 100
#: mean complementarity and residuals of a solution, in the scaled problem; and of one that still counts as solved
GAP, RESIDUAL = 1e-14, 1e-11
ENOUGH_GAP, ENOUGH_RESIDUAL = 1e-8, 1e-8
#: steps without halving what is missing after which rounding is all that is left, and how many times as many before
#: the point counts as solved
PATIENCE, MORE = 3, 5
#: share of the way to the boundary that a step goes, and the least step
BOUNDARY_SHARE, LEAST_STEP = 0.99, 1e-14


class Scaled(NamedTuple):
    """The scaled problem, v in [0, 1] and v = at where the step is none.

    slopes (L + 2 K, N): of the lines, of the norms' first and then of their second components; values (L + 2 K,): of
    these at v = 0; group (L + K,): of the lines and norms; excess (K,): c of the norms; A (m, N), b (m,): the linear
    rows, equalities last; penalty (J,); at (N,); curved: the curvature.
    """

    slopes: Floats
    values: Floats
    group: Ints
    excess: Floats
    A: Floats
    b: Floats
    penalty: Floats
    at: Floats
    curved: Curved


class Missing(NamedTuple):
    """Residuals: of the gradient by v (N,), by the levels (J + 1,), of lines (L,), norms (K, 3), linear rows (m,)."""

    gradient: Floats
    level: Floats
    line: Floats
    norm: Floats
    limit: Floats


class Parts(NamedTuple):
    """Where the parts of pairs begin: upper bounds, lines, limits, elastic variables; and how many pairs there are."""

    upper: int
    line: int
    limit: int
    elastic: int
    total: int


@vector_entry
def interior(
    slopes: Floats, values: Floats, group: Ints, excess: Floats, A: Floats, b: Floats, penalty: Floats, at: Floats,
    diagonal: Floats, directions: Floats, weight: Floats, matrix: Floats, pair: Floats, cone: Floats, free: Floats,
) -> tuple[int, bool, float, float]:  # fmt: skip
    """The best point of the iteration, which ends at rounding, after MAX_STEPS or where no step is possible.

    Constant:
      slopes, values, group, excess, A, b, penalty, at: as of `Scaled`.
      diagonal (N,), directions (k, N), weight (k,), matrix (N, N) or (0, 0): the curvature, as `reduced.Curved` has it.
    In place:
      pair, cone, free: the point to begin with, and the best one.

    Returns the steps, whether the point counts as a solution, its mean complementarity and its largest residual.
    """
    p = Scaled(slopes, values, group, excess, A, b, penalty, at, Curved(diagonal, directions, weight, matrix))
    parts = _parts(p, free)
    count = parts.total + len(excess)
    missing = Missing(
        np.empty(len(at)), np.empty(len(penalty) + 1), np.empty(len(group) - len(excess)), np.empty((len(excess), 3)),
        np.empty(len(b)),
    )  # fmt: skip
    here, here_cone, here_free = np.empty(pair.shape), np.empty(cone.shape), np.empty(len(free))
    _put_point(here, here_cone, here_free, pair, cone, free)
    best, best_gap, best_worst, good = np.inf, np.inf, np.inf, False
    step, lately = 0, 0
    while True:
        worst = _find_missing(p, parts, here, here_cone, here_free, missing)
        gap = _gap(here, here_cone) / count
        score = max(gap / GAP, worst / RESIDUAL)
        if not score < np.inf:
            break
        if score < 0.5 * best:
            lately = step
        enough = gap <= ENOUGH_GAP and worst <= ENOUGH_RESIDUAL
        if score < best and (enough or not good):  # rounding may undo what was solved
            best, best_gap, best_worst, good = score, gap, worst, enough
            _put_point(pair, cone, free, here, here_cone, here_free)
        if score <= 1.0 or step == MAX_STEPS or step - lately >= (PATIENCE if good else MORE * PATIENCE):
            break
        step += 1
        if not _advance(p, parts, here, here_cone, here_free, missing, gap, count):
            break
    return step, good, best_gap, best_worst


@member_kernel
def _put_point(pair: Floats, cone: Floats, free: Floats, of_pair: Floats, of_cone: Floats, of_free: Floats) -> None:
    """A point put in the place of another.

    Out:
      pair, cone, free: the place.
    In:
      of_pair, of_cone, of_free: the point.
    """
    for side in range(2):
        put(pair[side], of_pair[side])
        for k in range(cone.shape[1]):
            put(cone[side, k], of_cone[side, k])
    put(free, of_free)


@member_kernel
def _parts(p: Scaled, free: Floats) -> Parts:
    """Where the parts of pairs begin."""
    n = len(p.at)
    limit = 2 * n + len(p.group) - len(p.excess)
    elastic = limit + len(p.b) - (len(free) - 1)
    return Parts(n, 2 * n, limit, elastic, elastic + len(p.penalty))


@member_kernel
def _gap(pair: Floats, cone: Floats) -> float:
    """The sum of all products of a slack and its multiplier."""
    total = dot(pair[0], pair[1])
    for k in range(cone.shape[1]):
        total += dot(cone[0, k], cone[1, k])
    return total


@member_kernel
def _find_missing(p: Scaled, parts: Parts, pair: Floats, cone: Floats, free: Floats, missing: Missing) -> float:
    """What is missing at a point, and the largest of it.

    Constant:
      p, parts: the problem, and where the parts of pairs begin.
    In:
      pair, cone, free: the point.
    Out:
      missing: the residuals.
    """
    n, lines, norms, groups = len(p.at), len(missing.line), len(p.excess), len(missing.level)
    limits = parts.elastic - parts.limit
    v, lower, upper = pair[0, :n], pair[1, :n], pair[1, n : 2 * n]
    gradient, level = missing.gradient, missing.level
    moved = np.empty(n)
    for i in range(n):
        moved[i] = v[i] - p.at[i]
    times(p.curved, moved, gradient)
    for i in range(n):
        gradient[i] += upper[i] - lower[i]
    level[0] = 1.0
    for j in range(1, groups):
        level[j] = p.penalty[j - 1] - pair[1, parts.elastic + j - 1]
    for r in range(lines):
        g = p.group[r]
        y = pair[1, parts.line + r]
        add(gradient, y, p.slopes[r])
        level[g] -= y
        at_level = free[0] if g == 0 else pair[0, parts.elastic + g - 1]
        missing.line[r] = at_level - p.values[r] - dot(p.slopes[r], v) - pair[0, parts.line + r]
    for k in range(norms):
        first, second, g = lines + k, lines + norms + k, p.group[lines + k]
        add(gradient, -cone[1, k, 1], p.slopes[first])
        add(gradient, -cone[1, k, 2], p.slopes[second])
        level[g] -= cone[1, k, 0]
        at_level = free[0] if g == 0 else pair[0, parts.elastic + g - 1]
        missing.norm[k, 0] = at_level + p.excess[k] - cone[0, k, 0]
        missing.norm[k, 1] = p.values[first] + dot(p.slopes[first], v) - cone[0, k, 1]
        missing.norm[k, 2] = p.values[second] + dot(p.slopes[second], v) - cone[0, k, 2]
    for a in range(len(p.b)):
        limit = a < limits
        add(gradient, pair[1, parts.limit + a] if limit else free[1 + a - limits], p.A[a])
        missing.limit[a] = p.b[a] - dot(p.A[a], v) - (pair[0, parts.limit + a] if limit else 0.0)
    worst = max(_largest(gradient), _largest(level), _largest(missing.line), _largest(missing.limit))
    for k in range(norms):
        worst = max(worst, _largest(missing.norm[k]))
    return max(worst, cones.outside(cone[0]), cones.outside(cone[1]))


@member_kernel
def _largest(x: Floats) -> float:
    """The largest size of a number, or NaN where there is one."""
    most = 0.0
    for i in range(len(x)):
        if not abs(x[i]) <= most:
            most = abs(x[i])
    return most


@member_kernel
def _advance(
    p: Scaled, parts: Parts, pair: Floats, cone: Floats, free: Floats, missing: Missing, gap: float, count: int
) -> bool:
    """One predictor and corrector; whether the point has moved.

    Constant:
      p, parts: the problem, and where the parts of pairs begin.
      count: of all complementarity products.
    In:
      missing, gap: residuals and mean complementarity of the point.
    In place:
      pair, cone, free: the point.
    """
    scaling = cones.scaling_of(cone[0], cone[1])
    rows = _rows(p, parts, pair, scaling)
    n = len(p.at)
    D, L = np.empty(n), np.zeros(len(p.b))
    for i in range(n):
        D[i] = pair[1, i] / pair[0, i] + pair[1, n + i] / pair[0, n + i]
    for t in range(parts.limit, parts.elastic):
        L[t - parts.limit] = pair[0, t] / pair[1, t]
    E = np.empty(len(p.penalty))
    for j in range(len(E)):
        E[j] = pair[1, parts.elastic + j] / pair[0, parts.elastic + j]
    system, solvable = factor(p.curved, D, rows, p.A, L, E)
    if not solvable:
        return False
    step, step_cone, step_free = np.zeros(pair.shape), np.zeros(cone.shape), np.zeros(len(free))
    target, a = 0.0, 0.0
    for corrector in range(2):
        aim, aim_cone = np.empty(parts.total), np.empty((len(p.excess), 3))
        for t in range(parts.total):
            aim[t] = target - pair[0, t] * pair[1, t] - step[0, t] * step[1, t]
        cones.aim(scaling, target, step_cone[0], step_cone[1], corrector == 1, aim_cone)
        _direct(p, parts, system, rows, scaling, pair, missing, aim, aim_cone, step, step_cone, step_free)
        if not _largest(step[0, :n]) < np.inf:
            return False
        share = BOUNDARY_SHARE if corrector == 1 else 1.0
        a = min(1.0, share * min(_longest(pair, step), cones.longest(scaling, step_cone[0], step_cone[1])))
        if corrector == 0:
            after = 0.0
            for t in range(parts.total):
                after += (pair[0, t] + a * step[0, t]) * (pair[1, t] + a * step[1, t])
            for k in range(len(p.excess)):
                for i in range(3):
                    after += (cone[0, k, i] + a * step_cone[0, k, i]) * (cone[1, k, i] + a * step_cone[1, k, i])
            target = centred_gap(gap, min(1.0, max(0.0, after / count / gap))) if gap > 0.0 else 0.0
    if not a > LEAST_STEP:
        return False
    for side in range(2):
        add(pair[side], a, step[side])
        for k in range(len(p.excess)):
            add(cone[side, k], a, step_cone[side, k])
    add(free, a, step_free)
    return True


@member_kernel
def _rows(p: Scaled, parts: Parts, pair: Floats, scaling: cones.Scaling) -> Rows:
    """Lines and the norms' three rows in the basis of the scaling, as rows of the system."""
    n, norms = len(p.at), len(p.excess)
    lines = len(p.group) - norms
    many = lines + 3 * norms
    rows = Rows(np.empty((many, n)), np.empty(many, dtype=np.int64), np.empty(many), np.empty(many))
    for r in range(lines):
        put(rows.G[r], p.slopes[r])
        rows.level[r] = p.group[r]
        rows.C[r] = -1.0
        rows.S[r] = pair[0, parts.line + r] / pair[1, parts.line + r]
    for k in range(norms):
        first, second = p.slopes[lines + k], p.slopes[lines + norms + k]
        for e in range(3):
            r = lines + 3 * k + e
            along, beside = -scaling.turn[k, e, 1], -scaling.turn[k, e, 2]
            row = rows.G[r]
            for i in range(n):
                row[i] = along * first[i] + beside * second[i]
            rows.level[r] = p.group[lines + k]
            rows.C[r] = -scaling.turn[k, e, 0]
            rows.S[r] = scaling.squares[k, e]
    return rows


@member_kernel
def _direct(
    p: Scaled, parts: Parts, system: Factored, rows: Rows, scaling: cones.Scaling, pair: Floats, missing: Missing,
    aim: Floats, aim_cone: Floats, step: Floats, step_cone: Floats, step_free: Floats,
) -> None:  # fmt: skip
    """The step whose linearised conditions meet the aims.

    Constant:
      p, parts: the problem, and where the parts of pairs begin.
      system, rows, scaling: the linear system, its rows, and the scaling of the cones.
    In:
      pair, missing: the point's pairs and residuals.
      aim (T,): what the products of pairs are to change by.
      aim_cone (K, 3): likewise of the cones, as `cones.aim` has it.
    Out:
      step, step_cone, step_free: the step.
    """
    n, lines, norms, limits = len(p.at), len(missing.line), len(p.excess), parts.elastic - parts.limit
    elastic = parts.elastic
    r_v, r_e = np.empty(n), np.empty(len(missing.level))
    r_y, r_a = np.empty(len(rows.S)), np.empty(len(p.b))
    dv, de, dy, da = np.empty(n), np.empty(len(r_e)), np.empty(len(r_y)), np.empty(len(r_a))
    for i in range(n):
        r_v[i] = aim[i] / pair[0, i] - aim[n + i] / pair[0, n + i] - missing.gradient[i]
    r_e[0] = -missing.level[0]
    for j in range(1, len(r_e)):
        r_e[j] = aim[elastic + j - 1] / pair[0, elastic + j - 1] - missing.level[j]
    for r in range(lines):
        r_y[r] = missing.line[r] - aim[parts.line + r] / pair[1, parts.line + r]
    for k in range(norms):
        for e in range(3):
            total = 0.0
            for i in range(3):
                total += scaling.turn[k, e, i] * (missing.norm[k, i] - aim_cone[k, i])
            r_y[lines + 3 * k + e] = total
    for a in range(len(r_a)):
        r_a[a] = missing.limit[a]
        if a < limits:
            r_a[a] -= aim[parts.limit + a] / pair[1, parts.limit + a]
    solve(system, rows, p.A, r_v, r_e, r_y, r_a, dv, de, dy, da)
    for i in range(n):
        step[0, i] = dv[i]
        step[1, i] = (aim[i] - pair[1, i] * dv[i]) / pair[0, i]
        step[0, n + i] = -dv[i]
        step[1, n + i] = (aim[n + i] + pair[1, n + i] * dv[i]) / pair[0, n + i]
    for r in range(lines):
        step[0, parts.line + r] = missing.line[r] + de[p.group[r]] - dot(p.slopes[r], dv)
        step[1, parts.line + r] = dy[r]
    for k in range(norms):
        for i in range(3):
            total = 0.0
            for e in range(3):
                total += scaling.turn[k, e, i] * dy[lines + 3 * k + e]
            step_cone[1, k, i] = total
        step_cone[0, k, 0] = missing.norm[k, 0] + de[p.group[lines + k]]
        step_cone[0, k, 1] = missing.norm[k, 1] + dot(p.slopes[lines + k], dv)
        step_cone[0, k, 2] = missing.norm[k, 2] + dot(p.slopes[lines + norms + k], dv)
    for a in range(len(r_a)):
        if a < limits:
            step[0, parts.limit + a] = missing.limit[a] - dot(p.A[a], dv)
            step[1, parts.limit + a] = da[a]
        else:
            step_free[1 + a - limits] = da[a]
    step_free[0] = de[0]
    for j in range(1, len(de)):
        t = elastic + j - 1
        step[0, t] = de[j]
        step[1, t] = (aim[t] - pair[1, t] * de[j]) / pair[0, t]


@member_kernel
def _longest(pair: Floats, step: Floats) -> float:
    """The step to where the first slack or multiplier of a pair would vanish."""
    most = 0.0
    for side in range(2):
        x, d = pair[side], step[side]
        for t in range(len(x)):
            most = max(most, -d[t] / x[t])
    return 1.0 / most if most > 0.0 else np.inf
