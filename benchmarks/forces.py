"""What single members carry in a motion, from their laws written out once more: an engineer's check of a design."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mdstopo import Case, Trajectory, simulate
from mdstopo.case.model import GROUND, ActuatorLaw, CrushLaw, GapLaw, SpringLaw
from mdstopo.case.parts import MemberGroup

Floats = NDArray[np.float64]

#: places in time; motions that are kept, because all groups of a design are asked for in turn
PLACES, KEPT = 4000, 4
#: by case, design and load case; the case itself keeps its number its own
_RECENT: dict[tuple[int, bytes, str], tuple[Case, Trajectory]] = {}


def whole_forces(case: Case, alpha: Floats, group: MemberGroup, load_case: str) -> Floats:
    """The largest |f| (M,) in N that each member of a group would carry in this motion if it were whole.

    Raises ValueError for a law that is not written out here.
    """
    times, x, rate = _elongations(case, alpha, group, load_case)
    total = np.zeros_like(x)
    for law in group.laws:
        until = np.inf if law.active_until is None else law.active_until
        acts = (times >= (-np.inf if law.active_from is None else law.active_from)) & (times < until)
        free = getattr(law, "free_length", None)
        beyond = x if free is None else x + (group.length - free)
        total += np.where(acts[:, None], _force(law, beyond, rate), 0.0)
    return np.asarray(np.abs(total).max(axis=0))


def strokes(case: Case, alpha: Floats, group: MemberGroup, load_case: str) -> Floats:
    """By how much each member (M,) of a group becomes shorter or longer in this motion, at most, in m."""
    return np.asarray(np.abs(_elongations(case, alpha, group, load_case)[1]).max(axis=0))


def _elongations(case: Case, alpha: Floats, group: MemberGroup, load_case: str) -> tuple[Floats, Floats, Floats]:
    """Times (T,), elongations and their rates (T, M)."""
    motion = _motion(case, alpha, load_case)
    times = np.linspace(motion.t[0], motion.t[-1], PLACES)
    states = motion.at(times)
    points = _points if case.dimension == 2 else _points_in_space
    p, vp = points(case, group.body_from, group.from_local[group.from_index], states.q, states.v)
    q, vq = points(case, group.body_to, group.to_local[group.to_index], states.q, states.v)
    r, length = q - p, np.linalg.norm(q - p, axis=2)
    return times, length - group.length, ((vq - vp) * r).sum(axis=2) / length


def _motion(case: Case, alpha: Floats, load_case: str) -> Trajectory:
    key = id(case), alpha.tobytes(), load_case
    if key not in _RECENT:
        if len(_RECENT) >= KEPT:
            _RECENT.clear()
        _RECENT[key] = case, simulate(case, alpha, load_case)
    return _RECENT[key][1]


def _points(case: Case, body: str, local: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Places and velocities (T, M, 2) of points on a body."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape)), np.zeros((len(q), *local.shape))
    k = 3 * [each.name for each in case.bodies].index(body)
    c, s = np.cos(q[:, k + 2])[:, None], np.sin(q[:, k + 2])[:, None]
    arm = np.stack([c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1]], axis=2)
    turned = np.stack([-arm[..., 1], arm[..., 0]], axis=2) * v[:, None, k + 2 : k + 3]
    return q[:, None, k : k + 2] + arm, v[:, None, k : k + 2] + turned


def _points_in_space(case: Case, body: str, local: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Places and velocities (T, M, 3) of points on a body in space."""
    if body == GROUND:
        return np.broadcast_to(local, (len(q), *local.shape)), np.zeros((len(q), *local.shape))
    k = [each.name for each in case.bodies].index(body)
    place, turned = q[:, 7 * k : 7 * k + 3], Rotation.from_quat(np.roll(q[:, 7 * k + 3 : 7 * k + 7], -1, axis=1))
    arm = np.einsum("tij,mj->tmi", turned.as_matrix(), local)
    rate = v[:, None, 6 * k : 6 * k + 6]
    return place[:, None] + arm, rate[..., :3] + np.cross(rate[..., 3:], arm)


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
