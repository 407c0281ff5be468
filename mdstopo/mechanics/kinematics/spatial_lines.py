"""The line between a point of each of two bodies in space: its length, and how that changes.

    u = x_B + R_B c - x_A - R_A s,   L = |u|,   e = u/L,   L' = e . u',   L'' = e . u'' + (|u'|^2 - L'^2)/L

    dL/dq = (-e, e_A x s, e, c x e_B),   e_A = R_A^T e,   e_B = R_B^T e        (small turns in each body's own axes)

Members, inerters and links are such lines. R of a body stands at a place of an array (`vectors.turned`).
"""

import math

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.vectors import (
    cross,
    dot,
    minus,
    plus,
    put,
    times,
    turned,
    turned_back,
    unit,
    vector_at,
)

#: below this length (m) a line has no direction
NO_LENGTH = 1e-15


@part
def line_between(one, at_one, two, at_two, s, c, apart):
    """u, e (zero where there is no length) and L.

    one, at_one, two, at_two: where R_A and R_B stand. s, c: the points in their bodies' axes (m).
    apart: x_B - x_A (m).
    """
    u = plus(apart, minus(turned(two, at_two, c), turned(one, at_one, s)))
    length = math.sqrt(dot(u, u))
    return u, times(1.0 / length if length > NO_LENGTH else 0.0, u), length


@part
def line_speed(one, at_one, two, at_two, s, c, v, a, b):
    """u' (m/s).

    one, at_one, two, at_two, s, c: as of `line_between`. v: velocities, of which those of the bodies begin at a and b.
    """
    first = plus(vector_at(v, a), turned(one, at_one, cross(vector_at(v, a + 3), s)))
    second = plus(vector_at(v, b), turned(two, at_two, cross(vector_at(v, b + 3), c)))
    return minus(second, first)


@part
def centripetal(s, omega):
    """omega x (omega x s): the acceleration of a point that turns evenly."""
    return cross(omega, cross(omega, s))


@part
def line_row(one, at_one, two, at_two, s, c, e, row, first):
    """row[first : first + 12] = dL/dq.

    one, at_one, two, at_two, s, c: as of `line_between`, which gives e.
    """
    put(row, first, times(-1.0, e))
    put(row, first + 3, cross(turned_back(one, at_one, e), s))
    put(row, first + 6, e)
    put(row, first + 9, cross(c, turned_back(two, at_two, e)))


@part
def line_bias(one, at_one, two, at_two, s, c, e, length, v, a, b):
    """L'' without accelerations (m/s^2): what turning evenly, and the line's own turning, give.

    one, at_one, two, at_two, s, c: as of `line_between`, which gives e and the length.
    v: velocities, of which those of the bodies begin at a and b.
    """
    speed = line_speed(one, at_one, two, at_two, s, c, v, a, b)
    push = minus(
        turned(two, at_two, centripetal(c, vector_at(v, b + 3))),
        turned(one, at_one, centripetal(s, vector_at(v, a + 3))),
    )
    rate = dot(e, speed)
    inverse = 1.0 / length if length > NO_LENGTH else 0.0
    return dot(e, push) + (dot(speed, speed) - rate * rate) * inverse


@part
def line_rate_slopes(one, at_one, two, at_two, s, c, e, length, v, a, b, row):
    """row (12,) = d(L')/dq at given velocities.

    de . u' = e' . du with e' = (u' - L' e)/L, and d(u') = R (dtheta x (omega x c)): turning rates are the body's own.

    one, at_one, two, at_two, s, c: as of `line_between`. e, length: of it.
    v: velocities, of which those of the bodies begin at a and b.
    """
    speed = line_speed(one, at_one, two, at_two, s, c, v, a, b)
    turning = times(1.0 / length if length > NO_LENGTH else 0.0, minus(speed, times(dot(e, speed), e)))
    put(row, 0, times(-1.0, turning))
    put(row, 6, turning)
    x = cross(turned_back(one, at_one, turning), s)
    put(row, 3, plus(x, cross(turned_back(one, at_one, e), cross(vector_at(v, a + 3), s))))
    x = cross(c, turned_back(two, at_two, turning))
    put(row, 9, plus(x, cross(cross(vector_at(v, b + 3), c), turned_back(two, at_two, e))))


