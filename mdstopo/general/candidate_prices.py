"""The prices of members that are not built, by any laws, in a plane or in space: the derivative each would have.

What prices follow from is found first (`pricing_states`). The members of a group lie between the points of two grids;
here all of them are gone through, tile by tile, of which a few numbers are kept (as in
`sensitivity.springs_candidate_prices`), or single ones.

No step ends at a switch of a member of alpha = 0. So one whose law switches is followed through the steps by its
elongation at some nodes of each. Where it leaves its mode within a step, the sum over stages, which is for smooth
forces and energies, gives way to an integral over the pieces: there the virtual change, and the weight of the energy,
are the polynomials with the moments that the stages give.
"""

import math
from typing import Annotated, Any, NamedTuple

import numpy as np

from mdstopo.compiler.fields import Field, Fields, views_of
from mdstopo.compiler.jit import entry, kernel
from mdstopo.compiler.threads import shared, taken
from mdstopo.general.general_model import INERTER, MEMBER_EXCESS, MEMBER_FREE_LENGTH, unpack_general
from mdstopo.general.members import MODE
from mdstopo.general.structures import bundle
from mdstopo.mechanics.kinematics.kinematics_interface import (
    has_spring_energies,
    member_designs,
    member_motion,
    member_work,
    second_rate,
    spring_designs,
    spring_energies,
)
from mdstopo.mechanics.laws.law_table import (
    SPRING,
    law,
    law_first_set,
    law_is_idle,
    law_margin,
    law_next,
    law_remembers,
    law_set,
    law_start,
)
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.sensitivity.springs_candidate_prices import COMPUTED, ERROR, keep_tile
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    COLUMNS,
    PLACES,
    PRICED,
    ROWS,
    TALL,
    begin_tile,
    fill_lengths,
    make_scratch,
    next_candidates,
    take_prices,
)

#: columns of `PricedCandidates.run`
SCENE, CODE, FIRST_STATE, FIRST_ENERGY, LAST_STATE, FIRST_STEP, LAST_STEP, FROM_START = range(8)
#: columns of `PricedCandidates.step`, and what a step may be
FIRST_STAGE, LAST_STAGE, FIRST_NODE, KIND, MOVES = range(5)
WHOLE, PART, POINT = range(3)
#: fractions of a step at which a member that switches is sampled (Gauss and Lobatto), and the weights of these in the
#: polynomial through all
NODES = 6
_ROOTS = np.sort(np.polynomial.legendre.Legendre.basis(NODES - 1).deriv().roots())
NODE = 0.5 + 0.5 * np.concatenate([[-1.0], _ROOTS, [1.0]])
BARYCENTRIC = np.array([1.0 / np.prod(c - np.delete(NODE, m)) for m, c in enumerate(NODE)])
#: points and weights of an integral over a piece of a step, as fractions of it (Gauss)
GAUSS = 0.5 * np.array(np.polynomial.legendre.leggauss(5)) + np.array([[0.5], [0.0]])
#: what is known of a member at the nodes: elongation, its rate, its second derivative; its part of the virtual change;
#: the law's tabulated force; the weight of its energy
X, RATE, SECOND, ALONG, LEVEL, WEIGHT = range(6)
NODE_ROWS = 6
#: pieces of a step in which a member stays in a mode: the fraction at which one begins, the mode, the permanent set;
#: how many changes are followed, and how often an interval with one in it is halved
BEGIN, PIECE_MODE, PIECE_SET = range(3)
PIECE = 3
CHANGES = 4
HALVINGS = 40
#: arrays of states in `PricedCandidates`, and of steps and nodes
ARRAYS = (
    "pose", "change", "pose_a", "energy", "when", "level", "step", "step_time", "node_pose", "node_a", "node_change",
    "node_level", "node_energy",
)  # fmt: skip
#: states of one pass over a tile, whose poses stay in the nearest cache
AT_ONCE = 32


