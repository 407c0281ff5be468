"""The subproblem of rows that are lines or norms of two-vectors, solved by a primal-dual interior point.

    minimise   e_0 + sum_j penalty_j e_j + d'B d/2              j = 1 ... J
    subject to f_r + g_r.d <= e_j                             a line of group j
               |(u_r + g_r.d, v_r + p_r.d)| <= e_j + c_r      a norm of group j
               e_j >= 0 (j >= 1),  A d <= b or A d = b,  lower <= d <= upper

Group 0 is the objective, the others are constraints with one elastic variable each. Search directions are those of
Nesterov and Todd (1997) with Mehrotra's corrector; for cones of dimension three the scaling has a closed form
(L. Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010). Bounds are eliminated variable by
variable. What is left is one dense system: of the size of the variables where these are few, else of the size of the
rows (`reduced`).
"""

from dataclasses import dataclass

import numpy as np

from mdstopo.optimizer.conic_kernels import RESIDUAL, interior
from mdstopo.optimizer.curvature import Curvature
from mdstopo.optimizer.problem import Floats, Ints, LinearRows, largest_of_groups


@dataclass(frozen=True, slots=True)
class Lines:
    """Rows f + g.d: value (K,), slope (K, N), group (K,)."""

    value: Floats
    slope: Floats
    group: Ints


@dataclass(frozen=True, slots=True)
class Norms:
    """Rows |(u + g.d, v + p.d)| - c: vector (K, 2), slope (K, N), across (K, N), excess c (K,), group (K,)."""

    vector: Floats
    slope: Floats
    across: Floats
    excess: Floats
    group: Ints


@dataclass(frozen=True, slots=True)
class Program:
    """A subproblem; lower <= 0 <= upper and lower < upper (N,), penalty (J,), `linear` with b for the step d."""

    lower: Floats
    upper: Floats
    lines: Lines
    norms: Norms
    penalty: Floats
    linear: LinearRows
    curvature: Curvature


@dataclass(frozen=True, slots=True)
class Solution:
    """d (N,); level (J + 1,): e of the groups; multipliers of the lines (KL,), norms (KC,) and linear rows (m,); steps
    of the interior point; solved: whether it counts as a solution, with gap, the mean complementarity, and residual,
    the largest of the optimality conditions, both of the scaled problem."""

    d: Floats
    level: Floats
    lines: Floats
    norms: Floats
    linear: Floats
    steps: int
    solved: bool
    gap: float
    residual: float


def solve(program: Program) -> Solution:
    """Solve the program; `Solution.solved` tells whether that succeeded.

    The objective, group 0, needs a row. Raises AssertionError where numbers of the program are not finite.
    """
    with np.errstate(all="ignore"):  # what is not finite ends the iteration
        return _Interior(program).solve()


