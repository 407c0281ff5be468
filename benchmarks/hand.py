"""Designs that a careful person would draw, and how they are sized: what the found designs are compared with.

A hand design is a choice of members. Their sizes are one number for each of its parts, which is then made as good as
it can be: limits are kept if they can be, and U is the least that a pattern search finds.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case
from mdstopo.case.model import VolumeRow

Floats = NDArray[np.float64]
#: ends P and Q of one member, in m, global axes, at the start
Ends = tuple[tuple[float, float], tuple[float, float]]
#: by part, whose first word is a group: the members that share one size
Hand = Mapping[str, Sequence[Ends]]

#: factors by which sizes are changed in turn, and evaluations that may be spent
FACTORS, EVALUATIONS = (4.0, 2.0, 1.4, 1.15, 1.05), 100

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


def sized(case: Case, hand: Hand, judge: Callable[[Floats], tuple[float, float]]) -> Floats:
    """The hand design (N,) with the best sizes. judge: a design's largest violation, relative to its bound, and U."""
    parts = places(case, hand)
    sizes = np.array([float(case.upper[members].min()) for _, members in parts])

    def design(sizes: Floats) -> Floats:
        alpha = np.array(case.lower)
        for (_, members), size in zip(parts, sizes, strict=True):
            alpha[members] = np.clip(size, case.lower[members], case.upper[members])
        return alpha

    def rank(sizes: Floats) -> tuple[float, float]:
        alpha = design(sizes)
        rows = [row for row in case.constraints if isinstance(row, VolumeRow)]
        over = max((float(row.coefficients @ alpha) / row.bound - 1.0 for row in rows), default=0.0)
        if over > 1e-9:
            return 1e3 + over, np.inf  # not worth a simulation
        violation, combined = judge(alpha)
        return max(violation, 1e-6), combined

    best, spent = rank(sizes), 1
    for factor in FACTORS:
        moved = True
        while moved and spent < EVALUATIONS:
            moved = False
            for i in range(len(sizes)):
                for change in (1.0 / factor, factor):
                    tried = sizes.copy()
                    tried[i] *= change
                    if np.array_equal(design(tried), design(sizes)):
                        continue
                    found = rank(tried)
                    spent += found[0] < 1e3
                    if found < best:
                        best, sizes, moved = found, tried, True
                        break
    return design(sizes)
