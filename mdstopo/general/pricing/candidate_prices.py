"""The prices of members that are not built, by any laws, in a plane or in space: the derivative each would have.

What prices follow from is found first (`pricing_states`). The members of a group lie between the points of two grids;
here all of them are gone through, tile by tile, of which a few numbers are kept (as in
`sensitivity.springs_candidate_prices`), or single ones. Members of laws that switch are followed through the steps
(`switching_prices`), in tiles as few of them as can be (`tile_prices`).
"""

import numpy as np

from mdstopo.compiler.jit import entry, kernel
from mdstopo.compiler.threads import shared, taken
from mdstopo.general.dynamics.members import MODE
from mdstopo.general.model.general_model import INERTER, unpack_general
from mdstopo.general.model.priced_candidates import (
    CODE,
    FIRST_ENERGY,
    FIRST_STATE,
    FOLLOWED,
    LAST_STATE,
    MODES,
    NONE,
    SCENE,
    unpack_candidates,
)
from mdstopo.general.pricing.loaded_members import load_members
from mdstopo.general.pricing.priced_tile import make_lists
from mdstopo.general.pricing.switching_prices import ROW, make_following, price_followed
from mdstopo.general.pricing.tile_prices import price_run
from mdstopo.mechanics.kinematics.kinematics_interface import (
    has_spring_energies,
    member_designs,
    member_work,
    second_rate,
    spring_designs,
    spring_energies,
)
from mdstopo.mechanics.laws.law_table import SPRING
from mdstopo.sensitivity.springs_candidate_prices import COMPUTED, ERROR, keep_tile
from mdstopo.sensitivity.tile_interpolation import (
    BROAD,
    COLUMNS,
    LEVELS,
    PLACES,
    PRICED,
    begin_tile,
    extent,
    fill_lengths,
    make_scratch,
    next_candidates,
    number_candidates,
    take_prices,
)

#: states of one pass over a tile, whose poses stay in the nearest cache
AT_ONCE = 32
#: which laws are priced: all, or those without modes
EVERY, SMOOTH = range(2)


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
    _price(model, candidates, EVERY, places, np.int64(places.shape[1]), np.int64(0), price)
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
      ints, floats, candidate_ints, candidate_floats: as of `price_places`, with room for ROOM members.
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
    lists = make_lists(candidates)
    price = np.empty(PLACES)
    length = np.zeros(PLACES)
    across = (candidates.second.shape[2] + BROAD - 1) // BROAD
    k = taken(counter)
    while k < which.shape[0]:
        tile = which[k]
        i = tile // across
        j = tile % across
        price[:] = np.inf
        if common[ERROR] > 0.0 and _have_modes(candidates):
            computed = _price_by_modes(model, candidates, grids, i, j, common[ERROR], scratch, lists, price)
        else:
            computed = _price_tile(model, candidates, EVERY, grids, i, j, common[ERROR], scratch, price)
        fill_lengths(candidates.first_place, candidates.second_place, i, j, length)
        out[k, COMPUTED] = computed
        keep_tile(k, tile, price, length, common, built, places, out, prices)
        k = taken(counter)


@kernel
def _have_modes(candidates):
    """Whether a law of some candidates has modes."""
    found = False
    for k in range(candidates.run.shape[0]):
        found = found or candidates.run[k, MODES] != NONE
    return found


@kernel
def _price_by_modes(model, candidates, grids, i, j, error, scratch, lists, price):
    """The prices of a tile where laws have modes: those of each of these laws, and of all others.

    model, candidates, grids, i, j, error, scratch, price: as of `_price_tile`.
    lists: of `priced_tile.make_lists`.

    Returns how many prices were computed, of a law as parts of one.
    """
    laws = np.int64(0)
    smooth = np.int64(0)
    computed = 0.0
    for k in range(candidates.run.shape[0]):
        if candidates.run[k, MODES] == NONE:
            smooth = np.int64(1)
        else:
            laws += 1
    if smooth > 0:
        computed += _price_tile(model, candidates, SMOOTH, grids, i, j, error, scratch, price)
    else:
        height, width = extent(grids, i, j)
        for a in range(height):
            price[a * BROAD : a * BROAD + width] = 0.0
    for k in range(candidates.run.shape[0]):
        if candidates.run[k, MODES] != NONE:
            # a tile is priced at once with its parts of every level
            computed += price_run(model, candidates, k, (grids, i, j, error / LEVELS), scratch, lists, price)
    return computed / (laws + smooth)


@kernel
def _price_tile(model, candidates, which, grids, i, j, error, scratch, price):
    """The prices of a tile.

    In:
      model: with room for its members, which are overwritten.
      candidates, which: a `PricedCandidates`, and which of its laws.
      grids, error: as of `tile_interpolation.take_prices`. i, j: the tile.
    Out:
      price (PLACES,): of its candidates.
    Scratch:
      scratch: of `tile_interpolation.make_scratch`.

    Returns how many prices were computed.
    """
    plan, _, _, _, index, found, _ = scratch
    begin_tile(error, scratch)
    while next_candidates(grids, i, j, scratch):
        count = number_candidates(i, j, scratch)
        _price(model, candidates, which, index, count, plan[COLUMNS], found)
        take_prices(grids, i, j, error, scratch, price)
    return plan[PRICED]


@kernel
def _price(model, candidates, which, index, count, row, price):
    """The prices of some members, PLACES at most.

    In:
      model: with room for them.
      candidates, which: a `PricedCandidates`, and which of its laws.
      index (2, count or more): numbers of their points.
      count: how many there are.
      row: how many behind each other begin at one point; 0: they do not.
    Out:
      model: its members are overwritten.
      price (PLACES,): derivatives by alpha.
    """
    member_state = np.zeros((3, PLACES))
    price[:] = 0.0
    before = np.int64(-1)
    for k in range(candidates.run.shape[0]):
        if which == SMOOTH and candidates.run[k, MODES] != NONE:
            continue
        # laws of one scene differ in their free lengths at most
        if (
            before < 0
            or candidates.run[k, SCENE] != candidates.run[before, SCENE]
            or (candidates.rest[k] != candidates.rest[before])
        ):
            load_members(model, candidates, k, index, count, np.int64(0))
        before = np.int64(k)
        _price_run(model, candidates, k, count, row, member_state, price)


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
    if run[MODES] == FOLLOWED:
        following = make_following()
        for at in range(0, count, ROW):
            wide = min(ROW, count - at)
            price_followed(model, candidates, k, at, wide, following, price[at : at + wide])
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
