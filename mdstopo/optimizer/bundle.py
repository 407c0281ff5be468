"""The rows that a bundle method knows: of the iterate and of trials near it, accepted or rejected, all seen from the
iterate.

A row belongs to the objective (group 0) or to a constraint (1, 2, ...) and is a line, or the norm of a two-vector less
an offset (`conic`). No row may say more of the iterate than the largest of its group there: of a function that is not
convex a row from elsewhere would, and is lowered, the more the farther it comes from and the more the function was seen
to bend downwards (C. Lemarechal, 1975; K. C. Kiwiel, "Methods of descent for nondifferentiable optimization", 1985).
"""

from dataclasses import dataclass, fields

import numpy as np

from mdstopo.optimizer.conic import Lines, Norms
from mdstopo.optimizer.problem import Bools, Floats, Ints, Sample, largest_of_groups
from mdstopo.optimizer.stack import Slopes, Stack, alike, joined, slopes_of, steepest_of
from mdstopo.optimizer.wide_numbers import VERY_MANY_VARIABLES

#: numbers that the rows may take; the least and the most rows that may be kept, of very many variables the least
ROOM_FOR_ROWS, LEAST_ROWS, MOST_ROWS = 2e7, 8, 160
#: a row within this of another of its group, in slope and in value relative to the steepest, is the same
SAME_ROW = 1e-9
#: share of a row's slope by which a row from elsewhere may differ from it and still be the same peak, seen earlier
SEEN_AGAIN = 0.1
#: how much the vector of a norm changes in a box, in its own length, up to which the norm is a line there
STRAIGHT = 1e-6


