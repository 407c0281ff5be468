"""The linear spring with damping and preload."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import FloatArray
from mdstopo.case.keys.kinds import NUMBER
from mdstopo.case.laws.law import Law, damping_key, free_length_key, stiffness_key
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class SpringLaw(Law):
    """f = stiffness Delta + damping dDelta/dt + preload (Eq. 2); V = stiffness Delta^2 / 2."""

    type: ClassVar[str] = "spring"
    kind: ClassVar[str] = "passive"
    doc: ClassVar[str] = "Passive: f = k Delta + c dDelta/dt + preload (Eq. 2); energy k Delta^2 / 2."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.linear"

    stiffness: float = stiffness_key()
    damping: float = damping_key()
    free_length: float | None = free_length_key()
    preload: float = stated(
        NUMBER, "tension at Delta = 0, at alpha = 1", unit="N", default=0.0, scales=True, varies=True
    )

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks: always."""
        return True

    @property
    def holds(self) -> bool:
        """Whether it may have a force at rest: a damper alone has none."""
        return self.stiffness != 0.0 or self.preload != 0.0

    def force_at(self, stretch: FloatArray, rate: FloatArray) -> FloatArray:
        """Force (N) by elongation (m) and rate (m/s) at alpha = 1 (Eq. 2)."""
        return self.stiffness * stretch + self.damping * rate + self.preload
