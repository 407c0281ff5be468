"""Gauss collocation of a general scene without joints and events, adaptive: windows of nested numbers of nodes.

What a window is, and its equations, stands in `gauss_window`; how they are solved is told in
`integrators.springs_gauss`: a first pass with seven nodes, each further one with more until the coefficients of u have
decayed below the tolerance, then as many as Newton's corrections need. The last correction is solved for but not
balanced once more: the slopes that are kept belong to states that are off by it, by at most a part of the tolerance on
adaptive windows and by 1e-10 on fixed ones, whose discrete adjoint (`gauss_sensitivity`) is the exact derivative of
what was computed.

A window begins with a balance at its start, at the loads of its middle, which predicts its motion. It turns no body by
much more than `TURN`.
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.general.dynamics.accelerations import make_workspace
from mdstopo.general.dynamics.members import MODE, SET, may_meet, meeting, scale_general, shortest_at_start
from mdstopo.general.integrators.gauss_window import (
    COUNTS,
    MOST_NODES,
    balance_nodes,
    is_coupled,
    keep_nodes,
    level_of,
    make_nodes,
    moving,
    solve_nodes,
    spread_balance,
)
from mdstopo.general.integrators.generalized_alpha_step import rate_of
from mdstopo.general.model.general_model import ENERGY, KIND, unpack_general
from mdstopo.general.steps.first_step import motion_scale
from mdstopo.general.steps.run_start import motion_at_start
from mdstopo.general.steps.step_history import EVENTS, FIRST, carve_history, copy_vector, keep_state, keep_step
from mdstopo.integrators.driver import LOOSE_NEWTON, NEWTON_TOLERANCE
from mdstopo.integrators.rows import integrate_to_nodes, take_rows
from mdstopo.integrators.springs_gauss import FIRST_LEVEL, FIRST_WINDOW_SPAN, caution
from mdstopo.integrators.steps import (
    ACCEPTED,
    HELD_SHORT,
    NEEDS_ROOM,
    NEWTON,
    NEWTON_FAILED,
    NON_FINITE,
    OK,
    REJECTED,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TURN,
    lasting,
    solved_to,
)
from mdstopo.mechanics.kinematics.kinematics_interface import (
    deflection,
    drive_state,
    freedoms,
    motion_weights,
    pose_size,
    relative_pose,
    rotations,
    window_state,
)

TAG = (0, 0, 0)
#: error of a window relative to the tolerance, where more is looked at than energies: rates and accelerations are worse
#: off. Measured on two bodies with all smooth laws and a bushing, nineteen responses and their gradients, tolerances
#: from 1e-3 to 1e-10: errors are up to 5.4 times the one of a window
WINDOW_ERROR = 0.3
#: planes of `gauss_tables`
_A, _AA, _LEGENDRE, _FIRST, _SECOND, _VALUES = 1, 2, 3, 4, 5, 6
#: every which node of a window is looked at for members whose ends meet
STRIDE = 3
#: passes of Newton's iteration at most
PASSES = 12


@kernel
def margin_of(model):
    """By which factor errors of the motion have to be smaller than the tolerance of responses: 1 where all are
    energies."""
    count = model.response.shape[0]
    for j in range(count):
        if model.response[j, KIND] != ENERGY:
            return WINDOW_ERROR
    return 1.0 if count > 0 else WINDOW_ERROR


@kernel
def widest_turn(model, x):
    """The largest angle that numbers of moving bodies (W,), a shift or rates, contain."""
    each = freedoms(model)
    turns = rotations(model)
    most = 0.0
    for first in range(each - turns, moving(model), each):
        square = 0.0
        for r in range(turns):
            square += x[first + r] ** 2
        most = max(most, square)
    return np.sqrt(most)


@part
def _may_turn(model, angle, most):
    """Whether a window may turn a body by an angle (rad): rotation vectors up to so much only, angles in a plane."""
    return rotations(model) == 1 or angle <= most


@kernel
def weigh_turns(model, weights, row):
    """row (W,) = weights (n,) of moving bodies; rotations of a body that is tied to nothing are measured in rad."""
    each = freedoms(model)
    for d in range(moving(model)):
        turning = d % each >= each - rotations(model)
        row[d] = 1.0 if turning and weights[d] == 0.0 else weights[d]


@kernel
def _weigh(model, q, rel, motion, noise, tolerance, scale, weights, row):
    """What errors of the moving bodies' coordinates mean, relative to how far pairs have moved.

    In:
      model: the compiled scene.
      q (n_q,), rel (n_pair, POSE): coordinates, and relative poses there.
      motion (n_pair,): how far each pair has moved (m).
      noise (n_pair,): what rounding leaves of that (m).
      tolerance: relative.
    Out:
      row (W,): the weights. scale (n_pair,), weights (n,): scratch.
    """
    motion_scale(model, q, rel, rel, motion, noise, tolerance, scale)
    motion_weights(model, rel, scale, weights)
    weigh_turns(model, weights, row)


@kernel
def _tail(coef, weight, s, h):
    """What the next coefficient would add to the motion, from the last ones, and half as much again, weighed.

    coef (s or more, W), weight (W,), s: coefficients, weights, number of nodes. h: length of the window (s).
    """
    most = 0.0
    for d in range(coef.shape[1]):
        last = max(abs(coef[s - 1, d]), 0.1 * abs(coef[s - 2, d]))
        most = max(most, weight[d] * last)
    return most * 1.5 * h * h / (4.0 * s * s)


@kernel
def _more_nodes(planes, s, old, h, nodes):
    """Put x, y and u of a window to `s` nodes, from the coefficients at `old` ones."""
    c = planes[0, 0]
    integrate_to_nodes(planes[_SECOND], s, old, h * h, nodes.none, nodes.ahead, c, nodes.coef, nodes.x)
    integrate_to_nodes(planes[_FIRST], s, old, h, nodes.start, nodes.none, c, nodes.coef, nodes.y)
    integrate_to_nodes(planes[_VALUES], s, old, 1.0, nodes.none, nodes.none, c, nodes.coef, nodes.u)


@kernel
def begin_nodes(model, v0, nodes):
    """Set node 0 to the start of a window with velocities v0 (n,), and the row `start`."""
    for d in range(moving(model)):
        nodes.start[d] = v0[d]
        nodes.x[0, d] = 0.0
        nodes.y[0, d] = v0[d]


@kernel
def is_steady(model, segment):
    """Whether loads and tabulated forces do not change in a segment."""
    if model.timed_load.shape[0] > 0:
        return np.bool_(False)
    changes = 0.0
    for d in range(model.force.shape[1]):
        changes = max(changes, abs(model.force[segment, d, 1]))
    for k in range(model.load_body.shape[0]):
        for c in range(model.load_force.shape[2]):
            changes = max(changes, abs(model.load_force[segment, k, c, 1]))
    for k in range(model.block.shape[0]):
        changes = max(changes, abs(model.level[segment, k, 1]))
    return np.bool_(changes == 0.0)


@kernel
def predict(model, planes, h, o, workspace, history, nodes):
    """First guess of a window: the motion under the forces at its start alone, with linear forces as they are there.

    Constant:
      model: the compiled scene.
      planes (7, s_max, s_max): of `gauss_tables`, for the first number of nodes.
      h: length of the window (s).
      o: number of the window's first stage.
      workspace: the workspace, for its switches.
    In and out:
      nodes: rows start and ahead, and the balance of node 0, are read.
      history: the history of steps, whose stages of the window are scratch.
    """
    s = COUNTS[FIRST_LEVEL]
    spread_balance(model, history, o, s, workspace, nodes)
    for i in range(s):
        for d in range(nodes.x.shape[1]):
            nodes.ref_x[i, d] = 0.0
            nodes.ref_y[i, d] = nodes.start[d]
            nodes.u[i, d] = nodes.g[0, d]
    integrate_to_nodes(planes[_AA], s, s, h * h, nodes.none, nodes.ahead, planes[0, 0], nodes.u, nodes.x)


@entry
def simulate(ints, floats, tables, alpha, tangent, settings, limits, room, room_ints, member_state, work, where):
    """Integrate the motion of a design over model.times.

    Constant:
      ints, floats: the packed scene (`pack_general`).
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
      settings (4,): the tolerance; -; a fixed step (s; above 0: windows of that length, seven nodes); -.
      limits (6,): steps allowed, then sizes of the history of steps (`carve_history`).
    In:
      alpha (N,): the design.
      tangent: not used; slopes are always kept.
    Out:
      room, room_ints: flat arrays of the history of steps (`carve_history`).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      work (WORK,): counts of work, added to.
      where (3,): each -1 where there is none: -; a member whose ends have met; -.

    Returns a code (`integrators.steps`; NEEDS_ROOM asks for larger rooms), the number of steps, 0 for that of events,
    and the time reached (s).
    """
    model = unpack_general(ints, floats)
    history = carve_history(model, limits, room, room_ints)
    history.mass[0] = 0.0
    scale_general(model.block, model.power, alpha, member_state)
    member_state[MODE] = 0.0
    member_state[SET] = 0.0
    for i in range(where.shape[0]):
        where[i] = -1
    code, count, t = windows(model, tables, member_state, settings, limits[0], history, work, where)
    return code, count, np.int64(0), t


@kernel
def windows(model, tables, member_state, settings, most, history, work, where):
    """Integrate window after window from the start to the end: `simulate` with unpacked arguments.

    Constant:
      model: the compiled scene.
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
      settings (4,), most: as of `simulate`; windows allowed.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    Out:
      history: the history of steps.
      work (WORK,): counts of work, added to.
      where (3,): as of `simulate`.

    Returns the code, the number of windows and the time reached (s).
    """
    fixed_step = settings[2]
    tolerance = margin_of(model) * settings[0]
    newton_tolerance = NEWTON_TOLERANCE
    if not fixed_step > 0.0:
        newton_tolerance = min(max(tolerance, NEWTON_TOLERANCE), LOOSE_NEWTON)
    accuracy = solved_to(tolerance, fixed_step)
    n_pair = model.pair.shape[0]
    workspace = make_workspace(model)
    nodes = make_nodes(model)
    m = moving(model)
    rows = np.zeros((3, nodes.x.shape[1]))
    weight = rows[0]
    end = rows[1:3]
    weights = np.empty(model.mass.shape[0])
    push = np.zeros((2, model.size[0]))  # no joints hold windows
    poses = np.empty((3, n_pair, pose_size(model)))
    rel0 = poses[0]
    before = poses[1]
    after = poses[2]
    of_pairs = np.zeros((4, n_pair))
    motion = of_pairs[0]
    noise = of_pairs[1]
    scale = of_pairs[2]
    shortest = of_pairs[3]
    q0 = model.q0.copy()
    v0 = model.v0.copy()
    times = model.times
    t = times[0]
    drive_state(model, np.int64(0), t, q0, v0)
    for i in range(MOST_NODES):
        copy_vector(q0, nodes.q[i])  # those of ground stay
    relative_pose(model, q0, v0, rel0)
    relative_pose(model, q0, v0, before)
    if history.when.shape[0] < MOST_NODES:
        return NEEDS_ROOM, 0, t
    begin_nodes(model, v0, nodes)
    nodes.when[0] = t
    first = np.int64(0)
    balance_nodes(
        model, member_state, first, np.int64(1), np.bool_(True), q0, rel0, workspace, history, first, nodes, work
    )
    copy_vector(nodes.sums[0].reshape(workspace.sums.size), workspace.sums.reshape(workspace.sums.size))
    copy_vector(history.K[0].reshape(workspace.k.size), workspace.k.reshape(workspace.k.size))
    if is_coupled(model, workspace):
        copy_vector(history.C[0].reshape(workspace.c.size), workspace.c.reshape(workspace.c.size))
    balanced = is_steady(model, np.int64(0))  # whether node 0 has the balance that the next prediction begins with
    motion_at_start(model, member_state, workspace, rel0, v0, scale, motion, noise)
    shortest_at_start(model, rel0, shortest)
    last_time = times[times.shape[0] - 1]
    span = last_time - t
    wanted = fixed_step
    if not fixed_step > 0.0:
        wanted = min(
            span, FIRST_WINDOW_SPAN / max(rate_of(model, workspace), 1e-300), TURN / max(widest_turn(model, v0), 1e-300)
        )
    keep_state(history, 0, t, q0, v0, push[0], push[1])
    history.index[0, FIRST] = 0
    count = np.int64(0)
    stages = np.int64(0)
    longest = 0.0
    for segment in range(times.shape[0] - 1):
        stop = times[segment + 1]
        while t < stop:
            if count >= most:
                return STEP_LIMIT, count, t
            if count + 4 > history.t.shape[0] or stages + MOST_NODES > history.when.shape[0]:
                return NEEDS_ROOM, count, t
            pieces = np.ceil((stop - t) / wanted - 1e-9)
            h = (stop - t) / max(pieces, 1.0)
            lands = pieces <= 1.0
            if not h > 1e-14 * max(abs(t), abs(stop)) or h < 1e-15 * span:
                return STEP_TOO_SMALL, count, t
            begin_nodes(model, v0, nodes)
            for d in range(m):
                nodes.ahead[d] = h * v0[d]
            code, s, estimate = _solve_window(
                model, tables, member_state, segment, t, h, q0, v0, rel0, motion, noise, scale, weight, weights,
                tolerance, newton_tolerance, accuracy, fixed_step, longest, balanced, stages, workspace, history,
                nodes, work,
            )  # fmt: skip
            balanced = False
            turned = widest_turn(model, nodes.x[s - 1])
            if code == OK and turned > 1.1 * TURN and fixed_step <= 0.0:
                code = NEWTON_FAILED
                estimate = h * TURN / turned
            if code != OK:
                work[REJECTED] += 1
                if fixed_step > 0.0:
                    return code, count, t
                wanted = min(estimate, 0.5 * h)
                continue
            planes = tables[level_of(s)]
            keep_nodes(model, q0, s, t, h, planes, history, stages, nodes)
            finite = _end_of_window(model, planes, s, h, nodes, end)
            window_state(model, q0, end[0], end[1], q0, v0)
            if not finite:
                return NON_FINITE, count, t
            relative_pose(model, q0, v0, after)
            for p in range(n_pair):
                motion[p] = max(motion[p], nodes.reached[p], deflection(model, after, rel0, p))
            if where[1] < 0 and may_meet(shortest, motion):
                where[1] = _meeting(model, segment, t, member_state, s, before, after, nodes)
            copy_vector(after.reshape(after.size), before.reshape(before.size))
            t = stop if lands else t + h
            longest = max(longest, h)
            stages += s
            keep_step(history, count, segment, np.int64(0), stages, t, q0, v0, push)
            count += 1
            history.index[count, EVENTS] = 0
            work[ACCEPTED] += 1
            if not fixed_step > 0.0:
                change = 0.9 * (tolerance / max(estimate, 1e-30)) ** (1.0 / (s + 1)) * 11.0 / s
                wanted = h * min(max(change, 0.4), 2.0, TURN / max(turned, 1e-300))
    return OK, count, t


@kernel
def _end_of_window(model, planes, s, h, nodes, end):
    """x and y (2, W) at the end of a window, as Gauss's quadrature gives them; returns whether they are finite.

    model: the compiled scene. planes (7, s_max, s_max), s: of `gauss_tables`. h: length of the window (s). nodes: u.
    """
    finite = True
    for d in range(moving(model)):
        x = nodes.ahead[d]
        y = nodes.start[d]
        for j in range(s):
            x += h * h * planes[0, 2, j] * nodes.u[j, d]
            y += h * planes[0, 1, j] * nodes.u[j, d]
        end[0, d] = x
        end[1, d] = y
        finite = finite and np.isfinite(x) and np.isfinite(y)
    return finite


@kernel
def _meeting(model, segment, t, member_state, s, before, after, nodes):
    """A member whose ends meet while it would carry a force, between the nodes of a window; or -1 (`members.meeting`).

    model: the compiled scene. segment, t: segment of `model.times`, and a time in it (s).
    member_state (3, columns): state of the members.
    s, nodes: number of nodes, and the relative poses there. before, after (n_pair, POSE): those at both ends.
    """
    last = 0
    who = meeting(model, segment, t, member_state, before, nodes.rel[0])
    for i in range(STRIDE, s, STRIDE):
        if who < 0:
            who = meeting(model, segment, t, member_state, nodes.rel[last], nodes.rel[i])
        last = i
    return meeting(model, segment, t, member_state, nodes.rel[last], after) if who < 0 else who


@kernel
def _solve_window(
    model, tables, member_state, segment, t, h, q0, v0, rel0, motion, noise, scale, weight, weights, tolerance,
    newton_tolerance, accuracy, fixed_step, longest, balanced, o, workspace, history, nodes, work,
):  # fmt: skip
    """Solve the equations of one window, with as many nodes as the tolerance needs.

    Constant:
      model: the compiled scene.
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t, h: segment of `model.times`, time at the start, and length of the window (s).
      q0 (n_q,), v0 (n,): the state at its start. rel0 (n_pair, POSE): relative poses at the start of the motion.
      motion, noise (n_pair,): how far each pair has moved so far, and what rounding leaves of that (m).
      tolerance, newton_tolerance, accuracy: of the window, of Newton's corrections, of the iterations; relative.
      fixed_step: above 0 there is no control of the error.
      longest: window so far (s).
      balanced: whether node 0 has the balance at the start already.
      o: number of its first stage.
    In and out:
      nodes: rows start and ahead are read; x, y, u and the coefficients are the solution.
      workspace: workspace of a balance, overwritten.
      history: the history of steps, where slopes at the nodes are kept.
      work (WORK,): counts of work, added to.
    Out:
      scale (n_pair,), weight (W,), weights (n,): scratch.

    Returns OK or NEWTON_FAILED, the number of nodes, and the error relative to the motion, or where it failed the
    length that is to be tried next (s).
    """
    level = FIRST_LEVEL
    s = COUNTS[level]
    planes = tables[level]
    copy_vector(motion, nodes.reached)
    if not balanced:
        nodes.when[0] = t + 0.5 * h
        one = np.int64(1)
        balance_nodes(model, member_state, segment, one, np.bool_(False), q0, rel0, workspace, history, o, nodes, work)
    predict(model, planes, h, o, workspace, history, nodes)
    turned = widest_turn(model, nodes.x[s - 1])
    if turned >= 3.0 and fixed_step <= 0.0:
        return NEWTON_FAILED, s, h / turned
    if _may_turn(model, turned, 3.0):
        window_state(model, q0, nodes.x[s - 1], nodes.start, nodes.q[s - 1], nodes.v[s - 1])
        relative_pose(model, nodes.q[s - 1], nodes.v[s - 1], nodes.rel[s - 1])
        for p in range(model.pair.shape[0]):
            reached = deflection(model, nodes.rel[s - 1], rel0, p)
            scale[p] = max(motion[p], reached, 1e3 * noise[p])
        motion_weights(model, nodes.rel[s - 1], scale, weights)
        weigh_turns(model, weights, weight)
    e = solve_nodes(model, planes, s, h, history, o, workspace, nodes, weight, 1e-2, accuracy, work)
    if e < 0.0:
        work[HELD_SHORT] += 1
        return NEWTON_FAILED, s, 0.5 * h
    previous = np.inf
    for newton in range(1, PASSES + 1):
        if not _may_turn(model, widest_turn(model, nodes.x[s - 1]), 4.0):
            return NEWTON_FAILED, s, 0.25 * h
        take_rows(nodes.x, s, nodes.ref_x)
        take_rows(nodes.y, s, nodes.ref_y)
        copy_vector(motion, nodes.reached)
        for i in range(s):
            nodes.when[i] = t + h * planes[0, 0, i]
        balance_nodes(model, member_state, segment, s, np.bool_(False), q0, rel0, workspace, history, o, nodes, work)
        work[NEWTON] += 1
        _weigh(model, nodes.q[s - 1], nodes.rel[0], nodes.reached, noise, tolerance, scale, weights, weight)
        e = solve_nodes(model, planes, s, h, history, o, workspace, nodes, weight, 1e-3, accuracy, work)
        if e < 0.0:
            work[HELD_SHORT] += 1
            return NEWTON_FAILED, s, 0.5 * h
        integrate_to_nodes(planes[_LEGENDRE], s, s, 1.0, nodes.none, nodes.none, planes[0, 0], nodes.u, nodes.coef)
        estimate = _tail(nodes.coef, weight, s, h) * caution(nodes.coef, weight, s) * lasting(h, longest)
        if estimate <= tolerance or fixed_step > 0.0:
            if e <= newton_tolerance or (e >= 0.5 * previous and e < 1e-11):  # the last: rounding is all that is left
                return OK, s, estimate
            previous = e
        elif level == tables.shape[0] - 1 or (newton > 1 and e > 0.5):
            return NEWTON_FAILED, s, 0.5 * h  # more nodes are not to be had; a far too long window is seen early
        else:
            level += 1
            old = s
            s = COUNTS[level]
            planes = tables[level]
            previous = np.inf
            _more_nodes(planes, s, old, h, nodes)
    return NEWTON_FAILED, s, 0.5 * h
