"""From Python to the compiled entries that price candidates (`candidate_prices`): what they ask for, what they tell."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mdstopo.case.candidates import lengths_between, spread
from mdstopo.case.model import GROUND, MemberGroup, SpringLaw
from mdstopo.compiler.threads import allowed
from mdstopo.integrators.steps import FIRST, WORK, carve
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.scene.compile import NEAR
from mdstopo.scene.model import (
    DAMPING,
    EXCESS,
    KIND,
    L0,
    MEMBER,
    PAIR,
    PRELOAD,
    PX,
    PY,
    QX,
    QY,
    STIFFNESS,
    VECTOR,
    WIDTH,
    FloatArray,
    IndexArray,
)
from mdstopo.sensitivity import candidate_prices as kernels
from mdstopo.sensitivity.candidate_prices import (
    ABOVE,
    BELOW,
    BEST,
    BROAD,
    COMMON,
    COST,
    F0,
    FREE,
    NO_ROOM,
    RATIO,
    SEEN,
    TALL,
    TILE_NUMBERS,
    TOGETHER,
    UPPER,
    WORTH,
    C,
    K,
)

if TYPE_CHECKING:
    from mdstopo.sensitivity.springs_driver import SpringsDriver

#: tiles of which all candidates are looked at, of those with the largest gains
TILES = 64
#: of a tile, how many are told before any is of which so many are told already
SHARE = 8
#: members that are priced at once
AT_ONCE = 1 << 16


class Asked(NamedTuple):
    """What a weighted sum of rows asks of members, whatever they are.

    pose (S, n_pair, POSE) and change (S, n_pair, 3): relative poses and their virtual changes; point (E, n_pair, POSE)
    and weight (E,): relative poses, and the weights of the stored energy in them.
    """

    pose: FloatArray
    change: FloatArray
    point: FloatArray
    weight: FloatArray

    @classmethod
    def of_all(cls, parts: "Sequence[Asked]") -> "Asked":
        """What several motions of the same bodies ask together."""
        return cls(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def of_pair(self, pair: int) -> "tuple[FloatArray, FloatArray, FloatArray]":
        """Poses (S + E, 1, POSE), changes (S, 1, 3), weights (E,) of one pair, without those that ask for nothing."""
        moved = self.change[:, pair].any(axis=1)
        seen = self.weight != 0.0
        poses = np.concatenate([self.pose[moved, pair], self.point[seen, pair]])[:, None]
        changes = np.ascontiguousarray(self.change[moved, pair][:, None])
        return np.ascontiguousarray(poses), changes, self.weight[seen]


def asked_of(driver: "SpringsDriver", factor: FloatArray) -> Asked:
    """What the rows of a driver's last evaluation ask of members, each times its factor (n_obj, R)."""
    n, n_pair, damped, turning = driver.shape
    limits = [int(each) for each in driver.limits]
    index = carve.py_func(driver.room, driver.room_ints, n, n_pair, limits[1], limits[2], damped, turning)[2]  # type: ignore[attr-defined]
    stages = int(index[driver.count, FIRST])
    more = 64
    while True:
        pose, change = np.zeros((stages + more, n_pair, POSE)), np.zeros((stages + more, n_pair, 3))
        point, weight = np.zeros((more, n_pair, POSE)), np.zeros(more)
        poses, points = kernels.row_poses(
            driver.entry.TAG, driver.packed.ints, driver.packed.floats, driver.method.tables, damped, driver.settings,
            driver.limits, driver.count, driver.reductions, driver.rows, driver.found, factor, driver.room,
            driver.room_ints, driver.strength, stages, pose, change, point, weight, np.zeros(WORK, dtype=np.int64),
        )  # fmt: skip
        if poses != NO_ROOM:
            return Asked(pose[:poses], change[:poses], point[:points], weight[:points])
        more *= 4


