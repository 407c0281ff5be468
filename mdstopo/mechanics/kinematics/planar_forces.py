"""Applied loads on bodies in a plane, and the tangents of loads and of what acts between the bodies of a pair."""

from mdstopo.compiler.jit import inline, kernel, part
from mdstopo.mechanics.kinematics.planar_poses import COS_A, DX, DY, OMEGA_A, SIN_A, VX, VY, turned_body
from mdstopo.mechanics.kinematics.timed import ARM, BODY, DIRECTION, KIND, MOMENT, TURNS, timed_load_size


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
        x = model.load_force[segment, k, 0, 0] + tau * model.load_force[segment, k, 0, 1]
        y = model.load_force[segment, k, 1, 0] + tau * model.load_force[segment, k, 1, 1]
        _push(model, model.load_body[k], model.load_follows[k], model.load_arm[k, 0], model.load_arm[k, 1], x, y, q, f)


@inline
def _push(model, body, follows, arm_x, arm_y, x, y, q, f):
    """Add a force at a point of a body.

    model: the compiled scene.
    body: which. follows: whether the force turns with it.
    arm_x, arm_y: the point, in the body's frame (m).
    x, y: the force (N).
    q (n,): coordinates (m, rad).
    f (n,): in and out.
    """
    b = 3 * body
    c, s, _, _ = turned_body(model.home, body, q[b + 2])
    if follows:
        x, y = c * x - s * y, s * x + c * y
    rx = c * arm_x - s * arm_y
    ry = s * arm_x + c * arm_y
    f[b] += x
    f[b + 1] += y
    f[b + 2] += rx * y - ry * x


@kernel
def add_timed_loads(model, segment, t, q, f):
    """f (n or more,) += the loads that are formulas of time, of a general scene (`GeneralModel.timed_load`)."""
    for k in range(model.timed_load.shape[0]):
        size = timed_load_size(model, segment, k, t)
        body = model.timed_load[k, BODY]
        if model.timed_load[k, KIND] == MOMENT:
            f[3 * body + 2] += size
            continue
        arm = model.timed_arm[k]
        x, y = size * arm[DIRECTION], size * arm[DIRECTION + 1]
        _push(model, body, model.timed_load[k, TURNS], arm[ARM], arm[ARM + 1], x, y, q, f)


@kernel
def load_tangent(model, segment, t, q, turn):
    """turn (n,) = derivative of each body's applied load with respect to its own angle."""
    turn[:] = 0.0
    tau = t - model.times[segment]
    for k in range(model.load_body.shape[0]):
        x = model.load_force[segment, k, 0, 0] + tau * model.load_force[segment, k, 0, 1]
        y = model.load_force[segment, k, 1, 0] + tau * model.load_force[segment, k, 1, 1]
        arm_x, arm_y = model.load_arm[k, 0], model.load_arm[k, 1]
        _push_tangent(model, model.load_body[k], model.load_follows[k], arm_x, arm_y, x, y, q, turn)


@inline
def _push_tangent(model, body, follows, arm_x, arm_y, x, y, q, turn):
    """Add the derivative of `_push` by the angle of its body.

    model: the compiled scene.
    body: which. follows: whether the force turns with it.
    arm_x, arm_y: the point, in the body's frame (m).
    x, y: the force (N).
    q (n,): coordinates (m, rad).
    turn (n,): in and out.
    """
    b = 3 * body
    c, s, _, _ = turned_body(model.home, body, q[b + 2])
    if follows:  # force and arm turn together: the moment stays
        turn[b] -= s * x + c * y
        turn[b + 1] += c * x - s * y
    else:
        rx = c * arm_x - s * arm_y
        ry = s * arm_x + c * arm_y
        turn[b + 2] -= rx * x + ry * y


