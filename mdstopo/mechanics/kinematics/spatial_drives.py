"""Prescribed motions of centres of mass in space: each driven coordinate is a cubic of time within a segment."""

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS


@kernel
def drive_state(model, segment, t, q, v):
    """The driven part of a state; see `kinematics_interface.drive_state`."""
    tau = t - model.times[segment]
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        c = model.drive[segment, i]
        q[COORDINATES * (d // FREEDOMS) + d % FREEDOMS] = c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]))
        v[d] = c[1] + tau * (2.0 * c[2] + 3.0 * tau * c[3])
