"""Where a step ends because a member switches: the first moment on the step's own polynomial (`step_inside`).

That a member leaves its mode shows at the end of the step, or the cubic through both ends says where it might, come and
go in between. Then four balances more make the polynomial, on which margins cost no balance: it is cut where something
is doubtful, and both pieces are checked in the same way, until nothing is. The root is bracketed and closed in on by
secants, first beside the joints; at last it is corrected by what putting the state onto them changes. It is met to
rounding, on its far side.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.events.events import first_sign, smallest_margin
from mdstopo.general.events.locate import (
    BEHIND_SWITCH,
    CUTS,
    NEAR_SWITCH,
    RATE_SHIFT,
    RESOLUTION,
    TRIALS,
    cut_at,
    matters,
    narrowed,
    next_trial,
)
from mdstopo.general.model.bundles import bundle
from mdstopo.general.steps.step_history import copy_vector
from mdstopo.general.steps.step_inside import state_inside, weigh_inside
from mdstopo.integrators.runge_kutta_tables import INSIDE
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, end_state, pose_size, relative_pose

#: what `first_event` reads of a step and writes on: the scene, the second method's table, the size of the scene (m),
#: state of the members, start and stages of the step, workspace of a balance, the members that are watched; then its
#: room: a table, multipliers of a projection, a state, states at cuts with their fractions, poses
FIELDS = (
    "model", "table", "size", "member_state", "q0", "v0", "q", "v", "a", "workspace", "watched", "scaled", "push",
    "at_q", "at_v", "cut", "cut_q", "cut_v", "left_q", "left_v", "rel", "before", "crossed", "single",
)  # fmt: skip
#: corrections of the moment after it has been found beside the joints
CORRECTIONS = 12
#: the same between bounds, and after how many the interval is halved
BOUNDED, HALVED = 90, 30
#: how many switches in turn may hide before one that is found, as their margins are used up for a while only; at how
#: many places that is looked for
HIDDEN, PROBES = 8, 8


class Landing:
    """A step that is searched for an event, inside kernels; `FIELDS` names its parts, `landing_of` makes it."""

    def __init__(self, *_parts: object) -> None: ...


bundle(Landing, FIELDS)


@kernel
def landing_of(model, table, size, member_state, q0, v0, q, v, a, workspace, watched):
    """A `Landing` with its arrays.

    model: the compiled scene.
    table (3, 17, 17): coefficients of the second method.
    size: size of the scene (m).
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    q0 (n_q,), v0 (n,): the start of the step.
    q (17, n_q), v, a (17, n): its stages.
    workspace: workspace of a balance.
    watched: the members that may switch in it.
    """
    n_q, n = q0.shape[0], v0.shape[0]
    pose = (model.pair.shape[0], pose_size(model))
    return Landing(
        model, table, size, member_state, q0, v0, q, v, a, workspace, watched, np.zeros(table.shape),
        np.zeros((2, model.size[0])), np.empty(n_q), np.empty(n), np.empty(CUTS + 1), np.empty((CUTS + 1, n_q)),
        np.empty((CUTS + 1, n)), np.empty(n_q), np.empty(n), np.empty(pose), np.empty(pose),
        np.zeros_like(watched), np.zeros(2, np.int64),
    )  # fmt: skip


@kernel
def margin_inside(step, segment, t, h, c, watched, on_joints, q, v):
    """The smallest margin at fraction c of a step, and whose it is.

    step: the step (`Landing`); its `rel` and `push` are overwritten.
    segment: number of the stretch of time between two breakpoints.
    t, h, c: time at the start of the step, its length (s), and the fraction of it.
    watched: the members and contacts whose margins are checked.
    on_joints: whether the state is put onto the joints.
    q (n_q,), v (n,): the state, out.
    """
    model = step.model
    if on_joints:
        state_inside(
            model, step.table, segment, t, h, c, step.q0, step.v0, step.q, step.v, step.a, step.workspace, step.size,
            step.scaled, q, v, step.push,
        )  # fmt: skip
    else:
        weigh_inside(step.table, c, step.scaled)
        end_state(
            model, step.scaled, INSIDE, c * h, step.q0, step.v0, step.q, step.v, step.a, step.workspace.slopes, q, v
        )
        drive_state(model, segment, t + c * h, q, v)
    relative_pose(model, q, v, step.rel)
    return smallest_margin(model, t + c * h, step.member_state, step.rel, watched)


@kernel
def first_piece(step, segment, t, h, graze, rounding, end_q, end_v, margin, where):
    """The first piece of a step at whose end a margin is used up.

    step: the step (`Landing`); `cut`, `left_q` and what belongs to them are overwritten.
    segment: number of the stretch of time between two breakpoints.
    t, h: time at the start of the step, and its length (s).
    graze: a member whose margin would fall below zero by less than this only grazes (m).
    rounding: what rounding leaves of a margin.
    end_q (n_q,), end_v (n,), margin: the end of the step, and the smallest margin there.
    where (3,): where[2] becomes a member that grazes so that the motion has no derivative.

    Returns the fractions of the step at both ends of the piece, and the margin at its end; where there is no such
    piece, the first is 2. `step.before` and `step.rel` have the poses at its ends.
    """
    model, member_state, watched = step.model, step.member_state, step.watched
    low = 0.0
    top = 0
    cuts = 0
    step.cut[0] = 1.0
    at_high = margin
    copy_vector(end_q, step.cut_q[0])
    copy_vector(end_v, step.cut_v[0])
    copy_vector(step.q0, step.left_q)
    copy_vector(step.v0, step.left_v)
    while top >= 0:
        relative_pose(model, step.left_q, step.left_v, step.before)
        relative_pose(model, step.cut_q[top], step.cut_v[top], step.rel)
        dip, near = first_sign(
            model, t + low * h, member_state, step.left_q, step.left_v, step.cut_q[top], step.cut_v[top], step.before,
            step.rel, (step.cut[top] - low) * h, rounding, watched,
        )  # fmt: skip
        middle = cut_at(dip, near, low, step.cut[top])
        if middle < 0.0 or cuts == CUTS:
            if top == 0 and margin < -rounding:
                break
            low = step.cut[top]
            copy_vector(step.cut_q[top], step.left_q)
            copy_vector(step.cut_v[top], step.left_v)
            top -= 1
            continue
        cuts += 1
        top += 1
        step.cut[top] = middle
        value, who = margin_inside(
            step, segment, t, h, middle, watched, np.bool_(False), step.cut_q[top], step.cut_v[top]
        )
        if value < -rounding:
            at_high = value
            break
        if value < graze and matters(model, t + middle * h, member_state, step.rel, who):
            where[2] = who
    if top < 0:
        return 2.0, 2.0, 0.0
    relative_pose(model, step.left_q, step.left_v, step.before)
    return low, step.cut[top], at_high


@kernel
def keep_used(step, t, rounding):
    """Keep on the list of watched members those alone whose margin is used up at time t, `step.rel`."""
    step.single[0] = 1
    found = 0
    for m in range(1, step.watched[0] + 1):
        step.single[1] = step.watched[m]
        margin, _ = smallest_margin(step.model, t, step.member_state, step.rel, step.single)
        if margin < -rounding:
            found += 1
            step.crossed[found] = step.watched[m]
    step.crossed[0] = found


@kernel
def root_inside(step, segment, t, h, low, high, at_high, rounding, resolution):
    """The moment within a step at which the smallest margin of the members `step.crossed` is used up, without
    projection onto the joints.

    step: the step (`Landing`), with the poses at `low` in `before`.
    segment: number of the stretch of time between two breakpoints.
    t, h: time at the start of the step, and its length (s).
    low, high: fractions of the step between which that happens.
    at_high: the margin at the second.
    rounding: what rounding leaves of a margin.
    resolution: of fractions.

    Returns the fraction, on the far side.
    """
    crossed = step.crossed
    at_low, _ = smallest_margin(step.model, t + low * h, step.member_state, step.before, crossed)
    at_low = max(at_low, rounding)
    side = 0
    last = low
    at_last = at_low
    before = high
    at_before = at_high
    for tries in range(TRIALS):
        apart = last - before
        slope = (at_last - at_before) / apart if apart != 0.0 else 0.0
        foreseen = last - (at_last + BEHIND_SWITCH * rounding) / slope if slope < 0.0 and tries > 0 else -1.0
        middle = next_trial(low, high, at_low, at_high, foreseen, rounding, resolution, tries)
        if middle < 0.0:
            break
        value, _ = margin_inside(step, segment, t, h, middle, crossed, np.bool_(False), step.at_q, step.at_v)
        before = last
        at_before = at_last
        last = middle
        at_last = value
        low, high, at_low, at_high, side = narrowed(low, high, at_low, at_high, middle, value, rounding, side)
    return high


@kernel
def used_before(step, segment, t, h, low, c, at_c, who, rounding):
    """Whether a margin is used up before a root, as one with a rate in it may be for a while only.

    step: the step (`Landing`), all of whose watched members are checked.
    segment: number of the stretch of time between two breakpoints.
    t, h: time at the start of the step, and its length (s).
    low: a fraction of the step at which no margin is used up.
    c, at_c, who: the root, the margin there, and the member that it belongs to.
    rounding: what rounding leaves of a margin.

    Returns a fraction, 2 where there is none, and the margin there; `step.rel` has the poses.
    """
    for probe in range(1, PROBES + 1):
        earlier = low + (c - low) * probe / PROBES
        value, other = margin_inside(step, segment, t, h, earlier, step.watched, np.bool_(False), step.at_q, step.at_v)
        if value < -rounding and (probe < PROBES or (other != who and value < at_c)):
            return earlier, value
    return 2.0, 0.0


@kernel
def on_joints(step, segment, t, h, low, c, value, who, rate, rounding, resolution):
    """Correct the moment of an event for the projection onto the joints, by Newton's method between bounds.

    step: the step (`Landing`), whose members `crossed` are checked.
    segment: number of the stretch of time between two breakpoints.
    t, h: time at the start of the step, and its length (s).
    low: a fraction of the step at which no margin is used up.
    c, value, who: where the event is beside the joints, the margin there on the joints, and whose it is.
    rate: of the margin there (per s).
    rounding: what rounding leaves of a margin.
    resolution: of fractions.

    Returns what `first_event` does.
    """
    crossed = step.crossed
    high = 2.0
    wider = 1.0
    for tries in range(BOUNDED):
        if value < -rounding:
            high = c
            if value >= -NEAR_SWITCH * rounding or not rate < 0.0 or high - low <= resolution:
                return c, who, rate
        else:
            low = c
            if c >= 1.0:
                break
        shift = -(value + BEHIND_SWITCH * rounding) / (rate * h) if rate < 0.0 else 0.0
        if abs(shift) < resolution:
            shift = resolution if value >= -rounding else -resolution
        c += shift
        if high > 1.0:  # not on the far side yet
            c = min(max(c, low + wider * resolution), 1.0)
            wider *= 4.0
        elif not low < c < high or tries >= HALVED:
            c = 0.5 * (low + high)
            if c <= low or c >= high:
                c = high
                low = high
        value, who = margin_inside(step, segment, t, h, c, crossed, np.bool_(True), step.at_q, step.at_v)
    if high > 1.0:
        return 2.0, -1, 0.0
    _, who = margin_inside(step, segment, t, h, high, crossed, np.bool_(True), step.at_q, step.at_v)
    return high, who, rate


@kernel
def first_event(step, segment, t, h, graze, rounding, end_q, end_v, margin, where):
    """Where on the polynomial of a step, whose 16 stages have been made, the first member leaves its mode.

    step: the step (`Landing`).
    segment: number of the stretch of time between two breakpoints.
    t, h: time at the start of the step, and its length (s).
    graze: a member whose margin would fall below zero by less than this only grazes (m).
    rounding: what rounding leaves of a margin.
    end_q (n_q,), end_v (n,), margin: the end of the step, and the smallest margin there.
    where (3,): where[2] becomes a member that grazes so that the motion has no derivative.

    Returns the fraction of the step, 2 where no member leaves its mode; then `step.at_q`, `step.at_v` and `step.push`
    have the state, on the joints; the member; and the rate of its margin (per s).
    """
    low, high, at_high = first_piece(step, segment, t, h, graze, rounding, end_q, end_v, margin, where)
    if low > 1.0:
        return 2.0, -1, 0.0
    begin = low
    crossed = step.crossed
    resolution = RESOLUTION * (abs(t) + h) / h
    jointed = step.model.size[0] > 0
    no = np.bool_(False)
    c = high
    who = -1
    for _ in range(HIDDEN):
        keep_used(step, t + c * h, rounding)
        c = root_inside(step, segment, t, h, begin, c, at_high, rounding, resolution)
        at_high, who = margin_inside(step, segment, t, h, c, crossed, no, step.at_q, step.at_v)
        earlier, lower = used_before(step, segment, t, h, begin, c, at_high, who, rounding)
        if earlier > 1.0:
            break
        c = earlier
        at_high = lower
    beside = c - RATE_SHIFT * (c - begin)
    step.single[0] = 1  # its margin alone has a slope there: that of another may be the smallest before
    step.single[1] = who
    value, _ = margin_inside(step, segment, t, h, beside, step.single, no, step.at_q, step.at_v)
    rate = (at_high - value) / ((c - beside) * h) if c > beside else 0.0
    value, who = margin_inside(step, segment, t, h, c, crossed, np.bool_(True), step.at_q, step.at_v)
    if jointed:
        c, who, rate = on_joints(step, segment, t, h, begin, c, value, who, rate, rounding, resolution)
    if c < resolution:  # time would stand still, and a step without length has no slopes
        c = resolution
        _, who = margin_inside(step, segment, t, h, c, crossed, np.bool_(True), step.at_q, step.at_v)
    return c, who, rate
