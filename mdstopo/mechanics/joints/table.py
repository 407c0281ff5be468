"""The joints: what each contributes to the constrained equations, by its code, and its parameters from the case.

w (PLACES,): where the first and the second body are (`revolute.place_joint`); wd, wdd (6,): their time
derivatives. The equations of motion are
M a + Phi_q^T lam = F, so the force of a joint on its first body is -Phi_q^T lam.
"""

import math

import numpy as np

from mdstopo.case.model import DistanceJoint, Joint, Pair, PrismaticJoint
from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.joints.distance import (
    distance_acceleration_slopes,
    distance_gamma,
    distance_rows,
    distance_stiffness,
    distance_velocity_slope,
)
from mdstopo.mechanics.joints.fixed import (
    fixed_acceleration_slopes,
    fixed_gamma,
    fixed_rows,
    fixed_velocity_slope,
)
from mdstopo.mechanics.joints.prismatic import (
    prismatic_acceleration_slopes,
    prismatic_gamma,
    prismatic_moment,
    prismatic_rows,
    prismatic_stiffness,
    prismatic_velocity_slope,
)
from mdstopo.mechanics.joints.revolute import (
    arms,
    revolute_acceleration_slopes,
    revolute_gamma,
    revolute_rows,
    revolute_stiffness,
    revolute_velocity_slope,
)
from mdstopo.scene.model import HOME_ANGLE, HOME_COS, HOME_X, HOME_Y, FloatArray

REVOLUTE, PRISMATIC, FIXED, DISTANCE = range(4)
CODES = {"revolute": REVOLUTE, "prismatic": PRISMATIC, "fixed": FIXED, "distance": DISTANCE}
ROWS = {"revolute": 2, "prismatic": 2, "fixed": 3, "distance": 1}
WIDTH = 12
#: misfit of a joint at home, relative to its coordinates, that only rounding has left
FITTED = 4e-15
#: what a joint transmits (`joint_transmitted`)
FORCE, MOMENT, ACROSS = range(3)
#: slopes of Phi, by row, that are the same wherever the bodies are: columns of either body
STEADY = {REVOLUTE: ((0, 1), (0, 1)), PRISMATIC: ((), ()), FIXED: ((0, 1), (0, 1), (0, 1, 2)), DISTANCE: ((),)}


def parameters(joint: Joint, home: FloatArray, first: int, second: int) -> list[float]:
    """The parameter row (WIDTH,) of a joint between two bodies at home (n_body, HOME)."""
    row = [*joint.at_first, *joint.at_second] + [0.0] * (WIDTH - 4)
    x, y = apart_at_home(home, first, second, joint.at_first, joint.at_second)
    if isinstance(joint, PrismaticJoint):
        row[4], row[5] = -joint.axis[1], joint.axis[0]
        c, s = home[first, HOME_COS:].tolist()
        row[8] = (c * row[4] - s * row[5]) * x + (s * row[4] + c * row[5]) * y
    elif isinstance(joint, DistanceJoint):
        row[7] = joint.length
        length = math.hypot(x, y)
        off = (length - joint.length) * (length + joint.length)
        row[8] = off if abs(length - joint.length) > FITTED * _size(home, first, second, joint) else 0.0
    else:
        row[8], row[9] = x, y
    return row


def apart_at_home(home: FloatArray, first: int, second: int, at_first: Pair, at_second: Pair) -> list[float]:
    """The vector between a point of each of two bodies at home, m; what only rounding has left of it is zero."""
    ends, size = [], 0.0
    for body, (x, y) in ((first, at_first), (second, at_second)):
        c, s = home[body, HOME_COS:].tolist()
        ends.append((home[body, HOME_X] + c * x - s * y, home[body, HOME_Y] + s * x + c * y))
        size += abs(x) + abs(y) + abs(home[body, HOME_X]) + abs(home[body, HOME_Y])
    apart = [float(two - one) for one, two in zip(*ends, strict=True)]
    return [value if abs(value) > FITTED * size else 0.0 for value in apart]


def _size(home: FloatArray, first: int, second: int, joint: Joint) -> float:
    """What rounding of the ends of a joint is measured against, m."""
    places = float(np.abs(home[[first, second], :HOME_ANGLE]).sum())
    return places + sum(abs(value) for value in (*joint.at_first, *joint.at_second))


def describe(joint: Joint) -> str:
    """A joint in words."""
    name = f"{joint.name} " if not joint.name.isdigit() else f"joints[{joint.index}] "
    return f"joint {name}({joint.type}, between {joint.bodies[0]} and {joint.bodies[1]})"