class PricedCandidates(NamedTuple):
    """The candidates of a group, and the states from which their prices follow: by scenes, and by runs of states.

    Where a candidate has mirror images, a scene has one entry for each of them, with points of its own.
    """

    run: Annotated[
        IndexArray,
        Field(
            "n_run, 8",
            "of the states in which one law of one scene is evaluated: the scene; the law's code; the first state, the "
            "first one whose energy counts, and the one behind all; of a law that switches the first step, and the one "
            "behind all; whether it acts from the start",
        ),
    ]
    rest: Annotated[FloatArray, Field("n_run", "the law's free length (m); negative: the length as stated")]
    law: Annotated[FloatArray, Field("n_run, 8", "its parameters (`mechanics.laws.law_table`)")]
    curves: Annotated[FloatArray, Field("n_scene, n_curve", "numbers of the scene's laws")]
    pose: Annotated[FloatArray, Field("n_state, 1, n_pose", "relative pose of the group's bodies, and its rates")]
    change: Annotated[FloatArray, Field("n_state, 1, n_free", "minus the virtual change of the pose")]
    pose_a: Annotated[FloatArray, Field("n_state, n_free", "second derivative of the pose in time")]
    energy: Annotated[FloatArray, Field("n_state", "weight of the stored energy")]
    when: Annotated[FloatArray, Field("n_state", "time (s)")]
    level: Annotated[FloatArray, Field("n_state", "the law's tabulated force (N)")]
    step: Annotated[
        IndexArray,
        Field(
            "n_step, 5",
            "of laws that switch, in the order of time: the first stage among the states, and the one behind the last; "
            "the first node; whether it is a whole step, a part of one, or a state alone; whether anything is virtual",
        ),
    ]
    step_time: Annotated[FloatArray, Field("n_step, 2", "when it begins, and how long it is (s)")]
    node_pose: Annotated[FloatArray, Field("n_node, n_pose", "relative poses at NODE of each step, and their rates")]
    node_a: Annotated[FloatArray, Field("n_node, n_free", "their second derivatives")]
    node_change: Annotated[
        FloatArray, Field("n_node, n_free", "minus their virtual changes, by the fraction of the step")
    ]
    node_level: Annotated[FloatArray, Field("n_node", "the law's tabulated force (N)")]
    node_energy: Annotated[FloatArray, Field("n_node", "the weight of the stored energy, by the fraction of the step")]
    first: Annotated[FloatArray, Field("n_scene, n_axis, n_first", "points of the one grid in their body's frame (m)")]
    second: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "points of the other grid, likewise")]
    first_home: Annotated[FloatArray, Field("n_scene, n_axis, n_first", "the points of the one grid at the start (m)")]
    second_home: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "those of the other grid")]
    first_stated: Annotated[
        FloatArray, Field("n_scene, n_axis, n_first", "where the scene's case has the points of the one grid (m)")
    ]
    second_stated: Annotated[FloatArray, Field("n_scene, n_axis, n_second", "where it has those of the other grid")]
    first_place: Annotated[
        FloatArray, Field("n_axis, n_first", "where they are for what members cost, and which there are (m)")
    ]
    second_place: Annotated[FloatArray, Field("n_axis, n_second", "likewise of the other grid")]


class PricedCandidatesView:
    """A `PricedCandidates` inside kernels, made by `unpack_candidates`."""

    def __init__(self, *_arrays: Any) -> None: ...


FIELDS = Fields(PricedCandidates)
bundle(PricedCandidatesView, FIELDS.names)


@views_of(FIELDS, PricedCandidatesView, kernel)
def unpack_candidates(ints, floats):
    """The `PricedCandidates` whose arrays are views of the packed ones."""


@entry
def price_places(ints, floats, candidate_ints, candidate_floats, places, out):
    """The prices of single members.

    In:
      ints, floats: a packed scene (`pack_general`) with room for PLACES members and for the longest `curves`.
      candidate_ints, candidate_floats: a packed `PricedCandidates`.
      places (2, M): numbers of the points of each member; M at most PLACES.
    Out:
      out (M,): derivatives by alpha.
    """
    model = unpack_general(ints, floats.copy())
    price = np.empty(PLACES)
    candidates = unpack_candidates(candidate_ints, candidate_floats)
    _price(model, candidates, places, np.int64(places.shape[1]), np.int64(0), price)
    out[:] = price[: out.shape[0]]


