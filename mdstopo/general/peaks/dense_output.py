"""What Python calls for finished steps of a general scene: states and responses anywhere on the motion."""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.forces import members_alone
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import ENERGY, KIND, ORDER, SUBJECT, unpack_general
from mdstopo.general.model.strides import pair_freedoms, place_in_joint, place_in_pair
from mdstopo.general.responses.general_responses import (
    RATE_SHIFT,
    chosen_part,
    follows_state,
    group_forces,
    group_rates,
    is_chosen,
    is_plain,
    needs_balance,
    rated,
    response,
)
from mdstopo.general.steps.method_interface import derivatives, is_continuous, is_explicit, point_of, state_at_offset
from mdstopo.general.steps.step_history import EVENTS, FIRST, SEGMENT, carve_history, copy_vector, restore_modes
from mdstopo.integrators.steps import FORCES, OF_SAMPLES
from mdstopo.mechanics.kinematics.kinematics_interface import drive_state, most_rows, quintic, relative_pose

#: a finished motion, and a workspace for responses on it: the scene, the method's coefficients, state of the members,
#: steps and how many there are; one state with its multipliers, slopes of the response there, states beside it
FIELDS = (
    "model", "tables", "member_state", "history", "count", "work", "workspace", "q", "v", "a", "lam", "bars", "row_bar",
    "near_q", "near", "own", "ends_q", "ends",
)  # fmt: skip


class Motion:
    """A finished motion inside kernels, whose parts `FIELDS` names; made by `finished`."""

    def __init__(self, *_parts: Any) -> None: ...


bundle(Motion, FIELDS)


@kernel
def finished(model, tables, member_state, history, count, work):
    """A `Motion`, with its workspace.

    model: the compiled scene.
    tables: coefficients of the method.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    history: the history of steps (`StepHistory`).
    count: number of steps.
    work (WORK,): counts of work, added to.
    """
    n_q = model.q0.shape[0]
    n = model.mass.shape[0]
    n_row = model.size[0]
    # few arrays with many rows: each of its own would take as long as a short step
    places = np.empty((4, n_q))
    vectors = np.zeros((12, n))
    multipliers = np.zeros((3, n_row))
    return Motion(
        model, tables, member_state, history, count, work, make_workspace(model), places[0], vectors[0], vectors[1],
        multipliers[0], vectors[2:5], multipliers[1], places[1], vectors[5:8], multipliers[2], places[2:4],
        vectors[8:].reshape((2, 2, n)),
    )  # fmt: skip


@part
def goes_on(history, k):
    """Whether no law, load or mode changes between step k, which is not the first one, and the step before."""
    return (
        history.index[k, SEGMENT] == history.index[k - 1, SEGMENT]
        and history.index[k, EVENTS] == history.index[k - 1, EVENTS]
    )


@kernel
def known_at(tag, history, count, k, e):
    """The number of the stage whose accelerations are those at the start (e = 0) or the end (e = 1) of step k; -1
    where none is.

    The first stage of an explicit step is its start; what is in front of a boundary is what is behind it where no law,
    load or mode changes there.

    tag: the method of integration (`method_interface`).
    history, count: the history of steps, and how many steps it has.
    """
    if not is_explicit(tag) or k + e >= count:
        return -1
    return history.index[k + e, FIRST] if e == 0 or goes_on(history, k + e) else -1


@kernel
def balance_at_end(tag, motion, k, e, q, v, a):
    """Accelerations at the start (e = 0) or the end (e = 1) of step k, on its own side, with the modes of that step.

    tag: the method of integration (`method_interface`).
    motion: the finished motion, whose modes are those of the step; lam and the relative poses of its workspace are put
      in place, the rest of this is overwritten.
    k, e: the step, and its end.
    q (n_q,), v (n,): the state there, whose driven part is put in place.
    a (n,): the accelerations, out.
    """
    model, history = motion.model, motion.history
    segment, t = history.index[k, SEGMENT], history.t[k + e]
    known = known_at(tag, history, motion.count, k, e)
    if known >= 0:
        drive_state(model, segment, t, q, v)
        copy_vector(history.stage_a[known], a)
        copy_vector(history.lam[known], motion.lam)
        relative_pose(model, q, v, motion.workspace.rel)
        return
    solve_accelerations(
        model, motion.member_state, segment, t, q, v, np.bool_(False), motion.workspace, a, motion.lam
    )  # fmt: skip
    motion.work[FORCES] += 1
    motion.work[OF_SAMPLES] += 1


