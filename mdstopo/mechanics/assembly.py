"""Forces and tangents of the bodies, at several states in one pass over the members (`passes`), and their products.

One pass returns a few numbers a pair of bodies and pose (`SUMS`); everything here works on those.
"""

from mdstopo.compiler.jit import inline, kernel, part
from mdstopo.mechanics.geometry import add_pair_force, relative_pose, turned_body
from mdstopo.mechanics.passes import member_sums, springs_of


@part
def add_loads(model, segment, t, q, f):
    """f (n or more,) += the applied loads of a segment at time t in state q."""
    tau = t - model.times[segment]
    force = model.force
    for i in range(force.shape[1]):
        f[i] += force[segment, i, 0] + tau * force[segment, i, 1]
    if model.load_body.shape[0] == 0:
        return
    for k in range(model.load_body.shape[0]):
        b = 3 * model.load_body[k]
        c, s, _, _ = turned_body(model.home, model.load_body[k], q[b + 2])
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
def load_tangent(model, segment, t, q, turn):
    """turn (n,) = derivative of each body's applied load with respect to its own angle."""
    turn[:] = 0.0
    tau = t - model.times[segment]
    for k in range(model.load_body.shape[0]):
        b = 3 * model.load_body[k]
        c, s, _, _ = turned_body(model.home, model.load_body[k], q[b + 2])
        x = model.load_force[segment, k, 0, 0] + tau * model.load_force[segment, k, 0, 1]
        y = model.load_force[segment, k, 1, 0] + tau * model.load_force[segment, k, 1, 1]
        if model.load_follows[k]:  # force and arm turn together: the moment stays
            turn[b] -= s * x + c * y
            turn[b + 1] += c * x - s * y
        else:
            rx = c * model.load_arm[k, 0] - s * model.load_arm[k, 1]
            ry = s * model.load_arm[k, 0] + c * model.load_arm[k, 1]
            turn[b + 2] -= rx * x + ry * y


@part
def pair_tangents(pair, rel, sums, damped, k_out, c_out):
    """Tangents in body coordinates of one pose: k_out (n_pair, 6, 6) = -dF/dq, c_out = -dF/dv (if damped).

    K = T^T (K_xi T + C_xi d(Tv)/dq) - d(T^T Q)/dq, C = T^T C_xi T, written in global axes: with D = x_B - x_A and
    w = -J D, R dxi_d = dD + w dpsi_A, and R d(xi'_d) = -omega_A J dD - J R xi'_d dpsi_A.
    """
    for p in range(pair.shape[0]):
        pair_tangent(p, rel, sums, damped, k_out, c_out)


@kernel
def pair_tangent(p, rel, sums, damped, k_out, c_out):
    """`pair_tangents` of pair p alone."""
    o = sums[p]
    ca = rel[p, 7]
    sa = rel[p, 8]
    wx = sa * rel[p, 0] + ca * rel[p, 1]
    wy = sa * rel[p, 1] - ca * rel[p, 0]
    # K_xi turned into global axes: rows and columns x, y, theta
    kxx, kxy, kyx, kyy = _turned(ca, sa, o[7], o[8], o[10], o[11])
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
        cxx, cxy, _, cyy = _turned(ca, sa, o[16], o[17], o[17], o[18])
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


@part
def _turned(c, s, xx, xy, yx, yy):
    """R [xx, xy; yx, yy] R^T, R turning by the angle whose cos and sin are c and s."""
    ax = c * xx - s * yx
    ay = c * xy - s * yy
    bx = s * xx + c * yx
    by = s * xy + c * yy
    return c * ax - s * ay, s * ax + c * ay, c * bx - s * by, s * bx + c * by


@inline
def _spread(xx, xy, yx, yy, ax, ay, bx, by, tx, ty, ta, tb, wx, wy, m):
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
def subtract_products(pair, k, x, out, count):
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
def subtract_transposed(pair, k, x, out, count):
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
def add_turning(turn, x, out, count):
    """out[i] += (load tangent) x[i] for i < count: each body's load changes with its own angle; turn (count, n)."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, d] += turn[i, d] * x[i, b + 2]


@kernel
def add_turning_transposed(turn, x, out, count):
    """out[i] += (load tangent)^T x[i] for i < count."""
    for i in range(count):
        for b in range(0, turn.shape[1], 3):
            for d in range(b, b + 3):
                out[i, b + 2] += turn[i, d] * x[i, d]


@part
def forces(model, strength, segment, m, t, q, v, tangent, damped, rel, sums, f, k_out, c_out, turn):
    """Generalised forces, and on demand tangents, at m states in one pass over the members.

    Constant: model, strength. In: segment, m, t (m,), q, v (m, n). Out: rel (m, n_pair, POSE), sums (m, n_pair, SUMS),
    f (m, n); with `tangent` also k_out (m, n_pair, 6, 6), c_out (the same, if damped), turn (m, n, if loads turn).
    """
    place_bodies(model.pair, model.home, q, v, m, rel)
    member_sums(springs_of(model), strength, rel, m, tangent, sums)
    sum_bodies(model, segment, m, t, q, tangent, damped, rel, sums, f, k_out, c_out, turn)


@part
def place_bodies(pair, home, q, v, m, rel):
    """rel (m, n_pair, POSE) at m states."""
    for j in range(m):
        relative_pose(pair, home, q[j], v[j], rel[j])


@part
def sum_bodies(model, segment, m, t, q, tangent, damped, rel, sums, f, k_out, c_out, turn):
    """What `forces` gives, of the members' sums at the poses rel."""
    pair = model.pair
    turning = model.load_body.shape[0] > 0
    for j in range(m):
        out = f[j]
        out[:] = 0.0
        add_loads(model, segment, t[j], q[j], out)
        for p in range(pair.shape[0]):
            add_pair_force(pair, rel[j], p, sums[j, p, 0], sums[j, p, 1], sums[j, p, 2], out)
        if tangent:
            pair_tangents(pair, rel[j], sums[j], damped, k_out[j], c_out[j if damped else 0])
            if turning:
                load_tangent(model, segment, t[j], q[j], turn[j])
