"""When the largest force of a group passes from one member to another: the places in steps at which the forces of two
members are equal, or equal and opposite.

All pairs of a batch of steps are looked for together, on arrays: what takes long is the way from Python to the kernel
that computes forces, and one call serves any number of places. The cubics through samples say first which pairs may
meet where no other member is larger by far; only their zeros are refined on the motion itself.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdstopo.general.responses.general_responses import TIE
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: a member whose cubic stays below the largest force by less than this share of it may lead in truth
MAY_LEAD = 1e-3
#: what is added to it: how far a cubic between two samples may be off, relative to the largest rate there, per interval
OFF = 1e-4
#: members that are compared between two samples at most, those with the largest forces; of more that come near the
#: largest force there at once, changes between the others are not looked for
MOST_COMPARED = 24
#: pairs that are looked at in one go, each at all samples of a step
AT_ONCE = 100_000
#: places between two samples at which cubics are compared, and how far any other place is from the nearest at most
PLACES = np.linspace(0.0, 1.0, 33)
APART = 0.5 * float(PLACES[1])
#: looks at a dip of a difference that may pass zero
TRIALS = 4
#: Newton's steps at most, and the share of a step below which one ends them: the next one would be its square
NEWTON, LAST_CORRECTION = 80, 1e-12
#: bisections of a cubic: it only says where Newton's method begins
BISECTIONS = 20

#: step (P,), fraction of it (P,), members (2, P) as rows of the samples -> forces (2, P) (N) and rates (2, P) per step
Exact = Callable[[IndexArray, FloatArray, IndexArray], tuple[FloatArray, FloatArray]]


class Pairs(NamedTuple):
    """Pairs of members whose difference may vanish between two samples.

    cell (P,): the number of the interval between two samples.
    rows (2, P): both members, as rows of `CompetingMembers.members`.
    members (2, P): the same, as rows of the samples.
    sign (P,): 1, or -1 where the forces are equal and opposite.
    """

    cell: IndexArray
    rows: IndexArray
    members: IndexArray
    sign: FloatArray

    def some(self, which: NDArray[np.generic]) -> "Pairs":
        """Some of the pairs, in the order of `which`."""
        return Pairs(self.cell[which], self.rows[:, which], self.members[:, which], self.sign[which])


class Cubics(NamedTuple):
    """Cubics over 0 to 1, each by its coefficients."""

    start: FloatArray
    first: FloatArray
    square: FloatArray
    cube: FloatArray

    def at(self, x: FloatArray | float) -> FloatArray:
        """Their values."""
        return self.start + x * (self.first + x * (self.square + x * self.cube))

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Their values and rates at 0 and 1, each (2, ...)."""
        rates = np.stack([self.first, self.first + 2.0 * self.square + 3.0 * self.cube])
        return np.stack([self.start, self.at(1.0)]), rates

    def some(self, *places: Any) -> "Cubics":
        """Those at some places of the arrays."""
        return Cubics(*(each[places] for each in self))


def cubics(values: FloatArray, rates: FloatArray) -> Cubics:
    """The cubics through values (2, ...) at 0 and 1 with the rates (2, ...)."""
    rise = values[1] - values[0]
    return Cubics(values[0], rates[0], 3.0 * rise - 2.0 * rates[0] - rates[1], rates[0] + rates[1] - 2.0 * rise)


class CompetingMembers(NamedTuple):
    """The intervals between two samples in which several members come near the largest force.

    step (Q,): number of the step among those that are sampled. interval (Q,): of the first of the two samples.
    members (n, Q): who they are, as rows of the samples, rising; -1: nobody more.
    curves (n, Q): the cubics of their forces, zero where there is nobody.
    steepest (Q,): the largest rate, per interval (N).
    """

    step: IndexArray
    interval: IndexArray
    members: IndexArray
    curves: Cubics
    steepest: FloatArray

    def some(self, cells: IndexArray) -> "CompetingMembers":
        """Some of the intervals."""
        curves = self.curves.some(slice(None), cells)
        return CompetingMembers(
            self.step[cells], self.interval[cells], self.members[:, cells], curves, self.steepest[cells]
        )


