"""The prices of members that are not built: what the objective would change by with a little of each.

A member adds to the gradient a sum over stages and the states of rows that knows of the motion only the relative poses
of its two bodies and their virtual changes (`passes.design_gradient`). These are few numbers: `row_poses` finds them
for a weighted sum of rows. Then `price_candidates` goes through all candidates of two grids of points, tile by tile,
and keeps a few numbers a tile; `price_members` gives the prices of single ones. Nothing is kept a candidate.
"""

import math

import numpy as np

from mdstopo.compiler.jit import entry, kernel, part
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.vector import inverse_root, lanes, larger, largest, load, store, total, where_larger, zero
from mdstopo.integrators.steps import FIRST, carve, solved_to
from mdstopo.integrators.steps_interface import stage_weights, steps_of
from mdstopo.mechanics.active_members import active_members
from mdstopo.mechanics.kinematics.planar_poses import POSE, copy_rows, pair_displacement, relative_pose
from mdstopo.mechanics.laws.spring import ZERO_LENGTH_SQUARED
from mdstopo.mechanics.passes import SUM_T, SUMS, design_of_members, springs_of
from mdstopo.responses.energy import energy_at, energy_slope
from mdstopo.scene.compile_scene import NEAR_HOME
from mdstopo.scene.packing import unpack
from mdstopo.scene.springs_model import (
    BLOCK,
    DAMPING,
    EXCESS,
    L0,
    MEMBER,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    STIFFNESS,
)
from mdstopo.sensitivity.reductions import INTEGRAL, MEAN
from mdstopo.sensitivity.springs_adjoint import reverse_sweep
from mdstopo.sensitivity.state_in_step import state_in_step
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

#: what is kept of a tile: how many candidates it has, the largest gain of one, below zero where none gains, the sum of
#: all that gain, and the largest gain for what it costs; how many prices were computed, of which the others followed
SEEN, BEST, TOGETHER, RATIO, COMPUTED = range(5)
TILE_NUMBERS = 5
#: what candidates have in common: stiffness, damping, preload; the free length, negative where it is the initial one;
#: the cost, negative where it is that length; which lengths are allowed, just below the shortest and just above the
#: longest; what a unit of cost is worth; the largest alpha; by how much a price may be off
(
    K,
    C,
    F0,
    FREE,
    COST,
    BELOW,
    ABOVE,
    WORTH,
    UPPER,
    ERROR,
) = range(10)
COMMON = 10
#: prices are below it
ABOVE_ALL_PRICES = 1e300
#: `row_poses` needs more room
NO_ROOM = -1


