"""Springs in space that share a law: what `spatial_members.member_sums` does member by member, in vectors.

The geometry is that of `spatial_members`, with f = s (k x + c x' + preload), x = Delta, s = alpha^mu of each member.
With n = r/L, w = f/L, b = (n, a x n) and h = r - a = d - p, the matrix [I, -[a]] that makes dr of dxi gives

    Q = -(sum w r, sum a x w r),
    f B2 = w [I, -[a]]^T [I, -[a]] - w b b^T + (w (a r^T - (a . r) I) on the turns)
         = (w I, -w [a]; w [a], w (a h^T - (a . h) I)) - w b b^T,
    K = sum g b b^T + (W I, -[A]; [A], M - tr(M) I),   g = s k - w,   W = sum w,   A = sum w a,   M = sum w a h^T.

M is not symmetric: what differs is the moment, so K is symmetric only where that is zero. Damping adds
sum s c b (B2^T xi')^T to K and C = sum s c b b^T.

Arguments: member (8 M,), the rows of `GeneralModel.member` behind each other, width M of each; scale, s from member 0
on; start, stop: the members meant in whole vectors, padding included, where s = 0; p: k, c, preload; r (POSE,): the
relative pose. A member of zero length has no direction and adds nothing.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import inverse_root, lanes, larger, largest, load, store, total, where_larger, zero
from mdstopo.mechanics.kinematics.spatial_forces import C, K
from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D_SINCE, FREEDOMS, S_SINCE, D, S, W
from mdstopo.mechanics.kinematics.vectors import cross, dot, minus, plus, times, turned, vector_at
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED

#: rows of `GeneralModel.member`: the ends P and Q in body frames, l0, and L^2 - l0^2 at home
P, Q, L0, EXCESS = 0, 3, 6, 7
#: columns of sums over members: the energy, and its slopes
ENERGY, PULL = FREEDOMS, FREEDOMS + 1


@part
def _rows(member, width, first, i):
    """Three rows of members, from member i on."""
    return load(member, first * width + i), load(member, (first + 1) * width + i), load(member, (first + 2) * width + i)


@part
def _vectors(p, q, r):
    """The arms a, the vectors r = d + a - p (m) and their squares (m^2) of members with the ends p and q."""
    arm = turned(r, S, q)
    x = minus(arm, minus(p, vector_at(r, D)))
    return arm, x, dot(x, x)


@part
def _elongation(x, square, y, u, free, excess):
    """Delta = L - l0 of members (m), as `mechanics.laws.spring.elongation`.

    x, square, y: r, its square and 1/L (m, m^2, 1/m). u: what r has changed by since home (m).
    free, excess: l0 (m) and L0^2 - l0^2 (m^2).
    """
    stretch = square * y - free
    squares = excess + dot(u, minus(plus(x, x), u))
    off = 0.5 * y * (stretch * (square * y + free) - squares)
    return stretch - where_larger(square - dot(u, u), 0.0, off)


@part
def _seen(p, q, free, excess, r):
    """a, r, L^2, 1/L and Delta of members with the ends p and q, l0 `free` and L0^2 - l0^2 `excess`."""
    arm, x, square = _vectors(p, q, r)
    y = inverse_root(square, ZERO_LENGTH_SQUARED)
    u = plus(vector_at(r, D_SINCE), turned(r, S_SINCE, q))
    return arm, x, square, y, _elongation(x, square, y, u, free, excess)


@part
def _seen_at(member, width, i, r):
    """a, r, L^2, 1/L and Delta of the members from i on."""
    p = _rows(member, width, P, i)
    q = _rows(member, width, Q, i)
    return _seen(p, q, load(member, L0 * width + i), load(member, EXCESS * width + i), r)


@part
def _rate(x, y, arm, r):
    """n, and dDelta/dt = n . (d' + w x a)."""
    n = times(y, x)
    return n, dot(n, plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm)))


@part
def _none():
    """A vector of three zeros in each lane."""
    return zero(), zero(), zero()


@part
def add_totals(o, i, a, sign):
    """o[i : i + 3] += sign times the sums over the lanes of a."""
    o[i] += sign * total(a[0])
    o[i + 1] += sign * total(a[1])
    o[i + 2] += sign * total(a[2])


@kernel
def alike_sums(member, width, scale, start, stop, p, r, counted, o):
    """Add force and energy of springs with the same parameters to the sums of their pair.

    In:
      member, width, scale, start, stop, p, r: as above.
      counted: whether E and E_xi are wanted.
    Out:
      o (SUMS,): Q added to and, where they are counted, E and E_xi.
    """
    push = _none()
    moment = _none()
    pull = _none()
    pull_moment = _none()
    energy = zero()
    for i in range(start, stop, lanes()):
        arm, x, square, y, stretch = _seen_at(member, width, i, r)
        n, rate = _rate(x, y, arm, r)
        s = load(scale, i)
        elastic = p[0] * s * stretch
        force = times(elastic + s * (p[2] + p[1] * rate), n)
        push = plus(push, force)
        moment = plus(moment, cross(arm, force))
        if counted:
            energy = energy + where_larger(square, ZERO_LENGTH_SQUARED, elastic * stretch)
            force = times(elastic, n)
            pull = plus(pull, force)
            pull_moment = plus(pull_moment, cross(arm, force))
    add_totals(o, 0, push, -1.0)
    add_totals(o, 3, moment, -1.0)
    if counted:
        o[ENERGY] += 0.5 * total(energy)
        add_totals(o, PULL, pull, 1.0)
        add_totals(o, PULL + 3, pull_moment, 1.0)


