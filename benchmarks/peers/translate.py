"""A case of mdstopo as the plain arrays that the other programs are given."""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.peers.problem import GROUND, Floats, Problem
from benchmarks.peers.space_problem import SpatialProblem
from mdstopo.case.joints.joints_in_space import SphericalJoint
from mdstopo.case.model import Case, Joint, RevoluteJoint, SpringLaw


class NotForPeersError(ValueError):
    """The peers were not written for what a case has; the message says what they are written for."""


def problem_of(case: Case) -> Problem:
    """The case, whose objective must be one energy. Raises NotForPeersError."""
    _refuse(case)
    (load_case,) = case.load_cases
    order = {"ground": GROUND} | {body.name: k for k, body in enumerate(case.bodies)}
    springs = [_spring(group.laws) for group in case.members]
    mass = np.array([[body.mass, body.mass, body.inertia] for body in case.bodies])
    force = np.zeros_like(mass)
    force[:, :2] = mass[:, :2] * np.array(load_case.gravity)
    for load in load_case.loads:
        if load.at_local != (0.0, 0.0) or load.frame != "global":
            raise NotForPeersError("only forces at the centre of mass, in global axes")
        force[order[load.body]] += np.array([*map(_constant, load.force), _constant(load.moment)])
    return Problem(
        mass=mass,
        start=np.array([[*body.position, body.angle] for body in case.bodies]),
        force=force,
        groups=np.array([[order[group.body_from], order[group.body_to]] for group in case.members]),
        first=np.concatenate([[0], np.cumsum([len(group) for group in case.members])]),
        p=np.concatenate([group.p_local for group in case.members]),
        q=np.concatenate([group.q_local for group in case.members]),
        length=np.concatenate([group.length for group in case.members]),
        stiffness=np.repeat([law.stiffness for law in springs], [len(group) for group in case.members]),
        hinges=np.array([[order[name] for name in each.bodies] for each in case.joints], dtype=np.intp).reshape(-1, 2),
        at=np.array([[joint.at_first, joint.at_second] for joint in case.joints]).reshape(-1, 2, 2),
        end=load_case.end,
        peak=case.objectives[0].over_time == "max",
    )


def spatial_problem_of(case: Case) -> SpatialProblem:
    """The same for a case in space, whose joints are spherical."""
    _refuse(case, SphericalJoint)
    (load_case,) = case.load_cases
    order = {"ground": GROUND} | {body.name: k for k, body in enumerate(case.bodies)}
    springs = [_spring(group.laws) for group in case.members]
    mass = np.array([body.mass for body in case.bodies])
    force = np.zeros((len(mass), 6))
    force[:, :3] = mass[:, None] * np.array(load_case.gravity)
    for load in load_case.loads:
        if any(load.at_local) or load.frame != "global":
            raise NotForPeersError("only forces at the centre of mass, in global axes")
        force[order[load.body]] += np.array([*map(_constant, load.force), *map(_constant, load.moment)])
    return SpatialProblem(
        mass=mass,
        start=np.array([body.position for body in case.bodies]),
        force=force,
        groups=np.array([[order[group.body_from], order[group.body_to]] for group in case.members]),
        first=np.concatenate([[0], np.cumsum([len(group) for group in case.members])]),
        p=np.concatenate([group.p_local for group in case.members]),
        q=np.concatenate([group.q_local for group in case.members]),
        length=np.concatenate([group.length for group in case.members]),
        stiffness=np.repeat([law.stiffness for law in springs], [len(group) for group in case.members]),
        hinges=np.array([[order[name] for name in each.bodies] for each in case.joints], dtype=np.intp).reshape(-1, 2),
        at=np.array([[joint.at_first, joint.at_second] for joint in case.joints]).reshape(-1, 2, 3),
        end=load_case.end,
        peak=case.objectives[0].over_time == "max",
        inertia=np.array([body.inertia for body in case.bodies]),
        turn=np.array([quaternion(body.rotation) for body in case.bodies]),
    )


def _refuse(case: Case, joints: type[Joint] = RevoluteJoint) -> None:
    if len(case.objectives) != 1 or len(case.load_cases) != 1:
        raise NotForPeersError("only one objective in one load case")
    (objective,), (load_case,) = case.objectives, case.load_cases
    if objective.over_time not in ("max", "final") or objective.response.kind != "energy":
        raise NotForPeersError("only the energy, its maximum or the last")
    if not all(isinstance(joint, joints) for joint in case.joints):
        raise NotForPeersError(f"only {joints.type} joints")
    if case.bushings or case.contacts or load_case.motions or load_case.start != 0.0:
        raise NotForPeersError("no bushings, contacts, motions, and a start at 0")
    if any(any(body.velocity) or np.any(body.angular_velocity) for body in case.bodies):
        raise NotForPeersError("only bodies at rest")
    if case.variables or any(not group.design or group.power != 1.0 for group in case.members):
        raise NotForPeersError("only members that are designed, with a power of 1")


def quaternion(matrix: Floats) -> Floats:
    """w, x, y, z of a rotation matrix."""
    found: Floats = np.roll(Rotation.from_matrix(matrix).as_quat(), 1)
    return found


def _spring(laws: object) -> SpringLaw:
    match laws:
        case (SpringLaw(damping=0.0, preload=0.0, free_length=None) as law,) if law.active_from is None:
            return law
    raise NotForPeersError("only undamped springs")


def _constant(value: object) -> float:
    if not isinstance(value, float | int):
        raise NotForPeersError("only constant loads")
    return float(value)
