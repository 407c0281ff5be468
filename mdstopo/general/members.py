"""All member laws at one relative pose: sums over a block, one member's motion, the design gradient.

Geometry as in `mechanics.laws.spring`: with r = d + R q - p, L = |r|, e = r/L,

    b = dL/dxi = (e, (R q x r)/L),   B2 = d2L/dxi2,   Delta = L - l0,   dDelta/dt = b . xi'

and a law f(Delta, dDelta/dt, t) with its partials gives Q = -sum s f b, K = sum s (b (f_D b + f_Dd B2 xi')^T + f B2),
C = sum s f_Dd b b^T, E = sum s V, E_xi = sum s V' b, where s = alpha^mu. A law that switches is taken in the mode that
the member is in (`member_state` row 1); the integrators keep modes fixed within a step and land on their ends
(`events`). Blocks of springs, which neither switch nor remember, take the vectors of `mechanics.laws.alike` instead.
"""

import math

import numpy as np

from mdstopo.compiler.jit import inline, kernel, part
from mdstopo.compiler.padding import whole_vectors
from mdstopo.general.model import INERTER
from mdstopo.mechanics.contact import contact_pose, contact_start, second_rise
from mdstopo.mechanics.laws.alike import alike_damping, alike_design, alike_sums, alike_tangent, far
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED, elastic_force, elastic_tangent, elongation_of
from mdstopo.mechanics.laws.sums import add_forces, add_tangent
from mdstopo.mechanics.laws.table import SPRING, law, law_first_set, law_has_pieces, law_remembers, law_start

#: rows of `member_state` (3, M_padded + n_contact + 1): alpha^mu, the mode of a law that switches or of a contact, the
#: permanent set of a law that remembers. The last column has the number of events that the modes include (`history`)
SCALE, MODE, SET = range(3)

#: members of a group up to which steps end at the knots of their curves: a hundred would pass so many that steps
#: would be cut to nothing
KNOTTED = 12


@kernel
def scale_general(block, power, alpha, member_state):
    """member_state row SCALE = alpha^mu (Eq. 12); 1 for members that are no design variables."""
    for k in range(block.shape[0]):
        first = block[k, 4]
        mu = power[k]
        for i in range(block[k, 5]):
            a = alpha[first + i] if first >= 0 else 1.0
            member_state[0, block[k, 1] + i] = a if mu == 1.0 else a**mu


@inline
def direction(member, i, dx, dy, c, s):
    """Length and direction of member i at a relative pose.

    member (6, M_padded): P, Q in body frames (m) and what else `GeneralModel.member` has.
    i: number of the member (padded).
    dx, dy: place of the second body as seen from the first (m).
    c, s: cos and sin of its angle.

    Returns L (m), b = dL/dxi (3 numbers), 1 / L (1/m; 0 where there is no length) and R q (2 numbers, m).
    """
    ax = c * member[2, i] - s * member[3, i]
    ay = s * member[2, i] + c * member[3, i]
    rx = dx + ax - member[0, i]
    ry = dy + ay - member[1, i]
    r2 = rx * rx + ry * ry
    y = 1.0 / math.sqrt(r2) if r2 > ZERO_LENGTH_SQUARED else 0.0
    return r2 * y, y * rx, y * ry, y * (ax * ry - ay * rx), y, ax, ay


@inline
def stretched(member, i, r, length):
    """Elongation Delta (m) of member i at the relative pose r (POSE,), where it has a length."""
    x = member[2, i]
    y = member[3, i]
    rx = r[0] + (r[2] * x - r[3] * y) - member[0, i]
    ry = r[1] + (r[3] * x + r[2] * y) - member[1, i]
    ux = r[10] + (r[12] * x - r[13] * y)
    uy = r[11] + (r[13] * x + r[12] * y)
    return elongation_of(rx, ry, length, ux, uy, member[4, i], member[5, i])


@inline
def stretch_of(member, i, r):
    """Elongation Delta (m) and its rate (m/s) of member i at the relative pose r (POSE,)."""
    length, bx, by, bt, _, _, _ = direction(member, i, r[0], r[1], r[2], r[3])
    return stretched(member, i, r, length), bx * r[4] + by * r[5] + bt * r[6]


