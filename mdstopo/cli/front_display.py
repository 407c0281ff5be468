"""How a front or a sweep shows that it is going: a live table on a terminal, now and then a line elsewhere."""

import math
import sys
from typing import TYPE_CHECKING

from mdstopo.cli import display as displays
from mdstopo.cli.output import duration, number

if TYPE_CHECKING:
    from rich.table import Table

    from mdstopo.front.run_front import Snapshot

_ROWS = 25  # points that a table shows at once
_SOON = 1.0  # seconds below which no guess of the time left is told


class Plain(displays.Plain["Snapshot"]):
    """The progress of a front as a line every few seconds, for logs."""

    def _words(self, snapshot: "Snapshot") -> str:
        return line(snapshot)


class Live(displays.Live["Snapshot"]):
    """The progress of a front as a table that changes in place."""

    def _picture(self, snapshot: "Snapshot") -> "Table":
        return picture(snapshot)


def front_display(quiet: bool) -> "displays.Silent[Snapshot]":
    """The display that suits standard error: a table on a terminal, else lines; none where the user wants quiet."""
    if quiet:
        return displays.Silent()
    return Live() if sys.stderr.isatty() else Plain()


def line(snapshot: "Snapshot") -> str:
    """How far a front has come, in one line."""
    total = len(snapshot.directions)
    at_work = f", {len(snapshot.running)} are worked on" if snapshot.running else ""
    return (
        f"{len(snapshot.best)} of {total} points have a design{at_work}; "
        f"{snapshot.done} solves, {snapshot.evaluations} evaluations, {_left(snapshot.left, snapshot.more)}"
    )


def _left(due: float, more: float) -> str:
    """The time that is left in words: of what is due, and of what may follow it, where anything is known of either."""
    if math.isnan(due):
        return "time left not known"
    words = f"about {duration(due)} left" if due >= _SOON else f"less than {duration(_SOON)} left"
    if math.isnan(more):
        return f"{words} of this round"
    return f"{words} of this round, {duration(more)} where more are needed" if more >= _SOON else words


def picture(snapshot: "Snapshot") -> "Table":
    """The table of a front that is displayed: a row for each point, those being worked on first where not all have
    room."""
    from rich.table import Table

    table = Table(title=line(snapshot), title_justify="left", box=None, padding=(0, 2))
    table.add_column("point", justify="right")
    table.add_column("weights", justify="right")
    for name in snapshot.names:
        table.add_column(name, justify="right")
    table.add_column("")
    total = len(snapshot.directions)
    shown = list(range(total))
    if total > _ROWS:
        running = [j for j in snapshot.running if j < total]
        done = [j for j in shown if j in snapshot.best and j not in running]
        shown = sorted((running + done[::-1])[:_ROWS])
    for j in shown:
        found = snapshot.best.get(j)
        values = ["" for _ in snapshot.names] if found is None else [number(v) for v in found.objectives]
        word = "running" if j in snapshot.running else ("" if found is None else found.status.value.replace("_", " "))
        weights = ", ".join(number(weight, 4) for weight in snapshot.directions[j])
        table.add_row(str(j), weights, *values, word, style="" if found is not None else "dim")
    return table
