"""A crushable leg, or an energy absorber."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import FloatArray
from mdstopo.case.keys.kinds import NUMBER, POSITIVE
from mdstopo.case.laws.law import Law, Ranges, free_length_key, largest, side_key, sign_of, slack_before, stiffness_key
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class CrushLaw(Law):
    """f = stiffness (Delta - set - gap) between 0 and force; beyond it the set grows. V = f^2 / (2 stiffness).

    side: compression | tension, the way in which it is crushed; compression mirrors the law.
    """

    type: ClassVar[str] = "crush"
    kind: ClassVar[str] = "reactive"
    doc: ClassVar[str] = (
        "Reactive, a crushable leg or an energy absorber: f rises with k (Delta - gap) up to F, stays F while it "
        "is crushed further, falls with k on the way back to 0 and leaves a permanent set; energy f^2 / (2 k)."
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.crush"

    stiffness: float = stiffness_key(positive=True)
    force: float = stated(POSITIVE, "F, the plateau, at alpha = 1", unit="N", scales=True, varies=True)
    gap: float = stated(
        NUMBER, "elongation, or shortening, at which contact begins", unit="m", default=0.0, varies=True
    )
    free_length: float | None = free_length_key()
    side: str = side_key(
        "it is drawn out where the member becomes longer, and pulls",
        "it is crushed where the member becomes shorter, and pushes",
        "the way in which it is crushed",
        "compression",
    )

    def row(self) -> list[float]:
        """Parameters for the kernels: stiffness, plateau, gap, and the side on which it is crushed."""
        return [self.stiffness, self.force, self.gap, sign_of(self.side)]

    def strength(self, ranges: Ranges) -> float:
        """The largest force at alpha = 1 (N): that of the plateau."""
        return largest(ranges("force"))

    def side_of_force(self, ranges: Ranges) -> int:
        """1 where it is crushed by elongation and only pulls, -1 where it only pushes."""
        del ranges
        return int(sign_of(self.side))

    def slack(self, ranges: Ranges, length: FloatArray) -> FloatArray:
        """By how much the length of members has to change until the gap is closed, (M,) m."""
        return slack_before(self.side, self.free_length, ranges, length)
