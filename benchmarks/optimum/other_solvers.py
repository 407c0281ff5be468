"""Other optimisers on the same problems: IPOPT through CasADi, and NLopt's MMA, CCSAQ and SLSQP.

They get what mdstopo's optimiser gets from an evaluation: every competing peak of objectives and constraints with its
gradient, in the bound formulation, which is smooth:

    minimise U(z)   subject to   f_kr(x) <= z_k,   c(x) <= 0,   A x <= b or A x = b,   lower <= x <= upper

A fixed number of rows for each objective and each constraint; where fewer peaks compete the last is repeated.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.optimum.kkt import SIGNS, competing, gradient_of, volume_rows
from benchmarks.optimum.measure import excess, value_of
from mdstopo import Case, evaluate
from mdstopo.case.model import ResponseRow
from mdstopo.optimizer.nearest_feasible import project

Floats = NDArray[np.float64]

#: rows of each objective and of each side of a constraint
PEAKS, LIMIT_PEAKS = 12, 6
#: processor seconds of one attempt, most of which some solvers spend on their own subproblems
SECONDS = 8.0
#: evaluations of MMA's and CCSAQ's dual function for one step: their default, 100 000, takes seconds
DUAL = 1000
#: an evaluation that fails is so far from everything
FAR = 1e3


class SpentError(Exception):
    """The evaluations that were allowed have been used."""


@dataclass
class Smooth:
    """The bound formulation of a case at one design after another.

    v = (x, z): z in units of the objectives at the first design. budget: evaluations allowed; after them SpentError,
    or, where a solver cannot be stopped, the last rows again. visited: evaluations so far, value, excess of each
    design.
    """

    case: Case
    budget: int
    stopped: bool = True
    visited: list[tuple[int, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        case = self.case
        self._until = time.process_time() + SECONDS
        self.space = case.space
        self.lower, self.upper = self.space.bounds(case.lower, case.upper)
        self.n, self.k = self.space.size, len(case.objectives)
        self.signs = np.array([-1.0 if each.sense == "maximize" else 1.0 for each in case.objectives])
        self.units = np.ones(self.k)
        self.linear = volume_rows(case)
        self._x: Floats | None = None
        self._kept: tuple[Floats, Floats] = np.zeros(0), np.zeros((0, 0))

    def begin(self, x: Floats) -> Floats:
        """The first v at a first design, which is brought within bounds and volume rows."""
        x = project(x, self.lower, self.upper, self.linear)
        self.units = np.ones(self.k)
        rows, _ = self.at(x)
        if not self.visited or not np.isfinite(self.visited[-1][1]):
            raise ValueError("the first design cannot be computed")
        highest = rows[: self.k * PEAKS].reshape(self.k, PEAKS).max(axis=1)
        self.units = np.maximum(np.abs(highest), 1e-12)
        self._x = None
        self.visited.pop()  # the same design is asked for again
        return np.concatenate([x, highest / self.units])

    def at(self, x: Floats) -> tuple[Floats, Floats]:
        """f_kr in units of its objective, then c; and gradients by x. Raises SpentError after `budget` designs."""
        if self._x is not None and np.array_equal(x, self._x):
            return self._kept
        count = len(self.visited) + 1
        if count > self.budget or time.process_time() > self._until:
            if self.stopped:
                raise SpentError
            return self._kept
        self._x = np.array(x)
        self._kept = self._evaluated(np.clip(x, self.lower, self.upper), count)
        return self._kept

    def _evaluated(self, x: Floats, count: int) -> tuple[Floats, Floats]:
        case = self.case
        design = self.space.expand(x)
        found = evaluate(case, design[: case.n_design], variables=self.space.named(design))
        size = self.k * PEAKS + sum(
            LIMIT_PEAKS * len(SIGNS[row.sense]) for row in case.constraints if isinstance(row, ResponseRow)
        )
        if not found.status.usable:
            self.visited.append((count, float("inf"), float("inf")))
            return np.full(size, FAR), np.zeros((size, self.n))
        try:
            value = value_of(case, found.objectives)
        except (ValueError, FloatingPointError):
            value = float("inf")
        self.visited.append((count, value, excess(case, found.constraints)))
        rows: list[float] = []
        slopes: list[Floats] = []
        for objective, sign, unit in zip(case.objectives, self.signs, self.units, strict=True):
            peaks = competing(objective, sign, found.peaks[objective.name])
            for r in range(PEAKS):
                peak = peaks[min(r, len(peaks) - 1)]
                rows.append(sign * peak.value / unit)
                slopes.append(sign * self.space.vjp(gradient_of(peak)) / unit)
        for i, row in enumerate(case.constraints):
            if isinstance(row, ResponseRow):
                scale = abs(row.bound) or 1.0
                for sign in SIGNS[row.sense]:
                    peaks = competing(row, sign, found.constraint_peaks[i])
                    for r in range(LIMIT_PEAKS):
                        peak = peaks[min(r, len(peaks) - 1)]
                        rows.append(sign * (peak.value - row.bound) / scale)
                        slopes.append(sign * self.space.vjp(gradient_of(peak)) / scale)
        return np.array(rows), np.array(slopes)

    def inequalities(self, v: Floats) -> tuple[Floats, Floats]:
        """All rows that may not be positive, the volume rows that are no equalities included, by v = (x, z)."""
        x, z = v[: self.n], v[self.n :]
        rows, slopes = self.at(x)
        full = np.zeros((len(rows), self.n + self.k))
        full[:, : self.n] = slopes
        values = rows.copy()
        for k in range(self.k):
            own = slice(k * PEAKS, (k + 1) * PEAKS)
            values[own] -= z[k]
            full[own, self.n + k] = -1.0
        A, b = self._volumes(~self.linear.equal)
        return np.concatenate([values, A @ x - b]), np.concatenate([full, np.pad(A, ((0, 0), (0, self.k)))])

    def equalities(self) -> tuple[Floats, Floats]:
        """A (m, n + K), b (m,) of A v = b."""
        A, b = self._volumes(self.linear.equal)
        return np.pad(A, ((0, 0), (0, self.k))), b

    def _volumes(self, chosen: NDArray[np.bool_]) -> tuple[Floats, Floats]:
        """Volume rows in units of their bounds."""
        scale = np.maximum(np.abs(self.linear.b[chosen]), 1e-12)
        return self.linear.A[chosen] / scale[:, None], self.linear.b[chosen] / scale

    def objective(self, v: Floats) -> tuple[float, Floats]:
        """U(z) relative to the units, and its gradient; of weighted_product its logarithm."""
        z = v[self.n :]
        slope = np.zeros(len(v))
        combine = self.case.combine
        if self.k == 1:
            slope[self.n] = 1.0
            return float(z[0]), slope
        assert combine is not None
        weights = np.array([combine.weights[each.name] for each in self.case.objectives])
        weights = weights / weights.sum()
        if combine.method == "weighted_product":
            safe = np.maximum(z, 1e-6)
            slope[self.n :] = weights / safe
            return float(weights @ np.log(safe)), slope
        shares = weights * self.units
        shares = shares / shares.sum()
        if combine.method == "weighted_min_max":  # z_1 bounds the others, too (`tied`)
            slope[self.n] = 1.0
            return float(z[0]), slope
        slope[self.n :] = shares
        return float(shares @ z), slope

    def tied(self) -> Floats:
        """Rows by v, not positive: w_k z_k <= w_1 z_1 where the objectives compete for one maximum."""
        combine = self.case.combine
        if self.k == 1 or combine is None or combine.method != "weighted_min_max":
            return np.zeros((0, self.n + self.k))
        weights = self.units * np.array([combine.weights[each.name] for each in self.case.objectives])
        rows = np.zeros((self.k - 1, self.n + self.k))
        rows[:, self.n] = -1.0
        rows[np.arange(self.k - 1), self.n + 1 + np.arange(self.k - 1)] = weights[1:] / weights[0]
        return rows


def ipopt(problem: Smooth, first: Floats) -> None:
    """IPOPT with its limited-memory Hessian and CasADi's other defaults."""
    import casadi as ca

    size, tied = problem.n + problem.k, problem.tied()
    values, _ = problem.inequalities(first)
    problem.stopped = False

    class Slopes(ca.Callback):  # type: ignore[misc]
        """d rows / d v."""

        def __init__(self, name: str) -> None:
            ca.Callback.__init__(self)
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 2

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> object:
            return ca.Sparsity.dense(size if i == 0 else len(values), 1)

        def get_sparsity_out(self, i: int) -> object:
            return ca.Sparsity.dense(len(values), size)

        def eval(self, args: list[object]) -> list[object]:
            return [ca.DM(problem.inequalities(np.array(args[0]).ravel())[1])]

    class Rows(ca.Callback):  # type: ignore[misc]
        """The rows by v."""

        def __init__(self, name: str) -> None:
            ca.Callback.__init__(self)
            self.construct(name, {})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> object:
            return ca.Sparsity.dense(size, 1)

        def get_sparsity_out(self, i: int) -> object:
            return ca.Sparsity.dense(len(values), 1)

        def eval(self, args: list[object]) -> list[object]:
            return [ca.DM(problem.inequalities(np.array(args[0]).ravel())[0])]

        def has_jacobian(self) -> bool:
            return True

        def get_jacobian(self, name: str, *_: object) -> object:
            self.slopes = Slopes(name)
            return self.slopes

    rows, v = Rows("rows"), ca.MX.sym("v", size)
    A, b = problem.equalities()
    g = ca.vertcat(rows(v), ca.DM(tied) @ v, ca.DM(A) @ v)
    options = {
        "ipopt.hessian_approximation": "limited-memory",
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": problem.budget,
        "ipopt.tol": 1e-7,
        "print_time": False,
        "error_on_fail": False,
    }
    solver = ca.nlpsol("s", "ipopt", {"x": v, "f": _symbolic(ca, problem, v), "g": g}, options)
    low, high = _box(problem)
    count = len(values) + len(tied)
    solver(
        x0=first,
        lbx=low,
        ubx=high,
        lbg=np.concatenate([np.full(count, -np.inf), b]),
        ubg=np.concatenate([np.zeros(count), b]),
    )


