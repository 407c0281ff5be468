"""What the derivatives by the design gather at one state: from every member's force, and from the response itself."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.design.balance_slopes import add_numbers
from mdstopo.general.design.parameters import add_force_parameters, add_parameters
from mdstopo.general.dynamics.forces import inerter_force
from mdstopo.general.dynamics.members import MODE, SET, level_of, rate_of_row
from mdstopo.general.model.expressions import FIRST_PART
from mdstopo.general.model.general_model import (
    CODE,
    COUNT,
    DESIGN,
    GROUP,
    INERTER,
    KIND,
    MEMBER_FORCE,
    MEMBER_FREE_LENGTH,
    OFFSET,
    PAIR,
    ROW,
    START,
    SUBJECT,
)
from mdstopo.general.model.strides import pair_freedoms
from mdstopo.general.model.switches import carriers
from mdstopo.general.responses.general_responses import member_force
from mdstopo.general.steps.step_history import has_factors, has_poses
from mdstopo.integrators.steps import DESIGN as DESIGN_STATES
from mdstopo.mechanics.kinematics.kinematics_interface import (
    attitude,
    freedoms,
    has_spring_energies,
    member_designs,
    motion_of_ends,
    pair_displacement,
    pose_size,
    relative_pose,
    spring_designs,
    spring_energies,
    turn_bodies,
    turned_pose,
)
from mdstopo.mechanics.kinematics.planar_poses import copy_rows
from mdstopo.mechanics.laws.law_table import SPRING, law


@kernel
def add_design(model, segment, t, member_state, q, v, a, z, weight, out, work):
    """Add what all design members have of the gradient at one state: out -= f_i (b_i . T z) at unit strength, +=
    weight V_i.

    Behind the members out has the derivatives by parameters (P,), here and everywhere (`parameters`).

    Constant:
      model: the compiled scene.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      z (n,): virtual displacements.
      weight: of the stored energy.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters, added to.
      work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    work[DESIGN_STATES] += 1
    when = np.empty(1)
    turned = np.empty((model.home.shape[0], attitude(model)))
    when[0] = t
    turn_bodies(model, q, turned)
    rel = np.empty((1, model.pair.shape[0], pose_size(model)))
    pose_carriers(model, carriers(model), turned, q, v, rel[0])
    _add(
        model, segment, when, member_state, q.reshape((1, q.shape[0])), v.reshape((1, n)), a.reshape((1, n)), rel,
        z.reshape((1, n)), weight, out,
    )  # fmt: skip


@kernel
def add_designs(model, segment, history, o, member_state, z, out, work):
    """`add_design` at many stages, without energy: springs are read once for all.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`.
      history, o: the history of steps, and the number of the first stage.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      z (S, n): virtual displacements of the S stages from o on.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters, added to.
      work (WORK,): counts of work, added to.
    """
    end = o + z.shape[0]
    work[DESIGN_STATES] += z.shape[0]
    _add(
        model, segment, history.when[o:end], member_state, history.stage_q[o:end], history.stage_v[o:end],
        history.stage_a[o:end], poses_of_stages(model, history, o, z.shape[0]), z, 0.0, out,
    )  # fmt: skip


@kernel
def poses_of_stages(model, history, o, count):
    """(count, n_pair, POSE): relative poses at the stages from o on, of pairs that carry more than joints."""
    if has_poses(history):
        return history.rel[o : o + count]
    rel = np.empty((count, model.pair.shape[0], pose_size(model)))
    fill_poses(model, history, o, carriers(model), rel)
    return rel


@kernel
def fill_poses(model, history, o, carries, rel):
    """Compute relative poses of the pairs that carry more than joints, at the stages of a step from number o on.

    model: the compiled scene. history, o: the history of steps, and the number of the first stage.
    carries (n_pair,): of `switches.carriers`.
    rel (stages, n_pair, POSE): out.
    """
    turned = np.empty((model.home.shape[0], attitude(model)))
    for j in range(rel.shape[0]):
        q = history.stage_q[o + j]
        if has_factors(history):
            copy_rows(history.turned[o + j], turned)
        else:
            turn_bodies(model, q, turned)
        pose_carriers(model, carries, turned, q, history.stage_v[o + j], rel[j])


@kernel
def pose_carriers(model, carries, turned, q, v, rel):
    """Compute relative poses of the pairs that carry more than joints, at one state.

    model: the compiled scene. carries (n_pair,): of `switches.carriers`.
    turned (n_body, A): attitudes of the bodies. q (n_q,), v (n,): coordinates and velocities.
    rel (n_pair, POSE): out.
    """
    for p in range(rel.shape[0]):
        if carries[p] != 0:
            turned_pose(model, p, turned, q, v, rel)


