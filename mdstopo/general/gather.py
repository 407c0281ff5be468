"""What the derivatives by the design gather at one state: from every member's force, and from the response itself."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.padding import whole_vectors
from mdstopo.general.forces import inerter_force, turn_bodies, turned_pose
from mdstopo.general.members import block_design, rate_of_row, stretched
from mdstopo.general.model import INERTER
from mdstopo.general.parameters import add_force_parameters, add_parameters
from mdstopo.general.responses import MEMBER_FORCE, member_force
from mdstopo.general.step_history import has_factors
from mdstopo.general.switches import carriers
from mdstopo.integrators.steps import DESIGN
from mdstopo.mechanics.kinematics.planar_poses import POSE, pair_displacement, relative_pose
from mdstopo.mechanics.laws.alike import elastic_designs
from mdstopo.mechanics.laws.table import SPRING, law


@kernel
def add_design(model, segment, t, member_state, q, v, a, z, weight, out, work):
    """What all design members do to the gradient at one state: out -= f_i (b_i . T z) at unit strength, += weight V_i.

    Behind the members out has the derivatives by parameters (P,), here and everywhere (`parameters`).

    Constant:
      model: the compiled scene.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      z (n,): virtual displacements.
      weight: of the stored energy.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters, added to.
      work (WORK,): counts of work, added to.
    """
    n = model.mass.shape[0]
    work[DESIGN] += 1
    when = np.empty(1)
    stage = np.empty((1, 3, n))
    turned = np.empty((1, n // 3, 2))
    when[0] = t
    for d in range(n):
        stage[0, 0, d] = q[d]
        stage[0, 1, d] = v[d]
        stage[0, 2, d] = a[d]
    turn_bodies(q, turned[0])
    _add(model, segment, when, member_state, stage, turned, z.reshape((1, n)), weight, out)


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
    work[DESIGN] += z.shape[0]
    if has_factors(history):
        turned = history.turned[o:end]
    else:
        turned = np.empty((z.shape[0], model.mass.shape[0] // 3, 2))
        for j in range(z.shape[0]):
            turn_bodies(history.stage[o + j, 0], turned[j])
    _add(model, segment, history.when[o:end], member_state, history.stage[o:end], turned, z, 0.0, out)


@kernel
def _add(model, segment, when, member_state, stage, turned, z, weight, out):
    """`add_design` at S states of one segment.

    Constant:
      model: the compiled scene.
      segment: segment of `model.times`. when (S,): times (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      stage (S, 3, n): coordinates, velocities, accelerations. turned (S, n_body, 2): of `forces.turn_bodies`.
      z (S, n): virtual displacements.
      weight: of the stored energy.
    Out:
      out (M_padded + P,): the derivative by alpha^mu and by parameters, added to.
    """
    count = z.shape[0]
    n_pair = model.pair.shape[0]
    rel = np.empty((count, n_pair, POSE))
    u = np.empty((count, n_pair, 3))
    row = np.empty(6)
    carries = carriers(model)
    for j in range(count):
        for p in range(n_pair):
            if carries[p] != 0:
                turned_pose(model, p, turned[j], stage[j, 0], stage[j, 1], rel[j])
                _virtual(model.pair, rel[j], p, z[j], u[j, p])
    for k in range(model.block.shape[0]):
        code = model.block[k, 3]
        if model.block[k, 4] < 0 or model.active[segment, k] == 0:
            continue
        p = model.block[k, 0]
        lo = model.block[k, 1]
        if code == SPRING and weight == 0.0 and model.law[k, 1] == 0.0 and model.law[k, 2] == 0.0:
            width = model.member.shape[1]
            rows = model.member.reshape(6 * width)
            stop = lo + whole_vectors(model.block[k, 5])
            elastic_designs(rows, width, lo, stop, model.law[k, 0], rel, u, p, out)
            continue
        for j in range(count):
            if code != INERTER:
                block_design(model, k, segment, when[j], member_state, member_state[1], rel[j, p], u[j, p], weight, out)
                continue
            for i in range(lo, lo + model.block[k, 5]):
                f = inerter_force(model, k, i, stage[j, 0], stage[j, 1], stage[j, 2], row)
                out[i] -= f * rate_of_row(model, p, row, z[j])
    if model.varied.shape[0] > 0:
        for j in range(count):
            add_parameters(
                model, segment, when[j], member_state, stage[j, 0], stage[j, 1], stage[j, 2], z[j], weight, out
            )


@kernel
def _virtual(pair, rel, p, z, out):
    """out (3,) = -T z of pair p: the virtual change of its relative pose, with the sign turned."""
    pair_displacement(pair, rel, p, z, out)
    for i in range(3):
        out[i] = -out[i]


@kernel
def explicit_part(model, segment, j, who, t, member_state, q, v, a, scale, out):
    """What the design does to g_j at fixed motion, where g_j is the force f* of a member.

    f* has a sign; its absolute value is what is looked at (`force_sign`).

    Constant:
      model: the compiled scene.
      j, who: the response, and the number of the member in its group.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      scale: factor of df*.
    Out:
      out (M_padded + P,): scale times the derivative of f* by alpha^mu and by parameters, added to.
    """
    if model.response[j, 0] != MEMBER_FORCE:
        return
    _add_laws(model, segment, j, who, t, member_state, q, v, a, scale, out)
    if model.varied.shape[0] > 0:
        add_force_parameters(model, segment, model.response[j, 5], who, t, member_state, q, v, a, scale, out)


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
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
    """
    if model.response[j, 0] != MEMBER_FORCE:
        return 1.0
    slopes = np.empty((3, 6))
    own = np.empty((2, 6))
    f, _ = member_force(model, member_state, segment, t, model.response[j, 5], who, q, v, a, slopes, own)
    return 1.0 if f >= 0.0 else -1.0


@kernel
def _add_laws(model, segment, j, who, t, member_state, q, v, a, scale, out):
    """The forces of all laws of a member at unit strength, each to its own place.

    Constant:
      model: the compiled scene.
      j, who: the response, which names the group, and the number of the member in it.
      segment, t: segment of `model.times`, and time in it (s).
      member_state (3, columns): state of the members: scale, mode, permanent set (`members`).
      q, v, a (n,): coordinates, velocities, accelerations (m, rad; per s; per s^2).
      scale: factor of the forces.
    Out:
      out (M_padded,): added to.
    """
    row = np.empty(6)
    rel = np.empty((model.pair.shape[0], POSE))
    relative_pose(model.pair, model.home, q, v, rel)
    for k in range(model.block.shape[0]):
        if model.block[k, 6] != model.response[j, 5] or model.active[segment, k] == 0:
            continue
        if who < model.block[k, 7] or who >= model.block[k, 7] + model.block[k, 5]:
            continue
        i = model.block[k, 1] + who - model.block[k, 7]
        if model.block[k, 3] == INERTER:
            f = inerter_force(model, k, i, q, v, a, row)
        else:
            f = _unit_force(model, k, i, segment, t, rel[model.block[k, 0]], member_state)
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
    c = r[2]
    s = r[3]
    ax = c * model.member[2, i] - s * model.member[3, i]
    ay = s * model.member[2, i] + c * model.member[3, i]
    x = r[0] + ax - model.member[0, i]
    y = r[1] + ay - model.member[1, i]
    length = np.sqrt(x * x + y * y)
    rate = (x * r[4] + y * r[5] + (ax * y - ay * x) * r[6]) / length if length > 0.0 else 0.0
    value = model.level[segment, k, 0] + (t - model.times[segment]) * model.level[segment, k, 1]
    stretch = stretched(model.member, i, r, length) - member_state[2, i]
    f, _, _, _, _ = law(model.block[k, 3], model.law[k], stretch, rate, int(member_state[1, i]), t, value, model.curves)
    return f
