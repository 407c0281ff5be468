"""Joints between two bodies in space. Every joint is a list of rows of four kinds (`row_of_joint`):

    AT         D                 the points meet, three rows along global axes;    D = x_B + R_B c - x_A - R_A s
    ALONG i    (R_A n_i) . D     the points meet, along an axis of the first body's triad n
    ACROSS ij  (R_A n_i) . (R_B m_j)    an axis of the first body's triad stays perpendicular to one of the second's, m
    LINK       |D| - L

ALONG and ACROSS are terms f = (R_A alpha) . (chi (x_B - x_A) + R_B beta), chi 1 and 0. With z and y the second and
first factor as seen from A and from B,

    df/dq = (-chi a, alpha x z, chi a, beta x y),    a = R_A alpha

and as omega is seen from the bodies, a' = R_A (omega_A x alpha): derivatives of f by time are terms of the same kind.
So are their slopes.

Of the rows AT, with y_A = R_A^T y and y_B = R_B^T y, and a second derivative by time of each body's part of D,

    d(y . D)/dq = (-y, -s x y_A, y, c x y_B),      D'' = x_B'' - x_A'' + R_B c'' - R_A s'',
    s'' = omega_A' x s + omega_A x (omega_A x s)
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.compiler.vector import lanes, load, store
from mdstopo.mechanics.kinematics.spatial_lines import (
    add_column,
    add_line_stiffness,
    line_between,
    line_bias,
    line_rate_slopes,
    line_row,
    line_slopes,
)
from mdstopo.mechanics.kinematics.spatial_poses import (
    ATTITUDE,
    COORDINATES,
    FREEDOMS,
    HOME_PLACE,
    TURN,
    TURN_SINCE,
    fill_attitude,
)
from mdstopo.mechanics.kinematics.vectors import (
    add,
    cross,
    dot,
    minus,
    plus,
    put,
    row_of,
    times,
    turned,
    turned_back,
    unit,
    vector_at,
)

#: codes of the joints, in the order of the case format
SPHERICAL, REVOLUTE, UNIVERSAL, PRISMATIC, CYLINDRICAL, PLANAR, FIXED, DISTANCE = range(8)
#: those by which points of both bodies meet
AT_POINTS = (SPHERICAL, REVOLUTE, UNIVERSAL, FIXED)
#: rows of each
ROWS_OF = (3, 5, 4, 5, 4, 3, 6, 1)
ROWS = 6
#: kinds of a row
AT, ALONG, ACROSS, LINK = range(4)
#: places of a joint's parameters: both points, both triads by rows, D at home, the length of a link
FIRST_POINT, SECOND_POINT, FIRST_AXES, SECOND_AXES, APART, LENGTH = 0, 3, 6, 15, 24, 27
WIDTH = 30
#: places of a joint's bodies (`place_joint`): x_B - x_A, what that has changed by since home, attitudes of both
BETWEEN, MOVED, ONE, TWO = 0, 3, 6, 6 + ATTITUDE
PLACES = 6 + 2 * ATTITUDE


@part
def rows_of(code):
    """How many rows a joint has."""
    return ROWS_OF[code]


@part
def rows_at_points(code):
    """How many of the first rows are AT: 3 where points of both bodies meet, else 0."""
    return 3 if code in AT_POINTS else 0


@part
def row_of_joint(code, r):
    """Kind of row r, the axis of the first body's triad (or the global axis), and that of the second's."""
    if code == DISTANCE:
        return LINK, 0, 0
    points = 0
    if code in AT_POINTS:
        points = 3
        if r < points:
            return AT, r, 0
    elif code == PLANAR:
        points = 1
        if r < points:
            return ALONG, 0, 0
    else:
        points = 2
        if r < points:
            return ALONG, 1 + r, 0
    if code == UNIVERSAL:
        return ACROSS, 0, 0
    if r - points < 2:
        return ACROSS, 1 + r - points, 0
    return ACROSS, 1, 2


@kernel
def place_joint(model, j, q, turned, w):
    """Where the bodies of a joint are; see `kinematics_interface.place_joint`."""
    _copy_attitude(turned[model.joint[j, 1]], w, ONE)
    _copy_attitude(turned[model.joint[j, 2]], w, TWO)
    _place_between(model.home, model.joint[j, 1], model.joint[j, 2], q, w)


@part
def _copy_attitude(turned, w, at):
    """w[at : at + ATTITUDE] = turned (ATTITUDE,); the last vector begins early enough to end with it."""
    for begin in range(0, ATTITUDE, lanes()):
        i = min(begin, ATTITUDE - lanes())
        store(w, at + i, load(turned, i))


@kernel
def place_joint_alone(model, j, q, w):
    """Where the bodies of a joint are; see `kinematics_interface.place_joint_alone`."""
    _place_alone(model.home, model.joint[j, 1], model.joint[j, 2], q, w)


@kernel
def _place_alone(home, one, two, q, w):
    """w (PLACES,) from coordinates q (n_q,) of two bodies."""
    fill_attitude(home, one, q, w, ONE)
    fill_attitude(home, two, q, w, TWO)
    _place_between(home, one, two, q, w)


@part
def _place_between(home, one, two, q, w):
    """The first columns of w (PLACES,)."""
    moved = minus(vector_at(q, COORDINATES * two), vector_at(q, COORDINATES * one))
    put(w, MOVED, moved)
    put(w, BETWEEN, plus(minus(vector_at(home[two], HOME_PLACE), vector_at(home[one], HOME_PLACE)), moved))


@part
def _apart(par, w):
    """D (m): what it is at home, and what it has changed by since."""
    since = minus(
        turned(w, TWO + TURN_SINCE, vector_at(par, SECOND_POINT)),
        turned(w, ONE + TURN_SINCE, vector_at(par, FIRST_POINT)),
    )
    return plus(vector_at(par, APART), plus(vector_at(w, MOVED), since))


@part
def _line(par, w):
    """Vector, direction and length of a link."""
    return line_between(
        w, ONE, w, TWO, vector_at(par, FIRST_POINT), vector_at(par, SECOND_POINT), vector_at(w, BETWEEN)
    )


@part
def add_term(w, alpha, between, beta, scale, row, r):
    """row[r] (12,) += the slopes of scale (R_A alpha) . (between + R_B beta) by the turns of both bodies.

    w (PLACES,): where the bodies are. alpha, beta: in their axes. between: global.
    """
    z = turned_back(w, ONE + TURN, plus(between, turned(w, TWO + TURN, beta)))
    add(row[r], 3, times(scale, cross(alpha, z)))
    add(row[r], 9, times(scale, cross(beta, turned_back(w, TWO + TURN, turned(w, ONE + TURN, alpha)))))


@part
def add_places(w, alpha, row, r):
    """row[r] (12,) += the slopes of (R_A alpha) . (x_B - x_A) by both places."""
    a = turned(w, ONE + TURN, alpha)
    add(row[r], 0, times(-1.0, a))
    add(row[r], 6, a)


@part
def _fill_slopes(w, first, second, rows):
    """rows[i] (12,), i < 3: slopes of component i of R_B second - R_A first by the turns of both bodies.

    w (PLACES,): where the bodies are. first, second: vectors in their axes.
    """
    for i in range(3):
        row = rows[i]
        row[:] = 0.0
        put(row, 3, cross(row_of(w, ONE + TURN, i), first))
        put(row, 9, cross(second, row_of(w, TWO + TURN, i)))


@kernel
def joint_rows(model, j, w, phi, jac):
    """Phi and Phi_q; see `kinematics_interface.joint_rows`."""
    par = model.joint_par[j]
    rows_at(model.joint[j, 0], par, w, phi, jac)


@kernel
def rows_at(code, par, w, phi, jac):
    """`joint_rows` of a joint by its code and parameters."""
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    none = (0.0, 0.0, 0.0)
    between = vector_at(w, BETWEEN)
    points = rows_at_points(code)
    if points > 0:
        put(phi, 0, _apart(par, w))
        _fill_slopes(w, s, c, jac)
        for i in range(points):
            jac[i, i] = -1.0
            jac[i, 6 + i] = 1.0
    for r in range(points, rows_of(code)):
        kind, i, k = row_of_joint(code, r)
        row = jac[r]
        row[:] = 0.0
        if kind == LINK:
            _, e, length = _line(par, w)
            u = minus(_apart(par, w), vector_at(par, APART))
            home = vector_at(par, APART)
            # L^2 - L_0^2 at home is 2 D_0 . u + u . u more now
            off = dot(home, home) - par[LENGTH] * par[LENGTH] + dot(u, plus(u, times(2.0, home)))
            phi[r] = off / (length + par[LENGTH])
            line_row(w, ONE, w, TWO, s, c, e, row, 0)
        elif kind == ALONG:
            n = vector_at(par, FIRST_AXES + 3 * i)
            phi[r] = dot(turned(w, ONE + TURN, n), _apart(par, w))
            add_term(w, n, between, c, 1.0, jac, r)
            add_places(w, n, jac, r)
        else:
            n = vector_at(par, FIRST_AXES + 3 * i)
            m = vector_at(par, SECOND_AXES + 3 * k)
            phi[r] = dot(turned(w, ONE + TURN, n), turned(w, TWO + TURN, m))
            add_term(w, n, none, m, 1.0, jac, r)


@part
def _second(omega, turning, x):
    """The second derivative, in its body's axes, of a vector x that the body carries."""
    return plus(cross(turning, x), cross(omega, cross(omega, x)))


