"""Force sum, tangents and the design gradient of all blocks, at several poses in one pass over the members.

One pass returns a few numbers a pair of bodies and pose (`SUMS`); everything else here works on those. The order of
sums is fixed: members within a tile, tiles in order.
"""

import math

import numpy as np

from mdstopo.jit import inline, kernel
from mdstopo.mechanics.geometry import (
    POSE,
    add_pair_force,
    pair_displacement,
    relative_pose,
)
from mdstopo.mechanics.laws.spring import (
    elastic_design,
    elastic_force,
    elastic_tangent,
    stored_energy,
    viscous_design,
    viscous_force,
    viscous_tangent,
)
from mdstopo.scene.model import TILE

#: sums a pair and pose: Q (3), E, E_xi (3), K (9, by rows), C (6, upper triangle)
SUMS = 22


@kernel
def scale_members(block, power, member, alpha, strength):  # type: ignore[no-untyped-def]
    """strength (3, M_padded) = alpha^mu times stiffness, damping and preload (Eq. 12)."""
    for k in range(block.shape[0]):
        start = block[k, 1]
        stop = block[k, 2]
        first = block[k, 4]
        viscous = block[k, 3] == 1
        if first < 0:
            for i in range(start, stop):
                strength[0, i] = member[5, i]
                strength[1, i] = member[6, i]
                strength[2, i] = member[7, i]
            continue
        mu = power[k]
        count = block[k, 5]
        for i in range(count):
            a = alpha[first + i]
            s = a if mu == 1.0 else a**mu
            strength[0, start + i] = s * member[5, start + i]
            if viscous:
                strength[1, start + i] = s * member[6, start + i]
                strength[2, start + i] = s * member[7, start + i]
        for i in range(start + count, stop):
            strength[0, i] = 0.0
            strength[1, i] = 0.0
            strength[2, i] = 0.0


@kernel
def member_sums(block, member, strength, rel, m, tangent, sums):  # type: ignore[no-untyped-def]
    """One pass over all members at m relative poses.

    In: strength (3, M_padded), rel (m, n_pair, POSE), tangent (are K and C wanted). Out: sums (m, n_pair, SUMS).
    """
    sums[:m] = 0.0
    for k in range(block.shape[0]):
        p = block[k, 0]
        viscous = block[k, 3] == 1
        counted = block[k, 4] >= 0  # energy is that of design members
        for lo in range(block[k, 1], block[k, 2], TILE):
            hi = min(lo + TILE, block[k, 2])
            px = member[0, lo:hi]
            py = member[1, lo:hi]
            qx = member[2, lo:hi]
            qy = member[3, lo:hi]
            l0 = member[4, lo:hi]
            ks = strength[0, lo:hi]
            for j in range(m):
                r = rel[j, p]
                o = sums[j, p]
                if not viscous:
                    if tangent:
                        x, y, t, e, kxx, kxy, kyy, kxt, kyt, ktt = elastic_tangent(
                            px, py, qx, qy, l0, ks, r[0], r[1], r[2], r[3]
                        )
                        o[7] += kxx
                        o[8] += kxy
                        o[9] += kxt
                        o[10] += kxy
                        o[11] += kyy
                        o[12] += kyt
                        o[13] += kxt
                        o[14] += kyt
                        o[15] += ktt
                    else:
                        x, y, t, e = elastic_force(px, py, qx, qy, l0, ks, r[0], r[1], r[2], r[3])
                    o[0] += x
                    o[1] += y
                    o[2] += t
                    if counted:
                        o[3] += e
                        o[4] -= x
                        o[5] -= y
                        o[6] -= t
                    continue
                cs = strength[1, lo:hi]
                ps = strength[2, lo:hi]
                if tangent:
                    (x, y, t, e, ex, ey, et, k0, k1, k2, k3, k4, k5, k6, k7, k8, c0, c1, c2, c3, c4, c5) = (
                        viscous_tangent(px, py, qx, qy, l0, ks, cs, ps, r[0], r[1], r[2], r[3], r[4], r[5], r[6])
                    )
                    o[7] += k0
                    o[8] += k1
                    o[9] += k2
                    o[10] += k3
                    o[11] += k4
                    o[12] += k5
                    o[13] += k6
                    o[14] += k7
                    o[15] += k8
                    o[16] += c0
                    o[17] += c1
                    o[18] += c2
                    o[19] += c3
                    o[20] += c4
                    o[21] += c5
                else:
                    x, y, t, e, ex, ey, et = viscous_force(
                        px, py, qx, qy, l0, ks, cs, ps, r[0], r[1], r[2], r[3], r[4], r[5], r[6]
                    )
                o[0] += x
                o[1] += y
                o[2] += t
                if counted:
                    o[3] += e
                    o[4] += ex
                    o[5] += ey
                    o[6] += et


