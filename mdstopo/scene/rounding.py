"""The same scene, rounded otherwise: a sample of what double precision leaves uncertain.

Two evaluations of one scene that differ in nothing but their tolerance round elongations alike, so their difference
says nothing of what rounding does. Where a member is stretched by Delta while its bodies have moved by u, its force is
uncertain by eps u / Delta; states are rounded at every step, which adds up over many periods. Here the scene is
computed from another point, and each length and each attachment point is moved to one of its neighbours in double
precision: all products of displacements round otherwise. What that changes is what rounding changes, its growth in time
included.
"""

from dataclasses import replace

import numpy as np

from mdstopo.case.model import Case, MemberGroup
from mdstopo.scene.origin import Point, seen_from
from mdstopo.scene.springs_model import FloatArray

#: the other point is so far away, of the scene's size: coordinates stay as large as they are
FAR_POINT = 0.05, 0.2


def rounded_otherwise(case: Case, origin: Point, size: float, sample: int) -> Case:
    """The same case with other rounding: in coordinates from a point near `origin`, its numbers changed in the last
    digit; sample: which, from 1."""
    random = np.random.default_rng(sample)
    apart = (size * random.uniform(*FAR_POINT, len(origin))).tolist()
    moved = seen_from(case, tuple(zero + away for zero, away in zip(origin, apart, strict=True)))
    return replace(moved, members=tuple(_nudged(group, random) for group in moved.members))


def _nudged(group: MemberGroup, random: np.random.Generator) -> MemberGroup:
    return replace(
        group,
        from_local=_neighbours(group.from_local, random),
        to_local=_neighbours(group.to_local, random),
        length=_neighbours(group.length, random),
    )


def _neighbours(numbers: FloatArray, random: np.random.Generator) -> FloatArray:
    """Of each number the next larger or smaller one; zeros, which are exact, stay."""
    towards = np.where(random.random(numbers.shape) < 0.5, -np.inf, np.inf)
    found: FloatArray = np.where(numbers == 0.0, 0.0, np.nextafter(numbers, towards))
    return found
