"""What the derivatives of many rows by the design gather at the stages of one step: `gather.add_designs` for all.

Rows differ in their virtual displacements alone. So poses, directions and forces of members are formed once, and every
row multiplies them with its own.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.padding import whole_vectors
from mdstopo.compiler.vector import lanes
from mdstopo.general.forces import inerter_force, turn_bodies, turned_pose
from mdstopo.general.members import direction, rate_of_row, stretched
from mdstopo.general.model import INERTER
from mdstopo.general.parameters import parameter_slopes
from mdstopo.general.step_history import has_factors
from mdstopo.general.switches import carriers
from mdstopo.integrators.steps import DESIGN
from mdstopo.mechanics.kinematics.planar_poses import POSE, copy_rows, pair_displacement
from mdstopo.mechanics.laws.alike import alike_designs, elastic_designs_of_rows
from mdstopo.mechanics.laws.table import FREE_LENGTH, SPRING, law


@kernel
def add_designs_of_rows(model, segment, history, o, stages, member_state, z, out, work):
    """Add the derivatives by the design of many rows at the stages of one step: `gather.add_designs` for all of them.

    Constant:
      model: the compiled scene.
      history: the history of steps (`StepHistory`).
    In:
      segment: number of the stretch of time between two breakpoints.
      o, stages: number of the first stage, and how many there are.
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      z (R, 17, n): virtual displacements of each row at each stage.
    Out:
      out (R, M_padded + P): derivatives by alpha^mu and values of each row, added to.
      work (WORK,): counts of work, added to.
    """
    count = z.shape[0]
    n_pair = model.pair.shape[0]
    work[DESIGN] += stages * count
    rel = np.empty((stages, n_pair, POSE))
    u = np.empty((count, stages, n_pair, 3))
    turned = np.empty((model.mass.shape[0] // 3, 2))
    carries = carriers(model)
    for j in range(stages):
        stage = history.stage[o + j]
        if has_factors(history):
            copy_rows(history.turned[o + j], turned)
        else:
            turn_bodies(stage[0], turned)
        for p in range(n_pair):
            if carries[p] != 0:
                turned_pose(model, p, turned, stage[0], stage[1], rel[j])
                for m in range(count):
                    pair_displacement(model.pair, rel[j], p, z[m, j], u[m, j, p])
                    for i in range(3):
                        u[m, j, p, i] = -u[m, j, p, i]
    room = np.empty(4 * stages * lanes())
    longest = 0
    for k in range(model.block.shape[0]):
        longest = max(longest, model.block[k, 5])
    seen = np.empty((4, longest))
    for k in range(model.block.shape[0]):
        if model.block[k, 4] < 0 or model.active[segment, k] == 0:
            continue
        p = model.block[k, 0]
        lo = model.block[k, 1]
        if model.block[k, 3] == SPRING:
            width = model.member.shape[1]
            stop = lo + whole_vectors(model.block[k, 5])
            own = model.law[k]
            member = model.member.reshape(6 * width)
            if own[1] == 0.0 and own[2] == 0.0:
                elastic_designs_of_rows(member, width, lo, stop, own[0], rel, u, p, room, out)
            else:
                alike_designs(member, width, lo, stop, own, rel, u, p, room, out)
            continue
        for j in range(stages):
            if model.block[k, 3] == INERTER:
                _add_inerters(model, k, history.stage[o + j], z, j, out)
            else:
                _add_laws(model, k, segment, history.when[o + j], member_state, rel[j, p], u, j, seen, out)
    if model.varied.shape[0] > 0:
        for j in range(stages):
            _add_parameters(model, segment, history.when[o + j], member_state, history.stage[o + j], z, j, out)


@kernel
def _add_laws(model, k, segment, t, member_state, r, u, j, seen, out):
    """Add the derivatives by alpha^mu of the members of block k, no inerters, at one stage.

    Constant:
      model: the compiled scene.
      k: the block.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      r (POSE,): relative pose of the block's pair.
      u (R, stages, n_pair, 3): virtual changes -T z of the relative poses.
      j: the stage, counted from the first of the step.
    Out:
      out (R, M_padded + P): f (b . u) of each member is added to.
      seen (4, M): scratch for f and b, M at least the members of the block.
    """
    p = model.law[k]
    pair = model.block[k, 0]
    lo = model.block[k, 1]
    size = model.block[k, 5]
    value = model.level[segment, k, 0] + (t - model.times[segment]) * model.level[segment, k, 1]
    for e in range(size):
        i = lo + e
        length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
        f = 0.0
        if length > 0.0:
            rate = bx * r[4] + by * r[5] + bt * r[6]
            x = stretched(model.member, i, r, length) - member_state[2, i]
            f, _, _, _, _ = law(model.block[k, 3], p, x, rate, int(member_state[1, i]), t, value, model.curves)
        seen[0, e] = f
        seen[1, e] = bx
        seen[2, e] = by
        seen[3, e] = bt
    for m in range(out.shape[0]):
        x = u[m, j, pair, 0]
        y = u[m, j, pair, 1]
        angle = u[m, j, pair, 2]
        for e in range(size):
            out[m, lo + e] += seen[0, e] * (seen[1, e] * x + seen[2, e] * y + seen[3, e] * angle)


@kernel
def _add_inerters(model, k, stage, z, j, out):
    """Add the derivatives by alpha^mu of the inerters of block k at one stage.

    model: the compiled scene.
    k: the block.
    stage (3, n): coordinates, velocities, accelerations (m, rad; m/s, rad/s; m/s^2, rad/s^2).
    z (R, 17, n): virtual displacements of each row at each stage.
    j: the stage, counted from the first of the step.
    out (R, M_padded + P): added to.
    """
    row = np.empty(6)
    for i in range(model.block[k, 1], model.block[k, 1] + model.block[k, 5]):
        f = inerter_force(model, k, i, stage[0], stage[1], stage[2], row)
        for m in range(out.shape[0]):
            out[m, i] -= f * rate_of_row(model, model.block[k, 0], row, z[m, j])


@kernel
def _add_parameters(model, segment, t, member_state, stage, z, j, out):
    """Add the derivatives by the laws' parameters at one stage: `parameters.add_parameters` of rows, without energy.

    model: the compiled scene.
    segment: number of the stretch of time between two breakpoints.
    t: time (s).
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
    stage (3, n): coordinates, velocities, accelerations (m, rad; m/s, rad/s; m/s^2, rad/s^2).
    z (R, 17, n): virtual displacements of each row at each stage.
    j: the stage, counted from the first of the step.
    out (R, M_padded + P): added to behind the members.
    """
    row = np.empty(6)
    row_rate = np.empty(6)
    total = np.empty(out.shape[0])
    members = model.member.shape[1]
    for e in range(model.varied.shape[0]):
        k = model.varied[e, 0]
        place = model.varied[e, 1]
        if place > FREE_LENGTH or model.active[segment, k] == 0:
            continue
        total[:] = 0.0
        for i in range(model.block[k, 1], model.block[k, 1] + model.block[k, 5]):
            slope, _ = parameter_slopes(
                model, k, i, place, segment, t, member_state, stage[0], stage[1], stage[2], row, row_rate
            )
            for m in range(out.shape[0]):
                total[m] -= member_state[0, i] * (slope * rate_of_row(model, model.block[k, 0], row, z[m, j]))
        for m in range(out.shape[0]):
            out[m, members + model.varied[e, 2]] += total[m]
