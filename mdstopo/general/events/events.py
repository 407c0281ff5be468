"""Members that switch: when, what becomes of them, and what that does to derivatives.

Within a step every member stays in its mode and its law is smooth. A mode holds while its margin s (the law's, of
Delta and dDelta/dt) is not negative. Where s falls below zero the step is shortened until it ends there; then the
member changes its mode and, where the force jumps, the accelerations with it. The time of the event varies by

    dt_e = -(s_q dq + s_v dv) / s',      and behind it  dv+ = dv- + (a- - a+) dt_e      (saltation).

With L' = B v, dL'/dq is dB/dt, so s_q = s_x B + s_xd dB/dt, s_v = s_xd B, s' = s_x x' + s_xd x'' + s_t.

Where a margin only just falls below zero, or only just does not, the derivative may be another one on either side:
s'^2 / (2 |s''|) is how far it goes beyond. Less than the motion is accurate to, and it grazes (`law_grazes`).
"""

import math

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.general_contact import contact_switch
from mdstopo.general.dynamics.members import MODE, SCALE, SET
from mdstopo.general.model.general_model import CODE, COUNT, INERTER, MEMBER_FREE_LENGTH, PAIR, START, STOP
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.contact import contact_grazes, contact_margin, contact_margins, contact_one_margin
from mdstopo.mechanics.kinematics.kinematics_interface import (
    contact_distance,
    contact_seen,
    cubic,
    deflection,
    member_motion,
    member_rows,
    relative_pose,
    stretch_of,
    turning_rate,
)
from mdstopo.mechanics.laws.law_table import (
    law_grazes,
    law_has_pieces,
    law_margin,
    law_margin_by_time,
    law_margin_slopes,
    law_margins,
    law_next,
    law_one_margin,
    law_set,
    law_switches,
)

#: error of the cubic through both ends of a step, relative to the square of its length times the second derivative:
#: (h omega)^2 / 384 of a vibration
CUBIC_ERROR = 0.03
#: how near to the ends of a piece of a step it is not worth cutting
EDGE = 1e-7
#: how often a member may switch at one time by one of its margins
AT_ONCE = 3
#: a margin is watched unless the least control value of its cubic over a step is above this share of what it changes by
UNWATCHED_MARGIN = 0.25


@kernel
def has_switches(model, knots):
    """Whether any member can change its mode; knots: whether pieces of curves count as modes."""
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if code != INERTER and law_switches(code, model.law[k], model.curves) and (knots or not law_has_pieces(code)):
            return True
    return model.contact_pair.shape[0] > 0


@kernel
def room_for_watched(model):
    """An array for a list of members and contacts: their number, then their places (`watch_all`, `watch_near`)."""
    return np.zeros(1 + model.member.shape[1] + model.contact_pair.shape[0], np.int64)


@kernel
def watch_all(model, segment, watched):
    """Write into `watched` (`room_for_watched`) all members that act in a segment and may switch, and all contacts."""
    found = 0
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if code == INERTER or model.active[segment, k] == 0 or not law_switches(code, model.law[k], model.curves):
            continue
        lo = model.block[k, START]
        for i in range(lo, lo + model.block[k, COUNT]):
            found += 1
            watched[found] = i
    for j in range(model.contact_pair.shape[0]):
        found += 1
        watched[found] = model.member.shape[1] + j
    watched[0] = found


@kernel
def most_switches(model, member_state, watched):
    """How often the members and contacts that are watched may switch at one time.

    A leg that begins to act where it has been crushed already goes through all of its modes: open, elastic, crushing,
    elastic. Of a formula there may be as much to each of its kinks.

    model: the compiled scene.
    member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    watched: the list (`room_for_watched`).
    """
    total = 0
    for m in range(1, watched[0] + 1):
        total += AT_ONCE * margins_of(model, watched[m], int(member_state[MODE, watched[m]]))
    return total


@part
def margins_of(model, i, mode):
    """How many margins member or contact i has in a mode."""
    if i >= model.member.shape[1]:
        return contact_margins(model.contact[i - model.member.shape[1]], mode)
    k = block_of(model, i)
    return law_margins(model.block[k, CODE], model.law[k], mode, model.curves)


