"""What Python asks of displacements that count from where a scene has settled (`since_settled`)."""

import numpy as np

from mdstopo.compiler.jit import entry, part
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.events.permanent_sets import count_sets
from mdstopo.general.model.general_model import BODY, unpack_general
from mdstopo.general.model.strides import dimensions, first_freedom
from mdstopo.general.responses.general_responses import motion_component
from mdstopo.general.sensitivity.adjoint import integral_cotangents
from mdstopo.general.steps.step_history import FIRST, carve_history
from mdstopo.mechanics.kinematics.components import Z


@part
def _fill_components(model, j, q, none, bars, u, slopes):
    """The displacement that response j measures, less what it counts from, along the observer's axes.

    Constant:
      model: the compiled scene.
    In:
      j: the response.
      q (n_q,): coordinates.
      none (n,): zeros.
    Out:
      bars (3, n): scratch.
      u (D - T,): the displacement (m).
      slopes (D - T, n): by the freedoms at q.
    """
    for axis in range(dimensions(model)):
        bars[:] = 0.0
        u[axis] = motion_component(model, j, axis if axis < 2 else Z, q, none, none, bars)
        for d in range(slopes.shape[1]):
            slopes[axis, d] = bars[0, d]


@entry
def components(ints, floats, j, q, u, slopes):
    """The displacement that response j measures, less what it counts from, along the observer's axes.

    Constant:
      ints, floats: the packed scene (`pack_general`).
    In:
      j: the response.
      q (n_q,): coordinates.
    Out:
      u (D - T,): the displacement (m).
      slopes (D - T, n): by the freedoms at q.
    """
    model = unpack_general(ints, floats)
    n = model.mass.shape[0]
    _fill_components(model, j, q, np.zeros(n), np.empty((3, n)), u, slopes)


@entry
def integral_by_place(
    tag, ints, floats, tables, limits, count, j, integral, room, room_ints, member_state, padded, out, work
):
    """The derivative of an integral over time of a displacement by what the displacement counts from.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      j: the response.
      integral: 1 for the integral of the response, 2 for that of its square.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      padded (M_padded + P,): scratch.
      out (D - T,): the derivative, along the observer's axes.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    n = model.mass.shape[0]
    stages = history.index[count, FIRST]
    bars = np.zeros((stages, 3, n))
    rows_bar = np.zeros((stages, model.size[0]))
    sets_bar = np.zeros((stages, count_sets(model)))
    integral_cotangents(
        tag, model, tables, member_state, history, count, j, integral == 2, bars, rows_bar, sets_bar,
        np.empty(0), make_workspace(model), padded, work,
    )  # fmt: skip
    none = np.zeros(n)
    own = np.empty((3, n))
    u = np.empty(dimensions(model))
    slopes = np.empty((dimensions(model), n))
    first = first_freedom(model, model.response[j, BODY])
    out[:] = 0.0
    for i in range(stages):
        # shifting the body along an axis of the observer adds to that component alone
        _fill_components(model, j, history.stage_q[i], none, own, u, slopes)
        for axis in range(dimensions(model)):
            for d in range(first, first + dimensions(model)):
                out[axis] -= slopes[axis, d] * bars[i, 0, d]
