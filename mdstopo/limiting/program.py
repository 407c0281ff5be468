"""The least radius that free forces can reach: a linear program in time whose value is never above the true one.

Cells of time with ends t_i. Of the free accelerations u(t) the program knows two averages of each cell,

    a_i = 2/h^2 int (t_i+1 - t) u dt,     b_i = 2/h^2 int (t - t_i) u dt,

with which positions and velocities at the ends follow exactly,

    x_i+1 = x_i + h v_i + h^2/2 a_i,      v_i+1 = v_i + h/2 (a_i + b_i).

Both weights are positive with integral 1, so what is in a convex set at all times has its averages there too (Jensen).
Limits on positions and velocities are asked for at the ends only. So every motion that keeps the limits gives a point
of the program with the same radius or less: nothing is above the true value, only what happens within cells is lost.
A norm in the plane is a polygon around the circle, refined by further tangents where the solution asks for them.

What is returned is computed from the multipliers (weak duality), with their residual times a generous range of the
variables taken off: the tolerances of the solver cannot lift it above the value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mdstopo.limiting.known import Cubics, Floats
from mdstopo.limiting.response import Bounded
from mdstopo.limiting.solve_linear_program import (
    InfeasibleError,
    Reduced,
    Scales,
    Solution,
    Solve,
    Tangent,
    UnsolvedError,
)
from mdstopo.limiting.system import System

#: cells at first and at most, along a line and in the plane, where there are many more rows
FIRST_CELLS, MOST_CELLS = {1: 64, 2: 32}, {1: 400, 2: 150}
#: refinements without gain after which it ends
PATIENCE = {1: 3, 2: 2}
#: what a refinement has to gain, relative
GAIN = 2e-4
#: rounds of tangents for one grid
TANGENT_ROUNDS = 12


class ImpossibleError(Exception):
    """No forces keep the limits. excess: by which share of its size some limit is exceeded, at least."""

    def __init__(self, excess: float) -> None:
        super().__init__(excess)
        self.excess = excess


class Program:
    """The linear program of one objective.

    system: what is free; rows: those with radius None are minimised together; more: times at which cells end.
    """

    def __init__(self, system: System, rows: Sequence[Bounded], more: Sequence[float] = ()) -> None:
        self.system = system
        self.times = np.unique([*system.times, *more])
        matrices = [row.matrix @ system.free for row in rows]
        basis = _row_space(matrices, system.free.shape[1])
        self.scales = _scales(system, rows)
        self.k = basis.shape[1]
        free = system.free @ basis
        self.rows = [self._reduce(row, free) for row in rows]
        self.position = free.T @ system.start / self.scales.of(0)
        self.velocity = free.T @ system.rate / self.scales.of(1)

    @property
    def is_limited(self) -> bool:
        """Whether limits of another order concern the motion whose peak is minimised.

        They do not where they look at other directions than the objective does.
        """
        goal = [row for row in self.rows if row.radius is None]
        others = [row.matrix for row in self.rows if row.source.order != goal[0].source.order]
        if not others or self.k == 0:
            return False
        own = np.concatenate([row.matrix for row in goal])
        ranks = [int(np.linalg.matrix_rank(each, 1e-9)) for each in (own, np.concatenate(others))]
        return int(np.linalg.matrix_rank(np.concatenate([own, *others]), 1e-9)) < sum(ranks)

    def least(self) -> float:
        """The bound on the radius. Raises ImpossibleError, UnsolvedError; -inf where nothing holds it."""
        goal = [row for row in self.rows if row.radius is None]
        if all(not np.any(row.matrix) for row in goal):
            return max(self._known_peak(row) for row in goal)
        try:
            return self._refine(elastic=False)
        except InfeasibleError:
            excess = self._refine(elastic=True)
            if excess <= 1e-6:
                raise UnsolvedError("the limits can only just be kept, or not at all") from None
            raise ImpossibleError(excess) from None

    def _refine(self, elastic: bool) -> float:
        """Solve on finer and finer cells until nothing is gained; the best of all bounds."""
        span, plane = self.times[-1] - self.times[0], min(self.k, 2)
        grid = np.unique(
            np.concatenate([np.linspace(self.times[0], self.times[-1], FIRST_CELLS[plane] + 1), self.times])
        )
        grid = grid[np.append(True, np.diff(grid) > 1e-9 * span)]
        best, still = -math.inf, 0
        tangents: tuple[Tangent, ...] = ()
        while True:
            found, tangents = self._with_tangents(grid, tangents, elastic)
            gain = found.bound - best
            best = max(best, found.bound)
            if best == -math.inf or (elastic and best > 1e-3):
                return best
            still = still + 1 if gain <= GAIN * max(abs(best), 1e-9) else 0
            if still == PATIENCE[plane] or not found.split.any() or len(grid) >= MOST_CELLS[plane]:
                return best
            grid = np.sort(np.concatenate([grid, 0.5 * (grid[1:] + grid[:-1])[found.split]]))

    def _with_tangents(
        self, grid: Floats, tangents: tuple[Tangent, ...], elastic: bool
    ) -> tuple[Solution, tuple[Tangent, ...]]:
        """Solve, and again with the tangents that the solution lacks; the last solution has the best bound."""
        best, still = -math.inf, 0
        for _ in range(TANGENT_ROUNDS):
            found = Solve(self, grid, tangents, elastic).solution()
            still = still + 1 if found.bound - best <= 0.1 * GAIN * max(abs(best), 1e-9) else 0
            best = found.bound
            if not found.missing or still == 3:
                break
            tangents = tuple(dict.fromkeys((*tangents, *found.missing)))
        return found, found.tangents

    def _known_peak(self, row: Reduced) -> float:
        """The peak of what no member changes: its largest value among samples."""
        grid = np.unique(np.concatenate([np.linspace(self.times[0], self.times[-1], 4001), self.times]))
        order = row.source.order
        if row.source.final:
            values = row.known.at(grid[-1:], order)
        else:
            values = np.concatenate(row.known.at_ends(grid[:-1], grid[1:], order))
        sizes = values.max(axis=1) if row.source.by_component else np.sqrt((values**2).sum(axis=1))
        return float(sizes.max())

    def _reduce(self, row: Bounded, free: Floats) -> Reduced:
        """Known functions keep their own unit of time; `Reduced.unit` is taken off where they are evaluated."""
        known = row.known.plus(_on(self.system.known.mapped(row.matrix), row.known.times))
        return Reduced(row, row.matrix @ free, known, self.scales.of(row.order))


def _on(cubics: Cubics, times: Floats) -> Cubics:
    """Both have the segments of the same system."""
    assert np.array_equal(cubics.times, times)
    return cubics


def _row_space(matrices: Sequence[Floats], f: int) -> Floats:
    """(f, k): an orthonormal basis of the free coordinates that any row sees."""
    stacked = np.concatenate([*matrices, np.zeros((1, f))])
    if f == 0:
        return np.zeros((0, 0))
    _, s, vt = np.linalg.svd(stacked)
    return np.asarray(vt[: int((s > 1e-9).sum())].T)


def _scales(system: System, rows: Sequence[Bounded]) -> Scales:
    """The travel that is allowed, and the time that it takes at the speed there is."""
    span = float(system.times[-1] - system.times[0])
    t = np.linspace(system.times[0], system.times[-1], 65)
    known = system.known
    fastest = max(float(np.abs(system.rate).max()), float(np.abs(known.at(t, 1)).max()))
    forces = [row.radius for row in rows if row.order == 2 and row.radius]
    fastest = max([fastest, *(1e-3 * each * span for each in forces)])
    radii = [row.radius for row in rows if row.order == 0 and row.radius is not None and row.radius > 0.0]
    length = max(radii) if radii else (fastest * span or 1.0)
    return Scales(length, min(span, length / fastest) if fastest > 0.0 else span)