@kernel
def watch_near(model, segment, t, member_state, rel0, rel1, h, watched):
    """Write into `watched` those members and contacts that may leave their mode within a step; the others are too
    far from its end.

    The margin of a member is followed on the cubic through its values and rates at both ends, which stays above the
    least of the cubic's four control values. A member is left out where that value is positive and more than
    UNWATCHED_MARGIN of what the margin changes by. Margins with rates in them, and contacts, are always watched.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      t: time at the first pose (s).
      rel0, rel1 (n_pair, POSE): relative poses at both ends.
      h: length of the step (s).
    Out:
      watched: the list (`room_for_watched`), in the order of `watch_all`.
    """
    found = 0
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if code == INERTER or model.active[segment, k] == 0 or not law_switches(code, model.law[k], model.curves):
            continue
        p = model.block[k, PAIR]
        lo = model.block[k, START]
        for i in range(lo, lo + model.block[k, COUNT]):
            for which in range(law_margins(code, model.law[k], int(member_state[MODE, i]), model.curves)):
                s0, d0, plain0 = margin_of_member(model, k, i, which, t, member_state, rel0[p], h)
                s1, d1, plain1 = margin_of_member(model, k, i, which, t + h, member_state, rel1[p], h)
                least = min(min(s0, s1), min(s0 + d0 / 3.0, s1 - d1 / 3.0))
                if not (plain0 and plain1 and least > UNWATCHED_MARGIN * (abs(d0) + abs(d1) + abs(s1 - s0))):
                    found += 1
                    watched[found] = i
                    break
    for j in range(model.contact_pair.shape[0]):
        found += 1
        watched[found] = model.member.shape[1] + j
    watched[0] = found


@part
def margin_of_member(model, k, i, which, t, member_state, r, h):
    """A margin of a member, its change at its present rate within h (s), and whether no rate is in it.

    model: the compiled scene.
    k, i: the block, and the member (padded).
    which: number of the margin, of a law that has several (`law_margins`).
    t: time (s).
    member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    r (POSE,): relative pose of its pair. The change is 0 where rates are in the margin.
    """
    _, x, rate = member_motion(model, i, r)
    x -= member_state[SET, i]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    mode = int(member_state[MODE, i])
    s, by_x, by_rate, by_time = law_one_margin(
        model.block[k, CODE], model.law[k], which, x, rate, mode, t, model.curves, rest
    )
    plain = by_rate == 0.0
    return s, (h * by_x * rate + h * by_time if plain else 0.0), plain


@kernel
def smallest_margin(model, t, member_state, rel, watched):
    """The smallest margin of those that are watched, at time t and relative poses rel (n_pair, POSE); whose it is."""
    best = np.inf
    who = -1
    first = model.member.shape[1]
    for m in range(1, watched[0] + 1):
        i = watched[m]
        if i < first:
            k = block_of(model, i)
            _, x, rate = member_motion(model, i, rel[model.block[k, PAIR]])
            x -= member_state[SET, i]
            code = model.block[k, CODE]
            rest = model.member[MEMBER_FREE_LENGTH, i]
            s = law_margin(code, model.law[k], x, rate, int(member_state[MODE, i]), t, model.curves, rest)
        else:
            j = i - first
            height, rise, room, _, _ = contact_seen(model, j, rel[model.contact_pair[j]])
            s = contact_margin(model.contact[j], height, rise, room, int(member_state[MODE, i]))
        if s < best:
            best = s
            who = i
    return best, who


@kernel
def first_dip(model, t, member_state, rel0, rel1, h, parts, watched):
    """The first place in a step at which a margin is below zero between two poses where it is not: a member leaves
    its mode and comes back.

    Looked for on the cubic through a margin's values and rates at both poses.

    Constant:
      model: the compiled scene.
      t: time at the first pose (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      rel0, rel1 (n_pair, POSE): relative poses at both ends.
      h: time between them (s).
      parts: of how many parts of a step this is one, whose cubic the poses were taken from.
      watched: the members and contacts whose margins are checked (`watch_near`).

    Returns the earliest fraction at which a minimum is below zero, 2 where none is; the fraction of the lowest minimum
    that may be below zero in truth, 2 where there is none; its value, infinite where there is none.
    """
    best = 2.0
    near = 2.0
    low = np.inf
    first = model.member.shape[1]
    for m in range(1, watched[0] + 1):
        i = watched[m]
        k = block_of(model, i) if i < first else -1
        mode = int(member_state[MODE, i])
        for which in range(margins_of(model, i, mode)):
            if k >= 0:
                p = model.block[k, PAIR]
                s0, d0, plain = margin_of_member(model, k, i, which, t, member_state, rel0[p], h)
                if not plain:
                    continue
                s1, d1, plain = margin_of_member(model, k, i, which, t + h, member_state, rel1[p], h)
            else:
                s0, d0, s1, d1, plain = margins_of_contact(model, i - first, which, mode, rel0, rel1, h)
            if not plain:
                continue
            c, dip = lowest_between(s0, d0, s1, d1)
            if dip < 0.0:
                best = min(best, c)
            elif dip < low and dip < CUBIC_ERROR * parts * parts * (d1 - d0):
                low = dip
                near = c
    return best, near, low


