"""How a run shows that it is going: a live line on a terminal, now and then a plain one elsewhere."""

import math
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from mdstopo.cli import display as displays
from mdstopo.cli.output import duration, number

if TYPE_CHECKING:
    from rich.table import Table

    from mdstopo.session.outcome import Progress

Silent = displays.Silent


def display(quiet: bool) -> "displays.Silent[Progress]":
    """The display that suits standard error: a line that changes on a terminal, else lines; none with --quiet."""
    if quiet:
        return Silent()
    return Live() if sys.stderr.isatty() else Plain()


class Rate:
    """Iterations a second and the time left, of the start that is going."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        self._clock = clock
        self._began: float | None = None
        self._count = 0

    def add(self) -> None:
        """One more iteration; the clock runs from the first, so that getting ready does not count."""
        if self._began is None:
            self._began = self._clock()
        else:
            self._count += 1

    def words(self, progress: "Progress") -> str:
        """Rate and the time that all iterations would take which may still come."""
        elapsed = 0.0 if self._began is None else self._clock() - self._began
        if not self._count or elapsed <= 0.0:
            return "rate not known yet"
        rate = self._count / elapsed
        left = progress.max_iterations - progress.iteration
        left += (progress.starts - 1 - progress.start) * progress.max_iterations
        if left <= 0:
            return f"{number(rate, 3)}/s, the last iteration"
        return f"{number(rate, 3)}/s, at most {duration(left / rate)} left"


def line(progress: "Progress") -> str:
    """One iteration of the optimiser in words."""
    start = f"start {progress.start + 1}/{progress.starts}, " if progress.starts > 1 else ""
    return (
        f"{start}iteration {progress.iteration}/{progress.max_iterations}: "
        f"objective {_objective(progress)}{_why(progress)}, best {number(progress.best, 7)}, "
        f"constraint {number(progress.violation, 3)}, change {number(progress.change, 3)}"
    )


def _objective(progress: "Progress") -> str:
    """The value of the iterate, or that it has none."""
    return "none (failed)" if math.isnan(progress.objective) else number(progress.objective, 7)


def _why(progress: "Progress") -> str:
    """Why the iterate has no value, where that is known; for lines, as a table has no room for it."""
    return f": {progress.failure}" if progress.failure else ""


class Plain(displays.Plain["Progress"]):
    """The progress of a run as a line every few seconds, for logs."""

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        super().__init__(clock)
        self._rate = Rate(clock)

    def __call__(self, progress: "Progress") -> None:
        """Count it, and say it if it is time."""
        self._rate.add()
        super().__call__(progress)

    def _words(self, progress: "Progress") -> str:
        return f"{line(progress)}, {self._rate.words(progress)}"


class Live(displays.Live["Progress"]):
    """The progress of a run as a line that changes in place."""

    def __init__(self) -> None:
        super().__init__()
        self._rate = Rate()

    def __call__(self, progress: "Progress") -> None:
        """Count an iteration, and draw how far the run is if enough time has passed."""
        self._rate.add()
        super().__call__(progress)

    def _picture(self, progress: "Progress") -> "Table":
        from rich.progress_bar import ProgressBar
        from rich.table import Table

        total = progress.starts * progress.max_iterations
        done = progress.start * progress.max_iterations + progress.iteration
        grid = Table.grid(padding=(0, 2))
        names = ["iteration", "objective", "best", "constraint", "change", ""]
        values = [
            f"{progress.iteration}/{progress.max_iterations}",
            _objective(progress),
            number(progress.best, 7),
            number(progress.violation, 3),
            number(progress.change, 3),
            self._rate.words(progress),
        ]
        if progress.starts > 1:
            names.insert(0, "start")
            values.insert(0, f"{progress.start + 1}/{progress.starts}")
        grid.add_row(*(f"[dim]{name}[/dim]" for name in names))
        grid.add_row(*values)
        whole = Table.grid()
        whole.add_row(ProgressBar(total=max(total, 1), completed=done, width=60))
        whole.add_row(grid)
        return whole
