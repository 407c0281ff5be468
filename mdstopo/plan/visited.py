"""Designs that were visited on the way: which of them belong to the front beside its points.

Every evaluation of every solve gives a point in objective space, better or worse. Most are left behind; but one may be
better than a point of the front, or lie where the front has a gap, because no direction that was asked for leads there.
Of all of them only the values are kept. The few designs that are needed are computed again, by repeating their solve up
to that iterate (`solve_task.Task.iterate`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdstopo.plan.front_measures import SAME_VALUE, dominated, scaled
from mdstopo.plan.solve_task import Found, Task

Floats = NDArray[np.float64]
#: a design: the number of its solve, and which of its rows
Place = tuple[int, int]

#: distance from every point of the front from which a visited design fills a gap, in spacings of an even front; share
#: of its distance by which it has to be better than each of them in something, lest it lie on the gap's upper side
GAP, SLIVER = 0.5, 0.1
#: how far below the line through the front's points a visited design belongs to it however near a point is, in spacings
FAR_BELOW_LINE = 0.05


@dataclass(frozen=True)
class Solve:
    """A task that was solved, and what it has found."""

    task: Task
    found: Found

    def iterate(self, row: int) -> int:
        """The iterate of a row; -1 for the last row, the design that was kept."""
        return row if row < len(self.found.visited) - 1 else -1


class Visited:
    """The designs that a front's solves have evaluated, keep the limits, and have values of all objectives.

    table (V, m): their objectives, smaller is better; places: where each was met.
    """

    def __init__(self, m: int) -> None:
        self.solves: list[Solve] = []
        self.table = np.zeros((0, m))
        self.places: list[Place] = []

    def add(self, task: Task, found: Found, signs: Floats, tolerated: float) -> None:
        """Add the designs that a solve has evaluated."""
        number = len(self.solves)
        self.solves.append(Solve(task, found))
        values = signs * found.visited
        good: NDArray[np.bool_] = np.array(np.isfinite(values).all(axis=1))
        if len(found.violations) == len(good):
            good &= found.violations <= tolerated
        self.table = np.concatenate([self.table, values[good]])
        self.places += [(number, row) for row in np.flatnonzero(good).tolist()]

    def on_the_way(self) -> NDArray[np.bool_]:
        """(V,) which designs are no ends of solves, but were passed by one."""
        return np.array([self.solves[number].iterate(row) >= 0 for number, row in self.places], dtype=np.bool_)


def even_spacing(count: int, m: int) -> float:
    """The distance between neighbours of so many points, evenly spread on the plane between the ends, scaled."""
    parts = 1
    while math.comb(parts + m - 1, m - 1) < count:
        parts += 1
    return math.sqrt(2.0) / parts


def belonging(points: Floats, table: Floats, lowest: Floats, highest: Floats, spacing: float) -> list[int]:
    """The rows of `table` (V, m) that become points of a front of `points` (W, m), in the order in which they are
    taken.

    First those that dominate a point, the best of them first (the least sum of scaled objectives), each in the place of
    all that it dominates. Then those that fill gaps: not dominated, and farther than `GAP` spacings from every point
    (`_apart`), the farthest first, each a point from then on. Then those that are near a point, but farther than
    `FAR_BELOW_LINE` spacings below the line through the points (`_depth`): beside a steep end of the front a design may
    be near the end and still much better in one objective for little of another. The deepest first, each a point from
    then on.
    Objectives are scaled so that lowest and highest (m,), utopia and maxima, are 0 and 1.
    """
    front = points[~dominated(points)]
    if not len(front):
        return []
    left = [k for k in range(len(table)) if not _is_reached(table[k], front)]
    left = [left[k] for k in np.flatnonzero(~dominated(table[left])).tolist()]
    taken: list[int] = []
    order = np.argsort(scaled(table[left], lowest, highest).sum(axis=1), kind="stable").tolist()
    for k in (left[each] for each in order):
        beaten = dominated(np.concatenate([table[k][None], front]))[1:]
        if beaten.any():
            taken.append(k)
            front = np.concatenate([front[~beaten], table[k][None]])
    left = [k for k in left if k not in taken]
    own, placed = scaled(table[left], lowest, highest), scaled(front, lowest, highest)
    apart = np.full(len(left), np.inf)
    for point in placed:
        apart = np.minimum(apart, _apart(own, point))
    while len(left) and apart.max() > GAP * spacing:
        k = int(np.argmax(apart))
        taken.append(left[k])
        placed = np.concatenate([placed, own[k][None]])
        apart = np.minimum(apart, _apart(own, own[k]))
    while len(left) and (depth := _depth(own, placed)).max() > FAR_BELOW_LINE * spacing:
        k = int(np.argmax(depth))
        taken.append(left.pop(k))
        placed, own = np.concatenate([placed, own[k][None]]), np.delete(own, k, axis=0)
    return taken


def _depth(designs: Floats, points: Floats) -> Floats:
    """By how much (K,) designs (K, m) lie below the line through points (W, m), the same in every objective; -inf
    where there is no line: beyond the ends, or where the points do not span a surface.

    Seen along the direction in which all objectives change alike, points that do not dominate each other lie side by
    side, m - 1 coordinates apart. Over these the sum of the objectives is interpolated linearly between neighbours: of
    two objectives the line that a picture of the front shows, of more a surface of triangles (Delaunay's).
    """
    m = points.shape[1]
    across, over = points[:, :-1] - points[:, -1:], points.sum(axis=1)
    own = designs[:, :-1] - designs[:, -1:]
    if m == 2:
        order = np.argsort(across[:, 0], kind="stable")
        line = np.interp(own[:, 0], across[order, 0], over[order], left=-np.inf, right=-np.inf)
    else:
        from scipy.interpolate import LinearNDInterpolator
        from scipy.spatial import QhullError

        try:
            line = LinearNDInterpolator(across, over, fill_value=-np.inf)(own)
        except QhullError:
            return np.full(len(designs), -np.inf)
    return np.asarray((line - designs.sum(axis=1)) / m)


def _apart(designs: Floats, point: Floats) -> Floats:
    """The distance (K,) of designs (K, m) from a point, 0 where the point dominates them but for a sliver.

    By how much the point would have to be better in every objective to be as good is the additive epsilon indicator
    (E. Zitzler et al., Performance assessment of multiobjective optimizers, 2003).
    """
    distance = np.linalg.norm(designs - point, axis=1)
    return np.asarray(np.where((point - designs).max(axis=1) >= SLIVER * distance, distance, 0.0))


def _is_reached(values: Floats, front: Floats) -> bool:
    """Whether a point of the front is no worse in any objective, but for `SAME_VALUE` of it."""
    return bool((front <= values + SAME_VALUE * np.abs(values)).all(axis=1).any())
