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
from mdstopo.general.events import member_rows
from mdstopo.general.members import direction, stretched
from mdstopo.general.responses import ENERGY, MEMBER_FORCE, member_force
from mdstopo.mechanics.kinematics.planar_poses import POSE, pair_displacement, relative_pose
from mdstopo.mechanics.laws.table import (
    ACTIVE_FROM,
    FREE_LENGTH,
    law,
    law_divides,
    law_makes_set,
    law_remembers,
    law_set_slope,
)


@kernel
def count_sets(model):
    """How many members have a set; where there are none, nothing here is asked again."""
    total = 0
    for k in range(model.block.shape[0]):
        if law_remembers(model.block[k, 3]):
            total += model.block[k, 5]
    return total


@kernel
def slot_of(model, i):
    """The slot of padded member i and its block; -1, -1 where its law does not remember."""
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, 3]):
            continue
        if model.block[k, 1] <= i and i < model.block[k, 2]:
            return slot + i - model.block[k, 1], k
        slot += model.block[k, 5]
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
    _, by_x, _, _, pull = law(model.block[k, 3], model.law[k], x, rate, int(member_state[1, i]), 0.0, 0.0, model.curves)
    return -member_state[0, i] * by_x, -member_state[0, i] * pull


@kernel
def add_sets(model, segment, member_state, q, v, z, weight, out):
    """Add, at one state, what the permanent sets do to the forces, by their virtual work, and to the stored energy.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q, v (n,): coordinates and velocities (m, rad; m/s, rad/s).
      z (n,): virtual displacements at this state.
      weight: factor of the stored energy, that of design members.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    rel = np.empty((model.pair.shape[0], POSE))
    u = np.empty(3)
    relative_pose(model.pair, model.home, q, v, rel)
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, 3]):
            continue
        lo = model.block[k, 1]
        p = model.block[k, 0]
        r = rel[p]
        pair_displacement(model.pair, rel, p, z, u)
        energy = weight if model.block[k, 4] >= 0 else 0.0
        for i in range(lo, lo + model.block[k, 5]):
            if model.active[segment, k] != 0:
                length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
                if length > 0.0:
                    force, stored = set_slopes(
                        model, k, i, member_state, stretched(model.member, i, r, length) - member_state[2, i], 0.0
                    )
                    out[slot] += energy * stored - force * (bx * u[0] + by * u[1] + bt * u[2])
            slot += 1


@kernel
def add_explicit_sets(model, member_state, segment, j, who, t, q, v, a, bars, scale, out):
    """Add the derivatives, at fixed motion, of a member force by the permanent sets; of other responses there are none.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: number of the member in its group.
      t: time (s).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; m/s, rad/s; m/s^2, rad/s^2).
      bars (3, n): slopes of the response by q, v, a, which tell the sign of the force.
      scale: factor of the derivatives.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    if model.response[j, 0] != MEMBER_FORCE:
        return
    row = np.empty(6)
    row_rate = np.empty(6)
    slopes = np.empty((3, 6))
    own = np.empty((2, 6))
    group = model.response[j, 5]
    _, pair = member_force(model, member_state, segment, t, group, who, q, v, a, slopes, own)
    along = 0.0  # the force may be zero here; then its slopes tell its sign
    for c in range(6):
        along += slopes[0, c] * bars[0, 3 * model.pair[pair, c // 3] + c % 3]
    sign = 1.0 if along >= 0.0 else -1.0
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, 3]):
            continue
        own_i = who - model.block[k, 7]
        if model.block[k, 6] == group and model.active[segment, k] != 0 and own_i >= 0 and own_i < model.block[k, 5]:
            i = model.block[k, 1] + own_i
            x, _ = member_rows(model, model.block[k, 0], i, q, v, row, row_rate)
            force, _ = set_slopes(model, k, i, member_state, x - member_state[2, i], 0.0)
            out[slot + own_i] += scale * sign * force
        slot += model.block[k, 5]


@kernel
def add_looked_sets(model, member_state, segment, j, who, t, q, v, a, bars, scale, out):
    """Add the derivatives, at fixed motion, of any response by the permanent sets.

    Constant:
      model: the compiled scene.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      segment: number of the stretch of time between two breakpoints.
      j: the response.
      who: of a member force the number of the member in its group.
      t: time (s).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; m/s, rad/s; m/s^2, rad/s^2).
      bars (3, n): slopes of the response by q, v, a.
      scale: factor of the derivatives.
    Out:
      out (slots,): derivatives by the sets, added to.
    """
    if model.response[j, 0] == ENERGY:
        add_sets(model, segment, member_state, q, v, np.zeros(q.shape[0]), scale, out)
    else:
        add_explicit_sets(model, member_state, segment, j, who, t, q, v, a, bars, scale, out)


@kernel
def made_set(model, history, e):
    """Slot and block of the member whose set event e has made, or -1, -1."""
    slot, k = slot_of(model, history.event[e, 1])
    if slot < 0:
        return -1, -1
    made = law_makes_set(model.block[k, 3], history.event[e, 2], history.event[e, 3])
    if made or history.kept[e, 0] != history.kept[e, 1]:
        return slot, k
    return -1, -1


@kernel
def time_back(model, history, e, pulled, bar):
    """Add to bar (slots,), the cotangents of the sets, what they do to the time of event e.

    pulled: derivative of the value that is differentiated by the time of the event (per s).
    """
    slot, _ = slot_of(model, history.event[e, 1])
    if slot >= 0:
        bar[slot] -= pulled * history.kept[e, 2]