@dataclass(slots=True)
class Bundle:
    """Rows by columns: vector (K, 2), of a line its value and 0; slope (K, N) of the first and across (K, N) of the
    second component (no columns where no row is a norm); offset (K,), NaN of a line; group (K,); own (K,): whether it
    is the iterate's; age (K,): for how many subproblems it has had no multiplier; distance (K,): the way
    from where it was seen to the iterate, in ranges."""

    vector: Floats
    slope: Slopes
    across: Floats
    offset: Floats
    group: Ints
    own: Bools
    age: Ints
    distance: Floats

    def __post_init__(self) -> None:
        self.slope = slopes_of(self.slope)

    @classmethod
    def empty(cls, n: int) -> "Bundle":
        """A bundle without rows, of n variables."""
        none, ints = np.zeros((0, n)), np.zeros(0, dtype=np.int64)
        floats, truths = np.zeros(0), np.zeros(0, dtype=np.bool_)
        return cls(np.zeros((0, 2)), none, np.zeros((0, 0)), floats, ints, truths, ints, floats)

    @classmethod
    def of(cls, sample: Sample, rows: Ints) -> "Bundle":
        """The rows of a sample, seen from there: of the objective those at the places `rows`, of constraints all."""
        n, many = sample.gradients.shape[1], len(sample.constraint_rows)
        value = np.concatenate([sample.rows[rows], sample.constraint_rows])
        every, wide = len(rows) == len(sample.rows), n >= VERY_MANY_VARIABLES
        chosen = sample.gradients if every else sample.gradients[rows]
        slope = (Stack.of if wide else _stacked)(chosen, sample.constraint_gradients.reshape(-1, n))
        lines = np.full(len(sample.rows), np.nan), np.full(many, np.nan)
        offset = np.concatenate(
            [(sample.offset if len(sample.offset) and not wide else lines[0])[rows],
             sample.constraint_offset if len(sample.constraint_offset) and not wide else lines[1]]
        )  # fmt: skip
        norm = ~np.isnan(offset)
        across = np.zeros((len(value), n if norm.any() else 0))
        if across.size:
            across[: len(rows)] = sample.across[rows] if sample.across.size else 0.0
            if many and sample.constraint_across.size:
                across[len(rows) :] = sample.constraint_across
        vector = np.stack([np.where(norm, value + offset, value), np.zeros(len(value))], axis=1)
        group = np.concatenate([np.zeros(len(rows), dtype=np.int64), 1 + sample.groups])
        own = np.ones(len(value), dtype=np.bool_)
        return cls(vector, slope, across, offset, group, own, np.zeros(len(value), dtype=np.int64),
                   np.zeros(len(value)))  # fmt: skip

    def __len__(self) -> int:
        return len(self.group)

    @property
    def steepest(self) -> Floats:
        """The largest size of an entry of each row's slope, (K,)."""
        return steepest_of(self.slope)

    @property
    def norm(self) -> Bools:
        """(K,) which rows are norms of vectors."""
        return ~np.isnan(self.offset)

    def vectors_at(self, d: Floats) -> Floats:
        """(K, 2) the vectors of the rows after a step d (N,)."""
        out = self.vector.copy()
        out[:, 0] += self.slope @ d
        if self.across.shape[1]:
            out[:, 1] += self.across @ d
        return out

    def values_at(self, d: Floats) -> Floats:
        """(K,) values of the rows after a step d (N,)."""
        return _values(self.vectors_at(d), self.offset)

    def values(self) -> Floats:
        """(K,) values of the rows at the iterate."""
        return _values(self.vector, self.offset)

    def slopes_at(self, d: Floats) -> Floats:
        """The rows' gradients (K, N) after a step d (N,)."""
        if isinstance(self.slope, Stack):
            return np.array(self.slope)
        if not self.across.shape[1]:
            return self.slope
        vector = self.vectors_at(d)
        size = np.sqrt(vector[:, 0] ** 2 + vector[:, 1] ** 2)
        known = self.norm & (size > 0.0)
        unit = np.where(known[:, None], vector / np.where(known, size, 1.0)[:, None], [1.0, 0.0])
        return np.asarray(unit[:, :1] * self.slope + unit[:, 1:] * self.across)

    def tangent(self, weights: Floats, d: Floats) -> tuple[float, Floats]:
        """The sum with weights (K,) of the rows' tangents at a step d (N,), below which no row lies: its value at the
        iterate, and its gradient (N,)."""
        if isinstance(self.slope, Stack):  # lines, whose rows are not copied
            gradient = np.zeros(self.slope.n)
            for weight, row in zip(weights.tolist(), self.slope.rows, strict=True):
                if weight != 0.0:
                    gradient += weight * row
            return float(weights @ self.values()), gradient
        slopes = self.slopes_at(d)
        return float(weights @ (self.values_at(d) - slopes @ d)), np.asarray(weights @ slopes)

    def levels(self, groups: int) -> Floats:
        """The largest value of each group (groups,) at the iterate, -inf of one without rows."""
        return largest_of_groups(self.values(), self.group, groups)

    def moved(self, d: Floats, length: float) -> "Bundle":
        """The rows seen from another iterate, d (N,) away; `length`: how far that is, in ranges. None of them is the
        iterate's own any more."""
        return self._with(
            vector=self.vectors_at(d), own=np.zeros(len(self), dtype=np.bool_), distance=self.distance + length
        )

    def lowered(self, levels: Floats, concavity: Floats) -> "Bundle":
        """The rows with values of at most levels (groups,); those found elsewhere lower still, by concavity (groups,)
        times distance squared."""
        caps = levels[self.group] - np.where(self.own, 0.0, concavity[self.group] * self.distance**2)
        beyond = np.maximum(self.values() - caps, 0.0)
        vector = self.vector.copy()
        vector[:, 0] -= np.where(self.norm, 0.0, beyond)
        return self._with(vector=vector, offset=self.offset + beyond)

    def relevant(self, width: Floats) -> tuple[Bools, "Bundle"]:
        """The rows that may carry a multiplier in a box of half width (N,) around the iterate, norms that hardly bend
        there as lines: which of these rows they are (K,), and themselves.

        The others lie below the highest row of the objective, or below the limit, in all of the box.
        """
        assert not isinstance(self.slope, Stack)
        along, across = np.abs(self.slope) @ width, np.zeros(len(self))
        if self.across.shape[1]:
            across = np.abs(self.across) @ width
        reach, values = np.hypot(along, across), self.values()
        least = np.zeros(int(self.group.max(initial=0)) + 1)
        least[0] = (values - reach)[self.group == 0].max(initial=-np.inf)
        kept = values + reach >= least[self.group]
        straight = reach <= STRAIGHT * np.hypot(self.vector[:, 0], self.vector[:, 1])
        return kept, self.with_tangents(self.norm & straight).subset(kept)

    def with_tangents(self, norms: Bools) -> "Bundle":
        """The rows, those of them that the mask (K,) tells as lines: their tangents at the iterate."""
        lines = norms | ~self.norm
        first = np.where(norms, self.values(), self.vector[:, 0])
        vector = np.stack([first, np.where(norms, 0.0, self.vector[:, 1])], axis=1)
        slope = np.where(norms[:, None], self.slopes_at(np.zeros(self.slope.shape[1])), self.slope)
        across = self.across[:, :0] if lines.all() else self.across
        return self._with(vector=vector, slope=slope, across=across, offset=np.where(norms, np.nan, self.offset))

    def subset(self, places: Ints | Bools) -> "Bundle":
        """A bundle of some of the rows."""
        return Bundle(*(getattr(self, f.name)[places] for f in fields(Bundle)))

    def joined(self, other: "Bundle") -> "Bundle":
        """A bundle of these rows and others behind them."""
        width = max(self.across.shape[1], other.across.shape[1])
        wide = [np.zeros((len(b), width)) if b.across.shape[1] < width else b.across for b in (self, other)]
        columns = [np.concatenate([getattr(self, f.name), getattr(other, f.name)]) for f in fields(Bundle)
                   if f.name not in ("across", "slope")]  # fmt: skip
        vector, offset, group, own, age, distance = columns
        slope = joined(self.slope, other.slope)
        return Bundle(vector, slope, np.concatenate(wide), offset, group, own, age, distance)

    def without_repeats(self) -> "Bundle":
        """The rows, and of those that are the same within SAME_ROW only the last one."""
        if len(self) < 2:
            return self
        steepest, values = self.steepest, self.values()
        # slopes that are the same have nearly the same sum: most pairs need not be compared entry by entry
        total = np.zeros(len(self)) if isinstance(self.slope, Stack) else np.einsum("rn->r", self.slope)
        near = self.group[:, None] == self.group
        near &= np.abs(values - values[:, None]) <= (SAME_ROW * np.maximum(steepest, 1e-300))[:, None]
        near &= np.abs(total - total[:, None]) <= (2.0 * SAME_ROW * self.slope.shape[1] * steepest)[:, None]
        kept = np.ones(len(self), dtype=np.bool_)
        for i, k in np.argwhere(np.triu(near, 1)).tolist():
            if kept[i] and alike(self.slope, k, i, SAME_ROW * steepest[i]):
                kept[i] = False
        return self if kept.all() else self.subset(kept)

    def without_peaks_of(self, new: "Bundle") -> "Bundle":
        """The rows without those that are an earlier form of a peak of `new`: in the same group, with nearly the
        same slope.

        Beside the curvature that a subproblem has, such a row would count the curvature of its peak once more, and
        steps would become ever shorter. Of very many variables all rows stay: they are few.
        """
        if isinstance(self.slope, Stack) or not len(self):
            return self
        nowhere = np.zeros(self.slope.shape[1])
        old, fresh = self.slopes_at(nowhere), new.slopes_at(nowhere)
        size = np.einsum("rn,rn->r", fresh, fresh)
        apart = np.einsum("kn,kn->k", old, old)[:, None] + size - 2.0 * (old @ fresh.T)
        seen = (apart <= SEEN_AGAIN**2 * size) & (self.group[:, None] == new.group)
        return self.subset(~seen.any(axis=1))

    def without_far(self, group: int, farthest: float) -> "Bundle":
        """The rows without those of a group that were seen farther away, in ranges, but for the iterate's own."""
        return self.subset(self.own | (self.group != group) | (self.distance <= farthest))

    def thinned(self) -> "Bundle":
        """The iterate's own rows, and as many others as may be kept: those that carried a multiplier last, and of these
        the newest.

        Beside many own rows there may be half as many others as rows may be kept: a trial that fails is to be known by
        the next one. Of very many variables own rows may be all.
        """
        most, wide = self._most(), self.slope.shape[1] >= VERY_MANY_VARIABLES
        others = np.flatnonzero(~self.own)
        free = max(most - (len(self) - len(others)), 0 if wide else most // 2)
        if len(others) <= free:
            return self
        kept = self.own.copy()
        kept[others[np.lexsort((-others, self.age[others]))[:free]]] = True
        return self.subset(kept)

    def with_rejected(self, seen: "Bundle", below: Floats) -> "Bundle":
        """These rows with those of a rejected trial, seen from the iterate, as the newest ones that are not its own.

        At most a quarter of the rows that may be kept, or `LEAST_ROWS`, are one trial's: those nearest to carrying a
        multiplier there.
        below (K,): how far each is from that, as `Bundle.below` tells it.
        """
        most = max(self._most() // 4, LEAST_ROWS)
        nearest = np.sort(np.argsort(below, kind="stable")[:most])
        return self.subset(~self.own).joined(seen.subset(nearest)).joined(self.subset(self.own))

    def below(self) -> Floats:
        """How far each row (K,) is from carrying a multiplier, in steps of its steepest variable: below the highest of
        its group, or below the limit."""
        groups = int(self.group.max(initial=0)) + 1
        levels = self.levels(groups)
        levels[1:] = np.maximum(levels[1:], 0.0)
        return np.asarray((levels[self.group] - self.values()) / np.maximum(self.steepest, 1e-300))

    def _most(self) -> int:
        """How many rows may be kept."""
        n = max(self.slope.shape[1], 1)
        return LEAST_ROWS if n >= VERY_MANY_VARIABLES else int(min(max(ROOM_FOR_ROWS / n, LEAST_ROWS), MOST_ROWS))

    def aged(self, multipliers: Floats, enough: Floats) -> "Bundle":
        """The rows after a subproblem with multipliers (K,), with new ages; enough (groups,): the least that counts."""
        return self._with(age=np.where(multipliers > enough[self.group], 0, self.age + 1))

    def lines(self) -> tuple[Ints, Lines]:
        """The rows that are lines: their places and themselves."""
        at, slope = np.flatnonzero(~self.norm), self.slope
        assert not isinstance(slope, Stack)
        return at, Lines(self.vector[at, 0], slope[at], self.group[at])

    def norms(self) -> tuple[Ints, Norms]:
        """The rows that are norms: their places and themselves."""
        at, slope = np.flatnonzero(self.norm), self.slope
        assert not isinstance(slope, Stack)
        across = self.across[at] if self.across.shape[1] else np.zeros((len(at), slope.shape[1]))
        return at, Norms(self.vector[at], slope[at], across, self.offset[at], self.group[at])

    def _with(self, **columns: Floats | Ints | Bools | Stack) -> "Bundle":
        return Bundle(*(columns.get(f.name, getattr(self, f.name)) for f in fields(Bundle)))


def _stacked(one: Floats, other: Floats) -> Slopes:
    return np.concatenate([one, other])


def _values(vector: Floats, offset: Floats) -> Floats:
    """The values (K,) of lines (offset NaN) and norms with vectors (K, 2)."""
    size = np.sqrt(vector[:, 0] ** 2 + vector[:, 1] ** 2)
    return np.where(np.isnan(offset), vector[:, 0], size - offset)
