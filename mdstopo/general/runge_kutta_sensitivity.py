"""The interface functions of Runge-Kutta methods: partial steps, reverse and tangent steps, weights."""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.adaptive_steps import advance
from mdstopo.general.method_interface import implement, scheme
from mdstopo.general.run_start import scene_size
from mdstopo.general.runge_kutta import TAG
from mdstopo.general.step_history import EVENTS, FIRST, PARENT, SEGMENT, keep_state, restore_modes
from mdstopo.general.step_inside import table_of_step
from mdstopo.general.step_linear import changes_forward, steps_back
from mdstopo.integrators.runge_kutta import MOST
from mdstopo.integrators.steps import OF_POINTS
from mdstopo.mechanics.kinematics.kinematics_interface import advance_coordinates


@kernel
def point_of(tag, model, tables, member_state, history, count, k, c, keep, workspace, q, v, work):
    """The state inside a step: the end of a step of length c h from the same start.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
    In:
      count: number of steps.
      k, c: number of the step, and the fraction of it.
      keep: whether the partial step is kept, as number count + 1, for a reverse sweep.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes become those of step k.
      history: the history of steps (`StepHistory`).
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      q (n_q,), v (n,): the state.
      work (WORK,): counts of work, added to.

    Returns the number of the step that ends there: count + 1 where it is kept; else k.
    """
    n = v.shape[0]
    n_q = q.shape[0]
    method = 1 if model.size[2] != 0 else 0
    s = scheme(tag, method)[0]
    h = c * (history.t[k + 1] - history.t[k])
    o = history.index[count, FIRST]
    push = np.empty((2, model.size[0]))
    restore_modes(history, history.index[k, EVENTS], member_state)
    advance(
        tag, model, tables[method], s, member_state, history.index[k, SEGMENT], history.t[k], h, history.q[k],
        history.v[k], keep, o if keep else np.int64(-1), workspace, np.empty(model.size[0]), np.empty((MOST, n_q)),
        np.empty((MOST, n)), np.empty((MOST, n)), history, q, v, push, scene_size(model), work,
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
    """Pull R cotangents of the end of a step back to its start.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
      history: the history of steps (`StepHistory`).
    In:
      w: number of the step.
      c: not used: a point inside a step is the end of a partial one (`point_of`).
      bars (s, 3, n), rows_bar (s, n_row): explicit cotangents of the stages' q, v, a and multipliers; no rows: none.
    In place:
      lam_q, lam_v (R, n): the cotangents of coordinates and velocities.
      lam_x: not used: nothing else is carried from step to step.
    Out:
      z (R, s or more, n): virtual displacements of the stages' balances.
      y (n_row,): scratch.
      workspace: workspace of a balance (`accelerations.Workspace`).
      work (WORK,): counts of work, added to.
    """
    steps_back(tag, model, tables, history, w, bars, rows_bar, lam_q, lam_v, z, y, workspace, work)


@kernel
def step_forward(tag, model, tables, history, w, c, sweeps, dq, dv, dx, force, changes, rows, workspace):
    """Push changes of the state at the start of a step to its end.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
      history: the history of steps (`StepHistory`).
    In:
      w: number of the step.
      c, sweeps, dx: not used: partial steps are steps of their own, no stage is implicit, nothing else is carried.
      force (s, n): changes of the forces at the stages (N, N m).
    In place:
      dq, dv (n,): changes of coordinates and velocities.
    Out:
      changes (s, 3, n), rows (s, n_row): changes of the stages' q, v, a and multipliers.
      workspace: workspace of a balance (`accelerations.Workspace`).

    Returns True: there are no sweeps that might not settle.
    """
    changes_forward(tag, model, tables, history, w, dq, dv, force, changes, rows, workspace)
    return True


@kernel
def beside(tag, model, history, k, c, e, q, v, a, q_out, v_out):
    """The motion a little later, on a parabola: it has the accelerations of its balance everywhere.

    model: the compiled scene.
    tag, history, k, c: method, history, step and fraction; not used.
    e: how much later (s); below 0: earlier.
    q (n_q,), v, a (n,): the motion here.
    q_out (n_q,), v_out (n,): coordinates and velocities there.
    """
    advance_coordinates(model, q, v, a, e, q_out)
    for d in range(v.shape[0]):
        v_out[d] = v[d] + e * a[d]


@kernel
def derivatives(tag):
    """How many derivatives of the motion are those of the balance: velocities and accelerations."""
    return 2


@kernel
def is_continuous(tag):
    """A partial step has all its stages."""
    return False


@kernel
def weights_of(tag, model, tables, history, w, out):
    """Weights of the stages in an integral over one step, as of the velocity of one more coordinate.

    tag: the method of integration (`method_interface`).
    model: the compiled scene.
    tables: coefficients of the method.
    history: the history of steps (`StepHistory`).
    w: number of the step.
    out (s or more,): the weights (s).
    """
    table, stages = table_of_step(tag, model, tables, history, w)
    for j in range(stages):
        out[j] = (history.t[w + 1] - history.t[w]) * table[2, 2, j]


#: what all Runge-Kutta methods have in common
COMMON: dict[str, Any] = {
    "point_of": point_of,
    "step_back": step_back,
    "step_forward": step_forward,
    "beside": beside,
    "derivatives": derivatives,
    "is_continuous": is_continuous,
    "weights_of": weights_of,
}
implement(TAG, **COMMON)
