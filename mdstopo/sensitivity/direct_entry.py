"""Compiled entries of the direct method, one an integrator: they differentiate what `evaluate` left in room."""

import mdstopo.integrators.gauss_linear
import mdstopo.integrators.generalized_alpha_linear  # noqa: F401  (both enter the contract's table)
from mdstopo.integrators.gauss import GaussSteps
from mdstopo.integrators.generalized_alpha import AlphaSteps
from mdstopo.integrators.steps import carve
from mdstopo.jit import entry
from mdstopo.scene.packing import unpack
from mdstopo.sensitivity.direct import direct_rows


@entry
def gauss(
    ints, floats, tables, alpha, damped, limits, count, reductions, room, room_ints, strength, rows, found, gradients,
    history, work,
):  # type: ignore[no-untyped-def]
    """Gradients of the rows found by `gauss_entry.evaluate` with the same arguments; count: the steps it took.

    Out: gradients (n_obj, R, N), history (count + 1, N) or (0, N), see `direct.direct_rows`.
    """
    model = unpack(ints, floats)
    n_pair = model.pair.shape[0]
    turning = model.load_body.shape[0] > 0
    steps = GaussSteps(*carve(room, room_ints, model.q0.shape[0], n_pair, limits[1], limits[2], damped, turning))
    direct_rows(
        model, tables, strength, alpha, steps, count, damped, reductions, rows, found, gradients, history, work
    )


@entry
def generalized_alpha(
    ints, floats, tables, alpha, damped, limits, count, reductions, room, room_ints, strength, rows, found, gradients,
    history, work,
):  # type: ignore[no-untyped-def]
    """The same for `generalized_alpha_entry.evaluate`."""
    model = unpack(ints, floats)
    n_pair = model.pair.shape[0]
    turning = model.load_body.shape[0] > 0
    steps = AlphaSteps(*carve(room, room_ints, model.q0.shape[0], n_pair, limits[1], limits[2], damped, turning))
    direct_rows(
        model, tables, strength, alpha, steps, count, damped, reductions, rows, found, gradients, history, work
    )
