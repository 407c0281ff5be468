"""A spring that hardens or softens."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.keys.kinds import NUMBER
from mdstopo.case.laws.law import Law, free_length_key, stiffness_key
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class CubicLaw(Law):
    """f = stiffness Delta + cubic Delta^3; V = stiffness Delta^2 / 2 + cubic Delta^4 / 4."""

    type: ClassVar[str] = "cubic"
    kind: ClassVar[str] = "passive"
    doc: ClassVar[str] = "Passive: f = k1 Delta + k3 Delta^3; energy k1 Delta^2 / 2 + k3 Delta^4 / 4."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.cubic"

    stiffness: float = stiffness_key("k1 at alpha = 1")
    cubic: float = stated(NUMBER, "k3 at alpha = 1; negative: it softens", unit="N/m^3", scales=True, varies=True)
    free_length: float | None = free_length_key()

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks: always."""
        return True
