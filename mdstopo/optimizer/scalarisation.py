"""Several objectives as one (Section IV.B): rows whose maximum is U, built from every objective's competing peaks.

Each objective G_i (negated where it is to be maximised) is the maximum of its peaks G_ip; g is Eq. 24 of it. Then

    weighted_exponential   U = sum_i w_i sign(g_i) |g_i|^p        (Eq. 23)     one row for each choice of peaks p_i
    weighted_sum           U = sum_i w_i g_i                                   the same
    weighted_product       U = prod_i G_i^w_i, of raw values                   the same
    weighted_min_max       U = max_i w_i g_i                                   one row a peak
    nbi                    U = 1 + max_i (g_i - a_i) / r_i                     one row a peak
    nc                     U = g_k,  and rows  sum_i n_i (g_i - a_i) <= 0      one row a peak; one for each choice

or those that differ from the highest in one peak where choices are many, so that the bound formulation sees every peak.
`nbi` is normal boundary intersection (Das and Dennis 1998) in the form of Pascoletti and Serafini, whose inequalities
reach every point of a front; 1 keeps U away from zero, to which tolerances are relative. `nc` is the normal constraint
(Messac, Ismail-Yahaya and Mattson 2003).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod

import numpy as np

from mdstopo.optimizer.problem import Floats

#: rows that one U has at most, choices of peaks that are all taken, and peaks of one objective in a plane of `nc`
ROWS, CHOICES, PEAKS = 120, 36, 6

#: values (P,) of an objective's peaks, highest first, and their gradients (P, N); no rows where none were asked for
Part = tuple[Floats, Floats]


class NotPositiveError(ValueError):
    """A weighted product of a value that is not positive."""


@dataclass(frozen=True)
class Scalarisation:
    """One U of m objectives.

    weights (m,): those of weight 0 take no part (method nbi, nc: all take part). lowest, highest (m,): utopia and
    maxima of Eq. 24, of signed values; None: raw values. exponent: p. anchor, normal (m,): a and r of nbi; anchor and
    planes (c, m): a and the rows n of nc, whose k is the last objective.
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
        if self.method in ("nbi", "nc"):
            return list(range(len(self.weights)))
        return [i for i, weight in enumerate(self.weights.tolist()) if weight > 0.0]

    def transformed(self, values: Floats, i: int) -> tuple[Floats, float]:
        """g of values of objective i (Eq. 24), and its slope."""
        if self.lowest is None or self.highest is None:
            return values, 1.0
        width = float(self.highest[i] - self.lowest[i])
        return (values - self.lowest[i]) / width, 1.0 / width

    def values(self, signed: Floats) -> Floats:
        """U (K,) of designs with one value (K, m) each; NaN where there is none. Planes of nc are not part of it."""
        active = self.active
        raw, weights = signed[:, active], self.weights[active]
        if self.method == "weighted_product":
            with np.errstate(invalid="ignore", divide="ignore"):
                logs = np.log(np.where(raw > 0.0, raw, np.nan))
            return np.asarray(np.exp(logs @ weights))
        g = self._transformed_all(signed)[:, active]
        if self.method == "nbi":
            return np.asarray((1.0 + (g - self.anchor) / self.normal).max(axis=1))
        if self.method == "nc":
            return np.asarray(g[:, -1])
        if self.method == "weighted_min_max":
            return np.asarray((weights * g).max(axis=1))
        p = 1.0 if self.method == "weighted_sum" else self.exponent
        return np.asarray((weights * np.sign(g) * np.abs(g) ** p).sum(axis=1))

    def excesses(self, signed: Floats) -> Floats:
        """By how much values (K, m) exceed the planes of nc, (K,) added up; 0 where feasible."""
        if not len(self.planes):
            return np.zeros(len(signed))
        beyond = (self._transformed_all(signed) - self.anchor) @ self.planes.T
        return np.asarray(np.maximum(beyond, 0.0).sum(axis=1))

    def _transformed_all(self, signed: Floats) -> Floats:
        if self.lowest is None or self.highest is None:
            return signed
        return np.asarray((signed - self.lowest) / (self.highest - self.lowest))

    def rows(self, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """Rows (R,), highest first, and gradients (R, N), from the active objectives' parts.

        Raises NotPositiveError, with the place among the active objectives as its argument.
        """
        if self.method in ("weighted_min_max", "nbi", "nc"):
            return _sorted(*self._single(parts))
        terms = [self._term(i, values, k) for k, (i, (values, _)) in enumerate(zip(self.active, parts, strict=True))]
        rows, gradients = [], []
        wanted = all(len(part[1]) for part in parts)
        for choice in _choices([len(values) for values, _ in terms]):
            total = sum(float(terms[k][0][p]) for k, p in enumerate(choice))
            slopes = [float(terms[k][1][p]) for k, p in enumerate(choice)]
            if self.method == "weighted_product":
                total = float(np.exp(total))
                slopes = [total * slope for slope in slopes]
            rows.append(total)
            if wanted:
                gradients.append(sum(slopes[k] * parts[k][1][p] for k, p in enumerate(choice)))
        return _sorted(np.array(rows), np.array(gradients) if wanted else np.zeros((0, 0)))

    def limits(self, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        """Constraint rows (C,) and gradients (C, N), feasible where <= 0; of a fixed number: the last repeated."""
        values: list[float] = []
        slopes: list[Floats] = []
        for plane in self.planes:
            # where a plane falls with an objective, its highest peak alone counts
            counts = [min(len(part[0]), PEAKS) if n > 0.0 else 1 for n, part in zip(plane, parts, strict=True)]
            choices = list(product(*(range(count) for count in counts)))
            found = []
            for choice in choices[:PEAKS]:
                total, slope = 0.0, np.zeros(parts[0][1].shape[1])
                for i, p in enumerate(choice):
                    g, factor = self.transformed(parts[i][0][p : p + 1], i)
                    total += plane[i] * (float(g[0]) - self.anchor[i])
                    if len(parts[i][1]):
                        slope = slope + plane[i] * factor * parts[i][1][p]
                found.append((total, slope))
            found.sort(key=lambda each: -each[0])
            found += [found[-1]] * (PEAKS - len(found))
            values += [each[0] for each in found]
            slopes += [each[1] for each in found]
        return np.array(values), np.array(slopes).reshape(len(values), parts[0][1].shape[1])

    def _single(self, parts: Sequence[Part]) -> tuple[Floats, Floats]:
        rows, gradients = [], []
        for i, (values, slopes) in zip(self.active, parts, strict=True):
            if self.method == "nc" and i != len(self.weights) - 1:
                continue
            g, factor = self.transformed(values, i)
            scale, shift = float(self.weights[i]), 0.0
            if self.method == "nbi":
                scale, shift = 1.0 / float(self.normal[i]), 1.0 - float(self.anchor[i]) / float(self.normal[i])
            elif self.method == "nc":
                scale = 1.0
            rows.append(scale * g + shift)
            gradients.append(scale * factor * slopes)
        return np.concatenate(rows), np.concatenate(gradients)

    def _term(self, i: int, values: Floats, k: int) -> tuple[Floats, Floats]:
        """An objective's share of the sum, and its slope by G, at its peaks."""
        weight = float(self.weights[i])
        if self.method == "weighted_product":
            if np.any(values <= 0.0):
                raise NotPositiveError(k)
            return weight * np.log(values), weight / values
        g, factor = self.transformed(values, i)
        p = 1.0 if self.method == "weighted_sum" else self.exponent
        size = np.abs(g)
        with np.errstate(divide="ignore"):
            slope = np.ones_like(g) if p == 1.0 else p * size ** (p - 1.0)
        return weight * np.sign(g) * size**p, weight * slope * factor


def _choices(counts: Sequence[int]) -> list[tuple[int, ...]]:
    """Which peak of each objective: all choices where they are few, else those in which one is not the highest.

    What the others would add, trials tell as they come: their highest choice is always among these.
    """
    if prod(counts) <= CHOICES:
        return list(product(*(range(count) for count in counts)))
    top = (0,) * len(counts)
    return [top] + [(*top[:k], p, *top[k + 1 :]) for k, count in enumerate(counts) for p in range(1, count)]


def _sorted(rows: Floats, gradients: Floats) -> tuple[Floats, Floats]:
    order = np.argsort(-rows, kind="stable")[:ROWS]
    return rows[order], (gradients[order] if len(gradients) else gradients)
