"""Prescribed motions of bodies in a plane: each driven coordinate is a cubic of time within a segment."""

from mdstopo.compiler.jit import kernel


@kernel
def drive_state(model, segment, t, q, v):
    """The driven part of a state; see `kinematics_interface.drive_state`."""
    tau = t - model.times[segment]
    for i in range(model.driven.shape[0]):
        d = model.driven[i]
        c = model.drive[segment, i]
        q[d] = c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]))
        v[d] = c[1] + tau * (2.0 * c[2] + 3.0 * tau * c[3])


@kernel
def drive_acceleration(model, segment, t, a):
    """The driven accelerations; see `kinematics_interface.drive_acceleration`."""
    tau = t - model.times[segment]
    for i in range(model.driven.shape[0]):
        c = model.drive[segment, i]
        a[model.driven[i]] = 2.0 * c[2] + 6.0 * tau * c[3]
