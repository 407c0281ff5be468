"""The linear systems of the interior point in `conic`, reduced to the variables or to the rows, whichever is cheaper.

    (P + D) dv + G' dy + A' da = r_v        D: the diagonal that the bounds leave
    E de + C' dy = r_e                      E: that of the elastic variables, none for the objective
    G dv + C de - S dy = r_y                S: slack over multiplier, a diagonal
    A dv - L da = r_a                       L: slack over multiplier, 0 of an equality

C has one entry a row: that of its level.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from mdstopo.optimizer.curvature import Curvature
from mdstopo.optimizer.problem import Floats, Ints

#: slack over multiplier, in the scaled problem, below which a row is all but active
ACTIVE = 1e-3

#: passes after which the largest entry of each row of a system is near one (D. Ruiz, 2001)
SCALINGS = 4

#: dv (N,), de (J + 1,), dy (R,), da (m,)
Step = tuple[Floats, Floats, Floats, Floats]


@dataclass(frozen=True, slots=True)
class Rows:
    """G (R, N); the level (R,) and the entry (R,) of C; S (R,)."""

    G: Floats
    level: Ints
    C: Floats
    S: Floats


class Reduced(ABC):
    """One problem's system: factored for a point, then solved for several right sides.

    P: the curvature (N, N); A (m, N): the linear rows; groups: J + 1.
    """

    def __init__(self, P: Curvature, A: Floats, groups: int) -> None:
        self.P, self.A, self.groups = P, A, groups
        self.n = A.shape[1]

    @abstractmethod
    def factor(self, D: Floats, rows: Rows, L: Floats, E: Floats) -> None:
        """Take D (N,), the rows, L (m,) and E (J,). Raises LinAlgError where the system is singular."""

    @abstractmethod
    def solve(self, r_v: Floats, r_e: Floats, r_y: Floats, r_a: Floats) -> Step:
        """The step for right sides of the shapes of `Step`."""


class ByVariables(Reduced):
    """Rows eliminated but those that are all but active: a symmetric system of the variables, the levels, the linear
    rows and the rows that are left.

    The changes of the multipliers of eliminated rows are quotients by their S, which multiply the rounding of the
    solution: of rows that are all but active nothing would be left of them.
    """

    def factor(self, D: Floats, rows: Rows, L: Floats, E: Floats) -> None:
        n, g, m = self.n, self.groups, len(L)
        self.rows = rows
        self.kept = rows.S < ACTIVE
        whole = np.zeros((len(rows.S), n + g))
        whole[:, :n] = rows.G
        whole[np.arange(len(rows.S)), n + rows.level] = rows.C
        self.gone, stay = whole[~self.kept], whole[self.kept]
        self.weight = 1.0 / rows.S[~self.kept]
        first, size = n + g + m, n + g + m + len(stay)
        M = np.zeros((size, size))
        M[: n + g, : n + g] = self.gone.T @ (self.gone * self.weight[:, None])
        M[:n, :n] += self.P.dense()
        M[np.arange(n), np.arange(n)] += D
        M[np.arange(n + 1, n + g), np.arange(n + 1, n + g)] += E
        M[n + g : first, :n] = self.A
        M[:n, n + g : first] = self.A.T
        M[first:, : n + g] = stay
        M[: n + g, first:] = stay.T
        M[np.arange(n + g, size), np.arange(n + g, size)] = -np.concatenate([L, rows.S[self.kept]])
        self.inverse = _Inverse(M)

    def solve(self, r_v: Floats, r_e: Floats, r_y: Floats, r_a: Floats) -> Step:
        n, g = self.n, self.groups
        right = np.concatenate([r_v, r_e, r_a, r_y[self.kept]])
        right[: n + g] += self.gone.T @ (r_y[~self.kept] * self.weight)
        found = self.inverse.times(right)
        dy = np.empty(len(r_y))
        dy[~self.kept] = (self.gone @ found[: n + g] - r_y[~self.kept]) * self.weight
        first = n + g + len(r_a)
        dy[self.kept] = found[first:]
        return found[:n], found[n : n + g], dy, found[n + g : first]


class ByRows(Reduced):
    """Variables eliminated: a symmetric system of the curvature's rank, the rows, the linear rows and the levels."""

    def factor(self, D: Floats, rows: Rows, L: Floats, E: Floats) -> None:
        k, m, rank = len(rows.S), len(L), len(self.P.weight)
        self.Q = np.concatenate([self.P.factor.T, rows.G, self.A])
        self.inverse_diagonal = 1.0 / (self.P.diagonal + D)
        count, self.first = rank + k + m, rank
        size = count + self.groups
        T = np.zeros((size, size))
        T[:count, :count] = (self.Q * self.inverse_diagonal) @ self.Q.T
        T[np.arange(count), np.arange(count)] += np.concatenate([1.0 / self.P.weight, rows.S, L])
        places = np.arange(rank, rank + k), count + rows.level
        T[places] = -rows.C
        T[places[::-1]] = -rows.C
        T[np.arange(count + 1, size), np.arange(count + 1, size)] = -E
        self.inverse = _Inverse(T)

    def solve(self, r_v: Floats, r_e: Floats, r_y: Floats, r_a: Floats) -> Step:
        count, first, last = len(self.Q), self.first, self.first + len(r_y)
        right = np.concatenate([self.Q @ (self.inverse_diagonal * r_v), -r_e])
        right[first:last] -= r_y
        right[last:count] -= r_a
        found = self.inverse.times(right)
        dv = self.inverse_diagonal * (r_v - self.Q.T @ found[:count])
        return dv, found[count:], found[first:last], found[last:count]


class _Inverse:
    """The inverse of a dense symmetric matrix, scaled to a diagonal of ones.

    Raises LinAlgError where the matrix is singular or not finite.
    """

    def __init__(self, M: Floats) -> None:
        self.scale = np.ones(len(M))
        for _ in range(SCALINGS):
            largest = np.sqrt(np.abs(M * self.scale).max(axis=1, initial=0.0) * self.scale)
            self.scale /= np.where(largest > 0.0, largest, 1.0)
        self.M = M * self.scale[:, None] * self.scale
        if not np.isfinite(self.M).all():
            raise np.linalg.LinAlgError
        self.inverse = np.linalg.inv(self.M)

    def times(self, right: Floats) -> Floats:
        """The solution for a right side, after two steps of iterative refinement."""
        scaled = right * self.scale
        found = self.inverse @ scaled
        for _ in range(2):
            found += self.inverse @ (scaled - self.M @ found)
        return np.asarray(found * self.scale)


def reduced(P: Curvature, A: Floats, groups: int, rows: int) -> Reduced:
    """The cheaper system of the two, for so many rows."""
    n, others = A.shape[1], len(P.weight) + rows
    by_variables = P.matrix is not None or n**3 + others * n**2 <= others**3 + others**2 * n
    return (ByVariables if by_variables else ByRows)(P, A, groups)
