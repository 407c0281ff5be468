"""What permanent sets do to derivatives: those of members with a law that remembers.

A set p stays what it is from one event that makes it to the next such event, and shifts the elongation:
f* = s f(Delta - p), V = V(Delta - p). So over that time it collects, as a parameter would,

    dG/dp = - s (f_Delta (b . u) + weight V_Delta),   u = -T z,

from every stage with its virtual displacement z. At the event p = Delta(q(t_e)) - const with dDelta/dt = 0, so the time
of the event adds nothing and dp = B dq. Before it the member carried a plateau, which no set changes. The time at
which a member reaches its plateau, or loses contact, depends on its set as well: dt_e = -(s_q dq + s_v dv + s_p dp)/s'.

A parameter of the law stands in that constant too: the set begins with the parameter's own slope, `law_set_slope`, and
one that is made where the law begins to act (`active_from`) moves along the motion with that time.

Sets are counted through the blocks of the law, in their order: slots.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.design.balance_slopes import add_start_velocities
from mdstopo.general.design.parameters import moved_side, varies_member
from mdstopo.general.dynamics.members import MODE, SCALE, SET
from mdstopo.general.model.expressions import FIRST_PART
from mdstopo.general.model.general_model import (
    ALONG_FREE_LENGTH,
    CODE,
    COUNT,
    DESIGN,
    GROUP,
    KIND,
    MEMBER_FORCE,
    MEMBER_FREE_LENGTH,
    OFFSET,
    PAIR,
    START,
    STOP,
    SUBJECT,
    VARIED_BLOCK,
    VARIED_END,
    VARIED_FIRST,
    VARIED_PLACE,
    VARIED_STOP,
    VARIED_VALUE,
)
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.general.responses.general_responses import energy_weight, member_force
from mdstopo.general.steps.step_history import (
    EVENTS,
    MEMBER,
    NEW,
    OLD,
    SEGMENT,
    SET_AFTER,
    SET_BEFORE,
    STATE,
    TIME_BY_SET,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    end_slopes,
    freedoms,
    member_motion,
    member_rows,
    member_work,
    pair_displacement,
    pose_size,
    relative_pose,
)
from mdstopo.mechanics.laws.law_table import (
    ACTIVE_FROM,
    FREE_LENGTH,
    law,
    law_divides,
    law_is_idle,
    law_makes_set,
    law_remembers,
    law_set_slope,
)


@kernel
def count_sets(model):
    """How many members have a set; without any, no other function of this module is called."""
    total = 0
    for k in range(model.block.shape[0]):
        if law_remembers(model.block[k, CODE]):
            total += model.block[k, COUNT]
    return total


@kernel
def slot_of(model, i):
    """The place of member i among those with a permanent set, and its block; -1, -1 where its law does not remember."""
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, CODE]):
            continue
        if model.block[k, START] <= i and i < model.block[k, STOP]:
            return slot + i - model.block[k, START], k
        slot += model.block[k, COUNT]
    return -1, -1


@kernel
def set_slopes(model, k, i, member_state, x, rate):
    """Derivatives of the force and energy of member i by its permanent set: of s f (N/m) and of s V (N).

    model: the compiled scene.
    k: the block of the member.
    i: number of the member (padded).
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    x: elongation less the permanent set (m).
    rate: rate of the elongation (m/s).
    """
    _, by_x, _, _, pull = law(
        model.block[k, CODE], model.law[k], x, rate, int(member_state[MODE, i]), 0.0, 0.0, model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return -member_state[SCALE, i] * by_x, -member_state[SCALE, i] * pull


@kernel
def add_sets(model, segment, member_state, q, v, z, weight, out):
    """Add, at one state, what the permanent sets do to the forces, by their virtual work, and to the stored energy.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v (n,): coordinates and velocities.
      z (n,): virtual displacements at this state.
      weight: factor of the stored energy, that of design members.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    u = np.empty(freedoms(model))
    relative_pose(model, q, v, rel)
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, CODE]):
            continue
        lo = model.block[k, START]
        p = model.block[k, PAIR]
        r = rel[p]
        pair_displacement(model, rel, p, z, u)
        energy = weight if model.block[k, DESIGN] >= 0 else 0.0
        for i in range(lo, lo + model.block[k, COUNT]):
            if model.active[segment, k] != 0:
                length, x, along = member_work(model, i, r, u)
                if length > 0.0:
                    force, stored = set_slopes(model, k, i, member_state, x - member_state[SET, i], 0.0)
                    out[slot] += energy * stored - force * along
            slot += 1