@part
def rate_of_row(model, p, row, v):
    """row (6,) of pair p times v (n,), velocities or virtual displacements."""
    total = 0.0
    for r in range(6):
        total += row[r] * v[3 * model.pair[p, r // 3] + r % 3]
    return total


@kernel
def add_block(model, k, segment, t, member_state, r, tangent, o):
    """Add the forces, energy and tangents of the members of a block to the sums of its pair.

    Springs are summed by `add_springs`.

    Constant:
      model: the compiled scene.
      k: the block.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      r (POSE,): relative pose of the pair.
      tangent: whether K and C are wanted.
    Out:
      o (SUMS,): Q, E, E_xi and on demand K, C (`mechanics.passes`), added to.
    """
    p = model.law[k]
    code = model.block[k, 3]
    member = model.member
    counted = model.block[k, 4] >= 0
    curves = model.curves
    tau = t - model.times[segment]
    value = model.level[segment, k, 0] + tau * model.level[segment, k, 1]
    vx = r[4]
    vy = r[5]
    vt = r[6]
    lo = model.block[k, 1]
    for i in range(lo, lo + model.block[k, 5]):
        length, bx, by, bt, y, ax, ay = direction(member, i, r[0], r[1], r[2], r[3])
        if length == 0.0:  # not y == 0.0: that is so infinitely far away, too
            continue
        rate = bx * vx + by * vy + bt * vt
        scale = member_state[0, i]
        x = stretched(member, i, r, length) - member_state[2, i]
        f, fd, fr, energy, pull = law(code, p, x, rate, int(member_state[1, i]), t, value, curves)
        f *= scale
        o[0] -= f * bx
        o[1] -= f * by
        o[2] -= f * bt
        if counted:
            o[3] += scale * energy
            pull *= scale
            o[4] += pull * bx
            o[5] += pull * by
            o[6] += pull * bt
        if not tangent:
            continue
        fd *= scale
        fr *= scale
        hxx = y * (1.0 - bx * bx)
        hxy = -y * bx * by
        hyy = y * (1.0 - by * by)
        hxt = -y * (ay + bx * bt)
        hyt = y * (ax - by * bt)
        htt = y * (ax * ax + ay * ay - bt * bt) - (bx * ax + by * ay)
        fx = fd * bx + fr * (hxx * vx + hxy * vy + hxt * vt)
        fy = fd * by + fr * (hxy * vx + hyy * vy + hyt * vt)
        ft = fd * bt + fr * (hxt * vx + hyt * vy + htt * vt)
        o[7] += bx * fx + f * hxx
        o[8] += bx * fy + f * hxy
        o[9] += bx * ft + f * hxt
        o[10] += by * fx + f * hxy
        o[11] += by * fy + f * hyy
        o[12] += by * ft + f * hyt
        o[13] += bt * fx + f * hxt
        o[14] += bt * fy + f * hyt
        o[15] += bt * ft + f * htt
        o[16] += fr * bx * bx
        o[17] += fr * bx * by
        o[18] += fr * by * by
        o[19] += fr * bx * bt
        o[20] += fr * by * bt
        o[21] += fr * bt * bt


@part
def add_springs(model, k, member_state, r, tangent, o):
    """Add the forces, energy and tangents of a block of springs to the sums of its pair.

    Constant:
      model: the compiled scene.
      k: the block.
    In:
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      r (POSE,): relative pose of the pair.
      tangent: whether K and C are wanted.
    Out:
      o (SUMS,): Q, E, E_xi and on demand K, C (`mechanics.passes`), added to.
    """
    member = model.member
    p = model.law[k]
    start = model.block[k, 1]
    stop = start + whole_vectors(model.block[k, 5])
    counted = model.block[k, 4] >= 0
    width = member.shape[1]
    rows = member.reshape(member.size)
    scale = member_state.reshape(member_state.size)
    c = p[0]
    if p[1] != 0.0 or p[2] != 0.0:
        alike_sums(rows, width, scale, start, stop, p, r, counted, o)
        if tangent:
            alike_tangent(rows, width, scale, start, stop, p, r, o)
            if p[1] != 0.0:
                alike_damping(rows, width, scale, start, stop, p, r, o)
    elif tangent:
        x, y, t, e, kxx, kxy, kyy, kxt, kyt, ktt = elastic_tangent(rows, width, scale, start, stop, r, np.bool_(True))
        add_forces((c * x, c * y, c * t, c * e), counted, o)
        add_tangent((c * kxx, c * kxy, c * kyy, c * kxt, c * kyt, c * ktt), o)
    else:
        x, y, t, e = elastic_force(rows, width, scale, start, stop, r, np.bool_(True))
        add_forces((c * x, c * y, c * t, c * e), counted, o)


@kernel
def general_sums(model, segment, t, member_state, rel, tangent, sums):
    """Add the forces, energy and tangents of all members that act, but inerters, to the sums of their pairs.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      rel (n_pair, POSE): relative poses.
      tangent: whether K and C are wanted.
    Out:
      sums (n_pair, SUMS): Q, E, E_xi and on demand K, C (`mechanics.passes`), added to.
    """
    for k in range(model.block.shape[0]):
        if model.active[segment, k] != 0 and model.block[k, 3] != INERTER:
            p = model.block[k, 0]
            if model.block[k, 3] == SPRING:
                add_springs(model, k, member_state, rel[p], tangent, sums[p])
            else:
                add_block(model, k, segment, t, member_state, rel[p], tangent, sums[p])


@kernel
def set_modes(model, member_state, rel, rel_rate, knots):
    """Set rows MODE and SET of member_state, modes and permanent sets of members and contacts, as they are at the
    start.

    rel (n_pair, POSE): relative poses; rel_rate (n_pair, 3): their second derivatives in time.
    knots: whether each piece of a curve is a mode, so that steps end at its knots; otherwise, and in groups of more
    than KNOTTED members, curves have no modes.
    """
    for k in range(model.block.shape[0]):
        code = model.block[k, 3]
        if code == INERTER:
            continue
        r = rel[model.block[k, 0]]
        acc = rel_rate[model.block[k, 0]]
        lo = model.block[k, 1]
        for i in range(lo, lo + model.block[k, 5]):
            length, bx, by, bt, _, _, _ = direction(model.member, i, r[0], r[1], r[2], r[3])
            rate = bx * r[4] + by * r[5] + bt * r[6]
            second = second_rate(model.member, i, r, acc)
            x = stretched(model.member, i, r, length)
            whole = law_has_pieces(code) and (not knots or model.block[k, 5] > KNOTTED)
            member_state[1, i] = 0.0 if whole else law_start(code, model.law[k], x, rate, second, model.curves)
            member_state[2, i] = law_first_set(code, model.law[k], x, int(member_state[1, i]))
            if law_remembers(code) and model.active[0, k] == 0:  # it has not acted yet
                member_state[1, i] = 0.0
                member_state[2, i] = 0.0
    for j in range(model.contact_pair.shape[0]):
        p = model.contact_pair[j]
        along, height, _, rise = contact_pose(model.contact[j], rel[p])
        second = second_rise(model.contact[j], rel[p], rel_rate[p])
        member_state[1, model.member.shape[1] + j] = contact_start(model.contact[j], along, height, rise, second)


@inline
def second_rate(member, i, r, acc):
    """d2Delta/dt2 = b . xi'' + xi' . B2 xi' of member i; acc (3,): xi''."""
    _, bx, by, bt, y, ax, ay = direction(member, i, r[0], r[1], r[2], r[3])
    hxx = y * (1.0 - bx * bx)
    hxy = -y * bx * by
    hyy = y * (1.0 - by * by)
    hxt = -y * (ay + bx * bt)
    hyt = y * (ax - by * bt)
    htt = y * (ax * ax + ay * ay - bt * bt) - (bx * ax + by * ay)
    vx = r[4]
    vy = r[5]
    vt = r[6]
    return (
        bx * acc[0]
        + by * acc[1]
        + bt * acc[2]
        + vx * (hxx * vx + 2.0 * (hxy * vy + hxt * vt))
        + vy * (hyy * vy + 2.0 * hyt * vt)
        + vt * htt * vt
    )


@kernel
def block_design(model, k, segment, t, member_state, modes_of, r, u, weight, out):
    """Add what the members of a block contribute to a derivative by alpha^mu at one state: f_i (b_i . u) + weight V_i.

    f_i and V_i are a member's force (N) and energy (J) at unit strength; not of inerters.

    Constant:
      model: the compiled scene.
      k: the block.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      modes_of (M_padded or more,): mode of every member.
      r (POSE,): relative pose of the pair.
      u (3,): virtual change of that pose (m, m, rad).
      weight: factor of the stored energy.
    Out:
      out (M_padded or more,): added to.
    """
    p = model.law[k]
    code = model.block[k, 3]
    member = model.member
    lo = model.block[k, 1]
    if code == SPRING:
        width = member.shape[1]
        stop = lo + whole_vectors(model.block[k, 5])
        alike_design(member.reshape(6 * width), width, lo, stop, p, r, u, weight, out)
        return
    curves = model.curves
    tau = t - model.times[segment]
    value = model.level[segment, k, 0] + tau * model.level[segment, k, 1]
    for i in range(lo, lo + model.block[k, 5]):
        length, bx, by, bt, _, _, _ = direction(member, i, r[0], r[1], r[2], r[3])
        if length == 0.0:
            continue
        rate = bx * r[4] + by * r[5] + bt * r[6]
        x = stretched(member, i, r, length) - member_state[2, i]
        f, _, _, energy, _ = law(code, p, x, rate, int(modes_of[i]), t, value, curves)
        out[i] += f * (bx * u[0] + by * u[1] + bt * u[2]) + weight * energy


@kernel
def unscale_general(block, power, alpha, padded, out):
    """Derivatives by alpha from those by alpha^mu: times mu alpha^(mu - 1), summed over the laws of a member.

    block (n_block, 8), power (n_block,): as in `GeneralModel`; alpha (N,): the design.
    padded (M_padded + P,): derivatives by alpha^mu of each member and law, then by the values of the laws' variables.
    out (N + P,): set to the derivatives by alpha, then, unchanged, those by the values.
    """
    out[:] = 0.0
    members = block[block.shape[0] - 1, 2] if block.shape[0] > 0 else 0
    varied = padded.shape[0] - members
    for c in range(varied):
        out[out.shape[0] - varied + c] = padded[members + c]
    for k in range(block.shape[0]):
        first = block[k, 4]
        if first < 0:
            continue
        mu = power[k]
        for i in range(block[k, 5]):
            factor = 1.0 if mu == 1.0 else mu * alpha[first + i] ** (mu - 1.0)
            out[first + i] += factor * padded[block[k, 1] + i]


@kernel
def meeting(model, segment, t, member_state, before, after):
    """A member whose ends meet between two relative poses while it would carry a force, or -1.

    There its direction is not defined, so the motion has no derivative.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      before, after (n_pair, POSE): the poses; between them ends move on straight lines.

    Returns the number of the member (padded).
    """
    for k in range(model.block.shape[0]):
        if model.active[segment, k] == 0 or model.block[k, 3] == INERTER:
            continue
        r = before[model.block[k, 0]]
        w = after[model.block[k, 0]]
        m = model.member
        lo = model.block[k, 1]
        if far(m.reshape(m.size), m.shape[1], lo, lo + whole_vectors(model.block[k, 5]), r, w):
            continue
        value = model.level[segment, k, 0] + (t - model.times[segment]) * model.level[segment, k, 1]
        for i in range(lo, lo + model.block[k, 5]):
            x = r[0] + r[2] * m[2, i] - r[3] * m[3, i] - m[0, i]
            y = r[1] + r[3] * m[2, i] + r[2] * m[3, i] - m[1, i]
            ux = w[0] + w[2] * m[2, i] - w[3] * m[3, i] - m[0, i] - x
            uy = w[1] + w[3] * m[2, i] + w[2] * m[3, i] - m[1, i] - y
            u2 = ux * ux + uy * uy
            along = -(x * ux + y * uy)
            across = x * uy - y * ux
            met = u2 > 0.0 and along >= 0.0 and along <= u2 and across * across <= 1e-18 * u2 * u2
            if not met and x * x + y * y > ZERO_LENGTH_SQUARED:
                continue
            f, _, _, _, _ = law(
                model.block[k, 3], model.law[k], -m[4, i] - member_state[2, i], 0.0, int(member_state[1, i]), t, value,
                model.curves,
            )  # fmt: skip
            if f * member_state[0, i] != 0.0:
                return i
    return -1