@kernel
def add_timed_tangent(model, segment, t, q, turn):
    """turn (n,) += derivative of the loads of `add_timed_loads` by the angle of their body."""
    for k in range(model.timed_load.shape[0]):
        if model.timed_load[k, KIND] == MOMENT:
            continue
        size = timed_load_size(model, segment, k, t)
        arm = model.timed_arm[k]
        x, y = size * arm[DIRECTION], size * arm[DIRECTION + 1]
        body, follows = model.timed_load[k, BODY], model.timed_load[k, TURNS]
        _push_tangent(model, body, follows, arm[ARM], arm[ARM + 1], x, y, q, turn)


@part
def pair_tangents(pair, rel, sums, damped, k_out, c_out):
    """Tangents of one pose in the coordinates of each pair's bodies.

    K = T^T (K_xi T + C_xi d(Tv)/dq) - d(T^T Q)/dq, C = T^T C_xi T, written in global axes: with D = x_B - x_A and
    w = -J D, R dxi_d = dD + w dpsi_A, and R d(xi'_d) = -omega_A J dD - J R xi'_d dpsi_A.

    In:
      pair (n_pair, 2): the bodies of each pair.
      rel (n_pair, POSE): relative poses.
      sums (n_pair, SUMS): of the members, with K and C.
      damped: whether any force depends on velocity.
    Out:
      k_out (n_pair, 6, 6): -dF/dq by x, y, psi of the first body, then of the second.
      c_out (n_pair, 6, 6): -dF/dv, if damped; otherwise left as it is.
    """
    for p in range(pair.shape[0]):
        pair_tangent(p, rel, sums, damped, k_out, c_out)


@kernel
def pair_tangent(p, rel, sums, damped, k_out, c_out):
    """`pair_tangents` of pair p alone.

    In:
      p: number of the pair.
      rel (n_pair, POSE): relative poses.
      sums (n_pair, SUMS): of the members, with K and C.
      damped: whether any force depends on velocity.
    Out:
      k_out (n_pair, 6, 6): of which [p] = -dF/dq is written.
      c_out (n_pair, 6, 6): of which [p] = -dF/dv is written, if damped.
    """
    o = sums[p]
    ca = rel[p, COS_A]
    sa = rel[p, SIN_A]
    wx = sa * rel[p, DX] + ca * rel[p, DY]
    wy = sa * rel[p, DY] - ca * rel[p, DX]
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
        omega = rel[p, OMEGA_A]
        cxx, cxy, _, cyy = _turned(ca, sa, o[16], o[17], o[17], o[18])
        cxt = ca * o[19] - sa * o[20]
        cyt = sa * o[19] + ca * o[20]
        ctt = o[21]
        # -J R xi'_d
        gx = sa * rel[p, VX] + ca * rel[p, VY]
        gy = sa * rel[p, VY] - ca * rel[p, VX]
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
    m[2, 2] += o[0] * rel[p, DX] + o[1] * rel[p, DY]


@part
def _turned(c, s, xx, xy, yx, yy):
    """Turn a matrix of two rows into other axes: R [xx, xy; yx, yy] R^T.

    c, s: cosine and sine of the angle by which R turns.
    xx, xy, yx, yy: entries of the matrix.

    Returns the four entries of the product, by rows.
    """
    ax = c * xx - s * yx
    ay = c * xy - s * yy
    bx = s * xx + c * yx
    by = s * xy + c * yy
    return c * ax - s * ay, s * ax + c * ay, c * bx - s * by, s * bx + c * by


@inline
def _spread(xx, xy, yx, yy, ax, ay, bx, by, tx, ty, ta, tb, wx, wy, m):
    """Write the tangent of a pair, m = T~^T N with T~ = [-I w I 0; 0 -1 0 1], of slopes by relative coordinates.

    N has the rows x, y, theta, in global axes, and columns for D = x_B - x_A (two), psi_A and psi_B.

    xx, xy, ax, bx: row x of N.
    yx, yy, ay, by: row y of N.
    tx, ty, ta, tb: row theta of N.
    wx, wy: w, D turned by a right angle backwards (m).
    m (6, 6): out, by x, y, psi of the first body, then of the second.
    """
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
