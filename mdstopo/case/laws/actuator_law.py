"""A drive that steers to an elongation."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.keys.kinds import NOT_NEGATIVE, NUMBER
from mdstopo.case.laws.law import Law, Ranges, largest
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class ActuatorLaw(Law):
    """f = clip(proportional (Delta - target) + derivative dDelta/dt, -limit, limit); limit None: no clip."""

    type: ClassVar[str] = "actuator"
    kind: ClassVar[str] = "active"
    doc: ClassVar[str] = (
        "Active: f = kp (Delta - target) + kd dDelta/dt, kept between -limit and limit; stores no energy."
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.actuator"

    proportional: float = stated(NOT_NEGATIVE, "kp at alpha = 1", unit="N/m", scales=True, varies=True)
    derivative: float = stated(
        NOT_NEGATIVE, "kd at alpha = 1", unit="N s/m", default=0.0, scales=True, varies=True, of_rate=True
    )
    target: float = stated(NUMBER, "the elongation that it steers to", unit="m", default=0.0, varies=True)
    # a limit of 0 means another law, no force at all: one that varies stays above it
    limit: float | None = stated(
        NOT_NEGATIVE,
        "largest force at alpha = 1",
        unit="N",
        default=None,
        otherwise="none",
        scales=True,
        varies=True,
        varies_above=0.0,
    )

    def row(self) -> list[float]:
        """Parameters for the kernels: gains kp and kd, target, and limit (0: none); all 0 where the limit is zero."""
        if self.limit == 0.0:
            return []
        return [self.proportional, self.derivative, self.target, 0.0 if self.limit is None else self.limit]

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks: only where it has no limit."""
        return self.limit is None

    @property
    def holds(self) -> bool:
        """Whether it may have a force at rest: a damper alone has none."""
        return self.proportional != 0.0

    def strength(self, ranges: Ranges) -> float | None:
        """The largest force at alpha = 1 (N): its limit; None where it has none."""
        return None if self.limit is None else largest(ranges("limit"))
