"""The linear systems of the interior point in `conic`, reduced to the variables or to the rows, whichever is cheaper.

    (P + D) dv + G' dy + A' da = r_v        D: the diagonal that the bounds leave
    E de + C' dy = r_e                      E: that of the elastic variables, none for the objective
    G dv + C de - S dy = r_y                S: slack over multiplier, a diagonal
    A dv - L da = r_a                       L: slack over multiplier, 0 of an equality

C has one entry a row: that of its level. What is left is a dense symmetric system, scaled to a diagonal of ones and
eliminated with partial pivoting. All of it is compiled: the systems are small and many, and sums have one order
whatever the threads.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import kernel, member_kernel
from mdstopo.optimizer.interior_kernels import add, dot, put
from mdstopo.optimizer.problem import Floats, Ints

#: slack over multiplier, in the scaled problem, below which a row is all but active
ACTIVE = 1e-3
#: passes after which the largest entry of each row of a system is near one (D. Ruiz, 2001)
SCALINGS = 4
#: steps of iterative refinement of a solution
REFINEMENTS = 2


class Curved(NamedTuple):
    """P = diag(diagonal) + factor' diag(weight) factor, or `matrix` where that has rows: diagonal (N,), factor (k, N),
    weight (k,), matrix (N, N)."""

    diagonal: Floats
    factor: Floats
    weight: Floats
    matrix: Floats


class Rows(NamedTuple):
    """Rows of the program: G (R, N); the level (R,) and the entry (R,) of C; S (R,)."""

    G: Floats
    level: Ints
    C: Floats
    S: Floats


class Factored(NamedTuple):
    """A system: the scaled matrix M and its triangles LU, both (size, size); with which row each was exchanged, swap
    (size,); scale (size,); place (R,): where in the system each row is, -1 of one that was eliminated; inverse (N,): of
    the diagonal where the variables were eliminated, else nothing; Q (size of the rows, N): what multiplies them."""

    M: Floats
    LU: Floats
    swap: Ints
    scale: Floats
    place: Ints
    inverse: Floats
    Q: Floats


@member_kernel
def times(P: Curved, x: Floats, out: Floats) -> None:
    """The product of the matrix P with a vector: out (N,) = P x."""
    if len(P.matrix):
        for i in range(len(x)):
            out[i] = dot(P.matrix[i], x)
        return
    for i in range(len(x)):
        out[i] = P.diagonal[i] * x[i]
    for k in range(len(P.weight)):
        add(out, P.weight[k] * dot(P.factor[k], x), P.factor[k])


@kernel
def by_variables(variables: int, others: int) -> bool:
    """Whether the system of the variables is the cheaper one; others: the curvature's rank and the rows."""
    v, r = float(variables), float(others)
    return v**3 + r * v**2 <= r**3 + r**2 * v


@member_kernel
def factor(P: Curved, D: Floats, rows: Rows, A: Floats, L: Floats, E: Floats) -> tuple[Factored, bool]:
    """Factorise the reduced system of an interior-point step; and whether it can be solved.

    P, D (N,), A (m, N), L (m,), E (J,): what it is made of, with the letters of the module's equations.
    rows: G, C and S of these.
    """
    if len(P.matrix) or by_variables(len(D), len(P.weight) + len(rows.S)):
        found = _of_variables(P, D, rows, A, L, E)
    else:
        found = _of_rows(P, D, rows, A, L, E)
    _scale(found)
    return found, _eliminate(found.LU, found.swap)


@member_kernel
def solve(
    found: Factored, rows: Rows, A: Floats, r_v: Floats, r_e: Floats, r_y: Floats, r_a: Floats,
    dv: Floats, de: Floats, dy: Floats, da: Floats,
) -> None:  # fmt: skip
    """The step for right sides.

    Constant:
      found: the system of `factor`, for the rows and A (m, N).
    In:
      r_v (N,), r_e (J + 1,), r_y (R,), r_a (m,): the right sides.
    Out:
      dv (N,), de (J + 1,), dy (R,), da (m,): the step.
    """
    n, g, m, R = len(dv), len(de), len(da), len(dy)
    size = len(found.M)
    right, x = np.empty(size), np.empty(size)
    if len(found.inverse):
        count = size - g
        first = count - m - R
        for i in range(n):
            dv[i] = found.inverse[i] * r_v[i]
        for a in range(count):
            right[a] = dot(found.Q[a], dv)
        for r in range(R):
            right[first + r] -= r_y[r]
        for a in range(m):
            right[first + R + a] -= r_a[a]
        for j in range(g):
            right[count + j] = -r_e[j]
        _refined(found, right, x)
        for i in range(n):
            dv[i] = r_v[i]
        for a in range(count):
            add(dv, -x[a], found.Q[a])
        for i in range(n):
            dv[i] *= found.inverse[i]
        put(dy, x[first:])
        put(da, x[first + R :])
        put(de, x[count:])
        return
    put(right[:n], r_v)
    put(right[n : n + g], r_e)
    put(right[n + g : n + g + m], r_a)
    for r in range(R):
        if found.place[r] >= 0:
            right[found.place[r]] = r_y[r]
        else:
            weight = r_y[r] / rows.S[r]
            add(right[:n], weight, rows.G[r])
            right[n + rows.level[r]] += weight * rows.C[r]
    _refined(found, right, x)
    put(dv, x)
    put(de, x[n:])
    put(da, x[n + g :])
    for r in range(R):
        if found.place[r] >= 0:
            dy[r] = x[found.place[r]]
        else:
            dy[r] = (dot(rows.G[r], dv) + rows.C[r] * de[rows.level[r]] - r_y[r]) / rows.S[r]