@entry
def price_tiles(
    ints,
    floats,
    candidate_ints,
    candidate_floats,
    first_numbers,
    second_numbers,
    smooth_rows,
    smooth_columns,
    common,
    built,
    places,
    which,
    threads,
    out,
    prices,
):
    """Price tiles of the members from every point of one grid to every point of another.

    In:
      ints, floats, candidate_ints, candidate_floats: as of `price_places`.
      first_numbers, second_numbers, smooth_rows, smooth_columns: of `tile_interpolation.smoothness`.
      common (COMMON,): what candidates have in common, as of `sensitivity.springs_candidate_prices`.
      built (T + 1,), places (any,): by tile, where in it candidates are that do not count.
      which (K,): the tiles.
      threads: that share the work.
    Out:
      out (K, TILE_NUMBERS): of each tile what is kept of it.
      prices (K, PLACES) or (0, PLACES): of each tile's candidates, infinite where one does not count.
    """
    counter = np.zeros(1, np.int64)
    grids = (first_numbers, second_numbers, smooth_rows, smooth_columns)
    job = (counter, ints, floats, candidate_ints, candidate_floats, grids, common, built, places, which, out, prices)
    shared(_price_each, threads, job)


@kernel
def _price_each(
    counter, ints, floats, candidate_ints, candidate_floats, grids, common, built, places, which, out, prices
):
    """Price tile after tile, until none is left: what each thread does.

    In:
      counter (1,): tiles that some thread has taken so far; counted on.
      ints, floats, candidate_ints, candidate_floats, common, built, places, which: as of `price_tiles`.
      grids: of `tile_interpolation.smoothness`.
    Out:
      out (K, TILE_NUMBERS), prices: as of `price_tiles`.
    """
    model = unpack_general(ints, floats.copy())
    candidates = unpack_candidates(candidate_ints, candidate_floats)
    scratch = make_scratch()
    price = np.empty(PLACES)
    length = np.zeros(PLACES)
    across = (candidates.second.shape[2] + BROAD - 1) // BROAD
    k = taken(counter)
    while k < which.shape[0]:
        tile = which[k]
        i = tile // across
        j = tile % across
        price[:] = np.inf
        computed = _price_tile(model, candidates, grids, i, j, common[ERROR], scratch, price)
        fill_lengths(candidates.first_place, candidates.second_place, i, j, length)
        out[k, COMPUTED] = computed
        keep_tile(k, tile, price, length, common, built, places, out, prices)
        k = taken(counter)


@kernel
def _price_tile(model, candidates, grids, i, j, error, scratch, price):
    """The prices of a tile.

    In:
      model: with room for its members, which are overwritten.
      candidates: a `PricedCandidates`.
      grids, error: as of `tile_interpolation.take_prices`. i, j: the tile.
    Out:
      price (PLACES,): of its candidates.
    Scratch:
      scratch: of `tile_interpolation.make_scratch`.

    Returns how many prices were computed.
    """
    plan, _, rows, columns, index, found, _ = scratch
    begin_tile(error, scratch)
    while next_candidates(grids, i, j, scratch):
        wide = plan[COLUMNS]
        count = plan[ROWS] * wide
        for a in range(plan[ROWS]):
            for b in range(wide):
                index[0, a * wide + b] = i * TALL + rows[a]
                index[1, a * wide + b] = j * BROAD + columns[b]
        _price(model, candidates, index, count, wide, found)
        take_prices(grids, i, j, error, scratch, price)
    return plan[PRICED]


@kernel
def _price(model, candidates, index, count, row, price):
    """The prices of some members, PLACES at most.

    In:
      model: with room for them.
      candidates: a `PricedCandidates`.
      index (2, count or more): numbers of their points.
      count: how many there are.
      row: how many behind each other begin at one point; 0: they do not.
    Out:
      model: its members are overwritten.
      price (PLACES,): derivatives by alpha.
    """
    axes = candidates.first.shape[1]
    member_state = np.zeros((3, PLACES))
    start = np.empty(count)
    stated = np.empty(count)
    price[:] = 0.0
    before = np.int64(-1)
    for k in range(candidates.run.shape[0]):
        scene = candidates.run[k, SCENE]
        if scene != before:
            for d in range(axes):
                for i in range(count):
                    model.member[d, i] = candidates.first[scene, d, index[0, i]]
                    model.member[axes + d, i] = candidates.second[scene, d, index[1, i]]
            for i in range(candidates.curves.shape[1]):
                model.curves[i] = candidates.curves[scene, i]
            _lengths(candidates.first_home[scene], candidates.second_home[scene], index, start)
            _lengths(candidates.first_stated[scene], candidates.second_stated[scene], index, stated)
            before = scene
        for i in range(count):
            free = stated[i] if candidates.rest[k] < 0.0 else candidates.rest[k]
            model.member[MEMBER_FREE_LENGTH, i] = free
            model.member[MEMBER_EXCESS, i] = (start[i] - free) * (start[i] + free)
        _price_run(model, candidates, k, count, row, member_state, price)


