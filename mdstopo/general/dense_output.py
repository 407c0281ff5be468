"""What Python calls for finished steps of a general scene: states and responses anywhere on the motion."""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.general.accelerations import make_workspace, solve_accelerations
from mdstopo.general.forces import drive_state
from mdstopo.general.method_interface import beside, point_of
from mdstopo.general.model import unpack_general
from mdstopo.general.responses import APART, MEMBER_FORCE, group_forces, largest_force, rated
from mdstopo.general.step_history import carve_history, copy_vector, restore_modes


@entry
def sample_response(
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
    j,
    who,
    places,
    out,
    lam_out,
    seen,
    work,
):
    """States, and values and rates of a response, at any places of a finished motion.

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
      rates: whether rates are wanted; else, where response j needs no balance, there may be no a and lam_out either.
      j: the response; below 0: none.
      who: number of the member whose force is looked at; -1: at each place the one with the largest force.
      places (K, 2): steps, and fractions of them; 0 and 1 are the states at the ends as they are in that step.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    Out:
      out (3, K, n): coordinates, velocities, accelerations.
      lam_out (K, n_row + n_driven): multipliers of the solved rows, then those of the driven coordinates, what
        M a + Phi_q^T lam = F leaves to them.
      seen (K, 3): value of the response, its rate (per s), number of the member.
      work (WORK,): counts of work, added to.
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    n_row = model.size[0]
    no = np.bool_(False)
    bars = np.empty((3, n))
    row_bar = np.empty(n_row)
    near = np.empty((4, n))
    ends = np.empty((6, n))
    last = -1
    for i in range(places.shape[0]):
        k = int(places[i, 0])
        c = places[i, 1]
        q = out[0, i]
        v = out[1, i]
        a = out[2, i]
        lam = lam_out[i, :n_row]
        segment = history.index[k, 2]
        last = go_to(
            tag, model, tables, member_state, history, count, k, c, exact, last, workspace, ends, lam, q, v, work
        )
        t = time_at(history, k, c)
        seen[i, 2] = who
        if j >= 0 and model.response[j, 0] == MEMBER_FORCE and who < 0:
            solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
            seen[i, 2] = largest_force(model, member_state, segment, t, model.response[j, 5], q, v, a)
        value, rate = rated(
            tag,
            model,
            member_state,
            history,
            k,
            c,
            j,
            int(seen[i, 2]),
            rates,
            t,
            q,
            v,
            workspace,
            a,
            lam,
            bars,
            row_bar,
            near,
        )
        seen[i, 0] = value
        seen[i, 1] = rate
        for m in range(model.driven.shape[0]):
            d = model.driven[m]
            lam_out[i, n_row + m] = workspace.f[d] - model.mass[d] * a[d] - held_back(model, workspace, d, a, lam)


@entry
def compare(
    tag, ints, floats, tables, limits, count, room, room_ints, member_state, exact, j, places, who, top, seen, work
):
    """Forces of the members of a group beside each other, at any places of a finished motion.

    Constant:
      tag: the method of integration (`method_interface`).
      ints, floats: the packed scene (`pack_general`).
      tables: coefficients of the method.
      limits (6,): sizes of the history of steps (`carve_history`).
    In:
      count: number of steps.
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      exact: whether states inside steps are those of the method's own motion; else of a quintic (`sample_response`).
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
    workspace = make_workspace(model)
    n = model.mass.shape[0]
    n_row = model.size[0]
    no = np.bool_(False)
    group = model.response[j, 5]
    q = np.empty(n)
    v = np.empty(n)
    a = np.empty(n)
    lam = np.empty(n_row)
    near = np.empty((3, n))
    ends = np.empty((6, n))
    force = np.empty(top.shape[0])
    last = -1
    for i in range(top.shape[0]):
        top[i] = 0.0
    for i in range(places.shape[0]):
        k = int(places[i, 0])
        c = places[i, 1]
        segment = history.index[k, 2]
        last = go_to(
            tag, model, tables, member_state, history, count, k, c, exact, last, workspace, ends, lam, q, v, work
        )
        t = time_at(history, k, c)
        solve_accelerations(model, member_state, segment, t, q, v, no, workspace, a, lam)
        group_forces(model, member_state, segment, t, group, q, v, a, force)
        for m in range(top.shape[0]):
            top[m] = max(top[m], abs(force[m]))
        for m in range(who.shape[0]):
            seen[m, i, 0] = force[who[m]]
            seen[m, i, 1] = 0.0
        if who.shape[0] == 0:
            continue
        apart = APART * (history.t[k + 1] - history.t[k])
        for side in (-1.0, 1.0):
            e = side * apart
            beside(tag, history, k, c, e, q, v, a, near[0], near[1])
            solve_accelerations(model, member_state, segment, t + e, near[0], near[1], no, workspace, near[2], lam)
            group_forces(model, member_state, segment, t + e, group, near[0], near[1], near[2], force)
            for m in range(who.shape[0]):
                seen[m, i, 1] += side * force[who[m]] / (2.0 * apart)