def lead_changes(
    force: FloatArray, rate: FloatArray, may: NDArray[np.bool_], fine: FloatArray, exact: Exact
) -> tuple[IndexArray, FloatArray]:
    """Where the lead may pass to another member: number of the step (R,), fraction of it (R,), in order of time.

    force (C, W, K): forces of members at samples of steps (N). rate (C, W, K): their rates, per interval (N).
    may (C, W, K - 1): which members may lead between two samples.
    fine (K,): fractions of a step at which the samples are.
    exact: forces and rates on the motion itself.
    """
    competing = _competing(force, rate, may)
    most, cells = len(competing.members), np.arange(len(competing.step))
    portions = np.array_split(cells, max(1, -(-most * most * len(cells) // AT_ONCE)))
    found = [_changes_in(competing.some(cells), force, fine, exact) for cells in portions]
    step, fraction = (np.concatenate(each) for each in zip(*found, strict=True))
    order = np.lexsort([fraction, step])
    return step[order], fraction[order]


def _changes_in(
    competing: CompetingMembers, force: FloatArray, fine: FloatArray, exact: Exact
) -> tuple[IndexArray, FloatArray]:
    """Where the lead passes between competing members: number of the step (R,), fraction of it (R,).

    Further arguments: as of `lead_changes`.
    """
    pairs = _pairs(competing, force)
    a, b = (competing.curves.some(rows, pairs.cell) for rows in pairs.rows)
    difference = Cubics(*(x - pairs.sign * y for x, y in zip(a, b, strict=True)))
    values, rates = difference.ends()
    turns = (values[0] >= 0.0) != (values[1] >= 0.0)
    dips = ~turns & (values[0] * rates[0] < 0.0) & (values[1] * rates[1] > 0.0)
    guess = np.zeros(len(turns))
    guess[turns] = _zeros(difference.some(turns))
    lowest, passes = _turning(difference.some(dips))
    guess[dips] = lowest
    dips[dips] = passes
    kept = np.flatnonzero(turns | dips)
    kept = kept[_leads(competing, pairs.some(kept), guess[kept])]
    pairs, guess, turns, start = pairs.some(kept), guess[kept], turns[kept], values[0][kept]
    step, interval = competing.step[pairs.cell], competing.interval[pairs.cell]
    low, width = fine[interval], fine[interval + 1] - fine[interval]
    search = _Search(pairs, step, exact)
    crossed, dipped = np.flatnonzero(turns), np.flatnonzero(~turns)
    found = [search.zeros(crossed, low[crossed], (low + width)[crossed], (low + guess * width)[crossed])]
    # samples are of quintics: a zero beside one of them may lie on its other side on the motion itself
    missed = np.setdiff1d(crossed, found[0][0])
    left, right = (np.clip(each[missed], 0.0, 1.0) for each in (low - width, low + 2.0 * width))
    found.append(search.zeros(missed, left, right, (low + guess * width)[missed]))
    found += search.zeros_of_dips(dipped, low[dipped], width[dipped], guess[dipped], start[dipped])
    which, fraction = (np.concatenate(each) for each in zip(*found, strict=True))
    return step[which], fraction


def _competing(force: FloatArray, rate: FloatArray, may: NDArray[np.bool_]) -> CompetingMembers:
    """Where which members come so near the largest force, by their cubics, that they may lead.

    Of more than MOST_COMPARED members those with the largest forces. Arguments as of `lead_changes`.
    """
    step, interval, member = np.nonzero(np.moveaxis(may, 0, -1))
    new = np.append(True, (np.diff(step) != 0) | (np.diff(interval) != 0))[: len(step)]
    first, cell = np.flatnonzero(new), np.cumsum(new) - 1
    sides = np.stack([interval, interval + 1])
    values, rates = force[member, step, sides], rate[member, step, sides]
    curves = cubics(values, rates)
    steep = np.maximum(np.abs(rates).max(axis=0), 1.5 * np.abs(values[1] - values[0]))
    steepest = np.maximum.reduceat(steep, first) if len(first) else steep
    near = np.zeros(len(member), dtype=bool)
    for x in PLACES.tolist():
        size = np.abs(curves.at(x))
        largest = np.maximum.reduceat(size, first) if len(first) else size
        near |= size >= (largest - 2.0 * (MAY_LEAD * largest + APART * steepest))[cell]
    order = np.flatnonzero(near)
    order = order[np.lexsort([-np.abs(values[:, order]).max(axis=0), cell[order]])]
    order = np.sort(order[_ranks(cell[order]) < MOST_COMPARED])
    contested, own = np.unique(cell[order], return_inverse=True)
    several = np.bincount(own, minlength=len(contested)) > 1
    order, contested = order[several[own]], contested[several]
    own = np.searchsorted(contested, cell[order])
    rank = _ranks(own)
    shape = int(rank.max(initial=-1)) + 1, len(contested)
    members = np.full(shape, -1)
    members[rank, own] = member[order]
    packed = [np.zeros(shape) for _ in curves]
    for into, each in zip(packed, curves, strict=True):
        into[rank, own] = each[order]
    return CompetingMembers(
        step[first][contested], interval[first][contested], members, Cubics(*packed), steepest[contested]
    )


def _ranks(groups: IndexArray) -> IndexArray:
    """The place of each entry within its group; groups (N,): rising."""
    new = np.append(True, np.diff(groups) != 0)[: len(groups)]
    place = np.arange(len(groups))
    return np.asarray(place - np.maximum.accumulate(np.where(new, place, 0)))


def _pairs(competing: CompetingMembers, force: FloatArray) -> Pairs:
    """All pairs of members in the same interval, with both signs, without those whose forces are the same at all
    samples of the step. force (C, W, K): as of `lead_changes`."""
    p, q = np.triu_indices(len(competing.members), 1)
    which, cell = np.nonzero(competing.members[q] >= 0)
    rows = np.stack([p[which], q[which]])
    members = competing.members[rows, cell]
    found: list[Pairs] = []
    a, b = (force[each, competing.step[cell]] for each in members)
    largest = np.maximum(np.abs(a).max(axis=-1), np.abs(b).max(axis=-1))
    for sign in (1.0, -1.0):
        kept = np.abs(a - sign * b).max(axis=-1) > TIE * largest
        found.append(Pairs(cell, rows, members, np.full(len(cell), sign)).some(kept))
    cells, both, who, signs = (np.concatenate(each, axis=-1) for each in zip(*found, strict=True))
    return Pairs(cells, both, who, signs)


def _zeros(curves: Cubics) -> FloatArray:
    """A zero of each cubic that has different signs at 0 and 1, by bisection."""
    low, high = np.zeros(len(curves.start)), np.ones(len(curves.start))
    above = curves.start >= 0.0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = (curves.at(middle) >= 0.0) == above
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return np.asarray(0.5 * (low + high))


def _turning(curves: Cubics) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Where each cubic that comes nearer to zero and leaves again turns round, and whether it may pass zero there."""
    (d0, d1), (s0, s1) = curves.ends()
    square, cube = curves.square, curves.cube
    below = square + np.copysign(np.sqrt(np.maximum(square * square - 3.0 * cube * s0, 0.0)), d0)
    x = -s0 / np.where(below == 0.0, 1.0, below)
    slack = 0.02 * np.minimum(np.abs(d0), np.abs(d1)) + OFF * np.maximum(np.abs(s0), np.abs(s1))
    passes = (below != 0.0) & (x > 0.0) & (x < 1.0) & (curves.at(x) * np.sign(d0) <= slack)
    return np.clip(x, 0.0, 1.0), passes


def _leads(competing: CompetingMembers, pairs: Pairs, guess: FloatArray) -> NDArray[np.bool_]:
    """Whether a pair is near the largest force where its difference vanishes or turns round, or comes near zero.

    guess (P,): where between both samples it does.
    """
    a, b = (competing.curves.some(rows, pairs.cell) for rows in pairs.rows)
    near = np.zeros(len(guess), dtype=bool)
    steepest = competing.steepest[pairs.cell]
    # cubics of forces that are nearly the same meet anywhere: not only where the guess is
    for x in PLACES.tolist():
        largest = np.abs(competing.curves.at(x)).max(axis=0, initial=0.0)[pairs.cell]
        slack = 2.0 * (MAY_LEAD * largest + OFF * steepest)
        own, other = a.at(x), b.at(x)
        near |= (np.abs(own - pairs.sign * other) <= slack) & (np.abs(own) >= largest - slack)
    largest = np.zeros(len(guess))
    for row in range(len(competing.members)):
        largest = np.maximum(largest, np.abs(competing.curves.some(row, pairs.cell).at(guess)))
    slack = 2.0 * (MAY_LEAD * largest + OFF * steepest)
    found: NDArray[np.bool_] = near | (np.abs(a.at(guess)) >= largest - slack)
    return found


class _Search:
    """Zeros of the differences of pairs on the motion itself, of all pairs at once."""

    def __init__(self, pairs: Pairs, step: IndexArray, exact: Exact) -> None:
        self._pairs, self._step, self._exact = pairs, step, exact

    def _difference(self, which: IndexArray, fraction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The differences of the pairs `which`, each at a fraction of its step, and their rates per step."""
        pairs = self._pairs.some(which)
        force, rate = self._exact(self._step[which], fraction, pairs.members)
        return force[0] - pairs.sign * force[1], rate[0] - pairs.sign * rate[1]

    def zeros(
        self, which: IndexArray, low: FloatArray, high: FloatArray, guess: FloatArray
    ) -> tuple[IndexArray, FloatArray]:
        """Those pairs among `which` (B,) whose difference has two signs at low and high (B,), or is zero at one of
        them, and their zeros: by Newton's method from a guess (B,), kept between both by bisection."""
        first, last = (self._difference(which, each)[0] for each in (low, high))
        zero = np.where(first == 0.0, low, high)
        at_end = (first == 0.0) | (last == 0.0)
        crossed = np.flatnonzero(~at_end & ((first < 0.0) != (last < 0.0)))
        zero[crossed] = self._newton(which[crossed], low[crossed], high[crossed], guess[crossed], first[crossed])
        kept = np.union1d(np.flatnonzero(at_end), crossed)
        return which[kept], zero[kept]

    def _newton(
        self, which: IndexArray, low: FloatArray, high: FloatArray, guess: FloatArray, first: FloatArray
    ) -> FloatArray:
        """(B,) zeros between low and high (B,) of the pairs `which` (B,), whose differences at low are `first`."""
        low, high = low.copy(), high.copy()
        found = np.where((guess > low) & (guess < high), guess, 0.5 * (low + high))
        before = high - low
        live = np.arange(len(which))
        for _ in range(NEWTON):
            if not len(live):
                break
            x = found[live]
            value, rate = self._difference(which[live], x)
            same = (value < 0.0) == (first[live] < 0.0)
            low[live], high[live] = np.where(same, x, low[live]), np.where(same, high[live], x)
            step = -value / np.where(rate == 0.0, np.inf, rate)
            bad = (rate == 0.0) | (x + step <= low[live]) | (x + step >= high[live])
            bad |= np.abs(step) > 0.5 * before[live]
            step = np.where(bad & (value != 0.0), 0.5 * (low[live] + high[live]) - x, step)
            found[live], before[live] = x + step, np.abs(step)
            live = live[(value != 0.0) & (np.abs(step) > LAST_CORRECTION) & (high[live] - low[live] > LAST_CORRECTION)]
        return found

    def zeros_of_dips(
        self, which: IndexArray, low: FloatArray, interval: FloatArray, guess: FloatArray, start: FloatArray
    ) -> list[tuple[IndexArray, FloatArray]]:
        """The zeros, mostly none or two of each, of pairs `which` (B,) whose difference comes near zero and leaves.

        low, interval (B,): the first sample, and how far the second one is behind it, as fractions of the step.
        guess (B,): where between both it is nearest to zero. start (B,): the difference at the first sample (N).
        """
        found: list[tuple[IndexArray, FloatArray]] = []
        high, c = low + interval, low + guess * interval
        width = 0.02 * interval
        live = np.arange(len(which))
        for _ in range(TRIALS):
            if not len(live):
                break
            near = np.clip(c[live] + np.outer([-1.0, 0.0, 1.0], width[live]), low[live], high[live])
            seen = self._difference(np.tile(which[live], len(near)), near.ravel())[0].reshape(near.shape)
            beyond = seen * start[live] < 0.0
            passed = beyond.any(axis=0)
            own = live[passed]
            middle = near[beyond.argmax(axis=0), np.arange(len(live))][passed]
            for left, right in ((low[own], middle), (middle, high[own])):
                found.append(self.zeros(which[own], left, right, 0.5 * (left + right)))
            bend = seen[0] - 2.0 * seen[1] + seen[2]
            shift = 0.5 * width[live] * (seen[0] - seen[2]) / np.where(bend == 0.0, 1.0, bend)
            c[live], width[live] = np.clip(c[live] + shift, low[live], high[live]), 0.1 * width[live]
            live = live[~passed & (bend != 0.0)]
        return found
