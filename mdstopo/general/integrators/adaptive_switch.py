"""Where an adaptive step ends because a member switches, and how the run goes on behind that."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.singular_poses import least_singular_value
from mdstopo.general.events.event_log import log_switches, note_switch
from mdstopo.general.events.events import is_doubtful, smallest_margin, watch_near
from mdstopo.general.events.landing import CORRECTIONS, first_event
from mdstopo.general.events.locate import BEHIND_SWITCH, NEAR_SWITCH, RESOLUTION, is_sharp, time_to_sharp
from mdstopo.general.integrators.adaptive_run import reject
from mdstopo.general.integrators.runge_kutta_step import advance_trial
from mdstopo.general.steps.method_interface import is_explicit, make_stages
from mdstopo.general.steps.step_history import copy_vector
from mdstopo.integrators.runge_kutta_tables import INSIDE
from mdstopo.integrators.steps import CHATTERING, FORCES, NEEDS_ROOM, OF_STARTS, OF_SWITCHES, OK
from mdstopo.mechanics.kinematics.kinematics_interface import relative_pose

#: a step of a scene with curves that ends before this fraction is made anew: stages far behind its end take forces
#: from cubics far beyond their pieces, which are as large as they like, and derivatives are sums over the stages
LEAST_OF_CURVES = 0.5


@kernel
def end_at_switch(tag, run):
    """End the step that has been made where a member switches, if one does in it.

    tag: the method of integration (`method_interface`). run: the run (`AdaptiveRun`); `trial` is written.

    Returns whether the step is kept.
    """
    step, trial = run.step, run.trial
    c, rate, singular = _first_switch(tag, run)
    if singular:
        reject(run, run.rules.s, 0.25 * trial.h)
        return False
    trial.happens = c <= 1.0
    sharp = False
    if trial.happens and not run.rules.fixed_step > 0.0:
        relative_pose(step.model, step.at_q, step.at_v, step.rel)
        sharp = is_sharp(step.model, run.t + c * trial.h, step.member_state, step.rel, trial.who)
    if _leads_to_root(run, c, sharp):
        reject(run, INSIDE if c < 2.0 else run.rules.s, run.wanted)
        return False
    if trial.happens:
        far = run.rules.curved and c < LEAST_OF_CURVES
        if run.rules.stages_inside or sharp or far or not is_explicit(tag):
            run.work[OF_SWITCHES] += run.rules.s
            if _advance_to_switch(tag, run, c, rate):
                reject(run, run.rules.s, 0.25 * trial.h)
                return False
        else:
            _end_inside(run, c)
    if c <= 1.0:
        trial.lands = trial.lands and trial.h >= step.model.times[run.segment + 1] - run.t
        run.poses.at_end = least_singular_value(step.model, step.workspace)
        relative_pose(step.model, run.end_q, run.end_v, run.rel)
    return True


@kernel
def _first_switch(tag, run):
    """The first switch in the step: at which fraction, 2 where there is none; the rate of its margin there; and whether
    a stage that it takes has failed. `run.trial.who` has the smallest margin."""
    step, rules, trial, h = run.step, run.rules, run.trial, run.trial.h
    relative_pose(step.model, step.q0, step.v0, run.before)
    watch_near(step.model, run.segment, run.t, step.member_state, run.before, run.rel, h, step.watched)
    margin, who = smallest_margin(step.model, run.t + h, step.member_state, run.rel, step.watched)
    trial.who = who
    if not margin < -rules.rounding and not is_doubtful(
        step.model, run.t, step.member_state, step.q0, step.v0, run.end_q, run.end_v, run.before, run.rel, h,
        rules.rounding, step.watched,
    ):  # fmt: skip
        return 2.0, 0.0, False
    if is_explicit(tag):  # what else the polynomial needs
        singular = make_stages(
            tag, step.model, step.table, rules.s, INSIDE, step.member_state, run.segment, run.t, h, step.q0, step.v0,
            rules.tangent, run.stages, step.workspace, run.lam, step.q, step.v, step.a, run.history, run.work,
        )  # fmt: skip
        run.work[OF_SWITCHES] += INSIDE - rules.s
        if singular >= 0:
            return 2.0, 0.0, True
    c, who, rate = first_event(
        step, run.segment, run.t, h, rules.graze, rules.rounding, run.end_q, run.end_v, margin, run.where
    )
    trial.who = who
    return c, rate, False


@kernel
def _leads_to_root(run, c, sharp):
    """Whether a switch at which slopes begin with a root is so far ahead that shorter steps have to lead there; then it
    is noted in `run.roots`.

    c: fraction of the step at which a member switches, 2: none does. sharp: whether slopes begin with a root there.
    """
    step, trial, roots = run.step, run.trial, run.roots
    until = c * trial.h if sharp else 0.0
    if not trial.happens and not run.rules.fixed_step > 0.0:
        until, who = time_to_sharp(step.model, run.t + trial.h, step.member_state, run.rel, step.watched)
        trial.who = who
        until = until + trial.h if until < 0.5 * trial.h else 0.0
    if not until > roots.nearest * max(run.longest, trial.h):
        return False
    roots.ahead = run.t + until
    roots.usual = run.wanted if roots.whose < 0 else roots.usual
    roots.whose = trial.who
    return True


@kernel
def _end_inside(run, c):
    """End the step at fraction c, on its own polynomial: its stages are kept, and some of them lie behind its end."""
    step, trial = run.step, run.trial
    trial.stages = INSIDE
    run.history.share[run.count] = c
    trial.h *= c
    copy_vector(step.at_q, run.end_q)
    copy_vector(step.at_v, run.end_v)
    copy_vector(step.push[0], run.push[0])
    copy_vector(step.push[1], run.push[1])


@kernel
def _advance_to_switch(tag, run, c, rate):
    """Make the step anew so that it ends where a member switches, for the sake of what needs all stages within a step.

    tag: the method of integration (`method_interface`).
    run: the run (`AdaptiveRun`); `trial` is written: the length, and whether a margin is used up at its end.
    c, rate: the fraction of the step that is found on its polynomial, and the rate of the margin there (`first_event`).

    Returns whether it has failed: a stage is not found, or joints are singular or do not fit.
    """
    step, trial, rounding, h = run.step, run.trial, run.rules.rounding, run.trial.h
    trial.h = c * h
    resolution = RESOLUTION * (abs(run.t) + h)
    before = 0.0
    at_before = 0.0
    value = 0.0
    for tries in range(CORRECTIONS):
        singular = advance_trial(tag, run)
        run.work[OF_SWITCHES] += run.rules.s if tries > 0 else 0
        if singular >= 0:
            return True
        relative_pose(step.model, run.end_q, run.end_v, step.rel)
        value, _ = smallest_margin(step.model, run.t + trial.h, step.member_state, step.rel, step.watched)
        near = value < -rounding and (value >= -NEAR_SWITCH * rounding or tries >= CORRECTIONS // 2)
        if near or tries + 1 == CORRECTIONS:
            break
        if tries > 0 and trial.h != before and (value - at_before) / (trial.h - before) < 0.0:
            rate = (value - at_before) / (trial.h - before)
        before = trial.h
        at_before = value
        shift = -(value + BEHIND_SWITCH * rounding) / rate if rate < 0.0 else resolution * 4.0**tries
        trial.h = min(max(trial.h + shift, 0.5 * trial.h, resolution), h)
    trial.happens = value < -rounding
    return False


@kernel
def go_on_behind(run):
    """Log the switches at the end of a step that has been kept, and see how steps go on behind them.

    Returns OK, or the code with which the run ends (`integrators.steps`).
    """
    step, roots, model = run.step, run.roots, run.step.model
    solve_accelerations(
        model, step.member_state, run.segment, run.t, step.q0, step.v0, np.bool_(False), step.workspace, run.a0, run.lam
    )
    run.work[FORCES] += 1
    run.work[OF_STARTS] += 1
    events = log_switches(
        model, step.member_state, run.segment, run.t, step.q0, step.v0, step.watched, step.workspace, run.a0, run.lam,
        run.history, run.count, run.events, run.rules.graze, run.rules.rounding, run.work, run.where,
    )  # fmt: skip
    run.events = max(events, 0)
    if events < 0:
        return NEEDS_ROOM
    if is_sharp(model, run.t, step.member_state, run.rel, run.trial.who):
        roots.since = run.t
    else:
        run.wanted = max(run.wanted, roots.usual)
    roots.usual = 0.0
    if note_switch(run.chatter, run.t, model.times):
        run.where[0] = run.trial.who
        return CHATTERING
    return OK