@entry
def row_poses(
    tag,
    ints,
    floats,
    tables,
    damped,
    settings,
    limits,
    count,
    reductions,
    rows,
    found,
    factor,
    room,
    room_ints,
    strength,
    stages,
    pose,
    change,
    point,
    weight,
    work,
):
    """What a weighted sum of rows asks of members: poses and their virtual changes, and poses whose energy counts.

    Constant:
      tag: of the integrator (`steps_interface.steps_of`).
      ints, floats: the packed model.
      tables: constant arrays of the integrator.
    In:
      damped: whether any force depends on velocity.
      settings (4,): of `evaluate_responses`, of which the tolerance and the fixed step are read.
      limits (3,): steps allowed, room for steps, room for stages.
      count: steps that were taken.
      reductions (n_obj,): codes of the objectives' reductions.
      rows (n_obj, R, 4), found (n_obj,): what `evaluate_responses` found: time, value, step, fraction; how many.
      factor (n_obj, R): of the rows.
      room, room_ints: the steps (`steps.carve`), with tangents.
      strength (3 or more, M_padded): as the run left them (N/m, N s/m, N).
      stages: of the steps that were taken.
    Out:
      pose (S, n_pair, POSE), change (S, n_pair, 3): relative poses and virtual changes of xi; first of the stages.
      point (E, n_pair, POSE), weight (E,): relative poses, and the weights of a member's energy in them.
      work (WORK,): counts of work, added to.

    Returns how many poses and how many points there are; NO_ROOM where S or E is too small.
    """
    model = unpack(ints, floats)
    motion, own, _ = active_members(model, strength, np.bool_(False))
    turning = model.load_body.shape[0] > 0
    n = model.q0.shape[0]
    n_pair = model.pair.shape[0]
    steps = steps_of(tag, carve(room, room_ints, n, n_pair, limits[1], limits[2], damped, turning))
    accuracy = solved_to(settings[0], settings[2])
    used_poses = stages
    used_points = 0
    for i in range(stages):
        relative_pose(model.pair, model.home, steps.stage[i, 0], steps.stage[i, 1], pose[i])
    change[:] = 0.0
    state = np.empty((2, n))
    rel = np.empty((1, n_pair, POSE))
    sums = np.empty((1, n_pair, SUMS))
    slope = np.empty((n_pair, 3))
    mu_q = np.empty(n)
    for j in range(reductions.shape[0]):
        integral = reductions[j] in (MEAN, INTEGRAL)
        for r in range(found[j]):
            if factor[j, r] == 0.0:
                continue
            w = count - 1
            c = -1.0
            mu_q[:] = 0.0
            bar = np.zeros((stages if integral else 0, n))
            if integral:
                own_weight = np.zeros(stages)
                scale = factor[j, r] / (steps.t[count] - steps.t[0]) if reductions[j] == MEAN else factor[j, r]
                for k in range(count):
                    stage_weights(tables, steps, k, own_weight[steps.index[k, FIRST] : steps.index[k + 1, FIRST]])
                if used_points + stages > point.shape[0]:
                    return NO_ROOM, NO_ROOM
                for i in range(stages):
                    energy_slope(model.pair, pose[i], steps.pull[i], scale * own_weight[i], bar[i])
                    copy_rows(pose[i], point[used_points + i])
                    weight[used_points + i] = scale * own_weight[i]
                used_points += stages
            else:
                k = int(rows[j, r, 2])
                w, c = state_in_step(
                    motion, tables, own, steps, count, k, rows[j, r, 3], damped, state[0], state[1], work
                )
                energy_at(model.pair, model.home, springs_of(motion), own, state[0], state[1], rel, sums)
                for p in range(n_pair):
                    for axis in range(3):
                        slope[p, axis] = sums[0, p, ENERGY_SLOPE + axis]
                energy_slope(model.pair, rel[0], slope, factor[j, r], mu_q)
                if used_points + 1 > point.shape[0]:
                    return NO_ROOM, NO_ROOM
                copy_rows(rel[0], point[used_points])
                weight[used_points] = factor[j, r]
                used_points += 1
                if k == 0 and rows[j, r, 3] == 0.0:
                    continue  # a peak at the start is not passed by the motion
            passed = max(stages, steps.index[w + 1, FIRST])
            if used_poses + passed - stages > pose.shape[0]:
                return NO_ROOM, NO_ROOM
            z = np.zeros((passed, n))
            used = np.zeros(passed, np.int64)
            reverse_sweep(
                model.pair, model.inv_mass, tables, steps, w, c, mu_q, bar, z, used, damped, turning, accuracy, work
            )
            for i in range(passed):
                at = i
                if i >= stages:  # a partial step, which the next row overwrites
                    at = used_poses
                    used_poses += 1
                    relative_pose(model.pair, model.home, steps.stage[i, 0], steps.stage[i, 1], pose[at])
                if used[i]:
                    for p in range(n_pair):
                        pair_displacement(model.pair, pose[at], p, z[i], slope[p])
                        for axis in range(3):
                            change[at, p, axis] -= slope[p, axis]
    return used_poses, used_points


#: the first of the energy's slopes in `passes.SUMS`
ENERGY_SLOPE = SUM_T + 2


@entry
def price_members(member, kind, near, pose, change, weight, out):
    """The prices of single members.

    In:
      member (MEMBER, M): as of `Model`, M a multiple of its padding.
      kind: of their law, as of `Model.block`.
      near (1, 2): as of `Model.near`.
      pose (S + E, 1, POSE): relative poses of their two bodies.
      change (S, 1, 3): virtual changes of the first ones.
      weight (E,): of the energies in the others.
    Out:
      out (M,): derivatives by alpha.
    """
    out[:] = 0.0
    design_of_members(
        np.int64(0), np.int64(0), member.shape[1], block_of(kind, member.shape[1], np.int64(0)), near[0], member, pose,
        change, weight, out,
    )  # fmt: skip


