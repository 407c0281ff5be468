"""Derivatives by members that carry no load and pass knots of their law within a step.

In large groups steps end at the knots of those curves that carry load (`dynamics.members.set_modes`): the others do
nothing to the motion. But a derivative by alpha = 0 is an integral of the member's force over the motion, and the
weights of a step's stages are for integrands that are smooth within the step. So such a member is followed through it
(`followed_member`), as the price of a member that is not built is.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.design.followed_member import (
    AT_NODES,
    CHANGES,
    CLOSE_MARGIN,
    HIGHEST_POWER,
    NODE_ROWS,
    PIECE,
    degree_of,
    fill_power,
    follow,
    over_pieces,
)
from mdstopo.general.design.gather import poses_of_stages
from mdstopo.general.design.row_design import changes_of_pairs
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.dynamics.members import MODE, SCALE
from mdstopo.general.model.general_model import (
    CODE,
    COUNT,
    DESIGN,
    INERTER,
    MEMBER_FREE_LENGTH,
    PAIR,
    START,
)
from mdstopo.general.model.priced_candidates import NODE, NODES
from mdstopo.general.steps.step_history import FIRST, SEGMENT
from mdstopo.mechanics.kinematics.kinematics_interface import (
    ALONG,
    ELONGATION,
    INVERSE,
    RATE,
    WORKS,
    drive_state,
    freedoms,
    member_motion,
    member_work,
    member_works,
    pose_acceleration,
    pose_size,
    quintic,
    relative_pose,
    second_rate,
)
from mdstopo.mechanics.laws.law_table import law, law_has_pieces, law_margin, law_start

#: steps of fewer stages are of methods of second order, which lose nothing by knots; others begin with a stage at their
#: start (Gauss does not, but takes no laws with pieces). `row_sweep.SHORT_STEP` is below this
FEWEST_STAGES = 4


@kernel
def add_across_knots(model, history, w, member_state, z, out):
    """Put right what the derivatives by members without load have of a step, where they pass knots.

    Constant:
      model: the compiled scene.
      history, w: the history of steps (`StepHistory`), and the step.
      member_state (3, columns): state of the members, with the modes of the step.
    In:
      z (R, stages or more, n): virtual displacements of the stages, times the stages' weights, for each of R rows.
    Out:
      out (R, M_padded or more): derivatives by alpha^mu, to which the sums over the stages have been added.
    """
    if not _follows_any(model, history, w, member_state):
        return
    o, stages = _stages_of(history, w)
    rel = poses_of_stages(model, history, o, stages)
    u = np.empty((z.shape[0], stages, model.pair.shape[0], freedoms(model)))
    changes_of_pairs(model, rel, z, u)
    _add_followed(model, history, w, member_state, rel, u, np.empty(0), out)


@kernel
def add_changes_across_knots(model, history, w, member_state, rel, u, out):
    """`add_across_knots` where the changes of poses are known.

    model, history, w, member_state, out: as there.
    rel (S, n_pair, POSE): relative poses at the stages.
    u (R, S or more, n_pair, D): virtual changes of these, weighted alike, for each row, with their signs
    turned.
    """
    if _follows_any(model, history, w, member_state):
        _add_followed(model, history, w, member_state, rel, u, np.empty(0), out)


@kernel
def add_energies_across_knots(model, history, w, member_state, weights, out):
    """Put right what the derivatives of an integral have of the energy that members without load would store.

    model, history, w, member_state: as of `add_across_knots`.
    weights (S,): of the stored energy at each stage.
    out (M_padded or more,): derivatives by alpha^mu, to which the sums over the stages have been added.
    """
    if not _follows_any(model, history, w, member_state):
        return
    o, stages = _stages_of(history, w)
    rel = poses_of_stages(model, history, o, stages)
    u = np.zeros((1, stages, model.pair.shape[0], freedoms(model)))
    _add_followed(model, history, w, member_state, rel, u, weights, out.reshape((1, out.shape[0])))


@part
def _stages_of(history, w):
    """The first stage of a step, and how many it has."""
    o = history.index[w, FIRST]
    return o, history.index[w + 1, FIRST] - o


@kernel
def _follows_any(model, history, w, member_state):
    """Whether a member is to be followed through a step."""
    _, stages = _stages_of(history, w)
    if stages < FEWEST_STAGES:
        return False
    for k in range(model.block.shape[0]):
        if not _has_knots(model, k, history.index[w, SEGMENT]):
            continue
        for i in range(model.block[k, START], model.block[k, START] + model.block[k, COUNT]):
            if _is_followed(member_state, i):
                return True
    return False


@part
def _has_knots(model, k, segment):
    """Whether the members of block k are design variables whose law has knots and acts in a segment."""
    code = model.block[k, CODE]
    return code != INERTER and law_has_pieces(code) and model.block[k, DESIGN] >= 0 and model.active[segment, k] != 0


@part
def _is_followed(member_state, i):
    """Whether steps pass over the knots of member i, which carries no load."""
    return member_state[MODE, i] == 0.0 and member_state[SCALE, i] == 0.0


@kernel
def _add_followed(model, history, w, member_state, rel, u, weights, out):
    """Replace sums over the stages of a step by integrals over pieces, of all members that pass knots within it.

    model, history, w, member_state, out: as of `add_across_knots`. rel, u: as of `add_changes_across_knots`.
    weights (S,): of the stored energy at each stage; no length: none.
    """
    n_pair = model.pair.shape[0]
    o, stages = _stages_of(history, w)
    segment = history.index[w, SEGMENT]
    time = np.empty(2)
    time[0] = history.when[o]
    time[1] = history.t[w + 1] - time[0]
    poses = np.empty((NODES, n_pair, pose_size(model)))
    acc = np.empty((n_pair, freedoms(model)))
    if not _fill_nodes(model, history, w, member_state, time, poses, acc):
        return
    share = np.empty((NODES, stages))
    _fill_shares(history.when[o : o + stages], time, share)
    weight = np.zeros(NODES)
    if weights.shape[0] > 0:
        fill_power(_densities(share, weights), weight)
    changes = np.empty((u.shape[0], NODES, n_pair, freedoms(model)))
    _fill_changes(share, u, changes)
    node = np.zeros((NODE_ROWS, NODES))
    power = np.empty((NODE_ROWS, NODES))
    pieces = np.zeros((CHANGES + 1, PIECE))
    no_level = np.zeros(NODES)
    works = np.empty((NODES, WORKS, model.member.shape[1]))
    still = np.zeros(freedoms(model))
    for k in range(model.block.shape[0]):
        if not _has_knots(model, k, segment):
            continue
        p = model.block[k, PAIR]
        code = model.block[k, CODE]
        lo = model.block[k, START]
        for c in range(NODES):
            member_works(model, lo, model.block[k, COUNT], poses[c, p], still, works[c])
        for i in range(lo, lo + model.block[k, COUNT]):
            if not _is_followed(member_state, i):
                continue
            last = _follow(model, k, i, time, poses[0, p], acc[p], works[:, :, i - lo], node, power, pieces)
            if last == 0:
                continue
            _subtract_stages(model, k, i, history.when[o : o + stages], rel[:, p], u[:, :, p], weights, out)
            rest = model.member[MEMBER_FREE_LENGTH, i]
            for m in range(out.shape[0]):
                for c in range(NODES):
                    _, _, node[ALONG, c] = member_work(model, i, poses[c, p], changes[m, c, p])
                out[m, i] += over_pieces(
                    code, model.law[k], model.curves, rest, time, no_level, weight, last, node, power, pieces
                )


@kernel
def _fill_nodes(model, history, w, member_state, time, poses, acc):
    """Relative poses at the nodes of a step, on the quintic through both its ends.

    model, history, w, member_state: as of `add_across_knots`.
    time (2,): start and length of the step (s).
    poses (NODES, n_pair, POSE): out. acc (n_pair, D): out, second derivatives of these at the first node.

    The balance at its end is not counted as work.

    Returns whether there are accelerations at its end.
    """
    n = model.mass.shape[0]
    o = history.index[w, FIRST]
    segment = history.index[w, SEGMENT]
    workspace = make_workspace(model)
    q = history.q[w + 1].copy()
    v = history.v[w + 1].copy()
    a = np.empty(n)
    lam = np.empty(model.size[0])
    end = time[0] + time[1]
    if solve_accelerations(model, member_state, segment, end, q, v, np.bool_(False), workspace, a, lam) >= 0:
        return False
    relative_pose(model, q, v, poses[NODES - 1])
    relative_pose(model, history.stage_q[o], history.stage_v[o], poses[0])
    for p in range(acc.shape[0]):
        pose_acceleration(model, poses[0], p, history.stage_a[o], acc[p])
    inner_q = np.empty(q.shape[0])
    inner_v = np.empty(n)
    for c in range(1, NODES - 1):
        quintic(
            model, NODE[c], time[1], history.stage_q[o], history.stage_v[o], history.stage_a[o], q, v, a, inner_q,
            inner_v,
        )  # fmt: skip
        drive_state(model, segment, time[0] + NODE[c] * time[1], inner_q, inner_v)
        relative_pose(model, inner_q, inner_v, poses[c])
    return True


@kernel
def _fill_shares(when, time, share):
    """What makes, of numbers at the stages of a step whose sums are wanted, their density by the fraction of the step.

    It is the polynomial with the same moments: sums over stages of what is smooth in time are exact to a high order.

    when (S,): times of the stages (s). time (2,): start and length of the step (s).
    share (NODES, S): out.
    """
    legendre = np.empty(HIGHEST_POWER + 1)
    degree = degree_of(when.shape[0], time[1], np.max(when) - time[0])
    for j in range(when.shape[0]):
        x = 2.0 * (when[j] - time[0]) / time[1] - 1.0
        legendre[0] = 1.0
        legendre[1] = x
        for d in range(2, degree + 1):
            legendre[d] = ((2.0 * d - 1.0) * x * legendre[d - 1] - (d - 1.0) * legendre[d - 2]) / d
        for c in range(NODES):
            share[c, j] = 0.0
            for d in range(degree + 1):
                share[c, j] += AT_NODES[c, d] * legendre[d]


@kernel
def _densities(share, x):
    """Densities at the nodes (NODES,) of numbers x (S,) at the stages; share (NODES, S): of `_fill_shares`."""
    found = np.zeros(NODES)
    for c in range(NODES):
        for j in range(x.shape[0]):
            found[c] += share[c, j] * x[j]
    return found


@kernel
def _fill_changes(share, u, out):
    """Densities of the virtual changes of poses at the nodes of a step.

    share (NODES, S): of `_fill_shares`. u (R, S or more, n_pair, D): at the stages. out (R, NODES, n_pair, D).
    """
    out[:] = 0.0
    for m in range(u.shape[0]):
        for c in range(NODES):
            for j in range(share.shape[1]):
                for p in range(u.shape[2]):
                    for d in range(u.shape[3]):
                        out[m, c, p, d] += share[c, j] * u[m, j, p, d]


@part
def _follow(model, k, i, time, pose, acc, works, node, power, pieces):
    """The pieces of its law that member i of block k goes through in a step.

    model: the compiled scene.
    time (2,): start and length of the step (s).
    pose (POSE,), acc (D,): of its pair at the first node, with the second derivative.
    works (NODES, WORKS): of `member_works` at the nodes.
    node (NODE_ROWS, NODES): out, ELONGATION and RATE.
    power, pieces: of `followed_member.follow`, out.

    Returns the number of the last piece; 0 where it stays in one, or has no length at a node.
    """
    code = model.block[k, CODE]
    p = model.law[k]
    curves = model.curves
    rest = model.member[MEMBER_FREE_LENGTH, i]
    low = np.inf
    high = -np.inf
    for c in range(NODES):
        if works[c, INVERSE] == 0.0:
            return 0
        low = min(low, works[c, ELONGATION])
        high = max(high, works[c, ELONGATION])
    x = works[0, ELONGATION]
    rate = works[0, RATE]
    start = time[0]
    mode = np.int64(law_start(code, p, x, rate, 0.0, start, curves, rest))
    # a piece is a range of elongations
    if (
        law_margin(code, p, low, rate, mode, start, curves, rest) >= 0.0
        and law_margin(code, p, high, rate, mode, start, curves, rest) >= 0.0
    ):
        return 0
    if not law_margin(code, p, x, rate, mode, start, curves, rest) > CLOSE_MARGIN:
        second = second_rate(model, i, pose, acc)
        mode = np.int64(law_start(code, p, x, rate, second, start, curves, rest))
    for c in range(NODES):
        node[ELONGATION, c] = works[c, ELONGATION]
        node[RATE, c] = works[c, RATE]
    return follow(code, p, curves, rest, time, mode, 0.0, node, power, pieces)


@kernel
def _subtract_stages(model, k, i, when, rel, u, weights, out):
    """Take back what member i of block k has added to the derivatives at the stages of a step.

    model: the compiled scene.
    when (S,): times of the stages (s).
    rel (S, POSE), u (R, S or more, D): of its pair, as of `add_changes_across_knots`.
    weights (S,): of the stored energy at each stage; no length: none.
    out (R, M_padded or more): subtracted from.
    """
    for j in range(when.shape[0]):
        length, x, rate = member_motion(model, i, rel[j])
        if not length > 0.0:
            continue
        f, _, _, energy, _ = law(
            model.block[k, CODE], model.law[k], x, rate, np.int64(0), when[j], 0.0, model.curves,
            model.member[MEMBER_FREE_LENGTH, i],
        )  # fmt: skip
        for m in range(out.shape[0]):
            _, _, along = member_work(model, i, rel[j], u[m, j])
            out[m, i] -= f * along
            if weights.shape[0] > 0:
                out[m, i] -= weights[j] * energy
