"""One linear program of limiting performance: its rows, its solution, its certificate, and where it is too coarse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.limiting.known import Cubics, Floats
from mdstopo.limiting.response import Bounded

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from mdstopo.limiting.program import Program

#: what a norm may exceed its circle by, relative
TANGENT = 3e-4
#: new tangents of a row in one round, and how far their directions are apart at least, rad
NEW_TANGENTS, TANGENTS_APART = 4, 0.01
#: directions of a polygon at first
CORNERS = 16
#: the range of a variable, in sizes of the largest value of its kind in the solution, that residuals are taken times
RANGE = 1e3


class UnsolvedError(Exception):
    """The linear program could not be solved; the message says what the solver said."""


class InfeasibleError(Exception):
    """The solver finds no point that keeps the limits."""


@dataclass(frozen=True)
class Scales:
    """Units of length, m, and time, s, in which numbers are near one."""

    length: float
    time: float

    def of(self, order: int) -> float:
        """The unit by which a derivative of position of this order is scaled."""
        return self.length / self.time**order


@dataclass(frozen=True)
class Reduced:
    """A row on the free coordinates xi (k,), in units: y = matrix xi + known, |y| <= radius or <= z."""

    source: Bounded
    matrix: Floats
    known: Cubics
    unit: float

    @property
    def radius(self) -> float | None:
        """The radius of the set, in scaled units; None where it is what is minimised."""
        return None if self.source.radius is None else self.source.radius / self.unit

    @property
    def round(self) -> bool:
        """Whether the set is a disc: whether the norm in the plane is bounded, not each component."""
        return not self.source.by_component and len(self.matrix) == 2

    def directions(self) -> Floats:
        """(d, r) normals of the half-planes asked for everywhere."""
        r = len(self.matrix)
        if self.source.by_component:
            return np.eye(r)
        if r == 1:
            return np.array([[1.0], [-1.0]])
        angles = 2.0 * math.pi * np.arange(CORNERS) / CORNERS
        return np.stack([np.cos(angles), np.sin(angles)], axis=1)


@dataclass(frozen=True)
class Tangent:
    """A further half-plane of a row, at all of its places."""

    row: int
    normal: tuple[float, ...]


@dataclass(frozen=True)
class Solution:
    """The solution of a linear program. bound: certified, in the objective's own unit; the rest says where to refine:
    see `_refined`."""

    bound: float
    split: NDArray[np.bool_]
    tangents: tuple[Tangent, ...]
    missing: tuple[Tangent, ...]


class Solve:
    """One linear program: variables x, v (N + 1, k), a, b (N, k), z, one after the other."""

    def __init__(self, program: Program, grid: Floats, tangents: Sequence[Tangent], elastic: bool) -> None:
        self.p, self.grid, self.elastic, self.tangents = program, grid, elastic, tangents
        self.n, self.k = len(grid) - 1, program.k
        self.h = np.diff(grid) / program.scales.time
        ends, cells = (self.n + 1) * self.k, self.n * self.k
        self.first = np.cumsum([0, ends, ends, cells, cells]).tolist()
        self.size = self.first[-1] + 1
        #: of every row of the program: (row, place, normal); places of cells: a first, then b
        self.marks: list[tuple[int, Any, Floats]] = []
        self.parts: list[Any] = []
        self.right: list[Floats] = []
        self.y: list[tuple[Any, Floats]] = [self._sees(row) for row in program.rows]
        for index in range(len(program.rows)):
            self._ask(index)

    def solution(self) -> Solution:
        """The solution of the linear program. Raises InfeasibleError or UnsolvedError."""
        from scipy.optimize import linprog
        from scipy.sparse import vstack

        upper, right = vstack(self.parts).tocsr(), np.concatenate(self.right)
        equal, level = self._motion()
        cost = np.zeros(self.size)
        cost[-1] = 1.0
        low, high = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        low[-1] = 0.0 if self.elastic or not self._signed() else -np.inf
        found = linprog(cost, upper, right, equal, level, np.stack([low, high], axis=1), method="highs")
        if found.status == 2:
            raise InfeasibleError
        if found.status == 3:
            nothing = np.zeros(self.n, dtype=np.bool_)
            return Solution(-math.inf, nothing, (), ())
        if found.status != 0:
            raise UnsolvedError(str(found.message))
        price = np.maximum(-found.ineqlin.marginals, 0.0)
        bound = self._certified(found, cost, (upper, right, price), (equal, level), low[-1])
        unit = 1.0 if self.elastic else self._unit()
        return Solution(bound * unit, self._split(found.x, price), self._kept(price), self._missing(found.x, price))

    def _signed(self) -> bool:
        """Whether what is minimised may be negative."""
        return any(row.source.by_component for row in self.p.rows if row.radius is None)

    def _unit(self) -> float:
        return next(row.unit for row in self.p.rows if row.radius is None)

    def _motion(self) -> tuple[Any, Floats]:
        """The equations of x and v, with those of the start."""
        from scipy.sparse import csr_matrix, diags, eye, hstack, kron, vstack

        n, unit = self.n, eye(self.k)
        step = diags([-1.0, 1.0], [0, 1], shape=(n, n + 1))
        here = diags([1.0], [0], shape=(n, n + 1))
        h = diags(self.h)
        zero = csr_matrix((n * self.k, n * self.k))
        none = csr_matrix((n * self.k, 1))
        x = hstack([kron(step, unit), -kron(h @ here, unit), -kron(0.5 * h @ h, unit), zero, none])
        v = hstack([zero_wide(n, self.k), kron(step, unit), -kron(0.5 * h, unit), -kron(0.5 * h, unit), none])
        start = csr_matrix(
            (np.ones(2 * self.k), (np.arange(2 * self.k), np.r_[: self.k, self.first[1] : self.first[1] + self.k])),
            shape=(2 * self.k, self.size),
        )
        level = np.concatenate([np.zeros(2 * n * self.k), self.p.position, self.p.velocity])
        return vstack([x, v, start]).tocsr(), level

    def _sees(self, row: Reduced) -> tuple[Any, Floats]:
        """(matrix of y over all variables, (places r, size); known parts (places, r)), in units."""
        from scipy.sparse import csr_matrix, hstack, kron, vstack

        source, r = row.source, len(row.matrix)
        if source.order < 2:
            places = np.array([self.n]) if source.final else np.arange(self.n + 1)
            pick = csr_matrix((np.ones(len(places)), (np.arange(len(places)), places)), shape=(len(places), self.n + 1))
            first = self.first[source.order]
            blocks = [csr_matrix((len(places) * r, first)), kron(pick, row.matrix)]
            blocks.append(csr_matrix((len(places) * r, self.size - first - (self.n + 1) * self.k)))
            return hstack(blocks).tocsr(), row.known.at(self.grid[places], source.order) / row.unit
        count = self.n
        if source.until is not None:
            count = int((self.grid[1:] <= source.until * (1.0 + 1e-12)).sum())
        early, late = row.known.at_ends(self.grid[:count], self.grid[1 : count + 1], 2)
        averages = np.concatenate([(2.0 * early + late) / 3.0, (early + 2.0 * late) / 3.0]) / row.unit
        pick = csr_matrix((np.ones(count), (np.arange(count), np.arange(count))), shape=(count, self.n))
        own = kron(pick, row.matrix)
        before = csr_matrix((count * r, self.first[2]))
        other = csr_matrix((count * r, self.n * self.k))
        none = csr_matrix((count * r, 1))
        return vstack([hstack([before, own, other, none]), hstack([before, other, own, none])]).tocsr(), averages

    def _ask(self, index: int) -> None:
        """The half-planes of a row: those everywhere, then its tangents."""
        row, (_, known) = self.p.rows[index], self.y[index]
        if self.elastic and row.radius is None:
            return
        every = np.arange(len(known))
        for normal in row.directions():
            self._add(index, every, np.tile(normal, (len(every), 1)))
        for tangent in self.tangents:
            if tangent.row == index:
                self._add(index, every, np.tile(tangent.normal, (len(every), 1)))

    def _add(self, index: int, places: Any, normals: Floats) -> None:
        from scipy.sparse import csr_matrix

        row, (matrix, known) = self.p.rows[index], self.y[index]
        r = len(row.matrix)
        lines = np.repeat(np.arange(len(places)), r)
        columns = (places[:, None] * r + np.arange(r)).ravel()
        part = csr_matrix((normals.ravel(), (lines, columns)), shape=(len(places), len(known) * r)) @ matrix
        if row.radius is None:
            loose, limit = 1.0, 0.0
        elif self.elastic:
            loose, limit = (row.radius if row.radius > 0.0 else 1.0), row.radius
        else:
            loose, limit = 0.0, row.radius
        if loose:
            lines, last = np.arange(len(places)), np.full(len(places), self.size - 1)
            part = part + csr_matrix((np.full(len(places), -loose), (lines, last)), shape=part.shape)
        self.parts.append(part)
        self.right.append(limit - (normals * known[places]).sum(axis=1))
        self.marks.append((index, places, normals))

    def _certified(
        self, found: Any, cost: Floats, upper: tuple[Any, Floats, Floats], equal: tuple[Any, Floats], low: float
    ) -> float:
        """Weak duality: b . y + min over the variables' range of (c - A' y) . x."""
        (matrix, right, price), (motion, level) = upper, equal
        force = found.eqlin.marginals
        rest = cost + matrix.T @ price - motion.T @ force
        reach = np.empty(self.size)
        for first, last in zip(self.first, [*self.first[1:], self.size], strict=True):
            own = found.x[first:last]
            reach[first:last] = RANGE * (1.0 + np.abs(own).max(initial=0.0))
        if low == 0.0:
            rest[-1] = min(rest[-1], 0.0)  # z >= 0
        return float(level @ force - right @ price - np.abs(rest) @ reach)

    # -- where to refine

    def _values(self, index: int, x: Floats) -> Floats:
        """(places, r) of a row at a solution."""
        matrix, known = self.y[index]
        return np.asarray((matrix @ x).reshape(known.shape) + known)

    def _missing(self, x: Floats, price: Floats) -> tuple[Tangent, ...]:
        """Tangents for what exceeds the circles most, where it matters: at places that have a multiplier."""
        found = []
        weights = self._weights(price)
        for index, row in enumerate(self.p.rows):
            if not row.round or (self.elastic and row.radius is None):
                continue
            y = self._values(index, x)
            size = np.hypot(*y.T)
            z = x[-1]
            radius = z if row.radius is None else row.radius * (1.0 + (z if self.elastic else 0.0))
            over = (size - radius) * (weights[index] > 1e-10 * max(weights[index].max(), 1e-300))
            angles = np.arctan2(y[:, 1], y[:, 0])
            chosen: list[float] = []
            for place in np.argsort(-over * weights[index], kind="stable"):
                if over[place] <= TANGENT * max(radius, 1e-9) or len(chosen) == NEW_TANGENTS:
                    break
                if all(abs(math.remainder(angles[place] - other, 2.0 * math.pi)) > TANGENTS_APART for other in chosen):
                    chosen.append(float(angles[place]))
            found += [Tangent(index, (math.cos(angle), math.sin(angle))) for angle in chosen]
        return tuple(found)

    def _weights(self, price: Floats) -> list[Floats]:
        """(places,) of each row: the sum of its multipliers."""
        weights = [np.zeros(len(known)) for _, known in self.y]
        first = 0
        for index, places, _ in self.marks:
            weights[index][places] += price[first : first + len(places)]
            first += len(places)
        return weights

    def _kept(self, price: Floats) -> tuple[Tangent, ...]:
        """The tangents that hold the solution anywhere, for the next grid."""
        kept, first = [], 0
        for index, places, normals in self.marks:
            if np.any(price[first : first + len(places)] > 1e-12):
                kept.append(Tangent(index, tuple(normals[0].tolist())))
            first += len(places)
        return tuple(tangent for tangent in kept if tangent in self.tangents)

    def _split(self, x: Floats, price: Floats) -> NDArray[np.bool_]:
        """The cells within which a limit is exceeded by the motion that the averages suggest, or the objective is.

        Within a cell u is taken as linear with both averages: from 2 a - b to 2 b - a. Where the motion does not matter
        the solution is arbitrary, so cells come first in which or beside which a row has a multiplier.
        """
        split = np.zeros(self.n, dtype=np.bool_)
        for row in self.p.rows:
            if (self.elastic and row.radius is None) or row.source.final:
                continue
            z = x[-1]
            radius = z if row.radius is None else row.radius * (1.0 + (z if self.elastic else 0.0))
            excess = np.max([_size(row, each) for each in self._middles(row, x)], axis=0) - radius
            split[: len(excess)] |= excess > 3.0 * TANGENT * max(abs(radius), 1e-6)
        matters = split & self._held(price)
        return matters if matters.any() else split

    def _held(self, price: Floats) -> NDArray[np.bool_]:
        """Cells with a row that has a multiplier, in them or at one of their ends."""
        held, first = np.zeros(self.n, dtype=np.bool_), 0
        for index, places, _ in self.marks:
            own = places[price[first : first + len(places)] > 1e-10]
            first += len(places)
            source = self.p.rows[index].source
            if source.order == 2:
                held[own % max(len(self.y[index][1]) // 2, 1)] = True
            else:
                ends = np.full(len(own), self.n) if source.final else own
                held[np.minimum(ends, self.n - 1)] = True
                held[np.maximum(ends - 1, 0)] = True
        return held

    def _middles(self, row: Reduced, x: Floats) -> list[Floats]:
        """y (cells, r) at a quarter, a half and three quarters of each cell; of order 2 at its ends."""
        n, k, h = self.n, self.k, self.h[:, None]
        parts = [x[a:b].reshape(-1, k) for a, b in zip(self.first, [*self.first[1:], self.size - 1], strict=True)][:4]
        position, velocity, a, b = parts
        begin, slope = 2.0 * a - b, 3.0 * (b - a)
        found = []
        for share in (0.25, 0.5, 0.75) if row.source.order < 2 else (0.0, 1.0):
            s = share * h
            if row.source.order == 0:
                xi = position[:-1] + s * (velocity[:-1] + s * (0.5 * begin + slope * share / 6.0))
            elif row.source.order == 1:
                xi = velocity[:-1] + s * (begin + 0.5 * slope * share)
            else:
                xi = begin + slope * share
            ends = self.grid[:-1] + share * np.diff(self.grid)
            known = (
                row.known.at_ends(self.grid[:-1], ends, row.source.order)[1]
                if share
                else row.known.at(self.grid[:-1], row.source.order)
            )
            y = xi @ row.matrix.T + known / row.unit
            if row.source.until is not None:
                y = y[: int((self.grid[1:] <= row.source.until * (1.0 + 1e-12)).sum())]
            found.append(y)
        assert all(len(each) <= n for each in found)
        return found


def zero_wide(n: int, k: int) -> csr_matrix:
    """A sparse matrix (n k, (n + 1) k) of zeros."""
    from scipy.sparse import csr_matrix

    return csr_matrix((n * k, (n + 1) * k))


def _size(row: Reduced, y: Floats) -> Floats:
    return np.asarray(y.max(axis=1) if row.source.by_component else np.sqrt((y**2).sum(axis=1)))
