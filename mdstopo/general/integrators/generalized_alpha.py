"""Generalized-alpha steps of a general scene, fixed, with joints and events (Arnold and Bruels' form).

    (1 - alpha_m) x' + alpha_m x = (1 - alpha_f) a' + alpha_f a
    q* = q + h v + h^2 ((1/2 - beta) x + beta x'),  v* = v + h ((1 - gamma) x + gamma x'),  a' = a(q*, v*, t')

as in `integrators.springs_generalized_alpha`, with a(q, v, t) from the balance with its joints: accelerations and
multipliers are of second order like the motion. Then q*, v* are moved onto the joints (`projection`) by what they are
off, which is of third order: no drift, and no transient at the start, because x begins where it belongs. Newton's
iteration takes the exact tangent of the whole balance. A step that a switching member's margin does not survive ends at
the event; what is left of the segment is divided anew. Steps do not end at the knots of curves: where the second
derivative of a force jumps, a method of second order loses nothing, and steps that stay as they are have derivatives
that are exact.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import note_motion, scale_general, shortest_at_start
from mdstopo.general.events.event_log import log_at_breakpoint, log_switches, note_switch
from mdstopo.general.events.events import watch_all
from mdstopo.general.events.start_balance import balance_at_start
from mdstopo.general.integrators.generalized_alpha_run import make_run, make_step
from mdstopo.general.integrators.generalized_alpha_step import AUXILIARY, VELOCITY, rate_of
from mdstopo.general.integrators.generalized_alpha_switch import end_at_switch
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.steps.run_start import log_start, motion_at_start
from mdstopo.general.steps.step_history import (
    EVENTS,
    FIRST,
    carve_history,
    copy_vector,
    is_finite,
    keep_state,
    keep_step,
)
from mdstopo.integrators.springs_generalized_alpha import FEWEST_STEPS
from mdstopo.integrators.steps import (
    ACCEPTED,
    CHATTERING,
    NEEDS_ROOM,
    NON_FINITE,
    OK,
    SINGULAR,
    STEP_LIMIT,
    STEP_TOO_SMALL,
)
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, relative_pose
from mdstopo.mechanics.kinematics.planar_poses import copy_rows

TAG = (0, 0)


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, member_state, work, where):
    """Integrate a design over `model.times` in fixed steps.

    Constant:
      ints, floats: the packed scene (`general_model.pack_general`).
      tables (1,): the spectral radius.
      alpha (N,): the design.
      tangent: not read; tangents are always kept.
      settings: tolerance of the case, relative (it tells which touches count as doubtful); Newton tolerance, relative
        to the motion; the step (s), or, where negative, so many radians of the fastest vibration at the start.
      limits: steps allowed, and the sizes of the arrays (`carve_history`).
    Out:
      room, room_ints: the history of steps, as of `carve_history`.
      member_state (3, columns): state of the members; scales are set from alpha, modes and sets are those at the end.
      work (WORK,): counts of work, added to.
      where (3,): each -1 where there is none: the member or the unknown that is to blame for an early end; a member
        whose ends have met; one that grazes so that the motion has no derivative.

    Returns code (`integrators.steps`; NEEDS_ROOM: the arrays are too small), number of steps, number of events, time
    reached (s).
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    scale_general(model.block, model.power, alpha, member_state)
    run = make_run(model, tables[0], settings, history, member_state, where, work)
    pace = run.pace
    code = _begin(run)
    for segment in range(model.times.shape[0] - 1):
        if code == OK and segment > 0:
            code = _pass_breakpoint(run, segment)
        if code == OK:
            _divide(run)
        while code == OK and pace.t < model.times[segment + 1]:
            code = _take_step(run, limits[0])
    if code == OK:
        history.index[pace.count + 1, FIRST] = pace.stages  # no step follows (`weights_of`)
    return code, pace.count, pace.events, pace.t


@kernel
def _begin(run):
    """Bring a run to its start: modes, accelerations, the length of steps.

    Returns OK, or the code with which the run ends.
    """
    model, rules, pace, history, v = run.model, run.rules, run.pace, run.history, run.state[VELOCITY]
    history.mass[0] = 0.0
    drive_state(model, np.int64(0), pace.t, run.q, v)
    watch_all(model, np.int64(0), run.watched)
    singular = balance_at_start(
        model, run.member_state, run.workspace, run.q, v, run.a0, run.lam, np.int64(0), rules.graze, run.where
    )
    if singular >= 0:
        run.where[0] = singular
        return SINGULAR
    relative_pose(model, run.q, v, run.rel0)
    stiffness = np.empty(run.shortest.shape[0])
    motion_at_start(model, run.member_state, run.workspace, run.rel0, v, stiffness, run.extent[0], run.extent[1])
    shortest_at_start(model, run.rel0, run.shortest)
    if not rules.step > 0.0:
        longest = (model.times[model.times.shape[0] - 1] - pace.t) / FEWEST_STEPS
        rate = rate_of(model, run.workspace)
        rules.step = min(-rules.step / rate, longest) if rate > 0.0 else longest
    if rules.switching:
        events = log_start(run.member_state, history)
        if events < 0:
            return NEEDS_ROOM
        pace.events = events
    keep_state(history, 0, pace.t, run.q, v, run.push[0], run.push[1])
    history.index[0, FIRST] = 0
    return OK


