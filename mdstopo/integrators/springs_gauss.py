"""Gauss collocation with nested numbers of nodes and a Newton iteration at body level, adaptive.

On a window the accelerations at the nodes obey a_j = M^-1 F(q_j, v_j, t_j), with q_j, v_j given by the a_j
(`gauss_tables`). One pass over the members at all nodes gives forces and tangents; then the linearised balance

    a_j = M^-1 (F_j - K_j (q_j(a) - q_j) - C_j (v_j(a) - v_j))

is solved by iterations that touch no member (they contract quickly: h^2 |K/M| |A|^2 is small on the windows chosen
here). The first pass has seven nodes; every further one takes more, until the Legendre coefficients of a have decayed
below the tolerance, and goes on at that number until the Newton correction is. So the corrections and the tail of the
coefficients are the error estimate, at no cost. The last correction is solved for but not passed over once more, so
the kept tangents belong to states that are off by it: by at most the tolerance (and 1e-4) on adaptive windows, by
1e-10 on fixed ones, where the discrete adjoint (`springs_gauss_linear`) is the exact derivative of what was computed.
"""

from collections import namedtuple

import numpy as np

from mdstopo.compiler.jit import entry, part
from mdstopo.integrators.gauss_tables import LEVELS
from mdstopo.integrators.rows import (
    copy_row,
    integrate_to_nodes,
    make_rows,
    row_width,
    take_rows,
)
from mdstopo.integrators.springs_gauss_equations import ABOUT, Room, dense_rows, fastest_rate, solve_nodes
from mdstopo.integrators.steps import (
    ACCEPTED,
    FIELDS,
    FIRST,
    FORCES,
    LEVEL,
    NEEDS_ROOM,
    NEWTON,
    NEWTON_FAILED,
    NON_FINITE,
    OK,
    REJECTED,
    SEGMENT,
    STEP_LIMIT,
    STEP_TOO_SMALL,
    TANGENTS,
    TURN,
    add_preloads,
    carve,
    copy_tangents,
    keep_stage,
    keep_state,
    lasting,
    solved_to,
)
from mdstopo.mechanics.active_members import active_members
from mdstopo.mechanics.assembly import forces
from mdstopo.mechanics.kinematics.planar_forces import add_loads
from mdstopo.mechanics.kinematics.planar_poses import POSE, copy_rows, relative_pose
from mdstopo.mechanics.kinematics.planar_scales import (
    deflection,
    gross_loads,
    largest_turn,
    motion_weights,
    noise_of,
    rounding_of_pairs,
)
from mdstopo.mechanics.passes import K_XX, K_YY, STORED, SUMS, scale_members
from mdstopo.scene.packing import unpack

GaussSteps = namedtuple("GaussSteps", FIELDS)  # type: ignore[misc]
TAG = (0,)

COUNTS = LEVELS
MOST_NODES = max(LEVELS)
#: level of every first pass, and of all passes of a fixed step: seven nodes, order 14
FIRST_LEVEL = 0
#: radians of the fastest vibration that the first window may span, so that the iterations contract
FIRST_WINDOW_SPAN = 6.0
#: fall of the coefficients from one to the next from which on `caution` is due, and the most there is
SLOW = 0.26
MOST_CAUTIOUS = 100.0


