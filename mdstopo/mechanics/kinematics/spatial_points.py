"""Motion of a point, or of the attitude, of body b in space as an observer riding on body r sees it.

    y = R_r^T (x_b + R_b s - x_r);    displacement y - y(home), velocity y', acceleration y''

    y' = c_1 - omega x y,                                   c_1 = R_r^T (v_b + R_b (omega_b x s) - v_r)
    y'' = c_2 - omega' x y - 2 omega x y' - omega x (omega x y),    c_2 likewise of accelerations

with omega the turning rate of r. The turn since home is exp(rho) = S S_home^T with S = R_r^T R_b, and rho' = J_l^-1 w
with w = S omega_b - omega. Components are along the axes that the case gives body r (`spatial_poses.axis_of`).
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.components import ACROSS, X, Y, Z
from mdstopo.mechanics.kinematics.rotations import inverse, logarithm, product, quaternion_at, vector_rate
from mdstopo.mechanics.kinematics.spatial_poses import (
    ATTITUDE,
    COORDINATES,
    FREEDOMS,
    HOME_PLACE,
    HOME_TURN,
    TURN,
    TURN_SINCE,
    axis_of,
    fill_attitude,
)
from mdstopo.mechanics.kinematics.vectors import (
    add,
    cross,
    dot,
    minus,
    plus,
    times,
    turned,
    turned_back,
    vector_at,
)

#: the second of two components that are perpendicular to the vector as it is (`components.ACROSS`)
ACROSS_TWO = 5


@part
def seen_along(model, r, component, y):
    """The component of a vector y (axes of body r), and the direction whose component has its slopes."""
    if component in (X, Y, Z):
        axis = axis_of(model, r, 0 if component == X else 1 if component == Y else 2)
        return dot(axis, y), axis
    size = math.sqrt(dot(y, y))
    along = times(1.0 / size if size > 0.0 else 0.0, y)
    if component in (ACROSS, ACROSS_TWO):
        # perpendicular to the vector: to the axis that it is farthest from, and to both
        a, b, c = abs(along[0]), abs(along[1]), abs(along[2])
        first = a <= b and a <= c
        second = not first and b <= c
        e = (1.0 if first else 0.0, 1.0 if second else 0.0, 0.0 if first or second else 1.0)
        x = cross(along, e)
        length = math.sqrt(dot(x, x))
        x = times(1.0 / length if length > 0.0 else 0.0, x)
        along = x if component == ACROSS else cross(along, x)
    return size, along


@part
def _add_slopes_of_places(one, two, s, n, y, b, r, bars):
    """Slopes of n . y by coordinates, n and y (axes of r): bars (n_freedom,) += ..., bodies begin at b and r.

    one, two (ATTITUDE,): attitudes of r and b. s: the point in the axes of b.
    """
    g = turned(one, TURN, n)
    add(bars, b, g)
    add(bars, r, times(-1.0, g))
    add(bars, r + 3, cross(n, y))
    add(bars, b + 3, cross(s, turned_back(two, TURN, g)))


@part
def _add_slopes_of_rates(one, two, s, s_rate, first, n, y, omega, b, r, bars):
    """Slopes of n . y' by coordinates and velocities, bars (3, n_freedom) += ...; bodies begin at b and r.

    one, two, s, n, y: as of `_add_slopes_of_places`. s_rate: omega_b x s (m/s). first: c_1 (m/s). omega: of r.
    """
    g = turned(one, TURN, n)
    seen = turned_back(two, TURN, g)
    add(bars[0], r + 3, cross(n, first))
    add(bars[0], b + 3, cross(s_rate, seen))
    _add_slopes_of_places(one, two, s, cross(omega, n), y, b, r, bars[0])
    add(bars[1], b, g)
    add(bars[1], r, times(-1.0, g))
    add(bars[1], b + 3, cross(s, seen))
    add(bars[1], r + 3, cross(n, y))


@kernel
def point_motion(model, order, component, at, before, b, r, q, v, a, bars):
    """Motion of a point of body b as body r sees it; see `kinematics_interface.point_motion`."""
    one = np.empty(ATTITUDE)
    two = np.empty(ATTITUDE)
    fill_attitude(model.home, r, q, one, 0)
    fill_attitude(model.home, b, q, two, 0)
    s = vector_at(at, 0)
    home = minus(vector_at(model.home[b], HOME_PLACE), vector_at(model.home[r], HOME_PLACE))
    moved = minus(vector_at(q, COORDINATES * b), vector_at(q, COORDINATES * r))
    y = turned_back(one, TURN, plus(plus(home, moved), turned(two, TURN, s)))
    i = FREEDOMS * b
    k = FREEDOMS * r
    if order == 0:
        # what has changed since home, of which no term is larger
        home = plus(home, turned(model.home[b], HOME_TURN, s))
        since = plus(
            turned_back(one, TURN, plus(moved, turned(two, TURN_SINCE, s))), turned_back(one, TURN_SINCE, home)
        )
        for axis in range(3):
            since = minus(since, times(before[axis], axis_of(model, r, axis)))
        value, n = seen_along(model, r, component, since)
        _add_slopes_of_places(one, two, s, n, y, i, k, bars[0])
        return value
    omega = vector_at(v, k + 3)
    omega_b = vector_at(v, i + 3)
    s_rate = cross(omega_b, s)
    first = turned_back(one, TURN, minus(plus(vector_at(v, i), turned(two, TURN, s_rate)), vector_at(v, k)))
    rate = minus(first, cross(omega, y))
    if order == 1:
        value, n = seen_along(model, r, component, rate)
        _add_slopes_of_rates(one, two, s, s_rate, first, n, y, omega, i, k, bars)
        return value
    turning = vector_at(a, k + 3)
    s_second = plus(cross(vector_at(a, i + 3), s), cross(omega_b, s_rate))
    second = turned_back(one, TURN, minus(plus(vector_at(a, i), turned(two, TURN, s_second)), vector_at(a, k)))
    push = minus(second, plus(cross(turning, y), plus(times(2.0, cross(omega, rate)), cross(omega, cross(omega, y)))))
    value, n = seen_along(model, r, component, push)
    g = turned(one, TURN, n)
    seen = turned_back(two, TURN, g)
    twice = times(2.0, cross(omega, n))
    # by coordinates: of c_2, then of what rides on y and on y'
    add(bars[0], k + 3, cross(n, second))
    add(bars[0], i + 3, cross(s_second, seen))
    riding = minus(cross(turning, n), cross(omega, cross(omega, n)))
    _add_slopes_of_places(one, two, s, riding, y, i, k, bars[0])
    _add_slopes_of_rates(one, two, s, s_rate, first, twice, y, omega, i, k, bars)
    # by velocities
    add(bars[1], i + 3, plus(cross(s_rate, seen), cross(s, cross(seen, omega_b))))
    x = plus(cross(n, cross(omega, y)), cross(cross(n, omega), y))
    add(bars[1], k + 3, plus(times(2.0, cross(n, rate)), x))
    # by accelerations
    add(bars[2], i, g)
    add(bars[2], k, times(-1.0, g))
    add(bars[2], i + 3, cross(s, seen))
    add(bars[2], k + 3, cross(n, y))
    return value


@part
def _add_turn_slopes(one, two, m, b, r, bars):
    """bars (n_freedom,) += slopes of m . dphi, dphi = S dtheta_b - dtheta_r; bodies begin at b and r.

    one, two (ATTITUDE,): attitudes of r and b.
    """
    add(bars, b + 3, turned_back(two, TURN, turned(one, TURN, m)))
    add(bars, r + 3, times(-1.0, m))


@kernel
def turn_motion(model, order, component, b, r, q, v, a, bars):
    """How body b turns as body r sees it; see `kinematics_interface.turn_motion`."""
    one = np.empty(ATTITUDE)
    two = np.empty(ATTITUDE)
    fill_attitude(model.home, r, q, one, 0)
    fill_attitude(model.home, b, q, two, 0)
    i = FREEDOMS * b
    k = FREEDOMS * r
    if order == 0:
        e = quaternion_at(q, COORDINATES * b + 3)
        x = turned_back(model.home[r], HOME_TURN, turned(model.home[b], HOME_TURN, (e[1], e[2], e[3])))
        before = inverse(quaternion_at(q, COORDINATES * r + 3))
        rho = logarithm(product(before, (e[0], x[0], x[1], x[2])))
        value, n = seen_along(model, r, component, rho)
        _add_turn_slopes(one, two, vector_rate(rho, n), i, k, bars[0])
        return value
    omega = vector_at(v, k + 3)
    spin = turned_back(one, TURN, turned(two, TURN, vector_at(v, i + 3)))
    if order == 1:
        value, n = seen_along(model, r, component, minus(spin, omega))
        _add_turn_slopes(one, two, cross(spin, n), i, k, bars[0])
        _add_turn_slopes(one, two, n, i, k, bars[1])
        return value
    push = turned_back(one, TURN, turned(two, TURN, vector_at(a, i + 3)))
    rate = plus(minus(push, vector_at(a, k + 3)), cross(spin, omega))
    value, n = seen_along(model, r, component, rate)
    x = cross(omega, n)
    _add_turn_slopes(one, two, plus(cross(push, n), cross(spin, x)), i, k, bars[0])
    add(bars[1], i + 3, turned_back(two, TURN, turned(one, TURN, x)))
    add(bars[1], k + 3, cross(n, spin))
    _add_turn_slopes(one, two, n, i, k, bars[2])
    return value


@kernel
def tilt_motion(model, at, b, r, q, v, a, bars):
    """By how much an axis of body b has tilted as body r sees it; see `kinematics_interface.tilt_motion`."""
    one = np.empty(ATTITUDE)
    two = np.empty(ATTITUDE)
    fill_attitude(model.home, r, q, one, 0)
    fill_attitude(model.home, b, q, two, 0)
    axis = vector_at(at, 0)
    now = turned_back(one, TURN, turned(two, TURN, axis))
    home = turned_back(model.home[r], HOME_TURN, turned(model.home[b], HOME_TURN, axis))
    x = cross(home, now)
    size = math.sqrt(dot(x, x))
    m = times(1.0 / size if size > 0.0 else 0.0, x)
    _add_turn_slopes(one, two, m, FREEDOMS * b, FREEDOMS * r, bars[0])
    return math.atan2(size, dot(home, now))