@kernel
def add_loads(model, segment, t, q, f):  # type: ignore[no-untyped-def]
    """f (n or more,) += the applied loads of a segment at time t in state q."""
    tau = t - model.times[segment]
    force = model.force
    for i in range(force.shape[1]):
        f[i] += force[segment, i, 0] + tau * force[segment, i, 1]
    if model.load_body.shape[0] == 0:
        return
    for k in range(model.load_body.shape[0]):
        b = 3 * model.load_body[k]
        c = math.cos(q[b + 2])
        s = math.sin(q[b + 2])
        x = model.load_force[segment, k, 0, 0] + tau * model.load_force[segment, k, 0, 1]
        y = model.load_force[segment, k, 1, 0] + tau * model.load_force[segment, k, 1, 1]
        if model.load_follows[k]:
            x, y = c * x - s * y, s * x + c * y
        rx = c * model.load_arm[k, 0] - s * model.load_arm[k, 1]
        ry = s * model.load_arm[k, 0] + c * model.load_arm[k, 1]
        f[b] += x
        f[b + 1] += y
        f[b + 2] += rx * y - ry * x


@kernel
def load_tangent(model, segment, t, q, turn):  # type: ignore[no-untyped-def]
    """turn (n,) = derivative of each body's applied load with respect to its own angle."""
    turn[:] = 0.0
    tau = t - model.times[segment]
    for k in range(model.load_body.shape[0]):
        b = 3 * model.load_body[k]
        c = math.cos(q[b + 2])
        s = math.sin(q[b + 2])
        x = model.load_force[segment, k, 0, 0] + tau * model.load_force[segment, k, 0, 1]
        y = model.load_force[segment, k, 1, 0] + tau * model.load_force[segment, k, 1, 1]
        if model.load_follows[k]:  # force and arm turn together: the moment stays
            turn[b] -= s * x + c * y
            turn[b + 1] += c * x - s * y
        else:
            rx = c * model.load_arm[k, 0] - s * model.load_arm[k, 1]
            ry = s * model.load_arm[k, 0] + c * model.load_arm[k, 1]
            turn[b + 2] -= rx * x + ry * y


@kernel
def pair_tangents(pair, rel, q, sums, damped, k_out, c_out):  # type: ignore[no-untyped-def]
    """Tangents in body coordinates of one pose: k_out (n_pair, 6, 6) = -dF/dq, c_out = -dF/dv (if damped).

    K = T^T (K_xi T + C_xi d(Tv)/dq) - d(T^T Q)/dq, C = T^T C_xi T, written in global axes: with D = x_B - x_A and
    w = -J D, R dxi_d = dD + w dpsi_A, and R d(xi'_d) = -omega_A J dD - J R xi'_d dpsi_A.
    """
    for p in range(rel.shape[0]):
        o = sums[p]
        ca = rel[p, 7]
        sa = rel[p, 8]
        wx = q[3 * pair[p, 1] + 1] - q[3 * pair[p, 0] + 1]
        wy = q[3 * pair[p, 0]] - q[3 * pair[p, 1]]
        # K_xi turned into global axes: rows and columns x, y, theta
        rx = ca * o[7] - sa * o[10]
        ry = ca * o[8] - sa * o[11]
        sx = sa * o[7] + ca * o[10]
        sy = sa * o[8] + ca * o[11]
        kxx = ca * rx - sa * ry
        kxy = sa * rx + ca * ry
        kyx = ca * sx - sa * sy
        kyy = sa * sx + ca * sy
        kxt = ca * o[9] - sa * o[12]
        kyt = sa * o[9] + ca * o[12]
        ktx = ca * o[13] - sa * o[14]
        kty = sa * o[13] + ca * o[14]
        ktt = o[15]
        # columns of psi_A: rows x, y, theta
        ax = kxx * wx + kxy * wy - kxt
        ay = kyx * wx + kyy * wy - kyt
        at = ktx * wx + kty * wy - ktt
        if damped:
            omega = rel[p, 9]
            rx = ca * o[16] - sa * o[17]
            ry = ca * o[17] - sa * o[18]
            sx = sa * o[16] + ca * o[17]
            sy = sa * o[17] + ca * o[18]
            cxx = ca * rx - sa * ry
            cxy = sa * rx + ca * ry
            cyy = sa * sx + ca * sy
            cxt = ca * o[19] - sa * o[20]
            cyt = sa * o[19] + ca * o[20]
            ctt = o[21]
            # -J R xi'_d
            gx = sa * rel[p, 4] + ca * rel[p, 5]
            gy = sa * rel[p, 5] - ca * rel[p, 4]
            ax += cxx * gx + cxy * gy
            ay += cxy * gx + cyy * gy
            at += cxt * gx + cyt * gy
            kxx -= omega * cxy
            kxy += omega * cxx
            kyx -= omega * cyy
            kyy += omega * cxy
            ktx -= omega * cyt
            kty += omega * cxt
            _spread(
                cxx, cxy, cxy, cyy, cxx * wx + cxy * wy - cxt, cxy * wx + cyy * wy - cyt, cxt, cyt,
                cxt, cyt, cxt * wx + cyt * wy - ctt, ctt, wx, wy, c_out[p],
            )  # fmt: skip
        m = k_out[p]
        _spread(kxx, kxy, kyx, kyy, ax, ay, kxt, kyt, ktx, kty, at, ktt, wx, wy, m)
        # the change of the force's direction and arm at fixed Q: - d(T^T Q)/dq
        fx = ca * o[0] - sa * o[1]
        fy = sa * o[0] + ca * o[1]
        m[0, 2] -= fy
        m[1, 2] += fx
        m[3, 2] += fy
        m[4, 2] -= fx
        m[2, 0] -= fy
        m[2, 1] += fx
        m[2, 3] += fy
        m[2, 4] -= fx
        m[2, 2] += o[0] * rel[p, 0] + o[1] * rel[p, 1]