@kernel
def line_slopes(one, at_one, two, at_two, s, c, e, length, v, acc, a, b, by_q, by_v):
    """Slopes of L'' at given accelerations.

    With g = dL''/du and h = dL''/du' = 2 (u' - L' e)/L,
    g = (u'' - (e . u'') e)/L - L' h/L - (|u'|^2 - L'^2) e/L^2; arms turn u, u' and u''.

    In:
      one, at_one, two, at_two, s, c: as of `line_between`.
      e, length: of it.
      v, acc: velocities and accelerations, of which those of the bodies begin at a and b.
    Out:
      by_q, by_v (12,): slopes by coordinates and velocities of both bodies.

    Returns L'' (m/s^2).
    """
    y = 1.0 / length if length > NO_LENGTH else 0.0
    omega_a = vector_at(v, a + 3)
    omega_b = vector_at(v, b + 3)
    s_rate = cross(omega_a, s)
    c_rate = cross(omega_b, c)
    s_second = plus(cross(vector_at(acc, a + 3), s), cross(omega_a, s_rate))
    c_second = plus(cross(vector_at(acc, b + 3), c), cross(omega_b, c_rate))
    speed = minus(
        plus(vector_at(v, b), turned(two, at_two, c_rate)), plus(vector_at(v, a), turned(one, at_one, s_rate))
    )
    push = minus(
        plus(vector_at(acc, b), turned(two, at_two, c_second)), plus(vector_at(acc, a), turned(one, at_one, s_second))
    )
    rate = dot(e, speed)
    along = dot(e, push)
    excess = (dot(speed, speed) - rate * rate) * y
    h = times(2.0 * y, minus(speed, times(rate, e)))
    g = minus(times(y, minus(push, times(along, e))), plus(times(rate * y, h), times(excess * y, e)))
    put(by_q, 0, times(-1.0, g))
    put(by_q, 6, g)
    put(by_v, 0, times(-1.0, h))
    put(by_v, 6, h)
    for side in range(2):
        m = one if side == 0 else two
        at = at_one if side == 0 else at_two
        r = s if side == 0 else c
        r_rate = s_rate if side == 0 else c_rate
        r_second = s_second if side == 0 else c_second
        omega = omega_a if side == 0 else omega_b
        sign = -1.0 if side == 0 else 1.0
        seen_e = turned_back(m, at, e)
        seen_g = turned_back(m, at, g)
        seen_h = turned_back(m, at, h)
        x = plus(cross(r, seen_g), plus(cross(r_rate, seen_h), cross(r_second, seen_e)))
        put(by_q, 3 + 6 * side, times(sign, x))
        x = plus(cross(r, seen_h), plus(cross(r_rate, seen_e), cross(r, cross(seen_e, omega))))
        put(by_v, 3 + 6 * side, times(sign, x))
    return along + excess


@kernel
def add_line_stiffness(one, at_one, two, at_two, s, c, e, length, f, k):
    """k (12, 12) += f d2L/dq2, the slopes of the row dL/dq.

    one, at_one, two, at_two, s, c: as of `line_between`. e, length: of it. f: a force along the line (N).
    """
    y = 1.0 / length if length > NO_LENGTH else 0.0
    seen_one = turned_back(one, at_one, e)
    seen_two = turned_back(two, at_two, e)
    for j in range(12):
        i = j % 3
        axis = unit(i)
        block = j // 3
        if block == 0:
            du = times(-1.0, axis)
        elif block == 1:
            du = times(-1.0, turned(one, at_one, cross(axis, s)))
        elif block == 2:
            du = axis
        else:
            du = turned(two, at_two, cross(axis, c))
        de = times(f * y, minus(du, times(dot(e, du), e)))
        first = turned_back(one, at_one, de)
        second = turned_back(two, at_two, de)
        if block == 1:
            first = plus(first, times(f, cross(seen_one, axis)))
        if block == 3:
            second = plus(second, times(f, cross(seen_two, axis)))
        add_column(k, 0, j, times(-1.0, de))
        add_column(k, 3, j, cross(first, s))
        add_column(k, 6, j, de)
        add_column(k, 9, j, cross(c, second))


@part
def add_column(k, i, j, a):
    """k[i : i + 3, j] += a."""
    k[i, j] += a[0]
    k[i + 1, j] += a[1]
    k[i + 2, j] += a[2]
