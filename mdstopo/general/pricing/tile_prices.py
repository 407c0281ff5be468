"""The prices of a tile's members by a law with modes, most of them from those of a few.

A price is a sum over steps. In a step in which bounds show that all members of a part of the tile stay in one mode
(`certain_modes`), or all leave it for the same other one, what they do is as smooth in where their ends are as by a
law without modes: it is computed for a few members, and follows for the others (`sensitivity.tile_interpolation`).
In other steps members are sorted by what they do (`sorted_prices`): those of the whole tile, or of the largest parts
whose points are evenly spread, where a law does not remember; else of the smallest parts, after all larger ones.

Where a law remembers, steps are gone through in the order of time, with the mode and the permanent set that each member
has. Once the sets differ, what the members of a part do is a polynomial of the second degree in their sets, too.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.model.priced_candidates import (
    CODE,
    FIRST_STEP,
    KIND,
    LAST_STEP,
    MOVES,
    POINT,
    SCENE,
    TOGETHER_LEVELS,
    WHOLE,
)
from mdstopo.general.pricing.certain_modes import LEAVES, UNSURE, fill_spans, modes_at_nodes, modes_in_step
from mdstopo.general.pricing.followed_by_few import follow_parts, goes_by_few
from mdstopo.general.pricing.loaded_members import add_states, load_members, steps_together
from mdstopo.general.pricing.priced_tile import (
    LEAST,
    LISTED_PARTS,
    LOADED,
    MOST,
    SAME,
    SETS,
    add_points,
    begin_pricing,
    load_tile,
    set_share,
)
from mdstopo.general.pricing.sorted_members import modes_of_all
from mdstopo.general.pricing.sorted_prices import NO_LEVEL, price_part
from mdstopo.general.pricing.switching_prices import ROW, price_step
from mdstopo.mechanics.laws.law_table import law_is_idle, law_remembers
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    LEVELS,
    PARTS,
    PRICED,
    SHORT,
    TALL,
    begin_part,
    found_prices,
    next_candidates,
    number_candidates,
    take_prices,
)


@kernel
def price_run(model, candidates, k, place, scratch, lists, price):
    """Add what the members of a tile do by one law with modes.

    In:
      model: with room for ROOM members, which are overwritten.
      candidates, k: a `PricedCandidates`, and the number of the run.
      place: the tile's grids, i, j and error, as of `tile_interpolation.take_prices`.
    In place:
      price (PLACES,): of its candidates.
    Scratch:
      scratch: of `tile_interpolation.make_scratch`.
      lists: of `priced_tile.make_lists`.

    Returns how many prices were computed, of steps as parts of one.
    """
    run = candidates.run[k]
    tile = begin_pricing(model, candidates, k, place, scratch, lists, price)
    for n in range(candidates.curves.shape[1]):
        model.curves[n] = candidates.curves[run[SCENE], n]
    fill_spans(candidates, k, tile.i, tile.j, tile.spans)
    remembers = law_remembers(run[CODE])
    steps = run[LAST_STEP] - run[FIRST_STEP]
    begun = np.bool_(False)
    # where members that remember are at a state alone: behind a part of a step, or behind the last step
    ends = np.int64(0)
    done = 0.0
    if goes_by_few(model, candidates, k):
        done += follow_parts(tile, lists.left)
    others = _is_to_do(lists.left, tile.width)
    for u in range(steps if others else 0):
        kind = candidates.step[run[FIRST_STEP] + u, KIND]
        if not remembers and candidates.step[run[FIRST_STEP] + u, MOVES] == 0:
            continue
        if not remembers and kind != POINT:
            done += _price_sorted(tile, u)
            continue
        done += _price_next(tile, u, begun, ends)
        if kind != POINT:
            ends = np.int64(kind != WHOLE)
            begun = begun or ends == 0
    for part in range(LISTED_PARTS):
        done += _price_list(tile, part)
    return done / max(steps, 1)


@kernel
def _price_next(tile, u, begun, ends):
    """Go through a step: list it for the parts of which enough is known, and follow all other members.

    tile: a `PricedTile`.
    u: the step, as of `certain_modes.modes_in_step`.
    begun: whether members are in modes.
    ends: 1 where the last step was a part of one, and those of states alone are in `modes[1]`; else 0.

    Returns how many prices of steps were computed now; those of listed steps come later.
    """
    model, candidates, k, lists, width = tile.model, tile.candidates, tile.k, tile.lists, tile.width
    run = candidates.run[k]
    remembers = law_remembers(run[CODE])
    shared, todo, smooth = lists.shared, lists.todo, tile.grids[3]
    kind = candidates.step[run[FIRST_STEP] + u, KIND]
    counts = candidates.step[run[FIRST_STEP] + u, MOVES] != 0
    todo[:PARTS] = lists.left
    changed = False
    done = 0.0
    level = np.int64(0)
    while level < LEVELS and not (remembers and kind == POINT):
        size = BROAD >> level
        for at in range(1 << level):
            smallest = at * (size // SHORT)
            if (at + 1) * size > width or not _are_to_do(todo, smallest, size // SHORT):
                continue
            part = (1 << level) - 1 + at
            mode = np.int64(-1)
            if remembers and begun:
                mode = np.int64(shared[part, SAME])
                if mode < 0:
                    continue
            known, after = modes_in_step(
                model, candidates, k, u, part, mode, shared[part, LEAST], shared[part, MOST], tile.spans
            )
            if known == UNSURE:
                continue
            idle = known >= 0 and law_is_idle(run[CODE], known)
            if not idle and smooth[level, tile.j * PARTS + smallest] == 0:
                continue
            todo[smallest : smallest + size // SHORT] = 0
            if counts and not idle:
                _list_step(lists, part, u, known)
            if remembers and (kind != WHOLE or not begun or known < 0):
                _enter(lists.modes[0 if kind == WHOLE else 1], at * size, size, after)
                if kind != WHOLE:
                    _copy_sets(lists.sets, at * size, size)
                changed = changed or kind == WHOLE
        level += 1
    for smallest in range(PARTS):
        if todo[smallest] != 0 and smallest * SHORT < width:
            done += _follow_each(tile, u, begun, ends, smallest)
            changed = changed or (remembers and kind == WHOLE)
    if changed:
        _share(lists.modes[0], lists.sets[0], tile.height, shared)
    return done


@kernel
def _is_to_do(left, width):
    """Whether members of a tile of so many columns are gone through step by step; left (PARTS,): 1 for such parts."""
    found = False
    for smallest in range(PARTS):
        found = found or (left[smallest] != 0 and smallest * SHORT < width)
    return found


@kernel
def _are_to_do(todo, smallest, count):
    """Whether as many of the smallest parts as `count` are to do, from one on; todo (PARTS or more,): 1 for each."""
    found = True
    for c in range(smallest, smallest + count):
        found = found and todo[c] != 0
    return found


@kernel
def _list_step(lists, part, u, known):
    """List a step for a part, to be priced later; lists: a `StepLists`. known: what is known of its modes."""
    n = lists.count[part]
    lists.step[part, n] = u
    lists.told[part, n] = known
    lists.count[part] = n + 1


@kernel
def _price_sorted(tile, u):
    """Go through a step by a law that does not remember: list it for the parts of which all members stay in a mode, and
    price other parts by what their members do.

    tile: a `PricedTile`.
    u: the step, by its number among those of the run.

    Returns how many prices of steps were computed.
    """
    model, candidates, k, todo, width = tile.model, tile.candidates, tile.k, tile.lists.todo, tile.width
    mode, are_smooth = tile.sorting.mode, tile.grids[3]
    s = candidates.run[k, FIRST_STEP] + u
    todo[:LOADED] = 1
    yes = np.bool_(True)
    no = np.bool_(False)
    done = 0.0
    for level in range(LEVELS):
        size = BROAD >> level
        for at in range(1 << level):
            smallest = at * (size // SHORT)
            if (at + 1) * size > width or todo[smallest] == 0 or are_smooth[level, tile.j * PARTS + smallest] == 0:
                continue
            part = (1 << level) - 1 + at
            todo[smallest : smallest + size // SHORT] = 0
            modes_at_nodes(model, candidates, k, s, part, tile.spans, mode)
            old, new = modes_of_all(mode)
            if old == UNSURE or old != new:
                done += price_part(tile, s, level, at * size, size, yes, no)
            elif not law_is_idle(candidates.run[k, CODE], old):
                _list_step(tile.lists, part, u, old)
    for smallest in range(PARTS):
        first = smallest * SHORT
        last = min(first + SHORT, width)
        if todo[smallest] != 0 and first < width:
            level = np.int64(LEVELS - 1 if last - first == SHORT else NO_LEVEL)
            done += price_part(tile, s, level, first, last - first, no, no)
    return done


@kernel
def _enter(modes, first, size, mode):
    """Write the mode of the members of so many columns from one on; modes (PLACES,): of all."""
    for a in range(TALL):
        for b in range(first, first + size):
            modes[a * BROAD + b] = mode


@kernel
def _copy_sets(sets, first, size):
    """Of so many columns from one on: a part of a step that makes no set ends with those with which it begins."""
    for a in range(TALL):
        for b in range(first, first + size):
            sets[1, a * BROAD + b] = sets[0, a * BROAD + b]


@kernel
def _share(modes, sets, height, shared):
    """What the members of each part have in common.

    In:
      modes, sets (PLACES,): of all.
      height: rows of the tile.
    Out:
      shared (LISTED_PARTS, SHARED): set.
    """
    first = PARTS - 1
    for c in range(PARTS):
        mode = modes[c * SHORT]
        low = sets[c * SHORT]
        high = low
        for a in range(height):
            for b in range(c * SHORT, (c + 1) * SHORT):
                at = a * BROAD + b
                low = min(low, sets[at])
                high = max(high, sets[at])
                if modes[at] != mode:
                    mode = np.int64(UNSURE)
        shared[first + c, SAME] = mode
        shared[first + c, LEAST] = low
        shared[first + c, MOST] = high
    for part in range(first - 1, -1, -1):
        one = shared[2 * part + 1]
        other = shared[2 * part + 2]
        shared[part, SAME] = one[SAME] if one[SAME] == other[SAME] else UNSURE
        shared[part, LEAST] = min(one[LEAST], other[LEAST])
        shared[part, MOST] = max(one[MOST], other[MOST])


@kernel
def _follow_each(tile, u, begun, ends, smallest):
    """Follow the members of one of the smallest parts through a step.

    Where permanent sets become others, what is listed is priced first, with those that were.

    tile, u, begun, ends: as of `_price_next`.
    smallest: the number of the part among those of its level.

    Returns how many prices of steps were computed now, those of listed steps among them.
    """
    candidates, k, lists, height = tile.candidates, tile.k, tile.lists, tile.height
    sets, fresh = lists.sets, lists.fresh
    run = candidates.run[k]
    load_tile(tile)
    first = smallest * SHORT
    wide = min(SHORT, tile.width - first)
    s = run[FIRST_STEP] + u
    kind = candidates.step[s, KIND]
    if kind == POINT:
        add_points(tile, s, first, wide, begun or ends != 0, ends)
        return 1.0 * height * wide
    no = np.bool_(False)
    followed = price_part(tile, s, np.int64(NO_LEVEL), first, wide, no, begun)
    changed = False
    for a in range(height):
        for b in range(a * BROAD + first, a * BROAD + first + wide):
            changed = changed or fresh[b] != sets[0, b]
    if changed and kind == WHOLE and wide == SHORT:
        for level in range(LEVELS):
            part = (1 << level) - 1 + first // (BROAD >> level)
            followed += _price_list(tile, part)
    to = np.int64(0) if kind == WHOLE else np.int64(1)
    for a in range(height):
        for b in range(a * BROAD + first, a * BROAD + first + wide):
            sets[to, b] = fresh[b]
    return followed


@kernel
def _price_list(tile, part):
    """Price the steps that are listed for a part, which has none in its list then.

    tile: a `PricedTile`.
    part: its number.

    Returns how many prices of steps were computed.
    """
    i, j, scratch, lists, price = tile.i, tile.j, tile.scratch, tile.lists, tile.price
    shared, sets, found = lists.shared, lists.sets, lists.found
    plan, _, _, _, index, values, _ = scratch
    steps = lists.count[part]
    if steps == 0:
        return 0.0
    level = np.int64(0)
    while (2 << level) - 1 <= part:
        level += 1
    size = BROAD >> level
    first = (part - ((1 << level) - 1)) * size
    low = shared[part, LEAST]
    high = shared[part, MOST]
    done = 0.0
    for n in range(1 if low == high else SETS):
        begin_part(level, first, scratch)
        while next_candidates(tile.grids, i, j, scratch):
            members = number_candidates(i, j, scratch)
            load_members(tile.model, tile.candidates, tile.k, index, members, np.int64(0))
            values[:members] = 0.0
            _add_listed(tile, part, low + 0.5 * n * (high - low), members)
            take_prices(tile.grids, i, j, tile.error, scratch, found[n])
        done += plan[PRICED]
    for a in range(tile.height):
        for at in range(a * BROAD + first, a * BROAD + first + size):
            if high == low:
                price[at] += found[0, at]
                continue
            t = 2.0 * (sets[0, at] - low) / (high - low) - 1.0
            for n in range(SETS):
                price[at] += set_share(n, t) * found[n, at]
    lists.count[part] = 0
    return done * steps


@kernel
def _add_listed(tile, part, kept, members):
    """Add what some members do in the steps that are listed for a part to `found` of the tile's scratch.

    tile: a `PricedTile`, with the members in its model.
    part: its number.
    kept: the permanent set of the members (m).
    members: how many there are.
    """
    model, candidates, k, lists, following = tile.model, tile.candidates, tile.k, tile.lists, tile.following
    values = found_prices(tile.scratch)
    run = candidates.run[k]
    yes = np.bool_(True)
    n = np.int64(0)
    while n < lists.count[part]:
        known = lists.told[part, n]
        s = run[FIRST_STEP] + lists.step[part, n]
        alike = _alike_behind(lists, part, n)
        n += 1
        if known <= LEAVES:
            following.modes[0] = LEAVES - known
            following.sets[0] = kept
            for at in range(0, members, ROW):
                wide = min(ROW, members - at)
                price_step(
                    model, candidates, k, at, wide, s, following.modes[0], following.sets[0], yes, yes, following,
                    values[at : at + wide],
                )  # fmt: skip
            continue
        taken, o, behind = steps_together(model, candidates, s, alike, np.int64(0), members, lists.works)
        n += taken - 1
        following.sets[0, 0] = kept
        add_states(
            model, candidates, k, o, behind, members, known, following.sets[0, :1], lists.works, following, values
        )


@kernel
def _alike_behind(lists, part, n):
    """How many steps that are listed for a part, from the one at place n on, are behind each other and have the same
    told of them; as many as may have states together at most.

    lists: a `StepLists`.
    """
    count = np.int64(1)
    while (
        count < 1 << (TOGETHER_LEVELS - 1)
        and n + count < lists.count[part]
        and lists.step[part, n + count] == lists.step[part, n] + count
        and lists.told[part, n + count] == lists.told[part, n]
    ):
        count += 1
    return count
