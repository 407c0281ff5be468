"""Members of a tile by a law that remembers, followed through the steps from the motion of a few of them.

Each member has a mode and a permanent set of its own, and leaves the mode when it is time. But elongation and rate are
smooth in where its ends are, whatever it does: those of all members of a part follow from a few
(`sensitivity.tile_interpolation`), for each row of the part first, and within a row only where not all of it stays in
its mode. So the members that stay are known, and what they do follows from these few, too. All others, those near a
switch, are looked at and priced by themselves (`sorted_members`, `sorted_prices`).
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, larger, largest, load, magnitude, store, zero
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.priced_candidates import (
    CODE,
    FIRST_NODE,
    FIRST_STEP,
    KIND,
    LAST_STEP,
    MOVES,
    NODES,
    POINT,
    WHOLE,
)
from mdstopo.general.pricing.certain_modes import FASTEST, HIGH, LOW, SLOWEST, UNSURE
from mdstopo.general.pricing.loaded_members import loaded_at, steps_together
from mdstopo.general.pricing.priced_tile import SETS, add_points, load_tile, set_share
from mdstopo.general.pricing.sorted_members import (
    CLASSES,
    CORNERS,
    COUNT,
    FROM,
    SURE,
    TO,
    UNSORTED,
    fill_tangents,
    how_many,
    join_class,
    place_in_columns,
    sort_places,
    stay_in,
    try_mode,
)
from mdstopo.general.pricing.sorted_prices import ONE_BY_ONE, SHARE_OF_A_CLASS, follow_others, price_each
from mdstopo.general.pricing.switching_prices import NO_REST, add_polynomial, mode_at_start
from mdstopo.general.pricing.switching_together import is_quick
from mdstopo.mechanics.kinematics.kinematics_interface import ELONGATION, RATE, WORKS, member_works
from mdstopo.mechanics.laws.law_table import (
    law,
    law_degree,
    law_first_set,
    law_is_idle,
    law_margin,
    law_remembers,
)
from mdstopo.sensitivity.tile_interpolation import (
    ALL_ROWS,
    BROAD,
    COLUMN_NODE,
    COLUMN_NODES,
    LEVELS,
    MOST_FEW,
    PARTS,
    PLACES,
    ROW_NODE,
    ROW_NODES,
    SHORT,
    TALL,
    fill_column_shares,
    fill_row_shares,
    fill_weights,
    tail,
    worse,
)

#: where in the model the members are from which all others follow
FEW_AT = 2 * PLACES
#: the last coefficients of elongations and rates from which others follow are to be below this (m, m/s), a tenth of
#: `sorted_members.SURE`
EXACT = 1e-12
#: of the few: how many rows they are in, the columns of the part, whether other rows follow from theirs
FEW_NUMBERS = 3
FEW_ROWS, PART_COLUMNS, BETWEEN_ROWS = range(FEW_NUMBERS)
#: the places of the Lebesgue constants
BY_ROWS, BY_COLUMNS = range(2)

#: the arrays of a `FewMembers`
FIELDS = (
    "size", "places", "row_node", "row_weight", "row_share", "column_node", "column_weight", "column_share", "between",
    "works", "now", "sums", "row_motion", "box", "part_box", "row_sum", "total", "row_values", "row_mode", "sets",
)  # fmt: skip


class FewMembers:
    """The members from which all others of a part follow, inside kernels.

    size (FEW_NUMBERS,). places (MOST_FEW,): theirs in the tile, row by row. row_node, row_weight (TALL,), column_node,
    column_weight (COLUMN_NODES,): of `fill_weights`. row_share (TALL, TALL): by how much each of their rows counts in a
    row of the tile. column_share (COLUMN_NODES, BROAD): likewise by columns of the part. between (2,): the Lebesgue
    constants: by how many times what follows between rows, and between columns, may be larger than the largest of the
    values from which it follows. works (NODES, WORKS, MOST_FEW), now (WORKS, MOST_FEW): what they do at the nodes of a
    step, of which the first does not count, and at a stage. sums (SETS, MOST_FEW): what they would do in a step, with
    each of some permanent sets.

    At their columns: row_motion (TALL, NODES, 2, COLUMN_NODES): elongation and rate of each row; row_sum (SETS,
    COLUMN_NODES): what a row does in a step; total (TALL, COLUMN_NODES): what rows have done while all their members
    were in one mode.

    box (TALL, 4): the least and the largest elongation less permanent sets (m), and the least and the largest rate
    (m/s), in each row. part_box (4,): likewise in the part. row_values (BROAD,): what members of a row do. row_mode
    (TALL,): the mode that all members of a row are in, UNSURE where they differ. sets (TALL, 2): the least and the
    largest permanent set in each row (m).
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(FewMembers, FIELDS)


