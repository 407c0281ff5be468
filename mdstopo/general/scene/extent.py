"""How far the bodies and points of a case reach, and how fast they move."""

import numpy as np

from mdstopo.case.model import GROUND, Case
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.bodies import distances
from mdstopo.scene.springs_model import FloatArray


def size_of(case: Case) -> float:
    """The largest distance between bodies and points, m."""
    points = [np.array([body.position for body in case.bodies])]
    points += [grid.world for grid in case.points.values()]
    points += [np.concatenate([group.from_world, group.to_world]) for group in case.members]
    cloud = np.concatenate(points)
    for joint in case.joints:
        for name, at in zip(joint.bodies, (joint.at_first, joint.at_second), strict=True):
            centre = np.zeros(len(at)) if name == GROUND else np.array(case.body(name).position)
            cloud = np.concatenate([cloud, [centre + np.array(at)]])
    low, high = cloud.min(axis=0), cloud.max(axis=0)
    size = float(distances(high - low))
    return size if size > 0.0 else 1.0


def speed_of(case: Case, v: FloatArray, kinematics: Kinematics) -> float:
    """The largest speed of a body's centre or of a point a scene's size away from it, at velocities v (n,), m/s."""
    moves, turns = kinematics.shifts_and_turns(v)
    return float((distances(moves) + size_of(case) * distances(turns)).max())