@kernel
def add_sets_of_rows(model, segment, member_state, history, at, z, j, out):
    """`add_sets` at one stage for the virtual displacements of many rows, without energy.

    Constant:
      model: the compiled scene.
      history, at: the history of steps (`StepHistory`), and the number of the stage.
    In:
      segment: number of the stretch of time between two breakpoints.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      z (R, s or more, n), j: virtual displacements of each row at each stage; the stage, counted from the step's first.
    Out:
      out (R, slots): derivatives by the sets, added to.
    """
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    u = np.empty((out.shape[0], freedoms(model)))
    relative_pose(model, history.stage_q[at], history.stage_v[at], rel)
    slot = 0
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if not law_remembers(code):
            continue
        lo = model.block[k, START]
        p = model.block[k, PAIR]
        for m in range(out.shape[0]):
            pair_displacement(model, rel, p, z[m, j], u[m])
        for i in range(lo, lo + model.block[k, COUNT]):
            if model.active[segment, k] != 0 and not law_is_idle(code, int(member_state[MODE, i])):
                length, x, _ = member_motion(model, i, rel[p])
                force, _ = set_slopes(model, k, i, member_state, x - member_state[SET, i], 0.0)
                if length > 0.0 and force != 0.0:
                    for m in range(out.shape[0]):
                        _, _, along = member_work(model, i, rel[p], u[m])
                        out[m, slot] -= force * along
            slot += 1


@kernel
def add_explicit_sets(model, member_state, segment, j, who, slopes, t, q, v, a, bars, scale, out):
    """Add the derivatives, at fixed motion, of forces of members by the permanent sets; of other responses there are
    none.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: number of the member in its group.
      slopes (PARTS,): of an expression by what it is of (`design_slopes`).
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      bars (3, n): slopes of the response by q, v, a, which tell the sign of the force.
      scale: factor of the derivatives.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    for m in range(slopes.shape[0]):
        c = model.response[j, FIRST_PART] + m
        if model.response[c, KIND] == MEMBER_FORCE and slopes[m] != 0.0:
            group = model.response[c, SUBJECT]
            _add_force_sets(model, member_state, segment, group, 0, q, v, scale * slopes[m], out)
    if model.response[j, KIND] != MEMBER_FORCE:
        return
    by_state = np.empty((3, pair_freedoms(model)))
    own = np.empty((2, pair_freedoms(model)))
    group = model.response[j, SUBJECT]
    _, pair = member_force(model, member_state, segment, t, group, who, q, v, a, by_state, own)
    along = 0.0  # the force may be zero here; then its slopes tell its sign
    for c in range(pair_freedoms(model)):
        along += by_state[0, c] * bars[0, place_in_pair(model, pair, c)]
    sign = 1.0 if along >= 0.0 else -1.0
    _add_force_sets(model, member_state, segment, group, who, q, v, scale * sign, out)


@kernel
def _add_force_sets(model, member_state, segment, group, who, q, v, scale, out):
    """Add scale times the derivatives, at fixed motion, of the force f* of one member by the permanent sets.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      group, who: the group, and the number of the member in it.
      q (n_q,), v (n,): coordinates and velocities.
      scale: factor of the derivatives.
    Out:
      out (slots,): added to.
    """
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, CODE]):
            continue
        own_i = who - model.block[k, OFFSET]
        if (
            model.block[k, GROUP] == group
            and model.active[segment, k] != 0
            and own_i >= 0
            and own_i < model.block[k, COUNT]
        ):
            i = model.block[k, START] + own_i
            x, _ = member_rows(model, model.block[k, PAIR], i, q, v, row, row_rate)
            force, _ = set_slopes(model, k, i, member_state, x - member_state[SET, i], 0.0)
            out[slot + own_i] += scale * force
        slot += model.block[k, COUNT]


@kernel
def add_response_sets(model, member_state, segment, j, who, slopes, t, q, v, a, bars, scale, out):
    """Add the derivatives of any response by the permanent sets, at fixed motion.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: of a member force the number of the member in its group.
      slopes (PARTS,): of an expression by what it is of (`design_slopes`).
      t: time (s).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      bars (3, n): slopes of the response by q, v, a.
      scale: factor of the derivatives.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    weight = energy_weight(model, j, slopes)
    if weight != 0.0:
        add_sets(model, segment, member_state, q, v, np.zeros(v.shape[0]), scale * weight, out)
    add_explicit_sets(model, member_state, segment, j, who, slopes, t, q, v, a, bars, scale, out)