@kernel
def make_few():
    """A `FewMembers`."""
    return FewMembers(
        np.zeros(FEW_NUMBERS, np.int64),
        np.zeros(MOST_FEW, np.int64),
        np.zeros(TALL),
        np.zeros(TALL),
        np.zeros((TALL, TALL)),
        np.zeros(COLUMN_NODES),
        np.zeros(COLUMN_NODES),
        np.zeros((COLUMN_NODES, BROAD)),
        np.zeros(2),
        np.zeros((NODES, WORKS, MOST_FEW)),
        np.zeros((WORKS, MOST_FEW)),
        np.zeros((SETS, MOST_FEW)),
        np.zeros((TALL, NODES, 2, COLUMN_NODES)),
        np.zeros((TALL, 4)),
        np.zeros(4),
        np.zeros((SETS, COLUMN_NODES)),
        np.zeros((TALL, COLUMN_NODES)),
        np.zeros(BROAD),
        np.zeros(TALL, np.int64),
        np.zeros((TALL, 2)),
    )


@part
def goes_by_few(model, candidates, k):
    """Whether the members of a law may be followed by what a few of them do: it remembers, and in a mode it is linear
    in elongation and rate, and knows no time.

    model, candidates, k: with the numbers of the laws, a `PricedCandidates`, and the number of the run.
    """
    code = candidates.run[k, CODE]
    return law_remembers(code) and law_degree(code) == 1 and is_quick(code, candidates.law[k], model.curves)