def _symbolic(ca: object, problem: Smooth, v: object) -> object:
    """U(z), for CasADi."""
    _, slope = problem.objective(np.ones(problem.n + problem.k))
    combine = problem.case.combine
    if combine is not None and problem.k > 1 and combine.method == "weighted_product":
        return sum(slope[i] * ca.log(ca.fmax(v[i], 1e-6)) for i in range(problem.n, problem.n + problem.k))  # type: ignore
    return sum(slope[i] * v[i] for i in range(problem.n, problem.n + problem.k))  # type: ignore


def _box(problem: Smooth) -> tuple[Floats, Floats]:
    """Bounds of v: z stays within a hundred units."""
    room = np.full(problem.k, 100.0)
    lower = -room if (problem.signs < 0.0).any() else np.zeros(problem.k)
    return np.concatenate([problem.lower, lower]), np.concatenate([problem.upper, room])


def _nlopt(name: str) -> Callable[[Smooth, Floats], None]:
    def solve(problem: Smooth, first: Floats) -> None:
        import nlopt

        optimizer = nlopt.opt(getattr(nlopt, name), len(first))
        low, high = _box(problem)
        optimizer.set_lower_bounds(low)
        optimizer.set_upper_bounds(high)
        tied, (A, b) = problem.tied(), problem.equalities()
        slsqp = name == "LD_SLSQP"
        if not slsqp:  # these know no equalities
            tied = np.concatenate([tied, A, -A])
        level = np.concatenate([np.zeros(len(tied) - (0 if slsqp else 2 * len(b))), *([] if slsqp else [b, -b])])

        def objective(v: Floats, slope: Floats) -> float:
            value, own = problem.objective(v)
            if slope.size:
                slope[:] = own
            return value

        def rows(result: Floats, v: Floats, slope: Floats) -> None:
            values, own = problem.inequalities(v)
            result[:] = np.concatenate([values, tied @ v - level])
            if slope.size:
                slope[:] = np.concatenate([own, tied])

        def equal(result: Floats, v: Floats, slope: Floats) -> None:
            result[:] = A @ v - b
            if slope.size:
                slope[:] = A

        count = len(problem.inequalities(first)[0]) + len(tied)
        optimizer.set_min_objective(objective)
        optimizer.add_inequality_mconstraint(rows, np.full(count, 1e-8))
        if slsqp and len(b):
            optimizer.add_equality_mconstraint(equal, np.full(len(b), 1e-8))
        optimizer.set_ftol_rel(1e-9)
        optimizer.set_xtol_rel(1e-9)
        optimizer.set_maxeval(20 * problem.budget)
        if not slsqp:
            optimizer.set_param("dual_maxeval", DUAL)
        try:
            optimizer.optimize(np.clip(first, low, high))
        except (nlopt.RoundoffLimited, nlopt.ForcedStop, RuntimeError):
            return

    return solve


METHODS: Mapping[str, Callable[[Smooth, Floats], None]] = {
    "IPOPT": ipopt,
    "MMA": _nlopt("LD_MMA"),
    "CCSAQ": _nlopt("LD_CCSAQ"),
    "SLSQP": _nlopt("LD_SLSQP"),
}


def attempt(case: Case, method: str, first: Floats, budget: int) -> list[tuple[int, float, float]]:
    """What one method visits from one first design of the optimiser's variables: evaluations, value, excess."""
    problem = Smooth(case, budget)
    with suppress(SpentError):
        METHODS[method](problem, problem.begin(first))
    return problem.visited