@kernel
def evaluate_here(tag, motion, j, k, c, who, rates, balanced, purpose):
    """Response j at the state in `motion.q` and `motion.v`, of fraction c of step k, whose modes are put in place.

    tag: the method of integration (`method_interface`).
    motion: the finished motion; a, lam, bars, row_bar and the workspace are overwritten.
    j: the response; below 0 only the balance is made. k, c: the step, and the fraction of it.
    who: the member whose force is meant; -1: the one with the largest.
    rates, balanced: whether the rate is wanted, and a and lam whatever the response needs (`general_responses.rated`).
    purpose: place in `work` of what the balances are for (`integrators.steps`).

    Returns the value, its rate (per s) and the number of the member.
    """
    t = time_at(motion.history, k, c)
    q, v, a, lam = motion.q, motion.v, motion.a, motion.lam
    model = motion.model
    found = 0
    if j >= 0 and who < 0 and is_chosen(model, j):
        found = 1
        segment = motion.history.index[k, SEGMENT]
        solve_accelerations(model, motion.member_state, segment, t, q, v, np.bool_(False), motion.workspace, a, lam)
        who = chosen_part(model, motion.member_state, segment, j, who, t, q, v, a, lam, motion.workspace)
    value, rate, made = rated(
        tag, model, motion.member_state, motion.history, k, c, j, who, rates, balanced, t, q, v, motion.workspace, a,
        lam, motion.bars, motion.row_bar, motion.near_q, motion.near, motion.own,
    )  # fmt: skip
    motion.work[FORCES] += made + found
    motion.work[purpose] += made + found
    return value, rate, who


