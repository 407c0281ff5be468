"""The joints: by code in kernels, by record in Python. All of it follows from `JointKernels` of each joint.

w (PLACES,): where the first and the second body are (`revolute.place_joint`); wd, wdd (6,): their time
derivatives. The equations of motion are
M a + Phi_q^T lam = F, so the force of a joint on its first body is -Phi_q^T lam. Codes follow the order of
`case.joints.JOINTS`; the branches by code are made by `compiler.choice_by_code`.
"""

import importlib
import math

import numpy as np

from mdstopo.case.joints import JOINTS, Joint
from mdstopo.case.model import Pair
from mdstopo.compiler import store
from mdstopo.compiler.choice_by_code import Listed, chosen
from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.joints.joint_kernels import FITTED, AtHome, JointKernels
from mdstopo.mechanics.joints.revolute import arms
from mdstopo.mechanics.kinematics.kinematics_interface import ACROSS_FORCE, FORCE, MOMENT
from mdstopo.scene.springs_model import HOME_ANGLE, HOME_COS, HOME_X, HOME_Y, FloatArray

WIDTH = 12

LISTED: Listed[JointKernels] = Listed()
#: of the joints that are known so far, by their word
CODES: dict[str, int] = {}


def kernels_of(joint: type[Joint]) -> JointKernels:
    """The kernels of a joint, from the module that its record names."""
    if joint.type not in CODES:
        enter(joint)
        store.include(joint.kernels)
    return LISTED[CODES[joint.type]]


def code_of(joint: type[Joint]) -> int:
    """The code by which kernels know a joint."""
    kernels_of(joint)
    return CODES[joint.type]


def enter(joint: type[Joint]) -> None:
    """Give a joint a code and add its kernels to the table."""
    CODES[joint.type] = LISTED.add(importlib.import_module(joint.kernels).KERNELS)


for _joint in JOINTS.values():
    if _joint.kernels.startswith("mdstopo."):
        enter(_joint)
LISTED.is_filled = True


def parameters(joint: Joint, home: FloatArray, first: int, second: int) -> list[float]:
    """The parameter row (WIDTH,) of a joint between two bodies at home (n_body, HOME)."""
    row = [*joint.at_first, *joint.at_second] + [0.0] * (WIDTH - 4)
    x, y = apart_at_home(home, first, second, joint.at_first, joint.at_second)
    at_home = kernels_of(type(joint)).at_home
    own = joint.row()
    if at_home is not None:
        c, s = home[first, HOME_COS:].tolist()
        own |= at_home(joint, AtHome(x, y, c, s, _size(home, first, second, joint)))
    for place, value in own.items():
        row[place] = value
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
    """A joint in words: its name, type and bodies."""
    name = f"{joint.name} " if not joint.name.isdigit() else f"joints[{joint.index}] "
    return f"joint {name}({joint.type}, between {joint.bodies[0]} and {joint.bodies[1]})"


@chosen(LISTED, lambda each: each.rows, part)
def _row_count(code):
    return 0


@chosen(LISTED, lambda each: each.phi, part)
def joint_rows(code, par, w, phi, jac):
    """phi (3,) and jac (3, 6) = Phi_q; rows that the joint has not are left as they are."""


@chosen(LISTED, lambda each: each.gamma, part)
def joint_gamma(code, par, w, wd, gamma):
    """gamma (3,) of Phi_q a + gamma = 0: what velocities add to the second derivative of Phi."""
    for r in range(_row_count(code)):
        gamma[r] = 0.0


@chosen(LISTED, lambda each: each.velocity_slope, part)
def joint_velocity_slope(code, par, w, wd, out):
    """Slopes of the rate of Phi by coordinates: out (3, 6) = d(Phi_q v)/dq."""
    for r in range(_row_count(code)):
        for i in range(6):
            out[r, i] = 0.0


@chosen(LISTED, lambda each: each.acceleration_slopes, part)
def joint_acceleration_slopes(code, par, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a; zero for a joint whose rows are linear.

    In:
      code: of the joint.
      par (WIDTH,): its parameters.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    Out:
      by_q (3, 6): d(Phi_q a + gamma)/dq, in the rows that the joint has.
      by_v (3, 6): d(gamma)/dv, in the rows that the joint has.
    """
    for r in range(_row_count(code)):
        for i in range(6):
            by_q[r, i] = 0.0
            by_v[r, i] = 0.0


@chosen(LISTED, lambda each: each.stiffness, part)
def joint_stiffness(code, par, w, lam, k):
    """Add the slopes of a joint's forces, d(Phi_q^T lam)/dq, to k (6, 6)."""


@chosen(LISTED, lambda each: each.is_point or None, part)
def joint_is_point(code):
    """Whether a joint's rows are those of the revolute one, and linear ones behind them."""
    return False


@chosen(LISTED, lambda each: each.force_rows or None, part)
def joint_force_rows(code):
    """Of how many of the first rows the multipliers are components of the force that is transmitted."""
    return 0


@chosen(LISTED, lambda each: each.moment, part)
def _moment(code, par, w, lam, by_lam, by_q):
    """The moment that a joint transmits (N m), at the first body's joint point; 0 for a joint that transmits none.

    In:
      code: of the joint.
      par (WIDTH,): its parameters.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      lam (3,): multipliers (N, N m).
    Out:
      by_lam (3,), by_q (6,): slopes of the moment; zero before.
    """
    return 0.0


@kernel
def joint_reaction(code, rows, par, w, lam, out):
    """Force and moment of a joint on its first body at its joint point, global axes: -Phi_q^T lam, moved there.

    In:
      code: of the joint.
      rows: how many it has.
      par (WIDTH,): its parameters.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      lam (3,): multipliers (N, N m).
    Out:
      out (3,): F_x, F_y (N), M (N m).
    """
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
def joint_transmitted(code, par, w, lam, which, by_lam, by_q):
    """Norm of the force or of the moment that a joint transmits, at the first body's joint point (N or N m).

    In:
      code: of the joint.
      par (WIDTH,): its parameters.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      lam (3,): multipliers (N, N m).
      which: FORCE or MOMENT; ACROSS_FORCE: the norm of the force, with the slopes of the component perpendicular to
        it, a quarter turn ahead, in global axes; these are zero where the force has one direction.
    Out:
      by_lam (3,), by_q (6,): slopes; zero where the norm is zero.
    """
    by_lam[:] = 0.0
    by_q[:] = 0.0
    if which == MOMENT:
        moment = _moment(code, par, w, lam, by_lam, by_q)
        sign = np.sign(moment)
        for i in range(3):
            by_lam[i] *= sign
        for i in range(6):
            by_q[i] *= sign
        return abs(moment)
    rows = joint_force_rows(code)
    if rows == 0:
        return 0.0
    if rows == 1:
        if which == FORCE:
            by_lam[0] = np.sign(lam[0])
        return abs(lam[0])
    size = math.hypot(lam[0], lam[1])
    if size > 0.0 and which == FORCE:
        by_lam[0] = lam[0] / size
        by_lam[1] = lam[1] / size
    elif size > 0.0 and which == ACROSS_FORCE:
        by_lam[0] = -lam[1] / size
        by_lam[1] = lam[0] / size
    return size
