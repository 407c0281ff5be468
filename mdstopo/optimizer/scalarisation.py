"""Several objectives as one (Section IV.B): rows whose maximum is U, built from every objective's competing peaks.

Each objective G_i (negated where it is to be maximised) is the maximum of its peaks G_ip; g is Eq. 24 of it. Then, by
the records in `settings.scalarisations`,

    weighted_exponential   U = sum_i w_i sign(g_i) |g_i|^p        (Eq. 23)     one row for each choice of peaks p_i
    weighted_sum           U = sum_i w_i g_i                                   the same
    weighted_product       U = prod_i G_i^w_i, of raw values                   the same
    weighted_min_max       U = max_i w_i g_i                                   one row a peak
    nbi                    U = 1 + max_i (g_i - a_i) / r_i                     one row a peak
    nc                     U = g_k,  and rows  sum_i n_i (g_i - a_i) <= 0      one row a peak; one for each choice

or, where choices are many, the 27 highest of them and those that differ from the highest in one peak, so that the bound
formulation sees every peak, and all choices that tie up to that number.
`nbi` is normal boundary intersection (Das and Dennis 1998) in the form of Pascoletti and Serafini, whose inequalities
reach every point of a front; 1 keeps U away from zero, to which tolerances are relative. `nc` is the normal constraint
(Messac, Ismail-Yahaya and Mattson 2003).
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from heapq import heappop, heappush
from itertools import product
from math import prod
from pkgutil import resolve_name
from typing import cast

import numpy as np

from mdstopo.optimizer.problem import Floats, Ints
from mdstopo.settings.scalarisations import SCALARISATIONS

#: rows that one U has at most, and one plane of `nc`; choices of peaks that are all taken; the highest of more
MOST_ROWS_OF_U, MOST_PLANE_ROWS, ALL_CHOICES, HIGHEST_CHOICES = 120, 12, 36, 27

#: values (P,) of an objective's peaks, highest first, and their gradients (P, N); no rows where none were asked for
Part = tuple[Floats, Floats]


class NotPositiveError(ValueError):
    """A value that is not positive where the formula needs it to be."""


@dataclass(frozen=True)
class Scalarisation:
    """One number U of m objectives: which formula, with which weights, utopia and maxima.

    method: name of a record. weights (m,): those of weight 0 take no part, unless the formula says that all do. lowest,
    highest (m,): utopia and maxima of Eq. 24, of signed values; None: raw values. exponent: p. anchor, normal (m,): a
    and r of nbi; anchor and planes (c, m): a and the rows n of nc, whose k is the last objective.
    """

    method: str
    weights: Floats
    lowest: Floats | None = None
    highest: Floats | None = None
    exponent: float = 2.0
    anchor: Floats = field(default_factory=lambda: np.zeros(0))
    normal: Floats = field(default_factory=lambda: np.zeros(0))
    planes: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def active(self) -> list[int]:
        """The objectives that take part, by place."""
        if formula_of(self.method).all_take_part:
            return list(range(len(self.weights)))
        return [i for i, weight in enumerate(self.weights.tolist()) if weight > 0.0]

    def transformed(self, values: Floats, i: int) -> tuple[Floats, float]:
        """g of values of objective i (Eq. 24), and its slope."""
        if self.lowest is None or self.highest is None:
            return values, 1.0
        width = float(self.highest[i] - self.lowest[i])
        return (values - self.lowest[i]) / width, 1.0 / width

    def transformed_all(self, signed: Floats) -> Floats:
        """(K, m) the objectives g of Eq. 24, of values (K, m)."""
        if self.lowest is None or self.highest is None:
            return signed
        return np.asarray((signed - self.lowest) / (self.highest - self.lowest))

    def values(self, signed: Floats) -> Floats:
        """U (K,) of designs with one value (K, m) each; NaN where there is none. Planes of nc are not part of it."""
        return formula_of(self.method).values(self, signed)

    def excesses(self, signed: Floats) -> Floats:
        """By how much values (K, m) exceed the planes of nc, (K,) added up; 0 where feasible."""
        if not len(self.planes):
            return np.zeros(len(signed))
        beyond = (self.transformed_all(signed) - self.anchor) @ self.planes.T
        return np.asarray(np.maximum(beyond, 0.0).sum(axis=1))

    def rows(self, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """Rows (R,), highest first, and gradients (R, N), from the active objectives' parts.

        Raises NotPositiveError, with the place among the active objectives as its argument.
        """
        return _sorted(*formula_of(self.method).rows(self, parts))

    def limits(self, parts: Sequence[Part]) -> tuple[Floats, Ints, Floats]:
        """Constraint rows (C,), feasible where <= 0, the plane (C,) that each is of, and gradients (C, N).

        A plane has a row for each of the highest choices of a peak of every objective that it rises with; where it
        falls with an objective, its highest peak alone counts.
        """
        rows: list[float] = []
        of_plane: list[int] = []
        slopes: list[Floats] = []
        factors = [self.transformed(values, i)[1] for i, (values, _) in enumerate(parts)]
        for k, plane in enumerate(self.planes):
            shares = [
                n * self.transformed(values if n > 0.0 else values[:1], i)[0]
                for i, (n, (values, _)) in enumerate(zip(plane, parts, strict=True))
            ]
            for choice in highest_choices(shares, MOST_PLANE_ROWS):
                rows.append(float(sum(share[p] for share, p in zip(shares, choice, strict=True)) - plane @ self.anchor))
                of_plane.append(k)
                if all(len(part[1]) for part in parts):
                    every = zip(plane, factors, parts, choice, strict=True)
                    slopes.append(sum(n * factor * part[1][p] for n, factor, part, p in every))
        return np.array(rows), np.array(of_plane, dtype=np.int64), np.array(slopes).reshape(-1, parts[0][1].shape[1])


class Formula(ABC):
    """The formula by which U follows from the objectives; a record's `made_by` names it, and it has no state.

    all_take_part: whether objectives of weight 0 do, too.
    """

    all_take_part = False

    @abstractmethod
    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""

    @abstractmethod
    def rows(self, one: Scalarisation, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """Smooth rows whose maximum is U, in any order; see `Scalarisation.rows`."""

    def spread(self, one: Scalarisation, table: Floats) -> Scalarisation:
        """For a front: the scalarisation with its `normal` or `planes`, from the ends of the front; of formulas that
        spread points alone.

        table (m, m): a row for each end of the front, its objectives scaled by Eq. 24.
        """
        raise NotImplementedError


class SumOfPowers(Formula):
    """U = sum_i w_i sign(g_i) |g_i|^p, and whatever else is a sum over objectives: one row for each choice of peaks."""

    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""
        g, p = one.transformed_all(signed)[:, one.active], self.power(one)
        return np.asarray((one.weights[one.active] * np.sign(g) * np.abs(g) ** p).sum(axis=1))

    def rows(self, one: Scalarisation, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """One row for each choice of a peak of every objective, with gradients; see `Scalarisation.rows`."""
        terms = [self.term(one, i, values, k) for k, (i, (values, _)) in enumerate(zip(one.active, parts, strict=True))]
        rows, gradients = [], []
        wanted = all(len(part[1]) for part in parts)
        for choice in _choices([shares for shares, _ in terms]):
            total, factor = self.total(sum(float(terms[k][0][p]) for k, p in enumerate(choice)))
            slopes = [factor * float(terms[k][1][p]) for k, p in enumerate(choice)]
            rows.append(total)
            if wanted:
                gradients.append(sum(slopes[k] * parts[k][1][p] for k, p in enumerate(choice)))
        return np.array(rows), np.array(gradients) if wanted else np.zeros((0, 0))

    def power(self, one: Scalarisation) -> float:
        """The exponent of the objectives: p of the case."""
        return one.exponent

    def term(self, one: Scalarisation, i: int, values: Floats, place: int) -> tuple[Floats, Floats]:
        """An objective's share of the sum, and its slope by G, at its peaks. place: among the active objectives."""
        weight = float(one.weights[i])
        g, factor = one.transformed(values, i)
        p = self.power(one)
        size = np.abs(g)
        with np.errstate(divide="ignore"):
            slope = np.ones_like(g) if p == 1.0 else p * size ** (p - 1.0)
        return weight * np.sign(g) * size**p, weight * slope * factor

    def total(self, added: float) -> tuple[float, float]:
        """U from the sum over the objectives, and its slope by that."""
        return added, 1.0