@part
def block_of(kind, places, width):
    """One block of design members (1, BLOCK); width: places in a row of a grid, or 0."""
    block = np.zeros((1, BLOCK), np.int64)
    block[0, 2] = places
    block[0, 3] = kind
    block[0, 5] = places
    block[0, 6] = width
    block[0, 7] = width
    return block


@entry
def price_candidates(
    first,
    second,
    first_home,
    second_home,
    first_numbers,
    second_numbers,
    smooth_rows,
    smooth_columns,
    common,
    kind,
    pose,
    change,
    weight,
    built,
    places,
    which,
    threads,
    out,
    prices,
):
    """Price tiles of the members from every point of one grid to every point of another.

    In:
      first (2, n_A), second (2, n_B): points in the frames of their bodies (m).
      first_home, second_home (2, n_A), (2, n_B): where they are at the start (m).
      first_numbers, second_numbers, smooth_rows, smooth_columns: of `tile_interpolation.smoothness`.
      common (COMMON,): what candidates have in common.
      kind: of their law, as of `Model.block`.
      pose, change, weight: as of `price_members`.
      built (T + 1,), places (any,): by tile, where in it candidates are that do not count.
      which (K,): the tiles.
      threads: that share the work.
    Out:
      out (K, TILE_NUMBERS): of each tile what is kept of it.
      prices (K, PLACES) or (0, PLACES): of each tile's candidates, infinite where one does not count.
    """
    counter = np.zeros(1, np.int64)
    points = (first, second, first_home, second_home)
    grids = (first_numbers, second_numbers, smooth_rows, smooth_columns)
    job = (counter, points, grids, common, kind, pose, change, weight, built, places, which, out, prices)
    shared(_price_each, threads, job)


@kernel
def _price_each(counter, points, grids, common, kind, pose, change, weight, built, places, which, out, prices):
    """Price tile after tile, until none is left: what each thread does.

    In:
      counter (1,): tiles that some thread has taken so far; counted on.
      points: both grids in the frames of their bodies, and at the start, as of `price_candidates`.
      grids: of `tile_interpolation.smoothness`.
      common, kind, pose, change, weight, built, places, which: as of `price_candidates`.
    Out:
      out (K, TILE_NUMBERS), prices: as of `price_candidates`.
    """
    member = np.empty((MEMBER, PLACES))
    member[STIFFNESS] = common[K]
    member[DAMPING] = common[C]
    member[PRELOAD] = common[F0]
    scratch = make_scratch()
    price = np.empty(PLACES)
    home = np.zeros(PLACES)
    states = (pose, change, weight)
    across = (points[1].shape[1] + BROAD - 1) // BROAD
    k = taken(counter)
    while k < which.shape[0]:
        tile = which[k]
        i = tile // across
        j = tile % across
        price[:] = np.inf
        computed = _price_tile(points, grids, i, j, common, kind, states, member, scratch, price)
        fill_lengths(points[2], points[3], i, j, home)
        out[k, COMPUTED] = computed
        keep_tile(k, tile, price, home, common, built, places, out, prices)
        k = taken(counter)


@kernel
def _price_tile(points, grids, i, j, common, kind, states, member, scratch, price):
    """The prices of a tile.

    In:
      points, grids, common, kind: as of `_price_each`.
      i, j: the tile.
      states: pose, change, weight, as of `price_members`.
    Out:
      price (PLACES,): of its candidates.
    Scratch:
      member (MEMBER, PLACES): whose stiffness, damping and preload are known.
      scratch: of `tile_interpolation.make_scratch`.

    Returns how many prices were computed.
    """
    plan, _, rows, columns, _, found, _ = scratch
    near = np.empty(2)
    begin_tile(common[ERROR], scratch)
    while next_candidates(grids, i, j, scratch):
        wide = plan[COLUMNS]
        count = plan[ROWS] * wide
        _fill_members(points, i * TALL, j * BROAD, rows[: plan[ROWS]], columns[:wide], common[FREE], member, near)
        found[:count] = 0.0
        design_of_members(
            np.int64(0), np.int64(0), count, block_of(kind, count, wide if kind == 0 else 0), near, member, states[0],
            states[1], states[2], found,
        )  # fmt: skip
        take_prices(grids, i, j, common[ERROR], scratch, price)
    return plan[PRICED]


