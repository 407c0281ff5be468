"""A measured curve."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import FloatArray, read_only
from mdstopo.case.keys.number_rows import Rows
from mdstopo.case.laws.law import Law, free_length_key
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class CurveLaw(Law):
    """A force that a curve gives by elongation: monotone cubic (PCHIP) through ``curve`` (n, 2), rows [Delta, f] of
    rising Delta, linear outside."""

    type: ClassVar[str] = "curve"
    kind: ClassVar[str] = "passive"
    doc: ClassVar[str] = (
        "Passive: f follows a monotone cubic (PCHIP) through rows [Delta, f], linear outside them; its integral "
        "from Delta = 0 is the energy."
    )
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.curve"

    curve: FloatArray = stated(Rows(("Delta", "f"), "rising", 2), "rows of rising Delta", unit="m and N", scales=True)
    free_length: float | None = free_length_key()

    def __post_init__(self) -> None:
        object.__setattr__(self, "curve", read_only(self.curve))