@inline
def _spread(xx, xy, yx, yy, ax, ay, bx, by, tx, ty, ta, tb, wx, wy, m):  # type: ignore[no-untyped-def]
    """m (6, 6) = T~^T N for rows x, y, theta of N with columns D (2), psi_A, psi_B; T~ = [-I w I 0; 0 -1 0 1]."""
    m[3, 0] = -xx
    m[3, 1] = -xy
    m[3, 2] = ax
    m[3, 3] = xx
    m[3, 4] = xy
    m[3, 5] = bx
    m[4, 0] = -yx
    m[4, 1] = -yy
    m[4, 2] = ay
    m[4, 3] = yx
    m[4, 4] = yy
    m[4, 5] = by
    m[5, 0] = -tx
    m[5, 1] = -ty
    m[5, 2] = ta
    m[5, 3] = tx
    m[5, 4] = ty
    m[5, 5] = tb
    for j in range(6):
        m[0, j] = -m[3, j]
        m[1, j] = -m[4, j]
        m[2, j] = wx * m[3, j] + wy * m[4, j] - m[5, j]


@kernel
def subtract_products(pair, k, x, out, count):  # type: ignore[no-untyped-def]
    """out[i] -= K[i] x[i] for i < count: k (count, n_pair, 6, 6), x and out (count, n)."""
    for i in range(count):
        for p in range(pair.shape[0]):
            a = 3 * pair[p, 0]
            b = 3 * pair[p, 1]
            x0 = x[i, a]
            x1 = x[i, a + 1]
            x2 = x[i, a + 2]
            x3 = x[i, b]
            x4 = x[i, b + 1]
            x5 = x[i, b + 2]
            for r in range(6):
                d = a + r if r < 3 else b + r - 3
                out[i, d] -= (
                    k[i, p, r, 0] * x0
                    + k[i, p, r, 1] * x1
                    + k[i, p, r, 2] * x2
                    + k[i, p, r, 3] * x3
                    + k[i, p, r, 4] * x4
                    + k[i, p, r, 5] * x5
                )


@kernel
def subtract_transposed(pair, k, x, out, count):  # type: ignore[no-untyped-def]
    """out[i] -= K[i]^T x[i] for i < count: k (count, n_pair, 6, 6), x and out (count, n)."""
    for i in range(count):
        for p in range(pair.shape[0]):
            a = 3 * pair[p, 0]
            b = 3 * pair[p, 1]
            x0 = x[i, a]
            x1 = x[i, a + 1]
            x2 = x[i, a + 2]
            x3 = x[i, b]
            x4 = x[i, b + 1]
            x5 = x[i, b + 2]
            for r in range(6):
                d = a + r if r < 3 else b + r - 3
                out[i, d] -= (
                    k[i, p, 0, r] * x0
                    + k[i, p, 1, r] * x1
                    + k[i, p, 2, r] * x2
                    + k[i, p, 3, r] * x3
                    + k[i, p, 4, r] * x4
                    + k[i, p, 5, r] * x5
                )


@kernel
def add_turning(turn, x, out, count):  # type: ignore[no-untyped-def]
    """out[i] += (load tangent) x[i] for i < count: each body's load changes with its own angle; turn (count, n)."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, d] += turn[i, d] * x[i, b + 2]


@kernel
def add_turning_transposed(turn, x, out, count):  # type: ignore[no-untyped-def]
    """out[i] += (load tangent)^T x[i] for i < count."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, b + 2] += turn[i, d] * x[i, d]


