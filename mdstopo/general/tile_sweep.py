"""The prices of a tile's members by a law with modes, most of them from those of a few.

A price is a sum over steps. In a step in which bounds show that all members of a part of the tile stay in one mode
(`certain_modes`), or all leave it for the same other one, what they do is as smooth in where their ends are as by a
law without modes: it is computed for a few members, and follows for the others (`sensitivity.tile_interpolation`).
That is tried with the whole tile, then with its halves, down to the smallest parts; in the steps that are left members
are followed one by one.

Where a law remembers, steps are gone through in the order of time, with the mode and the permanent set that each member
has. Once the sets differ, what the members of a part do is a polynomial of the second degree in their sets, too.
"""

import numpy as np

from mdstopo.compiler.jit import kernel
from mdstopo.general.certain_modes import LEAVES, PARTS_OF_ALL, UNSURE, fill_spans, make_spans, modes_in_step
from mdstopo.general.general_model import MEMBER_EXCESS, MEMBER_FREE_LENGTH
from mdstopo.general.priced_candidates import (
    CODE,
    FIRST_STAGE,
    FIRST_STATE,
    FIRST_STEP,
    FOLLOWED,
    FROM_START,
    KIND,
    LAST_STAGE,
    LAST_STATE,
    LAST_STEP,
    MODES,
    MOVES,
    PIECES,
    POINT,
    SCENE,
    WHOLE,
)
from mdstopo.general.switching_prices import (
    ROW,
    add_in_mode,
    add_polynomial,
    make_following,
    price_point,
    price_step,
)
from mdstopo.mechanics.kinematics.kinematics_interface import ELONGATION, WORKS, member_works
from mdstopo.mechanics.laws.law_table import law_degree, law_is_idle, law_remembers
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    LEVELS,
    PARTS,
    PLACES,
    PRICED,
    SHORT,
    TALL,
    begin_part,
    extent,
    next_candidates,
    number_candidates,
    take_prices,
)

#: of each part: the mode that all its members are in, UNSURE where they differ; their least and largest permanent sets
SHARED = 3
SAME, LEAST, MOST = range(SHARED)
#: sets at which a part whose members differ in these is priced
SETS = 3
#: place behind those of the smallest parts: whether all members of the tile are in the model
LOADED = PARTS


@kernel
def load_members(model, candidates, k, index, count, at):
    """Put some members into the model.

    In:
      candidates, k: a `PricedCandidates`, and the number of the run.
      index (2, count or more): numbers of their points.
      count, at: how many there are, and where they go.
    Out:
      model: its members, and the numbers of its laws.
    """
    axes = candidates.first.shape[1]
    scene = candidates.run[k, SCENE]
    rest = candidates.rest[k]
    for d in range(axes):
        for i in range(count):
            model.member[d, at + i] = candidates.first[scene, d, index[0, i]]
            model.member[axes + d, at + i] = candidates.second[scene, d, index[1, i]]
    for i in range(candidates.curves.shape[1]):
        model.curves[i] = candidates.curves[scene, i]
    for i in range(count):
        home = 0.0
        stated = 0.0
        for d in range(axes):
            home += (candidates.second_home[scene, d, index[1, i]] - candidates.first_home[scene, d, index[0, i]]) ** 2
            apart = candidates.second_stated[scene, d, index[1, i]] - candidates.first_stated[scene, d, index[0, i]]
            stated += apart * apart
        start = np.sqrt(home)
        free = np.sqrt(stated) if rest < 0.0 else rest
        model.member[MEMBER_FREE_LENGTH, at + i] = free
        model.member[MEMBER_EXCESS, at + i] = (start - free) * (start + free)


