"""A force that is proportional to relative acceleration."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.keys.kinds import NOT_NEGATIVE
from mdstopo.case.laws.law import Law
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class InerterLaw(Law):
    """f = inertance d2Delta/dt2 (the acceleration of Eq. 1)."""

    type: ClassVar[str] = "inerter"
    kind: ClassVar[str] = "passive"
    doc: ClassVar[str] = "Passive: f = b d2Delta/dt2, the acceleration of Eq. 1; stores no energy."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.inerter"

    inertance: float = stated(NOT_NEGATIVE, "b at alpha = 1", unit="kg", scales=True, varies=True, of_rate=True)

    @property
    def holds(self) -> bool:
        """Whether it may have a force at rest: it has none."""
        return False
