"""What a step makes of changes of the state at its start, and of forces at its stages: the linear map of the step.

It is found at body level, by pushing unit changes through the step (`method_interface.step_forward`): one for each
freedom of the state, and one for each force at a stage. However many members there are, they act through these alone.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, load, store, zero
from mdstopo.general.design.across_knots import add_across_knots, add_changes_across_knots
from mdstopo.general.design.gather import fill_poses
from mdstopo.general.design.row_design import add_designs_of_rows, add_members_of_rows
from mdstopo.general.model.general_model import CODE, DESIGN, INERTER, PAIR
from mdstopo.general.model.switches import carriers
from mdstopo.general.sensitivity.row_sweep import add_share
from mdstopo.general.steps.method_interface import step_forward
from mdstopo.general.steps.step_history import FIRST, SEGMENT
from mdstopo.general.steps.step_linear import free_places, keep_free
from mdstopo.mechanics.kinematics.kinematics_interface import add_pair_force, freedoms, pose_size
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: stages of a step at most, as everywhere
STAGES = 17
#: unit changes that are pushed through at once
TOGETHER = 32


class StepMap(NamedTuple):
    """The map of one step, and what it is found with, made by `make_step_map`.

    A state has W numbers, of its F free freedoms: q, v and the vectors that the integrator carries from step to step
    besides. What a step makes has W + 1: those of the state at its end, and the change of an integral.

    by_state (W, W + 1): a row for each number at the start. by_force (W + 1, STAGES, n): by forces at the stages; no
      rows where by_pose is kept instead. by_pose (W + 1, STAGES, n_pair, D): by members' forces on the relative poses.
    rel (STAGES, n_pair, POSE): relative poses at the stages, for by_pose. carries (n_pair,): of `switches.carriers`.
    acting: the pairs that have design members. place (F,): the free freedoms. row_of (n,): which of these a freedom is,
      -1 where it is none.
    unit, dq, dv, dx, force, changes, rows: of the unit changes that are pushed at once, which they are and as of
      `step_forward`. one (D,), end (W + 1,): scratch.
    """

    by_state: FloatArray
    by_force: FloatArray
    by_pose: FloatArray
    rel: FloatArray
    carries: IndexArray
    acting: IndexArray
    place: IndexArray
    row_of: IndexArray
    unit: IndexArray
    dq: FloatArray
    dv: FloatArray
    dx: FloatArray
    force: FloatArray
    changes: FloatArray
    rows: FloatArray
    one: FloatArray
    end: FloatArray


@kernel
def make_step_map(model, vectors, by_poses):
    """A `StepMap`, its maps zeros.

    model: the compiled scene. vectors: how many vectors the integrator carries (`method_interface.carried`).
    by_poses: whether nothing but the forces of members on relative poses is asked for; they are the units where they
    are fewer than the freedoms.
    """
    n = model.mass.shape[0]
    n_pair = model.pair.shape[0]
    place = free_places(model)
    free = place.shape[0]
    row_of = np.full(n, -1)
    for k in range(free):
        row_of[place[k]] = k
    width = (2 + vectors) * free
    pairs = np.empty(n_pair, np.int64)
    acting = 0
    for p in range(n_pair):
        acts = False
        for k in range(model.block.shape[0]):
            if model.block[k, DESIGN] >= 0 and model.block[k, PAIR] == p:
                acts = True
                by_poses = by_poses and model.block[k, CODE] != INERTER
        if acts:
            pairs[acting] = p
            acting += 1
    by_poses = by_poses and acting * freedoms(model) < free
    of_force = 0 if by_poses else width + 1
    of_pose = width + 1 if by_poses else 0
    return StepMap(
        np.zeros((width, width + 1)), np.zeros((of_force, STAGES, n)),
        np.zeros((of_pose, STAGES, n_pair, freedoms(model))), np.zeros((STAGES, n_pair, pose_size(model))),
        carriers(model), pairs[:acting], place, row_of, np.empty(TOGETHER, np.int64),
        np.empty((TOGETHER, n)), np.empty((TOGETHER, n)),
        np.empty((TOGETHER, 2, n)), np.empty((TOGETHER, STAGES, n)), np.empty((TOGETHER, STAGES, 3, n)),
        np.empty((TOGETHER, STAGES, model.size[0])), np.zeros(freedoms(model)), np.zeros(width + 1),
    )  # fmt: skip


@kernel
def find_step_map(tag, model, tables, history, w, c, iterations, bars, rows_bar, workspace, step):
    """Find the map of step w.

    Constant:
      tag, tables: the integrator (`method_interface`) and its coefficients.
      model: the compiled scene.
      history, w: the history of steps, and the step.
      c: fraction of the step at which it is taken to end.
      iterations: above 0, implicit stages are solved by so many fixed-point iterations at most (`iterative`).
      bars (s, 3, n), rows_bar (s, n_row): cotangents of an integral by q, v, a and the multipliers of the stages; no
        rows where there is none.
    Out:
      step: the map (`StepMap`).
      workspace: workspace of a balance, overwritten.

    Returns whether all iterations settled.
    """
    n = model.mass.shape[0]
    o = history.index[w, FIRST]
    s = history.index[w + 1, FIRST] - o
    by_poses = step.by_pose.shape[0] > 0
    width = step.by_state.shape[0]
    units = width + s * (step.acting.shape[0] * freedoms(model) if by_poses else n)
    if by_poses:
        fill_poses(model, history, o, step.carries, step.rel[:s])
    settled = True
    b = 0
    while b < units:
        count = 0
        while b < units and count < TOGETHER:
            if _begin_unit(model, step, s, b, count):
                step.unit[count] = b
                count += 1
            b += 1
        settled = (
            step_forward(
                tag, model, tables, history, w, c, iterations, step.dq[:count], step.dv[:count], step.dx[:count],
                step.force[:count], step.changes[:count], step.rows[:count], workspace,
            )
            and settled
        )  # fmt: skip
        for m in range(count):
            _end_unit(model, step, m, bars, rows_bar)
    return settled


@part
def start_changes(step, m):
    """Make the changes of the start of a step in place m of those that are pushed at once zero."""
    for d in range(step.dq.shape[1]):
        step.dq[m, d] = 0.0
        step.dv[m, d] = 0.0
        step.dx[m, 0, d] = 0.0
        step.dx[m, 1, d] = 0.0


@kernel
def _begin_unit(model, step, s, b, m):
    """Put unit change b of a step into place m of those that are pushed at once; False where it changes nothing.

    model: the compiled scene. step: the map, which takes the change. s: stages of the step.
    """
    n = model.mass.shape[0]
    width = step.by_state.shape[0]
    free = step.place.shape[0]
    start_changes(step, m)
    for j in range(s):
        for d in range(n):
            step.force[m, j, d] = 0.0
    if b < width:
        d = step.place[b % free]
        if b < free:
            step.dq[m, d] = 1.0
        elif b < 2 * free:
            step.dv[m, d] = 1.0
        else:
            step.dx[m, b // free - 2, d] = 1.0
        return True
    if step.by_pose.shape[0] == 0:
        d = (b - width) % n
        if model.free[d] == 0:
            return False
        step.force[m, (b - width) // n, d] = 1.0
        return True
    each = freedoms(model)
    per_stage = step.acting.shape[0] * each
    j = (b - width) // per_stage
    i = (b - width) % per_stage
    step.one[:] = 0.0
    step.one[i % each] = -1.0  # a member in tension pulls: its force on the pose is -f b
    add_pair_force(model, step.rel[j], step.acting[i // each], step.one, 0, step.force[m, j])
    keep_free(model, step.force[m, j])
    return True


@kernel
def _end_unit(model, step, m, bars, rows_bar):
    """Take what has become of the unit change in place m of those that were pushed into the map of the step.

    model: the compiled scene. step: the map. bars, rows_bar: as of `find_step_map`.
    """
    n = model.mass.shape[0]
    width = step.by_state.shape[0]
    end = step.end
    free = step.place.shape[0]
    for k in range(free):
        d = step.place[k]
        end[k] = step.dq[m, d]
        end[free + k] = step.dv[m, d]
        for vector in range(width // free - 2):
            end[(2 + vector) * free + k] = step.dx[m, vector, d]
    end[width] = 0.0
    for j in range(bars.shape[0]):
        for kind in range(bars.shape[1]):
            for d in range(n):
                end[width] += bars[j, kind, d] * step.changes[m, j, kind, d]
        for r in range(rows_bar.shape[1]):
            end[width] += rows_bar[j, r] * step.rows[m, j, r]
    b = step.unit[m]
    if b < width:
        for d in range(width + 1):
            step.by_state[b, d] = end[d]
        return
    if step.by_pose.shape[0] == 0:
        for d in range(width + 1):
            step.by_force[d, (b - width) // n, (b - width) % n] = end[d]
        return
    each = freedoms(model)
    per_stage = step.acting.shape[0] * each
    i = (b - width) % per_stage
    for d in range(width + 1):
        step.by_pose[d, (b - width) // per_stage, step.acting[i // each], i % each] = end[d]


@kernel
def carry_states(step, count, fresh, states):
    """Multiply derivatives of the state at the start of a step by its map.

    Members go through it by whole vectors. What a vector has at the start is copied first: the rows of 1,024 members
    or a multiple lie so far apart that most of them share their place in the nearest cache.

    step: the map (`StepMap`).
    count: how many numbers of the end are wanted: W, or with the integral W + 1.
    fresh (2 W + 4, lanes): scratch.
    states (W + 1, M): the derivatives by M variables; in its last row the integral's, to which is added.
    """
    width = step.by_state.shape[0]
    columns = states.shape[1]
    flat = states.reshape(states.size)
    rows = fresh.reshape(fresh.size)
    vector = lanes()
    whole = columns - columns % vector
    for i in range(0, whole, vector):
        for b in range(width):
            store(rows, vector * b, load(flat, b * columns + i))
        for d in range(0, count, 4):
            two, three, four = min(d + 1, width), min(d + 2, width), min(d + 3, width)
            first = zero()
            second = zero()
            third = zero()
            fourth = zero()
            for b in range(width):
                x = load(rows, vector * b)
                first += x * step.by_state[b, d]
                second += x * step.by_state[b, two]
                third += x * step.by_state[b, three]
                fourth += x * step.by_state[b, four]
            store(rows, vector * (width + d), first)
            store(rows, vector * (width + d + 1), second)
            store(rows, vector * (width + d + 2), third)
            store(rows, vector * (width + d + 3), fourth)
        for d in range(width):
            store(flat, d * columns + i, load(rows, vector * (width + d)))
        if count > width:
            at = width * columns + i
            store(flat, at, load(flat, at) + load(rows, 2 * vector * width))
    for i in range(whole, columns):
        for d in range(count):
            value = 0.0
            for b in range(width):
                value += step.by_state[b, d] * states[b, i]
            fresh[d, 0] = value
        for d in range(width):
            states[d, i] = fresh[d, 0]
        if count > width:
            states[width, i] += fresh[width, 0]


@kernel
def add_forces(model, history, w, member_state, step, by_force, by_pose, out, work):
    """Add what the design members' forces at the stages of a step do to R numbers of its end.

    Constant:
      model: the compiled scene.
      history, w: the history of steps, and the step.
      member_state (3, columns): state of the members, with the modes and sets of the step.
      step: the map of the step (`StepMap`), of which rel is read.
      by_force (R, STAGES, n), by_pose (R, STAGES, n_pair, D): as of the map; one of them has no rows.
    Out:
      out (R, M_padded + P): derivatives by alpha^mu and by parameters, added to.
      work (WORK,): counts of work, added to.
    """
    o = history.index[w, FIRST]
    s = history.index[w + 1, FIRST] - o
    segment = history.index[w, SEGMENT]
    if by_pose.shape[0] == 0:
        add_designs_of_rows(model, segment, history, o, s, member_state, by_force, out, work)
        add_across_knots(model, history, w, member_state, by_force, out)
    else:
        add_members_of_rows(model, segment, history, o, member_state, step.rel[:s], by_pose, out, work)
        add_changes_across_knots(model, history, w, member_state, step.rel[:s], by_pose, out)


@kernel
def map_back(step, bars, share, by_force, by_pose):
    """What cotangents of the end of a step have by the state at its start and by forces at its stages.

    step: the map (`StepMap`).
    bars (2 or more, n): cotangents of q and v at the end.
    share (W,), by_force (0 or 1, STAGES, n), by_pose (0 or 1, STAGES, n_pair, D): out; as of the map.
    """
    free = step.place.shape[0]
    share[:] = 0.0
    by_force[:] = 0.0
    by_pose[:] = 0.0
    for k in range(2 * free):
        bar = bars[k // free, step.place[k % free]]
        if bar == 0.0:
            continue
        for b in range(share.shape[0]):
            share[b] += bar * step.by_state[b, k]
        if by_pose.shape[0] == 0:
            add_share(bar, step.by_force[k].reshape(step.by_force[k].size), by_force.reshape(by_force.size))
        else:
            add_share(bar, step.by_pose[k].reshape(step.by_pose[k].size), by_pose.reshape(by_pose.size))