class _Interior:
    """The scaled problem, which is solved by `conic_kernels`, and the way back to the units of the program."""

    def __init__(self, program: Program) -> None:
        self.program = program
        lines, norms, linear = program.lines, program.norms, program.linear
        self.width = program.upper - program.lower
        self.n, self.groups = len(self.width), len(program.penalty) + 1
        self.group = np.concatenate([lines.group, norms.group])
        slopes = np.concatenate([lines.slope, norms.slope, norms.across]) * self.width
        steepest = np.abs(slopes).max(axis=1, initial=0.0)
        along, beside = steepest[len(lines.group) : len(self.group)], steepest[len(self.group) :]
        steepest = np.concatenate([steepest[: len(lines.group)], np.maximum(along, beside)])
        scale = largest_of_groups(steepest, self.group, self.groups)
        self.scale = scale = np.where(scale > 0.0, scale, 1.0)
        self.at = -program.lower / self.width  # where d = 0 is, in v
        by = scale[np.concatenate([self.group, norms.group])]
        self.slopes = slopes / by[:, None]
        # levels are counted from the highest row at d = 0
        size = np.sqrt(norms.vector[:, 0] ** 2 + norms.vector[:, 1] ** 2)
        highest = largest_of_groups(np.concatenate([lines.value, size - norms.excess]), self.group, self.groups)[0]
        self.base = np.zeros(self.groups)
        self.base[0] = highest if np.isfinite(highest) else 0.0
        values = np.concatenate([lines.value - self.base[lines.group], norms.vector[:, 0], norms.vector[:, 1]])
        self.values = values / by - _times(self.slopes, self.at)
        self.excess = (norms.excess + self.base[norms.group]) / scale[norms.group]
        self.penalty = program.penalty * scale[1:] / scale[0]
        self.order = np.argsort(linear.equal, kind="stable")  # limits, then equalities
        A = linear.A[self.order] * self.width
        row = np.abs(A).max(axis=1, initial=0.0)
        self.row_scale = np.where(row > 0.0, row, 1.0)
        self.A = A / self.row_scale[:, None]
        self.b = linear.b[self.order] / self.row_scale + _times(self.A, self.at)
        self.limits = len(linear) - int(linear.equal.sum())

    def solve(self) -> Solution:
        """The solution, from a point inside all cones."""
        curved = self.program.curvature.scaled(self.width, float(self.scale[0]))
        matrix = np.zeros((0, 0)) if curved.matrix is None else curved.matrix
        # in C order whatever the program's: another layout would be compiled anew
        slopes, A, factor, matrix = (np.ascontiguousarray(x) for x in (self.slopes, self.A, curved.factor.T, matrix))
        point = self._start()
        steps, solved, gap, worst = interior(
            slopes, self.values, self.group, self.excess, A, self.b, self.penalty, self.at,
            curved.diagonal, factor, curved.weight, matrix, *point,
        )  # fmt: skip
        assert gap < np.inf
        return self._solution(*point, steps, solved, gap, worst)

    def _start(self) -> tuple[Floats, Floats, Floats]:
        """A point as `conic_kernels` has it: near the iterate, levels above all rows."""
        lines, norms = len(self.program.lines.group), len(self.program.norms.group)
        v = np.clip(self.at, 0.1, 0.9)
        here = self.values + _times(self.slopes, v)
        line, vector = here[:lines], here[lines:].reshape(2, norms)
        size = np.sqrt(vector[0] ** 2 + vector[1] ** 2)
        mu = 0.1
        e = largest_of_groups(np.concatenate([line, size - self.excess]), self.group, self.groups)
        e[1:] = np.maximum(e[1:], 0.0)
        e = np.where(np.isfinite(e), e, 0.0) + mu
        counts = np.bincount(self.group, minlength=self.groups)
        elastic = np.minimum(0.5 * self.penalty, 1.0)
        top = np.concatenate([[1.0], elastic]) / np.maximum(counts, 1)
        cone = np.zeros((2, norms, 3))
        cone[0, :, 0] = np.maximum(e[self.group[lines:]] + self.excess, size + mu)
        cone[0, :, 1:] = vector.T
        cone[1, :, 0] = top[self.group[lines:]]
        limit = np.maximum((self.b - _times(self.A, v))[: self.limits], mu)
        z = np.full(self.n, mu)
        pair = np.stack([
            np.concatenate([v, 1.0 - v, e[self.group[:lines]] - line, limit, e[1:]]),
            np.concatenate([z, z, top[self.group[:lines]], np.full(self.limits, mu), self.penalty - elastic]),
        ])  # fmt: skip
        free = np.zeros(1 + len(self.b) - self.limits)
        free[0] = e[0]
        return pair, cone, free

    def _solution(
        self, pair: Floats, cone: Floats, free: Floats, steps: int, solved: bool, gap: float, worst: float
    ) -> Solution:
        """A point in the units of the program; d at a bound is that bound to the bit.

        pair, cone, free: the point, as `conic_kernels` has it.
        steps, solved, gap, worst: as of `Solution`.
        """
        program, n, lines = self.program, self.n, len(self.program.lines.group)
        (v, upper_gap), (z_lower, z_upper) = pair[:, : 2 * n].reshape(2, 2, n)
        # the nearer end tells the place: from the farther it would be rounding
        d = np.where(v < upper_gap, program.lower + v * self.width, program.upper - upper_gap * self.width)
        d = np.where((z_lower > v) & (v < 1e-6), program.lower, d)
        d = np.where((z_upper > upper_gap) & (upper_gap < 1e-6), program.upper, d)
        by = self.scale[0]
        places = np.cumsum([2 * n, lines, self.limits])
        _, y_line, y_limit, _ = np.split(pair[1], places)
        linear = np.empty(len(self.b))
        linear[self.order] = np.concatenate([y_limit, free[1:]]) * by / self.row_scale
        return Solution(
            d=self._on_rows(d),
            level=np.concatenate([free[:1], pair[0, places[2] :]]) * self.scale + self.base,
            lines=y_line * by / self.scale[program.lines.group],
            norms=cone[1, :, 0] * by / self.scale[program.norms.group],
            linear=linear,
            steps=steps,
            solved=solved,
            gap=gap,
            residual=worst,
        )

    def _on_rows(self, d: Floats) -> Floats:
        """The nearest step, in widths of the box, on the linear rows: many variables put on their bounds leave them.

        A row that holds as it is stays as it is; variables at bounds stay there, and others within the box.
        """
        linear = self.program.linear
        missing = -linear.excess(d)[self.order] / self.row_scale
        off = np.where(linear.equal[self.order], np.abs(missing), -missing) > RESIDUAL
        free = (d > self.program.lower) & (d < self.program.upper)
        if not off.any() or not free.any():
            return d
        change = np.zeros(self.n)
        change[free] = np.linalg.lstsq(self.A[off][:, free], missing[off], rcond=None)[0]
        return np.clip(d + change * self.width, self.program.lower, self.program.upper)


def _times(A: Floats, x: Floats) -> Floats:
    """A x, summed in a fixed order, whatever the threads."""
    return np.asarray(np.einsum("ij,j->i", A, x))