@kernel
def time_at(history, k, c):
    """The time at fraction c of step k."""
    if c >= 1.0:
        return history.t[k + 1]
    return history.t[k] + c * (history.t[k + 1] - history.t[k])


@kernel
def go_to(tag, model, tables, member_state, history, count, k, c, exact, last, workspace, ends, lam, q, v, work):
    """The state at a fraction of a step, with the modes of that step.

    Constant:
      tag: the method of integration (`method_interface`).
      model: the compiled scene.
      tables: coefficients of the method.
      count: number of steps.
    In:
      k, c: number of the step, and the fraction of it.
      exact: whether the state inside it is that of the method's own motion; else of a quintic.
      last: number of the step whose ends are in `ends`; -1: none.
    In place:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
        The modes become those of step k.
      history: the history of steps (`StepHistory`).
      ends (6, n): coordinates, velocities, accelerations of the quintic's start, then of its end.
    Out:
      workspace: workspace of a balance (`accelerations.Workspace`).
      lam (n_row,): scratch.
      q, v (n,): the state (m, rad; m/s, rad/s).
      work (WORK,): counts of work, added to.

    Returns the number of the step whose ends are in `ends` now.
    """
    no = np.bool_(False)
    h = history.t[k + 1] - history.t[k]
    segment = history.index[k, 2]
    restore_modes(history, history.index[k, 3], member_state)
    if c <= 0.0 or c >= 1.0:
        state = history.state[k if c <= 0.0 else k + 1]
        copy_vector(state[0], q)
        copy_vector(state[1], v)
    elif exact:
        point_of(tag, model, tables, member_state, history, count, k, c, no, workspace, q, v, work)
    else:
        if k != last:
            for e in range(2):
                copy_vector(history.state[k + e, 0], ends[3 * e])
                copy_vector(history.state[k + e, 1], ends[3 * e + 1])
                solve_accelerations(
                    model, member_state, segment, history.t[k + e], ends[3 * e], ends[3 * e + 1], no, workspace,
                    ends[3 * e + 2], lam,
                )  # fmt: skip
            last = k
        quintic(c, h, ends, q, v)
    drive_state(model, segment, time_at(history, k, c), q, v)
    return last


@kernel
def quintic(c, h, ends, q, v):
    """q, v (n,) at fraction c of a step from both ends' positions, velocities and accelerations, ends (6, n)."""
    for d in range(q.shape[0]):
        v0 = ends[1, d]
        a0 = ends[2, d]
        j = ends[3, d] - ends[0, d] - h * (v0 + 0.5 * h * a0)
        w = h * (ends[4, d] - v0 - h * a0)
        b = h * h * (ends[5, d] - a0)
        x3 = 10.0 * j - 4.0 * w + 0.5 * b
        x4 = -15.0 * j + 7.0 * w - b
        x5 = 6.0 * j - 3.0 * w + 0.5 * b
        q[d] = ends[0, d] + c * (h * v0 + c * (0.5 * h * h * a0 + c * (x3 + c * (x4 + c * x5))))
        v[d] = v0 + c * (h * a0 + c * (3.0 * x3 + c * (4.0 * x4 + c * 5.0 * x5)) / h)


@kernel
def held_back(model, workspace, d, a, lam):
    """What inerters and joints take at coordinate d: (sum s b B^T B a + Phi_q^T lam)_d."""
    total = 0.0
    for p in range(model.pair.shape[0]):
        for i in range(6):
            if 3 * model.pair[p, i // 3] + i % 3 == d:
                for j in range(6):
                    total += workspace.mass[p, i, j] * a[3 * model.pair[p, j // 3] + j % 3]
    for j in range(model.joint.shape[0]):
        for i in range(6):
            if 3 * model.joint[j, 1 + i // 3] + i % 3 == d:
                for r in range(3):
                    if model.row[j, r] >= 0:
                        total += workspace.jac[j, r, i] * lam[model.row[j, r]]
    return total