@part
def joint_rows(code, par, w, phi, jac):  # type: ignore[no-untyped-def]
    """phi (3,) and jac (3, 6) = Phi_q; rows that the joint has not are left as they are."""
    if code == REVOLUTE:
        revolute_rows(par, w, phi, jac)
    elif code == PRISMATIC:
        prismatic_rows(par, w, phi, jac)
    elif code == FIXED:
        fixed_rows(par, w, phi, jac)
    else:
        distance_rows(par, w, phi, jac)


@part
def joint_gamma(code, par, w, wd, gamma):  # type: ignore[no-untyped-def]
    """gamma (3,) of Phi_q a + gamma = 0."""
    if code == REVOLUTE:
        revolute_gamma(par, w, wd, gamma)
    elif code == FIXED:
        fixed_gamma(par, w, wd, gamma)
    elif code == PRISMATIC:
        prismatic_gamma(par, w, wd, gamma)
    else:
        distance_gamma(par, w, wd, gamma)


@part
def joint_velocity_slope(code, par, w, wd, out):  # type: ignore[no-untyped-def]
    """out (3, 6) = d(Phi_q v)/dq."""
    if code == REVOLUTE:
        revolute_velocity_slope(par, w, wd, out)
    elif code == FIXED:
        fixed_velocity_slope(par, w, wd, out)
    elif code == PRISMATIC:
        prismatic_velocity_slope(par, w, wd, out)
    else:
        distance_velocity_slope(par, w, wd, out)


@part
def joint_acceleration_slopes(code, par, w, wd, wdd, by_q, by_v):  # type: ignore[no-untyped-def]
    """by_q, by_v (3, 6): slopes of Phi_q a + gamma at fixed a."""
    if code == REVOLUTE:
        revolute_acceleration_slopes(par, w, wd, wdd, by_q, by_v)
    elif code == FIXED:
        fixed_acceleration_slopes(par, w, wd, wdd, by_q, by_v)
    elif code == PRISMATIC:
        prismatic_acceleration_slopes(par, w, wd, wdd, by_q, by_v)
    else:
        distance_acceleration_slopes(par, w, wd, wdd, by_q, by_v)


@part
def joint_stiffness(code, par, w, lam, k):  # type: ignore[no-untyped-def]
    """k (6, 6) += d(Phi_q^T lam)/dq."""
    if code in (REVOLUTE, FIXED):
        revolute_stiffness(par, w, lam, k)
    elif code == PRISMATIC:
        prismatic_stiffness(par, w, lam, k)
    else:
        distance_stiffness(par, w, lam, k)


@kernel
def joint_reaction(code, rows, par, w, lam, out):  # type: ignore[no-untyped-def]
    """out (3,) = Fx, Fy, M on the first body at its joint point, global axes: -Phi_q^T lam, moved there."""
    phi = np.zeros(3)
    jac = np.zeros((3, 6))
    joint_rows(code, par, w, phi, jac)
    px, py, _, _ = arms(par, w)
    for i in range(3):
        out[i] = 0.0
        for r in range(rows):
            out[i] -= jac[r, i] * lam[r]
    out[2] -= px * out[1] - py * out[0]


@kernel
def joint_transmitted(code, par, w, lam, which, by_lam, by_q):  # type: ignore[no-untyped-def]
    """Norm of the force (which FORCE) or the moment (MOMENT) that a joint transmits, at the first body's joint point.

    Out: its slopes by_lam (3,), by_q (6,); zero where the norm is. ACROSS: the norm of the force, with the slopes of
    the component perpendicular to it, a quarter turn ahead, in global axes; zero where the force has one direction.
    """
    by_lam[:] = 0.0
    by_q[:] = 0.0
    if which != MOMENT:
        if code in (REVOLUTE, FIXED):
            size = math.hypot(lam[0], lam[1])
            if size > 0.0 and which == FORCE:
                by_lam[0] = lam[0] / size
                by_lam[1] = lam[1] / size
            elif size > 0.0:
                by_lam[0] = -lam[1] / size
                by_lam[1] = lam[0] / size
            return size
        if which == FORCE:
            by_lam[0] = np.sign(lam[0])
        return abs(lam[0])
    if code == FIXED:
        by_lam[2] = np.sign(lam[2])
        return abs(lam[2])
    if code == PRISMATIC:
        moment = prismatic_moment(par, w, lam, by_lam, by_q)
        sign = np.sign(moment)
        for i in range(3):
            by_lam[i] *= sign
        for i in range(6):
            by_q[i] *= sign
        return abs(moment)
    return 0.0
