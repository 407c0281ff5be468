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

from mdstopo.optimizer.curvature import Curvature
from mdstopo.optimizer.problem import Bools, Floats, Ints, LinearRows, largest_of_groups
from mdstopo.optimizer.reduced import Reduced, Rows, reduced

MAX_STEPS = 100
#: mean complementarity and residuals of a solution, in the scaled problem; and of one that still counts as solved
GAP, RESIDUAL = 1e-14, 1e-11
ENOUGH_GAP, ENOUGH_RESIDUAL = 1e-8, 1e-8
#: steps without halving what is missing after which rounding is all that is left
PATIENCE = 3
#: share of the way to the boundary that a step goes
SHARE = 0.99
#: what a determinant is at least: a point on the boundary is taken to be next to it
TINY = 1e-30
#: the signs of the cone's reflection (x_0, -x_1, -x_2)
_FLIP = np.array([1.0, -1.0, -1.0])


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


@dataclass(slots=True)
class _Point:
    """Where the iteration is, in the scaled problem: v (N,) in [0, 1], e (J + 1,), slacks and multipliers of lines
    (KL,), norms (KC, 3), limits (m,; equalities have no slack), bounds (N,) and elastic variables (J,)."""

    v: Floats
    upper_gap: Floats
    e: Floats
    s_line: Floats
    y_line: Floats
    s_norm: Floats
    y_norm: Floats
    s_limit: Floats
    y_limit: Floats
    z_lower: Floats
    z_upper: Floats
    z_elastic: Floats


def solve(program: Program) -> Solution:
    """Solve the program; `Solution.solved` tells whether that succeeded.

    The objective, group 0, needs a row. Raises AssertionError where numbers of the program are not finite.
    """
    with np.errstate(all="ignore"):  # what is not finite ends the iteration
        return _Interior(program).solve()


class _Scaling:
    """Nesterov and Todd's scaling W of three-dimensional cones: W y = W^-1 s = lam; s, y (K, 3) inside the cone.

    W is symmetric. Its eigenvectors are the rows of `turn` (K, 3, 3), with the squares of its eigenvalues (K, 3): in
    their basis the linear systems have a diagonal where W^2 has entries of which one would drown the others. Without
    cones nothing is computed.
    """

    def __init__(self, s: Floats, y: Floats) -> None:
        if not len(s):
            self.lam, self.squares, self.turn = s, s, np.zeros((0, 3, 3))
            return
        det_s, det_y = np.maximum(_determinant(s), TINY), np.maximum(_determinant(y), TINY)
        s_unit, y_unit = s / np.sqrt(det_s)[:, None], y / np.sqrt(det_y)[:, None]
        gamma = np.sqrt(0.5 * (1.0 + (s_unit * y_unit).sum(axis=1)))
        self.w = 0.5 * (s_unit + y_unit * _FLIP) / gamma[:, None]
        size = np.sqrt(self.w[:, 1] ** 2 + self.w[:, 2] ** 2)
        self.w[:, 0] = np.sqrt(1.0 + size**2)
        self.eta = np.sqrt(np.sqrt(det_s / det_y))
        self.lam = self.times(y)
        sum_ = self.w[:, 0] + size
        self.squares = (self.eta**2)[:, None] * np.stack([sum_**2, sum_**-2, np.ones_like(sum_)], axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            x, z = (np.where(size > 0.0, self.w[:, i] / size, i == 1) for i in (1, 2))
        half, zero = np.full_like(size, np.sqrt(0.5)), np.zeros_like(size)
        vectors = (half, half * x, half * z), (half, -half * x, -half * z), (zero, -z, x)
        self.turn = np.stack([np.stack(vector, axis=1) for vector in vectors], axis=1)

    def times(self, x: Floats) -> Floats:
        """W x of x (K, 3)."""
        w0, w1 = self.w[:, :1], self.w[:, 1:]
        dot = (w1 * x[:, 1:]).sum(axis=1, keepdims=True)
        rest = x[:, 1:] + w1 * (x[:, :1] + dot / (1.0 + w0))
        return np.asarray(self.eta[:, None] * np.concatenate([w0 * x[:, :1] + dot, rest], axis=1))

    def inverse_times(self, x: Floats) -> Floats:
        """W^-1 x of x (K, 3)."""
        w0, w1 = self.w[:, :1], self.w[:, 1:]
        dot = (w1 * x[:, 1:]).sum(axis=1, keepdims=True)
        rest = x[:, 1:] + w1 * (dot / (1.0 + w0) - x[:, :1])
        return np.concatenate([w0 * x[:, :1] - dot, rest], axis=1) / self.eta[:, None]

    def longest(self, ds: Floats, dy: Floats) -> float:
        """The step to the boundary; found in the scaled space, where s and y are far from it."""
        if not len(ds):
            return float("inf")
        return min(_to_boundary(self.lam, self.inverse_times(ds)), _to_boundary(self.lam, self.times(dy)))

    def aim(self, target: float, cross: tuple[Floats, Floats] | None) -> Floats:
        """W (lam \\ (target e - lam o lam - (W^-1 ds) o (W dy))), (K, 3)."""
        if not len(self.lam):
            return self.lam
        right = -_product(self.lam, self.lam)
        right[:, 0] += target
        if cross is not None:
            right -= _product(self.inverse_times(cross[0]), self.times(cross[1]))
        return self.times(_divided(right, self.lam))


def _determinant(x: Floats) -> Floats:
    """x0^2 - |x1|^2 without cancellation, (K,)."""
    size = np.sqrt(x[:, 1] ** 2 + x[:, 2] ** 2)
    return np.asarray((x[:, 0] - size) * (x[:, 0] + size))


def _outside(x: Floats) -> float:
    """How far points (K, 3) lie outside the cone, at most: where one is on its boundary to rounding the scaling fails,
    and a step may leave the cone by far more."""
    if not len(x):
        return 0.0
    return float((np.sqrt(x[:, 1] ** 2 + x[:, 2] ** 2) - x[:, 0]).max(initial=0.0))


def _product(a: Floats, b: Floats) -> Floats:
    """The cone's product a o b, (K, 3)."""
    return np.concatenate([(a * b).sum(axis=1, keepdims=True), a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:]], axis=1)


