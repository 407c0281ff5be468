"""Members that a step finds in different modes, sorted by the one in which each begins and the one in which it ends.

What a member does in a step depends on which of them it is: one that stays in a mode is summed over stages, one that
leaves it for another over the pieces of both. Members of one class do what is as smooth in where their ends are as by a
law without modes, and it goes on smoothly over all members beside them (`switching_prices.price_switched`).

Which class a member is in is not told from others: each is looked at at the nodes of the step, as it is when it is
followed by itself (`switching_prices.price_step`).
"""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.vector import WIDE, lanes, larger, load, negative, zero
from mdstopo.general.design.followed_member import CLOSE_MARGIN, NODE_ROWS
from mdstopo.general.model.bundles import bundle
from mdstopo.general.model.general_model import MEMBER_FREE_LENGTH
from mdstopo.general.model.priced_candidates import CODE, FIRST_NODE, NODE, NODES
from mdstopo.general.pricing.certain_modes import NARROW, UNSURE
from mdstopo.general.pricing.loaded_members import take_members
from mdstopo.general.pricing.switching_prices import NO_REST, mode_at_start, range_of
from mdstopo.general.pricing.switching_together import is_quick
from mdstopo.mechanics.kinematics.kinematics_interface import ELONGATION, RATE, WORKS, member_works
from mdstopo.mechanics.laws.law_table import (
    law_first_set,
    law_makes_set,
    law_margin,
    law_margin_slopes,
    law_next,
    law_remembers,
    law_start,
)
from mdstopo.sensitivity.tile_interpolation import BROAD, PLACES, SHORT, TALL

#: classes of members of a part in a step, at most
CLASSES = 6
#: of each class: the mode in which its members begin, the one in which they end, and how many there are
CLASS_NUMBERS = 3
FROM, TO, COUNT = range(CLASS_NUMBERS)
#: the class of members that are in none
UNSORTED = -1
#: members that are sorted at once
SORTED_AT_ONCE = SHORT * TALL
#: modes in which members may stay that are tried, at most
TRIED = 4
#: corners of the range of elongations and rates of all members
CORNERS = 4
#: of a tangent of a margin, a linear function: its value where elongation and rate are zero, and its slopes by these
TANGENT_NUMBERS = 3
AT_ZERO, BY_ELONGATION, BY_RATE = range(TANGENT_NUMBERS)
#: vectors of members are sorted where margins are above this: rounding does not decide (m, m/s or a part)
SURE = 1e-11


#: the arrays of a `Sorting`
FIELDS = ("kind", "row_class", "classes", "places", "mode", "works", "unsorted", "tried", "tangent")


class Sorting:
    """What sorting a tile needs, inside kernels.

    kind (PLACES,): the class of each member. row_class (TALL,): the class that all members of a row are in, or UNSORTED
    where they may differ; UNSORTED outside `followed_by_few.follow_parts`, as `sorted_prices._list_places` relies on.
    classes (CLASSES, CLASS_NUMBERS): what is known of each. places (PLACES,): places of some members. mode (NODES,): of
    all members of a part at the nodes of a step. works (NODES, WORKS, SORTED_AT_ONCE): what members do there. unsorted:
    1 for each of the narrowest parts that is not sorted. tried (TRIED,), tangent: modes in which members may stay, and
    the tangents of their margins.
    """

    def __init__(self, *_arrays: Any) -> None: ...


bundle(Sorting, FIELDS)


