"""Compiled entries of generalized-alpha: what Python calls (`driver`), with everything in few arrays.

In all of them: the packed model; tables (1,) the spectral radius; settings (tolerance, not used here; Newton
tolerance; step, see `springs_generalized_alpha.longest_step`; closeness); limits (steps allowed, room for steps,
room for stages); room, room_ints for the steps; strength (3 or more, M_padded), see `active_members`; work
counts, added to.
"""

import numpy as np

import mdstopo.integrators.springs_generalized_alpha_linear  # noqa: F401  (enters the interface's table)
from mdstopo.compiler.jit import entry
from mdstopo.integrators.springs_generalized_alpha import TAG, AlphaSteps, integrate, longest_step
from mdstopo.integrators.springs_generalized_alpha import rate_at_start as _rate_at_start
from mdstopo.integrators.steps import carve
from mdstopo.mechanics.active_members import active_members
from mdstopo.mechanics.passes import scale_members
from mdstopo.scene.packing import unpack

__all__ = ["TAG", "rate_at_start", "simulate"]


@entry
def simulate(ints, floats, tables, alpha, damped, tangent, settings, limits, room, room_ints, strength, work):
    """Integrate the motion of a design over model.times with equal steps in each segment.

    Constant:
      ints, floats: the packed model.
      tables (1,): the spectral radius.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      tangent: not used; tangents are always kept.
      settings (3 or more,): tolerance, which is not used; Newton tolerance; step (s), negative: radians of the fastest
        vibration (`springs_generalized_alpha.longest_step`).
      limits (3,): steps allowed, room for steps, room for stages.
    Out:
      room, room_ints: the steps (`steps.carve`).
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu; see `active_members` on further
        rows.
      work (WORK,): counts of work, added to.

    Returns the code, the number of steps and the time reached (s); NEEDS_ROOM asks for more room.
    """
    whole = unpack(ints, floats)
    scale_members(whole, alpha, strength)
    model, strength, _ = active_members(whole, strength, np.bool_(True))
    turning = model.load_body.shape[0] > 0
    steps = AlphaSteps(
        *carve(room, room_ints, model.q0.shape[0], model.pair.shape[0], limits[1], limits[2], damped, turning)
    )
    step = longest_step(model, strength, damped, settings[2])
    code, count = integrate(model, tables, strength, damped, settings[1], step, limits[0], steps, work)
    return code, count, steps.t[count]


@entry
def rate_at_start(ints, floats, strength, damped):
    """Angular frequency of the fastest vibration at the start, rad/s; strength (3, M_padded) as left by a run."""
    return _rate_at_start(unpack(ints, floats), strength, damped)
