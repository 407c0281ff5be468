"""Turns in space: unit quaternions (w, x, y, z), rotation vectors t, and how one changes with the other.

A turn by t is exp(t), and exp(t) exp(u) turns by u first as seen in the frame that t has turned to. While t changes,
the turning rate in the turned frame is

    omega = J(t) t',   J(t) u = u - (1 - cos)/|t|^2 t x u + (1 - sin/|t|)/|t|^2 t x (t x u)
    t' = J(t)^-1 omega = omega + t x omega / 2 + beta t x (t x omega),   beta = (1 - |t|/2 cot(|t|/2))/|t|^2

(A. Iserles et al., Lie-group methods, Acta Numerica 9, 2000). J(t)^T = J(-t). Angles stay below a half turn.
"""

import math

from mdstopo.compiler.jit import part
from mdstopo.mechanics.kinematics.vectors import cross, dot, minus, plus, times

#: squared angle below which what loses digits in closed form is summed as a series
SMALL_SQUARED_ANGLE = 0.1


@part
def quaternion_at(q, i):
    """The quaternion that stands at place i of q."""
    return q[i], q[i + 1], q[i + 2], q[i + 3]


@part
def product(e, f):
    """The quaternion of two rotations: e, and then f about axes turned by e."""
    return (
        e[0] * f[0] - e[1] * f[1] - e[2] * f[2] - e[3] * f[3],
        e[0] * f[1] + e[1] * f[0] + e[2] * f[3] - e[3] * f[2],
        e[0] * f[2] - e[1] * f[3] + e[2] * f[0] + e[3] * f[1],
        e[0] * f[3] + e[1] * f[2] - e[2] * f[1] + e[3] * f[0],
    )


@part
def inverse(e):
    """The quaternion of the opposite turn."""
    return e[0], -e[1], -e[2], -e[3]


@part
def exponential(t):
    """The quaternion of the turn by a rotation vector."""
    square = dot(t, t)
    half = 0.5 * math.sqrt(square)
    s = 0.5 * math.sin(half) / half if half > 1e-8 else 0.5
    return math.cos(half), s * t[0], s * t[1], s * t[2]


@part
def turn_by(e, t):
    """The quaternion of the rotation e and then one by the rotation vector t about the body's own axes, normalised."""
    x = product(e, exponential(t))
    s = 1.0 / math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3])
    return s * x[0], s * x[1], s * x[2], s * x[3]


@part
def logarithm(e):
    """The rotation vector of a quaternion, of half a turn at most."""
    sign = -1.0 if e[0] < 0.0 else 1.0
    square = e[1] * e[1] + e[2] * e[2] + e[3] * e[3]
    if square < 1e-4:
        factor = 2.0 + square * (1.0 / 3.0 + square * (3.0 / 20.0 + square * 5.0 / 56.0))
        size = math.sqrt(e[0] * e[0] + square)
        factor *= sign / size if size > 0.0 else sign
    else:
        s = math.sqrt(square)
        factor = 2.0 * sign * math.atan2(s, sign * e[0]) / s
    return factor * e[1], factor * e[2], factor * e[3]


@part
def turn_between(before, after):
    """The rotation vector that leads from one quaternion to another, in the frame of the first."""
    return logarithm(product(inverse(before), after))


@part
def _weights(square):
    """(1 - cos)/|t|^2 and (1 - sin/|t|)/|t|^2 of a squared angle, and their derivatives by it."""
    if square < SMALL_SQUARED_ANGLE:
        first = 0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square * (1.0 / 40320.0)))
        first += square * square * square * square * (1.0 / 3628800.0 - square / 479001600.0)
        second = 1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0 - square * (1.0 / 362880.0)))
        second += square * square * square * square * (1.0 / 39916800.0 - square / 6227020800.0)
        by_first = -1.0 / 24.0 + square * (2.0 / 720.0 - square * (3.0 / 40320.0 - square * (4.0 / 3628800.0)))
        by_first -= square * square * square * square * 5.0 / 479001600.0
        by_second = -1.0 / 120.0 + square * (2.0 / 5040.0 - square * (3.0 / 362880.0 - square * (4.0 / 39916800.0)))
        by_second -= square * square * square * square * 5.0 / 6227020800.0
        return first, second, by_first, by_second
    angle = math.sqrt(square)
    half = math.sin(0.5 * angle)
    sine = math.sin(angle) / angle
    first = 2.0 * half * half / square
    second = (1.0 - sine) / square
    return first, second, (0.5 * sine - first) / square, (0.5 * (first - second) - second) / square


