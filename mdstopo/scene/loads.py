"""Applied loads as arrays: generalised forces by coordinate, and apart from them those that turn with their body."""

from typing import NamedTuple

import numpy as np

from mdstopo.case.model import GROUND, Load, LoadCase
from mdstopo.scene.signal_segments import segment_values
from mdstopo.scene.springs_model import FloatArray, IndexArray


class Loads(NamedTuple):
    """The fields of a model that hold loads, with their meaning there (`scene.springs_model.Model`)."""

    force: FloatArray
    load_body: IndexArray
    load_follows: IndexArray
    load_arm: FloatArray
    load_force: FloatArray


def generalised_loads(load_case: LoadCase, index: dict[str, int], times: FloatArray, keep: bool = False) -> Loads:
    """The loads of a load case within segments of time, with gravity.

    index: place of each body in the state, of all that the state has. times (n_seg + 1,): ends of the segments (s).
    keep: whether a load at a point that is zero, or at the centre, is kept as one that turns, as others of it are not.
    """
    force = np.zeros((len(times) - 1, 3 * len(index), 2))
    for i, body in enumerate(load_case.bodies):
        force[:, 3 * i, 0] += body.mass * load_case.gravity[0]
        force[:, 3 * i + 1, 0] += body.mass * load_case.gravity[1]
    turning: list[Load] = []
    for load in load_case.loads:
        if load.body == GROUND:
            continue
        b = 3 * index[load.body]
        force[:, b + 2] += segment_values(load.moment, times)
        if load.frame == "global" and tuple(load.at_local) == (0.0, 0.0) and not keep:
            force[:, b] += segment_values(load.force[0], times)
            force[:, b + 1] += segment_values(load.force[1], times)
        elif keep or any(np.any(segment_values(component, times)) for component in load.force):
            turning.append(load)
    load_force = np.zeros((len(times) - 1, len(turning), 2, 2))
    for k, load in enumerate(turning):
        load_force[:, k, 0] = segment_values(load.force[0], times)
        load_force[:, k, 1] = segment_values(load.force[1], times)
    return Loads(
        force,
        np.array([index[load.body] for load in turning], dtype=np.int64),
        np.array([load.frame == "body" for load in turning], dtype=np.int64),
        np.array([load.at_local for load in turning], dtype=np.float64).reshape(-1, 2),
        load_force,
    )