@kernel
def _lengths(first, second, index, out):
    """out (M,): distances of points first (d, n_A) from second (d, n_B), by their numbers in index (2, M or more)."""
    for i in range(out.shape[0]):
        square = 0.0
        for d in range(first.shape[0]):
            apart = second[d, index[1, i]] - first[d, index[0, i]]
            square += apart * apart
        out[i] = math.sqrt(square)


@kernel
def _price_run(model, candidates, k, count, row, member_state, price):
    """Add what members do by one law in the states of a run.

    In:
      model: with the members.
      candidates, k: a `PricedCandidates`, and the number of the run.
      count: how many members there are.
      row: members behind each other that begin at one point, or 0.
      member_state (3, PLACES): zeros; no member of a law that does not switch has a mode.
    Out:
      price (PLACES,): added to.
    """
    pose = candidates.pose
    change = candidates.change
    run = candidates.run[k]
    p = candidates.law[k]
    code = run[CODE]
    if run[LAST_STEP] > run[FIRST_STEP]:
        _price_switching(model, candidates, k, count, price)
        return
    elastic = code == SPRING and p[1] == 0.0 and p[2] == 0.0
    begin = run[FIRST_STATE]
    if elastic:
        while begin < run[FIRST_ENERGY]:
            end = min(begin + AT_ONCE, run[FIRST_ENERGY])
            spring_designs(model, p, np.int64(0), count, row, pose[begin:end], change[begin:end], np.int64(0), price)
            begin = end
    for s in range(begin, run[LAST_STATE]):
        weight = candidates.energy[s] if s >= run[FIRST_ENERGY] else 0.0
        if elastic and has_spring_energies(model):
            spring_energies(model, p, np.int64(0), count, pose[s : s + 1], np.int64(0), weight, price)
        elif code == INERTER:
            _add_inertial(model, count, p[0], pose[s, 0], change[s, 0], candidates.pose_a[s], price)
        else:
            member_designs(
                model, code, p, np.int64(0), count, candidates.when[s], candidates.level[s], member_state,
                member_state[MODE], pose[s, 0], change[s, 0], weight, price,
            )  # fmt: skip


@kernel
def _price_switching(model, candidates, k, count, price):
    """Add what members of a law that switches do in the steps of a run.

    In:
      model: with the members.
      candidates, k: a `PricedCandidates`, and the number of the run.
      count: how many members there are.
    Out:
      price (PLACES,): added to.
    """
    node = np.empty((NODE_ROWS, NODES))
    pieces = np.empty((CHANGES + 1, PIECE))
    for i in range(count):
        price[i] += _price_followed(model, candidates, k, i, node, pieces)


