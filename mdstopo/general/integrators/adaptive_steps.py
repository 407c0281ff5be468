"""Adaptive Runge-Kutta steps of a general scene, explicit or diagonally implicit, with joints and events.

The stages, and what estimates a step's error, are those of the method that is chosen by its tag (`method_interface`).
The end of a step is moved onto the joints (`projection`), by no more than the step's error, so the order stays. A step
that a switching member's margin does not survive ends at the event, on its own polynomial, or is made anew up to there.
Where slopes of a force begin or end with a root, as those of x^1.5, a step is of low order for derivatives: there steps
become shorter and longer by shares of the time to and from the event, and the last one is made anew, so that no stage
lies behind the root.

A step is planned (`adaptive_length`), made (`runge_kutta_step`), judged (`adaptive_errors`), ended where a member
switches (`adaptive_switch`), and kept; what one step hands to the next is an `AdaptiveRun`.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.members import (
    curved_members,
    knotted_at,
    note_motion,
    scale_general,
    shortest_at_start,
)
from mdstopo.general.dynamics.singular_poses import least_singular_value, way_to_pose
from mdstopo.general.events.event_log import log_at_breakpoint
from mdstopo.general.events.start_balance import balance_at_start
from mdstopo.general.integrators.adaptive_errors import judge_step
from mdstopo.general.integrators.adaptive_length import plan_step
from mdstopo.general.integrators.adaptive_run import make_run, reject
from mdstopo.general.integrators.adaptive_switch import end_at_switch, go_on_behind
from mdstopo.general.integrators.braking import brake_rate
from mdstopo.general.integrators.runge_kutta_step import advance_trial
from mdstopo.general.steps.first_step import first_step
from mdstopo.general.steps.method_interface import UNSOLVED, scheme
from mdstopo.general.steps.run_start import log_start, method_number, motion_at_start
from mdstopo.general.steps.step_history import EVENTS, FIRST, copy_vector, keep_state, keep_step
from mdstopo.integrators.runge_kutta_tables import INSIDE
from mdstopo.integrators.steps import (
    ACCEPTED,
    FORCES,
    NEEDS_ROOM,
    NEWTON_FAILED,
    OF_STARTS,
    OK,
    SINGULAR,
    STABLE,
)
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, relative_pose


@kernel
def run_adaptive(
    tag, model, tables, alpha, tangent, settings, limits, history, member_state, work, where
):  # fmt: skip
    """Integrate the motion of a design over model.times.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables (2, 3, 17, 17): coefficients of both methods (`integrators.runge_kutta_tables`).
      settings (5,): the tolerance; -; a fixed step (s; above 0: no error control); -; not 0 where stages are to lie
        within their steps, as for integrals over time: then all steps that end at a switch are made anew, and shorter;
        else only those near a root, early ones of scenes with curves, and implicit ones.
      limits (6,): steps allowed, then sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      tangent: whether tangents are kept for a reverse sweep.
    Out:
      history: the history of steps (`StepHistory`).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member, at the end.
      work (WORK,): counts of work, added to.
      where (3,): each -1 where there is none: the member or the unknown that is to blame for an early end; a member
        whose ends have met; a member that grazes so that the motion has no derivative.

    Returns a code (`integrators.steps`; NEEDS_ROOM asks for larger rooms), the number of steps, that of events, and the
    time reached (s).
    """
    run = make_run(tag, model, tables, tangent, settings, limits, history, member_state, work, where)
    scale_general(model.block, model.power, alpha, member_state)
    code = _begin(tag, run, settings[0])
    for segment in range(model.times.shape[0] - 1):
        if code == OK and segment > 0:
            code = _pass_breakpoint(run, segment)
        while code == OK and run.t < model.times[segment + 1]:
            code = _take_step(tag, run)
    return code, run.count, run.events, run.t


@kernel
def _begin(tag, run, tolerance):
    """Bring a run to its start: modes, accelerations, the length of the first step.

    tag: the method of integration. run: the run (`AdaptiveRun`). tolerance: of the motion, as it was asked for.

    Returns OK, or the code with which the run ends.
    """
    step, rules, scales, history, where = run.step, run.rules, run.scales, run.history, run.where
    model, member_state, workspace = step.model, step.member_state, step.workspace
    history.mass[0] = 0.0
    rules.curved = curved_members(model, member_state)[0] > 0
    drive_state(model, np.int64(0), run.t, step.q0, step.v0)
    singular = balance_at_start(
        model, member_state, workspace, step.q0, step.v0, run.a0, run.lam, knotted_at(tolerance), rules.graze, where
    )
    run.work[FORCES] += 1
    run.work[OF_STARTS] += 1
    if singular >= 0:
        where[0] = singular
        return SINGULAR
    run.poses.sigma = least_singular_value(model, workspace)
    run.poses.largest = run.poses.sigma
    relative_pose(model, step.q0, step.v0, scales.rel0)
    motion_at_start(model, member_state, workspace, scales.rel0, step.v0, scales.scale, scales.motion, scales.noise)
    shortest_at_start(model, scales.rel0, scales.shortest)
    for p in range(scales.scale.shape[0]):
        scales.shaken += abs(scales.scale[p]) * scales.noise[p]
    if rules.switching:
        events = log_start(member_state, history)
        if events < 0:
            return NEEDS_ROOM
        run.events = events
    if not rules.fixed_step > 0.0:
        run.wanted = first_step(
            model, member_state, model.times[1], step.q0, step.v0, run.a0, scales.rel0, scales.motion, scales.noise,
            rules.tolerance, rules.order, scheme(tag, method_number(model))[2], workspace, run.lam, step.q[0],
            step.v[0], step.a[0], run.work,
        )  # fmt: skip
    _brake(run)
    keep_state(history, 0, run.t, step.q0, step.v0, run.push[0], run.push[1])
    history.index[0, FIRST] = 0
    return OK


@kernel
def _pass_breakpoint(run, segment):
    """Go on behind a breakpoint of time; returns OK, or the code with which the run ends."""
    step, history, count = run.step, run.history, run.count
    run.segment = segment
    run.rates.ended = 0.0
    drive_state(step.model, segment, run.t, step.q0, step.v0)
    keep_state(history, count, run.t, step.q0, step.v0, history.push[count, 0], history.push[count, 1])
    if not run.rules.switching:
        return OK
    run.work[FORCES] += 1
    run.work[OF_STARTS] += 1
    events = log_at_breakpoint(
        step.model, step.member_state, segment, run.t, step.q0, step.v0, step.watched, step.workspace, run.a0, run.lam,
        history, count, run.events, run.rules.rounding, run.work, run.where,
    )  # fmt: skip
    run.events = max(events, 0)
    return OK if events >= 0 else NEEDS_ROOM


@kernel
def _take_step(tag, run):
    """Make a step, and keep it or have a shorter one made; returns OK, or the code with which the run ends."""
    trial, history = run.trial, run.history
    code = plan_step(run)
    if code != OK:
        return code
    if run.count + 4 > history.t.shape[0] or run.stages + INSIDE + run.rules.s > history.when.shape[0]:
        return NEEDS_ROOM
    singular = advance_trial(tag, run)
    if singular >= 0:
        return _without_end(run, singular)
    good, code = judge_step(tag, run)
    if not good:
        return code
    trial.happens = np.bool_(False)
    trial.stages = run.rules.s
    history.share[run.count] = 1.0
    if run.rules.switching and not end_at_switch(tag, run):
        return OK
    _keep(run)
    code = go_on_behind(run) if trial.happens else OK
    if code != OK:
        return code
    _brake(run)
    history.index[run.count, EVENTS] = run.events
    return OK


@kernel
def _without_end(run, singular):
    """Have a shorter step made in place of one that has come to no end. singular: what `advance` said of it.

    A long step may have gone beyond a singular pose, a shorter one need not; a very short one is at it.
    """
    if not run.trial.h < 1e-9 * run.rules.span:
        reject(run, run.rules.s, 0.25 * run.trial.h)
        return OK
    run.where[0] = singular if singular != UNSOLVED else -1
    return SINGULAR if singular != UNSOLVED else NEWTON_FAILED


@kernel
def _keep(run):
    """Keep the step that has been made: its end is the start of the next one."""
    step, trial, scales, poses, roots, model = run.step, run.trial, run.scales, run.poses, run.roots, run.step.model
    poses.largest = max(poses.largest, poses.at_end)
    poses.way = way_to_pose(trial.h, poses.sigma, poses.at_end, poses.largest)
    poses.sigma = poses.at_end
    poses.reaches = np.bool_(True)
    note_motion(
        model, run.segment, run.t, step.member_state, step.q0, step.v0, run.rel, scales.rel0, scales.shortest,
        scales.motion, run.before, run.where,
    )  # fmt: skip
    run.rates.ended = trial.h if run.rules.measures and trial.stages == run.rules.s and not trial.happens else 0.0
    run.t = model.times[run.segment + 1] if trial.lands else run.t + trial.h
    if trial.happens or run.t >= roots.ahead:
        roots.ahead = np.inf
        roots.whose = -1
    run.longest = max(run.longest, trial.h)
    copy_vector(run.end_q, step.q0)
    copy_vector(run.end_v, step.v0)
    run.stages += trial.stages
    keep_step(run.history, run.count, run.segment, run.events, run.stages, run.t, step.q0, step.v0, run.push)
    run.count += 1
    run.work[ACCEPTED] += 1


@kernel
def _brake(run):
    """The rate at which contacts brake where the last step has ended."""
    if run.rules.rubbing and not run.rules.fixed_step > 0.0:
        step, rates = run.step, run.rates
        rates.brake, rates.braking = brake_rate(
            step.model, step.member_state, step.q0, step.v0, STABLE / run.wanted, step.workspace
        )
