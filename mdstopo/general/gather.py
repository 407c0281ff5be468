"""What the derivatives by the design gather at one state: from every member's force, and from what is looked at."""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.padding import whole_vectors
from mdstopo.general.forces import inerter_force, turn_bodies, turned_pose
from mdstopo.general.members import block_design, rate_of_row, stretched
from mdstopo.general.model import INERTER
from mdstopo.general.parameters import add_force_parameters, add_parameters
from mdstopo.general.responses import MEMBER_FORCE, member_force
from mdstopo.general.switches import carriers
from mdstopo.general.track import has_factors
from mdstopo.integrators.steps import DESIGN
from mdstopo.mechanics.geometry import POSE, pair_displacement, relative_pose
from mdstopo.mechanics.laws.alike import elastic_designs
from mdstopo.mechanics.laws.table import SPRING, law


@kernel
def add_design(model, segment, t, strength, q, v, a, z, weight, out, work):
    """out (M_padded,) -= f_i (b_i . T z) at unit strength, += weight V_i, of all design members at one state.

    Behind the members out has the derivatives by parameters (P,), here and everywhere (`parameters`).
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
    _add(model, segment, when, strength, stage, turned, z.reshape((1, n)), weight, out)


@kernel
def add_designs(model, segment, track, o, strength, z, out, work):
    """`add_design` of the stages from o on, as many as z (S, n) has, without energy: springs are read once."""
    end = o + z.shape[0]
    work[DESIGN] += z.shape[0]
    if has_factors(track):
        turned = track.turned[o:end]
    else:
        turned = np.empty((z.shape[0], model.mass.shape[0] // 3, 2))
        for j in range(z.shape[0]):
            turn_bodies(track.stage[o + j, 0], turned[j])
    _add(model, segment, track.when[o:end], strength, track.stage[o:end], turned, z, 0.0, out)


@kernel
def _add(model, segment, when, strength, stage, turned, z, weight, out):
    """`add_design` at the times when (S,), of stage (S, 3, n) with the bodies turned (S, n_body, 2)."""
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
                block_design(model, k, segment, when[j], strength, strength[1], rel[j, p], u[j, p], weight, out)
                continue
            for i in range(lo, lo + model.block[k, 5]):
                f = inerter_force(model, k, i, stage[j, 0], stage[j, 1], stage[j, 2], row)
                out[i] -= f * rate_of_row(model, p, row, z[j])
    if model.varied.shape[0] > 0:
        for j in range(count):
            add_parameters(model, segment, when[j], strength, stage[j, 0], stage[j, 1], stage[j, 2], z[j], weight, out)


@kernel
def _virtual(pair, rel, p, z, out):
    """out (3,) = -T z."""
    pair_displacement(pair, rel, p, z, out)
    for i in range(3):
        out[i] = -out[i]


@kernel
def explicit_part(model, segment, j, who, t, strength, q, v, a, scale, out):
    """out (M_padded,) += scale df*/d(alpha^mu) at fixed motion, where g_j is the force f* of member `who`.

    f* has a sign; its absolute value is what is looked at (`force_sign`).
    """
    if model.response[j, 0] != MEMBER_FORCE:
        return
    _add_laws(model, segment, j, who, t, strength, q, v, a, scale, out)
    if model.varied.shape[0] > 0:
        add_force_parameters(model, segment, model.response[j, 5], who, t, strength, q, v, a, scale, out)


@kernel
def force_sign(model, segment, j, who, t, strength, q, v, a):
    """The sign of f* where g_j is the force of member `who`; else 1.

    It is that of the very number that `response` takes the absolute value of: near zero another formula for the same
    force may have the other sign.
    """
    if model.response[j, 0] != MEMBER_FORCE:
        return 1.0
    slopes = np.empty((3, 6))
    own = np.empty((2, 6))
    f, _ = member_force(model, strength, segment, t, model.response[j, 5], who, q, v, a, slopes, own)
    return 1.0 if f >= 0.0 else -1.0


@kernel
def _add_laws(model, segment, j, who, t, strength, q, v, a, scale, out):
    """out (M_padded,) += scale times the force of each law of a member at unit strength."""
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
            f = _unit_force(model, k, i, segment, t, rel[model.block[k, 0]], strength)
        out[i] += scale * f


@kernel
def _unit_force(model, k, i, segment, t, r, strength):
    c = r[2]
    s = r[3]
    ax = c * model.member[2, i] - s * model.member[3, i]
    ay = s * model.member[2, i] + c * model.member[3, i]
    x = r[0] + ax - model.member[0, i]
    y = r[1] + ay - model.member[1, i]
    length = np.sqrt(x * x + y * y)
    rate = (x * r[4] + y * r[5] + (ax * y - ay * x) * r[6]) / length if length > 0.0 else 0.0
    value = model.level[segment, k, 0] + (t - model.times[segment]) * model.level[segment, k, 1]
    stretch = stretched(model.member, i, r, length) - strength[2, i]
    f, _, _, _, _ = law(model.block[k, 3], model.law[k], stretch, rate, int(strength[1, i]), t, value, model.curves)
    return f
