"""Bushings between bodies in space, along the axes that the case gives the first body.

    V = (u . k_u u + theta . k_theta theta)/2,   u = d + a - p, a = S c;   exp(theta) = S S_home^T

With theta' = J_l(theta)^-1 w the couple on the second body is -J_l^-T k_theta theta = -J(theta)^-1 k_theta theta
(`rotations`); dampers act against u' = d' + w x a and w.
"""

import math

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.kinematics.rotations import logarithm, vector_rate, vector_rate_jvp
from mdstopo.mechanics.kinematics.spatial_forces import C, K
from mdstopo.mechanics.kinematics.spatial_lines import add_column
from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D_SINCE, FREEDOMS, HOME_AXES, S_SINCE, S, W
from mdstopo.mechanics.kinematics.vectors import add, cross, plus, times, turned, turned_back, unit, vector_at

#: columns of `GeneralModel.bushing`: both points and the stretch at home, in principal axes (of the first body), then
#: stiffness and damping along the axes that the case gives the first body
FIRST, SECOND, APART, STIFFNESS, DAMPING = 0, 3, 6, 9, 15
WIDTH = 21


@part
def _along_axes(home, numbers, first, a):
    """Each component of a, along the case's axes of a body at home (HOME,), times one of three numbers from `first`."""
    x = turned(home, HOME_AXES, a)
    y = (numbers[first] * x[0], numbers[first + 1] * x[1], numbers[first + 2] * x[2])
    return turned_back(home, HOME_AXES, y)


@part
def turn_since_home(r):
    """theta of a pose r (POSE,), from the matrix S S_home^T.

    S_home = S - (S - S_home); its quaternion's part that does not vanish is the largest of four, so nothing is lost.
    """
    # rows of S S_home^T
    m00 = m01 = m02 = m10 = m11 = m12 = m20 = m21 = m22 = 0.0
    for k in range(3):
        a0 = r[S + k]
        a1 = r[S + 3 + k]
        a2 = r[S + 6 + k]
        b0 = a0 - r[S_SINCE + k]
        b1 = a1 - r[S_SINCE + 3 + k]
        b2 = a2 - r[S_SINCE + 6 + k]
        m00 += a0 * b0
        m01 += a0 * b1
        m02 += a0 * b2
        m10 += a1 * b0
        m11 += a1 * b1
        m12 += a1 * b2
        m20 += a2 * b0
        m21 += a2 * b1
        m22 += a2 * b2
    trace = m00 + m11 + m22
    if trace > 0.0:
        w = 0.5 * math.sqrt(1.0 + trace)
        f = 0.25 / w
        return logarithm((w, f * (m21 - m12), f * (m02 - m20), f * (m10 - m01)))
    if m00 >= m11 and m00 >= m22:
        x = 0.5 * math.sqrt(max(1.0 + m00 - m11 - m22, 0.0))
        f = 0.25 / x
        return logarithm((f * (m21 - m12), x, f * (m01 + m10), f * (m02 + m20)))
    if m11 >= m22:
        y = 0.5 * math.sqrt(max(1.0 + m11 - m00 - m22, 0.0))
        f = 0.25 / y
        return logarithm((f * (m02 - m20), f * (m01 + m10), y, f * (m12 + m21)))
    z = 0.5 * math.sqrt(max(1.0 + m22 - m00 - m11, 0.0))
    f = 0.25 / z
    return logarithm((f * (m10 - m01), f * (m02 + m20), f * (m12 + m21), z))


@kernel
def add_bushings(model, rel, q, tangent, sums):
    """Q, K and C of the bushings; see `kinematics_interface.add_bushings`."""
    for j in range(model.bushing_pair.shape[0]):
        b = model.bushing[j]
        p = model.bushing_pair[j]
        home = model.home[model.pair[p, 0]]
        r = rel[p]
        o = sums[p]
        c = vector_at(b, SECOND)
        arm = turned(r, S, c)
        u = plus(vector_at(b, APART), plus(vector_at(r, D_SINCE), turned(r, S_SINCE, c)))
        w = vector_at(r, W)
        rate = plus(vector_at(r, D_RATE), cross(w, arm))
        theta = turn_since_home(r)
        f = plus(_along_axes(home, b, STIFFNESS, u), _along_axes(home, b, DAMPING, rate))
        bent = _along_axes(home, b, STIFFNESS + 3, theta)
        couple = plus(vector_rate(theta, bent), _along_axes(home, b, DAMPING + 3, w))
        add(o, 0, times(-1.0, f))
        add(o, 3, times(-1.0, plus(cross(arm, f), couple)))
        if not tangent:
            continue
        k = o[K : K + FREEDOMS * FREEDOMS].reshape(FREEDOMS, FREEDOMS)
        for m in range(FREEDOMS):
            i = m % 3
            axis = unit(i)
            moved = axis if m < 3 else cross(axis, arm)
            df = _along_axes(home, b, STIFFNESS, moved)
            by_rate = _along_axes(home, b, DAMPING, moved)
            dm = cross(arm, df)
            if m >= 3:
                df = plus(df, _along_axes(home, b, DAMPING, cross(w, moved)))
                change = vector_rate(times(-1.0, theta), axis)
                dm = plus(plus(cross(moved, f), cross(arm, df)), vector_rate_jvp(theta, bent, change))
                dm = plus(dm, vector_rate(theta, _along_axes(home, b, STIFFNESS + 3, change)))
            add_column(k, 0, m, df)
            add_column(k, 3, m, dm)
            if o.shape[0] == C:
                continue  # sums have no room for C where nothing is damped
            damped = cross(arm, by_rate)
            if m >= 3:
                damped = plus(damped, _along_axes(home, b, DAMPING + 3, axis))
            for i in range(m + 1):
                x = by_rate if i < 3 else damped
                o[C + m * (m + 1) // 2 + i] += x[0] if i % 3 == 0 else x[1] if i % 3 == 1 else x[2]
