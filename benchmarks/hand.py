"""Designs that a careful person would draw, and how they are sized: what the found designs are compared with.

A hand design is a choice of members. Their sizes are one number for each of its parts, which is then made as good as
it can be, by the same optimiser under the same limits.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case
from mdstopo.engine import Evaluator
from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.structure import StructureProblem

Floats = NDArray[np.float64]
#: ends P and Q of one member, in m, global axes, at the start
Ends = tuple[tuple[float, float], tuple[float, float]]
#: by part, whose first word is a group: the members that share one size
Hand = Mapping[str, Sequence[Ends]]

#: iterations that its sizes are given, and shares of the upper bounds that they begin with
ITERATIONS, STARTS = 40, (0.5, 1.0)

HANDS: dict[str, Hand] = {
    "tiedown": {
        # every hook tied outwards, the outer ones inwards too, symmetric; chocks on both sides of the outer axles
        "chains at the ends": [((-2.8, 0.9), (-4.5, 0)), ((2.8, 0.9), (4.5, 0))],
        "chains between": [((-0.933, 0.9), (-3, 0)), ((0.933, 0.9), (3, 0))],
        "chains inwards": [((-2.8, 0.9), (-0.75, 0)), ((2.8, 0.9), (0.75, 0))],
        "straps at the ends": [((-2.8, 0.9), (-4.5, 0)), ((2.8, 0.9), (4.5, 0))],
        "straps between": [((-0.933, 0.9), (-3, 0)), ((0.933, 0.9), (3, 0))],
        "chocks": [
            ((-2.1, 0.3), (-3.1, 0.1)), ((-2.1, 0.3), (-1.1, 0.1)), ((2.1, 0.3), (1.1, 0.1)), ((2.1, 0.3), (3.1, 0.1)),
        ],
    },
    "mooring": {
        # head and stern lines, breast lines, springs from both quarters, as on any pier
        "long_lines head and stern": [((54, -4), (90, -13)), ((-54, -4), (-90, -13))],
        "long_lines springs": [((22, -9), (-15, -13)), ((-22, -9), (15, -13))],
        "short_lines breast": [((44, -8), (45, -13)), ((-44, -8), (-45, -13))],
        "tensioners": [((54, -4), (75, -13)), ((-54, -4), (-75, -13))],
        "fenders": [((x, -9), (x, -40)) for x in (-40, -20, 0, 20, 40)],
    },
    "restraint": {
        # a four-point harness: level shoulder straps from a reel, lap belts at 45 degrees, and a knee pad
        "shoulder_belts": [((-0.08, 1.05), (-0.55, 1.05))],
        "retractors": [((-0.08, 1.05), (-0.55, 1.05))],
        "lap_belts": [((0.06, 0.52), (-0.3, 0.2)), ((0.04, 0.6), (-0.3, 0.2))],
        "knee_pads": [((0.44, 0.56), (1.0, 0.5))],
    },
    "lander": {
        # as the lunar module: two crushable struts high up, a brace beside them and one to the lower edge, symmetric
        "left_crush": [((-1.9, 0), (-1, 1.7)), ((-1.9, 0), (-1, 2.1))],
        "right_crush": [((1.9, 0), (1, 1.7)), ((1.9, 0), (1, 2.1))],
        "left_struts upper": [((-1.9, 0), (-1, 1.7))],
        "right_struts upper": [((1.9, 0), (1, 1.7))],
        "left_struts lower": [((-1.9, 0), (-1, 0.9))],
        "right_struts lower": [((1.9, 0), (1, 0.9))],
    },
}  # fmt: skip


def places(case: Case, hand: Hand) -> list[tuple[str, list[int]]]:
    """The parts of a hand design with the places of their members in the design vector.

    Raises ValueError where the case has no such member (nearest ends off by more than 2 cm).
    """
    found = []
    for part, members in hand.items():
        group = next(each for each in case.design_groups if each.name == part.split()[0])
        first = case.group_slices[group.name].start
        p, q = group.from_world[group.from_index], group.to_world[group.to_index]
        chosen = []
        for ends in members:
            off = np.hypot(*(p - ends[0]).T) + np.hypot(*(q - ends[1]).T)
            if off.min() > 0.02:
                raise ValueError(f"{case.name}: no member of {group.name} joins {ends[0]} with {ends[1]}")
            chosen.append(first + int(off.argmin()))
        found.append((part, chosen))
    return found


class Sizes:
    """The problem of a case with one variable for each part of a hand design; all other members are at their bound."""

    def __init__(self, problem: StructureProblem, parts: list[tuple[str, list[int]]]) -> None:
        self.problem = problem
        self.spread = np.zeros((len(problem.initial), len(parts)))
        for k, (_, chosen) in enumerate(parts):
            self.spread[chosen, k] = 1.0
        rest = problem.lower * (1.0 - self.spread.sum(axis=1))
        self.rest = rest
        self.lower = np.array([problem.lower[chosen].max() for _, chosen in parts])
        self.upper = np.array([problem.upper[chosen].min() for _, chosen in parts])
        self.initial = 0.5 * self.upper
        rows = problem.linear
        self.linear = LinearRows(rows.A @ self.spread, rows.b - rows.A @ rest, rows.equal)

    def design(self, sizes: Floats) -> Floats:
        """alpha (N,)."""
        return np.asarray(self.rest + self.spread @ sizes)

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """A sample of the case, seen from the sizes."""
        sample = self.problem.evaluate(self.design(x), gradient)
        if not len(sample.gradients):
            return sample
        limits = sample.constraint_gradients.reshape(len(sample.constraint_rows), -1)
        return replace(sample, gradients=sample.gradients @ self.spread, constraint_gradients=limits @ self.spread)


def sized(case: Case, hand: Hand, score: Scalarisation) -> Floats:
    """The hand design (N,) with the sizes that the optimiser finds best, from the best of several equal starts."""
    problem = Sizes(StructureProblem(Evaluator(case), score), places(case, hand))
    chosen = settings(max_iterations=ITERATIONS)
    ends = [run(Gsao(problem, chosen), Gsao(problem, chosen).start(share * problem.upper)) for share in STARTS]
    best = min(ends, key=lambda state: (max(state.best_violation, 1e-6), state.best_objective))
    return problem.design(best.best_alpha)