@part
def margins_of_contact(model, j, which, mode, rel0, rel1, h):
    """A margin of contact j and its change at its rate within h (s), at both poses; whether no rate is in the margin,
    and it is of the same end.

    model: the compiled scene.
    j, which, mode: the contact, the number of the margin (`contact_margins`), and the mode that it is in.
    rel0, rel1 (n_pair, POSE): relative poses.
    h: a time (s).
    """
    row = model.contact[j]
    p = model.contact_pair[j]
    height, rise, room, room_rate, end = contact_seen(model, j, rel0[p])
    s0, by_height, by_rise, by_room = contact_one_margin(row, which, height, rise, room, mode)
    d0 = h * (by_room * room_rate + by_height * rise)
    height, rise, room, room_rate, at_end = contact_seen(model, j, rel1[p])
    s1, _, _, _ = contact_one_margin(row, which, height, rise, room, mode)
    d1 = h * (by_room * room_rate + by_height * rise)
    return s0, d0, s1, d1, by_rise == 0.0 and (by_room == 0.0 or end == at_end)


@kernel
def lowest_between(s0, d0, s1, d1):
    """Where the cubic with values s0, s1 and slopes d0, d1 at 0 and 1 is lowest between them, and its value there.

    2, infinite where it has no minimum inside, or where s0 or s1 is negative.
    """
    if not (d0 < 0.0 and d1 > 0.0) or s0 < 0.0 or s1 < 0.0:
        return 2.0, np.inf
    # s0 + d0 c + (3 D - 2 d0 - d1) c^2 + (d0 + d1 - 2 D) c^3, D = s1 - s0
    square = 3.0 * (s1 - s0) - 2.0 * d0 - d1
    cube = d0 + d1 - 2.0 * (s1 - s0)
    root = math.sqrt(max(square * square - 3.0 * cube * d0, 0.0))
    c = -d0 / (square + root) if square + root > 0.0 else 0.5
    if not (c > 0.0 and c < 1.0):
        return 2.0, np.inf
    return c, s0 + c * (d0 + c * (square + c * cube))


@kernel
def probes_needed(model, rel0, rel1, watched):
    """In how many parts a step is searched for events: in more where bodies move far compared with a member's
    length.

    The distance from a curved surface's centre or axis is to a contact what its length is to a member.
    """
    needed = 4.0
    first = model.member.shape[1]
    for m in range(1, watched[0] + 1):
        i = watched[m]
        p = model.block[block_of(model, i), PAIR] if i < first else model.contact_pair[i - first]
        moved = deflection(model, rel1, rel0, p)
        if i < first:
            one, _, _ = member_motion(model, i, rel0[p])
            two, _, _ = member_motion(model, i, rel1[p])
            near = min(one, two)
        else:
            near = min(contact_distance(model, i - first, rel0[p]), contact_distance(model, i - first, rel1[p]))
        if near < np.inf:
            needed = max(needed, min(8.0 * moved / max(near, 1e-300), 200.0))
        needed = max(needed, min(4.0 * (turning_rate(model, rel1, p) + turning_rate(model, rel0, p)), 8.0))
    return int(needed)


@kernel
def first_sign(model, t, member_state, q0, v0, q1, v1, rel0, rel1, h, noise, watched):
    """Where in a step a member seems to leave its mode and come back before the end.

    Looked for on the cubic through the states at both ends, in as many parts as the motion asks for, and in each part
    by `first_dip`.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      t: time at the first end (s).
      q0, q1 (n_q,), v0, v1 (n,): coordinates and velocities at both ends.
      rel0, rel1 (n_pair, POSE): relative poses at both ends.
      h: length of the step (s).
      noise: how far below zero a margin is by rounding alone (m).
      watched: the members and contacts whose margins are checked (`watch_near`).

    Returns the earliest fraction, or 2; and the fraction of the lowest margin that may be below zero in truth, or 2.
    """
    if watched[0] == 0:
        return 2.0, 2.0
    parts = probes_needed(model, rel0, rel1, watched)
    q = np.empty(q0.shape[0])
    v = np.empty(v0.shape[0])
    before = rel0.copy()
    rel = np.empty(rel0.shape)
    near = 2.0
    low = np.inf
    for piece in range(1, parts + 1):
        c = piece / parts
        if piece == parts:
            relative_pose(model, q1, v1, rel)
        else:
            cubic(model, c, h, q0, v0, q1, v1, q, v)
            relative_pose(model, q, v, rel)
            margin, _ = smallest_margin(model, t + c * h, member_state, rel, watched)
            if margin < -noise:
                return c, near
        start = t + (c - 1.0 / parts) * h
        dip, may, lowest = first_dip(model, start, member_state, before, rel, h / parts, parts, watched)
        if dip < 1.0:
            return (piece - 1 + dip) / parts, near
        if lowest < low:
            low = lowest
            near = (piece - 1 + may) / parts
        for p in range(rel.shape[0]):
            for i in range(rel.shape[1]):
                before[p, i] = rel[p, i]
    return 2.0, near


