"""The bundle method's subproblems with very many variables: what `competing_rows.DenseModel` is for fewer.

All rows are lines. Those that a subproblem is made of lie in one matrix (`Pool`), which compiled passes go through a
few times for each solution (`wide_program`); nothing else of the size of rows times variables is formed.
"""

from dataclasses import dataclass, replace

import numpy as np

from mdstopo.optimizer.bundle import Bundle
from mdstopo.optimizer.competing_rows import (
    FLOOR,
    MATCH_COSINE,
    Around,
    FeasibleSet,
    SecantPairs,
    Trial,
    is_only_row,
    rows_to_compare,
)
from mdstopo.optimizer.nearest_feasible import ROUNDING, repair
from mdstopo.optimizer.problem import Floats, Ints, largest_of_groups
from mdstopo.optimizer.stack import Slopes, Stack, joined
from mdstopo.optimizer.wide import Measures
from mdstopo.optimizer.wide_classes import combined, gram, projected
from mdstopo.optimizer.wide_curvature import compact, known_curvature
from mdstopo.optimizer.wide_interior import CURVED, EQUAL, LIMIT, LINE
from mdstopo.optimizer.wide_numbers import LIGHT, threads_for, total
from mdstopo.optimizer.wide_program import Region, Room, WideProgram, WideSolution, solve

#: rows that there is room for at first: those of a bundle, of the newest trial, of volume, of curvature
ROWS = 20
#: steps that curvature is learnt from
PAIRS = 3
#: how often what is left of linear rows is taken from variables inside their boxes
REPAIRS = 5
#: curvature of the subproblem of least violation, of the steepest limit
NEXT_TO_NONE = 1e-6
#: products and M where no steps are known
NO_MATRIX = np.zeros((0, 0))
#: of how many variables one tells how far a row reaches, where only rounding depends on it
SPARSE = 64