@kernel
def joint_gamma(model, j, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0; see `kinematics_interface.joint_gamma`."""
    par = model.joint_par[j]
    code = model.joint[j, 0]
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    omega_a = vector_at(wd, 3)
    omega_b = vector_at(wd, 9)
    still = (0.0, 0.0, 0.0)
    velocity = minus(vector_at(wd, 6), vector_at(wd, 0))
    points = rows_at_points(code)
    if points > 0:
        one = cross(omega_a, cross(omega_a, s))
        two = cross(omega_b, cross(omega_b, c))
        put(gamma, 0, minus(turned(w, TWO + TURN, two), turned(w, ONE + TURN, one)))
    for r in range(points, rows_of(code)):
        kind, i, k = row_of_joint(code, r)
        if kind == LINK:
            _, e, length = _line(par, w)
            gamma[r] = line_bias(w, ONE, w, TWO, s, c, e, length, wd, 0, FREEDOMS)
        else:
            n = vector_at(par, FIRST_AXES + 3 * i)
            m = c
            z = vector_at(w, BETWEEN)
            z_rate = velocity
            if kind == ACROSS:
                m = vector_at(par, SECOND_AXES + 3 * k)
                z = still
                z_rate = still
            z = plus(z, turned(w, TWO + TURN, m))
            z_rate = plus(z_rate, turned(w, TWO + TURN, cross(omega_b, m)))
            value = dot(turned(w, ONE + TURN, _second(omega_a, still, n)), z)
            value += 2.0 * dot(turned(w, ONE + TURN, cross(omega_a, n)), z_rate)
            gamma[r] = value + dot(turned(w, ONE + TURN, n), turned(w, TWO + TURN, _second(omega_b, still, m)))


@kernel
def joint_velocity_slope(model, j, w, wd, out):
    """d(Phi_q v)/dq; see `kinematics_interface.joint_velocity_slope`."""
    par = model.joint_par[j]
    code = model.joint[j, 0]
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    omega_a = vector_at(wd, 3)
    omega_b = vector_at(wd, 9)
    none = (0.0, 0.0, 0.0)
    velocity = minus(vector_at(wd, 6), vector_at(wd, 0))
    points = rows_at_points(code)
    if points > 0:
        _fill_slopes(w, cross(omega_a, s), cross(omega_b, c), out)
    for r in range(points, rows_of(code)):
        kind, i, k = row_of_joint(code, r)
        row = out[r]
        row[:] = 0.0
        if kind == LINK:
            _, e, length = _line(par, w)
            line_rate_slopes(w, ONE, w, TWO, s, c, e, length, wd, 0, FREEDOMS, row)
        else:
            n = vector_at(par, FIRST_AXES + 3 * i)
            m = c if kind == ALONG else vector_at(par, SECOND_AXES + 3 * k)
            n_rate = cross(omega_a, n)
            m_rate = cross(omega_b, m)
            if kind == ALONG:
                add_term(w, n_rate, vector_at(w, BETWEEN), m, 1.0, out, r)
                add_places(w, n_rate, out, r)
                add_term(w, n, velocity, m_rate, 1.0, out, r)
            else:
                add_term(w, n_rate, none, m, 1.0, out, r)
                add_term(w, n, none, m_rate, 1.0, out, r)


@kernel
def joint_acceleration_slopes(model, j, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a; see `kinematics_interface.joint_acceleration_slopes`."""
    par = model.joint_par[j]
    code = model.joint[j, 0]
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    omega_a = vector_at(wd, 3)
    omega_b = vector_at(wd, 9)
    points = rows_at_points(code)
    if points > 0:
        _fill_slopes(w, _second(omega_a, vector_at(wdd, 3), s), _second(omega_b, vector_at(wdd, 9), c), by_q)
        for i in range(points):
            rate = by_v[i]
            rate[:] = 0.0
            put(rate, 3, times(-1.0, _centripetal_slope(s, omega_a, row_of(w, ONE + TURN, i))))
            put(rate, 9, _centripetal_slope(c, omega_b, row_of(w, TWO + TURN, i)))
    for r in range(points, rows_of(code)):
        kind, i, k = row_of_joint(code, r)
        row = by_q[r]
        rate = by_v[r]
        row[:] = 0.0
        rate[:] = 0.0
        if kind == LINK:
            _, e, length = _line(par, w)
            line_slopes(w, ONE, w, TWO, s, c, e, length, wd, wdd, 0, FREEDOMS, row, rate)
        else:
            _slopes_along(kind == ALONG, par, i, k, w, wd, wdd, by_q, by_v, r)


@part
def _centripetal_slope(s, omega, y):
    """Slope of y . (omega x (omega x s)) by omega."""
    return plus(cross(cross(omega, s), y), cross(s, cross(y, omega)))


@part
def _slopes_along(moves, par, i, k, w, wd, wdd, by_q, by_v, r):
    """`joint_acceleration_slopes` of a row ALONG (moves) or ACROSS, row r of by_q and by_v (rows, 12), which are 0.

    par (WIDTH,), w (PLACES,), wd, wdd (12,): as of `joint_rows`. i, k: the axes of both triads.
    """
    omega_a = vector_at(wd, 3)
    omega_b = vector_at(wd, 9)
    between = (0.0, 0.0, 0.0)
    velocity = between
    acceleration = between
    n = vector_at(par, FIRST_AXES + 3 * i)
    m = vector_at(par, SECOND_AXES + 3 * k)
    if moves:
        between = vector_at(w, BETWEEN)
        velocity = minus(vector_at(wd, 6), vector_at(wd, 0))
        acceleration = minus(vector_at(wdd, 6), vector_at(wdd, 0))
        m = vector_at(par, SECOND_POINT)
    n_rate = cross(omega_a, n)
    m_rate = cross(omega_b, m)
    n_second = _second(omega_a, vector_at(wdd, 3), n)
    m_second = _second(omega_b, vector_at(wdd, 9), m)
    add_term(w, n_second, between, m, 1.0, by_q, r)
    if moves:
        add_places(w, n_second, by_q, r)
    add_term(w, n_rate, velocity, m_rate, 2.0, by_q, r)
    add_term(w, n, acceleration, m_second, 1.0, by_q, r)
    # by velocities: of a'' . z + 2 a' . z' + a . z''
    z = turned_back(w, ONE + TURN, plus(between, turned(w, TWO + TURN, m)))
    z_rate = turned_back(w, ONE + TURN, plus(velocity, turned(w, TWO + TURN, m_rate)))
    a_rate = turned(w, ONE + TURN, n_rate)
    y = turned_back(w, TWO + TURN, turned(w, ONE + TURN, n))
    y_rate = turned_back(w, TWO + TURN, a_rate)
    rate = by_v[r]
    add(rate, 3, plus(_centripetal_slope(n, omega_a, z), times(2.0, cross(n, z_rate))))
    add(rate, 9, plus(_centripetal_slope(m, omega_b, y), times(2.0, cross(m, y_rate))))
    if moves:
        add(rate, 0, times(-2.0, a_rate))
        add(rate, 6, times(2.0, a_rate))


@kernel
def joint_stiffness(model, j, w, lam, k):
    """k += d(Phi_q^T lam)/dq; see `kinematics_interface.joint_stiffness`."""
    par = model.joint_par[j]
    code = model.joint[j, 0]
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    none = (0.0, 0.0, 0.0)
    points = rows_at_points(code)
    if points > 0:
        one = turned_back(w, ONE + TURN, vector_at(lam, 0))
        two = turned_back(w, TWO + TURN, vector_at(lam, 0))
        for d in range(3):
            axis = unit(d)
            add_column(k, 3, 3 + d, cross(s, cross(axis, one)))
            add_column(k, 9, 9 + d, cross(c, cross(two, axis)))
    for r in range(points, rows_of(code)):
        kind, i, m = row_of_joint(code, r)
        f = lam[r]
        if f == 0.0:
            continue
        if kind == LINK:
            _, e, length = _line(par, w)
            add_line_stiffness(w, ONE, w, TWO, s, c, e, length, f, k)
        elif kind == ALONG:
            _stiffness_along(w, vector_at(par, FIRST_AXES + 3 * i), vector_at(w, BETWEEN), c, True, f, k)
        else:
            n = vector_at(par, FIRST_AXES + 3 * i)
            _stiffness_along(w, n, none, vector_at(par, SECOND_AXES + 3 * m), False, f, k)


@part
def _stiffness_along(w, n, between, m, moves, f, k):
    """k (12, 12) += f times the slopes of df/dq = (-a, n x z, a, m x y) of a row ALONG or ACROSS.

    w (PLACES,): where the bodies are. n, m: the vectors of both bodies. between: x_B - x_A (m), 0 if not `moves`.
    """
    z = turned_back(w, ONE + TURN, plus(between, turned(w, TWO + TURN, m)))
    y = turned_back(w, TWO + TURN, turned(w, ONE + TURN, n))
    for d in range(3):
        axis = unit(d)
        # by turns of the first body: a changes by R_A (axis x n), z by z x axis
        a = turned(w, ONE + TURN, cross(axis, n))
        add_column(k, 3, 3 + d, times(f, cross(n, cross(z, axis))))
        add_column(k, 9, 3 + d, times(f, cross(m, turned_back(w, TWO + TURN, a))))
        # by turns of the second: z by R_A^T R_B (axis x m), y by y x axis
        x = turned_back(w, ONE + TURN, turned(w, TWO + TURN, cross(axis, m)))
        add_column(k, 3, 9 + d, times(f, cross(n, x)))
        add_column(k, 9, 9 + d, times(f, cross(m, cross(y, axis))))
        if moves:
            add_column(k, 0, 3 + d, times(-f, a))
            add_column(k, 6, 3 + d, times(f, a))
            x = times(f, cross(n, turned_back(w, ONE + TURN, axis)))
            add_column(k, 3, d, times(-1.0, x))
            add_column(k, 3, 6 + d, x)


@part
def joint_is_point(model, j):
    """A joint whose rows are AT alone (`kinematics_interface.point_joint_vjp`)."""
    return model.joint[j, 0] == SPHERICAL


@part
def places_points(model):
    """See `kinematics_interface.places_points`."""
    return False


@part
def _of_rows(model, j, x):
    """What x (n_row,) has of the three rows of joint j; 0 for rows that are left out."""
    row = model.row
    return (
        x[row[j, 0]] if row[j, 0] >= 0 else 0.0,
        x[row[j, 1]] if row[j, 1] >= 0 else 0.0,
        x[row[j, 2]] if row[j, 2] >= 0 else 0.0,
    )


@part
def point_joint_vjp(model, j, own, turned, v, a, lam, z, y, bar_q, bar_v):
    """What turns do to D'' and to the multipliers' moments; see `kinematics_interface.point_joint_vjp`.

    With y_A = R_A^T y and l_A = R_A^T lam, -z . (s x l_A) has the slope (z x s) x l_A, and y . R_A s'' has s'' x y_A.
    """
    par = model.joint_par[j]
    s = vector_at(par, FIRST_POINT)
    c = vector_at(par, SECOND_POINT)
    one = FREEDOMS * model.joint[j, 1] + 3
    two = FREEDOMS * model.joint[j, 2] + 3
    turn_one = turned[model.joint[j, 1]]
    turn_two = turned[model.joint[j, 2]]
    adjoint = _of_rows(model, j, y)
    pull = _of_rows(model, j, lam)
    seen = turned_back(turn_one, TURN, adjoint)
    omega = vector_at(v, one)
    turning = cross(cross(vector_at(z, one), s), turned_back(turn_one, TURN, pull))
    add(bar_q, one, plus(turning, cross(_second(omega, vector_at(a, one), s), seen)))
    add(bar_v, one, _centripetal_slope(s, omega, seen))
    seen = turned_back(turn_two, TURN, adjoint)
    omega = vector_at(v, two)
    turning = cross(turned_back(turn_two, TURN, pull), cross(vector_at(z, two), c))
    add(bar_q, two, plus(turning, cross(seen, _second(omega, vector_at(a, two), c))))
    add(bar_v, two, times(-1.0, _centripetal_slope(c, omega, seen)))


@entry
def slopes_of(joint, joint_par, home, q, phi, jac):
    """Phi and Phi_q of joints at one configuration.

    joint (n_joint, 5), joint_par (n_joint, WIDTH), home (n_body, HOME): as in `GeneralModel`. q (n_q,): coordinates.
    phi (n_joint, rows), jac (n_joint, rows, 2 D): are written, as many rows as each joint has.
    """
    w = np.empty(PLACES)
    for j in range(joint.shape[0]):
        _place_alone(home, joint[j, 1], joint[j, 2], q, w)
        rows_at(joint[j, 0], joint_par[j], w, phi[j], jac[j])


@entry
def reactions(joint, joint_par, home, row, q, lam, out):
    """Force and moment of each joint on its first body at its own point, global axes, at many states.

    Constant:
      joint (n_joint, 5), joint_par (n_joint, WIDTH), home (n_body, HOME), row (n_joint, rows): as in `GeneralModel`.
    In:
      q (T, n_q): coordinates.
      lam (T, n_row): multipliers.
    Out:
      out (T, n_joint, 6): force (N), moment (N m).
    """
    w = np.empty(PLACES)
    phi = np.empty(ROWS)
    jac = np.empty((ROWS, 2 * FREEDOMS))
    for t in range(q.shape[0]):
        for j in range(joint.shape[0]):
            par = joint_par[j]
            _place_alone(home, joint[j, 1], joint[j, 2], q[t], w)
            rows_at(joint[j, 0], par, w, phi, jac)
            force = (0.0, 0.0, 0.0)
            moment = (0.0, 0.0, 0.0)
            for r in range(joint[j, 4]):
                if row[j, r] >= 0:
                    force = minus(force, times(lam[t, row[j, r]], vector_at(jac[r], 0)))
                    moment = minus(moment, times(lam[t, row[j, r]], vector_at(jac[r], 3)))
            arm = vector_at(par, FIRST_POINT)
            moment = minus(moment, cross(arm, turned_back(w, ONE + TURN, force)))
            put(out[t, j], 0, force)
            put(out[t, j], 3, turned(w, ONE + TURN, moment))