@dataclass(frozen=True)
class Passed:
    """What a pass over the candidates of a group has found, beside its members.

    seen: how many there are. best: the largest gain of one (of the objective, to first order, with alpha at its upper
    bound), together: the sum over all that gain; ratio: the largest gain for a unit of cost. i, j (K,), gain (K,):
    those with the largest gains, largest first, though some may be below zero.
    """

    seen: int
    best: float
    together: float
    ratio: float
    i: IndexArray
    j: IndexArray
    gain: FloatArray


class SpringCandidates:
    """The candidates of a group of springs between free bodies, in the plane.

    group: as the scene has it; block: its row of `Model.block`; homes: where its points P and Q are at the start,
    (n, 2) each; count: about how many of them, evenly spread; None: all. Inside, the points of that body come first
    that comes first in the scene.
    """

    def __init__(
        self,
        group: MemberGroup,
        block: IndexArray,
        homes: tuple[FloatArray, FloatArray],
        count: int | None = None,
    ) -> None:
        (law,) = group.laws
        assert isinstance(law, SpringLaw)
        assert group.candidates is not None
        self._law, self._candidates, self._upper = law, group.candidates, group.upper
        self._kind, self.pair = int(block[KIND]), int(block[PAIR])
        # as `scene.origin.ends_of` has it
        turned = group.body_to == GROUND and not block[WIDTH]
        self._order = slice(None, None, -1 if turned else 1)
        self._first, self._second = (group.from_local, group.to_local)[self._order]
        self._homes = homes[self._order]
        self._built = (group.from_index, group.to_index)[self._order]
        self._chosen = spread(len(self._first), len(self._second), count)
        self._far = float(np.sqrt((self._second**2).sum(axis=1).max()))

    def prices(self, asked: Asked, i: IndexArray, j: IndexArray) -> FloatArray:
        """The derivatives (K,) by alpha of members from points P (K,) to points Q (K,)."""
        return self._prices(asked, *(i, j)[self._order])[0]

    def go_through(self, asked: Asked, worth: float, most: int) -> Passed:
        """A pass over all of them; most: how many are told.

        worth: of a unit of cost, the multipliers of volume rows.
        """
        tiles = self._tiles(asked, worth)
        best = tiles[:, BEST]
        chosen = np.argsort(-best, kind="stable")[:TILES]
        a, b, rank, gain = (np.concatenate(each) for each in zip(
            *(self._of_tile(asked, int(tile), worth) for tile in chosen), strict=True
        ))  # fmt: skip
        # of every tile some before more of any: neighbours are alike
        order = np.lexsort((-gain, rank // SHARE))[:most]
        order = order[np.argsort(-gain[order], kind="stable")]
        i, j = (self._chosen[0][a[order]], self._chosen[1][b[order]])[self._order]
        seen, together = int(tiles[:, SEEN].sum()), float(tiles[:, TOGETHER].sum())
        return Passed(seen, max(float(best.max()), 0.0), together, float(tiles[:, RATIO].max()), i, j, gain[order])

    def _tiles(self, asked: Asked, worth: float) -> FloatArray:
        """(T, TILE_NUMBERS): what `price_candidates` keeps of each tile."""
        law, own = self._law, self._candidates
        common = np.empty(COMMON)
        common[[K, C, F0]] = law.stiffness, law.damping, law.preload
        common[FREE] = -1.0 if law.free_length is None else law.free_length
        common[COST] = -1.0 if own.cost is None else own.cost
        common[BELOW] = np.nextafter(own.shortest, -np.inf) if own.shortest else 0.0
        common[ABOVE] = np.nextafter(own.longest, np.inf)
        common[WORTH], common[UPPER] = worth, self._upper
        rows, columns = self._chosen
        first, second = _padded(self._first[rows], TALL), _padded(self._second[columns], BROAD)
        homes = _padded(self._homes[0][rows], TALL), _padded(self._homes[1][columns], BROAD)
        shape = first.shape[1] // TALL, second.shape[1] // BROAD
        a, b = self._built_here()
        tile = a // TALL * shape[1] + b // BROAD
        order = np.argsort(tile, kind="stable")
        begin = np.searchsorted(tile[order], np.arange(shape[0] * shape[1] + 1)).astype(np.int64)
        places = (a % TALL * BROAD + b % BROAD)[order].astype(np.int64)
        out = np.empty((*shape, TILE_NUMBERS))
        pose, change, weight = asked.of_pair(self.pair)
        kernels.price_candidates(
            first, second, *homes, common, self._kind, pose, change, weight, begin, places, allowed(), out
        )
        return out.reshape(-1, TILE_NUMBERS)

    def _built_here(self) -> tuple[IndexArray, IndexArray]:
        """The members whose points are among those that are looked at, by the places of these there."""
        found = [np.searchsorted(chosen, index) for chosen, index in zip(self._chosen, self._built, strict=True)]
        inside = np.ones(len(self._built[0]), dtype=np.bool_)
        for place, chosen, index in zip(found, self._chosen, self._built, strict=True):
            inside &= chosen[np.minimum(place, len(chosen) - 1)] == index
        return found[0][inside], found[1][inside]

    def _of_tile(self, asked: Asked, tile: int, worth: float) -> tuple[IndexArray, IndexArray, IndexArray, FloatArray]:
        """Of all candidates of a tile that may enter: the places of their points among those that are looked at, their
        ranks in the tile, and their gains."""
        rows, columns = self._chosen
        width = len(columns)
        across = -(-width // BROAD)
        row, column = tile // across * TALL, tile % across * BROAD
        own_a = np.arange(row, min(row + TALL, len(rows)))
        own_b = np.arange(column, min(column + BROAD, width))
        a, b = np.repeat(own_a, len(own_b)), np.tile(own_b, len(own_a))
        there = self._built_here()
        new = ~np.isin(a * width + b, there[0] * width + there[1])
        length = lengths_between(self._homes[0][rows[a]], self._homes[1][columns[b]])
        new &= (length >= self._candidates.shortest) & (length <= self._candidates.longest) & (length > 0.0)
        a, b = a[new], b[new]
        price, length = self._prices(asked, rows[a], columns[b])
        cost = length if self._candidates.cost is None else self._candidates.cost
        gain = -self._upper * (price + worth * cost)
        rank = np.empty(len(gain), dtype=np.intp)
        rank[np.argsort(-gain, kind="stable")] = np.arange(len(gain))
        return a, b, rank, gain

    def _prices(self, asked: Asked, a: IndexArray, b: IndexArray) -> tuple[FloatArray, FloatArray]:
        """The derivatives (K,) by alpha of members from first points to second ones, and their initial lengths."""
        law, own = self._law, asked.of_pair(self.pair)
        found, lengths = np.empty(len(a)), lengths_between(self._homes[0][a], self._homes[1][b])
        for start in range(0, len(a), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            count, length = len(a[part]), lengths[part]
            member, out = np.zeros((MEMBER, -(-count // VECTOR) * VECTOR)), np.empty(-(-count // VECTOR) * VECTOR)
            here = member[:, :count]
            here[[PX, PY]], here[[QX, QY]] = self._first[a[part]].T, self._second[b[part]].T
            here[L0] = length if law.free_length is None else law.free_length
            here[EXCESS] = (length - here[L0]) * (length + here[L0])
            here[[STIFFNESS, DAMPING, PRELOAD]] = np.array([law.stiffness, law.damping, law.preload])[:, None]
            member[:STIFFNESS, count:] = member[:STIFFNESS, count - 1 : count]  # no place has a length of its own
            far = NEAR * float(length.max())
            near = np.array([[far**2, min(far / max(self._far, 1e-300), 1.0) ** 2]])
            kernels.price_members(member, self._kind, near, *own, out)
            found[part] = out[:count]
        return found, lengths


def _padded(points: FloatArray, multiple: int) -> FloatArray:
    """Points (n, 2) as (2, n), behind them such as are nowhere, up to a multiple."""
    padded = np.full((2, -(-len(points) // multiple) * multiple), np.nan)
    padded[:, : len(points)] = points.T
    return padded
