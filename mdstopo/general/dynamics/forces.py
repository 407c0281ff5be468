"""All that acts on the bodies of a general scene but the joints, with tangents.

    (M + sum s b B^T B) a + Phi_q^T lam = F(q, v, t)

F holds loads, gravity, members, bushings, and the part of an inerter's force that does not depend on accelerations.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.dynamics.general_contact import add_contacts
from mdstopo.general.dynamics.members import SCALE, general_sums
from mdstopo.general.model.general_model import CODE, COUNT, INERTER, PAIR, START
from mdstopo.general.model.strides import FORCE, pair_freedoms, place_in_pair, tangent_column
from mdstopo.general.model.switches import APART, DAMPED, TURNING, UNFORMED
from mdstopo.mechanics.kinematics.kinematics_interface import (
    add_bushings,
    add_inerter_tangents,
    add_loads,
    add_pair_force,
    inerter_row,
    load_tangent,
    pair_tangent,
    turn_bodies,
    turned_pose,
)


@kernel
def add_inerters(model, segment, member_state, q, v, mass, f):
    """Mass of the inerters, sum s b B^T B, and the part of their forces that accelerations do not change.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v (n,): coordinates and velocities.
    Out:
      mass (n_pair, 2 D, 2 D): the mass (kg, kg m, kg m^2), set.
      f (n,): forces and moments on the coordinates (N, N m), to which -sum s b B^T (B' v) is added.
    """
    mass[:] = 0.0
    row = np.empty(pair_freedoms(model))
    bias = np.empty(1)
    for k in range(model.block.shape[0]):
        if model.block[k, CODE] != INERTER or model.active[segment, k] == 0:
            continue
        p = model.block[k, PAIR]
        lo = model.block[k, START]
        for i in range(lo, lo + model.block[k, COUNT]):
            inerter_row(model, q, v, i, p, row, bias)
            w = member_state[SCALE, i] * model.law[k, 0]
            for r in range(pair_freedoms(model)):
                f[place_in_pair(model, p, r)] -= w * row[r] * bias[0]
                for c in range(pair_freedoms(model)):
                    mass[p, r, c] += w * row[r] * row[c]


@kernel
def inerter_force(model, k, i, q, v, a, row):
    """Force b d2Delta/dt2 of an inerter at unit strength (N), and its row.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      row (2 D,): B over the coordinates of both bodies.
    """
    p = model.block[k, PAIR]
    bias = np.empty(1)
    inerter_row(model, q, v, i, p, row, bias)
    value = bias[0]
    for r in range(pair_freedoms(model)):
        value += row[r] * a[place_in_pair(model, p, r)]
    return model.law[k, 0] * value


@kernel
def add_tangents_of_inerters(model, segment, member_state, q, v, a, k_out, c_out):
    """Slopes by coordinates and velocities of what all inerters take, sum s b B^T d2Delta/dt2, at fixed a.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    Out:
      k_out, c_out (n_pair, 2 D, 2 D): stiffness and damping of the pairs, to which d/dq and d/dv are added.
    """
    for k in range(model.block.shape[0]):
        if model.block[k, CODE] != INERTER or model.active[segment, k] == 0:
            continue
        add_inerter_tangents(
            model, model.block[k, PAIR], model.block[k, START], model.block[k, COUNT], model.law[k, 0], member_state, q,
            v, a, k_out, c_out,
        )  # fmt: skip


@kernel
def general_forces(model, member_state, segment, t, q, v, tangent, workspace):
    """All forces of members, bushings, loads and contacts at one state, without inerters; on demand with tangents.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t: segment of `model.times`, and time in it (s).
      q (n_q,), v (n,): coordinates and velocities.
      tangent: whether workspace.k, .c and .turn are asked for.
    In and out:
      workspace: the workspace. Set are f (N, N m), turned, and, of the pairs that carry more than joints, rel and sums.
    """
    place_pairs(model, q, v, tangent, workspace, workspace.rel, workspace.sums)
    general_sums(model, segment, t, member_state, workspace.rel, tangent, workspace.sums)
    forces_of_sums(
        model, member_state, segment, t, q, v, tangent, workspace.rel, workspace.sums, workspace.k, workspace.c,
        workspace.turn, workspace,
    )  # fmt: skip


@kernel
def members_alone(model, member_state, segment, t, q, v, workspace):
    """The sums over members of `general_forces` at one state, without loads, bushings and contacts.

    Constant:
      model: the compiled scene.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      segment, t: segment of `model.times`, and time in it (s).
      q (n_q,), v (n,): coordinates and velocities.
    In and out:
      workspace: the workspace. Set are turned, and, of the pairs that carry more than joints, rel and sums.
    """
    no = np.bool_(False)
    place_pairs(model, q, v, no, workspace, workspace.rel, workspace.sums)
    general_sums(model, segment, t, member_state, workspace.rel, no, workspace.sums)


@part
def place_pairs(model, q, v, tangent, workspace, rel, sums):
    """Turn all bodies, find the relative poses of the pairs that carry more than joints, and set their sums to zero.

    Constant:
      model: the compiled scene.
    In:
      q (n_q,), v (n,): coordinates and velocities.
      tangent: whether sums of tangents are set to zero, too.
    Out:
      workspace: its attitudes `turned` are set.
      rel (n_pair, POSE): relative poses.
      sums (n_pair, SUMS): zeros.
    """
    turn_bodies(model, q, workspace.turned)
    for p in range(model.pair.shape[0]):
        if workspace.carries[p] != 0:
            turned_pose(model, p, workspace.turned, q, v, rel)
            for i in range(sums.shape[1] if tangent else tangent_column(model)):
                sums[p, i] = 0.0


@kernel
def forces_of_sums(model, member_state, segment, t, q, v, tangent, rel, sums, k, c, turn, workspace):
    """`general_forces` from relative poses and sums over members.

    Constant:
      model: the compiled scene.
      member_state, segment, t, q, v, tangent: as of `general_forces`.
      rel (n_pair, POSE): relative poses of the pairs that carry more than joints.
    In and out:
      sums (n_pair, SUMS): of members, to which those of bushings are added.
      workspace: the workspace, whose f is set (N, N m).
    Out:
      k, c (n_pair, 2 D, 2 D): on demand stiffness of the pairs, and damping where there is any.
      turn (n, slopes): on demand slopes of the loads where they have any, unless tangents are left unformed.
    """
    pair = model.pair
    f = workspace.f
    carries = workspace.carries
    add_bushings(model, rel, q, tangent, sums)
    f[:] = 0.0
    add_loads(model, segment, t, q, v, f)
    for p in range(pair.shape[0]):
        if carries[p] != 0:
            add_pair_force(model, rel, p, sums[p], FORCE, f)
    if tangent:
        damped = workspace.switches[DAMPED] != 0
        for p in range(pair.shape[0]):
            if carries[p] != 0:
                if workspace.switches[UNFORMED] == 0:
                    pair_tangent(model, p, rel, sums, damped, k, c)
            elif workspace.switches[APART] == 0:
                none = k[p]
                none[:] = 0.0
        if workspace.switches[TURNING] != 0 and workspace.switches[UNFORMED] == 0:
            load_tangent(model, segment, t, q, v, turn)
    if model.contact_pair.shape[0] > 0:
        add_contacts(model, member_state, rel, q, v, tangent, f, k, c)
