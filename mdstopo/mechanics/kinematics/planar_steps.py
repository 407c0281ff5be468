"""The state of bodies in a plane at the stages and at the end of a step, between steps, and how these change.

Coordinates in a plane are added to as numbers, so a stage of a Runge-Kutta method for second order (Nystroem) is

    q_i = q0 + h c_i v0 + h^2 sum_j A_ij a_j,     v_i = v0 + h sum_j a_ij a_j,

and all derivatives of it are its coefficients.
"""

from mdstopo.compiler.jit import part
from mdstopo.mechanics.kinematics.brief_steps import evenly_jvp, evenly_vjp, is_brief, shares_of_way

#: planes of a method's table (`integrators.runge_kutta_tables`), and rows of its last one
BY_STAGE, BY_RATE, VECTORS = range(3)
NODES, END, END_RATE = range(3)


@part
def stage_state(model, table, h, i, q0, v0, q, v, a, slopes):
    """Coordinates and velocities of stage i; see `kinematics_interface.stage_state`."""
    ahead = h * table[VECTORS, NODES, i]
    for d in range(q0.shape[0]):
        q[i, d] = q0[d] + ahead * v0[d]
        v[i, d] = v0[d]
    for j in range(i):
        w = h * h * table[BY_STAGE, i, j]
        u = h * table[BY_RATE, i, j]
        if w != 0.0:
            for d in range(q0.shape[0]):
                q[i, d] += w * a[j, d]
        if u != 0.0:
            for d in range(q0.shape[0]):
                v[i, d] += u * a[j, d]


@part
def end_state(model, table, s, h, q0, v0, q, v, a, slopes, q_end, v_end):
    """Coordinates and velocities at the end of a step; see `kinematics_interface.end_state`."""
    for d in range(q0.shape[0]):
        position = q0[d] + h * v0[d]
        speed = v0[d]
        for j in range(s):
            position += h * h * table[VECTORS, END, j] * a[j, d]
            speed += h * table[VECTORS, END_RATE, j] * a[j, d]
        q_end[d] = position
        v_end[d] = speed


@part
def stage_vjp(model, table, h, j, q, v, lam_q, lam_v, u, g, turns, z):
    """The cotangent of the accelerations of stage j; see `kinematics_interface.stage_vjp`."""
    s, n = u.shape
    by_end = h * h * table[VECTORS, END, j]
    by_end_rate = h * table[VECTORS, END_RATE, j]
    for d in range(n):
        z[d] = by_end * lam_q[d] + by_end_rate * lam_v[d]
    for i in range(j + 1, s):
        by_stage = h * h * table[BY_STAGE, i, j]
        by_rate = h * table[BY_RATE, i, j]
        if by_stage != 0.0 or by_rate != 0.0:
            for d in range(n):
                z[d] += by_stage * u[i, d] + by_rate * g[i, d]


@part
def start_vjp(model, table, s, h, q, v, u, g, lam_q, lam_v):
    """The cotangents of the start of a step; see `kinematics_interface.start_vjp`."""
    n = lam_q.shape[0]
    for d in range(n):
        lam_v[d] += h * lam_q[d]
    for i in range(s):
        ahead = h * table[VECTORS, NODES, i]
        for d in range(n):
            lam_q[d] += u[i, d]
            lam_v[d] += ahead * u[i, d] + g[i, d]


@part
def stage_jvp(model, table, h, first, i, q, v, dq, dv, changes):
    """Changes of coordinates and velocities of stage i; see `kinematics_interface.stage_jvp`."""
    for d in range(dq.shape[0]):
        position = dq[d] + h * table[VECTORS, NODES, i] * dv[d]
        speed = dv[d]
        for j in range(first, i):
            position += h * h * table[BY_STAGE, i, j] * changes[j, 2, d]
            speed += h * table[BY_RATE, i, j] * changes[j, 2, d]
        changes[i, 0, d] = position
        changes[i, 1, d] = speed


@part
def end_jvp(model, table, s, h, q, v, changes, dq, dv):
    """Changes of the end of a step; see `kinematics_interface.end_jvp`."""
    for d in range(dq.shape[0]):
        position = dq[d] + h * dv[d]
        speed = dv[d]
        for j in range(s):
            position += h * h * table[VECTORS, END, j] * changes[j, 2, d]
            speed += h * table[VECTORS, END_RATE, j] * changes[j, 2, d]
        dq[d] = position
        dv[d] = speed


@part
def shift_size(model):
    """How many numbers a body has in `shift_tangents`: none in a plane, where shifts are added to coordinates."""
    return 0


@part
def shift_tangents(model, q, moved, out):
    """Do nothing: in a plane the derivative by a shift is 1; see `kinematics_interface.shift_tangents`."""


@part
def slope_by_shift(model, slopes, m, r, i, tangents, body):
    """The slope itself, as turns of a plane add; see `kinematics_interface.slope_by_shift`."""
    return slopes[m, r, i]


