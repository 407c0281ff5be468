"""One step of a Runge-Kutta method, explicit or diagonally implicit, whose end is put onto the joints."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.projection import project
from mdstopo.general.steps.method_interface import make_stages
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, end_state


@kernel
def advance(
    tag,
    model,
    table,
    s,
    member_state,
    segment,
    t,
    h,
    q0,
    v0,
    tangent,
    o,
    workspace,
    lam,
    q,
    v,
    a,
    history,
    end_q,
    end_v,
    push,
    size,
    work,
):
    """Make one step, and put its end onto the joints.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      table (3, 17, 17): coefficients of the method (`integrators.runge_kutta_tables`).
      s: number of its stages.
      size: size of the scene (m).
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t, h: time at the start, and length of the step (s).
      q0 (n_q,), v0 (n,): coordinates and velocities at the start.
      tangent: whether the tangents of the stages are wanted.
      o: number of the first stage as which they are kept in `history`; -1: they are not kept.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      lam (n_row,): multipliers of the joints at the last stage.
      q (s or more, n_q), v, a (s or more, n): coordinates, velocities, accelerations of the stages.
      history: the history of steps (`StepHistory`), where stages are kept.
      end_q (n_q,), end_v (n,): coordinates and velocities at the end; NaN where a stage is not found.
      push (2, n_row): the multipliers of the projection there.
      work (WORK,): counts of work, added to.

    Returns -1; UNSOLVED of a stage that is not found; or what `projection.project` returns of joints that are singular
    or do not fit.
    """
    singular = make_stages(
        tag, model, table, 0, s, member_state, segment, t, h, q0, v0, tangent, o, workspace, lam, q, v, a, history, work
    )
    if singular >= 0:
        end_q[:] = np.nan
        end_v[:] = np.nan
        return singular
    end_state(model, table, s, h, q0, v0, q, v, a, workspace.slopes, end_q, end_v)
    drive_state(model, segment, t + h, end_q, end_v)
    return project(model, size, end_q, end_v, workspace, push[0], push[1])


@kernel
def advance_trial(tag, run):
    """`advance` of the step that a run is making, of the length `run.trial.h`, whose stages are kept.

    tag: the method of integration. run: the run (`adaptive_run.AdaptiveRun`).
    """
    step, rules = run.step, run.rules
    return advance(
        tag, step.model, step.table, rules.s, step.member_state, run.segment, run.t, run.trial.h, step.q0, step.v0,
        rules.tangent, run.stages, step.workspace, run.lam, step.q, step.v, step.a, run.history, run.end_q, run.end_v,
        run.push, step.size, run.work,
    )  # fmt: skip
