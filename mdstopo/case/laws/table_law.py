"""A force given over time."""

from __future__ import annotations

from typing import ClassVar

from mdstopo.case.arrays import Table
from mdstopo.case.keys.number_rows import Rows
from mdstopo.case.laws.law import Law, Ranges, side_between
from mdstopo.case.value import frozen, stated


@frozen(kw_only=True)
class TableLaw(Law):
    """A force that a table gives over time, with one value a row."""

    type: ClassVar[str] = "table"
    kind: ClassVar[str] = "active"
    doc: ClassVar[str] = "Active: f is a table of time; stores no energy."
    kernels: ClassVar[str] = "mdstopo.mechanics.laws.given"

    table: Table = stated(Rows(("t", "f")), "tension over time at alpha = 1", unit="s and N", scales=True)

    @property
    def is_smooth(self) -> bool:
        """Whether its force has no kinks: those of the table are in time, not in the elongation."""
        return True

    def strength(self, ranges: Ranges) -> float:
        """The largest force at alpha = 1 (N): the largest magnitude in the table."""
        del ranges
        return float(abs(self.table.values).max())

    def side_of_force(self, ranges: Ranges) -> int:
        """1 where all values are positive and it only pulls, -1 where it only pushes; 0 where there are both."""
        del ranges
        return side_between((float(self.table.values.min()), float(self.table.values.max())))
