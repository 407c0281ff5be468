"""What Python calls for integrals over time and their gradients, by the adjoint sweep; rows: `row_sweep`."""

from mdstopo.compiler.jit import entry
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.dynamics.members import unscale_general
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.sensitivity.adjoint import integral_gradient
from mdstopo.general.steps.step_history import carve_history


@entry
def integral_with_gradient(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    j,
    integral,
    gradient,
    room,
    room_ints,
    member_state,
    padded,
    out,
    start,
    work,
):
    """Integrate response j over time and, on demand, differentiate the integral by the design (adjoint).

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      count: number of steps.
      j: the response.
      integral: 1 for the integral of the response, 2 for that of its square.
      gradient: whether the derivatives are wanted.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      out (N + P,): derivatives by alpha, then by the values of the laws' variables; untouched without `gradient`.
      start (n,): what the integral pulls on the start's positions (cotangents); or no length: not wanted.
      padded (M_padded + P,): derivatives by alpha^mu and values.
      work (WORK,): counts of work, added to.

    Returns the integral.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    total = integral_gradient(
        tag, model, tables, member_state, history, count, j, integral == 2, gradient, workspace, start, padded, work
    )
    if gradient:
        unscale_general(model.block, model.power, alpha, padded, out)
    return total
