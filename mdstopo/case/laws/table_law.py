"""A force given over time."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import Table
from mdstopo.case.laws.law import Law, Ranges, side_between
from mdstopo.case.number_rows import Rows
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class TableLaw(Law):
    """f: a table of time with one value a row."""

    type: ClassVar[str] = "table"
    kind: ClassVar[str] = "active"
    doc: ClassVar[str] = "Active: f is a table of time; stores no energy."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.given"

    table: Table = stated(Rows(("t", "f")), "tension over time at alpha = 1", unit="s and N", scales=True)

    @property
    def is_smooth(self) -> bool:
        """Of elongation, rate and time alone, without a kink."""
        return True

    def strength(self, ranges: Ranges) -> float:
        """The largest value."""
        del ranges
        return float(abs(self.table.values).max())

    def side_of_force(self, ranges: Ranges) -> int:
        """The sign of the values; 0 where they have both."""
        del ranges
        return side_between((float(self.table.values.min()), float(self.table.values.max())))