@kernel
def time_forward(model, history, e, sets, i):
    """How much later event e happens because its member's permanent set changes (s per unit of variable i).

    sets (slots, M_padded + P): derivatives of the sets (m) by each alpha^mu, then by each value; i: one of these.
    """
    slot, _ = slot_of(model, history.event[e, 1])
    return -history.kept[e, 2] * sets[slot, i] if slot >= 0 else 0.0


@kernel
def own_slope(model, history, e, entry, rate):
    """Slope of the set that event e has made by the parameter of an entry of `varied`; rate: dDelta/dt there."""
    place = model.varied[entry, 1]
    k = model.varied[entry, 0]
    if place <= FREE_LENGTH:
        return law_set_slope(model.block[k, 3], model.law[k], place)
    if place != ACTIVE_FROM:
        return 0.0
    state = history.event[e, 0]
    begins = model.active[history.index[state - 1, 2], k] == 0 if state > 0 else model.varied[entry, 3] != 0
    return rate if begins else 0.0


@kernel
def begins_divided(model, member_state, q, v, near):
    """A member (padded) whose permanent set at the start depends on varying parameters on one side only, or -1.

    Its derivative differs on both sides; near: how near to such a place counts (m); q, v (n,): the start.
    """
    row = np.empty(6)
    row_rate = np.empty(6)
    for e in range(model.varied.shape[0]):
        k = model.varied[e, 0]
        if not law_remembers(model.block[k, 3]) or model.varied[e, 1] > FREE_LENGTH or model.active[0, k] == 0:
            continue
        p = model.law[k]
        for i in range(model.block[k, 1], model.block[k, 1] + model.block[k, 5]):
            if member_state[0, i] == 0.0:
                continue
            x, rate = member_rows(model, model.block[k, 0], i, q, v, row, row_rate)
            if law_divides(model.block[k, 3], p, x, rate, int(member_state[1, i]), near):
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
    row = np.empty(6)
    row_rate = np.empty(6)
    state = history.state[history.event[e, 0]]
    _, rate = member_rows(model, model.block[k, 0], history.event[e, 1], state[0], state[1], row, row_rate)
    for entry in range(model.varied.shape[0]):
        if model.varied[entry, 0] == k:
            own = own_slope(model, history, e, entry, rate)
            out[model.member.shape[1] + model.varied[entry, 2]] += bar[slot] * own
    for r in range(6):
        lam_q[3 * model.pair[model.block[k, 0], r // 3] + r % 3] += bar[slot] * row[r]
    bar[slot] = 0.0


@kernel
def keep_start(model, history, lam_q, bar, start, out):
    """Finish a reverse sweep at the start: pull back the sets that members begin with, and keep the cotangents there.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In place:
      lam_q (n,): cotangents of the start's coordinates; those of the sets are added to them.
      bar (slots,): cotangents of the sets, which become 0 for those that members begin with.
    Out:
      start (n,): lam_q afterwards; or no length: not wanted.
      out (M_padded + P,): derivatives by the parameters, added to behind the members.
    """
    if start.shape[0] == 0 and model.varied.shape[0] == 0:
        return
    if bar.shape[0] > 0:
        for e in range(history.index[0, 3]):
            sets_back(model, history, e, bar, lam_q, out)
    for d in range(start.shape[0]):
        start[d] = lam_q[d]


@kernel
def sets_forward(model, history, e, column, sets):
    """Carry the derivatives of the permanent sets over event e, if it has made one.

    column (M_padded + P, 4 n + 1): derivatives of q, v and the rest of the state, a row each variable
      (`direct.through_step`).
    sets (slots, M_padded + P): derivatives of the sets; the row of the set that was made is written.
    """
    slot, k = made_set(model, history, e)
    if slot < 0:
        return
    row = np.empty(6)
    row_rate = np.empty(6)
    state = history.state[history.event[e, 0]]
    _, rate = member_rows(model, model.block[k, 0], history.event[e, 1], state[0], state[1], row, row_rate)
    for i in range(column.shape[0]):
        sets[slot, i] = 0.0
        for r in range(6):
            sets[slot, i] += row[r] * column[i, 3 * model.pair[model.block[k, 0], r // 3] + r % 3]
    for entry in range(model.varied.shape[0]):
        if model.varied[entry, 0] == k:
            sets[slot, model.member.shape[1] + model.varied[entry, 2]] += own_slope(model, history, e, entry, rate)


@kernel
def through_sets(model, member_state, history, w, matrix, out):
    """What unit changes of the permanent sets do to the end of a step.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      w: number of the step.
      matrix (4 n + s n, 4 n + 1): the map of the step (`direct.step_map`).
    Out:
      out (slots, 4 n + 1): changes of q, v, the carried rows and the integral, per m of set.
    """
    n = model.mass.shape[0]
    segment = history.index[w, 2]
    o = history.index[w, 0]
    row = np.empty(6)
    row_rate = np.empty(6)
    slot = 0
    for k in range(model.block.shape[0]):
        if not law_remembers(model.block[k, 3]):
            continue
        p = model.block[k, 0]
        lo = model.block[k, 1]
        for i in range(lo, lo + model.block[k, 5]):
            out[slot] = 0.0
            if model.active[segment, k] != 0:
                for j in range(history.index[w + 1, 0] - o):
                    stage = history.stage[o + j]
                    x, rate = member_rows(model, p, i, stage[0], stage[1], row, row_rate)
                    force, _ = set_slopes(model, k, i, member_state, x - member_state[2, i], rate)
                    if force == 0.0:
                        continue
                    for r in range(6):
                        b = (4 + j) * n + 3 * model.pair[p, r // 3] + r % 3
                        for d in range(out.shape[1]):
                            out[slot, d] -= force * row[r] * matrix[b, d]
            slot += 1
