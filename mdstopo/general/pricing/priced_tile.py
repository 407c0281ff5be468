"""A tile whose members are being priced by one law with modes: what the kernels that do so hand to each other."""

from typing import Any

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.model.bundles import bundle
from mdstopo.general.pricing.certain_modes import make_spans
from mdstopo.general.pricing.loaded_members import load_all, loaded_at
from mdstopo.general.pricing.sorted_members import make_sorting
from mdstopo.general.pricing.switching_prices import make_following, price_point
from mdstopo.general.pricing.switching_together import make_switching
from mdstopo.mechanics.kinematics.kinematics_interface import WORKS
from mdstopo.sensitivity.tile_interpolation import BROAD, LEVELS, PARTS, PLACES, begin_tile, extent

#: parts of a tile of all levels that have lists, of which those of a level begin at 2^level - 1
LISTED_PARTS = 2**LEVELS - 1
#: of each part: the mode that all its members are in, UNSURE where they differ; their least and largest permanent sets
SHARED = 3
SAME, LEAST, MOST = range(SHARED)
#: sets at which a part whose members differ in these is priced
SETS = 3
#: of `todo` the place behind those of the smallest parts: whether all members of the tile are in the model
LOADED = PARTS

#: the arrays of a `StepLists`
LISTS = ("step", "told", "count", "shared", "modes", "sets", "todo", "left", "found", "fresh", "whole", "works")
#: the parts of a `PricedTile`
FIELDS = (
    "model", "candidates", "k", "grids", "i", "j", "height", "width", "error", "lists", "scratch", "spans", "following",
    "sorting", "switching", "price",
)  # fmt: skip


class StepLists:
    """What is known of the members of a tile from step to step, inside kernels: arrays for all runs of some candidates.

    step, told (LISTED_PARTS, any): the steps that are listed for each part, and what is known of their modes. count
    (LISTED_PARTS,): how many these are. shared (LISTED_PARTS, SHARED): what the members of each part have in common.
    modes, sets (2, PLACES): of members at the start of a step, or behind a whole one; and behind a part of one. todo
    (PARTS + 1,): 1 for each of the smallest parts that is not listed for the step; at LOADED whether members are
    loaded. left (PARTS,): 1 for each of the smallest parts that is gone through step by step. found (SETS, PLACES):
    prices. fresh (PLACES,): the permanent sets with which members end a step. whole (2, PLACES): points of all places.
    works (WORKS, PLACES): what members do at a state.
    """

    def __init__(self, *_arrays: Any) -> None: ...


class PricedTile:
    """A tile, the law by which it is priced, and all arrays that this takes, inside kernels.

    model: with room for ROOM members, which are overwritten. candidates, k: a `PricedCandidates`, and the number of the
    run. grids, i, j, error: as of `tile_interpolation.take_prices`. height, width: rows and columns of the tile.
    lists: its `StepLists`. scratch: of `tile_interpolation.make_scratch`. spans: its `Spans`. following: a `Following`.
    sorting: a `Sorting`. switching: a `Switching`. price (PLACES,): of the members, added to.
    """

    def __init__(self, *_parts: Any) -> None: ...


bundle(StepLists, LISTS)
bundle(PricedTile, FIELDS)


@kernel
def make_lists(candidates):
    """The `StepLists` for all runs of some candidates."""
    most = candidates.step.shape[0] + candidates.pose.shape[0] + 1
    return StepLists(
        np.zeros((LISTED_PARTS, most), np.int64),
        np.zeros((LISTED_PARTS, most), np.int64),
        np.zeros(LISTED_PARTS, np.int64),
        np.zeros((LISTED_PARTS, SHARED)),
        np.zeros((2, PLACES), np.int64),
        np.zeros((2, PLACES)),
        np.zeros(PARTS + 1, np.int64),
        np.zeros(PARTS, np.int64),
        np.zeros((SETS, PLACES)),
        np.zeros(PLACES),
        np.zeros((2, PLACES), np.int64),
        np.zeros((WORKS, PLACES)),
    )


@kernel
def begin_pricing(model, candidates, k, place, scratch, lists, price):
    """A `PricedTile` with no step listed and no member in a mode.

    model, candidates, k, scratch, price: as of `PricedTile`.
    place: its grids, i, j and error.
    lists: a `StepLists`, which is emptied.
    """
    grids, i, j, error = place
    height, width = extent(grids, i, j)
    begin_tile(error, scratch)
    lists.count[:] = 0
    lists.modes[:] = 0
    lists.sets[:] = 0.0
    lists.shared[:] = 0.0
    lists.todo[LOADED] = 0
    lists.left[:] = 1
    return PricedTile(
        model, candidates, k, grids, i, j, height, width, error, lists, scratch, make_spans(candidates.first.shape[1]),
        make_following(), make_sorting(), make_switching(), price,
    )  # fmt: skip


@kernel
def load_tile(tile):
    """Write all members of a `PricedTile` into its model, unless they are there."""
    if tile.lists.todo[LOADED] == 0:
        load_all(tile.model, tile.candidates, tile.k, tile.grids, tile.i, tile.j, tile.lists.whole)
        tile.lists.todo[LOADED] = 1


@part
def set_share(n, t):
    """By how much the price with the least (n = 0), the middle (1) or the largest (2) permanent set of some members
    counts for a member with the set t, on a scale on which these are -1, 0 and 1: the polynomial of the second degree.
    """
    return 1.0 - t * t if n == 1 else 0.5 * t * (t + n - 1.0)


@kernel
def add_points(tile, s, first, size, begun, ends):
    """Add what the members of some columns do at a state alone.

    tile: a `PricedTile`, with all its members in its model.
    s: number of the state among the steps.
    first, size: the first column, and how many there are.
    begun: whether members are in modes. ends: the row of these among `modes`, and of the permanent sets.
    """
    modes, sets, price = tile.lists.modes, tile.lists.sets, tile.price
    for a in range(tile.height):
        for b in range(a * BROAD + first, a * BROAD + first + size):
            price[b] += price_point(
                tile.model, tile.candidates, tile.k, loaded_at(b), s, modes[ends, b], sets[ends, b], begun
            )