@kernel
def follow_parts(tile, left):
    """Price the members of those parts of a tile whose motion follows from that of a few of them.

    tile: a `PricedTile`, by a law that `goes_by_few`.
    left (PARTS,): 1 for each of the smallest parts; 0 then for those whose members have their prices.

    Returns how many prices of steps were computed.
    """
    few = make_few()
    are_smooth = tile.grids[3]
    done = 0.0
    for level in range(LEVELS):
        size = BROAD >> level
        for at in range(1 << level):
            smallest = at * (size // SHORT)
            if (at + 1) * size > tile.width or left[smallest] == 0 or are_smooth[level, tile.j * PARTS + smallest] == 0:
                continue
            load_tile(tile)
            if _choose(tile, np.int64(level), at * size, few):
                left[smallest : smallest + size // SHORT] = 0
                done += _follow_part(tile, at * size, few)
    return done


@kernel
def _choose(tile, level, first, few):
    """Choose members of a part from whose motion that of all others follows.

    tile: a `PricedTile`, with all its members in its model.
    level, first: of the part, and its first column.
    few: a `FewMembers`, which is filled.

    Returns whether there are any.
    """
    grids, height = tile.grids, tile.height
    chosen = COLUMN_NODE[level]
    _fill_columns(grids[1], tile.j * BROAD + first, level, few)
    for tried in range(0 if height == TALL and grids[2][tile.i] != 0 else ALL_ROWS, ALL_ROWS + 1):
        _fill_rows(grids[0], tile.i, height, tried, few)
        rows = few.size[FEW_ROWS]
        for r in range(rows):
            row = r if tried == ALL_ROWS else ROW_NODE[tried, r]
            for b in range(COLUMN_NODES):
                few.places[r * COLUMN_NODES + b] = row * BROAD + first + chosen[b]
        member = tile.model.member
        for d in range(member.shape[0]):
            for m in range(rows * COLUMN_NODES):
                member[d, FEW_AT + m] = member[d, loaded_at(few.places[m])]
        if _is_enough(tile, few):
            return True
    return False


@kernel
def _fill_columns(numbers, begin, level, few):
    """Set by how much values at the columns of the few count in all columns of a part.

    numbers (n,): of the points of the second grid. begin: which one the part begins with. level: of the part.
    few: a `FewMembers`.
    """
    size = BROAD >> level
    few.size[PART_COLUMNS] = size
    fill_weights(numbers, begin, size, COLUMN_NODE[level], few.column_node, few.column_weight)
    fill_column_shares(numbers, begin, size, few.column_node, few.column_weight, few.column_share)
    few.between[BY_COLUMNS] = _lebesgue(few.column_share[:, :size].T)


@kernel
def _fill_rows(numbers, i, height, tried, few):
    """Set by how much values at the rows of the few count in all rows of a tile.

    numbers (n,): of the points of the first grid. i, height: the strip of the tile, and how many rows it has.
    tried: which number of rows, of ROW_NODES, or ALL_ROWS.
    few: a `FewMembers`.
    """
    rows = height if tried == ALL_ROWS else ROW_NODES[tried]
    few.size[FEW_ROWS] = rows
    few.size[BETWEEN_ROWS] = tried != ALL_ROWS
    if tried == ALL_ROWS:
        few.row_share[:] = 0.0
        for r in range(rows):
            few.row_share[r, r] = 1.0
    else:
        node, weight = few.row_node[:rows], few.row_weight[:rows]
        fill_weights(numbers, i * TALL, np.int64(TALL), ROW_NODE[tried], node, weight)
        fill_row_shares(numbers, i, node, weight, few.row_share)
    few.between[BY_ROWS] = _lebesgue(few.row_share[:, :rows])


@kernel
def _lebesgue(share):
    """The Lebesgue constant of nodes at some places: the largest sum of the magnitudes of their shares (places, nodes).

    The polynomial through values at the nodes is at no place larger than so many times the largest of them.
    """
    most = 0.0
    for a in range(share.shape[0]):
        total = 0.0
        for k in range(share.shape[1]):
            total += abs(share[a, k])
        most = max(most, total)
    return most


@kernel
def _is_enough(tile, few):
    """Whether elongations and rates of all members of a part follow from those of a few of them.

    Only the last node of each step is looked at: positions are smooth over a step. What is left out inside is caught
    for sums by `_sum_steps`, for modes by SURE.

    tile, few: as of `_choose`.
    """
    candidates = tile.candidates
    run = candidates.run[tile.k]
    count = few.size[FEW_ROWS] * COLUMN_NODES
    for s in range(run[FIRST_STEP], run[LAST_STEP]):
        if candidates.step[s, KIND] == POINT:
            continue
        o = candidates.step[s, FIRST_NODE] + NODES - 1
        member_works(
            tile.model, np.int64(FEW_AT), count, candidates.node_pose[o], candidates.node_change[o], few.works[0]
        )
        for row in (ELONGATION, RATE):
            if not _worst_tail(few.works[0, row], few) <= EXACT:
                return False
    return True


@kernel
def _worst_tail(values, few):
    """The largest of the last coefficients of the Chebyshev series through values, by columns and by rows.

    values (MOST_FEW,): of the members of a `FewMembers`.
    """
    rows = few.size[FEW_ROWS]
    worst = 0.0
    for r in range(rows):
        worst = worse(worst, tail(values, r * COLUMN_NODES, 1, few.column_node, few.column_weight))
    if few.size[BETWEEN_ROWS] != 0:
        for b in range(COLUMN_NODES):
            worst = worse(worst, tail(values, b, COLUMN_NODES, few.row_node[:rows], few.row_weight[:rows]))
    return worst


@kernel
def _follow_part(tile, first, few):
    """Price the members of a part.

    tile, first, few: as of `_choose`.

    Returns how many prices of steps were computed.
    """
    candidates = tile.candidates
    run = candidates.run[tile.k]
    has_modes = False
    has_whole_step = False
    # steps in which all members have stayed in a mode since any changed, and that are not priced yet
    begin = np.int64(0)
    behind = np.int64(0)
    # 1 behind a part of a step: the modes and permanent sets then are in row 1
    behind_part = np.int64(0)
    done = 0.0
    few.total[:] = 0.0
    for s in range(run[FIRST_STEP], run[LAST_STEP]):
        kind = candidates.step[s, KIND]
        if kind == POINT:
            add_points(tile, s, first, few.size[PART_COLUMNS], has_whole_step or behind_part != 0, behind_part)
            done += 1.0 * few.size[PART_COLUMNS] * tile.height
            continue
        if not has_modes:
            _begin(tile, s, first, few)
            has_modes = True
        has_whole_step = has_whole_step or kind == WHOLE
        behind_part = np.int64(kind != WHOLE)
        mode = few.row_mode[0]
        stay = _all_in_mode(tile, s, few)
        if stay and kind == WHOLE:
            if candidates.step[s, MOVES] == 0 or law_is_idle(run[CODE], mode):
                continue
            if s == behind:
                behind += 1
                continue
        done += _price_together(tile, begin, behind, first, few)
        behind = begin
        if stay and kind == WHOLE:
            begin = np.int64(s)
            behind = begin + 1
            continue
        # `fresh` is `sets[0]` here; a row with a `row_class` changes neither in the step
        if stay:
            _join_all(tile, mode, first, few)
        else:
            _sort_part(tile, s, first, few)
        done += _price_classes(tile, s, first, few)
        _end_step(tile, s, first, few)
    done += _price_together(tile, begin, behind, first, few)
    tile.sorting.row_class[:] = UNSORTED
    for a in range(tile.height):
        _spread_row(few.total[a], few)
        for b in range(few.size[PART_COLUMNS]):
            tile.price[a * BROAD + first + b] += few.row_values[b]
    return done


@kernel
def _begin(tile, s, first, few):
    """Set the modes and permanent sets with which the members of a part begin.

    tile, first, few: as of `_choose`.
    s: number of the first step.
    """
    model, candidates, k = tile.model, tile.candidates, tile.k
    modes, sets, fresh = tile.lists.modes, tile.lists.sets, tile.lists.fresh
    works, node = tile.sorting.works, tile.following.node
    code = candidates.run[k, CODE]
    o = candidates.step[s, FIRST_NODE]
    for at in range(first, first + few.size[PART_COLUMNS], SHORT):
        lo = PLACES + at * TALL
        member_works(model, lo, np.int64(SHORT * TALL), candidates.node_pose[o], candidates.node_change[o], works[0])
        for i in range(SHORT * TALL):
            if i % TALL >= tile.height:
                continue
            b = place_in_columns(at, i)
            node[ELONGATION, 0] = works[0, ELONGATION, i]
            node[RATE, 0] = works[0, RATE, i]
            modes[0, b] = mode_at_start(model, candidates, k, lo + i, s, node)
            sets[0, b] = law_first_set(code, candidates.law[k], node[ELONGATION, 0], modes[0, b])
            fresh[b] = sets[0, b]
    for a in range(tile.height):
        _note_row(tile, a, first, few)


@part
def _note_row(tile, a, first, few):
    """Note the mode of the members of row a, and the range of their permanent sets.

    tile, first, few: as of `_choose`.
    """
    modes, sets = tile.lists.modes, tile.lists.sets
    begin = a * BROAD + first
    mode = modes[0, begin]
    low = sets[0, begin]
    high = low
    for b in range(begin, begin + few.size[PART_COLUMNS]):
        low = min(low, sets[0, b])
        high = max(high, sets[0, b])
        if modes[0, b] != mode:
            mode = np.int64(UNSURE)
    few.row_mode[a] = mode
    few.sets[a, 0] = low
    few.sets[a, 1] = high


@kernel
def _all_in_mode(tile, s, few):
    """Whether all members of a part are in one mode, and bounds tell that they stay in it in a step.

    tile, few: as of `_choose`; what the few do at the nodes is set. s: number of the step.
    """
    model, candidates, k = tile.model, tile.candidates, tile.k
    o = candidates.step[s, FIRST_NODE]
    count = few.size[FEW_ROWS] * COLUMN_NODES
    for m in range(1, NODES):
        member_works(
            model, np.int64(FEW_AT), count, candidates.node_pose[o + m], candidates.node_change[o + m], few.works[m]
        )
    if few.size[BETWEEN_ROWS] == 0 or not _is_of_one_mode(few):
        return False
    _bound_all(few)
    return _all_stay(
        candidates.run[k, CODE], candidates.law[k], model.curves, candidates.step_time[s, 0], few.row_mode[0],
        few.part_box,
    )  # fmt: skip


@kernel
def _join_all(tile, mode, first, few):
    """Put all members of a part into the class of those that stay in a mode.

    tile, first, few: as of `_choose`; the tile's sorting is filled. mode: the mode.
    """
    classes, kind, row_class = tile.sorting.classes, tile.sorting.kind, tile.sorting.row_class
    size = few.size[PART_COLUMNS]
    classes[:] = 0
    own = join_class(mode, mode, size * tile.height, classes)
    row_class[:] = own
    for a in range(tile.height):
        kind[a * BROAD + first : a * BROAD + first + size] = own


@kernel
def _price_together(tile, begin, behind, first, few):
    """Price the members of a part in steps behind each other in which all stay in one mode.

    tile, first, few: as of `_choose`. begin, behind: the first step, and the one behind the last; none where equal.

    Returns how many prices of steps were computed.
    """
    if begin == behind:
        return 0.0
    _join_all(tile, few.row_mode[0], first, few)
    have_prices, done = _price_staying(tile, begin, behind, first, np.int64(0), few)
    if not have_prices:
        for s in range(begin, behind):
            done += _price_classes(tile, s, first, few)
    return done


@kernel
def _sort_part(tile, s, first, few):
    """Sort the members of a part by what they do in a step.

    tile, first, few: as of `_choose`, with what the few do at the nodes; the tile's sorting is filled.
    s: number of the step.
    """
    model, candidates, k, sorting = tile.model, tile.candidates, tile.k, tile.sorting
    classes, kind, row_class = sorting.classes, sorting.kind, sorting.row_class
    code = candidates.run[k, CODE]
    p = candidates.law[k]
    t = candidates.step_time[s, 0]
    size = few.size[PART_COLUMNS]
    classes[:] = 0
    near = np.int64(0)
    _move_rows(tile.height, few)
    for a in range(tile.height):
        box = few.box[a]
        mode = few.row_mode[a]
        row_class[a] = UNSORTED
        if mode != UNSURE and _all_stay(code, p, model.curves, t, mode, box):
            own = join_class(mode, mode, size, classes)
            row_class[a] = own
            kind[a * BROAD + first : a * BROAD + first + size] = own
            if own != UNSORTED:
                continue
        near = _sort_row(tile, s, a, first, box, few, near)
    sort_places(
        model, candidates, k, s, sorting.places, near, np.int64(0), np.bool_(True), tile.lists.modes[0],
        tile.lists.sets[0], sorting,
    )  # fmt: skip


@part
def _is_of_one_mode(few):
    """Whether the members of all rows are in one mode."""
    mode = few.row_mode[0]
    found = mode != UNSURE
    for a in range(1, TALL):
        found = found and few.row_mode[a] == mode
    return found


@kernel
def _bound_all(few):
    """Write the range of elongations less permanent sets, and of rates, of all members of a part at the nodes of a
    step but for the first into `part_box` of a `FewMembers`, of a part whose rows follow from others.

    They are bilinear in the places of both points, between what they are at the corners, but for a rest that is known
    at the few members.
    """
    works, box, node, row_node = few.works, few.part_box, few.column_node, few.row_node
    works = works.reshape(works.size)
    rows = few.size[FEW_ROWS]
    for q in range(2):
        low = np.inf
        high = -np.inf
        off = zero()
        for m in range(1, NODES):
            begin = (m * WORKS + (ELONGATION if q == 0 else RATE)) * MOST_FEW
            end = begin + (rows - 1) * COLUMN_NODES
            first, second = works[begin], works[begin + COLUMN_NODES - 1]
            third, fourth = works[end], works[end + COLUMN_NODES - 1]
            low = min(low, min(min(first, second), min(third, fourth)))
            high = max(high, max(max(first, second), max(third, fourth)))
            for r in range(rows):
                share = 0.5 * (1.0 + row_node[r])
                one = first + share * (third - first)
                other = second + share * (fourth - second)
                off = _off_line(works, begin + r * COLUMN_NODES, node, one, other, off)
        more = few.between[BY_ROWS] * few.between[BY_COLUMNS] * largest(off)
        box[LOW if q == 0 else SLOWEST] = low - more
        box[HIGH if q == 0 else FASTEST] = high + more
    least = few.sets[0, 0]
    most = few.sets[0, 1]
    for a in range(1, TALL):
        least = min(least, few.sets[a, 0])
        most = max(most, few.sets[a, 1])
    box[LOW] -= most
    box[HIGH] -= least


@part
def _off_line(values, begin, node, one, other, off):
    """How far values at the columns of the few are from a line, in vectors, where that is more than `off`.

    values, begin: the values, and where those at the first column are.
    node (COLUMN_NODES,): of `fill_weights`. one, other: the line at its ends.
    off: a vector, which is returned with what is larger in it.
    """
    middle = 0.5 * (one + other)
    half = 0.5 * (other - one)
    for b in range(0, COLUMN_NODES, lanes()):
        off = larger(magnitude(load(values, begin + b) - (load(node, b) * half + middle)), off)
    return off


@kernel
def _move_rows(height, few):
    """Elongations and rates of rows at the columns of the few, at the nodes of a step but for the first, and the range
    of elongations less permanent sets, and of rates, of all members of each row.

    height, few: how many rows there are, and a `FewMembers`, of which `row_motion` and `box` are set.
    """
    share, works, motion, node = few.row_share, few.works, few.row_motion, few.column_node
    rows, box = few.size[FEW_ROWS], few.box
    # places are counted here: slices would take longer than the sums
    works, motion = works.reshape(works.size), motion.reshape(motion.size)
    for a in range(height):
        for q in range(2):
            low = np.inf
            high = -np.inf
            off = zero()
            for m in range(1, NODES):
                begin = (m * WORKS + (ELONGATION if q == 0 else RATE)) * MOST_FEW
                to = ((a * NODES + m) * 2 + q) * COLUMN_NODES
                for b in range(to, to + COLUMN_NODES, lanes()):
                    value = zero()
                    for r in range(rows):
                        value += share[a, r] * load(works, begin + r * COLUMN_NODES + b - to)
                    store(motion, b, value)
                one = motion[to]
                other = motion[to + COLUMN_NODES - 1]
                low = min(low, min(one, other))
                high = max(high, max(one, other))
                off = _off_line(motion, to, node, one, other, off)
            more = few.between[BY_COLUMNS] * largest(off)
            box[a, LOW if q == 0 else SLOWEST] = low - more
            box[a, HIGH if q == 0 else FASTEST] = high + more
        box[a, LOW] -= few.sets[a, 1]
        box[a, HIGH] -= few.sets[a, 0]


@kernel
def _move_members(a, first, few, sets, works):
    """Elongations less permanent sets, and rates, of all members of a row at the nodes of a step but for the first.

    a, first, few: the row, the first column of the part, and a `FewMembers`.
    sets (2, PLACES): permanent sets, in row 0 (m).
    works (NODES, WORKS, MANY): set.
    """
    motion, share, sets = few.row_motion, few.column_share, sets.reshape(sets.size)
    motion, share = motion.reshape(motion.size), share.reshape(share.size)
    many = works.shape[2]
    works = works.reshape(works.size)
    size = few.size[PART_COLUMNS]
    for m in range(1, NODES):
        for q in range(2):
            own = ((a * NODES + m) * 2 + q) * COLUMN_NODES
            to = (m * WORKS + (ELONGATION if q == 0 else RATE)) * many
            for b in range(0, size, lanes()):
                value = zero()
                for c in range(COLUMN_NODES):
                    value += motion[own + c] * load(share, c * BROAD + b)
                if q == 0:
                    value = value - load(sets, a * BROAD + first + b)
                store(works, to + b, value)


@part
def _all_stay(code, p, curves, t, mode, box):
    """Whether members with elongations less permanent sets, and with rates, within a range stay in a mode.

    code, p (8,), curves, t: the law, numbers of all laws, and any time (s), on which the law does not depend.
    mode, box (4,): the mode, and the range.
    """
    for corner in range(CORNERS):
        x = box[LOW if corner < 2 else HIGH]
        rate = box[SLOWEST if corner % 2 == 0 else FASTEST]
        if not law_margin(code, p, x, rate, mode, t, curves, NO_REST) > SURE:
            return False
    return True


@kernel
def _sort_row(tile, s, a, first, box, few, near):
    """Sort those members of a row that stay in their modes, and list the others.

    In:
      tile, first, few: as of `_choose`. s, a: numbers of the step and of the row.
      box (4,): of a `FewMembers`, elongations less permanent sets.
      near: how many members are listed.
    In place:
      tile: of its sorting classes of the members are set, and those listed in `places` are UNSORTED.

    Returns how many members are listed then.
    """
    sorting, modes, sets = tile.sorting, tile.lists.modes, tile.lists.sets
    kind, classes, tried = sorting.kind, sorting.classes, sorting.tried
    size = few.size[PART_COLUMNS]
    begin = a * BROAD + first
    _move_members(a, first, few, sets, sorting.works)
    count = np.int64(0)
    alike = few.row_mode[a] != UNSURE
    for b in range(begin, begin + (1 if alike else size)):
        count = try_mode(modes[0, b], count, tried)
    fill_tangents(
        tile.candidates.run[tile.k, CODE], tile.candidates.law[tile.k], tile.model.curves,
        tile.candidates.step_time[s, 0], box, count, tried, sorting.tangent,
    )  # fmt: skip
    sorting.mode[:] = UNSURE
    for b in range(0, size, lanes()):
        left = (1 << lanes()) - 1
        for n in range(count):
            bits = stay_in(n, b, np.int64(1), sorting) & left
            for lane in range(lanes() if bits != 0 and not alike else 0):
                if modes[0, begin + b + lane] != tried[n]:
                    bits &= ~(1 << lane)
            if bits == 0:
                continue
            own = join_class(tried[n], tried[n], how_many(bits), classes)
            if own == UNSORTED:
                continue
            left &= ~bits
            for lane in range(lanes()):
                if (bits >> lane) & 1 == 1:
                    kind[begin + b + lane] = own
        for lane in range(lanes() if left != 0 else 0):
            if (left >> lane) & 1 == 1:
                kind[begin + b + lane] = UNSORTED
                sorting.places[near] = begin + b + lane
                near += 1
    return near


@kernel
def _price_classes(tile, s, first, few):
    """Price the members of a part that are sorted, and those that are not.

    tile, first, few: as of `_choose`. s: number of the step.

    Returns how many prices were computed.
    """
    candidates, k, lists, classes = tile.candidates, tile.k, tile.lists, tile.sorting.classes
    size = few.size[PART_COLUMNS]
    to = np.int64(0) if candidates.step[s, KIND] == WHOLE else np.int64(1)
    if to == 1:
        for a in range(tile.height):
            lists.modes[1, a * BROAD + first : a * BROAD + first + size] = lists.modes[
                0, a * BROAD + first : a * BROAD + first + size
            ]
    done = 0.0
    for c in range(CLASSES):
        if classes[c, COUNT] == 0:
            continue
        if classes[c, FROM] == classes[c, TO]:
            if candidates.step[s, MOVES] == 0 or law_is_idle(candidates.run[k, CODE], classes[c, FROM]):
                continue
            if classes[c, COUNT] > ONE_BY_ONE:
                have_prices, computed = _price_staying(tile, s, s + 1, first, c, few)
                done += computed
                if have_prices:
                    continue
        done += price_each(tile, s, first, size, c, to)
    return done + follow_others(tile, s, first, size, np.bool_(True), to)


@kernel
def _price_staying(tile, begin, behind, first, c, few):
    """Price members of a part that stay in a mode in some steps from what the few would do in it.

    Force and energy are polynomials of the second degree at most in a member's permanent set.

    tile, first, few: as of `_choose`. begin, behind: as of `_price_together`. c: the class.

    Returns whether they have their prices, not where what they do is not smooth enough, and how many were computed.
    """
    price, kind, row_class, sets = tile.price, tile.sorting.kind, tile.sorting.row_class, tile.lists.sets
    mode = tile.sorting.classes[c, FROM]
    size = few.size[PART_COLUMNS]
    low = np.inf
    high = -np.inf
    for a in range(tile.height):
        if row_class[a] == c:
            low = min(low, few.sets[a, 0])
            high = max(high, few.sets[a, 1])
        elif row_class[a] == UNSORTED:
            for b in range(a * BROAD + first, a * BROAD + first + size):
                if kind[b] == c:
                    low = min(low, sets[0, b])
                    high = max(high, sets[0, b])
    count = np.int64(SETS if low != high and _knows_sets(tile, begin, mode) else 1)
    computed = 1.0 * count * few.size[FEW_ROWS] * COLUMN_NODES
    if not _sum_steps(tile, begin, behind, mode, low, high, count, few) <= SHARE_OF_A_CLASS * tile.error:
        return False, computed
    for a in range(tile.height):
        if row_class[a] != c and row_class[a] != UNSORTED:
            continue
        _sum_row(a, count, few)
        if row_class[a] == c and count == 1:
            for b in range(COLUMN_NODES):
                few.total[a, b] += few.row_sum[0, b]
            continue
        at = a * BROAD + first
        for n in range(count):
            _spread_row(few.row_sum[n], few)
            for b in range(size):
                if kind[at + b] == c:
                    share = 1.0
                    if count > 1:
                        t = 2.0 * (sets[0, at + b] - low) / (high - low) - 1.0
                        share = set_share(n, t)
                    price[at + b] += share * few.row_values[b]
    return True, computed


@part
def _knows_sets(tile, s, mode):
    """Whether what members do in a mode depends on their permanent sets: not where force and energy, which are of the
    second degree at most in the elongation, have no slopes.

    tile, s, mode: a `PricedTile`, and numbers of the step and of the mode.
    """
    t = tile.candidates.step_time[s, 0]
    knows = False
    for x in range(2):
        _, by_x, _, _, energy_by_x = law(
            tile.candidates.run[tile.k, CODE], tile.candidates.law[tile.k], 1.0 * x, 0.0, mode, t, 0.0,
            tile.model.curves, NO_REST,
        )  # fmt: skip
        knows = knows or by_x != 0.0 or energy_by_x != 0.0
    return knows


@kernel
def _sum_steps(tile, begin, behind, mode, low, high, count, few):
    """What the few would do in some steps in a mode, with some permanent sets.

    tile, few: as of `_choose`; the sums are set. begin, behind: as of `_price_together`. mode: the mode.
    low, high, count: the least and the largest of the sets (m), and how many there are.

    Returns by how much what follows for other members may be off.
    """
    members = few.size[FEW_ROWS] * COLUMN_NODES
    few.sums[:count] = 0.0
    s = begin
    while s < behind:
        taken, first, last = steps_together(
            tile.model, tile.candidates, s, behind - s, np.int64(FEW_AT), members, few.now
        )
        _add_states(tile, first, last, mode, low, high, count, few)
        s += taken
    worst = 0.0
    for n in range(count):
        worst = worse(worst, _worst_tail(few.sums[n], few))
    return worst


@kernel
def _add_states(tile, first, behind, mode, low, high, count, few):
    """Add what the few would do at some states to their sums.

    tile, mode, low, high, count, few: as of `_sum_steps`. first, behind: the first state, and the one behind the last.
    """
    model, candidates, k, following, now = tile.model, tile.candidates, tile.k, tile.following, few.now
    code = candidates.run[k, CODE]
    members = few.size[FEW_ROWS] * COLUMN_NODES
    for o in range(first, behind):
        member_works(model, np.int64(FEW_AT), members, candidates.pose[o, 0], candidates.change[o, 0], now)
        for n in range(count):
            less = low if n == 0 else 0.5 * (high - low)
            for i in range(0, members, lanes()):
                store(now[ELONGATION], i, load(now[ELONGATION], i) - less)
            add_polynomial(
                code, candidates.law[k], model.curves, candidates.when[o], candidates.level[o], candidates.energy[o],
                now, members, mode, following.node, following.power, few.sums[n],
            )  # fmt: skip


@kernel
def _sum_row(a, count, few):
    """What row a does in a step at the columns of the few, with as many permanent sets as `count`: `row_sum` is set."""
    share, sums, row_sum = few.row_share, few.sums, few.row_sum
    sums, row_sum = sums.reshape(sums.size), row_sum.reshape(row_sum.size)
    for n in range(count):
        for b in range(0, COLUMN_NODES, lanes()):
            value = zero()
            for r in range(few.size[FEW_ROWS]):
                value += share[a, r] * load(sums, n * MOST_FEW + r * COLUMN_NODES + b)
            store(row_sum, n * COLUMN_NODES + b, value)


@kernel
def _spread_row(values, few):
    """What all members of a row have, from values (COLUMN_NODES,) at columns: `row_values` of a `FewMembers` is set."""
    share, row_values = few.column_share, few.row_values
    share = share.reshape(share.size)
    for b in range(0, few.size[PART_COLUMNS], lanes()):
        value = zero()
        for c in range(COLUMN_NODES):
            value += values[c] * load(share, c * BROAD + b)
        store(row_values, b, value)


@kernel
def _end_step(tile, s, first, few):
    """Have the modes and permanent sets with which members end a step be those with which they begin the next.

    tile, first, few: as of `_choose`. s: number of the step.
    """
    sets, fresh, row_class = tile.lists.sets, tile.lists.fresh, tile.sorting.row_class
    whole = tile.candidates.step[s, KIND] == WHOLE
    for a in range(tile.height):
        if whole and row_class[a] != UNSORTED:
            continue
        for b in range(a * BROAD + first, a * BROAD + first + few.size[PART_COLUMNS]):
            if whole:
                sets[0, b] = fresh[b]
            else:
                sets[1, b] = fresh[b]
                fresh[b] = sets[0, b]
        if whole:
            _note_row(tile, a, first, few)