@kernel
def is_doubtful(model, t, member_state, q0, v0, q1, v1, rel0, rel1, h, noise, watched):
    """Whether a member may leave its mode and come back within a step; arguments as of `first_sign`.

    model: the compiled scene.
    t: time at the first end (s).
    member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    q0, q1 (n_q,), v0, v1 (n,): coordinates and velocities at both ends.
    rel0, rel1 (n_pair, POSE): relative poses at both ends.
    h: length of the step (s).
    noise: how far below zero a margin is by rounding alone (m).
    watched: the members and contacts whose margins are checked (`watch_near`).
    """
    dip, near = first_sign(model, t, member_state, q0, v0, q1, v1, rel0, rel1, h, noise, watched)
    c = dip if dip < 1.0 else near
    return EDGE < c < 1.0 - EDGE


@kernel
def switch_any(model, segment, t, member_state, rel, q, v, a, who, slopes):
    """Switch a member or contact whose margin is used up, and note what that does to derivatives.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      t: time (s).
      rel (n_pair, POSE): relative poses.
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      who: the member or contact, as a column of `member_state`.
    Out:
      slopes (2, n): s_q / s', s_v / s'; zero at a knot of a curve, whose time makes no difference.

    Returns the mode it goes to, how far its margin goes beyond zero, what a touch that only just happens does
    (`law_grazes`), -s_x / s' (`switch_of`), and by how much its permanent set grows (m).
    """
    old = int(member_state[MODE, who])
    if who >= model.member.shape[1]:
        j = who - model.member.shape[1]
        new, beyond = contact_switch(model, member_state, q, v, a, j, slopes)
        return new, beyond, contact_grazes(model.contact[j], old), 0.0, 0.0
    k = block_of(model, who)
    code = model.block[k, CODE]
    new, beyond, by_set = switch_of(model, segment, t, member_state, q, v, a, who, k, slopes)
    x, _ = stretch_of(model, who, rel[model.block[k, PAIR]])
    x -= member_state[SET, who]
    first = member_state[SCALE, who] != 0.0 and member_state[SET, who] == 0.0
    rest = model.member[MEMBER_FREE_LENGTH, who]
    kind = law_grazes(code, model.law[k], x, old, t, model.curves, rest) if first else 0
    if law_has_pieces(code):  # nothing jumps at a knot: when it is passed makes no difference
        slopes[:] = 0.0
    return new, beyond, kind, by_set, law_set(code, model.law[k], x, old, new)


@kernel
def switch_of(model, segment, t, member_state, q, v, a, i, k, slopes):
    """The mode that a member goes to, s'^2 / (2 |s''|), and -s_x / s'.

    The second, how far its margin s goes beyond zero (m), is given for margins of Delta alone; infinite for others.
    The third is s_p / s' by the permanent set p, which shortens Delta.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      i, k: the member (padded), and its block.
    Out:
      slopes (2, n): s_q / s', s_v / s'.
    """
    n = v.shape[0]
    p = model.block[k, PAIR]
    code = model.block[k, CODE]
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    x, rate = member_rows(model, p, i, q, v, row, row_rate)
    x -= member_state[SET, i]
    second = 0.0
    for r in range(pair_freedoms(model)):
        d = place_in_pair(model, p, r)
        second += row[r] * a[d] + row_rate[r] * v[d]
    mode = int(member_state[MODE, i])
    rest = model.member[MEMBER_FREE_LENGTH, i]
    by_x, by_rate = law_margin_slopes(code, model.law[k], x, rate, mode, t, model.curves, rest)
    speed = by_x * rate + by_rate * second
    speed += law_margin_by_time(code, model.law[k], x, rate, mode, t, model.curves, rest)
    for d in range(n):
        slopes[0, d] = 0.0
        slopes[1, d] = 0.0
    if speed != 0.0:
        for r in range(pair_freedoms(model)):
            d = place_in_pair(model, p, r)
            slopes[0, d] = (by_x * row[r] + by_rate * row_rate[r]) / speed
            slopes[1, d] = by_rate * row[r] / speed
    bend = 2.0 * abs(by_x * second)
    beyond = speed * speed / bend if by_rate == 0.0 and bend > 0.0 else np.inf
    by_set = -by_x / speed if speed != 0.0 else 0.0
    new = law_next(code, model.law[k], x, rate, second, mode, t, model.curves, rest)
    return new, beyond, by_set


@kernel
def block_of(model, i):
    """The block of members that contains padded member i."""
    for k in range(model.block.shape[0]):
        if model.block[k, START] <= i and i < model.block[k, STOP]:
            return k
    return -1
