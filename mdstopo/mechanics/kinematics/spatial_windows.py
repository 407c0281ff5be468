"""Windows of collocation in space: places and rotation vectors since the start of a window, and how bodies follow them.

Within a window a body is at x_0 + x, turned by q_0 exp(theta) (`rotations`). With p = theta', u = theta'' and the
squared angle s = |theta|^2,

    J v = v - f1 theta x v + f2 theta x (theta x v),    f1 = (1 - cos)/s,    f2 = (1 - sin/|theta|)/s,
    omega = J p,    omega' = J u + E,    E = f2 p x y + 2 sigma g,
    y = theta x p,    sigma = theta . p,    g = -f1' y + f2' theta x y,

where a prime of f1 and f2 is a derivative by s: theta'' is found without ever solving for theta, which with x is
integrated as coordinates in a plane are. Changes are, with T = (1, J), H, L and N for the turns alone,

    dq = T dx,   domega = J dp + H dtheta,   domega' = J du + L dtheta + N dp.

f1 and f2 are sums of their series, right to rounding up to 2 rad and to 1e-13 at a half turn.
"""

import math

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, load, store
from mdstopo.mechanics.kinematics.rotations import quaternion_at, turn_by
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS
from mdstopo.mechanics.kinematics.spatial_steps import back_turned, put_quaternion
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
    vector_at,
)

#: where the matrices of a body begin in its row of `window_maps`, each by rows
J, INVERSE, H, L, N = 0, 9, 18, 27, 36
WIDTH = 45
#: coefficients of the series of (2 f1 - 1)/s and of f2 in powers of s, the highest first
TERMS = 12
_FIRST = tuple((-1.0) ** (k + 1) * 2.0 / math.factorial(2 * k + 4) for k in range(TERMS - 1, -1, -1))
_SECOND = tuple((-1.0) ** k / math.factorial(2 * k + 3) for k in range(TERMS - 1, -1, -1))


@part
def _sum(coefficients, s):
    """A polynomial in s with its first and second derivative."""
    value = 0.0
    slope = 0.0
    bend = 0.0
    for k in range(TERMS):
        bend = bend * s + slope
        slope = slope * s + value
        value = value * s + coefficients[k]
    return value, slope, 2.0 * bend


@part
def _weights(s):
    """f1 and f2 with their first and second derivatives by the squared angle s, and beta of `rotations`."""
    m, dm, ddm = _sum(_FIRST, s)
    f2, df2, ddf2 = _sum(_SECOND, s)
    f1 = 0.5 + 0.5 * m * s
    return f1, f2, 0.5 * (m + dm * s), df2, dm + 0.5 * ddm * s, ddf2, (f2 + m) / (2.0 * f1)


@part
def _rate(t, v, f1, f2):
    """J v."""
    x = cross(t, v)
    return plus(v, minus(times(f2, cross(t, x)), times(f1, x)))


@part
def _excess(t, p, f2, df1, df2):
    """E, what omega' is beside J theta''."""
    y = cross(t, p)
    g = minus(times(df2, cross(t, y)), times(df1, y))
    return plus(times(f2, cross(p, y)), times(2.0 * dot(t, p), g))


@part
def _back(t, v, beta):
    """J^-1 v."""
    x = cross(t, v)
    return plus(v, plus(times(0.5, x), times(beta, cross(t, x))))


@part
def _moving(model):
    """Bodies that are no ground."""
    return model.home.shape[0] - 1


@kernel
def window_state(model, q0, x, y, q, v):
    """Coordinates and velocities; see `kinematics_interface.window_state`."""
    for body in range(_moving(model)):
        c = COORDINATES * body
        d = FREEDOMS * body
        t = vector_at(x, d + 3)
        f1, f2, _, _, _, _, _ = _weights(dot(t, t))
        put(q, c, plus(vector_at(q0, c), vector_at(x, d)))
        put_quaternion(q, c + 3, turn_by(quaternion_at(q0, c + 3), t))
        put(v, d, vector_at(y, d))
        put(v, d + 3, _rate(t, vector_at(y, d + 3), f1, f2))