@kernel
def alike_tangent(member, width, scale, start, stop, p, r, o):
    """Add the tangent K of springs with the same parameters, but for what damping does by B2.

    In:
      member, width, scale, start, stop, p, r: as above.
    Out:
      o (SUMS,): K added to.
    """
    sum_w = zero()
    sum_wa = _none()
    m0 = _none()
    m1 = _none()
    m2 = _none()
    # of sum g b b^T: the diagonal of the shifts, and yz, zx, xy; rows of shifts by turns; the turns as the shifts
    shifts = _none()
    across = _none()
    by0 = _none()
    by1 = _none()
    by2 = _none()
    turns = _none()
    around = _none()
    for i in range(start, stop, lanes()):
        arm, x, _, y, stretch = _seen_at(member, width, i, r)
        n, rate = _rate(x, y, arm, r)
        s = load(scale, i)
        w = s * (p[0] * stretch + (p[2] + p[1] * rate)) * y
        g = p[0] * s - w
        lever = cross(arm, n)
        gn = times(g, n)
        gl = times(g, lever)
        shifts = shifts[0] + gn[0] * n[0], shifts[1] + gn[1] * n[1], shifts[2] + gn[2] * n[2]
        across = across[0] + gn[1] * n[2], across[1] + gn[2] * n[0], across[2] + gn[0] * n[1]
        by0 = plus(by0, times(gn[0], lever))
        by1 = plus(by1, times(gn[1], lever))
        by2 = plus(by2, times(gn[2], lever))
        turns = turns[0] + gl[0] * lever[0], turns[1] + gl[1] * lever[1], turns[2] + gl[2] * lever[2]
        around = around[0] + gl[1] * lever[2], around[1] + gl[2] * lever[0], around[2] + gl[0] * lever[1]
        wa = times(w, arm)
        h = minus(x, arm)
        sum_w = sum_w + w
        sum_wa = plus(sum_wa, wa)
        m0 = plus(m0, times(wa[0], h))
        m1 = plus(m1, times(wa[1], h))
        m2 = plus(m2, times(wa[2], h))
    add_symmetric(o, 0, shifts, across)
    add_symmetric(o, 3, turns, around)
    add_coupling(o, 0, by0)
    add_coupling(o, 1, by1)
    add_coupling(o, 2, by2)
    _add_geometric(o, total(sum_w), (total(sum_wa[0]), total(sum_wa[1]), total(sum_wa[2])))
    add_totals(o, K + FREEDOMS * 3 + 3, m0, 1.0)
    add_totals(o, K + FREEDOMS * 4 + 3, m1, 1.0)
    add_totals(o, K + FREEDOMS * 5 + 3, m2, 1.0)
    trace = total(m0[0] + m1[1] + m2[2])
    for j in range(3, FREEDOMS):
        o[K + FREEDOMS * j + j] -= trace


@part
def add_symmetric(o, first, diagonal, others):
    """Add a symmetric block to K that begins at column `first`: its diagonal, and yz, zx, xy."""
    at = K + FREEDOMS * first + first
    yz = total(others[0])
    zx = total(others[1])
    xy = total(others[2])
    o[at] += total(diagonal[0])
    o[at + FREEDOMS + 1] += total(diagonal[1])
    o[at + 2 * FREEDOMS + 2] += total(diagonal[2])
    o[at + 1] += xy
    o[at + FREEDOMS] += xy
    o[at + 2] += zx
    o[at + 2 * FREEDOMS] += zx
    o[at + FREEDOMS + 2] += yz
    o[at + 2 * FREEDOMS + 1] += yz


@part
def add_coupling(o, i, row):
    """Add row i of a block of shifts by turns to K, and its mirror image."""
    for_turn = total(row[0]), total(row[1]), total(row[2])
    for j in range(3):
        o[K + FREEDOMS * i + 3 + j] += for_turn[j]
        o[K + FREEDOMS * (3 + j) + i] += for_turn[j]


@part
def _add_geometric(o, w, a):
    """Add (W I, -[A]; [A], 0) to K."""
    for j in range(3):
        o[K + FREEDOMS * j + j] += w
        column = cross(a, (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0))
        for i in range(3):
            o[K + FREEDOMS * (3 + i) + j] += column[i]
            o[K + FREEDOMS * j + 3 + i] += column[i]


