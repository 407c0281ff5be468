"""The best choice of sizes from a catalogue: branch and bound, in which every choice that counts is evaluated exactly.

A node has a range of sizes for each variable. Its relaxation, any number within the ranges, is solved by the optimiser
from the design of the node above. Where the optimum has a number between two sizes, one more node has the sizes up to
the lower of them and one those from the upper on. A node is left where its relaxation is no better than the best choice
known, and where it has a size everywhere. Every relaxation is solved from the middle of its ranges, too. In the end the
neighbours of the best choices that were met are tried.

The optimiser finds local optima. So what a node's relaxation gives is no bound that is proven: a choice behind it may
be better where the problem has several optima. Where all choices are few, all are evaluated, and the best is the best.
"""

import heapq
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.nearest_feasible import InfeasibleRows, project
from mdstopo.optimizer.problem import LinearRows, Problem, Sample
from mdstopo.optimizer.state import State

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: so many choices are all evaluated, where nothing varies beside them: a search takes hundreds of evaluations or more,
#: with gradients
FEW_CHOICES = 5000
#: evaluations after which the search ends with the best so far, and says that nodes are left
MOST_EVALUATIONS = 50_000
#: how near to a size, as a share of the way to the next one, a number counts as it
AT_A_SIZE = 1e-6
#: what linear rows may be missed by, relative to the size of their sums
ROWS = 1e-9
#: pairs of variables up to which a good choice is tried with one size up and another one down
EXCHANGES = 2500
#: so many of the best choices that were met are the beginnings of such trials
BEGINNINGS = 8


class Catalogued(NamedTuple):
    """The variables of a problem that take sizes from a catalogue.

    place (k,): which of x (n,) they are. sizes, prices: of each, rising.
    """

    place: Ints
    sizes: tuple[Floats, ...]
    prices: tuple[Floats, ...]

    def at(self, x: Floats, choice: Ints) -> Floats:
        """The design x with the chosen sizes (k,) in it."""
        return self._with(self.sizes, x, choice)

    def paid(self, x: Floats, choice: Ints) -> Floats:
        """The problem's variables x with the prices of these sizes in their places."""
        return self._with(self.prices, x, choice)

    def _with(self, offered: tuple[Floats, ...], x: Floats, choice: Ints) -> Floats:
        out = x.copy()
        out[self.place] = [each[i] for each, i in zip(offered, choice.tolist(), strict=True)]
        return out

    @property
    def choices(self) -> int:
        """How many combinations of sizes there are."""
        return math.prod(len(sizes) for sizes in self.sizes)