def _divided(a: Floats, by: Floats) -> Floats:
    """x with by o x = a, (K, 3)."""
    det = _determinant(by)
    dot = (by[:, 1:] * a[:, 1:]).sum(axis=1)
    head = (by[:, 0] * a[:, 0] - dot) / det
    rest = (a[:, 1:] - head[:, None] * by[:, 1:]) / by[:, :1]
    return np.concatenate([head[:, None], rest], axis=1)


def _to_boundary(x: Floats, d: Floats) -> float:
    """The largest step for which x + a d (K, 3) stays inside the cone."""
    a = _determinant(d)
    b = x[:, 0] * d[:, 0] - x[:, 1] * d[:, 1] - x[:, 2] * d[:, 2]
    c = np.maximum(_determinant(x), 0.0)
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # the smallest positive root of a t^2 + 2 b t + c, c > 0
        leaving = (a < 0.0) | ((b < 0.0) & (b * b - a * c >= 0.0))
        step = np.where(leaving, c / (root - b), np.inf)
        head = np.where(d[:, 0] < 0.0, -x[:, 0] / d[:, 0], np.inf)
    step = np.where(np.isfinite(step) & (step >= 0.0), step, np.inf)
    return float(min(step.min(), head.min()))


def _copied(x: _Point) -> _Point:
    return _Point(*(getattr(x, name).copy() for name in _Point.__slots__))


def _moved(x: _Point, d: _Point, a: float) -> _Point:
    return _Point(*(getattr(x, name) + a * getattr(d, name) for name in _Point.__slots__))


def _move(x: _Point, d: _Point, a: float) -> None:
    for name in _Point.__slots__:
        getattr(x, name).__iadd__(a * getattr(d, name))