class Pool:
    """Rows (S, N) as one matrix, in which each stays in its place until that is needed for another."""

    def __init__(self, n: int) -> None:
        self.rows = np.empty((ROWS, n))
        self._where: dict[tuple[int, bool], int] = {}
        #: by place, what is there, so that it stays what it is; the places last asked for come last
        self._held: dict[int, tuple[Floats, bool] | None] = dict.fromkeys(range(ROWS))

    def places(self, arrays: list[tuple[Floats, bool]], unit: Floats) -> Ints:
        """The rows of the pool (R,) that hold arrays (N,); of those with True, divided by the square of the ranges.

        What is not held yet takes the place of what was longest not needed.
        """
        keys = [(id(array), over) for array, over in arrays]
        for key in keys:
            if key in self._where:  # it becomes the one last needed
                self._held[self._where[key]] = self._held.pop(self._where[key])
        known = {self._where[key] for key in keys if key in self._where}
        oldest = [k for k in self._held if k not in known]
        for key, (array, over) in zip(keys, arrays, strict=True):
            if key not in self._where:
                self._enter(oldest.pop(0) if oldest else self._more(), array, over, unit)
        return np.array([self._where[key] for key in keys], dtype=np.int64)

    def _enter(self, k: int, array: Floats, over: bool, unit: Floats) -> None:
        before = self._held.pop(k)
        if before is not None:
            del self._where[id(before[0]), before[1]]
        self._held[k], self._where[id(array), over] = (array, over), k
        if over:
            np.divide(array, unit * unit, out=self.rows[k])
        else:
            np.copyto(self.rows[k], array)

    def _more(self) -> int:
        k = len(self.rows)
        self.rows = np.concatenate([self.rows, np.empty((max(ROWS // 2, 1), self.rows.shape[1]))])
        self._held |= dict.fromkeys(range(k + 1, len(self.rows)))
        self._held[k] = None
        return k


class WideModel:
    """The interface `competing_rows.RowModel`, for very many variables.

    space: the problem's; measures: those of the driver.
    """

    def __init__(self, space: FeasibleSet, measures: Measures) -> None:
        self.space, self.measures = space, measures
        n = len(space.lower)
        self.room, self.pool = Room.of(n), Pool(n)
        short = measures.space.unit
        self._scale = space.scale
        self.unit = short if len(short) == n else short[:1]
        self.linear = [(np.ascontiguousarray(row), False) for row in space.linear.A]

    def around(self, x: Floats, reach: tuple[float, float], pairs: SecantPairs, steepest: float) -> Around:
        """The subproblems in a box around x; see `RowModel.around`. Curvature is never scaled down as a whole."""
        s, y = _stack(pairs.steps), _stack(pairs.changes)
        vectors = [*((row, True) for row in s.rows), *((row, False) for row in y.rows)]
        floor = FLOOR * self._scale * steepest if pairs.first is None else pairs.first
        while vectors:
            half = len(vectors) // 2
            places = self.pool.places(vectors, self.unit)
            _, products = self._products(places)
            sigma = known_curvature(products, half, floor) if pairs.first is None else pairs.first
            M = compact(products, half, sigma)
            if M is not None:
                return _WideAround(self, x, reach, sigma, vectors, products, M, scaled=True)
            vectors = vectors[1:half] + vectors[half + 1 :]  # without the oldest
        return _WideAround(self, x, reach, floor, [], NO_MATRIX, NO_MATRIX, scaled=True)

    def residual(self, own: Bundle, x: Floats, penalty: Floats, steepest: float) -> float:
        """The projected KKT residual at x; see `RowModel.residual`."""
        if steepest == 0.0:
            return 0.0
        scale = self._scale
        anywhere = _WideAround(self, x, (np.inf, np.inf), steepest / scale, [], NO_MATRIX, NO_MATRIX, scaled=False)
        program = anywhere.program(own, penalty)
        found = solve(program, self.room)
        K, linear = len(own), self.space.linear
        theta = found.theta
        space = self.measures.space
        places = program.places
        moved = projected(
            self.pool.rows, places, theta, x, space.lower, space.upper, steepest / scale, threads_for(len(x), LIGHT)
        )
        values = own.values()
        objective = own.group == 0
        gaps = theta[:K] * np.where(objective, values.max(initial=-np.inf, where=objective) - values, np.abs(values))
        slack = np.where(linear.equal, 0.0, np.abs(theta[K:] * self.measures.excess(x)))
        missing = abs(1.0 - float(theta[:K][objective].sum()))
        return max(moved / scale, float(gaps.sum() + slack.sum()) / (scale * steepest), missing)

    def gradient_change(
        self, bundle: Bundle, new: Bundle, d: Floats, multipliers: Floats, smooth: bool
    ) -> Floats | None:
        """How the Lagrangian's gradient has changed over a step, as of `RowModel`."""
        own, carried = rows_to_compare(bundle, multipliers, smooth)
        old, fresh = _stack(bundle.slope)[own], _stack(new.slope)
        rows = [(row, False) for row in (*old.rows, *fresh.rows)]
        places = self.pool.places(rows, self.unit)
        products, _ = self._products(places)
        size = np.sqrt(np.diag(products))
        weights = np.zeros(len(rows))
        for i, k in enumerate(own.tolist()):
            same = np.flatnonzero((new.group == bundle.group[k]) & (size[len(own) :] > 0.0))
            if size[i] == 0.0 or not len(same):
                continue
            cosine = products[i, len(own) + same] / (size[i] * size[len(own) + same])
            best = int(cosine.argmax())
            if cosine[best] >= MATCH_COSINE or is_only_row(bundle, new, k, smooth):
                weights[i] -= carried[i]
                weights[len(own) + same[best]] += carried[i]
        if not weights.any():
            return None
        change = np.empty(len(d))
        combined(self.pool.rows, places, weights, threads_for(len(d), LIGHT), change)
        return change

    def lengths(self, d: Floats) -> tuple[float, float]:
        """The largest entry and the length of a step, as of `RowModel`."""
        if len(self.unit) == 1:  # all ranges are alike
            unit = float(self.unit[0])
            return float(self.measures.steepest(d[None])[0]) / unit, float(np.sqrt(total(d, d))) / unit
        scaled = d / self.unit
        return float(self.measures.steepest(scaled[None])[0]), float(np.sqrt(total(scaled, scaled)))

    def learnt(self, known: Slopes, more: Floats, smooth: bool) -> Slopes:
        """The steps, or changes, that curvature is learnt from, as of `RowModel`."""
        return _stack(joined(known, more[None]))[-PAIRS:]

    def _products(self, places: Ints) -> tuple[Floats, Floats]:
        """Products of rows of the pool with each other: plain, and weighted with the ranges' squares."""
        plain, scaled = np.empty((2, len(places), len(places)))
        threads = threads_for(self.pool.rows.shape[1], LIGHT)
        gram(self.pool.rows, places, self.measures.space.unit, threads, plain, scaled)
        return plain, scaled


@dataclass(frozen=True, slots=True)
class _WideAround:
    """The subproblems around an iterate, as `competing_rows.Around`.

    curvature: that of all variables, in ranges if `scaled`; learnt: steps and changes (2 m rows), with their products
    and M (2 m, 2 m) of B = curvature - Z' M^-1 Z.
    """

    model: WideModel
    x: Floats
    reach_: tuple[float, float]
    curvature: float
    learnt: list[tuple[Floats, bool]]
    products: Floats
    M: Floats
    scaled: bool

    def solve(self, rows: Bundle, penalty: Floats) -> Trial:
        program = self.program(rows, penalty)
        found = solve(program, self.model.room)
        trial, change = self._kept(found, program)
        K = len(rows)
        levels = largest_of_groups(rows.vector[:, 0] + change[:K], rows.group, len(penalty) + 1)
        linear = found.theta[K : K + len(self.model.linear)]
        return Trial(trial, np.maximum(found.theta[:K], 0.0), linear, levels, found.curved, found.solved)

    def least_violation(self, rows: Bundle, weight: Floats) -> Trial:
        only = rows.subset(rows.group > 0)
        steepest = float((weight[only.group - 1] * only.steepest).max(initial=0.0))
        return self.flat(max(NEXT_TO_NONE * steepest, 1e-300)).solve(only, weight)

    def reach(self, rows: Bundle) -> Floats:
        unit = self.model.unit[:: SPARSE if len(self.model.unit) > 1 else 1]
        wide = np.minimum(2.0 * np.minimum(self.reach_[1], self.reach_[0] * unit), unit)
        return SPARSE * np.array([float((np.abs(row[::SPARSE]) * wide).sum()) for row in _stack(rows.slope).rows])

    def flat(self, curvature: float) -> "_WideAround":
        return replace(self, curvature=curvature, learnt=[], products=NO_MATRIX, M=NO_MATRIX)

    def program(self, rows: Bundle, penalty: Floats) -> WideProgram:
        """The subproblem of rows, all of them lines."""
        model, K, m, c = self.model, len(rows), len(self.model.linear), len(self.learnt)
        slopes = [(row, False) for row in _stack(rows.slope).rows]
        places = model.pool.places([*slopes, *model.linear, *self.learnt], model.unit)
        excess = model.measures.excess(self.x) if m else np.zeros(0)
        M = np.zeros((K + m + c, K + m + c))
        M[K + m :, K + m :] = self.M
        kind = np.concatenate([np.full(K, LINE), np.where(model.space.linear.equal, EQUAL, LIMIT), np.full(c, CURVED)])
        group = np.concatenate([rows.group, np.zeros(m + c, dtype=np.int64)])
        space = model.measures.space
        limits = np.array([*self.reach_, max(self.curvature, 1e-200), float(self.scaled), 0.0])
        region = Region(self.x, space.lower, space.upper, space.unit, limits)
        offset = np.concatenate([rows.vector[:, 0], excess, np.zeros(c)])
        return WideProgram(region, model.pool.rows, places, offset, kind, group, penalty, M, self.products)

    def _kept(self, found: WideSolution, program: WideProgram) -> tuple[Floats, Floats]:
        """The trial without the last rounding errors of the linear rows, and what the rows change by."""
        measures, linear, few = self.model.measures, self.model.space.linear, found.few
        trial, change = found.trial, found.change
        if not len(linear):
            return trial, change
        first = int((program.kind == LINE).sum())
        own = slice(first, first + len(linear))
        for _ in range(REPAIRS):
            left = measures.excess(trial)
            allowed = ROUNDING * (np.abs(left + linear.b) + np.abs(linear.b))
            broken = np.where(linear.equal, np.abs(left), left) > allowed
            if not broken.any():
                return trial, change
            at = trial[few.which]
            low, high = (self.x[few.which] + end for end in (few.low, few.high))
            inside = (at > low) & (at < high)
            A = few.Q[own][broken][:, inside]
            if not np.abs(A).any():
                break
            push = np.linalg.lstsq(A @ A.T, left[broken], rcond=1e-12)[0] @ A
            which = few.which[inside]
            trial = trial.copy()  # `Measures` keeps what it knows of the other array
            trial[which] = np.clip(at[inside] - push, low[inside], high[inside])
            change = change + few.Q[:, inside] @ (trial[which] - at[inside])
        low, high, _ = program.region.box(slice(None))
        trial = repair(trial, self.x + low, self.x + high, linear)
        d = trial - self.x
        return trial, np.array([total(program.pool[k], d) for k in program.places.tolist()])


def _stack(slopes: Slopes) -> Stack:
    return slopes if isinstance(slopes, Stack) else Stack.of(slopes)