@part
def turn_rate(t, u):
    """The angular velocity J(t) u in the turned frame, while the rotation vector t changes at the rate u."""
    first, second, _, _ = _weights(dot(t, t))
    x = cross(t, u)
    return plus(u, minus(times(second, cross(t, x)), times(first, x)))


@part
def turn_rate_jvp(t, u, dt):
    """The change of J(t) u with a change of t alone."""
    first, second, by_first, by_second = _weights(dot(t, t))
    along = 2.0 * dot(t, dt)
    x = cross(t, u)
    dx = cross(dt, u)
    change = minus(times(second, plus(cross(dt, x), cross(t, dx))), times(first, dx))
    return plus(change, times(along, minus(times(by_second, cross(t, x)), times(by_first, x))))


@part
def turn_rate_vjp(t, u, bar):
    """The cotangent of the rotation vector t from that of J(t) u; see `vector_rate_vjp`."""
    first, second, by_first, by_second = _weights(dot(t, t))
    x = cross(t, u)
    own = minus(times(second, plus(cross(x, bar), cross(u, cross(bar, t)))), times(first, cross(u, bar)))
    along = 2.0 * (by_second * dot(bar, cross(t, x)) - by_first * dot(bar, x))
    return plus(own, times(along, t))


@part
def _beta(square):
    """beta of the module's docstring, and its derivative by |t|^2."""
    if square < SMALL_SQUARED_ANGLE:
        value = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square * (1.0 / 1209600.0)))
        rest = square * square * square
        value += rest * square * (1.0 / 47900160.0 + square * 691.0 / 1307674368000.0)
        slope = 1.0 / 720.0 + square * (2.0 / 30240.0 + square * (3.0 / 1209600.0))
        slope += rest * (4.0 / 47900160.0 + square * 3455.0 / 1307674368000.0)
        return value, slope
    angle = math.sqrt(square)
    s = math.sin(0.5 * angle)
    cotangent = math.cos(0.5 * angle) / s
    value = (1.0 - 0.5 * angle * cotangent) / square
    slope = (0.25 * angle / (s * s) + 0.5 * cotangent - 2.0 / angle) / (2.0 * square * angle)
    return value, slope


@part
def vector_rate(t, omega):
    """The rate J(t)^-1 omega of the rotation vector t of a body that turns with the angular velocity omega in its own
    frame."""
    beta, _ = _beta(dot(t, t))
    x = cross(t, omega)
    return plus(omega, plus(times(0.5, x), times(beta, cross(t, x))))


@part
def vector_rate_jvp(t, omega, dt):
    """The change of J(t)^-1 omega with a change of t alone."""
    beta, slope = _beta(dot(t, t))
    x = cross(t, omega)
    dx = cross(dt, omega)
    second = plus(cross(dt, x), cross(t, dx))
    along = 2.0 * slope * dot(t, dt)
    return plus(times(0.5, dx), plus(times(beta, second), times(along, cross(t, x))))


@part
def vector_rate_vjp(t, omega, bar):
    """The cotangent of the rotation vector t from that of J(t)^-1 omega.

    bar . (dt x omega) = dt . (omega x bar); bar . (dt x x) = dt . (x x bar);
    bar . (t x (dt x omega)) = (bar x t) . (dt x omega) = dt . (omega x (bar x t)).
    """
    beta, slope = _beta(dot(t, t))
    x = cross(t, omega)
    second = plus(cross(x, bar), cross(omega, cross(bar, t)))
    along = 2.0 * slope * dot(bar, cross(t, x))
    return plus(times(0.5, cross(omega, bar)), plus(times(beta, second), times(along, t)))