class _Interior:
    """One solution's arrays: the scaled problem, the point, and the steps."""

    def __init__(self, program: Program) -> None:
        self.program = program
        lines, norms, linear = program.lines, program.norms, program.linear
        self.width = program.upper - program.lower
        self.n, self.groups = len(self.width), len(program.penalty) + 1
        self.group = np.concatenate([lines.group, norms.group])
        line_slope, norm_slope, across = (x * self.width for x in (lines.slope, norms.slope, norms.across))
        of_line, along, beside = (np.abs(x).max(axis=1, initial=0.0) for x in (line_slope, norm_slope, across))
        steepest = np.concatenate([of_line, np.maximum(along, beside)])
        scale = largest_of_groups(steepest, self.group, self.groups)
        self.scale = scale = np.where(scale > 0.0, scale, 1.0)
        at = -program.lower / self.width  # where d = 0 is, in v
        self.g_line = line_slope / scale[lines.group, None]
        by = scale[norms.group]
        self.g_norm, self.p_norm = norm_slope / by[:, None], across / by[:, None]
        # levels are counted from the highest row at d = 0
        size = np.sqrt(norms.vector[:, 0] ** 2 + norms.vector[:, 1] ** 2)
        highest = largest_of_groups(np.concatenate([lines.value, size - norms.excess]), self.group, self.groups)[0]
        self.base = np.zeros(self.groups)
        self.base[0] = highest if np.isfinite(highest) else 0.0
        self.f_line = (lines.value - self.base[lines.group]) / scale[lines.group] - self.g_line @ at
        self.u_norm = norms.vector / by[:, None] - np.stack([self.g_norm @ at, self.p_norm @ at], axis=1)
        self.c_norm = (norms.excess + self.base[norms.group]) / by
        self.penalty = program.penalty * scale[1:] / scale[0]
        row = np.abs(linear.A * self.width).max(axis=1, initial=0.0)
        self.row_scale = np.where(row > 0.0, row, 1.0)
        self.A = linear.A * self.width / self.row_scale[:, None]
        self.b = linear.b / self.row_scale + self.A @ at
        self.equal: Bools = linear.equal
        self.at = at
        self.P = program.curvature.scaled(self.width, scale[0])
        self.system: Reduced = reduced(self.P, self.A, self.groups, len(lines.group) + 3 * len(norms.group))
        self.count = 2 * self.n + len(self.f_line) + len(self.c_norm) + int((~self.equal).sum()) + self.groups - 1

    # -- the iteration

    def solve(self) -> Solution:
        """The best point of the iteration, which ends at rounding, after MAX_STEPS or where no step is possible."""
        point = self._start()
        best: tuple[float, _Point, float, float] | None = None
        good = False
        step = lately = 0
        while True:
            residuals = self._residuals(point)
            gap = self._gap(point) / self.count
            worst = max((float(np.abs(r).max(initial=0.0)) for r in residuals), default=0.0)
            worst = max(worst, _outside(point.s_norm), _outside(point.y_norm))
            score = max(gap / GAP, worst / RESIDUAL)
            if not np.isfinite(score):
                break
            if best is None or score < 0.5 * best[0]:
                lately = step
            enough = gap <= ENOUGH_GAP and worst <= ENOUGH_RESIDUAL
            if best is None or (score < best[0] and enough >= good):  # rounding may undo what was solved
                best, good = (score, _copied(point), gap, worst), enough
            if score <= 1.0 or step == MAX_STEPS or step - lately >= (PATIENCE if good else 5 * PATIENCE):
                break
            step += 1
            if not self._advance(point, residuals, gap):
                break
        assert best is not None
        _, point, gap, worst = best
        return self._solution(point, step, good, gap, worst)

    def _start(self) -> _Point:
        """A point inside all cones: near the iterate, levels above all rows."""
        v = np.clip(self.at, 0.1, 0.9)
        line = self.f_line + self.g_line @ v
        vector = self.u_norm + np.stack([self.g_norm @ v, self.p_norm @ v], axis=1)
        size = np.sqrt(vector[:, 0] ** 2 + vector[:, 1] ** 2)
        mu = 0.1
        e = largest_of_groups(np.concatenate([line, size - self.c_norm]), self.group, self.groups)
        e[1:] = np.maximum(e[1:], 0.0)
        e = np.where(np.isfinite(e), e, 0.0) + mu
        s_norm = np.concatenate([(e[self.program.norms.group] + self.c_norm)[:, None], vector], axis=1)
        s_norm[:, 0] = np.maximum(s_norm[:, 0], size + mu)
        counts = np.bincount(self.group, minlength=self.groups)
        top = np.concatenate([[1.0], np.minimum(0.5 * self.penalty, 1.0)]) / np.maximum(counts, 1)
        y_norm = np.zeros_like(s_norm)
        y_norm[:, 0] = top[self.program.norms.group]
        limit = self.b - self.A @ v
        z = np.full(self.n, mu)
        return _Point(
            v=v,
            upper_gap=1.0 - v,
            e=e,
            s_line=e[self.program.lines.group] - line,
            y_line=top[self.program.lines.group].copy(),
            s_norm=s_norm,
            y_norm=y_norm,
            s_limit=np.where(self.equal, 1.0, np.maximum(limit, mu)),
            y_limit=np.where(self.equal, 0.0, mu),
            z_lower=z,
            z_upper=z.copy(),
            z_elastic=self.penalty - np.minimum(0.5 * self.penalty, 1.0),
        )

    def _residuals(self, x: _Point) -> tuple[Floats, ...]:
        """What is missing: of the gradient by v, by e, of lines, norms and linear rows."""
        lines, norms = self.program.lines.group, self.program.norms.group
        gradient = self.P.times(x.v - self.at) + self.g_line.T @ x.y_line + self.A.T @ x.y_limit
        gradient -= self.g_norm.T @ x.y_norm[:, 1] + self.p_norm.T @ x.y_norm[:, 2] + x.z_lower - x.z_upper
        by_level = np.concatenate([[1.0], self.penalty - x.z_elastic])
        np.subtract.at(by_level, lines, x.y_line)
        np.subtract.at(by_level, norms, x.y_norm[:, 0])
        line = x.e[lines] - self.f_line - self.g_line @ x.v - x.s_line
        norm = np.stack(
            [x.e[norms] + self.c_norm, self.u_norm[:, 0] + self.g_norm @ x.v, self.u_norm[:, 1] + self.p_norm @ x.v],
            axis=1,
        )
        limit = self.b - self.A @ x.v - np.where(self.equal, 0.0, x.s_limit)
        return gradient, by_level, line, norm - x.s_norm, limit

    def _gap(self, x: _Point) -> float:
        """The sum of all products of a slack and its multiplier."""
        total = x.v @ x.z_lower + x.upper_gap @ x.z_upper + x.s_line @ x.y_line + x.e[1:] @ x.z_elastic
        total += float((x.s_norm * x.y_norm).sum()) + float((x.s_limit * x.y_limit)[~self.equal].sum())
        return float(total)

    def _advance(self, x: _Point, residuals: tuple[Floats, ...], gap: float) -> bool:
        """One predictor and corrector; whether the point has moved."""
        self.scaling = scaling = _Scaling(x.s_norm, x.y_norm)
        limit = np.where(self.equal, 0.0, x.s_limit / np.where(self.equal, 1.0, x.y_limit))
        try:
            rows = self._rows(scaling, x.s_line / x.y_line)
            self.system.factor(x.z_lower / x.v + x.z_upper / x.upper_gap, rows, limit, x.z_elastic / x.e[1:])
        except np.linalg.LinAlgError:
            return False
        aims = self._aims(x, scaling, 0.0, None)
        first = self._direction(x, residuals, scaling, aims)
        a = min(1.0, self._longest(x, first, 1.0))
        after = self._gap(_moved(x, first, a)) / self.count
        centre = min(1.0, max(0.0, after / gap)) ** 3 if gap > 0.0 else 0.0
        aims = self._aims(x, scaling, centre * gap, first)
        second = self._direction(x, residuals, scaling, aims)
        a = min(1.0, self._longest(x, second, SHARE))
        if not (a > 1e-14 and np.isfinite(second.v).all()):
            return False
        _move(x, second, a)
        return True

    def _rows(self, scaling: _Scaling, S: Floats) -> Rows:
        """Lines and the norms' three rows in the basis of the scaling, as rows of the system."""
        lines, norms = self.program.lines.group, self.program.norms.group
        n = self.n
        first, second = scaling.turn[:, :, 1, None], scaling.turn[:, :, 2, None]
        turned = -first * self.g_norm[:, None] - second * self.p_norm[:, None]
        return Rows(
            np.concatenate([self.g_line, turned.reshape(-1, n)]),
            np.concatenate([lines, np.repeat(norms, 3)]),
            np.concatenate([np.full(len(lines), -1.0), -scaling.turn[:, :, 0].ravel()]),
            np.concatenate([S, scaling.squares.ravel()]),
        )

    def _aims(self, x: _Point, scaling: _Scaling, target: float, first: _Point | None) -> _Point:
        """Targets of the complementarity products, each divided by its slack: what the multiplier is to change by,
        were the slack to stay; `first`: the predictor, whose second order is corrected."""
        d = first
        line, limit = target - x.s_line * x.y_line, target - x.s_limit * x.y_limit
        low, high, elastic = target - x.v * x.z_lower, target - x.upper_gap * x.z_upper, target - x.e[1:] * x.z_elastic
        cross = None
        if d is not None:
            line = line - d.s_line * d.y_line
            limit = limit - d.s_limit * d.y_limit
            low = low - d.v * d.z_lower
            high = high - d.upper_gap * d.z_upper
            elastic = elastic - d.e[1:] * d.z_elastic
            cross = d.s_norm, d.y_norm
        return _Point(
            v=low / x.v,
            upper_gap=high / x.upper_gap,
            e=np.concatenate([[0.0], elastic / x.e[1:]]),
            s_line=line / x.y_line,
            y_line=line,
            s_norm=scaling.aim(target, cross),
            y_norm=x.y_norm,
            s_limit=np.where(self.equal, 0.0, limit / np.where(self.equal, 1.0, x.y_limit)),
            y_limit=limit,
            z_lower=low,
            z_upper=high,
            z_elastic=elastic,
        )

    def _direction(self, x: _Point, residuals: tuple[Floats, ...], scaling: _Scaling, aims: _Point) -> _Point:
        """The step whose linearised conditions meet the aims."""
        gradient, by_level, line, norm, limit = residuals
        lines, norms = self.program.lines.group, self.program.norms.group
        turned = (scaling.turn @ (norm - aims.s_norm)[:, :, None])[:, :, 0]
        dv, de, dy, dy_limit = self.system.solve(
            -gradient + aims.v - aims.upper_gap,
            -by_level + aims.e,
            np.concatenate([line - aims.s_line, turned.ravel()]),
            limit - aims.s_limit,
        )
        dy_line, dy_turned = dy[: len(line)], dy[len(line) :].reshape(-1, 3, 1)
        dy_norm = (scaling.turn.transpose(0, 2, 1) @ dy_turned)[:, :, 0]
        ds_line = line + de[lines] - self.g_line @ dv
        ds_norm = norm + np.stack([de[norms], self.g_norm @ dv, self.p_norm @ dv], axis=1)
        ds_limit = np.where(self.equal, 0.0, limit - self.A @ dv)
        return _Point(
            v=dv,
            upper_gap=-dv,
            e=de,
            s_line=ds_line,
            y_line=dy_line,
            s_norm=ds_norm,
            y_norm=dy_norm,
            s_limit=ds_limit,
            y_limit=dy_limit,
            z_lower=aims.v - x.z_lower / x.v * dv,
            z_upper=aims.upper_gap + x.z_upper / x.upper_gap * dv,
            z_elastic=aims.e[1:] - x.z_elastic / x.e[1:] * de[1:],
        )

    def _longest(self, x: _Point, d: _Point, share: float) -> float:
        """The step to the boundary of the cones, times `share`."""
        pairs = [(x.v, d.v), (x.upper_gap, d.upper_gap), (x.s_line, d.s_line), (x.y_line, d.y_line), (x.e[1:], d.e[1:]),
                 (x.z_lower, d.z_lower), (x.z_upper, d.z_upper), (x.z_elastic, d.z_elastic)]  # fmt: skip
        free = ~self.equal
        pairs += [(x.s_limit[free], d.s_limit[free]), (x.y_limit[free], d.y_limit[free])]
        at, by = (np.concatenate(side) for side in zip(*pairs, strict=True))
        most = float((-by / at).max(initial=0.0))
        longest = 1.0 / most if most > 0.0 else np.inf
        return share * min(longest, self.scaling.longest(d.s_norm, d.y_norm))

    def _solution(self, x: _Point, steps: int, solved: bool, gap: float, worst: float) -> Solution:
        """The point in the units of the program; d at a bound is that bound to the bit."""
        program = self.program
        # the nearer end tells the place: from the farther it would be rounding
        d = np.where(x.v < x.upper_gap, program.lower + x.v * self.width, program.upper - x.upper_gap * self.width)
        d = np.where((x.z_lower > x.v) & (x.v < 1e-6), program.lower, d)
        d = np.where((x.z_upper > x.upper_gap) & (x.upper_gap < 1e-6), program.upper, d)
        by = self.scale[0]
        return Solution(
            d=self._on_rows(d),
            level=x.e * self.scale + self.base,
            lines=x.y_line * by / self.scale[program.lines.group],
            norms=x.y_norm[:, 0] * by / self.scale[program.norms.group],
            linear=x.y_limit * by / self.row_scale,
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
        missing = (linear.b - linear.A @ d) / self.row_scale
        off = np.where(self.equal, np.abs(missing), -missing) > RESIDUAL
        free = (d > self.program.lower) & (d < self.program.upper)
        if not off.any() or not free.any():
            return d
        change = np.zeros(self.n)
        change[free] = np.linalg.lstsq(self.A[off][:, free], missing[off], rcond=None)[0]
        return np.clip(d + change * self.width, self.program.lower, self.program.upper)
