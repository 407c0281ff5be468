"""Compiled entry of the iterative method: it differentiates what `generalized_alpha_entry.evaluate` left in room."""

import mdstopo.integrators.generalized_alpha_linear  # noqa: F401  (enters the contract's table)
from mdstopo.integrators.generalized_alpha import AlphaSteps
from mdstopo.integrators.steps import carve
from mdstopo.jit import entry
from mdstopo.scene.packing import unpack
from mdstopo.sensitivity.iterative import iterative_rows


@entry
def generalized_alpha(
    ints, floats, tables, alpha, damped, limits, count, reductions, room, room_ints, strength, rows, found, gradients,
    work,
):  # type: ignore[no-untyped-def]
    """Gradients (n_obj, R, N) of the rows found with the same arguments; count: the steps that were taken.

    Returns -1, or the step at which the sweeps do not contract: then `direct_entry.generalized_alpha` is to be taken.
    """
    model = unpack(ints, floats)
    n_pair = model.pair.shape[0]
    turning = model.load_body.shape[0] > 0
    steps = AlphaSteps(*carve(room, room_ints, model.q0.shape[0], n_pair, limits[1], limits[2], damped, turning))
    return iterative_rows(
        model, tables, strength, alpha, steps, count, damped, reductions, rows, found, gradients, work
    )