@entry
def sample_responses(
    tag,
    ints,
    floats,
    tables,
    limits,
    count,
    room,
    room_ints,
    member_state,
    exact,
    rates,
    js,
    who,
    places,
    out_q,
    out,
    lam_out,
    seen,
    work,
):
    """States, and values and rates of responses, at any places of a finished motion.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      exact: whether states inside steps are those of the method's own motion; else of the quintic through the
        coordinates, velocities and accelerations at both ends.
      rates: whether rates are wanted; else a and lam_out are only what the responses need of them, and those of
        driven coordinates mean nothing.
      js (R,): the responses; none: states alone.
      who (K, R): numbers of the members whose forces are meant; -1: of the one with the largest force there.
      places (K, 2): steps, and fractions of them; 0 and 1 are the states at the ends as they are in that step.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      out_q (K, n_q), out (2, K, n): coordinates, and velocities and accelerations; no rows: no states are wanted.
      lam_out (K, n_row + n_driven): multipliers of the solved rows, then those of the driven coordinates, what
        M a + Phi_q^T lam = F leaves to them.
      seen (K, R, 3): values of the responses, their rates (per s), numbers of the members.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    motion = finished(model, tables, member_state, history, count, work)
    n_row = model.size[0]
    last = -1
    driven = model.driven.shape[0] > 0
    needed = balance_of(tag, model, js)
    for i in range(places.shape[0]):
        k = int(places[i, 0])
        c = places[i, 1]
        last = go_to(tag, motion, k, c, exact, last)
        if rates or js.shape[0] == 0:
            _with_rates(tag, motion, js, k, c, who[i], rates, seen[i])
        else:
            _values(tag, motion, js, k, c, who[i], needed, seen[i])
        # the workspace is of a state beside it
        if driven and rates and js.shape[0] > 0 and not follows_state(tag, model, js[js.shape[0] - 1]):
            segment = history.index[k, SEGMENT]
            t = time_at(history, k, c)
            solve_accelerations(
                model, member_state, segment, t, motion.q, motion.v, np.bool_(False), motion.workspace, motion.a,
                motion.lam,
            )  # fmt: skip
        if out_q.shape[0] == 0:
            continue
        copy_vector(motion.q, out_q[i])
        copy_vector(motion.v, out[0, i])
        copy_vector(motion.a, out[1, i])
        copy_vector(motion.lam, lam_out[i, :n_row])
        for m in range(model.driven.shape[0]):
            d = model.driven[m]
            force = motion.workspace.f[d] - model.mass[d] * motion.a[d]
            lam_out[i, n_row + m] = force - held_back(model, motion.workspace, d, motion.a, motion.lam)


#: what values of responses take beyond the state: nothing, sums over the members, accelerations, all that a balance
#: leaves
NOTHING, SUMS, ACCELERATIONS, BALANCE = range(4)


@kernel
def balance_of(tag, model, js):
    """What the values of responses js (R,) take beyond the state, the most that any of them takes.

    tag: the method of integration; energies take sums alone where it has states inside steps (`rated`).
    """
    sums = False
    accelerations = False
    for j in js:
        if is_continuous(tag) and model.response[j, KIND] == ENERGY:
            sums = True
        elif needs_balance(model, j):
            return BALANCE
        elif model.response[j, ORDER] > 1:
            accelerations = True
    if sums:
        return BALANCE if accelerations else SUMS
    return ACCELERATIONS if accelerations else NOTHING


@kernel
def _with_rates(tag, motion, js, k, c, who, rates, seen):
    """Values, rates and members of responses at the state of the motion: as `sample_responses` has them.

    tag: the method of integration (`method_interface`). motion: the finished motion.
    js (R,), who (R,): the responses, and the members whose forces are meant; without any only the balance is made.
    k, c: the step, and the fraction of it. rates: whether rates are wanted. seen (R, 3): out.
    """
    if js.shape[0] == 0:
        evaluate_here(tag, motion, np.int64(-1), k, c, np.int64(-1), rates, rates, OF_SAMPLES)
    for r in range(js.shape[0]):
        seen[r, 0], seen[r, 1], seen[r, 2] = evaluate_here(
            tag, motion, js[r], k, c, who[r], rates, rates, OF_SAMPLES
        )  # fmt: skip


@kernel
def _values(tag, motion, js, k, c, who, needed, seen):
    """Values and members of responses at the state of the motion, of which one balance serves all; rates are 0.

    tag: the method of integration (`method_interface`). motion: the finished motion.
    js (R,), who (R,): the responses, and the members whose forces are meant. k, c: the step, and the fraction of it.
    needed: what they take of a balance (`balance_of`). seen (R, 3): out.
    """
    model, member_state, workspace = motion.model, motion.member_state, motion.workspace
    q, v, a, lam = motion.q, motion.v, motion.a, motion.lam
    segment, t = motion.history.index[k, SEGMENT], time_at(motion.history, k, c)
    if needed == ACCELERATIONS and (c <= 0.0 or c >= 1.0):
        balance_at_end(tag, motion, k, 1 if c >= 1.0 else 0, q, v, a)
    elif needed == SUMS:
        members_alone(model, member_state, segment, t, q, v, workspace)
        motion.work[FORCES] += 1
        motion.work[OF_SAMPLES] += 1
    elif needed != NOTHING:
        solve_accelerations(model, member_state, segment, t, q, v, np.bool_(False), workspace, a, lam)
        motion.work[FORCES] += 1
        motion.work[OF_SAMPLES] += 1
    for r in range(js.shape[0]):
        j = js[r]
        part = chosen_part(model, member_state, segment, j, who[r], t, q, v, a, lam, workspace)
        seen[r, 0] = response(
            model, member_state, segment, j, part, t, q, v, a, lam, workspace, motion.bars, motion.row_bar
        )
        seen[r, 1] = 0.0
        seen[r, 2] = part


@entry
def compare(
    tag, ints, floats, tables, limits, count, room, room_ints, member_state, exact, j, places, who, top, seen, work
):
    """Forces of the members of a group, at any places of a finished motion.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      exact: whether states inside steps are those of the method's own motion; else of a quintic (`sample_responses`).
      j: the response, which says which group.
      places (K, 2): steps, and fractions of them.
      who (C,): numbers within the group of the members whose forces and rates are wanted; without any no rates are
        computed.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      top (M,): the largest |f*| of each member of the group over all places (N).
      seen (C, K, 2): f* of the members who (N) and its rate (N/s), by differences along the motion.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    motion = finished(model, tables, member_state, history, count, work)
    workspace, near_q, near, lam = motion.workspace, motion.near_q, motion.near, motion.lam
    no = np.bool_(False)
    group = model.response[j, SUBJECT]
    force = np.empty(top.shape[0])
    both = np.empty((2, top.shape[0]))
    plain = derivatives(tag) > 1 and is_plain(model, group)
    last = -1
    top[:] = 0.0
    for i in range(places.shape[0]):
        k = int(places[i, 0])
        c = places[i, 1]
        segment = history.index[k, SEGMENT]
        last = go_to(tag, motion, k, c, exact, last)
        t = time_at(history, k, c)
        q, v, a = motion.q, motion.v, motion.a
        if c <= 0.0 or c >= 1.0:
            balance_at_end(tag, motion, k, 1 if c >= 1.0 else 0, q, v, a)
        else:
            solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
            work[FORCES] += 1
            work[OF_SAMPLES] += 1
        if plain and who.shape[0] > 0:
            group_rates(model, member_state, segment, t, group, q, v, a, workspace.rel, both)
            for m in range(top.shape[0]):
                top[m] = max(top[m], abs(both[0, m]))
            for m in range(who.shape[0]):
                seen[m, i, 0] = both[0, who[m]]
                seen[m, i, 1] = both[1, who[m]]
            continue
        group_forces(model, member_state, segment, t, group, q, v, a, force)
        for m in range(top.shape[0]):
            top[m] = max(top[m], abs(force[m]))
        for m in range(who.shape[0]):
            seen[m, i, 0] = force[who[m]]
            seen[m, i, 1] = 0.0
        if who.shape[0] == 0:
            continue
        apart = RATE_SHIFT * (history.t[k + 1] - history.t[k])
        work[FORCES] += 2
        work[OF_SAMPLES] += 2
        for side in (-1.0, 1.0):
            e = side * apart
            state_at_offset(tag, model, history, k, c, e, q, v, a, near_q, near[0])
            solve_accelerations(model, member_state, segment, t + e, near_q, near[0], no, workspace, near[1], lam)
            group_forces(model, member_state, segment, t + e, group, near_q, near[0], near[1], force)
            for m in range(who.shape[0]):
                seen[m, i, 1] += side * force[who[m]] / (2.0 * apart)


