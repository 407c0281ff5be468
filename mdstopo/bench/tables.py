"""Tables that read well in a terminal and in Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True)
class Table:
    """One table. columns: headings; rows: text, a cell a column; notes: sentences below it; detail: whether another
    sums it up."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    detail: bool = False

    def markdown(self, level: int = 3) -> str:
        """The table with its title as a heading."""
        widths = [max(len(row[i]) for row in [self.columns, *self.rows]) for i in range(len(self.columns))]

        def line(cells: Sequence[str]) -> str:
            return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"

        rule = "| " + " | ".join("-" * width for width in widths) + " |"
        parts = [f"{'#' * level} {self.title}", "", line(self.columns), rule, *map(line, self.rows)]
        if self.notes:
            parts += ["", " ".join(self.notes)]
        return "\n".join(parts) + "\n"


def verdict(ok: bool) -> str:
    """How a table says whether a bar is met."""
    return "yes" if ok else "NO"


def significant(value: float, digits: int = 3) -> str:
    """A number without exponent where that reads well."""
    if value != 0.0 and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.1e}"
    text = f"{value:#.{digits}g}"
    return text.rstrip(".") if "e" not in text else f"{value:.0f}"


def spread(values: Sequence[float], digits: int = 3) -> str:
    """Median (smallest - largest)."""
    low, high = significant(min(values), digits), significant(max(values), digits)
    return f"{significant(median(values), digits)} ({low} - {high})"