class Within:
    """A problem with narrower bounds and further linear rows; it counts evaluations."""

    def __init__(self, problem: Problem, counts: list[int], lower: Floats, upper: Floats, linear: LinearRows) -> None:
        self.lower, self.upper, self.linear = lower, upper, linear
        self.initial = np.clip(problem.initial, lower, upper)
        self._problem, self._counts = problem, counts

    def __getattr__(self, name: str) -> Any:
        """What only some problems have."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._problem, name)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        self._counts[0] += 1
        return self._problem.evaluate(x, gradient)


@dataclass(order=True)
class Node:
    """A node of the branch-and-bound search: a range of sizes for each variable, low to high (k,), both included, as
    numbers of sizes.

    bound: the optimum of the relaxation of the node above; number: of equal ones the first comes first. x: where the
    relaxation begins.
    """

    bound: float
    number: int
    low: Ints = field(compare=False)
    high: Ints = field(compare=False)
    x: Floats = field(compare=False)


@dataclass
class SearchProgress:
    """What the search has found up to now.

    choice (k,), x (n,), objective: the best; None and infinite before there is one. nodes, evaluations: so far.
    bound: the least optimum of a relaxation that is open; the objective where none is. finished: whether no node is
    left. exhaustive: whether all choices were evaluated. exchanged: whether the best was found by trying neighbours of
    the best of all nodes, behind a node that was left.
    """

    choice: Ints | None = None
    x: Floats | None = None
    objective: float = float("inf")
    nodes: int = 0
    evaluations: int = 0
    bound: float = float("-inf")
    finished: bool = False
    exhaustive: bool = False
    exchanged: bool = False


def rows_for_sizes(rows: LinearRows, catalogued: Catalogued) -> LinearRows:
    """The linear rows that a choice has to keep.

    A sum that is to be equal can seldom be met by sizes. It must not be exceeded, and must not fall short by more than
    the largest step from one size of one member to the next.
    """
    weights = np.abs(rows.A[:, catalogued.place])
    steps = np.array([np.diff(prices).max(initial=0.0) for prices in catalogued.prices])
    split = rows.equal & (weights.max(axis=1, initial=0.0) > 0.0)
    short = (weights * steps).max(axis=1, initial=0.0)
    return LinearRows(
        np.concatenate([rows.A, -rows.A[split]]),
        np.concatenate([rows.b, (short - rows.b)[split]]),
        np.concatenate([rows.equal & ~split, np.zeros(int(split.sum()), dtype=np.bool_)]),
    )


class SizeSearch:
    """A branch-and-bound search for sizes, which can be stopped and taken up again (`to_arrays`)."""

    def __init__(
        self,
        problem: Problem,
        catalogued: Catalogued,
        x: Floats,
        solve: Callable[[Problem, Floats], State],
        tolerance: float,
    ) -> None:
        """Begin at the continuous optimum x (n,).

        problem: of all variables; those with a catalogue that are not in `catalogued` are held by its bounds.
        catalogued: the variables whose sizes are chosen.
        solve: optimises a problem from a design on.
        tolerance: relative; a node has to promise so much more than the best choice.
        """
        self._counts = [0]
        self._catalogued, self._solve, self._tolerance = catalogued, solve, tolerance
        self._rows = rows_for_sizes(problem.linear, catalogued)
        self._problem = problem
        self._others = np.setdiff1d(np.flatnonzero(problem.upper > problem.lower), catalogued.place)
        self.progress = SearchProgress()
        k = len(catalogued.place)
        last = np.array([len(sizes) - 1 for sizes in catalogued.sizes], dtype=np.int64)
        self._open = [Node(float("-inf"), 0, np.zeros(k, dtype=np.int64), last, x.copy())]
        self._made = 1
        self._start = x
        #: choices that were evaluated -> their objective, infinite where they keep no constraint
        self._known: dict[tuple[int, ...], float] = {}
        #: the choices with whose neighbours the search ends, None before it has come to that; whether all were tried
        self._beginnings: list[tuple[int, ...]] | None = None
        self._refined = False

    # -- the search

    def know(self, x: Floats, objective: float) -> None:
        """Take a design x (n,) with sizes, of another search, for the best choice so far."""
        self.progress.choice, self.progress.x, self.progress.objective = self._nearest(x), x.copy(), objective
        self._known[tuple(self.progress.choice.tolist())] = objective

    def run(
        self,
        stop: Callable[[], bool],
        keep: Callable[[SearchProgress], None],
        seen: Callable[[SearchProgress], None] = lambda _: None,
    ) -> SearchProgress:
        """Search on until nothing is left, or stop() says so.

        stop: asked between evaluations.
        keep: is given what has been found after each node.
        seen: is given it after each node and after each choice that is tried where there are no nodes.
        """
        progress = self.progress
        if self._catalogued.choices <= FEW_CHOICES and not len(self._others):
            self._try_all(stop, seen)
        while self._open and not progress.exhaustive and not stop() and self._counts[0] < MOST_EVALUATIONS:
            node = heapq.heappop(self._open)
            if node.bound < self._cutoff():
                self._branch(node)
                progress.nodes += 1
            self._update()
            keep(progress)
            seen(progress)
        if not self._open and not progress.exhaustive and not self._refined:
            self._refined = self._refine(stop, seen)
        self._update()
        keep(progress)
        return progress

    def _update(self) -> None:
        self.progress.evaluations = self._counts[0]
        least = min((node.bound for node in self._open), default=float("inf"))
        self.progress.finished = not self._open and (self._refined or self.progress.exhaustive)
        self.progress.bound = min(least, self.progress.objective)

    def _cutoff(self) -> float:
        best = self.progress.objective
        return best - self._tolerance * abs(best) if np.isfinite(best) else best

    def _try_all(self, stop: Callable[[], bool], seen: Callable[[SearchProgress], None]) -> None:
        ranges = [range(len(sizes)) for sizes in self._catalogued.sizes]
        for choice in product(*ranges):
            if stop():
                return
            self._try(np.array(choice, dtype=np.int64), self._start)
            self._update()
            seen(self.progress)
        self._open = []
        self.progress.exhaustive = True

    def _branch(self, node: Node) -> None:
        """Solve the relaxation of a node, try what is near its optimum, and open what is behind it."""
        relaxed = self._relaxed(node)
        state = self._solved(relaxed, node.x)
        if state is None:
            return
        x, value = state.best_alpha, float(state.best_objective)
        slope = state.slope()
        self._try_near(node, x, slope)
        if value >= self._cutoff() or not len(node.low):
            return
        off = [
            self._off_size(x[place], sizes)
            for place, sizes in zip(self._catalogued.place.tolist(), self._catalogued.sizes, strict=True)
        ]
        most = int(np.argmax([share for share, _ in off]))
        share, below = off[most]
        if share <= AT_A_SIZE:
            choice = np.clip(self._nearest(x), node.low, node.high)
            if self._excess(choice, x) <= 0.0:
                self._try(choice, x)
                return
            # the line that stands for the prices lies below them here: shorter ranges have a closer one
            widths = node.high - node.low
            most = int(np.argmax(widths))
            if widths[most] == 0:
                return
            below = min(int(choice[most]), int(node.high[most]) - 1)
        for low, high in ((node.low[most], below), (below + 1, node.high[most])):
            if low > high:
                continue
            ends = node.low.copy(), node.high.copy()
            ends[0][most], ends[1][most] = low, high
            heapq.heappush(self._open, Node(value, self._made, *ends, x.copy()))
            self._made += 1

    def _solved(self, relaxed: Within, x: Floats) -> State | None:
        """The better optimum of a relaxation, from a design on and from the middle; None where none keeps the rows."""
        found: list[State] = []
        middle = x.copy()
        middle[self._catalogued.place] = 0.5 * (relaxed.lower + relaxed.upper)[self._catalogued.place]
        for start in (x, middle):
            try:
                begin = project(
                    np.clip(start, relaxed.lower, relaxed.upper), relaxed.lower, relaxed.upper, relaxed.linear
                )
            except InfeasibleRows:
                return None
            state = self._solve(relaxed, begin)
            if np.isfinite(state.best_objective) and state.best_violation <= self._tolerance:
                found.append(state)
        return min(found, key=lambda each: each.best_objective, default=None)

    def _relaxed(self, node: Node) -> Within:
        """The problem of a node, relaxed: any number within its ranges, at the lowest price of a size there."""
        lower, upper = self._problem.lower.copy(), self._problem.upper.copy()
        slope, offset = np.ones((len(self._rows), len(lower))), np.zeros((len(self._rows), len(lower)))
        for k, place in enumerate(self._catalogued.place.tolist()):
            i, j = int(node.low[k]), int(node.high[k])
            sizes, prices = self._catalogued.sizes[k][i : j + 1], self._catalogued.prices[k][i : j + 1]
            lower[place], upper[place] = sizes[0], sizes[-1]
            steps = (prices[1:] - prices[0]) / (sizes[1:] - sizes[0])
            for r in range(len(self._rows)):
                least = self._rows.A[r, place] >= 0.0
                rise = 0.0 if not len(steps) else float(steps.min() if least else steps.max())
                slope[r, place], offset[r, place] = rise, prices[0] - rise * sizes[0]
        rows = self._rows
        linear = LinearRows(rows.A * slope, rows.b - np.sum(rows.A * offset, axis=1), rows.equal)
        return Within(self._problem, self._counts, lower, upper, linear)

    # -- choices

    def _off_size(self, value: float, sizes: Floats) -> tuple[float, int]:
        """How far a number is from its nearest size, as a share of the way between the two beside it; the lower one."""
        below = int(np.clip(np.searchsorted(sizes, value, side="right") - 1, 0, max(len(sizes) - 2, 0)))
        if len(sizes) == 1:
            return 0.0, 0
        share = (value - sizes[below]) / (sizes[below + 1] - sizes[below])
        return float(min(abs(share), abs(1.0 - share))), below

    def _nearest(self, x: Floats) -> Ints:
        pairs = zip(self._catalogued.place.tolist(), self._catalogued.sizes, strict=True)
        return np.array([int(np.abs(sizes - x[place]).argmin()) for place, sizes in pairs], dtype=np.int64)

    def _try_near(self, node: Node, x: Floats, slope: Floats) -> None:
        """Try the nearest sizes, with the cheapest changes until the rows hold, then with what these still allow."""
        choice = np.clip(self._nearest(x), node.low, node.high)
        gains = slope[self._catalogued.place]
        if not self._repair(choice, x, gains):
            return
        while True:
            up = []
            for k, i in enumerate(choice.tolist()):
                if i + 1 < len(self._catalogued.sizes[k]) and gains[k] < 0.0:
                    choice[k] += 1
                    if self._excess(choice, x) <= 0.0:
                        up.append((self._loss(k, i, i + 1, gains), k))
                    choice[k] -= 1
            if not up or min(up)[0] >= 0.0:
                break
            choice[min(up)[1]] += 1
        self._try(choice, x)

    def _repair(self, choice: Ints, x: Floats, gains: Floats) -> bool:
        """Change a choice, one size at a time by what costs least, until it keeps the rows; whether it does."""
        for _ in range(2 * sum(map(len, self._catalogued.sizes)) + 1):
            missed = self._missed(choice, x)
            if not missed.max(initial=0.0) > 0.0:
                return True
            row = self._rows.A[int(missed.argmax()), self._catalogued.place]
            moves = []
            for k, i in enumerate(choice.tolist()):
                by = -1 if row[k] > 0.0 else 1
                if row[k] != 0.0 and 0 <= i + by < len(self._catalogued.sizes[k]):
                    moves.append((self._loss(k, i, i + by, gains), k, by))
            if not moves:
                return False
            _, k, by = min(moves)
            choice[k] += by
        return False

    def _loss(self, k: int, i: int, j: int, gains: Floats) -> float:
        """What going from size i to j of variable k does to the objective, to first order, by what it saves."""
        sizes, prices = self._catalogued.sizes[k], self._catalogued.prices[k]
        change = float(gains[k]) * float(sizes[j] - sizes[i])
        saved = abs(float(prices[j] - prices[i]))
        weight = float(np.abs(self._rows.A[:, self._catalogued.place[k]]).max(initial=0.0)) * saved
        return change / weight if weight > 0.0 else change

    def _excess(self, choice: Ints, x: Floats) -> float:
        """By how much the rows are missed by a choice, at its prices; not above zero where they are kept."""
        return float(self._missed(choice, x).max(initial=0.0))

    def _missed(self, choice: Ints, x: Floats) -> Floats:
        """(m,) by how much each row is missed, beyond rounding.

        A sum that is to be equal and has no size in it is left to what varies beside; where nothing does, it has to
        be met by what is held.
        """
        paid = self._catalogued.paid(x, choice)
        miss = self._rows.excess(paid)
        left = np.abs(self._rows.A[:, self._others]).max(axis=1, initial=0.0) > 0.0
        miss = np.where(self._rows.equal, np.where(left, 0.0, np.abs(miss)), miss)
        size = np.abs(self._rows.A) @ np.abs(paid) + np.abs(self._rows.b)
        return np.asarray(miss - ROWS * size)

    def _try(self, choice: Ints, x: Floats) -> bool:
        """Evaluate a choice of sizes, all other variables at their optimum; whether it is the best so far."""
        key = tuple(choice.tolist())
        if key in self._known or self._excess(choice, x) > 0.0:
            return False
        self._known[key] = float("inf")
        if len(self._others):
            fixed = self._relaxed(Node(0.0, 0, choice, choice, x))
            try:
                begin = project(self._catalogued.at(x, choice), fixed.lower, fixed.upper, fixed.linear)
            except InfeasibleRows:
                return False
            state = self._solve(fixed, begin)
            value, violation, there = state.best_objective, state.best_violation, state.best_alpha
        else:
            self._counts[0] += 1
            there = self._catalogued.at(x, choice)
            sample = self._problem.evaluate(there, gradient=False)
            usable = sample.status.usable and np.isfinite(sample.objective)
            value = sample.objective if usable else float("inf")
            violation = float(sample.constraint_rows.max(initial=0.0)) if usable else float("inf")
        if violation > self._tolerance:
            return False
        self._known[key] = float(value)
        if not value < self.progress.objective:
            return False
        self.progress.choice, self.progress.x, self.progress.objective = choice.copy(), there, float(value)
        return True

    def _refine(self, stop: Callable[[], bool], seen: Callable[[SearchProgress], None]) -> bool:
        """Go downhill from the best choices that were met, to better neighbours; whether it came to its end."""
        if self._beginnings is None:
            usable = [(value, key) for key, value in self._known.items() if np.isfinite(value)]
            self._beginnings = [key for _, key in sorted(usable)[: 1 if len(self._others) else BEGINNINGS]]
        for key in self._beginnings:
            at, least = np.array(key, dtype=np.int64), self._known[key]
            improved = True
            while improved and self._counts[0] < MOST_EVALUATIONS:
                improved = False
                for choice in self._neighbours(at):
                    if stop():
                        return False
                    start = self._start if self.progress.x is None else self.progress.x
                    self.progress.exchanged |= self._try(choice, start)
                    self._update()
                    seen(self.progress)
                    there = self._known.get(tuple(choice.tolist()), float("inf"))
                    if there < least:
                        at, least, improved = choice, there, True
        return True

    def _neighbours(self, choice: Ints) -> Iterator[Ints]:
        k = len(choice)
        last = np.array([len(sizes) - 1 for sizes in self._catalogued.sizes])
        moves = [[(i, 1)] for i in range(k)] + [[(i, -1)] for i in range(k)]
        if k * k <= EXCHANGES and not len(self._others):
            moves += [[(i, 1), (j, -1)] for i in range(k) for j in range(k) if i != j]
        for move in moves:
            other = choice.copy()
            for i, by in move:
                other[i] += by
            if np.all(other >= 0) and np.all(other <= last):
                yield other

    # -- keeping

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that a later process needs to go on, by name."""
        progress, k, n = self.progress, len(self._catalogued.place), len(self._start)
        nodes, begun = sorted(self._open), self._beginnings or []
        numbers = (
            progress.objective, progress.nodes, self._counts[0], self._made, self._refined, progress.exchanged,
            progress.exhaustive,
        )  # fmt: skip
        return {
            "open_bound": np.array([node.bound for node in nodes], dtype=np.float64),
            "open_number": np.array([node.number for node in nodes], dtype=np.int64),
            "open_low": np.array([node.low for node in nodes], dtype=np.int64).reshape(len(nodes), k),
            "open_high": np.array([node.high for node in nodes], dtype=np.int64).reshape(len(nodes), k),
            "open_x": np.array([node.x for node in nodes], dtype=np.float64).reshape(len(nodes), n),
            "choice": np.full(k, -1, dtype=np.int64) if progress.choice is None else progress.choice,
            "x": np.full(n, np.nan) if progress.x is None else progress.x,
            "tried": np.array(list(self._known), dtype=np.int64).reshape(len(self._known), k),
            "values": np.array(list(self._known.values()), dtype=np.float64),
            "beginnings": np.array(begun, dtype=np.int64).reshape(len(begun), k),
            "numbers": np.array(numbers, dtype=np.float64),
            "place": self._catalogued.place,
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take up what `to_arrays` gave. Raises KeyError or ValueError where something is missing."""
        columns = (arrays[f"open_{name}"] for name in ("bound", "number", "low", "high", "x"))
        self._open = [
            Node(float(bound), int(number), np.array(low), np.array(high), np.array(x))
            for bound, number, low, high, x in zip(*columns, strict=True)
        ]
        heapq.heapify(self._open)
        _, _, _, made, refined, _, _ = arrays["numbers"].tolist()
        self._made, self._refined = int(made), bool(refined)
        tried = map(tuple, np.asarray(arrays["tried"]).tolist())
        self._known = dict(zip(tried, np.asarray(arrays["values"]).tolist(), strict=True))
        begun = np.asarray(arrays.get("beginnings", ())).tolist()  # older files have none
        self._beginnings = list(map(tuple, begun)) or None
        self.progress = progress_in(arrays)
        self._counts[0] = self.progress.evaluations


def progress_in(arrays: Mapping[str, NDArray[Any]]) -> SearchProgress:
    """The progress of a search that `to_arrays` has kept. Raises KeyError or ValueError where something is missing."""
    objective, nodes, evaluations, _, refined, exchanged, exhaustive = arrays["numbers"].tolist()
    known = bool(np.isfinite(arrays["x"]).all())
    bounds = arrays["open_bound"]
    return SearchProgress(
        choice=np.array(arrays["choice"]) if known else None,
        x=np.array(arrays["x"]) if known else None,
        objective=float(objective),
        nodes=int(nodes),
        evaluations=int(evaluations),
        bound=float(min(bounds.min(initial=np.inf), objective)),
        finished=not len(bounds) and bool(refined or exhaustive),
        exhaustive=bool(exhaustive),
        exchanged=bool(exchanged),
    )
