"""What to solve, in rounds that are fixed in advance: the same tasks from the same results, wherever they are solved.

1. Each objective alone, from the first design; then each again from where the others ended. The best are the ends; they
   give utopia and maxima (the pay-off table, Eq. 24).
2. The other points between solved ones, halving the gaps: each from the solved design that is best by its own U, and
   from the neighbour on the other side. Where more starts are asked for, they compete beside these, here and in 1.
3. Exchange: whoever's U is lower at another point's design starts again from that, until nobody gains.
4. With what has been found utopia and maxima are brought up to date. Every point goes on from its own design, where
   they changed, and from both neighbours'; and exchange again. Whoever's U is lower at a design that was only visited
   starts again from that. The same again while utopia and maxima still move by much.
5. What was visited and belongs to the front is added to it (`visited`).

Designs that violate constraints come after all that do not, whatever their U, and are no ends.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mdstopo.optimizer.scalarisation import Scalarisation, formula_of
from mdstopo.optimizer.start_families import Family, begins_at_best, family_of
from mdstopo.plan.front_measures import dominated
from mdstopo.plan.race import Solved, in_contest, race
from mdstopo.plan.solve_task import Found, Result, Task
from mdstopo.plan.visited import Place, Visited, belonging, even_spacing
from mdstopo.settings.scalarisations import SCALARISATIONS, SUM
from mdstopo.status import RunStatus

Floats = NDArray[np.float64]
Rounds = Generator[list[Task], list[Result], "Front"]
Part = Generator[list[Task], list[Result], None]
#: a design of a family: number, family, the best design so far; None for the first design
Draw = Callable[[int, Family, Floats | None], Floats | None]

#: rounds of exchange at most; gain by which another's design is better, relative to U (to the violation)
EXCHANGES, GAIN, LESS = 6, 1e-6, 1e-3
#: gain by which a design that was only visited is better, relative to U: less than that, a solve that keeps its limits
#: to the tolerance may have given away itself
VISITED_GAIN = 1e-4
#: rounds of refinement at most; change of utopia or maxima, relative to their distance, from which points are solved
#: anew the first time, and in further rounds
REFINEMENTS, MOVED, MOVED_AGAIN = 4, 1e-6, 1e-3
#: violation of a constraint, relative to its bound, up to which a design counts as feasible here
TOLERATED = 1e-6


@dataclass(frozen=True)
class Starts:
    """The designs with which solves begin: first (N,), the case's own; count: how many a solve has; draw: makes the
    others.

    tolerance: of violations, where starts are compared. softens: whether there are members whose strengths vary.
    """

    first: Floats
    count: int = 1
    draw: Draw | None = None
    tolerance: float = 0.0
    softens: bool = True

    @property
    def early(self) -> int:
        """How many starts come before those that begin at the best design of the others."""
        return sum(not begins_at_best(family_of(index, self.count)) for index in range(self.count))

    def begin(self, task: Task, index: int, number: int, best: Floats | None = None) -> Task:
        """The task from start `index`, with the design of that number of its family."""
        family = family_of(index, self.count, self.softens)
        own = self.draw(number, family, best) if self.draw is not None else None
        start = self.first if own is None else own
        return replace(task, start=start, softened=family is Family.SOFTENED)


@dataclass(frozen=True)
class Request:
    """The front that is asked for: directions (W, m), weights or anchors; method; exponent p and whether to
    normalise (Eq. 24).

    signs (m,): -1 for what is to be maximised. starts: where solves begin; iterations: of each. active: the objectives
    that take part, by place; all where empty.
    """

    directions: Floats
    method: str
    exponent: float
    normalize: bool
    signs: Floats
    starts: Starts
    iterations: int
    active: tuple[int, ...] = ()


@dataclass(frozen=True)
class Front:
    """A front. points: what was found for every direction, None where nothing was. ends: the best known of every
    objective.

    utopia, maxima (m,): raw values, which the points of the last rounds were found with. further: designs that were
    visited on the way to a point (`Found.point`) and belong to the front.
    """

    points: tuple[Found | None, ...]
    ends: tuple[Found, ...]
    utopia: Floats
    maxima: Floats
    further: tuple[Found, ...] = ()


class NoEndError(Exception):
    """An objective alone could not be optimised: its place, and what was found."""

    def __init__(self, place: int, found: Found) -> None:
        super().__init__(found.reason)
        self.place = place
        self.found = found


class Planner:
    """Plans the solves of a front: keeps what has been found, and says which solves follow."""

    def __init__(self, request: Request) -> None:
        self.request = request
        self.count, self.m = request.directions.shape
        self.active = request.active or tuple(range(self.m))
        #: all usable results, and their signed objectives (K, m) and violations (K,) beyond what is tolerated
        self.known: list[Found] = []
        self.table = np.zeros((0, self.m))
        self.beyond = np.zeros(0)
        self.ends: list[Found] = []
        #: utopia and maxima, signed, and whether they are known: only once each end was begun at the others' designs
        self.lowest = np.zeros(self.m)
        self.highest = np.ones(self.m)
        self.scale_is_known = False
        #: by point, the best that was found for it under the present utopia and maxima, or in the last ones
        self.best: dict[int, Found] = {}
        self.solved: set[tuple[int, bytes]] = set()
        self.visited = Visited(self.m)
        #: what going the way of a solve once more has found
        self.repeated: dict[Place, Found] = {}

    def rounds(self) -> Rounds:
        """Tasks to be solved together; send their results, in order; returns the front."""
        yield from self._ends()
        yield from self._between()
        yield from self._exchange()
        for k in range(REFINEMENTS):
            moved = self._moves(MOVED if k == 0 else MOVED_AGAIN)
            if k > 0 and not moved:
                break
            yield from self._refine(moved)
            yield from self._exchange()
            yield from self._revisit()
        further = yield from self._further()
        self._improve_ends()
        points = tuple(self.best.get(j) for j in range(self.count))
        signs = self.request.signs
        return Front(points, tuple(self.ends), signs * self.lowest, signs * self.highest, further)

    def ends_alone(self) -> Part:
        """Plan the first rounds alone: each objective's optimum, and with it utopia and maxima."""
        yield from self._ends()

    # the rounds

    def _ends(self) -> Part:
        starts = self.request.starts
        early = starts.early
        alone = {i: Task(-1 - i, self._alone(i), starts.first, self.request.iterations) for i in self.active}
        contests = [in_contest([starts.begin(alone[i], k, k) for k in range(1, early)]) for i in self.active]
        solved = yield from self._solve(self._new(list(alone.values())), contests)
        self._choose_ends([found for _, found in solved])
        crossed = [
            replace(alone[i], start=other.alpha)
            for i in self.active
            for k, other in enumerate(self.ends)
            if k != i and k in self.active
        ]
        late = range(early, starts.count)
        crossed += [starts.begin(alone[i], k, k, self.ends[i].alpha) for i in self.active for k in late]
        yield from self._solve(self._new(crossed))
        self._moves(0.0)

    def _between(self) -> Part:
        for j in range(self.count):
            i = self._vertex(j)
            if i >= 0:
                self.best[j] = replace(self.ends[i], point=j)
        while True:
            due = self._due()
            if not due:
                return
            tasks = self._new([self._task(j, start) for j in due for start in self._sides(j)])
            solved = yield from self._solve(tasks, [self._contest(j) for j in due])
            for j in due:
                if j not in self.best:  # nothing worked; the first failure speaks for the point
                    failed = [found for _, found in solved if found.point == j]
                    self.best[j] = failed[0] if failed else self.ends[0]

    def _contest(self, j: int) -> list[Task]:
        """The further starts of a point: other designs of the families than other points have, near other ends."""
        starts = self.request.starts
        if starts.count == 1:
            return []
        task = self._task(j, starts.first)
        best = self.known[self._best_of(self._values(j, self.table), self.beyond)].alpha
        return in_contest([starts.begin(task, k, k + starts.count * (1 + j), best) for k in range(1, starts.count)])

    def _exchange(self) -> Part:
        for _ in range(EXCHANGES):
            tasks = []
            for j in range(self.count):
                values = self._values(j, self.table)
                k = self._best_of(values, self.beyond)
                own = self.best[j]
                if not own.usable:
                    better = True
                else:
                    beyond = _beyond(own)
                    value = float(self._values(j, self._signed(own)[None])[0])
                    gain = value > values[k] + GAIN * abs(values[k])
                    better = beyond > (1.0 + LESS) * self.beyond[k] if beyond > 0.0 else bool(gain)
                if better:
                    tasks.append(self._task(j, self.known[k].alpha))
            tasks = self._new(tasks)
            if not tasks:
                return
            yield from self._solve(tasks)

    def _refine(self, moved: bool) -> Part:
        tasks = []
        for j in range(self.count):
            if self._vertex(j) >= 0:
                continue
            starts = [self.best[j].alpha] if moved else []
            starts += [self.best[k].alpha for k in self._adjacent(j, [k for k in range(self.count) if k != j])]
            tasks += [self._task(j, start) for start in starts]
        if moved:
            # U has changed: what was found under the old one is no longer anybody's best
            self.best = {j: found for j, found in self.best.items() if self._vertex(j) >= 0}
        tasks = self._new(tasks, again=moved)
        if not tasks:
            return
        solved = yield from self._solve(tasks)
        for j in range(self.count):
            if j not in self.best:
                self.best[j] = next(found for _, found in solved if found.point == j)

    def _revisit(self) -> Part:
        """Points whose U is lower at a design that was only visited start again from that, and exchange."""
        way = self.visited.on_the_way()
        table, wanted = self.visited.table[way], []
        places = [place for place, on_the_way in zip(self.visited.places, way.tolist(), strict=True) if on_the_way]
        if not places:
            return
        for j in range(self.count):
            values = self._values(j, table)
            k = int(np.argmin(values))
            own = self.best[j]
            value = float(self._values(j, self._signed(own)[None])[0]) if own.usable and not _beyond(own) else np.inf
            if value > values[k] + VISITED_GAIN * abs(values[k]):
                wanted.append(places[k])
        new = [place for place in dict.fromkeys(wanted) if place not in self.repeated]
        if new:
            yield from self._repeat(new)
            yield from self._exchange()

    def _further(self) -> Generator[list[Task], list[Result], tuple[Found, ...]]:
        """The designs that were only visited and belong to the front."""
        points = [self._signed(each) for each in self.best.values() if each.usable and not _beyond(each)]
        front = np.array(points).reshape(-1, self.m)
        spacing = even_spacing(self.count, self.m)
        rows = belonging(front, self.visited.table, self.lowest, self.highest, spacing)
        places = [self.visited.places[row] for row in rows]
        solves = self.visited.solves
        yield from self._repeat(
            [place for place in places if solves[place[0]].iterate(place[1]) >= 0 and place not in self.repeated]
        )
        found = [self.repeated.get(place, solves[place[0]].found) for place in places]
        good = [replace(each, status=RunStatus.VISITED) for each in found if each.usable and not _beyond(each)]
        return tuple(sorted(good, key=lambda each: each.objectives.tolist()))

    def _repeat(self, places: list[Place]) -> Part:
        """The designs of places, by going the way to them once more."""
        if not places:
            return
        tasks = []
        for number, row in places:
            solve = self.visited.solves[number]
            tasks.append(replace(solve.task, iterate=solve.iterate(row)))
        solved = yield from self._solve(tasks)
        self.repeated |= {place: found for place, (_, found) in zip(places, solved, strict=True)}

    def _solve(
        self, tasks: list[Task], contests: list[list[Task]] | None = None
    ) -> Generator[list[Task], list[Result], Solved]:
        """Solve tasks, and those that compete with each other, and take the results in."""
        solved = yield from race(tasks, contests or [], self.request.starts.tolerance)
        self._learn(solved)
        return solved

    # what is known

    def _learn(self, solved: Solved) -> None:
        """Take results in: they are known to everybody, and the best of its point is that point's."""
        for task, found in solved:
            if found.iterate < 0:
                self.visited.add(task, found, self.request.signs, TOLERATED)
        new = [found for _, found in solved if found.usable]
        if new:
            self.known += new
            self.table = np.concatenate([self.table, [self._signed(each) for each in new]])
            self.beyond = np.concatenate([self.beyond, [_beyond(each) for each in new]])
        for each in new:
            if each.point < 0 or each.iterate >= 0:
                continue
            before = self.best.get(each.point)
            if before is None or not before.usable:
                self.best[each.point] = each
                continue
            pair = np.array([self._signed(before), self._signed(each)])
            if self._best_of(self._values(each.point, pair), np.array([_beyond(before), _beyond(each)])) == 1:
                self.best[each.point] = each

    def _choose_ends(self, found: list[Found]) -> None:
        if not self.known:  # where one objective alone fails, another's optimum is an end, and the crossed start
            raise NoEndError(-1 - found[0].point, found[0])
        self._improve_ends()

    def _improve_ends(self) -> None:
        """The ends are the best of their objective."""
        self.ends = [self.known[self._best_of(self.table[:, i], self.beyond)] for i in range(self.m)]

    def _moves(self, much: float) -> bool:
        """Bring utopia and maxima up to date, where they have moved by more than `much` of their distance.

        The maxima are those over the ends; of three objectives and more also those over the front so far, which may
        reach beyond. What has moved by less stays, so that they are what all points were solved with.
        """
        self._improve_ends()
        table = np.array([self._signed(self.ends[i]) for i in self.active])
        lowest, highest = table.min(axis=0), table.max(axis=0)
        if self.m > 2:
            points = np.array([self._signed(each) for each in self.best.values() if each.usable and not _beyond(each)])
            if len(points):
                highest = np.maximum(highest, points[~dominated(points)].max(axis=0))
        # objectives that agree have no width to be measured in
        flat = ~(highest - lowest > 1e-12 * np.abs(highest))
        highest = np.where(flat, lowest + 1.0, highest)
        limit = much * (highest - lowest)
        moved = bool(np.any(np.abs(lowest - self.lowest) > limit) or np.any(np.abs(highest - self.highest) > limit))
        if moved:
            self.lowest, self.highest = lowest, highest
        self.scale_is_known = True
        return moved

    def _signed(self, found: Found) -> Floats:
        return self.request.signs * found.objectives

    def _values(self, j: int, table: Floats) -> Floats:
        """U (K,) of point j at objectives (K, m); infinite where it has none. What violates planes (nc) costs a lot."""
        one = self.scalarisation(j)
        values = one.values(table) + 1e3 * one.excesses(table)
        return np.where(np.isfinite(values), values, np.inf)

    @staticmethod
    def _best_of(values: Floats, beyond: Floats) -> int:
        """The least violation beyond what is tolerated, among equals the lowest value, then the first."""
        return int(np.lexsort((np.arange(len(values)), values, beyond))[0])

    # scalarisations

    def _alone(self, i: int) -> Scalarisation:
        return Scalarisation(SUM, np.eye(self.m)[i])

    def _vertex(self, j: int) -> int:
        """The objective of which point j is the optimum alone, or -1."""
        places = np.flatnonzero(self.request.directions[j] > 0.0)
        return int(places[0]) if len(places) == 1 else -1

    def scalarisation(self, j: int) -> Scalarisation:
        """U of point j under the present utopia and maxima."""
        request, direction = self.request, self.request.directions[j]
        i = self._vertex(j)
        if i >= 0:
            return self._alone(i)
        kind = SCALARISATIONS[request.method]
        if not kind.in_cases:  # it spreads the points evenly
            # in units of Eq. 24 the ends are the rows of a table; anchors lie on the plane through them
            table = np.array([(self._signed(end) - self.lowest) / (self.highest - self.lowest) for end in self.ends])
            anchor = direction @ table
            one = Scalarisation(kind.name, np.ones(self.m), self.lowest, self.highest, anchor=anchor)
            return formula_of(kind.name).spread(one, table)
        if not (request.normalize and kind.scaled):
            return Scalarisation(request.method, direction, exponent=request.exponent)
        return Scalarisation(request.method, direction, self.lowest, self.highest, request.exponent)

    # tasks

    def _task(self, j: int, start: Floats) -> Task:
        return Task(j, self.scalarisation(j), start, self.request.iterations)

    def _new(self, tasks: list[Task], again: bool = False) -> list[Task]:
        """The tasks that were not begun yet for their point from their start, each once."""
        if again:
            self.solved = {mark for mark in self.solved if mark[0] < 0}
        new = []
        for task in tasks:
            mark = (task.point, task.start.tobytes())
            if mark not in self.solved:
                self.solved.add(mark)
                new.append(task)
        return new

    def _due(self) -> list[int]:
        """The points of the next round: in the middle of gaps; for more objectives those farthest from solved ones."""
        directions = self.request.directions
        todo = [j for j in range(self.count) if j not in self.best]
        if not todo:
            return []
        if self.m == 2:
            marks = sorted([0.0, 1.0, *(float(directions[j, 0]) for j in self.best)])
            due = []
            for low, high in pairwise(marks):
                inside = [j for j in todo if low < directions[j, 0] < high]
                if inside:
                    due.append(min(inside, key=lambda j: abs(float(directions[j, 0]) - 0.5 * (low + high))))
            return due
        placed = [np.eye(self.m)[i] for i in range(self.m)] + [directions[j] for j in self.best]
        due = []
        for _ in range(min(len(todo), len(placed))):
            distance = [min(float(np.linalg.norm(directions[j] - place)) for place in placed) for j in todo]
            j = todo.pop(int(np.argmax(distance)))
            due.append(j)
            placed.append(directions[j])
        return due

    def _sides(self, j: int) -> list[Floats]:
        """Where an unsolved point begins: the solved design that is best for it, and the neighbour across from it."""
        solved = [k for k in self.best if self.best[k].usable]
        sides = [self.best[k].alpha for k in self._adjacent(j, solved)]
        position = self.request.directions[j]
        if self.m > 2 or len(sides) < 2:
            order = np.argsort([float(np.linalg.norm(np.eye(self.m)[i] - position)) for i in range(self.m)])
            sides += [self.ends[i].alpha for i in order.tolist()]
        best = self.known[self._best_of(self._values(j, self.table), self.beyond)]
        if any(np.array_equal(best.alpha, side) for side in sides[:2]):
            return sides[:2]
        return [best.alpha, sides[0]]

    def _adjacent(self, j: int, among: list[int]) -> list[int]:
        """The nearest points on either side; for more objectives the nearest ones, as many as there are objectives."""
        directions = self.request.directions
        if self.m == 2:
            here = float(directions[j, 0])
            below = [k for k in among if directions[k, 0] < here]
            above = [k for k in among if directions[k, 0] > here]
            sides = [max(below, key=lambda k: float(directions[k, 0]))] if below else []
            return sides + ([min(above, key=lambda k: float(directions[k, 0]))] if above else [])
        order = sorted(among, key=lambda k: (float(np.linalg.norm(directions[k] - directions[j])), k))
        return order[: self.m]


def _beyond(found: Found) -> float:
    """A design's violation beyond what is tolerated; infinite where it is not known."""
    violation = found.violation
    if not np.isfinite(violation):
        return float("inf")
    return violation if violation > TOLERATED else 0.0