@part
def turn_slope_by_shift(model, slopes, d, r, tangents, body):
    """The slope itself, as turns of a plane add; see `kinematics_interface.turn_slope_by_shift`."""
    return slopes[d, r]


@part
def add_shift(model, tangents, w, shift, dq):
    """Add the change of a shift to that of coordinates; see `kinematics_interface.add_shift`."""
    for d in range(dq.shape[0]):
        dq[d] += w * shift[d]


@part
def add_shift_curvature(model, shift, mass, body, first, k):
    """Add nothing: in a plane there is no curvature; see `kinematics_interface.add_shift_curvature`."""


@part
def turn_back(model, shift, transposed, x):
    """Do nothing: changes of coordinates are those of the shift; see `kinematics_interface.turn_back`."""


@part
def shift_further(model, start, shift, change, q):
    """Change a shift and the coordinates to which it leads; see `kinematics_interface.shift_further`."""
    for d in range(q.shape[0]):
        q[d] += change[d]


@part
def advance_coordinates(model, q, v, a, e, out):
    """Where bodies are after a time e at constant accelerations; see `kinematics_interface.advance_coordinates`."""
    for d in range(q.shape[0]):
        out[d] = q[d] + e * (v[d] + 0.5 * e * a[d])


@part
def hermite(c):
    """Weights of q, h v at the start and q, h v at the end in the position at fraction c, and their derivatives."""
    d = 1.0 - c
    return (
        d * d * (1.0 + 2.0 * c),
        d * d * c,
        c * c * (3.0 - 2.0 * c),
        -c * c * d,
        -6.0 * c * d,
        d * (d - 2.0 * c),
        6.0 * c * d,
        c * (c - 2.0 * d),
    )


@part
def cubic(model, c, h, q0, v0, q1, v1, q, v):
    """The cubic through both ends of a step; see `kinematics_interface.cubic`."""
    if is_brief(model, h):
        first, last = shares_of_way(c, h)
        for d in range(q.shape[0]):
            q[d] = q0[d] + first * v0[d] + last * v1[d]
            v[d] = v0[d] + c * (v1[d] - v0[d])
        return
    a0, b0, a1, b1, da0, db0, da1, db1 = hermite(c)
    for d in range(q.shape[0]):
        q[d] = a0 * q0[d] + a1 * q1[d] + h * (b0 * v0[d] + b1 * v1[d])
        v[d] = (da0 * q0[d] + da1 * q1[d]) / h + db0 * v0[d] + db1 * v1[d]


@part
def cubic_vjp(model, c, h, q0, v0, q1, v1, bar_q, bar_v, start_q, start_v, end_q, end_v):
    """The cotangents of both ends of a cubic; see `kinematics_interface.cubic_vjp`."""
    if is_brief(model, h):
        evenly_vjp(c, h, bar_q, bar_v, start_q, start_v, end_q, end_v)
        return
    a0, b0, a1, b1, da0, db0, da1, db1 = hermite(c)
    for d in range(bar_q.shape[0]):
        start_q[d] = a0 * bar_q[d] + da0 / h * bar_v[d]
        start_v[d] = h * b0 * bar_q[d] + db0 * bar_v[d]
        end_q[d] = a1 * bar_q[d] + da1 / h * bar_v[d]
        end_v[d] = h * b1 * bar_q[d] + db1 * bar_v[d]


@part
def cubic_jvp(model, c, h, q0, v0, q1, v1, dq, dv, end_dq, end_dv):
    """The change of a cubic; see `kinematics_interface.cubic_jvp`."""
    if is_brief(model, h):
        evenly_jvp(c, h, dq, dv, end_dv)
        return
    a0, b0, a1, b1, da0, db0, da1, db1 = hermite(c)
    for d in range(dq.shape[0]):
        start = dq[d]
        dq[d] = a0 * start + a1 * end_dq[d] + h * (b0 * dv[d] + b1 * end_dv[d])
        dv[d] = (da0 * start + da1 * end_dq[d]) / h + db0 * dv[d] + db1 * end_dv[d]


@part
def quintic(model, c, h, q0, v0, a0, q1, v1, a1, q, v):
    """The quintic through both ends of a step; see `kinematics_interface.quintic`."""
    if is_brief(model, h):
        cubic(model, c, h, q0, v0, q1, v1, q, v)
        return
    for d in range(q.shape[0]):
        j = q1[d] - q0[d] - h * (v0[d] + 0.5 * h * a0[d])
        w = h * (v1[d] - v0[d] - h * a0[d])
        b = h * h * (a1[d] - a0[d])
        x3 = 10.0 * j - 4.0 * w + 0.5 * b
        x4 = -15.0 * j + 7.0 * w - b
        x5 = 6.0 * j - 3.0 * w + 0.5 * b
        q[d] = q0[d] + c * (h * v0[d] + c * (0.5 * h * h * a0[d] + c * (x3 + c * (x4 + c * x5))))
        v[d] = v0[d] + c * (h * a0[d] + c * (3.0 * x3 + c * (4.0 * x4 + c * 5.0 * x5)) / h)