@kernel
def _pass_breakpoint(run, segment):
    """Go on behind a breakpoint of time; returns OK, or the code with which the run ends."""
    model, pace, history, count, v = run.model, run.pace, run.history, run.pace.count, run.state[VELOCITY]
    pace.segment = segment
    drive_state(model, segment, pace.t, run.q, v)
    keep_state(history, count, pace.t, run.q, v, history.push[count, 0], history.push[count, 1])
    if not run.rules.switching:
        return OK
    events = log_at_breakpoint(
        model, run.member_state, segment, pace.t, run.q, v, run.watched, run.workspace, run.a0, run.lam, history,
        count, pace.events, run.rules.rounding, run.work, run.where,
    )  # fmt: skip
    pace.events = max(events, 0)
    return OK if events >= 0 else NEEDS_ROOM


@kernel
def _divide(run):
    """Divide what is left of the segment into equal steps, of which nothing before tells how they begin."""
    pace = run.pace
    pace.begin = pace.t
    pace.pieces = max(np.ceil((run.model.times[pace.segment + 1] - pace.t) / run.rules.step - 1e-9), 1.0)
    pace.done = 0.0
    pace.known = 0


@kernel
def _take_step(run, most):
    """Make a step and keep it. most: how many steps are allowed. Returns OK, or the code with which the run ends."""
    model, pace, trial, history = run.model, run.pace, run.trial, run.history
    end = model.times[pace.segment + 1]
    trial.h = (end - pace.begin) / pace.pieces
    if not pace.count + pace.pieces - pace.done <= most:
        return STEP_LIMIT
    if pace.count + 3 > history.t.shape[0] or pace.stages + 3 > history.when.shape[0]:
        return NEEDS_ROOM
    if not trial.h > 1e-15 * max(abs(pace.begin), abs(end)):
        return STEP_TOO_SMALL
    trial.lands = pace.done + 1.0 >= pace.pieces
    trial.happens = np.bool_(False)
    starting = np.bool_(pace.known == 0)
    code, stages, singular = make_step(
        run, pace.segment, pace.t, trial.h, starting, pace.stages, run.state, run.end_q, run.ends, run.push
    )
    trial.stages = stages
    if code == OK:
        relative_pose(model, run.end_q, run.ends[VELOCITY], run.rel)
        if run.rules.switching:
            code, singular = end_at_switch(run, starting)
    if code != OK:
        run.where[0] = singular
        return code
    if not (is_finite(run.end_q) and is_finite(run.ends[VELOCITY])):
        return NON_FINITE
    _keep(run)
    code = _go_on_behind(run) if trial.happens else OK
    if code == OK:
        history.index[pace.count, EVENTS] = pace.events
    return code


@kernel
def _keep(run):
    """Keep the step that has been made: its end is the start of the next one."""
    model, pace, trial = run.model, run.pace, run.trial
    note_motion(
        model, pace.segment, pace.t, run.member_state, run.q, run.state[VELOCITY], run.rel, run.rel0, run.shortest,
        run.extent[0], run.before, run.where,
    )  # fmt: skip
    pace.done += 1.0
    pace.known += 1
    if trial.lands:
        pace.t = model.times[pace.segment + 1]
    else:
        pace.t = pace.t + trial.h if trial.happens else pace.begin + trial.h * pace.done
    _guess(run)
    copy_vector(run.end_q, run.q)
    copy_rows(run.ends, run.state)
    pace.stages += trial.stages
    keep_step(
        run.history, pace.count, pace.segment, pace.events, pace.stages, pace.t, run.q, run.state[VELOCITY], run.push
    )
    pace.count += 1
    run.work[ACCEPTED] += 1


@kernel
def _guess(run):
    """x of the steps before, from which the next one's is guessed; in the first steps its slope counts as constant."""
    guess, x, x_end = run.guess, run.state[AUXILIARY], run.ends[AUXILIARY]
    for d in range(x.shape[0]):
        guess[2, d] = guess[1, d]
        guess[1, d] = guess[0, d]
        guess[0, d] = x[d]
    if run.pace.known <= 3:
        for d in range(x.shape[0]):
            slope = x_end[d] - x[d]
            guess[0, d] = x_end[d] - slope
            guess[1, d] = x_end[d] - 2.0 * slope
            guess[2, d] = x_end[d] - 3.0 * slope


@kernel
def _go_on_behind(run):
    """Log the switches at the end of a step that has been kept, and divide what is left of the segment anew.

    Returns OK, or the code with which the run ends (`integrators.steps`).
    """
    model, pace, v = run.model, run.pace, run.state[VELOCITY]
    solve_accelerations(
        model, run.member_state, pace.segment, pace.t, run.q, v, np.bool_(False), run.workspace, run.a0, run.lam
    )
    events = log_switches(
        model, run.member_state, pace.segment, pace.t, run.q, v, run.watched, run.workspace, run.a0, run.lam,
        run.history, pace.count, pace.events, run.rules.graze, run.rules.rounding, run.work, run.where,
    )  # fmt: skip
    pace.events = max(events, 0)
    if events < 0:
        return NEEDS_ROOM
    if note_switch(run.chatter, pace.t, model.times):
        run.where[0] = run.trial.who
        return CHATTERING
    _divide(run)
    return OK