@kernel
def _fill_members(points, row, column, rows, columns, free, member, near):
    """Write candidates of a tile as members, row by row.

    In:
      points: as of `_price_each`.
      row, column: where the tile begins.
      rows, columns: the candidates, by their places in the tile, whole vectors of columns.
      free: the free length (m); negative: the initial one.
    Out:
      member (MEMBER, PLACES): points, free length, excess; as of `Model.member`.
      near (2,): as a row of `Model.near`.
    """
    first, second, first_home, second_home = points
    wide = columns.shape[0]
    end = np.empty((4, BROAD))
    for b in range(wide):
        at = column + columns[b]
        for d in range(2):
            end[d, b] = second[d, at]
            end[2 + d, b] = second_home[d, at]
    shortest = zero() - np.inf
    longest = zero()
    far = zero()
    for i in range(0, wide, lanes()):
        x = load(end[0], i)
        y = load(end[1], i)
        hx = load(end[2], i)
        hy = load(end[3], i)
        far = larger(x * x + y * y, far)
        for a in range(rows.shape[0]):
            at = a * wide + i
            own = row + rows[a]
            rx = hx - first_home[0, own]
            ry = hy - first_home[1, own]
            r2 = rx * rx + ry * ry
            length = r2 * inverse_root(r2, ZERO_LENGTH_SQUARED)
            shortest = larger(zero() - length, shortest)
            longest = larger(length, longest)
            store(member[PX], at, zero() + first[0, own])
            store(member[PY], at, zero() + first[1, own])
            store(member[QX], at, x)
            store(member[QY], at, y)
            if free < 0.0:
                store(member[L0], at, length)
                store(member[EXCESS], at, zero())
            else:
                store(member[L0], at, zero() + free)
                store(member[EXCESS], at, (length - free) * (length + free))
    distance = min(NEAR_HOME * largest(longest), -0.25 * largest(shortest))
    reach = math.sqrt(largest(far))
    near[0] = distance * distance
    near[1] = min(distance / max(reach, 1e-300), 1.0) ** 2


@kernel
def keep_tile(k, tile, price, length, common, built, places, out, prices):
    """Write what is kept of the tile in place k of those that are priced, and on demand its prices.

    In:
      k, tile: its place, and its number.
      length (PLACES,), common: as of `sum_tile`.
      built, places: as of `price_candidates`.
    In place:
      price (PLACES,): becomes infinite of candidates that do not count.
    Out:
      out (K, TILE_NUMBERS), prices (K, PLACES) or (0, PLACES): row k is overwritten, of out but for COMPUTED.
    """
    for at in range(built[tile], built[tile + 1]):
        price[places[at]] = np.inf
    sum_tile(price, length, common, out[k])
    if prices.shape[0] > 0:
        prices[k] = price


@part
def sum_tile(price, home, common, out):
    """What is kept of a tile.

    In:
      price (PLACES,): of the candidates; infinite where one does not count.
      home (PLACES,): their initial lengths (m).
      common (COMMON,): what they have in common.
    Out:
      out (TILE_NUMBERS,): overwritten, but for COMPUTED.
    """
    seen = zero()
    best = zero() - np.inf
    gains = zero()
    ratio = zero()
    for at in range(0, PLACES, lanes()):
        length = load(home, at)
        found = load(price, at)
        cost = length if common[COST] < 0.0 else zero() + common[COST]
        counts = where_larger(zero() - found, -ABOVE_ALL_PRICES, zero() + 1.0)
        counts = where_larger(length, common[BELOW], where_larger(zero() - length, -common[ABOVE], counts))
        gain = where_larger(counts, 0.5, zero() - (found + common[WORTH] * cost))
        seen += counts
        best = larger(gain + ABOVE_ALL_PRICES * (counts - 1.0), best)
        gains += larger(gain, zero())
        inverse = inverse_root(cost * cost, ZERO_LENGTH_SQUARED)
        ratio = larger(gain * inverse, ratio)
    out[SEEN] = total(seen)
    out[BEST] = common[UPPER] * largest(best)
    out[TOGETHER] = common[UPPER] * total(gains)
    out[RATIO] = largest(ratio)
