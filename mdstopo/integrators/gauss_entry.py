"""Compiled entries of the Gauss method: what Python calls (`driver`), with everything in few arrays.

In all of them: the packed model; settings (tolerance, Newton tolerance, fixed step, closeness); limits (steps allowed,
room for steps, room for stages); room, room_ints for the steps; strength (3, M_padded); work counts, added to.
"""

import mdstopo.integrators.gauss_linear  # noqa: F401  (enters the method's functions in the contract's table)
from mdstopo.integrators.gauss import GaussSteps, integrate
from mdstopo.integrators.steps import carve
from mdstopo.jit import entry
from mdstopo.mechanics.assembly import scale_members
from mdstopo.scene.packing import unpack
from mdstopo.sensitivity.look import dense_states, look_at


@entry
def simulate(ints, floats, tables, alpha, damped, tangent, settings, limits, room, room_ints, strength, work):  # type: ignore[no-untyped-def]
    """Simulate alpha (N,) once; the steps stay in room, with tangents if asked. Returns (code, steps, time reached)."""
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    steps = GaussSteps(
        *carve(room, room_ints, model.q0.shape[0], model.pair.shape[0], limits[1], limits[2], damped, turning)
    )
    scale_members(model.block, model.power, model.member, alpha, strength)
    code, count = integrate(
        model, tables, strength, damped, settings[0], settings[1], settings[2], limits[0], steps, work
    )
    return code, count, steps.t[count]


@entry
def look(  # type: ignore[no-untyped-def]
    ints, floats, tables, alpha, damped, settings, limits, count, reductions, gradient, room, room_ints, strength,
    padded, rows, found, gradients, meeting, work,
):
    """Look at the steps that `simulate` left in room (`look.look_at`)."""
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    steps = GaussSteps(
        *carve(room, room_ints, model.q0.shape[0], model.pair.shape[0], limits[1], limits[2], damped, turning)
    )
    look_at(
        model, tables, strength, alpha, steps, count, damped, reductions, settings[3], gradient, padded, rows, found,
        gradients, meeting, work,
    )  # fmt: skip


@entry
def dense(ints, floats, tables, damped, limits, count, room, room_ints, strength, times, out, work):  # type: ignore[no-untyped-def]
    """q, v, a at times (T,) from the steps that `simulate` left in room: out (3, T, n)."""
    model = unpack(ints, floats)
    turning = model.load_body.shape[0] > 0
    steps = GaussSteps(
        *carve(room, room_ints, model.q0.shape[0], model.pair.shape[0], limits[1], limits[2], damped, turning)
    )
    dense_states(model, tables, strength, steps, count, damped, times, out, work)