@kernel
def make_lists(candidates):
    """What `price_run` needs of its own, for all runs of some candidates.

    Returns numbers of steps, and what is known of each, by parts; how many these are; SHARED of parts; modes and
    permanent sets, and behind a part of a step; which of the smallest parts are not listed, and whether members are
    loaded; prices; what members of a step end with; all places of a tile; what members do at a state.
    """
    most = candidates.step.shape[0] + candidates.pose.shape[0] + 1
    return (
        np.zeros((PARTS_OF_ALL, most), np.int64),
        np.zeros((PARTS_OF_ALL, most), np.int64),
        np.zeros(PARTS_OF_ALL, np.int64),
        np.zeros((PARTS_OF_ALL, SHARED)),
        np.zeros((2, PLACES), np.int64),
        np.zeros((2, PLACES)),
        np.zeros(PARTS + 1, np.int64),
        np.zeros((SETS, PLACES)),
        np.zeros(PLACES),
        np.zeros((2, PLACES), np.int64),
        np.zeros((WORKS, PLACES)),
    )


@kernel
def price_run(model, candidates, k, tile, scratch, lists, price):
    """Add what the members of a tile do by one law with modes.

    In:
      model: with room for 2 PLACES members, which are overwritten.
      candidates, k: a `PricedCandidates`, and the number of the run.
      tile: grids, i, j and error as of `tile_interpolation.take_prices`.
    In place:
      price (PLACES,): of its candidates.
    Scratch:
      scratch: of `tile_interpolation.make_scratch`.
      lists: of `make_lists`.

    Returns how many prices were computed, of steps as parts of one.
    """
    run = candidates.run[k]
    spans = make_spans(candidates.first.shape[1])
    buffers = (scratch, lists, spans, make_following())
    _, i, j, _ = tile
    _, _, count, shared, modes, sets, todo, _, _, _, _ = lists
    for n in range(candidates.curves.shape[1]):
        model.curves[n] = candidates.curves[run[SCENE], n]
    fill_spans(candidates, k, i, j, spans)
    count[:] = 0
    modes[:] = 0
    sets[:] = 0.0
    shared[:] = 0.0
    todo[LOADED] = 0
    followed = run[MODES] == FOLLOWED
    steps = run[LAST_STEP] - run[FIRST_STEP] if followed else run[LAST_STATE] - run[FIRST_STATE]
    begun = run[FROM_START] == 0
    # where members that remember are at a state alone: behind a part of a step, or behind the last step
    ends = np.int64(0)
    done = 0.0
    for u in range(steps):
        if followed and not law_remembers(run[CODE]) and candidates.step[run[FIRST_STEP] + u, MOVES] == 0:
            continue
        done += _price_next(model, candidates, k, u, begun, ends, tile, buffers, price)
        if followed and candidates.step[run[FIRST_STEP] + u, KIND] != POINT:
            ends = np.int64(candidates.step[run[FIRST_STEP] + u, KIND] != WHOLE)
            begun = begun or ends == 0
    for part in range(PARTS_OF_ALL):
        done += _price_list(model, candidates, k, part, tile, buffers, price)
    return done / max(steps, 1)


