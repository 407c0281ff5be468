"""A step in which some members of a part of a tile leave their mode, and others do not: sorted by what they do in it.

Members that stay in one mode do what is smooth in where their ends are, and it goes on smoothly over the members beside
them: it is computed for a few of the part, whatever these do themselves, and follows for those that stay. Members that
leave a mode for the same other one are followed together (`switching_together`), and the few that do anything else one
by one (`switching_prices.price_step`).
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.compiler.vector import WIDE
from mdstopo.general.model.priced_candidates import CODE, FIRST_STAGE, KIND, LAST_STAGE, MOVES, WHOLE
from mdstopo.general.pricing.certain_modes import BOUND_LEVELS, NARROW, UNSURE, modes_at_nodes
from mdstopo.general.pricing.loaded_members import add_states, take_members
from mdstopo.general.pricing.priced_tile import load_tile
from mdstopo.general.pricing.sorted_by_lines import sort_by_lines
from mdstopo.general.pricing.sorted_members import (
    CLASSES,
    COUNT,
    FROM,
    TO,
    UNSORTED,
    join_class,
    modes_of_all,
    sort_members,
    sort_places,
)
from mdstopo.general.pricing.switching_prices import ROW, price_step
from mdstopo.general.pricing.switching_together import SUM, TOGETHER, is_quick, price_switched
from mdstopo.mechanics.laws.law_table import law_is_idle, law_remembers
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    DONE,
    LEVEL,
    LEVELS,
    PRICED,
    SHORT,
    begin_part,
    found_prices,
    next_candidates,
    place_candidates,
    take_prices,
)

#: classes of as many members or fewer are computed member by member
ONE_BY_ONE = 96
#: the prices of a class in a step may be off by this part of what those of all listed steps together may be. It is not
#: divided by the number of steps, too: over many steps with classes more may add up
SHARE_OF_A_CLASS = 0.25
#: the class of members that have their prices
PAID = -2
#: the level of columns that are no part of a tile with bounds
NO_LEVEL = -1


@kernel
def price_part(tile, s, level, first, size, smooth, begun):
    """Price the members of some columns of a tile in a step.

    In:
      tile: a `priced_tile.PricedTile`, by a law whose members are followed. Of a law that remembers the modes behind
        the step are set, in row 0 behind a whole step, else in row 1, and the permanent sets behind it in `fresh`.
      s: the number of the step.
      level, first, size: of the part, its first column, and how many it has; NO_LEVEL: its members are looked at one by
        one.
      smooth: whether some members may be computed from others.
      begun: whether members of a law that remembers are in modes.

    Returns how many prices of steps were computed.
    """
    model, candidates, k, lists, sorting = tile.model, tile.candidates, tile.k, tile.lists, tile.sorting
    classes, places = sorting.classes, sorting.places
    code = candidates.run[k, CODE]
    load_tile(tile)
    classes[:] = 0
    if level != NO_LEVEL:
        _sort_part(tile, s, level, first)
    else:
        sorting.mode[:] = UNSURE
        known = law_remembers(code) and begun
        sort_members(model, candidates, k, s, first, size, tile.height, known, lists.modes[0], lists.sets[0], sorting)
    to = np.int64(0) if candidates.step[s, KIND] == WHOLE else np.int64(1)
    done = 0.0
    for c in range(CLASSES):
        if classes[c, COUNT] == 0:
            continue
        stays = classes[c, FROM] == classes[c, TO]
        idle = stays and law_is_idle(code, classes[c, FROM])
        if stays and smooth and classes[c, COUNT] > ONE_BY_ONE and not idle:
            done += _price_by_few(tile, s, level, first, c)
        if (idle or classes[c, COUNT] == 0) and not law_remembers(code):
            continue
        if stays or is_quick(code, candidates.law[k], model.curves):
            done += price_each(tile, s, first, size, c, to)
        else:
            for m in range(_list_places(tile, c, first, size)):
                sorting.kind[places[m]] = UNSORTED
    return done + follow_others(tile, s, first, size, begun, to)


@kernel
def _list_places(tile, c, first, size):
    """List the members of a class in some columns of a tile, row by row.

    tile: a `PricedTile`, whose `sorting.places` begin with the places of these members then.
    c: the class, or UNSORTED.
    first, size: the first column, and how many there are.

    Returns how many there are.
    """
    kind, row_class, places = tile.sorting.kind, tile.sorting.row_class, tile.sorting.places
    count = np.int64(0)
    for a in range(tile.height):
        if row_class[a] != UNSORTED and row_class[a] != c:
            continue
        for b in range(a * BROAD + first, a * BROAD + first + size):
            if kind[b] == c:
                places[count] = b
                count += 1
    return count


@kernel
def _sort_part(tile, s, level, first):
    """Sort the members of a part by a law that does not remember: where margins are the least of linear functions by
    bounds of each, else those of its halves, and so on, by bounds, and where these do not tell member by member.

    tile, s, level, first: as of `price_part`. The tile's sorting is filled.
    """
    model, candidates, k, lists, sorting = tile.model, tile.candidates, tile.k, tile.lists, tile.sorting
    height, unsorted = tile.height, sorting.unsorted
    if is_quick(candidates.run[k, CODE], candidates.law[k], model.curves):
        tried = sort_by_lines(model, candidates, k, s, level, first, height, tile.spans, sorting)
        if tried >= 0:
            count = _list_places(tile, np.int64(UNSORTED), first, BROAD >> level)
            sort_places(
                model, candidates, k, s, sorting.places, count, tried, np.bool_(False), lists.modes[0], lists.sets[0],
                sorting,
            )  # fmt: skip
            return
        sorting.classes[:] = 0
    begin = first // NARROW
    behind = begin + (BROAD >> level) // NARROW
    unsorted[begin:behind] = 1
    for inner in range(level, BOUND_LEVELS):
        size = BROAD >> inner
        for narrow in range(begin, behind, size // NARROW):
            if unsorted[narrow] == 0:
                continue
            at = narrow * NARROW
            modes_at_nodes(model, candidates, k, s, (1 << inner) - 1 + at // size, tile.spans, sorting.mode)
            old, new = modes_of_all(sorting.mode)
            if old == UNSURE and size > NARROW:
                continue
            unsorted[narrow : narrow + size // NARROW] = 0
            if old != UNSURE:
                own = join_class(old, new, height * size, sorting.classes)
                for a in range(height):
                    sorting.kind[a * BROAD + at : a * BROAD + at + size] = own
                continue
            sort_members(
                model, candidates, k, s, at, size, height, np.bool_(False), lists.modes[0], lists.sets[0], sorting
            )


@kernel
def _price_by_few(tile, s, level, first, c):
    """Price the members of a part that stay in a mode from those of few of the part.

    tile, s, level, first: as of `price_part`.
    c: the class. Members that have their prices are PAID then, and in no class.

    Returns how many prices were computed.
    """
    model, candidates, k, i, j = tile.model, tile.candidates, tile.k, tile.i, tile.j
    scratch, sorting, found = tile.scratch, tile.sorting, tile.lists.found
    plan, part_level, _, _, _, values, _ = scratch
    places, classes = sorting.places, sorting.classes
    step = candidates.step[s]
    mode = classes[c, FROM]
    found[1, 0] = 0.0
    begin_part(level, first, scratch)
    while next_candidates(tile.grids, i, j, scratch) and plan[LEVEL] < LEVELS:
        members = place_candidates(scratch, places)
        take_members(model, places, members, members)
        values[:members] = 0.0
        add_states(
            model, candidates, k, step[FIRST_STAGE], step[LAST_STAGE], members, mode, found[1, :1], tile.lists.works,
            tile.following, values,
        )  # fmt: skip
        take_prices(tile.grids, i, j, tile.error * SHARE_OF_A_CLASS, scratch, found[0])
    for m in range(_list_places(tile, c, first, BROAD >> level)):
        b = places[m]
        if part_level[b % BROAD // SHORT] == DONE:
            tile.price[b] += found[0, b]
            sorting.kind[b] = PAID
            classes[c, COUNT] -= 1
    return 1.0 * plan[PRICED]


@kernel
def price_each(tile, s, first, size, c, to):
    """Price the members of a class one by one, in vectors. Those for which that does not do are UNSORTED then.

    tile, s, first, size: as of `price_part`.
    c: the class.
    to: the row for modes behind the step.

    Returns how many prices were computed.
    """
    model, candidates, k, price, lists = tile.model, tile.candidates, tile.k, tile.price, tile.lists
    modes, sets, found, fresh = lists.modes, lists.sets, lists.found, lists.fresh
    kind, classes, places = tile.sorting.kind, tile.sorting.classes, tile.sorting.places
    switching = tile.switching
    values = found_prices(tile.scratch)
    step = candidates.step[s]
    old = classes[c, FROM]
    new = classes[c, TO]
    count = _list_places(tile, c, first, size)
    for m in range(count):
        fresh[places[m]] = sets[0, places[m]]
    if old != new:
        for at in range(0, count, TOGETHER):
            wide = min(TOGETHER, count - at)
            for m in range(wide):
                switching.sets[0, m] = sets[0, places[at + m]]
            take_members(model, places[at : at + wide], wide, np.int64(TOGETHER))
            price_switched(model, candidates, k, wide, s, old, new, switching)
            for m in range(wide):
                b = places[at + m]
                fresh[b] = switching.sets[1, m]
                if switching.found[SUM, m] == switching.found[SUM, m]:
                    price[b] += switching.found[SUM, m]
                    modes[to, b] = new
                else:
                    kind[b] = UNSORTED
        return 1.0 * count
    for m in range(count):
        modes[to, places[m]] = old
        found[1, m] = sets[0, places[m]]
    if count == 0 or step[MOVES] == 0 or law_is_idle(candidates.run[k, CODE], old):
        return 0.0
    behind = (count + WIDE - 1) // WIDE * WIDE
    take_members(model, places, count, behind)
    values[:behind] = 0.0
    kept = found[1, :count] if law_remembers(candidates.run[k, CODE]) else found[1, :1]
    add_states(
        model, candidates, k, step[FIRST_STAGE], step[LAST_STAGE], count, old, kept, lists.works, tile.following, values
    )
    for m in range(count):
        price[places[m]] += values[m]
    return 1.0 * count


@kernel
def follow_others(tile, s, first, size, begun, to):
    """Follow those members that are in no class.

    tile, s, first, size, begun: as of `price_part`.
    to: as of `price_each`.

    Returns how many these are.
    """
    model, candidates, k, price, following = tile.model, tile.candidates, tile.k, tile.price, tile.following
    modes, sets, fresh = tile.lists.modes, tile.lists.sets, tile.lists.fresh
    places = tile.sorting.places
    yes = np.bool_(True)
    values = np.zeros(ROW)
    count = _list_places(tile, np.int64(UNSORTED), first, size)
    for at in range(0, count, ROW):
        wide = min(ROW, count - at)
        take_members(model, places[at : at + wide], wide, np.int64(ROW))
        for m in range(wide):
            following.modes[0, m] = modes[0, places[at + m]]
            following.sets[0, m] = sets[0, places[at + m]]
        values[:] = 0.0
        price_step(
            model, candidates, k, np.int64(0), wide, s, following.modes[0], following.sets[0], begun, yes, following,
            values,
        )  # fmt: skip
        for m in range(wide):
            b = places[at + m]
            price[b] += values[m]
            if law_remembers(candidates.run[k, CODE]):
                modes[to, b] = following.modes[1, m]
                fresh[b] = following.sets[1, m]
    return 1.0 * count
