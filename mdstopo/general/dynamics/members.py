"""The members of a scene by their blocks: how much there is of each, in which mode it is, and what all add up to.

Where a member lies between two bodies, and what its force does to them, is kinematics (`member_sums` and what stands
beside it in `kinematics_interface`). A law that switches is taken in the mode that the member is in (row MODE of
`member_state`); the integrators keep modes fixed within a step and land on their ends (`events`). Blocks of springs,
which neither switch nor remember, are summed as vectors.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, larger, largest, load, zero
from mdstopo.general.model.general_model import (
    CODE,
    COUNT,
    DESIGN,
    INERTER,
    MEMBER_EXCESS,
    MEMBER_FREE_LENGTH,
    PAIR,
    ROW,
    START,
)
from mdstopo.general.model.strides import pair_freedoms, place_in_pair
from mdstopo.mechanics.contact import contact_start
from mdstopo.mechanics.kinematics.kinematics_interface import (
    contact_second_rise,
    contact_seen,
    deflection,
    ends_meet,
    keep_apart,
    member_motion,
    member_sums,
    relative_pose,
    second_rate,
    spring_sums,
    spring_sums_at_poses,
)
from mdstopo.mechanics.laws.law_table import SPRING, law, law_first_set, law_has_pieces, law_remembers, law_start

#: rows of `member_state` (3, M_padded + n_contact + 1): alpha^mu, the mode of a law that switches or of a contact, the
#: permanent set of a law that remembers. The last column has the number of events that the modes include (`history`)
SCALE, MODE, SET = range(3)

#: share of the square of a free length that rounding may take from the square of a length at home
SURE = 1e-12
#: of how many members with curves steps end at the knots: of groups of up to SMALL_GROUP at any tolerance; of up to
#: KNOTTED in all at tolerances down to COARSE_TOLERANCE, and of more below it by this power of the tolerance
SMALL_GROUP, KNOTTED, COARSE_TOLERANCE, RISE = 12, 40, 1e-6, 0.25


@kernel
def scale_general(block, power, alpha, member_state):
    """member_state row SCALE = alpha^mu (Eq. 12); 1 for members that are no design variables."""
    for k in range(block.shape[0]):
        first = block[k, 4]
        mu = power[k]
        for i in range(block[k, 5]):
            a = alpha[first + i] if first >= 0 else 1.0
            member_state[SCALE, block[k, 1] + i] = a if mu == 1.0 else a**mu


@part
def level_of(model, segment, k, t):
    """The tabulated force (N) of the law of block k at time t of a segment."""
    return model.level[segment, k, 0] + (t - model.times[segment]) * model.level[segment, k, 1]


@part
def rate_of_row(model, p, row, v):
    """row (2 D,) of pair p times v (n,), velocities or virtual displacements."""
    total = 0.0
    for r in range(pair_freedoms(model)):
        total += row[r] * v[place_in_pair(model, p, r)]
    return total


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
        if model.active[segment, k] != 0 and model.block[k, CODE] != INERTER:
            p = model.block[k, PAIR]
            code = model.block[k, CODE]
            lo = model.block[k, START]
            count = model.block[k, COUNT]
            counted = model.block[k, DESIGN] >= 0
            if code == SPRING:
                row = model.block[k, ROW]
                spring_sums(model, model.law[k], lo, count, row, counted, member_state, rel[p], tangent, sums[p])
            else:
                level = level_of(model, segment, k, t)
                member_sums(
                    model, code, model.law[k], lo, count, counted, t, level, member_state, rel[p], tangent, sums[p]
                )


@kernel
def sums_at_poses(model, segment, when, member_state, rel, count, energies, sums):
    """`general_sums` with tangents at several states of one segment: the springs' data are read once for all.

    Constant:
      model: the compiled scene.
    In:
      segment: number of the stretch of time between two breakpoints.
      when (count or more,): times (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      rel (count or more, n_pair, POSE): relative poses.
      count: how many of them.
      energies: whether E and E_xi are wanted.
    Out:
      sums (count or more, n_pair, SUMS): added to.
    """
    tangent = np.bool_(True)
    for k in range(model.block.shape[0]):
        if model.active[segment, k] != 0 and model.block[k, CODE] != INERTER:
            p = model.block[k, PAIR]
            code = model.block[k, CODE]
            lo = model.block[k, START]
            members = model.block[k, COUNT]
            counted = energies and model.block[k, DESIGN] >= 0
            if code == SPRING:
                row = model.block[k, ROW]
                spring_sums_at_poses(
                    model, model.law[k], lo, members, row, counted, member_state, rel, p, count, tangent, sums
                )
                continue
            for j in range(count):
                level = level_of(model, segment, k, when[j])
                member_sums(
                    model, code, model.law[k], lo, members, counted, when[j], level, member_state, rel[j, p], tangent,
                    sums[j, p],
                )  # fmt: skip


@kernel
def shortest_at_home(model, shortest):
    """shortest (n_pair,) = at most the length of the shortest member of each pair at home (m); infinite without one."""
    width = model.member.shape[1]
    rows = model.member.reshape(model.member.size)
    free = (model.member.shape[0] + MEMBER_FREE_LENGTH) * width
    excess = (model.member.shape[0] + MEMBER_EXCESS) * width
    shortest[:] = np.inf
    for k in range(model.block.shape[0]):
        lo = model.block[k, START]
        stop = lo + model.block[k, COUNT]
        vectors = lo + (stop - lo) // lanes() * lanes()
        opposite = zero() - np.inf  # of the square
        for i in range(lo, vectors, lanes()):
            l0 = load(rows, free + i)
            opposite = larger((SURE - 1.0) * l0 * l0 - load(rows, excess + i), opposite)
        most = largest(opposite)
        for i in range(vectors, stop):
            l0 = rows[free + i]
            most = max(most, (SURE - 1.0) * l0 * l0 - rows[excess + i])
        p = model.block[k, PAIR]
        shortest[p] = min(shortest[p], np.sqrt(max(-most, 0.0)))


@kernel
def shortest_at_start(model, rel0, shortest):
    """shortest (n_pair,) = at most the length of each pair's shortest member at the relative poses rel0 (m)."""
    shortest_at_home(model, shortest)
    home = np.zeros(rel0.shape)  # nothing has changed since
    for p in range(shortest.shape[0]):
        shortest[p] -= deflection(model, rel0, home, p)


@kernel
def may_meet(shortest, motion):
    """Whether ends of a member may have met: not where all are longer than their pair has moved; both (n_pair,)."""
    may = False
    for p in range(motion.shape[0]):
        may = may or not shortest[p] > 1.001 * motion[p]
    return may


@kernel
def note_motion(model, segment, t, member_state, q, v, rel, rel0, shortest, motion, before, where):
    """Note how far bodies have moved by the end of a step, and a member whose ends may have met in it.

    Constant:
      model: the compiled scene.
      rel0 (n_pair, POSE): relative poses at the start of the run.
      shortest (n_pair,): of `shortest_at_start` (m).
    In:
      segment: number of the stretch of time between two breakpoints.
      t: time at the start of the step (s).
      member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member.
      q (n_q,), v (n,): the start of the step.
      rel (n_pair, POSE): relative poses at its end.
    In place:
      motion (n_pair,): how far each pair has been strained (m).
      where (3,): where[1] becomes the member, if there is none yet.
    Out:
      before (n_pair, POSE): relative poses at the start of the step, where these are looked at.
    """
    for p in range(motion.shape[0]):
        motion[p] = max(motion[p], deflection(model, rel, rel0, p))
    if where[1] < 0 and may_meet(shortest, motion):
        relative_pose(model, q, v, before)
        where[1] = meeting(model, segment, t, member_state, before, rel)


@kernel
def knotted_at(tolerance):
    """Of how many members with curves steps end at the knots, at a tolerance.

    Steps across knots leave the motion within the tolerance, but derivatives off by thousands of it, because stiffness
    has kinks there. To end at each knot costs a step. The smaller the tolerance, the shorter steps are anyway, and the
    less an end at a knot costs.

    tolerance: of the case, relative.
    """
    return np.int64(KNOTTED * max(COARSE_TOLERANCE / tolerance, 1.0) ** RISE)


@kernel
def curved_members(model, member_state):
    """How many members have curves, and how many of these carry load; each law of a member counts."""
    curved = 0
    loaded = 0
    for k in range(model.block.shape[0]):
        if model.block[k, CODE] == INERTER or not law_has_pieces(model.block[k, CODE]):
            continue
        lo = model.block[k, START]
        curved += model.block[k, COUNT]
        for i in range(lo, lo + model.block[k, COUNT]):
            loaded += member_state[SCALE, i] != 0.0
    return curved, loaded


@kernel
def set_modes(model, member_state, rel, rel_rate, most_knotted):
    """Set the modes and permanent sets of members and contacts in member_state as they are at the start.

    Where steps end at the knots of a curve, its pieces are modes; else it has none. That is so of members that carry
    load where there are few of these, and, for the derivatives by their alphas, of the others too where there are few
    members with curves in all; of small groups always. The derivatives by all others that carry no load follow them
    through their knots within a step (`design.across_knots`).

    model: the compiled scene.
    member_state (3, M_padded + n_contact + 1): scale, mode and permanent set of every member; the scales are read.
    rel (n_pair, POSE): relative poses; rel_rate (n_pair, D): their second derivatives in time.
    most_knotted: up to how many members with curves are few (`knotted_at`); 0: steps end at no knots.
    """
    curved, loaded = curved_members(model, member_state)
    for k in range(model.block.shape[0]):
        code = model.block[k, CODE]
        if code == INERTER:
            continue
        r = rel[model.block[k, PAIR]]
        acc = rel_rate[model.block[k, PAIR]]
        lo = model.block[k, START]
        small = most_knotted > 0 and model.block[k, COUNT] <= SMALL_GROUP
        for i in range(lo, lo + model.block[k, COUNT]):
            _, x, rate = member_motion(model, i, r)
            second = second_rate(model, i, r, acc)
            carries = member_state[SCALE, i] != 0.0
            few = small or curved <= most_knotted or (carries and loaded <= most_knotted)
            if law_has_pieces(code) and not few:
                member_state[MODE, i] = 0.0
            else:
                rest = model.member[MEMBER_FREE_LENGTH, i]
                member_state[MODE, i] = law_start(
                    code, model.law[k], x, rate, second, model.times[0], model.curves, rest
                )
            member_state[SET, i] = law_first_set(code, model.law[k], x, int(member_state[MODE, i]))
            if law_remembers(code) and model.active[0, k] == 0:  # it has not acted yet
                member_state[MODE, i] = 0.0
                member_state[SET, i] = 0.0
    for j in range(model.contact_pair.shape[0]):
        p = model.contact_pair[j]
        height, rise, room, _, _ = contact_seen(model, j, rel[p])
        second = contact_second_rise(model, j, rel[p], rel_rate[p])
        member_state[MODE, model.member.shape[1] + j] = contact_start(model.contact[j], height, rise, second, room)


@kernel
def unscale_general(block, power, alpha, padded, out):
    """Derivatives by alpha from those by alpha^mu: times mu alpha^(mu - 1), summed over the laws of a member.

    block (n_block, 9), power (n_block,): as in `GeneralModel`; alpha (N,): the design.
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
        if model.active[segment, k] == 0 or model.block[k, CODE] == INERTER:
            continue
        r = before[model.block[k, PAIR]]
        w = after[model.block[k, PAIR]]
        lo = model.block[k, START]
        if keep_apart(model, lo, model.block[k, COUNT], model.block[k, ROW], r, w):
            continue
        value = level_of(model, segment, k, t)
        for i in range(lo, lo + model.block[k, COUNT]):
            if not ends_meet(model, i, r, w):
                continue
            f, _, _, _, _ = law(
                model.block[k, CODE], model.law[k], -model.member[MEMBER_FREE_LENGTH, i] - member_state[SET, i], 0.0,
                int(member_state[MODE, i]), t, value, model.curves, model.member[MEMBER_FREE_LENGTH, i],
            )  # fmt: skip
            if f * member_state[SCALE, i] != 0.0:
                return i
    return -1
