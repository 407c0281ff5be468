"""A belt with slack, or a contact."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.case.keys.kinds import NUMBER, Flag
from mdstopo.case.laws.law import (
    Law,
    Ranges,
    damping_key,
    free_length_key,
    largest,
    side_key,
    sign_of,
    slack_before,
    stiffness_key,
)
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class GapLaw(Law):
    """f = 0 until Delta >= gap, then stiffness (Delta - gap) + damping dDelta/dt (Eq. 3).

    side: tension | compression; compression mirrors the law. clip: damping cannot reverse the force.
    """

    type: ClassVar[str] = "gap"
    kind: ClassVar[str] = "reactive"
    doc: ClassVar[str] = (
        "Reactive, a belt with slack or a contact: f = 0 until Delta >= gap, then k (Delta - gap) + c dDelta/dt "
        "(Eq. 3); energy k (Delta - gap)^2 / 2 while closed."
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.gap"

    stiffness: float = stiffness_key()
    damping: float = damping_key()
    gap: float = stated(NUMBER, "elongation at which it closes", unit="m", default=0.0, varies=True)
    free_length: float | None = free_length_key()
    side: str = side_key(
        "closes where the member has become longer: Delta >= gap",
        "closes where it has become shorter: k (Delta + gap) + c dDelta/dt for Delta <= -gap",
        "on which side it acts",
        "tension",
    )
    clip: bool = stated(Flag(), "true: damping cannot reverse the force; false: Eq. 3 to the letter", default=False)

    def row(self) -> list[float]:
        """Parameters for the kernels: stiffness, damping, gap, side, and whether damping cannot reverse the force."""
        return [self.stiffness, self.damping, self.gap, sign_of(self.side), float(self.clip)]

    def side_of_force(self, ranges: Ranges) -> int:
        """1 where it only pulls, -1 where it only pushes; 0 where damping may reverse the force, unless `clip` prevents
        that."""
        return 0 if largest(ranges("damping")) > 0.0 and not self.clip else int(sign_of(self.side))

    def slack(self, ranges: Ranges, length: FloatArray) -> FloatArray:
        """By how much the length of members has to change until the gap is closed, (M,) m."""
        return slack_before(self.side, self.free_length, ranges, length)

    def force_at(self, stretch: FloatArray, rate: FloatArray) -> FloatArray:
        """Force (N) by elongation (m) and rate (m/s) at alpha = 1 (Eq. 3)."""
        side = sign_of(self.side)
        force = self.stiffness * (side * stretch - self.gap) + self.damping * side * rate
        if self.clip:
            force = np.maximum(force, 0.0)
        return np.where(side * stretch >= self.gap, side * force, 0.0)