@kernel
def _price_followed(model, candidates, k, i, node, pieces):
    """What member i of a law that switches does in the steps of a run.

    A step in which it stays in its mode is summed over its stages, as for a member that is built. In a step in which
    its mode changes, the force of each mode times the member's part of the virtual change, and the energy times its
    weight, are integrated over the mode's piece, all from their values at the nodes.

    In:
      model: with the members.
      candidates, k, i: a `PricedCandidates`, the number of the run, and the member.
    Scratch:
      node (NODE_ROWS, NODES): the member at the nodes of a step.
      pieces (CHANGES + 1, PIECE): pieces of a step in which it stays in a mode.

    Returns its part of the derivative by alpha.
    """
    run = candidates.run[k]
    p = candidates.law[k]
    code = run[CODE]
    rest = model.member[MEMBER_FREE_LENGTH, i]
    remembers = law_remembers(code)
    mode = np.int64(0)
    kept = 0.0
    begun = run[FROM_START] == 0  # a law that acts later begins in mode 0, unset
    total = 0.0
    pieces[0, PIECE_MODE] = 0.0
    pieces[0, PIECE_SET] = 0.0
    last = 0
    for s in range(run[FIRST_STEP], run[LAST_STEP]):
        step = candidates.step[s]
        if step[KIND] == POINT:
            o = step[FIRST_STAGE]
            length, x, rate = member_motion(model, i, candidates.pose[o, 0])
            if not length > 0.0:
                continue
            now = int(pieces[last, PIECE_MODE])
            own = pieces[last, PIECE_SET]
            if not begun or not remembers:
                second = second_rate(model, i, candidates.pose[o, 0], candidates.pose_a[o])
                now = law_start(code, p, x, rate, second, candidates.when[o], model.curves, rest)
                own = law_first_set(code, p, x, now)
            worked, stored = _at_state(model, candidates, code, p, i, o, now, own)
            total += worked + stored
            continue
        if step[MOVES] == 0 and not remembers:
            continue
        _fill_motion(model, candidates, i, step[FIRST_NODE], node)
        if not begun or not remembers:
            t = candidates.step_time[s, 0]
            second = _second_at_node(model, candidates, i, step[FIRST_NODE])
            mode = law_start(code, p, node[X, 0], node[RATE, 0], second, t, model.curves, rest)
            kept = law_first_set(code, p, node[X, 0], mode)
            begun = np.bool_(True)
        pieces[0, BEGIN] = 0.0
        pieces[0, PIECE_MODE] = mode
        pieces[0, PIECE_SET] = kept
        last = 0
        if not _stays(code, p, model.curves, rest, candidates.step_time[s], node, mode, kept):
            _fill_nodes(model, candidates, i, step[FIRST_NODE], node)
            last = _follow(code, p, model.curves, rest, candidates.step_time[s], node, pieces)
        if last == 0:
            if law_is_idle(code, mode):
                continue
            for o in range(step[FIRST_STAGE], step[LAST_STAGE]):
                worked, stored = _at_state(model, candidates, code, p, i, o, mode, kept)
                total += worked + stored
        else:
            for at in range(last + 1):
                end = pieces[at + 1, BEGIN] if at < last else 1.0
                total += _over_piece(model, candidates, code, p, rest, s, node, pieces[at], end)
        if step[KIND] == WHOLE:
            mode = int(pieces[last, PIECE_MODE])
            kept = pieces[last, PIECE_SET]
    return total


@kernel
def _at_state(model, candidates, code, p, i, o, mode, kept):
    """What member i does at a state: its force times the virtual change, and its energy times the weight there.

    model: with the members.
    candidates: a `PricedCandidates`.
    code, p (8,): of the law.
    i, o: numbers of the member and of the state.
    mode, kept: the mode that the member is in, and its permanent set (m).
    """
    length, x, along = member_work(model, i, candidates.pose[o, 0], candidates.change[o, 0])
    if not length > 0.0:
        return 0.0, 0.0
    _, _, rate = member_motion(model, i, candidates.pose[o, 0])
    f, _, _, energy, _ = law(
        code, p, x - kept, rate, mode, candidates.when[o], candidates.level[o], model.curves,
        model.member[MEMBER_FREE_LENGTH, i],
    )  # fmt: skip
    return f * along, candidates.energy[o] * energy


@kernel
def _fill_motion(model, candidates, i, first, node):
    """Elongation of member i and its rate at the nodes of a step.

    model: with the members.
    candidates, first: a `PricedCandidates`, and the number of the first node.
    node (NODE_ROWS, NODES): X and RATE are set.
    """
    for m in range(NODES):
        _, x, rate = member_motion(model, i, candidates.node_pose[first + m])
        node[X, m] = x
        node[RATE, m] = rate


@kernel
def _second_at_node(model, candidates, i, at):
    """The second derivative of the elongation of member i at the node `at`; 0 where it has no length."""
    r = candidates.node_pose[at]
    length, _, _ = member_motion(model, i, r)
    return second_rate(model, i, r, candidates.node_a[at]) if length > 0.0 else 0.0


@kernel
def _fill_nodes(model, candidates, i, first, node):
    """What else `node` has of member i at the nodes of a step, whose X and RATE are known.

    model: with the members.
    candidates, first: a `PricedCandidates`, and the number of the first node.
    node (NODE_ROWS, NODES): SECOND, ALONG, LEVEL and WEIGHT are set.
    """
    for m in range(NODES):
        _, _, along = member_work(model, i, candidates.node_pose[first + m], candidates.node_change[first + m])
        node[SECOND, m] = _second_at_node(model, candidates, i, first + m)
        node[ALONG, m] = along
        node[LEVEL, m] = candidates.node_level[first + m]
        node[WEIGHT, m] = candidates.node_energy[first + m]


@kernel
def _stays(code, p, curves, rest, time, node, mode, kept):
    """Whether a mode has not ended at any node of a step.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s). node (NODE_ROWS, NODES): the member there, of which X and RATE count.
    mode, kept: the mode, and the permanent set (m).
    """
    for m in range(1, NODES):
        if law_margin(code, p, node[X, m] - kept, node[RATE, m], mode, time[0] + NODE[m] * time[1], curves, rest) < 0.0:
            return False
    return True


