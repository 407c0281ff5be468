"""The optimiser's variables x and the design that they stand for.

A design is one vector: alpha (N,), then the values of the laws' variables (P,) in their own units. The optimiser sees
x: one alpha for all members that share it, in a unit of its own where its bounds are small numbers (as those of areas
in square metres are), and each value as its share of the way from its lower to its upper bound, so that all variables
are numbers of size 1. Both directions are linear:

    alpha_i = unit_i x_slot(i),     value_p = (1 - x) lower_p + x upper_p,     dU/dx = T^T dU/d(design)

Where nothing is shared, nothing but alpha varies, and no alpha has a unit, x is alpha itself: nothing is copied or
computed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.objects.problem_parts import Variable, VolumeRow

#: the largest bound of alphas that are counted in a unit of their own
SMALL_BOUND = 0.25


class DesignSpace:
    """The map between the optimiser's variables x (n,) and designs (N + P,).

    slots (N,): which x each alpha is, in the order of first appearance; None where each is its own. variables: in the
    case's order. units (N,): what each alpha is counted in, that of those which are one the same; None: all in 1.
    Immutable.
    """

    def __init__(
        self,
        n_alpha: int,
        slots: IndexArray | None,
        variables: Sequence[Variable],
        units: FloatArray | None = None,
    ) -> None:
        self.n_alpha = n_alpha
        self.identity = slots is None and not variables and units is None
        self._units = units
        self._slots = np.arange(n_alpha) if slots is None else slots
        self._own = slots is None
        self._free = n_alpha if slots is None else int(slots.max(initial=-1)) + 1
        self._low = _values([(each.lower, each.count) for each in variables])
        self._high = _values([(each.upper, each.count) for each in variables])
        #: name -> where its values stand in a design
        self.parts: Mapping[str, slice] = {}
        first = n_alpha
        for each in variables:
            self.parts[each.name] = slice(first, first + each.count)
            first += each.count
        #: N + P
        self.length = first
        #: how many variables the optimiser has
        self.size = self._free + len(self._low)

    @property
    def slots(self) -> IndexArray:
        """(N,) which x each alpha is."""
        return self._slots

    def expand(self, x: FloatArray) -> FloatArray:
        """The design (N + P,) that x (n,) stands for; x itself where both are the same."""
        if self.identity:
            return x
        design = np.empty(self.length)
        design[: self.n_alpha] = x[self._slots] if self._units is None else x[self._slots] * self._units
        share = x[self._free :]
        design[self.n_alpha :] = (1.0 - share) * self._low + share * self._high
        return design

    def reduce(self, design: FloatArray) -> FloatArray:
        """The x (n,) whose design is nearest in alpha: members that share a variable take the mean of theirs."""
        if self.identity:
            return design
        x = np.empty(self.size)
        x[: self._free] = self._shared(self._counted(design[: self.n_alpha]))
        width = self._high - self._low
        own = design[self.n_alpha :] - self._low
        x[self._free :] = np.divide(own, width, out=np.zeros(len(own)), where=width > 0.0)
        return x

    def vjp(self, gradient: FloatArray) -> FloatArray:
        """(n,) the derivative by the optimiser's variables, from that by the design (N + P,)."""
        if self.identity:
            return gradient
        own = gradient[: self.n_alpha]
        own = own if self._units is None else own * self._units
        summed = own if self._own else np.bincount(self._slots, own, self._free)
        return np.concatenate([summed, gradient[self.n_alpha :] * (self._high - self._low)])

    def bounds(self, lower: FloatArray, upper: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The bounds of x, from those of alpha (N,): of members that share one the narrowest."""
        if self.identity:
            return np.array(lower), np.array(upper)
        low, high = np.full(self._free, -np.inf), np.full(self._free, np.inf)
        np.maximum.at(low, self._slots, self._counted(lower))
        np.minimum.at(high, self._slots, self._counted(upper))
        steady = self._high == self._low
        return np.concatenate([low, np.zeros(len(steady))]), np.concatenate([high, np.where(steady, 0.0, 1.0)])

    def row(self, row: VolumeRow) -> tuple[FloatArray, float]:
        """A volume row as coefficients (n,) and bound on x."""
        if self.identity:
            return row.coefficients, row.bound
        prices = row.prices if len(row.prices) else np.zeros(len(self._low))
        bound = row.bound - float(prices @ self._low)
        return self.vjp(np.concatenate([row.coefficients, prices])), bound

    def named(self, design: FloatArray) -> dict[str, FloatArray]:
        """The part of each variable, by name, of a design or of a derivative by it (..., N + P)."""
        return {name: design[..., part] for name, part in self.parts.items()}

    def _counted(self, alpha: FloatArray) -> FloatArray:
        """Alphas (N,) in their units."""
        return alpha if self._units is None else alpha / self._units

    def _shared(self, alpha: FloatArray) -> FloatArray:
        """(free,): the mean of the alphas that share one; that of equal ones is they, to the bit."""
        if self._own:
            return alpha
        first = np.zeros(self._free)
        first[self._slots[::-1]] = alpha[::-1]
        count = np.bincount(self._slots, minlength=self._free)
        mean: FloatArray = first + np.bincount(self._slots, alpha - first[self._slots], self._free) / count
        return mean


def units_of(
    bounds: Sequence[tuple[float, float]], counts: Sequence[int], slots: IndexArray | None
) -> FloatArray | None:
    """(N,) what alphas are counted in, from the bounds and the numbers of members of design groups; None where in 1.

    The least power of two that is not below the larger bound: whichever it is, the optimiser sees the same to the bit.
    1 where that bound is above `SMALL_BOUND` or 0. Alphas that are one, by slots (N,), take the smallest unit of all.
    """
    largest = [max(abs(lower), abs(upper)) for lower, upper in bounds]
    units = [2.0 ** math.ceil(math.log2(size)) if 0.0 < size <= SMALL_BOUND else 1.0 for size in largest]
    if all(unit == 1.0 for unit in units):
        return None
    found: FloatArray = np.repeat(units, counts)
    if slots is None:
        return found
    least = np.ones(int(slots.max(initial=-1)) + 1)
    np.minimum.at(least, slots, found)
    return least[slots]


def _values(pieces: list[tuple[float, int]]) -> FloatArray:
    return np.concatenate([np.full(count, value) for value, count in pieces]) if pieces else np.zeros(0)


def slots_of(counts: Mapping[str, int], shared: Sequence[str], mirrored: Sequence[Sequence[str]]) -> IndexArray | None:
    """(N,) the number of the optimiser's variable that each alpha is; None where each alpha is a variable of its own.

    counts: how many members each design group has, in order.
    """
    if not shared and not mirrored:
        return None
    first: dict[str, str] = {}
    for pair in mirrored:
        leader = pair[0]
        while leader in first:
            leader = first[leader]
        for name in pair[1:]:
            while name in first:
                name = first[name]
            if name != leader:
                first[name] = leader
    order = list(counts)
    leaders = {}
    for name in order:
        leader = name
        while leader in first:
            leader = first[leader]
        leaders[name] = leader
    alike = {leaders[name] for name in shared if name in leaders}
    slots: list[IndexArray] = []
    known: dict[str, IndexArray] = {}
    size = 0
    for name in order:
        leader = leaders[name]
        if leader not in known:
            count = 1 if leader in alike else counts[name]
            known[leader] = np.arange(size, size + count)
            size += count
        own = known[leader]
        slots.append(np.full(counts[name], own[0]) if leader in alike else own)
    return np.concatenate(slots) if slots else np.zeros(0, dtype=np.intp)
