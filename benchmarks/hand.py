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
from mdstopo.case.objects.parts import MemberGroup
from mdstopo.design_problem import DesignProblem
from mdstopo.engine import Evaluator
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.settings.optimizer_presets import settings

Floats = NDArray[np.float64]
#: a point in the plane or in space
Place = tuple[float, ...]
#: ends P and Q of one member, in m, global axes, at the start
Ends = tuple[Place, Place]
#: by part: the members that share one size. Its first word is a group, or how the names of several groups begin
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


def of_four_legs(*members: Ends) -> list[Ends]:
    """Members of the leg on the x axis with their mirror images, y against -y, and those of three more legs, each
    turned by a quarter about z."""
    return [
        ((c * p[0] - s * side * p[1], s * p[0] + c * side * p[1], p[2]),
         (c * q[0] - s * side * q[1], s * q[0] + c * side * q[1], q[2]))
        for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
        for side in (1, -1)
        for p, q in members
    ]  # fmt: skip


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
    "touchdown": {
        # as the lunar module: two crushable struts high up, close together, springs beside them, and a pair of braces
        # to the lower corners, which are crushable too
        "crush upper": of_four_legs(((2.2, 0, 0), (1, 0.2, 2.1))),
        "crush lower": of_four_legs(((2.2, 0, 0), (1, 1, 0.9))),
        "struts upper": of_four_legs(((2.2, 0, 0), (1, 0.2, 2.1))),
        "struts lower": of_four_legs(((2.2, 0, 0), (1, 1, 0.9))),
    },
    "cargo": {
        # as in the Code's own example four chains athwart on either side at 40 degrees, and at either end a pair at 40
        # and one at 12 degrees
        "side chains": in_quarters(((0.6, 2, 2.4), (0.6, 4.8, 0)), ((2.4, 2, 2.4), (2.4, 4.8, 0))),
        "end chains": in_quarters(((3, 0.8, 2.4), (5.8, 0.8, 0)), ((3, 0.8, 0.6), (5.8, 0.8, 0))),
    },
    "occupant": {
        # a three-point belt as in a car: from the middle of the pillar over clavicle and breastbone to the buckle, and
        # from the buckle over the lap to the sill; beside the lap, because behind it the pelvis goes too far in `right`
        "shoulder clavicle": [((-0.05, 0.13, 1.0), (-0.35, 0.35, 1.05))],
        "shoulder breastbone": [((-0.01, 0.03, 0.88), (-0.35, 0.35, 1.05))],
        "diagonal ribs": [((-0.03, -0.12, 0.72), (-0.25, -0.25, 0.4))],
        "diagonal breastbone": [((-0.01, -0.02, 0.8), (0.05, -0.25, 0.4))],
        "lap_outside": [((0.08, 0.0, 0.55), (0.05, 0.3, 0.35))],
        "lap_inside upper": [((0.06, -0.15, 0.54), (-0.25, -0.25, 0.4)), ((0.08, 0.0, 0.55), (-0.25, -0.25, 0.4))],
        "lap_inside lower": [((0.06, -0.15, 0.54), (-0.25, -0.25, 0.25)), ((0.08, 0.0, 0.55), (-0.25, -0.25, 0.25))],
    },
}  # fmt: skip


def places(case: Case, hand: Hand) -> list[tuple[str, list[int]]]:
    """The parts of a hand design with the places of their members in the design vector.

    Raises ValueError where the case has no such member (nearest ends off by more than 2 cm).
    """
    return [(part, [_place(case, part.split()[0], ends) for ends in members]) for part, members in hand.items()]


def _place(case: Case, word: str, ends: Ends) -> int:
    """The place in the design vector of the member with these ends, of the groups whose names begin with a word."""
    best, place = np.inf, -1
    for group in case.design_groups:
        if f"{group.name}_".startswith(f"{word}_"):
            p, q = group.from_world[group.from_index], group.to_world[group.to_index]
            off = np.linalg.norm(p - ends[0], axis=1) + np.linalg.norm(q - ends[1], axis=1)
            if off.min() < best:
                best, place = float(off.min()), case.group_slices[group.name].start + int(off.argmin())
    if best > 0.02:
        raise ValueError(f"{case.name}: no member of {word} joins {ends[0]} with {ends[1]}")
    return place


def alike(case: Case) -> list[list[MemberGroup]]:
    """The design groups, those together whose members have the same alphas."""
    found: list[list[MemberGroup]] = []
    for group in case.design_groups:
        others = {name for names in case.mirrored if group.name in names for name in names}
        with_it = next((each for each in found if each[0].name in others), None)
        if with_it is None:
            found.append([group])
        else:
            with_it.append(group)
    return found


def even(case: Case) -> list[tuple[str, list[int]]]:
    """The simplest rule, as parts of a design: all candidates of a group, and of those like it, have one size."""
    ranges = [(groups[0].name, [case.group_slices[group.name] for group in groups]) for groups in alike(case)]
    return [(name, [i for own in slices for i in range(own.start, own.stop)]) for name, slices in ranges]


class Sizes:
    """The problem of a case with one variable for each part of a hand design; all other members are at their bound.

    Raises ValueError where a part has some of the members that share an alpha, and not all of them.
    """

    def __init__(self, problem: DesignProblem, parts: list[tuple[str, list[int]]]) -> None:
        self.problem = problem
        self.spread = np.zeros((len(problem.initial), len(parts)))
        for k, (part, chosen) in enumerate(parts):
            whole = np.zeros(problem.space.length)
            whole[chosen] = 1.0
            self.spread[:, k] = problem.space.reduce(whole)
            if not np.isin(self.spread[:, k], (0.0, 1.0)).all():
                raise ValueError(f"{part}: all members that share an alpha belong to it, or none")
        rest = problem.lower * (1.0 - self.spread.sum(axis=1))
        self.rest = rest
        self.lower = np.array([problem.lower[own > 0.0].max() for own in self.spread.T])
        self.upper = np.array([problem.upper[own > 0.0].min() for own in self.spread.T])
        self.initial = 0.5 * self.upper
        rows = problem.linear
        self.linear = LinearRows(rows.A @ self.spread, rows.b - rows.A @ rest, rows.equal)

    def variables(self, sizes: Floats) -> Floats:
        """The problem's own variables x (n,)."""
        return np.asarray(self.rest + self.spread @ sizes)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """A sample of the case, seen from the sizes."""
        sample = self.problem.evaluate(self.variables(x), gradient)
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
    return case.space.expand(problem.variables(best.best_alpha))
