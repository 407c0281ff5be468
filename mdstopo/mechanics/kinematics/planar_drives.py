"""Prescribed motions of bodies in a plane: each driven coordinate is a cubic of time within a segment, or a formula."""

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.kinematics.timed import driven_coordinate


@kernel
def drive_state(model, segment, t, q, v):
    """The driven part of a state; see `kinematics_interface.drive_state`."""
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        q[d], v[d], _ = driven_coordinate(model, segment, t, i)


@kernel
def drive_acceleration(model, segment, t, a):
    """The driven accelerations; see `kinematics_interface.drive_acceleration`."""
    for i in range(model.driven.shape[0]):
        _, _, a[model.driven[i]] = driven_coordinate(model, segment, t, i)