@kernel
def made_set(model, history, e):
    """Slot and block of the member whose set event e has made, or -1, -1."""
    slot, k = slot_of(model, history.event[e, MEMBER])
    if slot < 0:
        return -1, -1
    made = law_makes_set(model.block[k, CODE], history.event[e, OLD], history.event[e, NEW])
    if made or history.kept[e, SET_BEFORE] != history.kept[e, SET_AFTER]:
        return slot, k
    return -1, -1


@kernel
def time_back(model, history, e, pulled, bar):
    """Pull the cotangent of the time of event e back to the permanent set of its member, on which that depends:
    added to bar (slots,).

    pulled: derivative of the value that is differentiated by the time of the event (per s).
    """
    slot, _ = slot_of(model, history.event[e, MEMBER])
    if slot >= 0:
        bar[slot] -= pulled * history.kept[e, TIME_BY_SET]


@kernel
def time_forward(model, history, e, sets, later):
    """Add how much later event e happens because its member's permanent set changes: later (M_padded + P,), s per unit.

    sets (slots, M_padded + P): derivatives of the sets (m) by each alpha^mu, then by each value.
    """
    slot, _ = slot_of(model, history.event[e, MEMBER])
    if slot >= 0:
        for i in range(later.shape[0]):
            later[i] -= history.kept[e, TIME_BY_SET] * sets[slot, i]


@kernel
def own_slope(model, history, e, entry, rate):
    """Slope of the set that event e has made by an entry of `varied`; rate: dDelta/dt there."""
    place = model.varied[entry, VARIED_PLACE]
    k = model.varied[entry, VARIED_BLOCK]
    if place < 0:
        side = moved_side(model, entry)
        s = history.event[e, STATE]
        spare = np.empty(pair_freedoms(model))
        by_length, _, _, _ = end_slopes(
            model, model.block[k, PAIR], history.event[e, MEMBER], side, model.along[entry], history.q[s], history.v[s],
            history.v[s], spare,
        )  # fmt: skip
        return by_length - model.along[entry, ALONG_FREE_LENGTH]
    if place <= FREE_LENGTH:
        return law_set_slope(model.block[k, CODE], model.law[k], place)
    if place != ACTIVE_FROM:
        return 0.0
    state = history.event[e, STATE]
    begins = (
        model.active[history.index[state - 1, SEGMENT], k] == 0 if state > 0 else model.varied[entry, VARIED_END] != 0
    )
    return rate if begins else 0.0


