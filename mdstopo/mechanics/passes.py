"""The passes over all members: their strengths, their sums at several poses, the design gradient.

A pass returns a few numbers a pair of bodies and pose (`SUMS`), or a number a member. The order of sums is fixed:
members within a tile, tiles in order. All passes go through the chunks of the members (`Model.chunk`): whole blocks, or
of very many members parts of them. The sums of parts are made each by itself and added in order, so that threads can
share them (`compiler.threads`) and no bit depends on how many do.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.vector import lanes, load, store
from mdstopo.mechanics.grid_passes import design_grid, sum_grid
from mdstopo.mechanics.kinematics.planar_poses import POSE, copy_rows, pair_displacement, relative_pose
from mdstopo.mechanics.laws.spring import (
    elastic_design,
    elastic_force,
    elastic_tangent,
    is_near,
    stored_energy,
    viscous_design,
    viscous_force,
    viscous_tangent,
)
from mdstopo.mechanics.laws.sums import add_forces, add_tangent
from mdstopo.scene.springs_model import (
    CHUNK_BLOCK,
    CHUNK_START,
    CHUNK_STOP,
    COUNT,
    DAMPING,
    DESIGN,
    EXCESS,
    KIND,
    L0,
    LENGTH,
    PAIR,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    SCALED_DAMPING,
    SCALED_PRELOAD,
    SCALED_STIFFNESS,
    START,
    STIFFNESS,
    STOP,
    TILE,
    WIDTH,
    Springs,
)

#: sums a pair and pose: Q (3), E, E_xi (3), K (9, by rows), C (6, upper triangle)
SUMS = 22
#: columns of them: the force and couple Q, the stored energy E and its slopes E_xi, K_xx and K_yy
SUM_X, SUM_Y, SUM_T, STORED, SLOPE_X, SLOPE_Y, SLOPE_T, K_XX = range(8)
K_YY = 11
#: members times poses from which on threads are worth making: some 0.8 ms of work
WORTH_THREADS = 400_000


@part
def springs_of(model):
    """The arrays of a model that `member_sums` needs."""
    return Springs(model.block, model.member, model.chunk, model.threads, model.near)


@kernel
def threads_for(springs, poses):
    """How many threads share a pass over the members at so many poses."""
    return springs.threads if springs.threads > 0 and springs.member.shape[1] * poses >= WORTH_THREADS else 1


@part
def scale_members(model, alpha, strength):
    """Strengths of the members (Eq. 12): strength (3 or more, M_padded) = alpha^mu times stiffness, damping and
    preload.

    Rows 1 and 2 of design springs that have neither damping nor preload are left as they are: zero.
    """
    counter = np.zeros(1, np.int64)
    job = (counter, model.chunk, model.block, model.power, model.member, alpha, strength)
    shared(_scale_chunks, threads_for(model, np.int64(1)), job)


@kernel
def _scale_chunks(counter, chunk, block, power, member, alpha, strength):
    """Scale the members of chunk after chunk, until none is left: what each thread does.

    In:
      counter (1,): chunks that some thread has taken so far; counted on.
      chunk, block, power, member: as of `Model`.
      alpha (N,): the design.
    Out:
      strength (3 or more, M_padded): see `scale_members`.
    """
    i = taken(counter)
    while i < chunk.shape[0]:
        _scale(
            chunk[i, CHUNK_BLOCK], chunk[i, CHUNK_START], chunk[i, CHUNK_STOP], block, power, member, alpha, strength
        )
        i = taken(counter)


@kernel
def _scale(k, start, stop, block, power, member, alpha, strength):
    """Scale the members in places start to stop of block k; those of fixed blocks keep what they have at alpha = 1.

    In:
      k: number of the block.
      start, stop: places in the padded arrays.
      block (n_block, BLOCK), power (n_block,): as of `Model`.
      member (MEMBER, M_padded): as of `Model`; stiffness, damping and preload at alpha = 1 (N/m, N s/m, N).
      alpha (N,): the design.
    Out:
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu there, zeros in the padding.
    """
    if block[k, DESIGN] < 0:
        for i in range(start, stop):
            for row in range(3):
                strength[row, i] = member[STIFFNESS + row, i]
        return
    mu = power[k]
    rows, count, first, width = _rows(block, k, start, stop)
    for row in range(3 if block[k, KIND] == 1 else 1):
        for j in range(rows):
            at = start + j * width
            begin = first + j * count
            a = alpha[begin : begin + count]
            whole = member[STIFFNESS + row, at : at + width]
            scaled = strength[row, at : at + width]
            if mu == 1.0 and begin + width <= alpha.shape[0]:
                # whole vectors: a place of padding takes some other variable times no stiffness
                for i in range(0, width, lanes()):
                    store(scaled, i, load(alpha, begin + i) * load(whole, i))
                continue
            if mu == 1.0:  # a loop of its own: a power that is not used would be computed all the same
                for i in range(count):
                    scaled[i] = a[i] * whole[i]
            else:
                for i in range(count):
                    scaled[i] = a[i] ** mu * whole[i]
            for i in range(count, width):
                scaled[i] = 0.0
        for i in range(start + rows * width, stop):
            strength[row, i] = 0.0


@part
def _rows(block, k, start, stop):
    """The part start..stop of block k by rows: how many, the members of one, the first's variable, places of a row.

    Of a grid its rows, else one row. Behind the last row of a grid there may be eight places that are none of it:
    blocks are padded to sixteen.
    """
    width = block[k, WIDTH]
    before = start - block[k, START]
    if width == 0:
        return np.int64(1), min(stop - start, block[k, COUNT] - before), block[k, DESIGN] + before, stop - start
    count = block[k, LENGTH]
    before //= width
    return (
        min(block[k, COUNT] // count - before, (stop - start) // width),
        count,
        block[k, DESIGN] + before * count,
        width,
    )


@kernel
def member_sums(springs, strength, rel, m, tangent, sums):
    """Sum all members to forces and energies of pairs at m relative poses, on demand with tangents, in one pass.

    Constant:
      springs: what a pass needs of the model (`Springs`).
    In:
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      rel (m or more, n_pair, POSE): relative poses.
      m: how many of them.
      tangent: whether K and C are wanted; they are zero otherwise.
    Out:
      sums (m or more, n_pair, SUMS): the first m are overwritten; energy is that of design members.
    """
    block = springs.block
    chunk = springs.chunk
    sums[:m] = 0.0
    if springs.threads == 0:  # whole blocks: added where they belong at once
        for k in range(block.shape[0]):
            _sum(
                k, block[k, START], block[k, STOP], block, springs.near[k], springs.member, strength, rel, m, tangent,
                sums, block[k, PAIR],
            )  # fmt: skip
        return
    counter = np.zeros(1, np.int64)
    part = np.empty((chunk.shape[0], m, 1, SUMS))
    job = (counter, chunk, block, springs.near, springs.member, strength, rel, m, tangent, part)
    shared(_sum_chunks, threads_for(springs, m), job)
    for i in range(chunk.shape[0]):
        p = block[chunk[i, CHUNK_BLOCK], PAIR]
        for j in range(m):
            for s in range(SUMS):
                sums[j, p, s] += part[i, j, 0, s]


@kernel
def _sum_chunks(counter, chunk, block, near, member, strength, rel, m, tangent, part):
    """Sum the members of chunk after chunk, each chunk by itself, until none is left: what each thread does.

    In:
      counter (1,): chunks that some thread has taken so far; counted on.
      chunk, block, near, member: as of `Model`.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      rel (m or more, n_pair, POSE): relative poses.
      m: how many of them.
      tangent: whether K and C are wanted.
    Out:
      part (n_chunk, m, 1, SUMS): sums of each chunk, for the pair of its block.
    """
    i = taken(counter)
    while i < chunk.shape[0]:
        out = part[i]
        out[:] = 0.0
        k = chunk[i, CHUNK_BLOCK]
        _sum(
            k,
            chunk[i, CHUNK_START],
            chunk[i, CHUNK_STOP],
            block,
            near[k],
            member,
            strength,
            rel,
            m,
            tangent,
            out,
            np.int64(0),
        )
        i = taken(counter)


@kernel
def _sum(k, start, stop, block, near, member, strength, rel, m, tangent, sums, column):
    """Add the sums over the members in places start to stop of block k.

    In:
      k: number of the block.
      start, stop: places in the padded arrays.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
      near (2,): the block's row of `Model.near`.
      strength (3, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      rel (m or more, n_pair, POSE): relative poses.
      m: how many of them.
      tangent: whether K and C are wanted.
      column: where in the second axis of sums the block's pair is.
    Out:
      sums (m or more, columns, SUMS): added to.
    """
    if block[k, WIDTH] > 0:
        sum_grid(k, start, stop, block, near, member, strength[0], rel, m, tangent, sums, column)
        return
    p = block[k, PAIR]
    viscous = block[k, KIND] == 1
    counted = block[k, DESIGN] >= 0  # energy is that of design members
    width = member.shape[1]
    rows = member.reshape(member.size)
    scale = strength.reshape(strength.size)
    for lo in range(start, stop, TILE):
        hi = min(lo + TILE, stop)
        px = member[PX, lo:hi]
        py = member[PY, lo:hi]
        qx = member[QX, lo:hi]
        qy = member[QY, lo:hi]
        l0 = member[L0, lo:hi]
        excess = member[EXCESS, lo:hi]
        ks = strength[SCALED_STIFFNESS, lo:hi]
        for j in range(m):
            r = rel[j, p]
            o = sums[j, column]
            if not viscous:
                if tangent:
                    found = elastic_tangent(rows, width, scale, lo, hi, r, is_near(r, near))
                    add_forces(found[:4], counted, o)
                    add_tangent(found[4:], o)
                else:
                    found_force = elastic_force(rows, width, scale, lo, hi, r, is_near(r, near))
                    add_forces(found_force, counted, o)
                continue
            cs = strength[SCALED_DAMPING, lo:hi]
            ps = strength[SCALED_PRELOAD, lo:hi]
            if tangent:
                (x, y, t, e, ex, ey, et, k0, k1, k2, k3, k4, k5, k6, k7, k8, c0, c1, c2, c3, c4, c5) = viscous_tangent(
                    px, py, qx, qy, l0, excess, ks, cs, ps, r
                )
                o[7] += k0
                o[8] += k1
                o[9] += k2
                o[10] += k3
                o[11] += k4
                o[12] += k5
                o[13] += k6
                o[14] += k7
                o[15] += k8
                o[16] += c0
                o[17] += c1
                o[18] += c2
                o[19] += c3
                o[20] += c4
                o[21] += c5
            else:
                x, y, t, e, ex, ey, et = viscous_force(px, py, qx, qy, l0, excess, ks, cs, ps, r)
            o[0] += x
            o[1] += y
            o[2] += t
            if counted:
                o[3] += e
                o[4] += ex
                o[5] += ey
                o[6] += et


@part
def design_gradient(model, stage, pose, z, used, point, weight, out, work):
    """Add sum over stages of z_s . (force of each member at unit strength) + sum_e weight_e V_i(q_e) to the gradient.

    One pass over the members, no histories. A member's generalised force is -T^T b f, so each adds -f_i (b_i . T z_s).
    Fixed members are passed over.

    Constant:
      model: the compiled scene.
    In:
      stage (S or more, 3, n): q, v of the stages (m, rad; m/s, rad/s), and a vector that is not used.
      pose (any, n_pair, POSE): relative poses of the first stages, which are not found again.
      z (S, n): virtual displacements at the stages, the adjoint of the force balance.
      used (S,): 1 for the stages that count, 0 for the others.
      point (E, 2 or more, n): q, v of the states whose energy counts.
      weight (E,): of the energies V in these states.
    Out:
      out (M_padded,): derivatives by alpha^mu, added to.
      work: counts of work; the stages in this pass are added.
    """
    pair = model.pair
    n_pair = pair.shape[0]
    count = np.int64(0)
    for i in range(used.shape[0]):
        count += used[i]
    work[7] += count
    energies = np.int64(0)
    for i in range(weight.shape[0]):
        energies += weight[i] != 0.0
    rel = np.empty((count + energies, n_pair, POSE))
    own = np.empty(energies)
    u = np.empty((count, n_pair, 3))
    j = 0
    for i in range(used.shape[0]):
        if used[i]:
            if i < pose.shape[0]:
                copy_rows(pose[i], rel[j])
            else:
                relative_pose(pair, model.home, stage[i, 0], stage[i, 1], rel[j])
            for p in range(n_pair):
                pair_displacement(pair, rel[j], p, z[i], u[j, p])
                for axis in range(3):
                    u[j, p, axis] = -u[j, p, axis]
            j += 1
    energies = 0
    for i in range(weight.shape[0]):
        if weight[i] != 0.0:
            own[energies] = weight[i]
            relative_pose(pair, model.home, point[i, 0], point[i, 1], rel[count + energies])
            energies += 1
    counter = np.zeros(1, np.int64)
    job = (counter, model.chunk, model.block, model.near, model.member, rel, u, own, out)
    shared(_design_chunks, threads_for(model, count + energies), job)


@kernel
def _design_chunks(counter, chunk, block, near, member, rel, u, weight, out):
    """Add to the design gradient of chunk after chunk, until none is left: what each thread does.

    In:
      counter (1,): chunks that some thread has taken so far; counted on.
      chunk, block, near, member: as of `Model`.
      rel (S + E, n_pair, POSE): relative poses, those of the stages first.
      u (S, n_pair, 3): virtual changes of the stages' poses.
      weight (E,): of the energies at the other poses.
    Out:
      out (M_padded,): added to.
    """
    i = taken(counter)
    while i < chunk.shape[0]:
        design_of_members(
            chunk[i, CHUNK_BLOCK],
            chunk[i, CHUNK_START],
            chunk[i, CHUNK_STOP],
            block,
            near[chunk[i, CHUNK_BLOCK]],
            member,
            rel,
            u,
            weight,
            out,
        )
        i = taken(counter)


@kernel
def design_of_members(k, start, stop, block, near, member, rel, u, weight, out):
    """Add f (b . u) at the first poses and weight V at the others for the members in places start to stop of block k.

    In:
      k: number of the block; nothing is done for one of fixed members.
      start, stop: places in the padded arrays.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
      near (2,): the block's row of `Model.near`.
      rel (S + E, n_pair, POSE): relative poses.
      u (S, n_pair, 3): virtual changes of the first ones.
      weight (E,): of the stored energies V at the others.
    Out:
      out (M_padded,): added to.
    """
    if block[k, DESIGN] < 0:
        return
    p = block[k, PAIR]
    many = u.shape[0]
    if block[k, WIDTH] > 0:
        design_grid(start, stop, block[k, WIDTH], near, member, rel[:, p], u[:, p], weight, out)
        return
    for lo in range(start, stop, TILE):
        hi = min(lo + TILE, stop)
        px = member[PX, lo:hi]
        py = member[PY, lo:hi]
        qx = member[QX, lo:hi]
        qy = member[QY, lo:hi]
        l0 = member[L0, lo:hi]
        excess = member[EXCESS, lo:hi]
        ks = member[STIFFNESS, lo:hi]
        o = out[lo:hi]
        if block[k, KIND] == 0:
            elastic_design(px, py, qx, qy, l0, excess, ks, rel[:many, p], u[:, p], o)
        else:
            for j in range(many):
                viscous_design(
                    px, py, qx, qy, l0, excess, ks, member[DAMPING, lo:hi], member[PRELOAD, lo:hi], rel[j, p], u[j, p],
                    o,
                )  # fmt: skip
        for j in range(weight.shape[0]):
            stored_energy(px, py, qx, qy, l0, excess, ks, rel[many + j, p], weight[j], o)


@part
def unscale_gradient(model, alpha, padded, out):
    """The gradient by alpha from that by alpha^mu: out (N,) = mu alpha^(mu - 1) times the padded gradient."""
    counter = np.zeros(1, np.int64)
    job = (counter, model.chunk, model.block, model.power, alpha, padded, out)
    shared(_unscale_chunks, threads_for(model, np.int64(1)), job)


@kernel
def _unscale_chunks(counter, chunk, block, power, alpha, padded, out):
    """Turn the gradient of chunk after chunk into that by alpha, until none is left: what each thread does.

    In:
      counter (1,): chunks that some thread has taken so far; counted on.
      chunk, block, power: as of `Model`.
      alpha (N,): the design.
      padded (M_padded,): gradient by alpha^mu.
    Out:
      out (N,): gradient by alpha.
    """
    i = taken(counter)
    while i < chunk.shape[0]:
        _unscale(chunk[i, CHUNK_BLOCK], chunk[i, CHUNK_START], chunk[i, CHUNK_STOP], block, power, alpha, padded, out)
        i = taken(counter)


@kernel
def _unscale(k, start, stop, block, power, alpha, padded, out):
    """Turn the gradient by alpha^mu into that by alpha for the members in places start to stop of block k.

    In:
      k: number of the block; nothing is done for one of fixed members.
      start, stop: places in the padded arrays.
      block (n_block, BLOCK), power (n_block,): as of `Model`.
      alpha (N,): the design.
      padded (M_padded,): gradient by alpha^mu.
    Out:
      out (N,): mu alpha^(mu - 1) times it, at the variables of these members.
    """
    if block[k, DESIGN] < 0:
        return
    mu = power[k]
    rows, count, first, width = _rows(block, k, start, stop)
    for j in range(rows):
        at = start + j * width
        begin = first + j * count
        a = alpha[begin : begin + count]
        given = padded[at : at + count]
        own = out[begin : begin + count]
        if mu == 1.0 and j + 1 < rows and 2 * count >= width:
            # whole vectors: what spills into the next row's variables, this chunk's own, is written over there
            for i in range(0, width, lanes()):
                store(out, begin + i, load(padded, at + i))
        elif mu == 1.0:
            for i in range(count):
                own[i] = given[i]
        else:
            for i in range(count):
                own[i] = mu * a[i] ** (mu - 1.0) * given[i]