@member_kernel
def _of_variables(P: Curved, D: Floats, rows: Rows, A: Floats, L: Floats, E: Floats) -> Factored:
    """Rows eliminated but those that are all but active: a symmetric system of the variables, the levels, the linear
    rows and the rows that are left. P, D, A, L, E, rows: as of `factor`. Not yet scaled, nor eliminated.

    The changes of the multipliers of eliminated rows are quotients by their S, which multiply the rounding of the
    solution: of rows that are all but active nothing would be left of them.
    """
    n, g, m, R = len(D), len(E) + 1, len(L), len(rows.S)
    place = np.empty(R, dtype=np.int64)
    gone = np.empty(R, dtype=np.int64)
    size, many = n + g + m, 0
    for r in range(R):
        if rows.S[r] < ACTIVE:
            place[r] = size
            size += 1
        else:
            place[r] = -1
            gone[many] = r
            many += 1
    M = np.zeros((size, size))
    for i in range(n):  # the lower triangle
        if len(P.matrix):
            put(M[i, : i + 1], P.matrix[i])
        else:
            for k in range(len(P.weight)):
                add(M[i, : i + 1], P.weight[k] * P.factor[k, i], P.factor[k])
            M[i, i] += P.diagonal[i]
        M[i, i] += D[i]
    for j in range(1, g):
        M[n + j, n + j] = E[j - 1]
    _add_products(M, rows, gone[:many], n)
    for a in range(m):
        put(M[n + g + a, :n], A[a])
        M[n + g + a, n + g + a] = -L[a]
    for r in range(R):
        if place[r] >= 0:
            put(M[place[r], :n], rows.G[r])
            M[place[r], n + rows.level[r]] = rows.C[r]
            M[place[r], place[r]] = -rows.S[r]
    swap = np.empty(size, dtype=np.int64)
    return Factored(M, np.empty((size, size)), swap, np.ones(size), place, np.empty(0), np.empty((0, 0)))


@member_kernel
def _add_products(M: Floats, rows: Rows, gone: Ints, n: int) -> None:
    """Add to the lower triangle what rows leave that are eliminated: their outer products over S, four at a time."""
    many = len(gone)
    for start in range(0, many, 4):
        # the last ones of a group that is not full weigh nothing
        a = gone[start]
        b = gone[min(start + 1, many - 1)]
        c = gone[min(start + 2, many - 1)]
        d = gone[min(start + 3, many - 1)]
        weight_a = 1.0 / rows.S[a]
        weight_b = 1.0 / rows.S[b] if start + 1 < many else 0.0
        weight_c = 1.0 / rows.S[c] if start + 2 < many else 0.0
        weight_d = 1.0 / rows.S[d] if start + 3 < many else 0.0
        A, B, C, D = rows.G[a], rows.G[b], rows.G[c], rows.G[d]
        for i in range(n):
            out = M[i, : i + 1]
            wa, wb, wc, wd = weight_a * A[i], weight_b * B[i], weight_c * C[i], weight_d * D[i]
            for j in range(i + 1):
                out[j] += wa * A[j] + wb * B[j] + wc * C[j] + wd * D[j]
    for k in range(many):
        r = gone[k]
        level = n + rows.level[r]
        weight = rows.C[r] / rows.S[r]
        add(M[level, :n], weight, rows.G[r])
        M[level, level] += weight * rows.C[r]


@member_kernel
def _of_rows(P: Curved, D: Floats, rows: Rows, A: Floats, L: Floats, E: Floats) -> Factored:
    """Variables eliminated: a symmetric system of the curvature's rank, the rows, the linear rows and the levels. P,
    D, A, L, E, rows: as of `factor`. Not yet scaled, nor eliminated."""
    n, g, m, R, rank = len(D), len(E) + 1, len(L), len(rows.S), len(P.weight)
    count = rank + R + m
    size = count + g
    Q = np.empty((count, n))
    for k in range(rank):
        put(Q[k], P.factor[k])
    for r in range(R):
        put(Q[rank + r], rows.G[r])
    for a in range(m):
        put(Q[rank + R + a], A[a])
    inverse = np.empty(n)
    for i in range(n):
        inverse[i] = 1.0 / (P.diagonal[i] + D[i])
    M = np.zeros((size, size))
    _add_inner(M, Q, inverse)
    for k in range(rank):
        M[k, k] += 1.0 / P.weight[k]
    for r in range(R):
        M[rank + r, rank + r] += rows.S[r]
        M[count + rows.level[r], rank + r] = -rows.C[r]
    for a in range(m):
        M[rank + R + a, rank + R + a] += L[a]
    for j in range(1, g):
        M[count + j, count + j] = -E[j - 1]
    swap, place = np.empty(size, dtype=np.int64), np.empty(0, dtype=np.int64)
    return Factored(M, np.empty((size, size)), swap, np.ones(size), place, inverse, Q)


