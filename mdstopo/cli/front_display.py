"""How a front or a sweep shows that it is going: a live table on a terminal, now and then a line elsewhere."""

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING

from mdstopo.cli.output import duration, number, write

if TYPE_CHECKING:
    from rich.table import Table

    from mdstopo.front.session import Snapshot

_EVERY = 3.0  # seconds between plain lines
_REFRESH = 0.1  # seconds between changes of the table
_ROWS = 25  # points that a table shows at once


class Silent:
    """Says nothing."""

    def __enter__(self) -> "Silent":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def __call__(self, snapshot: "Snapshot") -> None:
        """Nothing."""


class Plain(Silent):
    """A line every few seconds: for logs. What is over before says nothing."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._said_at = clock()

    def __call__(self, snapshot: "Snapshot") -> None:
        """Say it if it is time."""
        now = self._clock()
        if now - self._said_at >= _EVERY:
            self._said_at = now
            write(sys.stderr, line(snapshot))


class Live(Silent):
    """A table that changes in place, drawn with rich, which is imported only here."""

    def __init__(self) -> None:
        self._drawn_at = 0.0

    def __enter__(self) -> "Live":
        from rich.console import Console
        from rich.live import Live as RichLive

        self._live = RichLive(console=Console(stderr=True), auto_refresh=False, transient=True)
        self._live.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.__exit__(kind, error, trace)

    def __call__(self, snapshot: "Snapshot") -> None:
        """Draw it, but not faster than an eye can follow."""
        now = time.perf_counter()
        if now - self._drawn_at >= _REFRESH:
            self._drawn_at = now
            self._live.update(picture(snapshot), refresh=True)


def front_display(quiet: bool) -> Silent:
    """The one that suits where standard error goes."""
    if quiet:
        return Silent()
    return Live() if sys.stderr.isatty() else Plain()


def line(snapshot: "Snapshot") -> str:
    """All of it in a line."""
    total = len(snapshot.directions)
    return (
        f"{len(snapshot.best)} of {total} points have a design, {len(snapshot.running)} are worked on; "
        f"{snapshot.done} solves, {snapshot.evaluations} evaluations, about {duration(snapshot.left)} left"
    )


def picture(snapshot: "Snapshot") -> "Table":
    """Points in rows: what is running first where not all have room."""
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