@kernel
def time_at(history, k, c):
    """The time (s) at fraction c of step k."""
    if c >= 1.0:
        return history.t[k + 1]
    return history.t[k] + c * (history.t[k + 1] - history.t[k])


@kernel
def go_to(tag, motion, k, c, exact, last):
    """Put the state at a fraction of a step into `motion.q` and `motion.v`, and members into the modes of that step.

    tag: the method of integration (`method_interface`).
    motion: the finished motion; its workspace, lam and the ends of the quintic are overwritten.
    k, c: number of the step, and the fraction of it.
    exact: whether the state inside it is that of the method's own motion; else of a quintic.
    last: number of the step whose ends the quintic has; -1: none.

    Returns the number of the step whose ends it has now.
    """
    model, member_state, history, workspace = motion.model, motion.member_state, motion.history, motion.workspace
    q, v, ends_q, ends = motion.q, motion.v, motion.ends_q, motion.ends
    no = np.bool_(False)
    h = history.t[k + 1] - history.t[k]
    segment = history.index[k, SEGMENT]
    restore_modes(history, history.index[k, EVENTS], member_state)
    if c <= 0.0 or c >= 1.0:
        copy_vector(history.q[k if c <= 0.0 else k + 1], q)
        copy_vector(history.v[k if c <= 0.0 else k + 1], v)
    elif exact or is_continuous(tag):
        point_of(tag, model, motion.tables, member_state, history, motion.count, k, c, no, workspace, q, v, motion.work)
    else:
        if k != last:
            for e in range(2):
                copy_vector(history.q[k + e], ends_q[e])
                copy_vector(history.v[k + e], ends[e, 0])
                balance_at_end(tag, motion, k, e, ends_q[e], ends[e, 0], ends[e, 1])
            last = k
        quintic(model, c, h, ends_q[0], ends[0, 0], ends[0, 1], ends_q[1], ends[1, 0], ends[1, 1], q, v)
    drive_state(model, segment, time_at(history, k, c), q, v)
    return last


@kernel
def held_back(model, workspace, d, a, lam):
    """The force at coordinate d that inerters and joints take up: (sum s b B^T B a + Phi_q^T lam)_d."""
    total = 0.0
    for p in range(model.pair.shape[0]):
        for i in range(pair_freedoms(model)):
            if place_in_pair(model, p, i) == d:
                for j in range(pair_freedoms(model)):
                    total += workspace.mass[p, i, j] * a[place_in_pair(model, p, j)]
    for j in range(model.joint.shape[0]):
        for i in range(pair_freedoms(model)):
            if place_in_joint(model, j, i) == d:
                for r in range(most_rows(model)):
                    if model.row[j, r] >= 0:
                        total += workspace.jac[j, r, i] * lam[model.row[j, r]]
    return total