@entry
def simulate(ints, floats, tables, alpha, damped, tangent, settings, limits, room, room_ints, strength, work):
    """Integrate the motion of a design over model.times, window after window.

    Constant:
      ints, floats: the packed model.
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
    In:
      alpha (N,): the design.
      damped: whether any force depends on velocity.
      tangent: not used; tangents are always kept.
      settings (3 or more,): tolerance, the error of the interpolated motion relative to the motion itself; Newton
        tolerance; fixed step (s; > 0: windows of that length, seven nodes, no error control).
      limits (3,): windows allowed, room for windows, room for stages.
    Out:
      room, room_ints: the steps (`steps.carve`).
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu; see `active_members` on further
        rows.
      work (WORK,): counts of work, added to.

    Returns the code, the number of windows and the time reached (s); NEEDS_ROOM asks for more room.
    """
    whole = unpack(ints, floats)
    scale_members(whole, alpha, strength)
    model, strength, _ = active_members(whole, strength, np.bool_(True))
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    turning = model.load_body.shape[0] > 0
    steps = GaussSteps(*carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    own = Room(
        np.empty(MOST_NODES),
        np.empty((MOST_NODES, n_pair, POSE)),
        np.empty((MOST_NODES, n_pair, SUMS)),
        np.empty((MOST_NODES, n_pair, 6, 6)),
        np.empty((MOST_NODES if damped else 1, n_pair, 6, 6)),
        np.zeros((MOST_NODES if turning else 1, n)),
        make_rows((2 if damped else 1) * MOST_NODES * dense_rows(n), n).reshape(
            (2 if damped else 1, MOST_NODES, dense_rows(n), row_width(n))
        ),
        make_rows(np.int64(10 * MOST_NODES), n).reshape((10, MOST_NODES, row_width(n))),
        make_rows(np.int64(11), n),
        np.zeros(n_pair),
        np.empty(n_pair),
        np.empty(n_pair),
        np.empty((n_pair, POSE)),
        np.empty((n_pair, 6, 6)),
        np.empty((n_pair, 6, 6)),
    )
    return _windows(model, tables, strength, settings, limits[0], damped, turning, steps, own, work)


@part
def _windows(model, tables, strength, settings, most, damped, turning, steps, own, work):
    """Integrate window after window from the start to the end.

    Constant:
      model: the compiled scene.
      tables (n_level, 7, s_max, s_max): of `gauss_tables`.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
    In:
      settings (3 or more,): tolerance, Newton tolerance, fixed step (s; > 0: windows of that length).
      most: windows allowed.
      damped: whether any force depends on velocity.
      turning: whether loads turn.
    Out:
      steps: the windows (`GaussSteps`).
      own: room to work in (`Room`), of zeros and unwritten arrays.
      work (WORK,): counts of work, added to.

    Returns the code, the number of windows and the time reached (s), as `simulate` does.
    """
    tolerance = settings[0]
    newton_tolerance = settings[1]
    fixed_step = settings[2]
    accuracy = solved_to(tolerance, fixed_step)
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    n_level = tables.shape[0]
    pair = model.pair
    inv_mass = model.inv_mass
    times = model.times
    reach = model.reach
    # a number written in a call has a type of its own, for which the callee would be compiled once more
    yes = np.bool_(True)
    t_node = own.t
    rel = own.rel
    sums = own.sums
    k = own.K
    c = own.C
    turn = own.turn
    ref = own.rows[0:2]
    f = own.rows[5]
    q = own.rows[6]
    v = own.rows[7]
    a = own.rows[8]
    coef = own.rows[9]
    weight = own.vectors[0]
    load = own.vectors[1]
    load_base = own.vectors[2]
    hv0 = own.vectors[3]
    q_base = own.vectors[4]
    f_base = own.vectors[5]
    q0 = own.vectors[6]
    v0 = own.vectors[7]
    v_base = own.vectors[8]
    none = own.vectors[9]
    inverse = own.vectors[10]  # of the masses
    copy_row(inv_mass, inverse)
    motion = own.motion
    noise = own.noise
    scale = own.scale
    rel0 = own.rel0
    k_base = own.K0
    c_base = own.C0

    # the start: forces and tangents give the first prediction, the first window and the scale of what matters
    for d in range(n):
        q0[d] = model.q0[d]
        v0[d] = model.v0[d]
        ref[0, 0, d] = q0[d]
        ref[1, 0, d] = v0[d]
        q_base[d] = q0[d]
        v_base[d] = v0[d]
        load_base[d] = 0.0
    t = times[0]
    t_node[0] = t
    forces(model, strength, np.int64(0), np.int64(1), t_node, ref[0], ref[1], yes, damped, rel, sums, f, k, c, turn)
    work[FORCES] += 1
    work[TANGENTS] += 1
    copy_rows(rel[0], rel0)
    copy_tangents(k[0], k_base)
    copy_tangents(c[0], c_base)
    for d in range(n):
        f_base[d] = f[0, d]
    add_loads(model, np.int64(0), t, q0, load_base)
    for p in range(n_pair):
        scale[p] = sums[0, p, K_XX] + sums[0, p, K_YY]
        if sums[0, p, STORED] > 0.0 and scale[p] > 0.0:
            motion[p] = np.sqrt(2.0 * sums[0, p, STORED] / scale[p])  # a pair that starts strained
    gross_loads(model, load[:n])
    add_preloads(model, strength, rel0, load)
    rounding_of_pairs(model, inv_mass, rel0, v0, load, scale, motion, noise)
    rate = fastest_rate(pair, inv_mass, k, c, damped, ABOUT)
    last_time = times[times.shape[0] - 1]
    span = last_time - t
    wanted = span if rate * span <= FIRST_WINDOW_SPAN else FIRST_WINDOW_SPAN / rate
    if fixed_step > 0.0:
        wanted = fixed_step
    keep_state(steps.t, steps.state, np.int64(0), t, q0, v0)
    # the start is a stage of no window: what was found there is not computed again
    keep_stage(
        np.int64(0), t, q0, v0, none, rel[0], sums[0], k[0], c[0], turn[0],
        steps.scalar, steps.stage, steps.pull, steps.K, steps.C, steps.turn,
    )  # fmt: skip
    steps.index[0, FIRST] = 1
    count = 0
    stages = 1
    longest = 0.0

    for segment in range(times.shape[0] - 1):
        end = times[segment + 1]
        while t < end:
            if count >= most:
                return STEP_LIMIT, count, t
            pieces = np.ceil((end - t) / wanted - 1e-9)
            h = (end - t) / max(pieces, 1.0)
            lands = pieces <= 1.0
            if not h > 1e-14 * max(abs(t), abs(end)) or h < 1e-15 * span:
                return STEP_TOO_SMALL, count, t

            # predict with the balance linearised at the window's start (the last stage before it)
            level = FIRST_LEVEL
            s = COUNTS[level]
            planes = tables[level]
            load[:] = 0.0
            add_loads(model, segment, t + 0.5 * h, q_base, load)
            for i in range(s):
                t_node[i] = t + h * planes[0, 0, i]
                for d in range(n):
                    f[i, d] = f_base[d] + load[d] - load_base[d]
                    a[i, d] = inv_mass[d] * f[i, d]
                    ref[0, i, d] = q_base[d]
                    ref[1, i, d] = v_base[d]
                copy_tangents(k_base, k[i])
                if damped:
                    copy_tangents(c_base, c[i])
                if turning:
                    turn[i] = 0.0
            for d in range(n):
                hv0[d] = h * v0[d]
            # nothing has moved yet: what the start's forces alone would do is the scale of the prediction
            integrate_to_nodes(planes[2], s, s, h * h, q0, hv0, planes[0, 0], a, q)
            relative_pose(pair, model.home, q[s - 1], v0, rel[s - 1])
            for p in range(n_pair):
                scale[p] = max(motion[p], deflection(rel[s - 1], rel0, reach, p), 1e3 * noise[p])
            motion_weights(pair, rel0, reach, scale, weight)
            accepted = False
            estimate = 0.0
            previous = np.inf
            e = 0.0
            for newton in range(13):
                if newton > 0:
                    # one pass over the members at all nodes
                    take_rows(q, s, ref[0])
                    take_rows(v, s, ref[1])
                    forces(model, strength, segment, s, t_node, ref[0], ref[1], yes, damped, rel, sums, f, k, c, turn)
                    work[FORCES] += s
                    work[TANGENTS] += s
                    work[NEWTON] += 1
                    widest = 0.0
                    for p in range(n_pair):
                        reached = motion[p]
                        for i in range(s):
                            reached = max(reached, deflection(rel[i], rel0, reach, p))
                        scale[p] = reached
                        widest = max(widest, reached)
                    for p in range(n_pair):
                        lost = noise_of(pair, noise, rel[0], reach, q[s - 1], p)
                        scale[p] = max(scale[p], 0.01 * widest, lost / tolerance, 1e3 * lost)
                    motion_weights(pair, rel[0], reach, scale, weight)
                e = solve_nodes(
                    pair, inverse, planes, s, q0, v0, hv0, none, h, f, own, damped, turning,
                    newton == 0, weight, accuracy, ref, a, q, v, work,
                )  # fmt: skip
                if e < 0.0:
                    break
                if newton == 0:
                    continue
                integrate_to_nodes(planes[3], s, s, 1.0, none, none, planes[0, 0], a, coef)
                # what the next coefficient would add to the motion, from the last ones, and half as much again: peaks
                # amplify what is left (measured on 150 random scenes)
                estimate = 0.0
                for d in range(n):
                    tail = max(abs(coef[s - 1, d]), 0.1 * abs(coef[s - 2, d])) * 1.5 * h * h / (4.0 * s * s)
                    estimate = max(estimate, weight[d] * tail)
                estimate *= caution(coef, weight, s) * lasting(h, longest)
                if estimate <= tolerance or fixed_step > 0.0:
                    # the last clause: rounding is all that is left
                    if e <= newton_tolerance or (e >= 0.5 * previous and e < 1e-11):
                        accepted = True
                        break
                    previous = e
                elif level == n_level - 1 or (newton > 1 and e > 0.5):
                    break  # more nodes are not to be had; a far too long window is seen early
                else:
                    level += 1
                    old = s
                    s = COUNTS[level]
                    planes = tables[level]
                    previous = np.inf
                    for i in range(s):
                        t_node[i] = t + h * planes[0, 0, i]
                    integrate_to_nodes(planes[5], s, old, h * h, q0, hv0, planes[0, 0], coef, q)
                    integrate_to_nodes(planes[4], s, old, h, v0, none, planes[0, 0], coef, v)
                    integrate_to_nodes(planes[6], s, old, 1.0, none, none, planes[0, 0], coef, a)
            if not accepted:
                work[REJECTED] += 1
                if fixed_step > 0.0:
                    return NEWTON_FAILED, count, t
                wanted = 0.5 * h
                continue
            turned = largest_turn(pair, q0, q[s - 1])
            if turned > 1.1 * TURN and fixed_step <= 0.0:
                work[REJECTED] += 1
                wanted = h * TURN / turned
                continue

            if count + 2 > steps.t.shape[0] or stages + s > steps.scalar.shape[0]:
                return NEEDS_ROOM, count, t
            for i in range(s):
                keep_stage(
                    stages + i, t_node[i], q[i], v[i], coef[i], rel[i], sums[i], k[i], c[i if damped else 0],
                    turn[i if turning else 0], steps.scalar, steps.stage, steps.pull, steps.K, steps.C, steps.turn,
                )  # fmt: skip
                for p in range(n_pair):
                    motion[p] = max(motion[p], deflection(rel[i], rel0, reach, p))
            # the last stage is the base of the next prediction
            load_base[:] = 0.0
            add_loads(model, segment, t_node[s - 1], q[s - 1], load_base)
            copy_tangents(k[s - 1], k_base)
            if damped:
                copy_tangents(c[s - 1], c_base)
            finite = True
            for d in range(n):
                q_base[d] = q[s - 1, d]
                v_base[d] = v[s - 1, d]
                f_base[d] = a[s - 1, d] / inv_mass[d] if inv_mass[d] > 0.0 else 0.0
                # the end, as Gauss quadrature gives it
                position = q0[d] + hv0[d]
                speed = v0[d]
                for j in range(s):
                    position += h * h * planes[0, 2, j] * a[j, d]
                    speed += h * planes[0, 1, j] * a[j, d]
                q0[d] = position
                v0[d] = speed
                finite = finite and np.isfinite(position) and np.isfinite(speed)
            if not finite:
                return NON_FINITE, count, t
            t = end if lands else t + h
            longest = max(longest, h)
            steps.index[count, LEVEL] = level
            steps.index[count, SEGMENT] = segment
            stages += s
            count += 1
            steps.index[count, FIRST] = stages
            keep_state(steps.t, steps.state, count, t, q0, v0)
            work[ACCEPTED] += 1
            if fixed_step <= 0.0:
                change = 0.9 * (tolerance / max(estimate, 1e-30)) ** (1.0 / (s + 1)) * 11.0 / s
                wanted = h * min(max(change, 0.4), 2.0, TURN / max(turned, 1e-300))
    return OK, count, t


@part
def caution(coef, weight, s):
    """By how much the last coefficients understate what is left: 1 where they fall fast, up to MOST_CAUTIOUS.

    Where they fall slowly, as where a member passes near zero length, the gradient is off by much more than the motion.
    Measured on 200 random scenes: three gradients were off by 15 to 160 tolerances without it.
    """
    first = 1e-300
    earlier = 1e-300
    last = 0.0
    for d in range(coef.shape[1]):
        first = max(first, weight[d] * abs(coef[0, d]))
        earlier = max(earlier, weight[d] * abs(coef[s - 3, d]))
        last = max(last, weight[d] * abs(coef[s - 1, d]))
    decay = max((last / first) ** (1.0 / (s - 1)), np.sqrt(last / earlier))
    return min(max(1.0, (decay / SLOW) ** 6), MOST_CAUTIOUS)
