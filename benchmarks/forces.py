"""What single members carry in a motion, from their laws written out once more: an engineer's check of a design."""

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case, simulate
from mdstopo.case.model import GROUND, ActuatorLaw, CrushLaw, GapLaw, SpringLaw
from mdstopo.case.objects.parts import MemberGroup
from mdstopo.integrators.trajectory import Trajectory

Floats = NDArray[np.float64]
#: a motion, or None: it is simulated
Motion = Trajectory | None

#: places in time
PLACES = 4000


def whole_forces(case: Case, alpha: Floats, group: MemberGroup, load_case: str, motion: Motion = None) -> Floats:
    """The largest |f| (M,) in N that each member of a group would carry in this motion if it were whole.

    motion: that of the design, if it is known. Raises ValueError for a law that is not written out here.
    """
    times, x, rate = _elongations(case, group, motion or simulate(case, alpha, load_case))
    total = np.zeros_like(x)
    for law in group.laws:
        until = np.inf if law.active_until is None else law.active_until
        acts = (times >= (-np.inf if law.active_from is None else law.active_from)) & (times < until)
        free = getattr(law, "free_length", None)
        beyond = x if free is None else x + (group.length - free)
        total += np.where(acts[:, None], _force(law, beyond, rate), 0.0)
    return np.asarray(np.abs(total).max(axis=0))


def strokes(case: Case, alpha: Floats, group: MemberGroup, load_case: str, motion: Motion = None) -> Floats:
    """By how much each member (M,) of a group becomes shorter or longer in this motion, at most, in m.

    motion: that of the design, if it is known.
    """
    motion = motion or simulate(case, alpha, load_case)
    return np.asarray(np.abs(_elongations(case, group, motion)[1]).max(axis=0))


def _elongations(case: Case, group: MemberGroup, motion: Trajectory) -> tuple[Floats, Floats, Floats]:
    """Times (T,), elongations and their rates (T, M)."""
    times = np.linspace(motion.t[0], motion.t[-1], PLACES)
    states = motion.at(times)
    p, vp = _points(case, group.body_from, group.from_local[group.from_index], states.q, states.v)
    q, vq = _points(case, group.body_to, group.to_local[group.to_index], states.q, states.v)
    r, length = q - p, np.linalg.norm(q - p, axis=2)
    return times, length - group.length, ((vq - vp) * r).sum(axis=2) / length


def _points(case: Case, body: str, local: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Places and velocities (T, M, 2), in space (T, M, 3), of points on a body."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape)), np.zeros((len(q), *local.shape))
    k = [each.name for each in case.bodies].index(body)
    if case.dimension == 3:
        return _spatial_points(local, q[:, 7 * k : 7 * k + 7], v[:, 6 * k : 6 * k + 6])
    q, v = q[:, 3 * k : 3 * k + 3], v[:, 3 * k : 3 * k + 3]
    c, s = np.cos(q[:, 2])[:, None], np.sin(q[:, 2])[:, None]
    arm = np.stack([c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1]], axis=2)
    turned = np.stack([-arm[..., 1], arm[..., 0]], axis=2) * v[:, None, 2:]
    return q[:, None, :2] + arm, v[:, None, :2] + turned


def _spatial_points(local: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Places and velocities (T, M, 3) of points of one body with q (T, 7) and v (T, 6).

    The arm turned by the quaternion (w, u) is r + 2 w (u x r) + 2 u x (u x r).
    """
    w, u = q[:, None, 3:4], np.broadcast_to(q[:, None, 4:], (len(q), *local.shape))
    once = 2.0 * np.cross(u, local[None])
    arm = local + w * once + np.cross(u, once)
    turn = np.broadcast_to(v[:, None, 3:], arm.shape)
    return q[:, None, :3] + arm, v[:, None, :3] + np.cross(turn, arm)


def _force(law: object, x: Floats, rate: Floats) -> Floats:
    if isinstance(law, SpringLaw):
        return law.stiffness * x + law.damping * rate + law.preload
    if isinstance(law, ActuatorLaw):
        force = law.proportional * (x - law.target) + law.derivative * rate
        return force if law.limit is None else np.clip(force, -law.limit, law.limit)
    if isinstance(law, GapLaw):
        sign = 1.0 if law.side == "tension" else -1.0
        force = law.stiffness * (sign * x - law.gap) + law.damping * sign * rate
        force = np.maximum(force, 0.0) if law.clip else force
        return np.where(sign * x >= law.gap, force, 0.0)
    if isinstance(law, CrushLaw):
        sign = 1.0 if law.side == "tension" else -1.0
        beyond = sign * x - law.gap - law.force / law.stiffness
        crushed = np.maximum.accumulate(np.maximum(beyond, 0.0), axis=0)
        return np.clip(law.stiffness * (sign * x - law.gap - crushed), 0.0, law.force)
    raise ValueError(f"no force is written out for {type(law).__name__}")
