"""Where within a step a margin falls through zero: the next trial, and what it has shown.

First it has to be known that one does: members that come and go within a step show it at neither end. Looking at the
cubic through both ends tells where they might; there the step is cut, and both pieces are checked in the same way,
until nothing is doubtful. Then the root is bracketed and closed in on. Each trial is a step of its own, a dozen sums of
forces; so the first is where the quintic through both ends has the root, the second is put right by how far the margin
there is from the quintic's, and further ones are secants of trials, which are near each other. Where that leads out of
the bracket, or takes long, Illinois' rule takes over.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.dynamics.accelerations import solve_accelerations
from mdstopo.general.dynamics.members import MODE, SCALE, SET
from mdstopo.general.events.events import EDGE, block_of, smallest_margin
from mdstopo.general.model.general_model import CODE, MEMBER_FREE_LENGTH, PAIR
from mdstopo.general.steps.step_history import copy_vector
from mdstopo.mechanics.contact import contact_grazes
from mdstopo.mechanics.kinematics.kinematics_interface import (
    drive_state,
    member_motion,
    quintic,
    relative_pose,
    stretch_of,
)
from mdstopo.mechanics.laws.law_table import (
    law_grazes,
    law_is_sharp,
    law_margin,
    law_margin_by_time,
    law_margin_slopes,
)

#: trials of the moment of one event: after LAST_FORESEEN every other one is a bisection, and so many of these come to
#: rounding
TRIALS, LAST_FORESEEN = 130, 15
#: cuts of one step
CUTS = 24
#: margins (times rounding) at which a place behind the switch is near enough, and which is aimed at
NEAR_SWITCH, BEHIND_SWITCH = 50.0, 5.0
#: times that differ by less than this part of them are one: a step as short would have no length
RESOLUTION = 4e-16
#: trials that are foreseen; evaluations of the quintic's margin for its root, and how near that is found; by which
#: share of the piece its rate is differenced
FORESEEN, LAPS, ROOT_FOUND, RATE_SHIFT = 8, 40, 1e-9, 1e-4
#: steps beside a switch at which slopes begin with a root: relative to the time from it and to it; the shortest are the
#: longest one so far times the tolerance to this power
LEAVE, APPROACH, NEAREST = 1.0, 0.5, 0.65


@kernel
def quintic_ends(model, member_state, segment, t, low, high, q0, v0, q1, v1, workspace, lam, ends_q, ends):
    """The coefficients of the quintic through both ends of a piece of a step.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t: time at the start of the step (s).
      low, high: where the piece begins and ends, from there (s).
      q0, q1 (n_q,), v0, v1 (n,): coordinates and velocities at its ends.
    Out:
      ends_q (2, n_q), ends (2, 2, n): coordinates, and velocities and accelerations, at its start and its end.
      workspace: workspace of a balance (`accelerations.Workspace`).
      lam (n_row,): scratch.
    """
    for e in range(2):
        copy_vector(q0 if e == 0 else q1, ends_q[e])
        copy_vector(v0 if e == 0 else v1, ends[e, 0])
        solve_accelerations(
            model, member_state, segment, t + (low if e == 0 else high), ends_q[e], ends[e, 0], np.bool_(False),
            workspace, ends[e, 1], lam,
        )  # fmt: skip


@kernel
def foreseen_margin(model, member_state, segment, t, low, high, ends_q, ends, c, watched, room_q, room_v, rel):
    """The smallest margin on the quintic through both ends of a piece (`quintic_ends`).

    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    segment: number of the stretch of time between two breakpoints.
    t, low, high: time at the start of the step, and where the piece begins and ends from there (s).
    ends_q (2, n_q), ends (2, 2, n): of the quintic.
    c: fraction of the piece.
    watched: the members and contacts whose margins are checked (`events.watch_near`).
    room_q (n_q,), room_v (n,), rel (n_pair, POSE): overwritten.
    """
    quintic(model, c, high - low, ends_q[0], ends[0, 0], ends[0, 1], ends_q[1], ends[1, 0], ends[1, 1], room_q, room_v)
    drive_state(model, segment, t + low + c * (high - low), room_q, room_v)
    relative_pose(model, room_q, room_v, rel)
    margin, _ = smallest_margin(model, t + low + c * (high - low), member_state, rel, watched)
    return margin


@kernel
def foreseen_root(model, member_state, segment, t, low, high, ends_q, ends, watched, room_q, room_v, rel):
    """Where in a piece of a step the quintic's smallest margin falls through zero, or -1: it does not.

    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    segment: number of the stretch of time between two breakpoints.
    t, low, high: time at the start of the step, and where the piece begins and ends from there (s).
    ends_q (2, n_q), ends (2, 2, n): of the quintic (`quintic_ends`).
    watched: the members and contacts whose margins are checked (`events.watch_near`).
    room_q (n_q,), room_v (n,), rel (n_pair, POSE): overwritten.

    Returns a length of the step (s).
    """
    a = 0.0
    b = 1.0
    at_a = foreseen_margin(model, member_state, segment, t, low, high, ends_q, ends, a, watched, room_q, room_v, rel)
    at_b = foreseen_margin(model, member_state, segment, t, low, high, ends_q, ends, b, watched, room_q, room_v, rel)
    if not at_b < 0.0:
        return -1.0
    if at_a < -1e-3 * at_b:  # the piece begins on the switch of a member that has just left it: half-way first
        at_a = -at_b
    side = 0
    c = b
    for _ in range(LAPS):
        c = (a * at_b - b * at_a) / (at_b - at_a)
        if not a < c < b:
            c = 0.5 * (a + b)
        if b - a <= ROOT_FOUND:
            break
        value = foreseen_margin(
            model, member_state, segment, t, low, high, ends_q, ends, c, watched, room_q, room_v, rel
        )
        if value < 0.0:
            if b - c <= ROOT_FOUND and side == 1:
                break
            b = c
            at_b = value
            if side == 1:
                at_a *= 0.5
            side = 1
        else:
            if c - a <= ROOT_FOUND and side == -1:
                break
            a = c
            at_a = value
            if side == -1:
                at_b *= 0.5
            side = -1
    return low + c * (high - low)


@kernel
def foreseen_trial(
    model, member_state, segment, t, low, high, ends_q, ends, trials, tries, rounding, watched, room_q, room_v, rel
):
    """Where to try next for a zero of the margin, from the quintic and the trials so far; -1: they tell nothing.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      t, low, high: time at the start of the step, and where the piece begins and ends from there (s).
      ends_q (2, n_q), ends (2, 2, n): of the quintic (`quintic_ends`).
      trials (2, 2): length of the step (s) and smallest margin of the last trial and of the one before.
      tries: how many trials there have been.
      rounding: what rounding leaves of a margin.
      watched: the members and contacts whose margins are checked (`events.watch_near`).
    Out:
      room_q (n_q,), room_v (n,), rel (n_pair, POSE): overwritten.

    Returns a length of the step (s).
    """
    if tries == 0:
        return foreseen_root(model, member_state, segment, t, low, high, ends_q, ends, watched, room_q, room_v, rel)
    if tries >= FORESEEN:
        return -1.0
    last = trials[0, 0]
    over = trials[0, 1] + BEHIND_SWITCH * rounding
    if tries == 1:
        c = min(max((last - low) / (high - low), RATE_SHIFT), 1.0 - RATE_SHIFT)
        ahead = foreseen_margin(
            model, member_state, segment, t, low, high, ends_q, ends, c + RATE_SHIFT, watched, room_q, room_v, rel
        )
        behind = foreseen_margin(
            model, member_state, segment, t, low, high, ends_q, ends, c - RATE_SHIFT, watched, room_q, room_v, rel
        )
        rate = (ahead - behind) / (2.0 * RATE_SHIFT * (high - low))
    else:
        apart = last - trials[1, 0]
        rate = (trials[0, 1] - trials[1, 1]) / apart if apart != 0.0 else 0.0
    return last - over / rate if rate < 0.0 else -1.0


@kernel
def note_trial(trials, middle, value):
    """Keep the last two trials in trials (2, 2): each a length (s) and a margin."""
    for i in range(2):
        trials[1, i] = trials[0, i]
    trials[0, 0] = middle
    trials[0, 1] = value


@kernel
def next_trial(low, high, at_low, at_high, foreseen, rounding, resolution, tries):
    """Where within a step to try next for the moment at which a margin vanishes; -1 where `high` is near enough.

    It is where it is foreseen, if that is between the ends; else the secant through both ends, aimed behind the switch
    by more than rounding. After many trials every other one is a bisection: where one margin takes over from another,
    of other units and a thousand times as steep, secants come near to no root.

    low, high: lengths of the step between which it happens (s).
    at_low, at_high: the smallest margins there; at_high is negative.
    foreseen: a length of the step, or -1.
    rounding: what rounding leaves of a margin.
    resolution: lengths that differ by no more than this are the same (s).
    tries: how many trials there have been.
    """
    if high - low <= resolution or at_high >= -NEAR_SWITCH * rounding:
        return -1.0
    halve = tries > LAST_FORESEEN and tries % 2 == 0
    if low < foreseen < high and not halve:
        return foreseen
    aim = BEHIND_SWITCH * rounding
    middle = (low * (at_high + aim) - high * (at_low + aim)) / (at_high - at_low)
    if halve or middle <= low or middle >= high:
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            return -1.0
    return middle


@kernel
def narrowed(low, high, at_low, at_high, middle, value, rounding, side):
    """The bracket of a zero after another trial: low, high, at_low, at_high, side, by Illinois' rule.

    low, high: lengths of the step between which the margin vanishes (s).
    at_low, at_high: the smallest margins there; the one that stays a second time running is halved.
    middle, value: where the look was (s), and the margin there.
    rounding: what rounding leaves of a margin.
    side: which end the last look has moved: 1 `high`, -1 `low`, 0 none yet.
    """
    if value < -rounding:
        return low, middle, (0.5 * at_low if side == 1 else at_low), value, 1
    return middle, high, max(value, rounding), (0.5 * at_high if side == -1 else at_high), -1


@kernel
def cut_at(dip, near, low, high):
    """Where to cut the piece of a step between low and high (s), or -1: nowhere.

    dip, near: the fractions of the piece that `events.first_sign` has found.
    """
    c = dip if dip < 1.0 else near
    if not (c > EDGE and c < 1.0 - EDGE):
        return -1.0
    return low + c * (high - low)


@kernel
def matters(model, t, member_state, rel, i):
    """Whether derivatives would be others if member or contact i only just left its mode.

    t, rel (n_pair, POSE): that time (s), and relative poses then. Members with a permanent set are left out: where no
    energy is lost they come back to the very place at which the set was made, which is no touch to warn of.
    """
    if i >= model.member.shape[1]:
        return contact_grazes(model.contact[i - model.member.shape[1]], int(member_state[MODE, i])) == 2
    if i < 0 or member_state[SCALE, i] == 0.0 or member_state[SET, i] != 0.0:
        return False
    k = block_of(model, i)
    x, _ = stretch_of(model, i, rel[model.block[k, PAIR]])
    rest = model.member[MEMBER_FREE_LENGTH, i]
    mode = int(member_state[MODE, i])
    return law_grazes(model.block[k, CODE], model.law[k], x, mode, t, model.curves, rest) == 2


@kernel
def is_sharp(model, t, member_state, rel, i):
    """Whether the slopes of the force of member or contact i grow like a root behind its nearest switch.

    t, rel (n_pair, POSE): that time (s), and relative poses then.
    """
    if i < 0 or i >= model.member.shape[1]:
        return False
    k = block_of(model, i)
    _, x, rate = member_motion(model, i, rel[model.block[k, PAIR]])
    x -= member_state[SET, i]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    mode = int(member_state[MODE, i])
    return law_is_sharp(model.block[k, CODE], model.law[k], x, rate, mode, t, model.curves, rest)


@kernel
def time_to_switch(model, t, member_state, rel, i):
    """When the margin of member i is used up at its present rate, s from now; infinite where that is not known.

    t, rel (n_pair, POSE): that time (s), and relative poses then.
    """
    k = block_of(model, i)
    code = model.block[k, CODE]
    _, x, rate = member_motion(model, i, rel[model.block[k, PAIR]])
    x -= member_state[SET, i]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    mode = int(member_state[MODE, i])
    by_x, by_rate = law_margin_slopes(code, model.law[k], x, rate, mode, t, model.curves, rest)
    speed = by_x * rate + law_margin_by_time(code, model.law[k], x, rate, mode, t, model.curves, rest)
    if by_rate != 0.0 or not speed < 0.0:
        return np.inf
    return -law_margin(code, model.law[k], x, rate, mode, t, model.curves, rest) / speed


@kernel
def time_to_sharp(model, t, member_state, rel, watched):
    """The time (s) until the first of the watched members comes to a switch behind which slopes grow like a root,
    and which member.

    t, rel (n_pair, POSE): that time (s), and relative poses then. watched: the members (`events.watch_near`).

    Infinite, -1 where none is known to do so.
    """
    first = np.inf
    who = -1
    for m in range(1, watched[0] + 1):
        i = watched[m]
        if is_sharp(model, t, member_state, rel, i):
            away = time_to_switch(model, t, member_state, rel, i)
            if away < first:
                first = away
                who = i
    return first, who


@kernel
def step_beside_sharp(away, since, near):
    """The longest step (s) near switches behind which slopes grow like a root, by the times from and to them.

    away: how long it is to the next such switch, infinite: none is foreseen. since: how long ago the last one was.
    near: how long the steps right beside them are (s).
    """
    most = near + LEAVE * since
    return min(most, APPROACH * away) if away > near else min(most, 2.0 * near)
