"""The spring law over members that share its parameters: what `general.dynamics.members` does one by one, in vectors.

The geometry and the sums are those of `mechanics.laws.spring`, with f = k x + c x' + preload, x = Delta, times
s = alpha^mu of each member. Arguments: member (6 M,), the rows of `spring` of all members behind each other,
width M of each; scale, s from member 0 on; start, stop: the members meant, padding included, where s = 0; p: k, c,
preload; r (POSE,): the relative pose. A member of zero length has no direction: no force, but the energy that its
elongation has.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.vector import lanes, larger, largest, load, store, total, zero
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED, elastic_parts, elastic_work, seen_members
from mdstopo.mechanics.laws.sums import add_tangent, upper_triangle


@kernel
def _seen(member, width, i, r):
    """Geometry of the members from i on: Q in the frame of P (two numbers), 1/L, its row of B (three), Delta."""
    ax, ay, rx, ry, _, y, stretch = seen_members(member, width, i, r, np.bool_(True))
    bx = y * rx
    by = y * ry
    return ax, ay, y, bx, by, ax * by - ay * bx, stretch


@kernel
def alike_sums(member, width, scale, start, stop, p, r, counted, o):
    """Add force and energy of members with the same parameters to the sums of their pair.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      scale (stop or more,): alpha^mu of each member.
      start, stop: the members, with padding in between that has a scale of zero.
      p (3 or more,): k, c, preload (N/m, N s/m, N).
      r (POSE,): relative pose.
      counted: whether E and E_xi are wanted.
    Out:
      o (SUMS,): Q added to and, where they are counted, E and E_xi.
    """
    sum_x = zero()
    sum_y = zero()
    sum_t = zero()
    energy = zero()
    ex = zero()
    ey = zero()
    et = zero()
    for i in range(start, stop, lanes()):
        _, _, _, bx, by, bt, x = _seen(member, width, i, r)
        s = load(scale, i)
        pull = p[0] * s * x
        f = pull + s * (p[2] + p[1] * (bx * r[4] + by * r[5] + bt * r[6]))
        sum_x += f * bx
        sum_y += f * by
        sum_t += f * bt
        energy += pull * x
        ex += pull * bx
        ey += pull * by
        et += pull * bt
    o[0] -= total(sum_x)
    o[1] -= total(sum_y)
    o[2] -= total(sum_t)
    if counted:
        o[3] += 0.5 * total(energy)
        o[4] += total(ex)
        o[5] += total(ey)
        o[6] += total(et)


@kernel
def alike_tangent(member, width, scale, start, stop, p, r, o):
    """Add the tangent of members with the same parameters, without damping: sum s (k b b^T + f B2), which is symmetric.

    With w = f/L, f B2 = w (g^T g - b b^T) - f (e . R q) on theta, g = [I, J R q].

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      scale (stop or more,): alpha^mu of each member.
      start, stop: the members, with padding in between that has a scale of zero.
      p (3 or more,): k, c, preload (N/m, N s/m, N).
      r (POSE,): relative pose.
    Out:
      o (SUMS,): K added to.
    """
    kxx = zero()
    kxy = zero()
    kyy = zero()
    kxt = zero()
    kyt = zero()
    ktt = zero()
    sum_w = zero()
    sum_wx = zero()
    sum_wy = zero()
    for i in range(start, stop, lanes()):
        ax, ay, y, bx, by, bt, x = _seen(member, width, i, r)
        s = load(scale, i)
        f = s * (p[0] * x + (p[2] + p[1] * (bx * r[4] + by * r[5] + bt * r[6])))
        w = f * y
        g = p[0] * s - w
        kxx += g * bx * bx
        kxy += g * bx * by
        kyy += g * by * by
        kxt += g * bx * bt
        kyt += g * by * bt
        ktt += g * bt * bt + w * (ax * ax + ay * ay) - f * (bx * ax + by * ay)
        sum_w += w
        sum_wx += w * ax
        sum_wy += w * ay
    add_tangent(upper_triangle(kxx, kxy, kyy, kxt, kyt, ktt, sum_w, sum_wx, sum_wy), o)


@kernel
def alike_damping(member, width, scale, start, stop, p, r, o):
    """Add what damping does to the tangents: sum s c b (B2 xi')^T to K, C = sum s c b b^T.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      scale (stop or more,): alpha^mu of each member.
      start, stop: the members, with padding in between that has a scale of zero.
      p (3 or more,): k, c, preload (N/m, N s/m, N).
      r (POSE,): relative pose.
    Out:
      o (SUMS,): K and C added to.
    """
    kxx = zero()
    kxy = zero()
    kxt = zero()
    kyx = zero()
    kyy = zero()
    kyt = zero()
    ktx = zero()
    kty = zero()
    ktt = zero()
    cxx = zero()
    cxy = zero()
    cyy = zero()
    cxt = zero()
    cyt = zero()
    ctt = zero()
    vx = r[4]
    vy = r[5]
    vt = r[6]
    for i in range(start, stop, lanes()):
        ax, ay, y, bx, by, bt, _ = _seen(member, width, i, r)
        c = p[1] * load(scale, i)
        rate = bx * vx + by * vy + bt * vt
        # B2 xi': the velocity of the end, less its part along the member, over the length
        ux = vx - ay * vt
        uy = vy + ax * vt
        hx = y * (ux - bx * rate)
        hy = y * (uy - by * rate)
        ht = y * (ax * uy - ay * ux - bt * rate) - (bx * ax + by * ay) * vt
        cx = c * bx
        cy = c * by
        ct = c * bt
        kxx += cx * hx
        kxy += cx * hy
        kxt += cx * ht
        kyx += cy * hx
        kyy += cy * hy
        kyt += cy * ht
        ktx += ct * hx
        kty += ct * hy
        ktt += ct * ht
        cxx += cx * bx
        cxy += cx * by
        cyy += cy * by
        cxt += cx * bt
        cyt += cy * bt
        ctt += ct * bt
    o[7] += total(kxx)
    o[8] += total(kxy)
    o[9] += total(kxt)
    o[10] += total(kyx)
    o[11] += total(kyy)
    o[12] += total(kyt)
    o[13] += total(ktx)
    o[14] += total(kty)
    o[15] += total(ktt)
    o[16] += total(cxx)
    o[17] += total(cxy)
    o[18] += total(cyy)
    o[19] += total(cxt)
    o[20] += total(cyt)
    o[21] += total(ctt)


@kernel
def alike_design(member, width, start, stop, p, r, u, weight, out):
    """Add f (b . u) + weight V of each member, at alpha^mu = 1.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      start, stop: the members; padding in between becomes something that nobody reads.
      p (3 or more,): k, c, preload (N/m, N s/m, N).
      r (POSE,): relative pose.
      u (3,): virtual change of the relative pose.
      weight: of the stored energy V.
    Out:
      out (M or more,): added to.
    """
    half = 0.5 * weight * p[0]
    for i in range(start, stop, lanes()):
        _, _, _, bx, by, bt, x = _seen(member, width, i, r)
        f = p[0] * x + (p[2] + p[1] * (bx * r[4] + by * r[5] + bt * r[6]))
        store(out, i, load(out, i) + f * (bx * u[0] + by * u[1] + bt * u[2]) + half * (x * x))


@kernel
def alike_works(member, width, start, stop, r, u, out):
    """Write down what members do at a relative pose.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      start, stop: the members; padding in between becomes something that nobody reads.
      r (POSE,): relative pose.
      u (3,): change of it.
    Out:
      out (4, stop - start or more): Delta, its rate, b . u, 1 / L.
    """
    for i in range(start, stop, lanes()):
        _, _, y, bx, by, bt, x = _seen(member, width, i, r)
        store(out[0], i - start, x)
        store(out[1], i - start, bx * r[4] + by * r[5] + bt * r[6])
        store(out[2], i - start, bx * u[0] + by * u[1] + bt * u[2])
        store(out[3], i - start, y)


@kernel
def elastic_designs(member, width, start, stop, k, rel, u, p, out):
    """Add sum_j f (b . u_j) over S poses of each member, without damping and preload, at alpha^mu = 1.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      start, stop: the members; padding in between becomes something that nobody reads.
      k: stiffness (N/m).
      rel (S, n_pair, POSE): relative poses.
      u (S, n_pair, 3): virtual changes of these.
      p: number of the pair.
    Out:
      out (M or more,): added to.
    """
    for i in range(start, stop, lanes()):
        x = load(member, i)
        y = load(member, width + i)
        v = load(member, 2 * width + i)
        w = load(member, 3 * width + i)
        free = load(member, 4 * width + i)
        more = load(member, 5 * width + i)
        work = zero()
        for j in range(rel.shape[0]):
            work += elastic_work(x, y, v, w, free, more, rel[j, p], u[j, p])
        store(out, i, load(out, i) + k * work)


@kernel
def alike_designs(member, width, start, stop, p, rel, u, pair, room, out):
    """Add sum_j f (b . u_j) over S poses of each member, at alpha^mu = 1, for R rows.

    One pass over the members serves all rows.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      start, stop: the members; padding in between becomes something that nobody reads.
      p (3 or more,): k, c, preload (N/m, N s/m, N).
      rel (S, n_pair, POSE): relative poses.
      u (R, S, n_pair, 3): virtual changes of these, for each row.
      pair: number of the pair.
    Out:
      out (R, M or more): added to, each row as it would be by itself.
    Room:
      room (4 S lanes,): f and b of the members at hand, at all poses.
    """
    poses = rel.shape[0]
    flat = out.reshape(out.size)
    vector = lanes()
    for i in range(start, stop, vector):
        for j in range(poses):
            r = rel[j, pair]
            _, _, _, bx, by, bt, x = _seen(member, width, i, r)
            at = 4 * vector * j
            store(room, at, p[0] * x + (p[2] + p[1] * (bx * r[4] + by * r[5] + bt * r[6])))
            store(room, at + vector, bx)
            store(room, at + 2 * vector, by)
            store(room, at + 3 * vector, bt)
        for m in range(u.shape[0]):
            work = load(flat, m * out.shape[1] + i)
            for j in range(poses):
                at = 4 * vector * j
                along = load(room, at + vector) * u[m, j, pair, 0] + load(room, at + 2 * vector) * u[m, j, pair, 1]
                work += load(room, at) * (along + load(room, at + 3 * vector) * u[m, j, pair, 2])
            store(flat, m * out.shape[1] + i, work)


@kernel
def elastic_designs_of_rows(member, width, start, stop, k, rel, u, pair, room, out):
    """Do `elastic_designs` for R rows: one pass over the members serves all.

    In:
      member (6 M,): rows of `spring` of all members behind each other.
      width: of a row, M.
      start, stop: the members; padding in between becomes something that nobody reads.
      k: stiffness (N/m).
      rel (S, n_pair, POSE): relative poses.
      u (R, S, n_pair, 3): virtual changes of these, for each row.
      pair: number of the pair.
    Out:
      out (R, M or more): added to, each row as it would be by itself.
    Room:
      room (4 S lanes,): Delta/L and L b of the members at hand, at all poses.
    """
    poses = rel.shape[0]
    flat = out.reshape(out.size)
    vector = lanes()
    for i in range(start, stop, vector):
        x = load(member, i)
        y = load(member, width + i)
        v = load(member, 2 * width + i)
        w = load(member, 3 * width + i)
        free = load(member, 4 * width + i)
        more = load(member, 5 * width + i)
        for j in range(poses):
            force, rx, ry, moment = elastic_parts(x, y, v, w, free, more, rel[j, pair])
            at = 4 * vector * j
            store(room, at, force)
            store(room, at + vector, rx)
            store(room, at + 2 * vector, ry)
            store(room, at + 3 * vector, moment)
        for m in range(u.shape[0]):
            work = zero()
            for j in range(poses):
                at = 4 * vector * j
                along = load(room, at + vector) * u[m, j, pair, 0] + load(room, at + 2 * vector) * u[m, j, pair, 1]
                work += load(room, at) * (along + load(room, at + 3 * vector) * u[m, j, pair, 2])
            store(flat, m * out.shape[1] + i, load(flat, m * out.shape[1] + i) + k * work)


@kernel
def far(member, width, start, stop, before, after):
    """Whether no member's ends can meet on a straight way between two relative poses: all are longer than they move.

    member (6 M,): rows of `spring` of all members behind each other.
    width: of a row, M.
    start, stop: the members.
    before, after (POSE,): the relative poses.
    """
    near = zero() - np.inf
    for i in range(start, stop, lanes()):
        px = load(member, i)
        py = load(member, width + i)
        u = load(member, 2 * width + i)
        v = load(member, 3 * width + i)
        rx = before[2] * u - before[3] * v - (px - before[0])
        ry = before[3] * u + before[2] * v - (py - before[1])
        ux = after[2] * u - after[3] * v - (px - after[0]) - rx
        uy = after[3] * u + after[2] * v - (py - after[1]) - ry
        near = larger(1.001 * (ux * ux + uy * uy) - (rx * rx + ry * ry), near)
    return largest(near) < -ZERO_LENGTH_SQUARED