@kernel
def begins_divided(model, member_state, q, v, near):
    """A member (padded) whose permanent set at the start depends on varying parameters on one side only, or -1.

    Its derivative differs on both sides; near: how near to such a place counts (m); q, v (n,): the start.
    """
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    for e in range(model.varied.shape[0]):
        k = model.varied[e, VARIED_BLOCK]
        if (
            not law_remembers(model.block[k, CODE])
            or model.varied[e, VARIED_PLACE] > FREE_LENGTH
            or model.active[0, k] == 0
        ):
            continue
        p = model.law[k]
        for i in range(model.varied[e, VARIED_FIRST], model.varied[e, VARIED_STOP]):
            if member_state[SCALE, i] == 0.0:
                continue
            x, rate = member_rows(model, model.block[k, PAIR], i, q, v, row, row_rate)
            if law_divides(model.block[k, CODE], p, x, rate, int(member_state[MODE, i]), near):
                return i
    return -1


@kernel
def sets_back(model, history, e, bar, lam_q, out):
    """Pull the cotangent of the permanent set that event e has made back to the positions and the parameters.

    Nothing where the event has made none.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      e: number of the event.
    In place:
      bar (slots,): cotangents of the sets behind the event; that of the set which was made becomes 0.
    Out:
      lam_q (n,): cotangents of the coordinates at the event, added to.
      out (M_padded + P,): derivatives by the parameters, added to behind the members.
    """
    slot, k = made_set(model, history, e)
    if slot < 0:
        return
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    s = history.event[e, STATE]
    p = model.block[k, PAIR]
    _, rate = member_rows(model, p, history.event[e, MEMBER], history.q[s], history.v[s], row, row_rate)
    for entry in range(model.varied.shape[0]):
        if varies_member(model, entry, history.event[e, MEMBER]):
            own = own_slope(model, history, e, entry, rate)
            out[model.member.shape[1] + model.varied[entry, VARIED_VALUE]] += bar[slot] * own
    for r in range(pair_freedoms(model)):
        lam_q[place_in_pair(model, model.block[k, PAIR], r)] += bar[slot] * row[r]
    bar[slot] = 0.0


@kernel
def keep_start(model, history, lam_q, lam_v, bar, start, out):
    """Finish a reverse sweep at the start: pull back the sets that members begin with, and keep the cotangents there.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In place:
      lam_q, lam_v (n,): cotangents of the start's coordinates and velocities; those of the sets are added to lam_q.
      bar (slots,): cotangents of the sets, which become 0 for those that members begin with.
    Out:
      start (n,): lam_q afterwards; or no length: not wanted.
      out (M_padded + P,): derivatives by the parameters, added to behind the members.
    """
    add_start_velocities(model, lam_v, out)
    if start.shape[0] == 0 and model.varied.shape[0] == 0:
        return
    if bar.shape[0] > 0:
        for e in range(history.index[0, EVENTS]):
            sets_back(model, history, e, bar, lam_q, out)
    for d in range(start.shape[0]):
        start[d] = lam_q[d]


@kernel
def sets_forward(model, history, e, row_of, states, sets):
    """Carry the derivatives of the permanent sets over event e, if it has made one.

    model: the compiled scene.
    history, e: the history of steps (`StepHistory`), and number of the event.
    row_of (n,): which row of `states` has a coordinate, -1 where none has.
    states (W + 1, M_padded + P): derivatives of q, v and the rest of the state, a column each variable
      (`direct.through_step`).
    sets (slots, M_padded + P): derivatives of the sets; the row of the set that was made is written.
    """
    slot, block = made_set(model, history, e)
    if slot < 0:
        return
    row = np.empty(pair_freedoms(model))
    row_rate = np.empty(pair_freedoms(model))
    s = history.event[e, STATE]
    p = model.block[block, PAIR]
    _, rate = member_rows(model, p, history.event[e, MEMBER], history.q[s], history.v[s], row, row_rate)
    for i in range(sets.shape[1]):
        sets[slot, i] = 0.0
        for r in range(pair_freedoms(model)):
            k = row_of[place_in_pair(model, p, r)]
            if k >= 0:
                sets[slot, i] += row[r] * states[k, i]
    for entry in range(model.varied.shape[0]):
        if varies_member(model, entry, history.event[e, MEMBER]):
            sets[slot, model.member.shape[1] + model.varied[entry, VARIED_VALUE]] += own_slope(
                model, history, e, entry, rate
            )