@kernel
def forces(model, strength, segment, m, t, q, v, tangent, damped, rel, sums, f, k_out, c_out, turn):  # type: ignore[no-untyped-def]
    """Generalised forces, and on demand tangents, at m states in one pass over the members.

    Constant: model, strength. In: segment, m, t (m,), q, v (m, n). Out: rel (m, n_pair, POSE), sums (m, n_pair, SUMS),
    f (m, n); with `tangent` also k_out (m, n_pair, 6, 6), c_out (the same, if damped), turn (m, n, if loads turn).
    """
    pair = model.pair
    for j in range(m):
        relative_pose(pair, q[j], v[j], rel[j])
    member_sums(model.block, model.member, strength, rel, m, tangent, sums)
    turning = model.load_body.shape[0] > 0
    for j in range(m):
        out = f[j]
        out[:] = 0.0
        add_loads(model, segment, t[j], q[j], out)
        for p in range(pair.shape[0]):
            add_pair_force(pair, rel[j], p, sums[j, p, 0], sums[j, p, 1], sums[j, p, 2], out)
        if tangent:
            pair_tangents(pair, rel[j], q[j], sums[j], damped, k_out[j], c_out[j if damped else 0])
            if turning:
                load_tangent(model, segment, t[j], q[j], turn[j])


@kernel
def design_gradient(pair, block, member, stage, z, used, out, work):  # type: ignore[no-untyped-def]
    """out (M_padded,) += sum over stages of z_s . (force of each member at unit strength): one pass, no histories.

    In: stage (S, 3, n) with q, v, and their virtual displacements z (S, n), the adjoint of the force balance, of the
    stages that are used (S,). The member's generalised force is -T^T b f, so each adds -f_i (b_i . T z_s). Fixed
    members are passed over. work: counts the stages.
    """
    n_pair = pair.shape[0]
    count = 0
    for i in range(used.shape[0]):
        count += used[i]
    work[7] += count
    rel = np.empty((count, n_pair, POSE))
    u = np.empty((count, n_pair, 3))
    j = 0
    for i in range(used.shape[0]):
        if used[i]:
            relative_pose(pair, stage[i, 0], stage[i, 1], rel[j])
            for p in range(n_pair):
                pair_displacement(pair, rel[j], p, z[i], u[j, p])
                for axis in range(3):
                    u[j, p, axis] = -u[j, p, axis]
            j += 1
    for k in range(block.shape[0]):
        if block[k, 4] < 0:
            continue
        p = block[k, 0]
        for lo in range(block[k, 1], block[k, 2], TILE):
            hi = min(lo + TILE, block[k, 2])
            px = member[0, lo:hi]
            py = member[1, lo:hi]
            qx = member[2, lo:hi]
            qy = member[3, lo:hi]
            l0 = member[4, lo:hi]
            ks = member[5, lo:hi]
            o = out[lo:hi]
            if block[k, 3] == 0:
                elastic_design(px, py, qx, qy, l0, ks, rel[:, p], u[:, p], o)
                continue
            for j in range(count):
                r = rel[j, p]
                w = u[j, p]
                viscous_design(
                    px, py, qx, qy, l0, ks, member[6, lo:hi], member[7, lo:hi],
                    r[0], r[1], r[2], r[3], r[4], r[5], r[6], w[0], w[1], w[2], o,
                )  # fmt: skip


@kernel
def energy_gradient(pair, block, member, unit, stage, weight, out):  # type: ignore[no-untyped-def]
    """out (M_padded,) += sum_s weight_s V_i(q_s): the explicit part of the energy's design gradient."""
    rel = np.empty((pair.shape[0], POSE))
    for j in range(weight.shape[0]):
        if weight[j] == 0.0:
            continue
        relative_pose(pair, stage[j, 0], stage[j, 1], rel)
        for k in range(block.shape[0]):
            if block[k, 4] < 0:
                continue
            r = rel[block[k, 0]]
            lo = block[k, 1]
            hi = block[k, 2]
            stored_energy(
                member[0, lo:hi], member[1, lo:hi], member[2, lo:hi], member[3, lo:hi], member[4, lo:hi],
                unit[0, lo:hi], r[0], r[1], r[2], r[3], weight[j], out[lo:hi],
            )  # fmt: skip


@kernel
def unscale_gradient(block, power, alpha, padded, out):  # type: ignore[no-untyped-def]
    """out (N,) = mu alpha^(mu - 1) times the padded gradient with respect to alpha^mu."""
    for k in range(block.shape[0]):
        first = block[k, 4]
        if first < 0:
            continue
        mu = power[k]
        start = block[k, 1]
        for i in range(block[k, 5]):
            factor = 1.0 if mu == 1.0 else mu * alpha[first + i] ** (mu - 1.0)
            out[first + i] = factor * padded[start + i]