class Sum(SumOfPowers):
    """The weighted sum, U = sum_i w_i g_i."""

    def power(self, one: Scalarisation) -> float:
        """The exponent of the objectives: 1."""
        return 1.0


class Product(SumOfPowers):
    """U = prod_i G_i^w_i: the exponential of a sum of logarithms, of raw values."""

    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""
        raw = signed[:, one.active]
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(np.where(raw > 0.0, raw, np.nan))
        return np.asarray(np.exp(logs @ one.weights[one.active]))

    def term(self, one: Scalarisation, i: int, values: Floats, place: int) -> tuple[Floats, Floats]:
        """An objective's share of the sum of logarithms, and its slope by G. Raises NotPositiveError."""
        if np.any(values <= 0.0):
            raise NotPositiveError(place)
        weight = float(one.weights[i])
        return weight * np.log(values), weight / values

    def total(self, added: float) -> tuple[float, float]:
        """U from the sum of logarithms: its exponential, which is its own slope."""
        total = float(np.exp(added))
        return total, total


class Largest(Formula):
    """U = max_i w_i g_i, and whatever else is the largest of s_i g_i + c_i: one row a peak."""

    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""
        g = one.transformed_all(signed)[:, one.active]
        return np.asarray((one.weights[one.active] * g).max(axis=1))

    def rows(self, one: Scalarisation, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """One row for each peak of every objective, with gradients; see `Scalarisation.rows`."""
        rows, gradients = [], []
        for i, (values, slopes) in zip(one.active, parts, strict=True):
            line = self.line(one, i)
            if line is not None:
                scale, shift = line
                g, factor = one.transformed(values, i)
                rows.append(scale * g + shift)
                gradients.append(scale * factor * slopes)
        return np.concatenate(rows), np.concatenate(gradients)

    def line(self, one: Scalarisation, i: int) -> tuple[float, float] | None:
        """s and c of objective i; None where it is no part of U."""
        return float(one.weights[i]), 0.0


class BoundaryIntersection(Largest):
    """Normal boundary intersection: U = 1 + max_i (g_i - a_i) / r_i."""

    all_take_part = True

    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""
        return np.asarray((1.0 + (one.transformed_all(signed) - one.anchor) / one.normal).max(axis=1))

    def line(self, one: Scalarisation, i: int) -> tuple[float, float] | None:
        """Slope 1/r and offset 1 - a/r of the line that an objective is in U."""
        return 1.0 / float(one.normal[i]), 1.0 - float(one.anchor[i]) / float(one.normal[i])

    def spread(self, one: Scalarisation, table: Floats) -> Scalarisation:
        """The scalarisation with all entries of r equal to 1: objectives give way alike, in units of Eq. 24."""
        return replace(one, normal=np.ones(len(table)))


class NormalConstraint(Largest):
    """U = g_k, the last objective; the others are in the planes' rows (`Scalarisation.limits`)."""

    all_take_part = True

    def values(self, one: Scalarisation, signed: Floats) -> Floats:
        """(K,) U of designs with values (K, m); see `Scalarisation.values`."""
        return np.asarray(one.transformed_all(signed)[:, -1])

    def line(self, one: Scalarisation, i: int) -> tuple[float, float] | None:
        """Slope 1 and offset 0: U is the last objective."""
        return (1.0, 0.0) if i == len(one.weights) - 1 else None

    def spread(self, one: Scalarisation, table: Floats) -> Scalarisation:
        """The scalarisation with planes through the anchor, whose normals lead from the other ends to the last one."""
        return replace(one, planes=table[-1] - table[:-1])


@cache
def formula_of(method: str) -> Formula:
    """The formula of a way to combine objectives, by its name."""
    return cast(Formula, resolve_name(SCALARISATIONS[method].made_by)())


def _choices(shares: Sequence[Floats]) -> list[tuple[int, ...]]:
    """Which peak of each objective: all choices where they are few; else those whose sums are highest, and those that
    differ from the highest in exactly one peak.

    shares (P_i,): what the peaks of each objective add, highest first. Where peaks of several objectives tie, it takes
    all choices of these to tell that U has no descent. What lower choices would add, trials tell as they come.
    """
    counts = [len(one) for one in shares]
    if prod(counts) <= ALL_CHOICES:
        return list(product(*(range(count) for count in counts)))
    top = (0,) * len(counts)
    single = [(*top[:k], p, *top[k + 1 :]) for k, count in enumerate(counts) for p in range(1, count)]
    return list(dict.fromkeys(highest_choices(shares, HIGHEST_CHOICES) + single))


def highest_choices(shares: Sequence[Floats], most: int) -> list[tuple[int, ...]]:
    """The choices of one peak of each objective whose sums are largest, at most so many, the highest first.

    shares (P_i,): what the peaks of each objective add, highest first. From a choice, those that take the next peak of
    one objective are the next to be looked at; none of them has a larger sum (best-first search).
    """
    top = (0,) * len(shares)
    waiting, seen = [(-sum(float(peaks[0]) for peaks in shares), top)], {top}
    found: list[tuple[int, ...]] = []
    while waiting and len(found) < most:
        negative_sum, choice = heappop(waiting)
        found.append(choice)
        for k, peaks in enumerate(shares):
            p = choice[k] + 1
            after = (*choice[:k], p, *choice[k + 1 :])
            if p < len(peaks) and after not in seen:
                seen.add(after)
                heappush(waiting, (negative_sum + float(peaks[p - 1] - peaks[p]), after))
    return found


def _sorted(rows: Floats, gradients: Floats) -> tuple[Floats, Floats]:
    order = np.argsort(-rows, kind="stable")[:MOST_ROWS_OF_U]
    return rows[order], (gradients[order] if len(gradients) else gradients)
