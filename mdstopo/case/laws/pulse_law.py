"""A bell of force over time."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.keys.kinds import NOT_NEGATIVE, NUMBER
from mdstopo.case.laws.law import Law, Ranges, largest, side_between
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class PulseLaw(Law):
    """A pulse of force at a known time: f = peak exp(-rate (t - time)^2) (Eq. 4)."""

    type: ClassVar[str] = "pulse"
    kind: ClassVar[str] = "active"
    doc: ClassVar[str] = "Active: f = f0 exp(-sigma (t - t0)^2) (Eq. 4); stores no energy."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.pulse"

    peak: float = stated(NUMBER, "f0, the largest tension at alpha = 1", unit="N", scales=True, varies=True)
    rate: float = stated(NOT_NEGATIVE, "sigma; larger is shorter", unit="1/s^2", varies=True, is_time=True)
    time: float = stated(NUMBER, "t0, when the peak is", unit="s", varies=True, is_time=True)

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks: always."""
        return True

    def strength(self, ranges: Ranges) -> float:
        """The largest force at alpha = 1 (N): the peak of the pulse."""
        return largest(ranges("peak"))

    def side_of_force(self, ranges: Ranges) -> int:
        """1 where the peak is positive and it only pulls, -1 where it only pushes; 0 where the peak may have both
        signs."""
        return side_between(ranges("peak"))
