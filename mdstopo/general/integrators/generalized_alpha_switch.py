"""Where a step of generalized-alpha ends because a member switches: every trial is a step of its own.

First it is found in which piece of the step a margin is used up, as `landing.first_piece` does on polynomials; then the
root is bracketed and closed in on (`locate`).
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.events.events import first_sign, smallest_margin
from mdstopo.general.events.locate import (
    CUTS,
    RESOLUTION,
    TRIALS,
    cut_at,
    foreseen_trial,
    matters,
    narrowed,
    next_trial,
    note_trial,
    quintic_ends,
)
from mdstopo.general.integrators.generalized_alpha_run import make_step
from mdstopo.general.integrators.generalized_alpha_step import VELOCITY
from mdstopo.general.steps.step_history import copy_vector
from mdstopo.integrators.steps import FORCES, OK
from mdstopo.mechanics.kinematics.kinematics_interface import relative_pose
from mdstopo.mechanics.kinematics.planar_poses import copy_rows


@kernel
def _first_piece(run, room, segment, t, h, starting, end_q, ends):
    """The first piece of a step at whose end a margin is used up.

    In:
      run: a `FixedRun`, with the relative poses at the end of the step in `rel`.
      segment, t, h, starting: as of `make_step`.
      end_q (n_q,), ends (3, n): the end of the step.
    Out:
      room: a `SwitchRoom`, with the state in front of the piece in `left_q` and `left_v`, and the cut at its end.

    Returns a code, with the unknown at which joints are singular; the margin at the end of the piece, negative where a
    member switches, and whose it is; where the piece begins and ends after the start of the step (s), and the number of
    the cut at its end.
    """
    model, member_state, where, watched = run.model, run.member_state, run.where, run.watched
    rel, before, rounding = run.rel, run.before, run.rules.rounding
    margin, who = smallest_margin(model, t + h, member_state, rel, watched)
    low = 0.0
    high = h
    top = 0
    cuts = 0
    singular = np.int64(-1)
    code = np.int64(OK)
    room.cut[0] = h
    copy_vector(end_q, room.beyond_q[0])
    copy_rows(ends, room.beyond[0])
    copy_vector(run.q, room.left_q)
    copy_vector(run.state[VELOCITY], room.left_v)
    while top >= 0:
        relative_pose(model, room.left_q, room.left_v, before)
        relative_pose(model, room.beyond_q[top], room.beyond[top, VELOCITY], rel)
        dip, near = first_sign(
            model, t + low, member_state, room.left_q, room.left_v, room.beyond_q[top], room.beyond[top, VELOCITY],
            before, rel, room.cut[top] - low, rounding, watched,
        )  # fmt: skip
        middle = cut_at(dip, near, low, room.cut[top])
        if middle < 0.0 or cuts == CUTS:
            if top == 0 and margin < -rounding:
                break
            low = room.cut[top]
            copy_vector(room.beyond_q[top], room.left_q)
            copy_vector(room.beyond[top, VELOCITY], room.left_v)
            top -= 1
            continue
        cuts += 1
        top += 1
        room.cut[top] = middle
        copy_rows(run.state, room.kept)
        code, _, singular = make_step(
            run, segment, t, middle, starting, np.int64(-1), room.kept, room.beyond_q[top], room.beyond[top], room.push
        )
        if code != OK:
            break
        relative_pose(model, room.beyond_q[top], room.beyond[top, VELOCITY], rel)
        value, near_who = smallest_margin(model, t + middle, member_state, rel, watched)
        if value < -rounding:
            high = middle
            margin = value
            who = near_who
            break
        if value < run.rules.graze and matters(model, t + middle, member_state, rel, near_who):
            where[2] = near_who
    return code, singular, margin, who, low, high, top


@kernel
def _close_in(run, room, segment, t, h, starting, low, high, top, margin, who):
    """The length of a step that ends where a member switches.

    In:
      run: a `FixedRun`.
      segment, t, h, starting: as of `make_step`.
      low, high, top: the piece in which it switches, as of `_first_piece`.
      margin, who: the margin at its end, and whose it is.
    In and out:
      room: the `SwitchRoom` of `_first_piece`.

    Returns a code, with the unknown at which joints are singular; the length (s), and the member that switches.
    """
    model, member_state, watched = run.model, run.member_state, run.watched
    rel, before, rounding = run.rel, run.before, run.rules.rounding
    singular = np.int64(-1)
    code = np.int64(OK)
    relative_pose(model, room.left_q, room.left_v, before)
    at_low, _ = smallest_margin(model, t + low, member_state, before, watched)
    at_low = max(at_low, rounding)
    at_high = margin
    side = 0
    piece = low
    stop = high
    quintic_ends(
        model, member_state, segment, t, piece, stop, room.left_q, room.left_v, room.beyond_q[top],
        room.beyond[top, VELOCITY], run.workspace, run.lam, room.curve_q, room.curve,
    )  # fmt: skip
    run.work[FORCES] += 2
    for tries in range(TRIALS):
        foreseen = foreseen_trial(
            model, member_state, segment, t, piece, stop, room.curve_q, room.curve, room.trials, tries, rounding,
            watched, room.trial_q, room.trial[VELOCITY], rel,
        )  # fmt: skip
        middle = next_trial(low, high, at_low, at_high, foreseen, rounding, RESOLUTION * (abs(t) + h), tries)
        if middle < 0.0:
            break
        copy_rows(run.state, room.kept)
        code, _, singular = make_step(
            run, segment, t, middle, starting, np.int64(-1), room.kept, room.trial_q, room.trial, room.push
        )
        if code != OK:
            break
        relative_pose(model, room.trial_q, room.trial[VELOCITY], rel)
        value, who = smallest_margin(model, t + middle, member_state, rel, watched)
        note_trial(room.trials, middle, value)
        low, high, at_low, at_high, side = narrowed(low, high, at_low, at_high, middle, value, rounding, side)
    return code, singular, high, who


@kernel
def end_at_switch(run, starting):
    """End the step that has been made where a member switches, if one does in it.

    run: the run (`FixedRun`), whose `trial` and end are written. starting: as of `make_step`.

    Returns a code, with the unknown at which joints are singular.
    """
    trial, segment, t = run.trial, run.pace.segment, run.pace.t
    code, singular, margin, who, low, high, top = _first_piece(
        run, run.switch_room, segment, t, trial.h, starting, run.end_q, run.ends
    )
    trial.happens = margin < -run.rules.rounding
    trial.who = who
    if trial.happens and code == OK:
        code, singular, length, who = _close_in(
            run, run.switch_room, segment, t, trial.h, starting, low, high, top, margin, who
        )
        trial.h = length
        trial.who = who
    if trial.happens and code == OK:
        trial.lands = trial.lands and t + trial.h >= run.model.times[segment + 1]
        code, stages, singular = make_step(
            run, segment, t, trial.h, starting, run.pace.stages, run.state, run.end_q, run.ends, run.push
        )
        trial.stages = stages
    relative_pose(run.model, run.end_q, run.ends[VELOCITY], run.rel)
    return code, singular