#: variables that inner products go through at once, so that rows stay in cache
BLOCK = 1024


@member_kernel
def _add_inner(M: Floats, Q: Floats, inverse: Floats) -> None:
    """Add Q diag(inverse) Q' to the lower triangle of M, rows by two."""
    count, n = Q.shape
    one, other = np.empty(BLOCK), np.empty(BLOCK)
    for start in range(0, n, BLOCK):
        stop = min(start + BLOCK, n)
        width = stop - start
        weight = inverse[start:stop]
        for a in range(0, count, 2):
            above = min(a + 1, count - 1)
            upper, lower = Q[a, start:stop], Q[above, start:stop]
            for i in range(width):
                one[i] = weight[i] * upper[i]
                other[i] = weight[i] * lower[i]
            for b in range(0, a + 1, 2):
                beside = min(b + 1, count - 1)
                left, right = Q[b, start:stop], Q[beside, start:stop]
                p, q, s, t = 0.0, 0.0, 0.0, 0.0
                for i in range(width):
                    p += one[i] * left[i]
                    q += one[i] * right[i]
                    s += other[i] * left[i]
                    t += other[i] * right[i]
                M[a, b] += p
                if beside > b and beside <= a:
                    M[a, beside] += q
                if above > a:
                    M[above, b] += s
                    if beside > b:
                        M[above, beside] += t


@member_kernel
def _scale(found: Factored) -> None:
    """Mirror the lower triangle, find the scale, and scale M into itself and LU."""
    M, scale = found.M, found.scale
    size = len(M)
    for a in range(size):
        for b in range(a):
            M[b, a] = M[a, b]
    largest = np.empty(size)
    for _ in range(SCALINGS):
        for a in range(size):
            row = M[a]
            most = 0.0
            for b in range(size):
                most = max(most, abs(row[b] * scale[b]))
            largest[a] = np.sqrt(most * scale[a])
        for a in range(size):
            if largest[a] > 0.0:
                scale[a] /= largest[a]
    for a in range(size):
        row, copy = M[a], found.LU[a]
        for b in range(size):
            row[b] *= scale[a] * scale[b]
            copy[b] = row[b]


@member_kernel
def _eliminate(LU: Floats, swap: Ints) -> bool:
    """Both triangles of a matrix, in its place, with partial pivoting; False where it is singular or not finite."""
    size = len(LU)
    for c in range(size):
        p = c
        most = abs(LU[c, c])
        for r in range(c + 1, size):
            here = abs(LU[r, c])
            if not here <= most:
                p, most = r, here
        if not (most > 0.0 and most < np.inf):
            return False
        swap[c] = p
        pivot_row = LU[c]
        if p != c:
            other = LU[p]
            for k in range(size):
                kept = pivot_row[k]
                pivot_row[k] = other[k]
                other[k] = kept
        inverse = 1.0 / pivot_row[c]
        behind = pivot_row[c + 1 :]
        for r in range(c + 1, size):
            if LU[r, c] != 0.0:
                LU[r, c] *= inverse
                add(LU[r, c + 1 :], -LU[r, c], behind)
    return True


@member_kernel
def _solved(found: Factored, x: Floats) -> None:
    """The solution of the scaled system for a right side x (size,), in its place."""
    LU, size = found.LU, len(x)
    for c in range(size):
        p = found.swap[c]
        if p != c:
            kept = x[c]
            x[c] = x[p]
            x[p] = kept
    for r in range(1, size):
        x[r] -= dot(LU[r, :r], x)
    for r in range(size - 1, -1, -1):
        x[r] = (x[r] - dot(LU[r, r + 1 :], x[r + 1 :])) / LU[r, r]


@member_kernel
def _refined(found: Factored, right: Floats, x: Floats) -> None:
    """The solution x (size,) for a right side (size,), which is scaled on the way, with iterative refinement."""
    size = len(x)
    rest = np.empty(size)
    for a in range(size):
        right[a] *= found.scale[a]
        x[a] = right[a]
    _solved(found, x)
    for _ in range(REFINEMENTS):
        for a in range(size):
            rest[a] = right[a] - dot(found.M[a], x)
        _solved(found, rest)
        for a in range(size):
            x[a] += rest[a]
    for a in range(size):
        x[a] *= found.scale[a]
