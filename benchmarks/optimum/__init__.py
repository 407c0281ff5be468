"""Does the optimiser find the optimum, and is its last word true?

`python -m benchmarks optimum` prints all tables with the defaults; `python -m benchmarks.optimum` has options.
"""

from collections.abc import Iterator

from mdstopo.bench.tables import Table

__all__ = ["optimum"]


def optimum() -> Iterator[Table]:
    """All tables."""
    from benchmarks.optimum.tables import everything

    yield from everything()