@kernel
def between_nodes(values, c):
    """The polynomial through values (NODES,) at the nodes, at a fraction c of a step."""
    above = 0.0
    below = 0.0
    for m in range(NODES):
        apart = c - NODE[m]
        if apart == 0.0:
            return values[m]
        w = BARYCENTRIC[m] / apart
        above += w * values[m]
        below += w
    return above / below


@kernel
def _margin(code, p, curves, rest, time, node, c, mode, kept):
    """How far a mode is from its end at a fraction c of a step.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s). node (NODE_ROWS, NODES): the member there.
    mode, kept: the mode, and the permanent set (m).
    """
    x = between_nodes(node[X], c) - kept
    return law_margin(code, p, x, between_nodes(node[RATE], c), mode, time[0] + c * time[1], curves, rest)


@kernel
def _follow(code, p, curves, rest, time, node, pieces):
    """The modes that a member goes through in a step.

    In:
      code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
      time (2,): start and length of the step (s).
      node (NODE_ROWS, NODES): the member at its nodes.
    In place:
      pieces (CHANGES + 1, PIECE): of which the first one is known, but for its end; then all.

    Returns the number of the last one.
    """
    last = 0
    while last < CHANGES:
        begin = pieces[last, BEGIN]
        mode = int(pieces[last, PIECE_MODE])
        kept = pieces[last, PIECE_SET]
        lower = begin
        upper = -1.0
        for m in range(1, NODES):
            if NODE[m] <= begin:
                continue
            if _margin(code, p, curves, rest, time, node, NODE[m], mode, kept) < 0.0:
                upper = NODE[m]
                break
            lower = NODE[m]
        if upper < 0.0:
            return last
        if _margin(code, p, curves, rest, time, node, lower, mode, kept) >= 0.0:
            for _ in range(HALVINGS):
                middle = 0.5 * (lower + upper)
                if _margin(code, p, curves, rest, time, node, middle, mode, kept) < 0.0:
                    upper = middle
                else:
                    lower = middle
        else:
            upper = lower
        x = between_nodes(node[X], upper) - kept
        rate = between_nodes(node[RATE], upper)
        t = time[0] + upper * time[1]
        new = law_next(code, p, x, rate, between_nodes(node[SECOND], upper), mode, t, curves, rest)
        if new == mode:
            return last
        last += 1
        pieces[last, BEGIN] = upper
        pieces[last, PIECE_MODE] = new
        pieces[last, PIECE_SET] = kept + law_set(code, p, x, mode, new)
    return last


@kernel
def _over_piece(model, candidates, code, p, rest, s, node, piece, end):
    """The integral over a mode's piece of its force times the member's part of the virtual change, and of its energy
    times the weight of that.

    model: with the members.
    candidates, s: a `PricedCandidates`, and the number of the step.
    code, p (8,), rest: the law, and the member's free length (m).
    node (NODE_ROWS, NODES): the member at the nodes.
    piece (PIECE,), end: the mode's piece, and the fraction of the step at which it ends.
    """
    total = 0.0
    begin = piece[BEGIN]
    for g in range(GAUSS.shape[1]):
        c = begin + (end - begin) * GAUSS[0, g]
        f, _, _, energy, _ = law(
            code, p, between_nodes(node[X], c) - piece[PIECE_SET], between_nodes(node[RATE], c),
            int(piece[PIECE_MODE]), candidates.step_time[s, 0] + c * candidates.step_time[s, 1],
            between_nodes(node[LEVEL], c), model.curves, rest,
        )  # fmt: skip
        total += GAUSS[1, g] * (f * between_nodes(node[ALONG], c) + energy * between_nodes(node[WEIGHT], c))
    return (end - begin) * total


@kernel
def _add_inertial(model, count, inertance, r, u, acc, price):
    """Add what inerters do at one state.

    In:
      model: with the members.
      count: how many there are.
      inertance: at alpha = 1 (kg).
      r (POSE,), u (D,), acc (D,): the relative pose, minus its virtual change, and its second derivative.
    Out:
      price (PLACES,): added to.
    """
    for i in range(count):
        length, _, along = member_work(model, i, r, u)
        if length > 0.0:
            price[i] += inertance * second_rate(model, i, r, acc) * along
