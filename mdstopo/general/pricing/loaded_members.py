"""The members of a tile in the model, and what those in one mode do at a row of states."""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.model.general_model import MEMBER_EXCESS, MEMBER_FREE_LENGTH
from mdstopo.general.model.priced_candidates import BEHIND_FEW, CODE, FIRST_FEW, SCENE, TOGETHER_LEVELS
from mdstopo.general.pricing.switching_prices import add_in_mode, add_polynomial, range_of
from mdstopo.mechanics.kinematics.kinematics_interface import ELONGATION, INVERSE, member_works
from mdstopo.mechanics.laws.law_table import law_degree
from mdstopo.sensitivity.tile_interpolation import BROAD, PLACES, TALL, extent


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
def load_all(model, candidates, k, grids, i, j, whole):
    """Put all members of a tile into the model, from place PLACES on, column by column: those of some columns lie
    behind each other, and are whole vectors.

    model, candidates, k: as of `load_members`.
    grids, i, j: the tile, as of `tile_interpolation.extent`.
    whole (2, PLACES): scratch.
    """
    height, width = extent(grids, i, j)
    for b in range(BROAD):
        for a in range(TALL):
            whole[0, b * TALL + a] = i * TALL + min(a, height - 1)
            whole[1, b * TALL + a] = j * BROAD + min(b, width - 1)
    load_members(model, candidates, k, whole, np.int64(PLACES), np.int64(PLACES))


@part
def loaded_at(place):
    """Where `load_all` has put the member at a place of the tile."""
    return PLACES + place % BROAD * TALL + place // BROAD


@kernel
def take_members(model, places, count, behind):
    """Put some members of a tile (`load_all`) behind each other, from the first place on, and the first of them once
    more in the places up to `behind`.

    places (count or more,): which of the tile's members. count: how many there are.
    """
    member = model.member
    for d in range(member.shape[0]):
        for m in range(count):
            member[d, m] = member[d, loaded_at(places[m])]
        for m in range(count, behind):
            member[d, m] = member[d, 0]


@kernel
def steps_together(model, candidates, s, count, at, members, works):
    """The states over which members in one mode are summed in some steps, as few as will do.

    In:
      model: with the members.
      candidates, s: a `PricedCandidates`, and the number of the first step.
      count: how many steps there are from it on, 1 or more.
      at, members: the first member, and how many there are.
    Out:
      works (WORKS, members or more): overwritten.

    Returns for how many of the steps they are, the first state, and the one behind the last.
    """
    level = np.int64(TOGETHER_LEVELS - 1)
    while level > 0:
        first = candidates.few[s, level, FIRST_FEW]
        behind = candidates.few[s, level, BEHIND_FEW]
        if 1 << level <= count and behind > first:
            member_works(model, at, members, candidates.pose[first, 0], candidates.change[first, 0], works)
            least, most = range_of(works[INVERSE], members)
            # the inverse length of a member whose ends meet, the shortest there is, is written as 0
            if least > 0.0 and most <= candidates.nearest[s, level]:
                return 1 << level, first, behind
        level -= 1
    return np.int64(1), candidates.few[s, 0, FIRST_FEW], candidates.few[s, 0, BEHIND_FEW]


@kernel
def add_states(model, candidates, k, first, behind, members, mode, kept, works, following, values):
    """Add what some members in one mode do at some states.

    In:
      model: with the members.
      candidates, k: a `PricedCandidates`, and the number of the run.
      first, behind: the first state, and the one behind the last.
      members: how many there are.
      mode: the mode.
      kept (1, or members): the permanent set of all, or of each (m).
    Out:
      values (members or more,): added to.
      works (WORKS, members or more), following: overwritten.
    """
    code = candidates.run[k, CODE]
    p = candidates.law[k]
    free = model.member[MEMBER_FREE_LENGTH]
    quick = law_degree(code) > 0
    for o in range(first, behind):
        member_works(model, np.int64(0), members, candidates.pose[o, 0], candidates.change[o, 0], works)
        t = candidates.when[o]
        value = candidates.level[o]
        weight = candidates.energy[o]
        if kept.shape[0] > 1:
            for m in range(members):
                works[ELONGATION, m] -= kept[m]
        elif kept[0] != 0.0:
            for m in range(members):
                works[ELONGATION, m] -= kept[0]
        if quick:
            add_polynomial(
                code, p, model.curves, t, value, weight, works, members, mode, following.node, following.power, values
            )  # fmt: skip
        else:
            add_in_mode(code, p, model.curves, t, value, weight, free, works, mode, values[:members])