@kernel
def _add(model, segment, when, member_state, q, v, a, rel, z, weight, out):
    """`add_design` at S states of one segment.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`. when (S,): times (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (S, n_q), v, a (S, n): coordinates, velocities, accelerations.
      rel (S, n_pair, POSE): relative poses of pairs that carry more than joints.
      z (S, n): virtual displacements.
      weight: of the stored energy.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters, added to.
    """
    count = z.shape[0]
    n_pair = model.pair.shape[0]
    u = np.empty((count, n_pair, freedoms(model)))
    carries = carriers(model)
    for j in range(count):
        for p in range(n_pair):
            if carries[p] != 0:
                _virtual(model, rel[j], p, z[j], u[j, p])
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if model.block[k, DESIGN] < 0 or model.active[segment, k] == 0:
            continue
        p = model.block[k, PAIR]
        lo = model.block[k, START]
        elastic = code == SPRING and model.law[k, 1] == 0.0 and model.law[k, 2] == 0.0
        if elastic and (weight == 0.0 or has_spring_energies(model)):
            spring_designs(model, model.law[k], lo, model.block[k, COUNT], model.block[k, ROW], rel, u, p, out)
            if weight != 0.0:
                spring_energies(model, model.law[k], lo, model.block[k, COUNT], rel, p, weight, out)
            continue
        for j in range(count):
            if code != INERTER:
                level = level_of(model, segment, k, when[j])
                member_designs(
                    model, code, model.law[k], lo, model.block[k, COUNT], when[j], level, member_state,
                    member_state[MODE], rel[j, p], u[j, p], weight, out,
                )  # fmt: skip
                continue
            row = np.empty(pair_freedoms(model))
            for i in range(lo, lo + model.block[k, COUNT]):
                f = inerter_force(model, k, i, q[j], v[j], a[j], row)
                out[i] -= f * rate_of_row(model, p, row, z[j])
    if model.varied.shape[0] > 0:
        for j in range(count):
            add_parameters(model, segment, when[j], member_state, q[j], v[j], a[j], z[j], weight, out)
    if model.apart.shape[0] > 0:
        for j in range(count):
            add_numbers(model, segment, when[j], q[j], v[j], a[j], z[j], out)


@kernel
def _virtual(model, rel, p, z, out):
    """out (D,) = -T z of pair p: the virtual change of its relative pose, with the sign turned."""
    pair_displacement(model, rel, p, z, out)
    for i in range(freedoms(model)):
        out[i] = -out[i]


@kernel
def explicit_part(model, segment, j, who, slopes, t, member_state, q, v, a, scale, out):
    """Add the derivative by the design at fixed motion of g_j that is a force f* of members.

    f* has a sign; the response is its absolute value (`force_sign`).

    Constant:
      model: the compiled scene.
      j, who: the response, and the number of the member in its group.
      slopes (PARTS,): of an expression by what it is of (`design_slopes`).
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      scale: factor of df*.
    Out:
      out (M_padded + P,): scale times the derivative of f* by alpha^mu and by parameters, added to.
    """
    if model.response[j, KIND] == MEMBER_FORCE:
        _explicit_force(model, segment, model.response[j, SUBJECT], who, t, member_state, q, v, a, scale, out)
        return
    for m in range(slopes.shape[0]):
        c = model.response[j, FIRST_PART] + m
        if model.response[c, KIND] == MEMBER_FORCE and slopes[m] != 0.0:
            group = model.response[c, SUBJECT]
            _explicit_force(model, segment, group, 0, t, member_state, q, v, a, scale * slopes[m], out)


@kernel
def _explicit_force(model, segment, group, who, t, member_state, q, v, a, scale, out):
    """What the design does to the force f* of one member at fixed motion.

    Constant:
      model: the compiled scene.
      group, who: the group, and the number of the member in it.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      scale: factor of df*.
    Out:
      out (M_padded + P,): scale times the derivative of f* by alpha^mu and by parameters, added to.
    """
    _add_laws(model, segment, group, who, t, member_state, q, v, a, scale, out)
    if model.varied.shape[0] > 0:
        add_force_parameters(model, segment, group, who, t, member_state, q, v, a, scale, out)


@kernel
def force_sign(model, segment, j, who, t, member_state, q, v, a):
    """The sign of f* where g_j is the force of a member; else 1.

    It is that of the very number that `response` takes the absolute value of: near zero another formula for the same
    force may have the other sign.

    Constant:
      model: the compiled scene.
      j, who: the response, and the number of the member in its group.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
    """
    if model.response[j, KIND] != MEMBER_FORCE:
        return 1.0
    slopes = np.empty((3, pair_freedoms(model)))
    own = np.empty((2, pair_freedoms(model)))
    f, _ = member_force(model, member_state, segment, t, model.response[j, SUBJECT], who, q, v, a, slopes, own)
    return 1.0 if f >= 0.0 else -1.0


@kernel
def _add_laws(model, segment, group, who, t, member_state, q, v, a, scale, out):
    """The forces of all laws of a member at unit strength, each to its own place.

    Constant:
      model: the compiled scene.
      group, who: the group, and the number of the member in it.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q (n_q,), v, a (n,): coordinates, velocities, accelerations.
      scale: factor of the forces.
    Out:
      out (M_padded,): added to.
    """
    row = np.empty(pair_freedoms(model))
    rel = np.empty((model.pair.shape[0], pose_size(model)))
    relative_pose(model, q, v, rel)
    for k in range(model.block.shape[0]):
        if model.block[k, GROUP] != group or model.active[segment, k] == 0:
            continue
        if who < model.block[k, OFFSET] or who >= model.block[k, OFFSET] + model.block[k, COUNT]:
            continue
        i = model.block[k, START] + who - model.block[k, OFFSET]
        if model.block[k, CODE] == INERTER:
            f = inerter_force(model, k, i, q, v, a, row)
        else:
            f = _unit_force(model, k, i, segment, t, rel[model.block[k, PAIR]], member_state)
        out[i] += scale * f


@kernel
def _unit_force(model, k, i, segment, t, r, member_state):
    """The force of a member at unit strength (N), in tension positive; no inerter.

    Constant:
      model: the compiled scene.
      k, i: the block, and the member (padded).
      segment, t: segment of `model.times`, and time in it (s).
      r (POSE,): relative pose of its pair.
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
    """
    stretch, rate = motion_of_ends(model, i, r)
    stretch -= member_state[SET, i]
    value = level_of(model, segment, k, t)
    f, _, _, _, _ = law(
        model.block[k, CODE], model.law[k], stretch, rate, int(member_state[MODE, i]), t, value, model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return f
