"""Designs that a careful person would draw, and how they are sized: what the found designs are compared with.

A hand design is a choice of members. Their sizes are one number for each of its parts, which is then made as good as
it can be, by the same optimiser under the same limits. An even design has no choice: every candidate of a group has the
same size, which is found in the same way.

The layouts below keep all limits within the volumes of their cases. They are not first drafts: these did not.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case
from mdstopo.case.parts import MemberGroup
from mdstopo.design_problem import DesignProblem
from mdstopo.engine import Evaluator
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.settings.optimizer_presets import settings

Floats = NDArray[np.float64]
#: ends P and Q of one member, in m, global axes, at the start; two or three coordinates each
Ends = tuple[tuple[float, ...], tuple[float, ...]]
#: by part, whose first word is a group, or how the names of its groups begin: the members that share one size
Hand = Mapping[str, Sequence[Ends]]

#: iterations that its sizes are given, and shares of the upper bounds that they begin with
ITERATIONS, STARTS = 40, (0.5, 1.0)


def mirrored(*members: Ends) -> list[Ends]:
    """Members and their mirror images, x against -x."""
    return [((side * p[0], *p[1:]), (side * q[0], *q[1:])) for side in (1, -1) for p, q in members]


def in_quarters(*members: Ends) -> list[Ends]:
    """Members and their mirror images, x against -x and y against -y."""
    both = mirrored(*members)
    return [((p[0], side * p[1], *p[2:]), (q[0], side * q[1], *q[2:])) for side in (1, -1) for p, q in both]


HANDS: dict[str, Hand] = {
    "tiedown": {
        # both sides alike; every hook is tied outwards to the two rings that pull least downwards, a size for each of
        # the four directions; straps beside the chains; a chock on the outer side of either outer axle
        "chains to the ends": mirrored(((2.8, 0.9), (4.5, 0))),
        "chains beside them": mirrored(((2.8, 0.9), (3.75, 0))),
        "chains between, short": mirrored(((0.933, 0.9), (3, 0))),
        "chains between, long": mirrored(((0.933, 0.9), (3.75, 0))),
        "straps at the ends": mirrored(((2.8, 0.9), (4.5, 0)), ((2.8, 0.9), (3.75, 0))),
        "straps between": mirrored(((0.933, 0.9), (3, 0))),
        "chocks": mirrored(((2.1, 0.3), (3.1, 0.1))),
    },
    "mooring": {
        # head and stern lines, four breast lines, springs from both quarters, a tensioner and a fender at either end
        "long_lines head and stern": mirrored(((54, -4), (90, -13))),
        "long_lines springs": mirrored(((22, -9), (-15, -13))),
        "short_lines breast": mirrored(((44, -8), (45, -13)), ((22, -9), (30, -13))),
        "tensioners": mirrored(((54, -4), (75, -13))),
        "fenders": mirrored(((40, -9), (40, -40))),
    },
    "restraint": {
        # a four-point harness: level shoulder straps from a reel, lap belts to the rear of the seat, and a knee pad
        "shoulder_belts": [((-0.08, 1.05), (-0.55, 1.05))],
        "retractors": [((-0.08, 1.05), (-0.55, 1.05))],
        "lap_belts": [((0.06, 0.52), (-0.4, 0.2)), ((0.04, 0.6), (-0.4, 0.2))],
        "knee_pads": [((0.44, 0.56), (1.0, 0.5))],
    },
    "lander": {
        # as the lunar module: two crushable struts high up, a brace beside them and two to the lower edge; both legs
        # are laid out alike, with sizes of their own, because only one meets the stone
        "left_crush": [((-1.9, 0), (-1, 1.7)), ((-1.9, 0), (-1, 2.1))],
        "right_crush": [((1.9, 0), (1, 1.7)), ((1.9, 0), (1, 2.1))],
        "left_struts upper": [((-1.9, 0), (-1, 1.7))],
        "right_struts upper": [((1.9, 0), (1, 1.7))],
        "left_struts lower": [((-1.9, 0), (-1, 0.9)), ((-1.9, 0), (-0.6, 0.9))],
        "right_struts lower": [((1.9, 0), (1, 0.9)), ((1.9, 0), (0.6, 0.9))],
    },
    "cargo": {
        # as in the Code's own example four chains athwart on either side at 40 degrees, and at either end a pair at 40
        # and one at 12 degrees
        "side chains": in_quarters(((0.6, 2, 2.4), (0.6, 4.8, 0)), ((2.4, 2, 2.4), (2.4, 4.8, 0))),
        "end chains": in_quarters(((3, 0.8, 2.4), (5.8, 0.8, 0)), ((3, 0.8, 0.6), (5.8, 0.8, 0))),
    },
}  # fmt: skip


def places(case: Case, hand: Hand) -> list[tuple[str, list[int]]]:
    """The parts of a hand design with the places of their members in the design vector.

    Raises ValueError where the case has no such member (nearest ends off by more than 2 cm).
    """
    found = []
    for part, members in hand.items():
        name = part.split()[0]
        groups = [each for each in case.design_groups if each.name == name or each.name.startswith(f"{name}_")]
        places_of = [np.arange(own.start, own.stop) for own in (case.group_slices[each.name] for each in groups)]
        p, q = (np.concatenate(ends) for ends in zip(*map(_ends, groups), strict=True))
        chosen = []
        for ends in members:
            off = np.linalg.norm(p - ends[0], axis=1) + np.linalg.norm(q - ends[1], axis=1)
            if off.min() > 0.02:
                raise ValueError(f"{case.name}: no member of {name} joins {ends[0]} with {ends[1]}")
            chosen.append(int(np.concatenate(places_of)[off.argmin()]))
        found.append((part, chosen))
    return found


def _ends(group: MemberGroup) -> tuple[Floats, Floats]:
    return group.from_world[group.from_index], group.to_world[group.to_index]


def even(case: Case) -> list[tuple[str, list[int]]]:
    """The simplest rule, as parts of a design: all candidates of a group, and of its mirror images, have one size."""
    parts: dict[str, list[int]] = {}
    images = {name: names[0] for names in case.mirrored for name in names}
    for group in case.design_groups:
        own = case.group_slices[group.name]
        parts.setdefault(images.get(group.name, group.name), []).extend(range(own.start, own.stop))
    return list(parts.items())


class Sizes:
    """The problem of a case with one variable for each part of a hand design; all other members are at their bound."""

    def __init__(self, problem: DesignProblem, parts: list[tuple[str, list[int]]]) -> None:
        self.problem = problem
        n = problem.space.n_alpha
        columns = [np.isin(np.arange(n), chosen).astype(np.float64) for _, chosen in parts]
        # of members that share one alpha all are in a part, or none
        self.spread = np.column_stack([problem.space.reduce(column) for column in columns])
        rest = problem.lower * (1.0 - self.spread.sum(axis=1))
        self.rest = rest
        self.lower = np.array([problem.lower[column > 0.0].max() for column in self.spread.T])
        self.upper = np.array([problem.upper[column > 0.0].min() for column in self.spread.T])
        self.initial = 0.5 * self.upper
        rows = problem.linear
        self.linear = LinearRows(rows.A @ self.spread, rows.b - rows.A @ rest, rows.equal)

    def design(self, sizes: Floats) -> Floats:
        """alpha (N,)."""
        return np.asarray(self.problem.space.expand(self._shared(sizes)))

    def _shared(self, sizes: Floats) -> Floats:
        """The optimiser's variables of the case."""
        return np.asarray(self.rest + self.spread @ sizes)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """A sample of the case, seen from the sizes."""
        sample = self.problem.evaluate(self._shared(x), gradient)
        if not len(sample.gradients):
            return sample
        slopes = {
            name: rows.reshape(-1, self.spread.shape[0]) @ self.spread
            for name in ("gradients", "constraint_gradients", "across", "constraint_across")
            if (rows := getattr(sample, name)).size
        }
        return replace(sample, **slopes)


def sized(case: Case, parts: list[tuple[str, list[int]]], score: Scalarisation) -> Floats:
    """The design (N,) with the sizes of its parts that the optimiser finds best, from the best of several starts."""
    problem = Sizes(DesignProblem(Evaluator(case), score), parts)
    chosen = settings(max_iterations=ITERATIONS)
    ends = [run(Gsao(problem, chosen), Gsao(problem, chosen).start(share * problem.upper)) for share in STARTS]
    best = min(ends, key=lambda state: (max(state.best_violation, 1e-6), state.best_objective))
    return problem.design(best.best_alpha)