@kernel
def _price_next(model, candidates, k, u, begun, ends, tile, buffers, price):
    """Go through a step: list it for the parts of which enough is known, and follow all other members.

    In:
      model, candidates, k, tile: as of `price_run`.
      u: the step, as of `certain_modes.modes_in_step`.
      begun: whether members are in modes.
      ends: 1 where the last step was a part of one, and those of states alone are in `modes[1]`; else 0.
    In place:
      buffers: of `make_scratch`, `make_lists`, `make_spans` and `make_following`, of which the lists matter.
      price (PLACES,): added to.

    Returns how many members were followed.
    """
    run = candidates.run[k]
    remembers = law_remembers(run[CODE])
    grids, i, j, _ = tile
    _, lists, spans, _ = buffers
    step, told, count, shared, modes, sets, todo, _, _, _, _ = lists
    followed = run[MODES] == FOLLOWED
    kind = candidates.step[run[FIRST_STEP] + u, KIND] if followed else np.int64(POINT)
    counts = not followed or candidates.step[run[FIRST_STEP] + u, MOVES] != 0
    height, width = extent(grids, i, j)
    todo[:LOADED] = 1
    changed = False
    level = np.int64(0)
    while level < LEVELS and not (remembers and kind == POINT):
        size = BROAD >> level
        for at in range(1 << level):
            smallest = at * (size // SHORT)
            if (at + 1) * size > width or todo[smallest] == 0:
                continue
            part = (1 << level) - 1 + at
            mode = np.int64(-1)
            if remembers and begun:
                mode = np.int64(shared[part, SAME])
                if mode < 0:
                    continue
            known, after = modes_in_step(
                model, candidates, k, u, part, mode, shared[part, LEAST], shared[part, MOST], spans
            )
            if known == UNSURE:
                continue
            idle = known >= 0 and law_is_idle(run[CODE], known)
            if not idle and grids[3][level, j * PARTS + smallest] == 0:
                continue
            todo[smallest : smallest + size // SHORT] = 0
            if counts and not idle:
                step[part, count[part]] = u
                told[part, count[part]] = known
                count[part] += 1
            if remembers and (kind != WHOLE or not begun or known < 0):
                _enter(modes[0 if kind == WHOLE else 1], at * size, size, after)
                if kind != WHOLE:
                    _copy_sets(sets, at * size, size)
                changed = changed or kind == WHOLE
        level += 1
    done = 0.0
    for smallest in range(PARTS):
        if todo[smallest] != 0 and smallest * SHORT < width:
            done += _follow_each(model, candidates, k, u, begun, ends, smallest, tile, buffers, price)
            changed = changed or (remembers and kind == WHOLE)
    if changed:
        _share(modes[0], sets[0], height, shared)
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
      shared (PARTS_OF_ALL, SHARED): set.
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
def _load_all(model, candidates, k, grids, i, j, whole):
    """Put all members of a tile into the model, from place PLACES on.

    model, candidates, k: as of `load_members`.
    grids, i, j: the tile, as of `tile_interpolation.extent`.
    whole (2, PLACES): scratch.
    """
    height, width = extent(grids, i, j)
    for a in range(TALL):
        for b in range(BROAD):
            whole[0, a * BROAD + b] = i * TALL + min(a, height - 1)
            whole[1, a * BROAD + b] = j * BROAD + min(b, width - 1)
    load_members(model, candidates, k, whole, np.int64(PLACES), np.int64(PLACES))


@kernel
def _follow_each(model, candidates, k, u, begun, ends, smallest, tile, buffers, price):
    """Follow the members of one of the smallest parts through a step.

    Where permanent sets become others, what is listed is priced first, with those that were.

    model, candidates, k, u, begun, ends, tile, buffers, price: as of `_price_next`.
    smallest: the number of the part among those of its level.

    Returns how many members there are.
    """
    run = candidates.run[k]
    grids, i, j, _ = tile
    _, lists, _, following = buffers
    _, _, _, _, modes, sets, todo, _, fresh, whole, _ = lists
    height, width = extent(grids, i, j)
    if todo[LOADED] == 0:
        _load_all(model, candidates, k, grids, i, j, whole)
        todo[LOADED] = 1
    first = smallest * SHORT
    last_column = min(first + SHORT, width)
    remembers = law_remembers(run[CODE])
    s = run[FIRST_STEP] + u
    kind = candidates.step[s, KIND] if run[MODES] == FOLLOWED else np.int64(POINT)
    to = np.int64(0) if kind == WHOLE else np.int64(1)
    yes = np.bool_(True)
    changed = False
    wide = last_column - first
    for a in range(height):
        at = a * BROAD + first
        if run[MODES] == PIECES:
            o = run[FIRST_STATE] + u
            works = following[3][0]
            member_works(model, PLACES + at, wide, candidates.pose[o, 0], candidates.change[o, 0], works)
            own = model.member[MEMBER_FREE_LENGTH, PLACES + at : PLACES + at + wide]
            t = candidates.when[o]
            value = candidates.level[o]
            add_in_mode(
                run[CODE], candidates.law[k], model.curves, t, value, candidates.energy[o], own, works, np.int64(0),
                price[at : at + wide],
            )  # fmt: skip
            continue
        if kind == POINT:
            started = begun or ends != 0
            for b in range(at, at + wide):
                price[b] += price_point(model, candidates, k, PLACES + b, s, modes[ends, b], sets[ends, b], started)
            continue
        row = slice(at, at + wide)
        price_step(
            model, candidates, k, PLACES + at, wide, s, modes[0, row], sets[0, row], begun, yes, following, price[row]
        )
        if remembers:
            for b in range(wide):
                modes[to, at + b] = following[4][1, b]
                fresh[at + b] = following[5][1, b]
                changed = changed or fresh[at + b] != sets[0, at + b]
    followed = 1.0 * height * wide
    if not remembers or kind == POINT:
        return followed
    if changed and kind == WHOLE and last_column == first + SHORT:
        for level in range(LEVELS):
            part = (1 << level) - 1 + first // (BROAD >> level)
            followed += _price_list(model, candidates, k, part, tile, buffers, price)
    for a in range(height):
        for b in range(first, last_column):
            sets[to, a * BROAD + b] = fresh[a * BROAD + b]
    return followed


@kernel
def _price_list(model, candidates, k, part, tile, buffers, price):
    """Price the steps that are listed for a part, which has none in its list then.

    model, candidates, k, tile, buffers, price: as of `_price_next`.
    part: its number.

    Returns how many prices of steps were computed.
    """
    grids, i, j, error = tile
    scratch, lists, _, following = buffers
    _, _, count, shared, _, sets, _, found, _, _, _ = lists
    plan, _, _, _, index, values, _ = scratch
    steps = count[part]
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
        while next_candidates(grids, i, j, scratch):
            members = number_candidates(i, j, scratch)
            load_members(model, candidates, k, index, members, np.int64(0))
            values[:members] = 0.0
            _price_few(model, candidates, k, part, low + 0.5 * n * (high - low), members, lists, following, values)
            take_prices(grids, i, j, error, scratch, found[n])
        done += plan[PRICED]
    height, _ = extent(grids, i, j)
    for a in range(height):
        for at in range(a * BROAD + first, a * BROAD + first + size):
            value = found[0, at]
            if high != low:
                t = 2.0 * (sets[0, at] - low) / (high - low) - 1.0
                value = 0.5 * t * ((t - 1.0) * value + (t + 1.0) * found[2, at]) + (1.0 - t * t) * found[1, at]
            price[at] += value
    count[part] = 0
    return done * steps


@kernel
def _price_few(model, candidates, k, part, kept, members, lists, following, values):
    """Add what some members do in the steps that are listed for a part.

    In:
      model: with the members.
      candidates, k: a `PricedCandidates`, and the number of the run.
      part: its number.
      kept: the permanent set of the members (m).
      members: how many there are.
      lists: of `make_lists`.
    Out:
      values (members or more,): added to.
      following: of `make_following`, overwritten.
    """
    run = candidates.run[k]
    step, told, count, _, _, _, _, _, _, _, works = lists
    p = candidates.law[k]
    free = model.member[MEMBER_FREE_LENGTH]
    own = values[:members]
    quick = law_degree(run[CODE]) > 0
    yes = np.bool_(True)
    for n in range(count[part]):
        known = told[part, n]
        s = run[FIRST_STEP] + step[part, n]
        if known <= LEAVES:
            following[4][0] = LEAVES - known
            following[5][0] = kept
            for at in range(0, members, ROW):
                wide = min(ROW, members - at)
                few = values[at : at + wide]
                price_step(
                    model, candidates, k, at, wide, s, following[4][0], following[5][0], yes, yes, following, few
                )
            continue
        o = run[FIRST_STATE] + step[part, n]
        behind = o + 1
        if run[MODES] == FOLLOWED:
            o = candidates.step[s, FIRST_STAGE]
            behind = candidates.step[s, LAST_STAGE]
        while o < behind:
            member_works(model, np.int64(0), members, candidates.pose[o, 0], candidates.change[o, 0], works)
            t = candidates.when[o]
            value = candidates.level[o]
            weight = candidates.energy[o]
            if kept != 0.0:
                for m in range(members):
                    works[ELONGATION, m] -= kept
            if quick:
                add_polynomial(
                    run[CODE], p, model.curves, t, value, weight, works, members, known, following[0], following[1],
                    values,
                )  # fmt: skip
            else:
                add_in_mode(run[CODE], p, model.curves, t, value, weight, free, works, known, own)
            o += 1
