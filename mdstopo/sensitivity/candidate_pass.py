"""A pass over the candidates of a group, with any function that prices them: totals, and the best candidates.

Prices are computed by compiled entries that keep a few numbers of each tile of TALL by BROAD points, and those of
single candidates (`sensitivity.springs_pricing`, `general.driver.general_pricing`).
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import MemberGroup
from mdstopo.case.scene.candidates import are_there, lengths_between, some_candidates, spread
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.sensitivity.springs_candidate_prices import (
    ABOVE,
    BELOW,
    BEST,
    COMMON,
    COST,
    ERROR,
    RATIO,
    SEEN,
    TILE_NUMBERS,
    TOGETHER,
    UPPER,
    WORTH,
)
from mdstopo.sensitivity.tile_interpolation import BROAD, PLACES, TALL, smoothness

#: tiles of which all candidates are priced one by one, of those with the largest gains
TILES = 64
#: the largest error of a price in a pass, relative to the largest price, and of how many candidates that is found
SMOOTH_ERROR, SAMPLE = 1e-12, 512
#: of a tile, how many are told before any is of which so many are told already
SHARE = 8

A = TypeVar("A")


@dataclass(frozen=True)
class Passed:
    """What a pass over the candidates of a group has found, beside its members.

    seen: how many there are. best: the largest gain of one (of the objective, to first order, with alpha at its upper
    bound), together: the sum over all that gain; ratio: the largest gain for a unit of cost. i, j (K,), gain (K,):
    those with the largest gains, largest first, though some may be below zero. left: the largest gain of all others,
    -inf where there are none.
    """

    seen: int
    best: float
    together: float
    ratio: float
    i: IndexArray
    j: IndexArray
    gain: FloatArray
    left: float


class CandidatePass(ABC, Generic[A]):
    """The candidates of a group, between the points of two grids; A: what a motion asks of members.

    group: as the scene has it.
    homes: where its points P and Q are at the start, (n, d) each.
    turned: whether the points Q come first inside, as the scene has it.
    count: about how many of the candidates, evenly spread; None: all.
    """

    def __init__(
        self, group: MemberGroup, homes: tuple[FloatArray, FloatArray], turned: bool, count: int | None
    ) -> None:
        assert group.candidates is not None
        self.candidates, self.upper = group.candidates, group.upper
        self.order = slice(None, None, -1 if turned else 1)
        self.homes = homes[self.order]
        self._built = (group.from_index, group.to_index)[self.order]
        self.chosen = spread(len(self.homes[0]), len(self.homes[1]), count)
        self._smooth: tuple[A, tuple[FloatArray, FloatArray, IndexArray, IndexArray]] | None = None

    @abstractmethod
    def fill_tiles(self, states: A, common: FloatArray, which: IndexArray, out: FloatArray, prices: FloatArray) -> None:
        """Price tiles.

        common: of `common`. which (K,): the tiles.
        Out: out (K, TILE_NUMBERS), what is kept of each; prices (K, PLACES), or (0, PLACES) where they are not wanted:
        of its candidates, infinite where one does not count.
        """

    @abstractmethod
    def prices_between(self, states: A, a: IndexArray, b: IndexArray) -> FloatArray:
        """The derivatives (K,) by alpha of members from first points to second ones."""

    def error(self, states: A) -> float:
        """The largest error of a price in a pass, relative to the largest price; 0: every price is computed."""
        return SMOOTH_ERROR

    def prices(self, states: A, i: IndexArray, j: IndexArray) -> FloatArray:
        """The derivatives (K,) by alpha of members from points P (K,) to points Q (K,).

        They are those of candidates that are not built. Rows that tell the force of one member, of a built one, have
        more of it in their gradient: its own force.
        """
        return self.prices_between(states, *(i, j)[self.order])

    def go_through(self, states: A, worth: float, most: int) -> Passed:
        """A pass over all of them; most: how many are told.

        worth: of a unit of cost, the multipliers of volume rows.
        """
        common = self.common(states, worth)
        tiles, _ = self.tiles(states, common, np.arange(self.shape[0] * self.shape[1]))
        best = tiles[:, BEST]
        by_gain = np.argsort(-best, kind="stable")
        chosen = by_gain[:TILES]
        _, prices = self.tiles(states, common, chosen, True)
        a, b, rank, gain, cost = (np.concatenate(each) for each in zip(
            *(self._of_tile(int(tile), own, worth) for tile, own in zip(chosen, prices, strict=True)), strict=True
        ))  # fmt: skip
        # of every tile some before more of any: neighbours are alike
        order = np.lexsort((-gain, rank // SHARE))[:most]
        rows, columns = self.chosen[0][a[order]], self.chosen[1][b[order]]
        gain[order] = -self.upper * (self.prices_between(states, rows, columns) + worth * cost[order])
        order = order[np.argsort(-gain[order], kind="stable")]
        left = np.append(np.delete(gain, order), best[by_gain[TILES:]]).max(initial=-np.inf)
        i, j = (self.chosen[0][a[order]], self.chosen[1][b[order]])[self.order]
        seen, together = int(tiles[:, SEEN].sum()), float(tiles[:, TOGETHER].sum())
        largest, ratio = max(float(best.max()), 0.0), float(tiles[:, RATIO].max())
        return Passed(seen, largest, together, ratio, i, j, gain[order], float(left))

    def tiles(
        self, states: A, common: FloatArray, which: IndexArray, wanted: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """(K, TILE_NUMBERS) and (K, PLACES), or (0, PLACES) where these are not wanted, of `fill_tiles`."""
        out, prices = np.empty((len(which), TILE_NUMBERS)), np.empty((len(which) if wanted else 0, PLACES))
        self.fill_tiles(states, common, which.astype(np.int64), out, prices)
        return out, prices

    def common(self, states: A, worth: float) -> FloatArray:
        """(COMMON,) of what candidates have in common, without what belongs to a law; worth: of a unit of cost."""
        own = self.candidates
        common = np.zeros(COMMON)
        common[ERROR] = self._allowed(states)
        common[COST] = -1.0 if own.cost is None else own.cost
        common[BELOW] = np.nextafter(own.shortest, -np.inf) if own.shortest else 0.0
        common[ABOVE] = np.nextafter(own.longest, np.inf)
        common[WORTH], common[UPPER] = worth, self.upper
        return common

    def _allowed(self, states: A) -> float:
        """The largest error of a price in a pass: `error` of the largest price of a sample; 0: none."""
        error = self.error(states)
        if error == 0.0:
            return 0.0
        sample = self.prices_between(states, *some_candidates(self.candidates, self.homes[0], self.homes[1], SAMPLE))
        return float(max(error * np.abs(sample).max(initial=0.0), np.finfo(float).tiny))

    def grids(self, states: A) -> Sequence[tuple[FloatArray, FloatArray]]:
        """The points that are priced, (n_A, d) and (n_B, d), once for each way in which they lie: those of `homes`."""
        return [(self.homes[0][self.chosen[0]], self.homes[1][self.chosen[1]])]

    def smoothness(self, states: A) -> tuple[FloatArray, FloatArray, IndexArray, IndexArray]:
        """Which parts of the tiles may be priced by a few of their candidates (`tile_interpolation.smoothness`)."""
        if self._smooth is None or self._smooth[0] is not states:
            found = [smoothness(each, self.chosen) for each in self.grids(states)]
            rows, columns = (np.min([each[k] for each in found], axis=0) for k in (2, 3))
            self._smooth = states, (*found[0][:2], rows, columns)
        return self._smooth[1]

    def _lengths(self, a: IndexArray, b: IndexArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """The lengths (K,) of candidates from first points to second ones (m), and whether there are such."""
        length = lengths_between(self.homes[0][a], self.homes[1][b])
        return length, are_there(self.candidates, length)

    @property
    def shape(self) -> tuple[int, int]:
        """How many tiles there are along the first and along the second points."""
        rows, columns = self.chosen
        return -(-len(rows) // TALL), -(-len(columns) // BROAD)

    @cached_property
    def by_tile(self) -> tuple[IndexArray, IndexArray]:
        """(T + 1,) and (any,): by tile, where in it the members are that are built."""
        a, b = self._built_here()
        tile = a // TALL * self.shape[1] + b // BROAD
        order = np.argsort(tile, kind="stable")
        begin = np.searchsorted(tile[order], np.arange(self.shape[0] * self.shape[1] + 1)).astype(np.int64)
        return begin, (a % TALL * BROAD + b % BROAD)[order].astype(np.int64)

    def _built_here(self) -> tuple[IndexArray, IndexArray]:
        """The members whose points are among those of the tile, by the places of these there."""
        found = [np.searchsorted(chosen, index) for chosen, index in zip(self.chosen, self._built, strict=True)]
        inside = np.ones(len(self._built[0]), dtype=np.bool_)
        for place, chosen, index in zip(found, self.chosen, self._built, strict=True):
            inside &= chosen[np.minimum(place, len(chosen) - 1)] == index
        return found[0][inside], found[1][inside]

    def _of_tile(
        self, tile: int, prices: FloatArray, worth: float
    ) -> tuple[IndexArray, IndexArray, IndexArray, FloatArray, FloatArray]:
        """Of all candidates of a tile that may enter: the places of their points among those that are priced, their
        ranks in the tile, their gains and what they cost.

        prices (PLACES,): of the tile; worth: of a unit of cost.
        """
        rows, columns = self.chosen
        width = len(columns)
        row, column = tile // self.shape[1] * TALL, tile % self.shape[1] * BROAD
        own_a = np.arange(row, min(row + TALL, len(rows)))
        own_b = np.arange(column, min(column + BROAD, width))
        a, b = np.repeat(own_a, len(own_b)), np.tile(own_b, len(own_a))
        price = prices[(a - row) * BROAD + b - column]
        length, new = self._lengths(rows[a], columns[b])
        new &= np.isfinite(price)
        a, b, length = a[new], b[new], length[new]
        cost = length if self.candidates.cost is None else np.full(len(a), self.candidates.cost)
        gain = -self.upper * (price[new] + worth * cost)
        rank = np.empty(len(gain), dtype=np.intp)
        rank[np.argsort(-gain, kind="stable")] = np.arange(len(gain))
        return a, b, rank, gain, cost