@kernel
def make_sorting():
    """The arrays that sorting takes."""
    return Sorting(
        np.zeros(PLACES, np.int64),
        np.full(TALL, UNSORTED, np.int64),
        np.zeros((CLASSES, CLASS_NUMBERS), np.int64),
        np.zeros(PLACES, np.int64),
        np.zeros(NODES, np.int64),
        np.zeros((NODES, WORKS, SORTED_AT_ONCE)),
        np.zeros(BROAD // NARROW, np.int64),
        np.zeros(TRIED, np.int64),
        np.zeros((TRIED, CORNERS, TANGENT_NUMBERS)),
    )


@part
def try_mode(now, count, tried):
    """Add a mode to those that are tried, unless it is there or they are TRIED.

    now, count, tried (TRIED,): the mode, how many there are, and the modes.

    Returns how many there are then.
    """
    new = count < TRIED
    for n in range(count):
        new = new and tried[n] != now
    if not new:
        return count
    tried[count] = now
    return count + 1


@part
def least_margin(tangent, x, rate):
    """The margins of a vector of members in a mode: the least of the tangents.

    tangent (CORNERS, TANGENT_NUMBERS): of the mode.
    x, rate: elongations (m) and rates (m/s), vectors.
    """
    over = zero() - np.inf
    for corner in range(CORNERS):
        own = tangent[corner]
        value = own[BY_ELONGATION] * x + own[BY_RATE] * rate + own[AT_ZERO]
        over = larger(over, zero() - value)
    return zero() - over


@part
def join_class(old, new, count, classes):
    """Add members to the class of those that begin in one mode and end in another, which is made if there is none.

    In:
      old, new: the modes.
      count: how many members are added, 1 or more.
    In place:
      classes (CLASSES, CLASS_NUMBERS): of those that there are.

    Returns the number of the class; UNSORTED where there are too many classes.
    """
    for c in range(CLASSES):
        if classes[c, COUNT] == 0:
            classes[c, FROM] = old
            classes[c, TO] = new
        if classes[c, FROM] == old and classes[c, TO] == new:
            classes[c, COUNT] += count
            return c
    return UNSORTED


@part
def modes_of_all(mode):
    """The mode in which all members of a part begin a step, and the one in which they end it; UNSURE where members
    differ, and where there are more modes.

    mode (NODES,): of `certain_modes.modes_at_nodes`.
    """
    unsure = np.int64(UNSURE)
    now = mode[0]
    for m in range(NODES):
        if mode[m] == UNSURE or (mode[m] != now and now != mode[0]):
            return unsure, unsure
        now = mode[m]
    return mode[0], now


@kernel
def sort_members(model, candidates, k, s, first, size, height, known, begin, kept, sorting):
    """Sort the members of some columns of a tile.

    In:
      model: with the members of the tile (`load_all`).
      candidates, k: a `PricedCandidates`, and the number of the run.
      s: the number of the step.
      first, size, height: the first column, how many there are, SHORT at most, and how many rows.
      known: whether it is known in which modes they begin.
      begin, kept (PLACES,): these, and their permanent sets (m); of a law that does not remember, zeros.
    In place:
      sorting: a `Sorting`: with the modes of all members at nodes, UNSURE where the members are to be looked at,
        who are overwritten there; classes of the members are set, and added to those that there are.
    """
    kind, classes, mode, works, tried = sorting.kind, sorting.classes, sorting.mode, sorting.works, sorting.tried
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    lo = PLACES + first * TALL
    free = model.member[MEMBER_FREE_LENGTH]
    for m in range(NODES):
        if mode[m] == UNSURE:
            o = candidates.step[s, FIRST_NODE] + m
            member_works(model, lo, size * TALL, candidates.node_pose[o], candidates.node_change[o], works[m])
            if law_remembers(code):
                for i in range(size * TALL):
                    works[m, ELONGATION, i] -= kept[place_in_columns(first, i)]
    count = np.int64(0)
    if is_quick(code, p, model.curves) and (known or not law_remembers(code)):
        count = _fill_tried(code, p, model.curves, candidates.step_time[s, 0], first, size, known, begin, sorting)
    for i in range(0, size * TALL, lanes()):
        # a bit for each lane
        left = (1 << max(min(height - i % TALL, lanes()), 0)) - 1
        for n in range(count):
            bits = stay_in(n, i, np.int64(0), sorting) & left
            for lane in range(lanes() if bits != 0 else 0):
                at = place_in_columns(first, i + lane)
                if (bits >> lane) & 1 == 1 and (not known or begin[at] == tried[n]):
                    own = join_class(tried[n], tried[n], 1, classes)
                    kind[at] = own
                    left &= ~(1 << lane)
        for lane in range(lanes() if left != 0 else 0):
            if (left >> lane) & 1 == 1:
                at = place_in_columns(first, i + lane)
                old = begin[at] if known else np.int64(UNSURE)
                old, new = modes_of(
                    code, p, model.curves, free[lo + i + lane], candidates.step_time[s], old, mode, works, i + lane,
                    0.0,
                )  # fmt: skip
                kind[at] = join_class(old, new, 1, classes) if old != UNSURE else UNSORTED


@kernel
def sort_places(model, candidates, k, s, places, count, modes, known, begin, kept, sorting):
    """Sort some members of a tile by a law of which `is_quick`.

    In:
      model: with the members of the tile (`load_all`).
      candidates, k, s: as of `sort_members`.
      places (count or more,), count: which members, and how many.
      modes: how many modes in which members may stay are tried, of a law that does not remember; else 0.
      known, begin, kept: as of `sort_members`.
    In place:
      sorting: a `Sorting`, with these modes and the tangents of their margins in a range that all members are in;
        classes of the members are set, and added to those that there are.
    """
    kind, classes, mode, works, tried = sorting.kind, sorting.classes, sorting.mode, sorting.works, sorting.tried
    p = candidates.law[k]
    code = candidates.run[k, CODE]
    free = model.member[MEMBER_FREE_LENGTH]
    inside = np.zeros((TRIED, NODES), np.int64)
    outside = np.zeros((TRIED, NODES), np.int64)
    node = np.empty((NODE_ROWS, NODES))
    mode[:] = UNSURE
    for at in range(0, count, SORTED_AT_ONCE):
        wide = min(SORTED_AT_ONCE, count - at)
        take_members(model, places[at : at + wide], wide, (wide + WIDE - 1) // WIDE * WIDE)
        for m in range(NODES):
            o = candidates.step[s, FIRST_NODE] + m
            member_works(model, np.int64(0), wide, candidates.node_pose[o], candidates.node_change[o], works[m])
            if law_remembers(code):
                for i in range(wide):
                    works[m, ELONGATION, i] -= kept[places[at + i]]
        for i in range(0, wide, lanes()):
            left = (1 << min(wide - i, lanes())) - 1
            _fill_masks(modes, i, sorting, inside, outside)
            if modes > 0:
                _begin_unclear(model, candidates, k, s, i, left, modes, sorting, inside, node)
            for old in range(modes):
                for new in range(modes):
                    bits = _that_go(inside[old], outside[old], inside[new], old == new) & left
                    if bits == 0:
                        continue
                    left &= ~bits
                    own = join_class(tried[old], tried[new], how_many(bits), classes)
                    for lane in range(lanes()):
                        if (bits >> lane) & 1 == 1:
                            kind[places[at + i + lane]] = own
            for lane in range(lanes() if left != 0 else 0):
                if (left >> lane) & 1 == 1:
                    place = places[at + i + lane]
                    old = begin[place] if known else np.int64(UNSURE)
                    old, new = modes_of(
                        code, p, model.curves, free[i + lane], candidates.step_time[s], old, mode, works, i + lane,
                        0.0,
                    )  # fmt: skip
                    kind[place] = join_class(old, new, 1, classes) if old != UNSURE else UNSORTED


@part
def _fill_masks(modes, i, sorting, inside, outside):
    """Which members of a vector of them are in a mode at a node, and which are out of it, a bit for each.

    In:
      modes, i: how many modes are tried, and the first member.
      sorting: a `Sorting`.
    Out:
      inside, outside (TRIED, NODES): set; neither where rounding may decide.
    """
    works, tangent = sorting.works, sorting.tangent
    for m in range(NODES):
        x = load(works[m, ELONGATION], i)
        rate = load(works[m, RATE], i)
        for n in range(modes):
            margin = least_margin(tangent[n], x, rate)
            inside[n, m] = ~negative(margin - (CLOSE_MARGIN if m == 0 else SURE))
            outside[n, m] = negative(margin + SURE)


@part
def _begin_unclear(model, candidates, k, s, i, left, modes, sorting, inside, node):
    """Find the modes of those members of a vector that begin a step near a switch, as all do whose curve has a knot at
    the elongation with which the motion begins: their second derivatives decide.

    In:
      model: with the members, from the first place on.
      candidates, k, s: as of `sort_members`.
      i, left: the first member, and a bit for each that there is.
      modes: how many modes are tried.
      sorting: a `Sorting`, with these and what the members do at nodes.
    In place:
      inside (TRIED, NODES): of `_fill_masks`; a bit is added at the first node for the mode of each of these members.
      node (NODE_ROWS, NODES): scratch.
    """
    works, tried = sorting.works, sorting.tried
    for n in range(modes):
        left &= ~inside[n, 0]
    for lane in range(lanes() if left != 0 else 0):
        if (left >> lane) & 1 == 0:
            continue
        node[ELONGATION, 0] = works[0, ELONGATION, i + lane]
        node[RATE, 0] = works[0, RATE, i + lane]
        now = mode_at_start(model, candidates, k, i + lane, s, node)
        for n in range(modes):
            if tried[n] == now:
                inside[n, 0] |= 1 << lane


@part
def _that_go(inside, outside, other, alike):
    """A bit for each member that begins in a mode and ends in another, without a third one between.

    inside, outside (NODES,): of the mode in which they begin, of `_fill_masks`; other (NODES,): of the one in which
    they end, `inside`. alike: whether this is the same one.
    """
    found = np.int64(0)
    before = inside[0]
    if alike:
        for m in range(1, NODES):
            before &= inside[m]
        return before
    for m in range(1, NODES):
        behind = before & outside[m]
        for n in range(m, NODES):
            behind &= other[n]
        found |= behind
        before &= inside[m]
    return found


@part
def how_many(bits):
    """How many bits of a vector's lanes are set."""
    count = np.int64(0)
    for lane in range(lanes()):
        count += (bits >> lane) & 1
    return count


@part
def place_in_columns(first, i):
    """The place in the tile of member i of columns from the first one on."""
    return i % TALL * BROAD + first + i // TALL


@part
def _fill_tried(code, p, curves, t, first, size, known, begin, sorting):
    """Modes in which some members may stay, and tangents of their margins at the corners of the range of elongations
    and rates of all members.

    Within the range a margin is the least of its tangents at the corners, being the lesser of two linear functions.

    code, p (8,), curves, t: the law, numbers of all laws, and any time (s), on which the law does not depend.
    first, size, known, begin: as of `sort_members`.
    sorting: a `Sorting`, with what the members do; the modes and the tangents are set.

    Returns how many modes there are; 0 where bounds tell the modes at all nodes, so that no range is known.
    """
    mode, works, tried, tangent = sorting.mode, sorting.works, sorting.tried, sorting.tangent
    box = np.array([np.inf, -np.inf, np.inf, -np.inf])
    for m in range(NODES):
        if mode[m] == UNSURE:
            for row in range(2):
                low, high = range_of(works[m, ELONGATION if row == 0 else RATE], size * TALL)
                box[2 * row] = min(box[2 * row], low)
                box[2 * row + 1] = max(box[2 * row + 1], high)
    count = np.int64(0)
    if box[0] > box[1]:
        return count
    for i in range(size * TALL if known else CORNERS):
        if known:
            now = begin[place_in_columns(first, i)]
        else:
            now = np.int64(law_start(code, p, box[i // 2], box[2 + i % 2], 0.0, t, curves, NO_REST))
        count = try_mode(now, count, tried)
    fill_tangents(code, p, curves, t, box, count, tried, tangent)
    return count


@part
def fill_tangents(code, p, curves, t, box, count, tried, tangent):
    """Tangents of the margins of modes at the corners of a range of elongations and rates.

    In:
      code, p (8,), curves, t: as of `_fill_tried`.
      box (4,): the least and the largest elongation (m), and the least and the largest rate (m/s).
      count, tried (count or more,): the modes.
    Out:
      tangent (count or more, CORNERS, TANGENT_NUMBERS): set.
    """
    for n in range(count):
        for corner in range(CORNERS):
            x = box[corner // 2]
            rate = box[2 + corner % 2]
            by_x, by_rate = law_margin_slopes(code, p, x, rate, tried[n], t, curves, NO_REST)
            tangent[n, corner, AT_ZERO] = (
                law_margin(code, p, x, rate, tried[n], t, curves, NO_REST) - by_x * x - by_rate * rate
            )
            tangent[n, corner, BY_ELONGATION] = by_x
            tangent[n, corner, BY_RATE] = by_rate


@part
def stay_in(n, i, begin, sorting):
    """A bit for each member of a vector of them that stays in a mode.

    n, i: the number of the mode among those that were filled, and of the first member.
    begin: the first node that is looked at: 1 where it is known that members begin in the mode, else 0.
    sorting: a `Sorting`.
    """
    mode, works, tried, tangent = sorting.mode, sorting.works, sorting.tried, sorting.tangent
    own = tangent[n]
    bits = (1 << lanes()) - 1
    for m in range(begin, NODES):
        if mode[m] != UNSURE:
            bits = bits if mode[m] == tried[n] else 0
            continue
        x = load(works[m, ELONGATION], i)
        rate = load(works[m, RATE], i)
        bits &= ~negative(least_margin(own, x, rate) - (CLOSE_MARGIN if m == 0 else SURE))
    return bits


@part
def modes_of(code, p, curves, rest, time, old, mode, works, i, sure):
    """The mode in which a member begins a step, and the one in which it ends it; UNSURE where there are more, or
    where values at nodes do not tell.

    code, p (8,), curves, rest: the law, numbers of all laws, and the member's free length (m).
    time (2,): start and length of the step (s).
    old: the mode with which it begins, or UNSURE where it is to be found.
    mode (NODES,): of all members at the nodes, or UNSURE.
    works (NODES, WORKS, SORTED_AT_ONCE), i: what members do at the nodes where that is so, less their sets, and which
      one it is.
    sure: margins at nodes that are nearer to zero than this do not tell (m, m/s or a part).
    """
    unsure = np.int64(UNSURE)
    if old == UNSURE:
        old = mode[0]
    if old == UNSURE:
        x = works[0, ELONGATION, i]
        rate = works[0, RATE, i]
        old = np.int64(law_start(code, p, x, rate, 0.0, time[0], curves, rest))
        is_clear = law_margin(code, p, x, rate, old, time[0], curves, rest) > CLOSE_MARGIN
        if not is_clear or law_first_set(code, p, x, old) != 0.0:
            return unsure, unsure
    now = old
    for m in range(1, NODES):
        if mode[m] == now:
            continue
        new = mode[m]
        if new == UNSURE:
            x = works[m, ELONGATION, i]
            rate = works[m, RATE, i]
            t = time[0] + NODE[m] * time[1]
            margin = law_margin(code, p, x, rate, now, t, curves, rest)
            if margin >= sure:
                continue
            if margin > -sure:
                return unsure, unsure
            if law_remembers(code):
                new = np.int64(law_next(code, p, x, rate, 0.0, now, t, curves, rest))
            else:
                new = np.int64(law_start(code, p, x, rate, 0.0, t, curves, rest))
            if law_makes_set(code, now, new) and now == old:
                return old, new  # `switching_together` looks at what is behind
            if new == now or not law_margin(code, p, x, rate, new, t, curves, rest) >= sure:
                return unsure, unsure
        if now != old:
            return unsure, unsure
        now = new
    return old, now
