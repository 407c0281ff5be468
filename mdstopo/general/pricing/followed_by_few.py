"""Members of a tile by a law that remembers, followed through the steps from the motion of a few of them.

Each member has a mode and a permanent set of its own, and leaves the mode when it is time. But elongation and rate are
smooth in where its ends are, whatever it does: those of all members of a part follow from a few
(`sensitivity.tile_interpolation`). Bounds tell first of the part, then of each row, and then of groups of SHORT columns
of a row whether all members stay in their mode; elongations and rates of single members are formed only in what is
left. So the mode in which each begins and ends a step is known, and what those that stay do follows from these few,
too. Members so near to a switch that it does not tell are looked at by themselves (`sorted_members`), and those that
leave their mode are followed (`sorted_prices`).
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import lanes, larger, largest, load, magnitude, negative, store, zero
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
    AT_ZERO,
    BY_ELONGATION,
    BY_RATE,
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
    modes_of,
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
    "row_off", "group_at", "group_mode", "group_set", "sure",
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
    largest permanent set in each row (m). row_off (TALL, 2): how far elongations (m) and rates (m/s) of a row are at
    most off the line between its ends.

    SHORT columns are a group: group_at (2, PARTS): where its first and its last column are on that line, from 0 to 1.
    group_mode (TALL, PARTS), group_set (TALL, 2, PARTS): as row_mode and sets, of each group of each row. sure (TALL,):
    a bit for each group of a row that bounds tell to stay in its mode in the step.
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
        np.zeros((TALL, 2)),
        np.zeros((2, PARTS)),
        np.zeros((TALL, PARTS), np.int64),
        np.zeros((TALL, 2, PARTS)),
        np.zeros(TALL, np.int64),
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
    for g in range(size // SHORT):
        for end in range(2):
            place = 0.0
            for c in range(COLUMN_NODES):
                place += few.column_node[c] * few.column_share[c, g * SHORT + end * (SHORT - 1)]
            few.group_at[end, g] = 0.5 * (1.0 + place)


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
    few.sure[:] = 0
    for a in range(tile.height):
        _note_row(tile, a, first, few)


@part
def _note_row(tile, a, first, few):
    """Note the modes of the members of row a, and the range of their permanent sets: of each group that is not `sure`
    to have kept these, and of the row.

    tile, first, few: as of `_choose`.
    """
    modes, sets, group_mode, group_set = tile.lists.modes, tile.lists.sets, few.group_mode, few.group_set
    groups = few.size[PART_COLUMNS] // SHORT
    for g in range(groups):
        if (few.sure[a] >> g) & 1 == 1:
            continue
        begin = a * BROAD + first + g * SHORT
        mode = modes[0, begin]
        low = sets[0, begin]
        high = low
        for b in range(begin, begin + SHORT):
            low = min(low, sets[0, b])
            high = max(high, sets[0, b])
            if modes[0, b] != mode:
                mode = np.int64(UNSURE)
        group_mode[a, g] = mode
        group_set[a, 0, g] = low
        group_set[a, 1, g] = high
    few.row_mode[a] = group_mode[a, 0]
    few.sets[a] = group_set[a, :, 0]
    for g in range(1, groups):
        if group_mode[a, g] != group_mode[a, 0]:
            few.row_mode[a] = UNSURE
        few.sets[a, 0] = min(few.sets[a, 0], group_set[a, 0, g])
        few.sets[a, 1] = max(few.sets[a, 1], group_set[a, 1, g])


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
    """Put all members of a part into the class of those that stay in a mode, whose number is returned.

    tile, first, few: as of `_choose`; the tile's sorting is filled. mode: the mode.
    """
    classes, kind, row_class = tile.sorting.classes, tile.sorting.kind, tile.sorting.row_class
    size = few.size[PART_COLUMNS]
    classes[:] = 0
    own = join_class(mode, mode, size * tile.height, classes)
    row_class[:] = own
    for a in range(tile.height):
        kind[a * BROAD + first : a * BROAD + first + size] = own
    return own


@kernel
def _price_together(tile, begin, behind, first, few):
    """Price the members of a part in steps behind each other in which all stay in one mode.

    tile, first, few: as of `_choose`. begin, behind: the first step, and the one behind the last; none where equal.

    Returns how many prices of steps were computed.
    """
    if begin == behind:
        return 0.0
    own = _join_all(tile, few.row_mode[0], first, few)
    done = 0.0
    if behind - begin > 1:
        have_prices, done = _price_staying(tile, begin, behind, first, own, few)
        if have_prices:
            return done
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
    sorting.mode[:] = UNSURE
    near = np.int64(0)
    _move_rows(tile.height, few)
    _bound_rows(tile.height, few)
    count = _try_modes(tile, first, few)
    fill_tangents(code, p, model.curves, t, few.part_box, count, sorting.tried, sorting.tangent)
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
        near = _sort_row(tile, s, a, first, count, few, near)
    sort_places(
        model, candidates, k, s, sorting.places, near, np.int64(0), np.bool_(True), tile.lists.modes[0],
        tile.lists.sets[0], sorting,
    )  # fmt: skip


@part
def _bound_rows(height, few):
    """Write the range that all rows are in, of elongations less permanent sets, and of rates, into `part_box`."""
    box, rows = few.part_box, few.box
    box[:] = rows[0]
    for a in range(1, height):
        box[LOW] = min(box[LOW], rows[a, LOW])
        box[HIGH] = max(box[HIGH], rows[a, HIGH])
        box[SLOWEST] = min(box[SLOWEST], rows[a, SLOWEST])
        box[FASTEST] = max(box[FASTEST], rows[a, FASTEST])


@kernel
def _try_modes(tile, first, few):
    """The modes that some members of a part are in, TRIED of them at most: `tried` of the tile's sorting is set.

    tile, first, few: as of `_choose`. Returns how many there are.
    """
    modes, tried = tile.lists.modes, tile.sorting.tried
    count = np.int64(0)
    for a in range(tile.height):
        if few.row_mode[a] != UNSURE:
            count = try_mode(few.row_mode[a], count, tried)
            continue
        for b in range(a * BROAD + first, a * BROAD + first + few.size[PART_COLUMNS]):
            count = try_mode(modes[0, b], count, tried)
    return count


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
            few.row_off[a, q] = more
            box[a, LOW if q == 0 else SLOWEST] = low - more
            box[a, HIGH if q == 0 else FASTEST] = high + more
        box[a, LOW] -= few.sets[a, 1]
        box[a, HIGH] -= few.sets[a, 0]


@kernel
def _move_members(a, first, g, few, sets, works):
    """Elongations less permanent sets, and rates, of the members of a group of columns of a row at the nodes of a step
    but for the first.

    a, first, g, few: the row, the first column of the part, the group, and a `FewMembers`.
    sets (2, PLACES): permanent sets, in row 0 (m).
    works (NODES, WORKS, MANY): set.
    """
    motion, share, sets = few.row_motion, few.column_share, sets.reshape(sets.size)
    motion, share = motion.reshape(motion.size), share.reshape(share.size)
    many = works.shape[2]
    works = works.reshape(works.size)
    begin = g * SHORT
    for m in range(1, NODES):
        for q in range(2):
            own = ((a * NODES + m) * 2 + q) * COLUMN_NODES
            to = (m * WORKS + (ELONGATION if q == 0 else RATE)) * many
            for b in range(0, SHORT, lanes()):
                value = zero()
                for c in range(COLUMN_NODES):
                    value += motion[own + c] * load(share, c * BROAD + begin + b)
                if q == 0:
                    value = value - load(sets, a * BROAD + first + begin + b)
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
def _sort_row(tile, s, a, first, count, few, near):
    """Sort the members of a row by what they do in a step: groups of columns that stay in their mode by bounds, the
    members of others by themselves.

    In:
      tile, first: as of `_choose`. s, a: numbers of the step and of the row.
      count: how many modes are tried.
      near: how many members are listed.
    In place:
      tile: of its sorting classes of the members are set, and those listed in `places` are UNSORTED.
      few: a `FewMembers`, of which `sure` is set for the row.

    Returns how many members are listed then.
    """
    classes = tile.sorting.classes
    sure = _sure_groups(a, count, few, tile.sorting)
    few.sure[a] = 0
    for g in range(few.size[PART_COLUMNS] // SHORT):
        if (sure >> g) & 1 == 1:
            mode = few.group_mode[a, g]
            own = join_class(mode, mode, SHORT, classes)
            if own != UNSORTED:
                begin = a * BROAD + first + g * SHORT
                tile.sorting.kind[begin : begin + SHORT] = own
                few.sure[a] |= 1 << g
                continue
        near = _sort_group(tile, s, a, g, first, count, few, near)
    return near


@part
def _sure_groups(a, count, few, sorting):
    """A bit for each group of columns of a row whose members are in one mode, and stay in it by bounds.

    Elongations and rates are linear along the row but for what `row_off` tells.

    a, count, few: as of `_sort_row`. sorting: the tile's `Sorting`.
    """
    motion, at = few.row_motion, few.group_at
    found = np.int64(0)
    for g in range(0, PARTS, lanes()):
        least_x, most_x = _range_of_groups(motion, at, a, 0, g)
        least_rate, most_rate = _range_of_groups(motion, at, a, 1, g)
        least_x = least_x - few.row_off[a, 0] - load(few.group_set[a, 1], g)
        most_x = most_x + few.row_off[a, 0] - load(few.group_set[a, 0], g)
        least_rate = least_rate - few.row_off[a, 1]
        most_rate = most_rate + few.row_off[a, 1]
        for n in range(count):
            short = zero() - np.inf
            for corner in range(CORNERS):
                own = sorting.tangent[n, corner]
                x = least_x if own[BY_ELONGATION] > 0.0 else most_x
                rate = least_rate if own[BY_RATE] > 0.0 else most_rate
                short = larger(SURE - (own[BY_ELONGATION] * x + own[BY_RATE] * rate + own[AT_ZERO]), short)
            bits = negative(short)
            for lane in range(lanes() if bits != 0 else 0):
                if (bits >> lane) & 1 == 1 and few.group_mode[a, g + lane] == sorting.tried[n]:
                    found |= 1 << (g + lane)
    return found


@part
def _range_of_groups(motion, at, a, q, g):
    """The least and the largest elongation (q = 0) or rate (1) of some groups of columns at the nodes of a step but for
    the first, on the line between the ends of a row: vectors.

    motion, at: of a `FewMembers`. a, g: the row and the first group.
    """
    low = zero() - np.inf
    high = zero() - np.inf
    for m in range(1, NODES):
        begin = motion[a, m, q, 0]
        change = motion[a, m, q, COLUMN_NODES - 1] - begin
        for end in range(2):
            value = change * load(at[end], g) + begin
            low = larger(zero() - value, low)
            high = larger(value, high)
    return zero() - low, high


@kernel
def _sort_group(tile, s, a, g, first, count, few, near):
    """Sort the members of a group of columns of a row, and list those near a switch.

    tile, s, a, first, count, few, near: as of `_sort_row`. g: the group.

    Returns how many members are listed then.
    """
    sorting, modes, sets = tile.sorting, tile.lists.modes, tile.lists.sets
    kind, classes, tried, works = sorting.kind, sorting.classes, sorting.tried, sorting.works
    candidates, k, curves = tile.candidates, tile.k, tile.model.curves
    begin = a * BROAD + first + g * SHORT
    _move_members(a, first, g, few, sets, works)
    for b in range(0, SHORT, lanes()):
        left = (1 << lanes()) - 1
        for n in range(count):
            if few.group_mode[a, g] != UNSURE and few.group_mode[a, g] != tried[n]:
                continue
            bits = stay_in(n, b, np.int64(1), sorting) & left
            for lane in range(lanes() if bits != 0 else 0):
                if modes[0, begin + b + lane] != tried[n]:
                    bits &= ~(1 << lane)
            own = join_class(tried[n], tried[n], how_many(bits), classes) if bits != 0 else UNSORTED
            if own == UNSORTED:
                continue
            left &= ~bits
            for lane in range(lanes()):
                if (bits >> lane) & 1 == 1:
                    kind[begin + b + lane] = own
        for lane in range(lanes() if left != 0 else 0):
            if (left >> lane) & 1 == 0:
                continue
            place = begin + b + lane
            old, new = modes_of(
                candidates.run[k, CODE], candidates.law[k], curves, NO_REST, candidates.step_time[s], modes[0, place],
                sorting.mode, works, b + lane, SURE,
            )  # fmt: skip
            kind[place] = join_class(old, new, 1, classes) if old != UNSURE else UNSORTED
            if old == UNSURE:
                sorting.places[near] = place
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
        for g in range(few.size[PART_COLUMNS] // SHORT):
            if whole and (few.sure[a] >> g) & 1 == 1:
                continue
            begin = a * BROAD + first + g * SHORT
            for b in range(begin, begin + SHORT):
                if whole:
                    sets[0, b] = fresh[b]
                else:
                    sets[1, b] = fresh[b]
                    fresh[b] = sets[0, b]
        if whole:
            _note_row(tile, a, first, few)