@kernel
def alike_damping(member, width, scale, start, stop, p, r, o):
    """Add what damping does to the tangents: sum s c b (B2^T xi')^T to K, C = sum s c b b^T.

    One row of b after the other: all rows at once would be more sums than a processor has places for.

    In:
      member, width, scale, start, stop, p, r: as above.
    Out:
      o (SUMS,): K and C added to.
    """
    for j in range(FREEDOMS):
        shift = _none()
        turn = _none()
        shift_c = _none()
        turn_c = _none()
        for i in range(start, stop, lanes()):
            arm, x, _, y, _ = _seen_at(member, width, i, r)
            n, rate = _rate(x, y, arm, r)
            lever = cross(arm, n)
            w = vector_at(r, W)
            speed = plus(vector_at(r, D_RATE), cross(w, arm))
            turning = times(y, minus(speed, times(rate, n)))
            by_turn = cross(arm, plus(turning, cross(n, w)))
            b = n if j < 3 else lever
            along = p[1] * load(scale, i) * (b[0] if j % 3 == 0 else b[1] if j % 3 == 1 else b[2])
            shift = plus(shift, times(along, turning))
            turn = plus(turn, times(along, by_turn))
            shift_c = plus(shift_c, times(along, n))
            turn_c = plus(turn_c, times(along, lever))
        add_totals(o, K + FREEDOMS * j, shift, 1.0)
        add_totals(o, K + FREEDOMS * j + 3, turn, 1.0)
        column = total(shift_c[0]), total(shift_c[1]), total(shift_c[2])
        other = total(turn_c[0]), total(turn_c[1]), total(turn_c[2])
        for i in range(j + 1):
            o[C + j * (j + 1) // 2 + i] += column[i] if i < 3 else other[i - 3]


@kernel
def alike_works(member, width, start, stop, r, u, out):
    """Write down what members do at a relative pose.

    In:
      member, width, start, stop, r: as above.
      u (FREEDOMS,): change of the pose.
    Out:
      out (4, stop - start or more): Delta, its rate, b . u, 1 / L.
    """
    for i in range(start, stop, lanes()):
        arm, x, _, y, stretch = _seen_at(member, width, i, r)
        n, rate = _rate(x, y, arm, r)
        store(out[0], i - start, stretch)
        store(out[1], i - start, rate)
        store(out[2], i - start, dot(n, plus(vector_at(u, 0), cross(vector_at(u, 3), arm))))
        store(out[3], i - start, y)


@kernel
def elastic_designs(member, width, start, stop, k, rel, u, pair, out):
    """Add sum_j f (b . u_j) over S poses of each spring, without damping and preload, at alpha^mu = 1.

    A vector of members stays at hand over all poses.

    In:
      member, width, start, stop: as above; padding becomes something that nobody reads.
      k: stiffness (N/m).
      rel (S, n_pair, POSE): relative poses.
      u (S, n_pair, D): virtual changes of these.
      pair: number of the pair.
    Out:
      out (M or more,): added to.
    """
    for i in range(start, stop, lanes()):
        p = _rows(member, width, P, i)
        q = _rows(member, width, Q, i)
        free = load(member, L0 * width + i)
        excess = load(member, EXCESS * width + i)
        work = zero()
        for j in range(rel.shape[0]):
            arm, x, _, y, stretch = _seen(p, q, free, excess, rel[j, pair])
            moved = plus(vector_at(u[j, pair], 0), cross(vector_at(u[j, pair], 3), arm))
            work = work + stretch * y * dot(x, moved)
        store(out, i, load(out, i) + k * work)


@kernel
def elastic_energies(member, width, start, stop, k, rel, pair, out):
    """Add the sum of k Delta^2 / 2 over S poses of each spring, at alpha^mu = 1.

    In:
      member, width, start, stop: as above; padding becomes something that nobody reads.
      k: stiffness (N/m), times a weight.
      rel (S, n_pair, POSE): relative poses.
      pair: number of the pair.
    Out:
      out (M or more,): added to.
    """
    for i in range(start, stop, lanes()):
        p = _rows(member, width, P, i)
        q = _rows(member, width, Q, i)
        free = load(member, L0 * width + i)
        excess = load(member, EXCESS * width + i)
        energy = zero()
        for j in range(rel.shape[0]):
            _, _, square, _, stretch = _seen(p, q, free, excess, rel[j, pair])
            energy = energy + where_larger(square, ZERO_LENGTH_SQUARED, stretch * stretch)
        store(out, i, load(out, i) + 0.5 * k * energy)


@kernel
def far(member, width, start, stop, before, after):
    """Whether no member's ends can meet on a straight way between two relative poses: all are longer than they move.

    member, width, start, stop: as above; padding, whose ends are the origins of both bodies, counts as a member.
    before, after (POSE,): the relative poses.
    """
    near = zero() - np.inf
    for i in range(start, stop, lanes()):
        p = _rows(member, width, P, i)
        q = _rows(member, width, Q, i)
        _, x, square = _vectors(p, q, before)
        moved = minus(_vectors(p, q, after)[1], x)
        near = larger(1.001 * dot(moved, moved) - square, near)
    return largest(near) < -ZERO_LENGTH_SQUARED