@kernel
def window_accelerations(model, x, y, u, a):
    """omega' = J theta'' + E; see `kinematics_interface.window_accelerations`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        t = vector_at(x, d + 3)
        f1, f2, df1, df2, _, _, _ = _weights(dot(t, t))
        put(a, d, vector_at(u, d))
        turn = _rate(t, vector_at(u, d + 3), f1, f2)
        put(a, d + 3, plus(turn, _excess(t, vector_at(y, d + 3), f2, df1, df2)))


@kernel
def window_rates(model, x, y, a, u):
    """theta'' = J^-1 (omega' - E); see `kinematics_interface.window_rates`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        t = vector_at(x, d + 3)
        put(u, d, vector_at(a, d))
        put(u, d + 3, _turning(t, vector_at(y, d + 3), vector_at(a, d + 3), _weights(dot(t, t))))


@part
def _turning(t, p, push, weights):
    """theta'' from theta, theta', omega' and the weights f1, ... at theta."""
    _, f2, df1, df2, _, _, beta = weights
    return _back(t, minus(push, _excess(t, p, f2, df1, df2)), beta)


@kernel
def window_rates_with_maps(model, x, y, a, u, maps):
    """Both from the same weights; see `kinematics_interface.window_rates_with_maps`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        t = vector_at(x, d + 3)
        p = vector_at(y, d + 3)
        weights = _weights(dot(t, t))
        w = _turning(t, p, vector_at(a, d + 3), weights)
        put(u, d, vector_at(a, d))
        put(u, d + 3, w)
        _fill_maps(t, p, w, weights, maps[body])


@part
def window_size(model):
    """See `window_maps`."""
    return WIDTH


@part
def _fill(m, at, scale, turn, one, first, two, second):
    """m[at : at + 9] = scale 1 + [turn] + one first^T + two second^T, by rows."""
    for r in range(3):
        for c in range(3):
            m[at + 3 * r + c] = one[r] * first[c] + two[r] * second[c]
    m[at] += scale
    m[at + 4] += scale
    m[at + 8] += scale
    m[at + 1] -= turn[2]
    m[at + 2] += turn[1]
    m[at + 3] += turn[2]
    m[at + 5] -= turn[0]
    m[at + 6] -= turn[1]
    m[at + 7] += turn[0]


@kernel
def window_maps(model, x, y, u, maps):
    """J, J^-1, H, L and N of each body; see `kinematics_interface.window_maps`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        t = vector_at(x, d + 3)
        _fill_maps(t, vector_at(y, d + 3), vector_at(u, d + 3), _weights(dot(t, t)), maps[body])


@part
def _fill_maps(t, p, w, weights, m):
    """m (MAPS,): J, J^-1, H, L and N of a body with theta = t, theta' = p, theta'' = w and the weights f1, ... at t.

    H is the slope of J p at fixed p; L that of J u + E; with z = theta x u, tau = theta . u, h as g with z for y, and
    k = -f1'' y + f2'' theta x y:

        H = f2 sigma 1 + [f1 p - f2 y] + (2 g - f2 p) theta^T
        N = -(f2 + 2 s f2') sigma 1 - [f2 y + 2 sigma f1' theta] + f2 theta p^T + 2 (g + sigma f2' theta) theta^T
        L = (f2 |p|^2 + 2 sigma^2 f2' + f2 tau) 1 + [2 sigma (f1' p - f2' y) + f1 u - f2 z] + (2 g - f2 p) p^T
            + (2 f2' (p x y - sigma p) + 4 sigma k + 2 h - f2 u) theta^T
    """
    none = (0.0, 0.0, 0.0)
    s = dot(t, t)
    f1, f2, df1, df2, ddf1, ddf2, beta = weights
    sigma = dot(t, p)
    c = cross(t, p)
    cc = cross(t, c)
    z = cross(t, w)
    g = minus(times(df2, cc), times(df1, c))
    k = minus(times(ddf2, cc), times(ddf1, c))
    h = minus(times(df2, cross(t, z)), times(df1, z))
    slope = minus(times(2.0, g), times(f2, p))
    _fill(m, J, 1.0 - f2 * s, times(-f1, t), times(f2, t), t, none, none)
    _fill(m, INVERSE, 1.0 - beta * s, times(0.5, t), times(beta, t), t, none, none)
    _fill(m, H, f2 * sigma, minus(times(f1, p), times(f2, c)), slope, t, none, none)
    turn = minus(times(-f2, c), times(2.0 * sigma * df1, t))
    _fill(m, N, -(f2 + 2.0 * s * df2) * sigma, turn, times(f2, t), p, times(2.0, plus(g, times(sigma * df2, t))), t)
    turn = plus(times(2.0 * sigma, minus(times(df1, p), times(df2, c))), minus(times(f1, w), times(f2, z)))
    along = plus(times(2.0 * df2, minus(cross(p, c), times(sigma, p))), times(4.0 * sigma, k))
    along = plus(along, minus(times(2.0, h), times(f2, w)))
    scale = f2 * (dot(p, p) + dot(t, w)) + 2.0 * sigma * sigma * df2
    _fill(m, L, scale, turn, slope, p, along, t)


@kernel
def window_jvp(model, maps, dx, dy, dq, dv, da):
    """Changes forward; see `kinematics_interface.window_jvp`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        m = maps[body]
        put(dq, d, vector_at(dx, d))
        put(dv, d, vector_at(dy, d))
        put(da, d, (0.0, 0.0, 0.0))
        turn = vector_at(dx, d + 3)
        rate = vector_at(dy, d + 3)
        put(dq, d + 3, turned(m, J, turn))
        put(dv, d + 3, plus(turned(m, J, rate), turned(m, H, turn)))
        put(da, d + 3, plus(turned(m, L, turn), turned(m, N, rate)))


@kernel
def window_vjp(model, maps, bar_q, bar_v, bar_a, bar_x, bar_y):
    """Cotangents back; see `kinematics_interface.window_vjp`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        m = maps[body]
        put(bar_x, d, vector_at(bar_q, d))
        put(bar_y, d, vector_at(bar_v, d))
        seen = vector_at(bar_q, d + 3)
        rate = vector_at(bar_v, d + 3)
        push = vector_at(bar_a, d + 3)
        own = plus(turned_back(m, J, seen), plus(turned_back(m, H, rate), turned_back(m, L, push)))
        put(bar_x, d + 3, own)
        put(bar_y, d + 3, plus(turned_back(m, J, rate), turned_back(m, N, push)))


@kernel
def window_turn(model, maps, inverse, transposed, x):
    """T, its inverse or their transposes; see `kinematics_interface.window_turn`."""
    at = INVERSE if inverse else J
    for body in range(_moving(model)):
        d = FREEDOMS * body + 3
        a = vector_at(x, d)
        put(x, d, turned_back(maps[body], at, a) if transposed else turned(maps[body], at, a))


@kernel
def window_start_jvp(model, x, dq0, dq):
    """A turn of the start is seen behind theta; see `kinematics_interface.window_start_jvp`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        add(dq, d, vector_at(dq0, d))
        add(dq, d + 3, back_turned(vector_at(x, d + 3), vector_at(dq0, d + 3)))


@kernel
def window_start_vjp(model, x, bar_q, bar_q0):
    """The transpose; see `kinematics_interface.window_start_vjp`."""
    for body in range(_moving(model)):
        d = FREEDOMS * body
        add(bar_q0, d, vector_at(bar_q, d))
        add(bar_q0, d + 3, back_turned(times(-1.0, vector_at(x, d + 3)), vector_at(bar_q, d + 3)))


@kernel
def window_slopes(model, maps, coupled, by_x, by_y):
    """T^-1 (A_q T + A_v H - L) and T^-1 (A_v T - N); see `kinematics_interface.window_slopes`."""
    bodies = _moving(model)
    for i in range(bodies):
        d = FREEDOMS * i
        for r in range(d, d + FREEDOMS):
            for j in range(bodies):
                e = FREEDOMS * j + 3
                turn = turned_back(maps[j], J, vector_at(by_x[r], e))
                if coupled or i == j:
                    rate = vector_at(by_y[r], e)
                    turn = plus(turn, turned_back(maps[j], H, rate))
                    put(by_y[r], e, turned_back(maps[j], J, rate))
                put(by_x[r], e, turn)
        d += 3
        m = maps[i]
        for r in range(3):
            for c in range(3):
                by_x[d + r, d + c] -= m[L + 3 * r + c]
                by_y[d + r, d + c] -= m[N + 3 * r + c]
        _turn_rows(m, by_x[d], by_x[d + 1], by_x[d + 2])
        _turn_rows(m, by_y[d], by_y[d + 1], by_y[d + 2])


@part
def _turn_rows(m, x, y, z):
    """Three rows (W,) become T^-1 times these, whole vectors at a time; m (MAPS,): of a body."""
    first = row_of(m, INVERSE, 0)
    second = row_of(m, INVERSE, 1)
    third = row_of(m, INVERSE, 2)
    for c in range(0, x.shape[0], lanes()):
        column = load(x, c), load(y, c), load(z, c)
        store(x, c, dot(first, column))
        store(y, c, dot(second, column))
        store(z, c, dot(third, column))
