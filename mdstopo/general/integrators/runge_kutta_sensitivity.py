"""The interface functions of Runge-Kutta methods: partial steps, reverse and tangent steps, weights."""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.integrators.runge_kutta import TAG
from mdstopo.general.integrators.runge_kutta_step import advance
from mdstopo.general.steps.method_interface import implement, scheme
from mdstopo.general.steps.run_start import method_number, scene_size
from mdstopo.general.steps.step_history import EVENTS, FIRST, PARENT, SEGMENT, keep_state, restore_modes
from mdstopo.general.steps.step_inside import table_of_step
from mdstopo.general.steps.step_linear import changes_forward, steps_back
from mdstopo.integrators.springs_runge_kutta import MOST_STAGES
from mdstopo.integrators.steps import OF_POINTS
from mdstopo.mechanics.kinematics.kinematics_interface import advance_coordinates


@kernel
def point_of(tag, model, tables, member_state, history, count, k, c, keep, workspace, q, v, work):
    """The end of a step of length c h from the same start; see `method_interface.point_of`.

    With `keep` this partial step is number count + 1, which is returned.
    """
    n = v.shape[0]
    n_q = q.shape[0]
    method = method_number(model)
    s = scheme(tag, method)[0]
    h = c * (history.t[k + 1] - history.t[k])
    o = history.index[count, FIRST]
    push = np.empty((2, model.size[0]))
    restore_modes(history, history.index[k, EVENTS], member_state)
    advance(
        tag, model, tables[method], s, member_state, history.index[k, SEGMENT], history.t[k], h, history.q[k],
        history.v[k], keep, o if keep else np.int64(-1), workspace, np.empty(model.size[0]),
        np.empty((MOST_STAGES, n_q)), np.empty((MOST_STAGES, n)), np.empty((MOST_STAGES, n)), history, q, v,
        push, scene_size(model), work,
    )  # fmt: skip
    work[OF_POINTS] += s
    if not keep:
        return k
    w = count + 1
    history.t[w] = history.t[k]
    history.index[w, FIRST] = o
    history.index[w, PARENT] = k - 1
    history.index[w, SEGMENT] = history.index[k, SEGMENT]
    history.index[w, EVENTS] = history.index[k, EVENTS]
    keep_state(history, w + 1, history.t[k] + h, q, v, push[0], push[1])
    history.index[w + 1, FIRST] = o + s
    return w


@kernel
def step_back(tag, model, tables, history, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, workspace, work):
    """Pull cotangents back through a step, its last stage first; see `method_interface.step_back`.

    Not used: c (a point inside a step is the end of a partial one), lam_x (nothing else is carried from step to step).
    """
    steps_back(tag, model, tables, history, w, bars, rows_bar, lam_q, lam_v, z, y, workspace, work)


@kernel
def step_forward(tag, model, tables, history, w, c, iterations, dq, dv, dx, force, changes, rows, workspace):
    """Push changes at the start of a step through its stages to its end; see `method_interface.step_forward`.
    Returns True.

    Not used: c, iterations, dx: partial steps are steps of their own, no stage is implicit, nothing else is carried.
    """
    changes_forward(tag, model, tables, history, w, dq, dv, force, changes, rows, workspace)
    return True


@kernel
def carried(tag):
    """A step takes nothing over but the state."""
    return 0


@kernel
def state_at_offset(tag, model, history, k, c, e, q, v, a, q_out, v_out):
    """The state a little later, on a parabola with the accelerations at c; see `method_interface.state_at_offset`.

    Not used: history, k, c.
    """
    advance_coordinates(model, q, v, a, e, q_out)
    for d in range(v.shape[0]):
        v_out[d] = v[d] + e * a[d]


@kernel
def derivatives(tag):
    """How many derivatives of the motion are exact: velocities and accelerations."""
    return 2


@kernel
def is_continuous(tag):
    """Whether the state inside a step costs no forces: no, a partial step has all its stages."""
    return False


@kernel
def ends_in_stage(tag):
    """Whether the last stage of a step is its end: that of the explicit methods is not, and of the implicit ones it is
    so to Newton's tolerance only."""
    return False


@kernel
def weights_of(tag, model, tables, history, w, out):
    """Weights of the stages in an integral: those of a velocity; see `method_interface.weights_of`."""
    table, stages = table_of_step(tag, model, tables, history, w)
    for j in range(stages):
        out[j] = (history.t[w + 1] - history.t[w]) * table[2, 2, j]


#: what all Runge-Kutta methods have in common
COMMON: dict[str, Any] = {
    "point_of": point_of,
    "step_back": step_back,
    "step_forward": step_forward,
    "state_at_offset": state_at_offset,
    "carried": carried,
    "derivatives": derivatives,
    "is_continuous": is_continuous,
    "ends_in_stage": ends_in_stage,
    "weights_of": weights_of,
}
implement(TAG, **COMMON)
