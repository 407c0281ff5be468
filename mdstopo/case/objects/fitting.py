"""What is fitted to measurements: numbers of the case, and the series that were measured."""

from __future__ import annotations

from mdstopo.case.methods.losses import DEFAULT_LOSS
from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.value import Value, frozen

#: a column of a file: its name in the header line, or its place from 0
Column = str | int


@frozen
class Estimate(Value):
    """A number that is estimated, between two bounds; where both are equal it is known."""

    initial: float
    lower: float
    upper: float

    @property
    def is_free(self) -> bool:
        """Whether the number is estimated: whether its bounds differ."""
        return self.lower < self.upper


@frozen
class FitNumber(Value):
    """A number of the case by its key path as messages write it, and what it may be, in its SI unit."""

    key: str
    range: Estimate


@frozen
class Series(Value):
    """Values measured over time, and what of the motion they are.

    file: path as written; time, value: its columns; time_scale, value_scale: what these are multiplied by. deviation:
    standard deviation of a value: a number in the response's unit, the name of a column (scaled as the values are), or
    None where it is not known. offset (the response's unit): what is measured too much; delay (s): how much later
    something is recorded than it happens. begin, end (s): only what was recorded between these counts, None where there
    is no limit.
    """

    name: str
    response: Response
    load_case: str
    file: str
    time: Column = 0
    value: Column = 1
    deviation: float | str | None = None
    time_scale: float = 1.0
    value_scale: float = 1.0
    offset: Estimate = Estimate(0.0, 0.0, 0.0)
    delay: Estimate = Estimate(0.0, 0.0, 0.0)
    begin: float | None = None
    end: float | None = None


@frozen
class Fit(Value):
    """The section `fit`.

    loss: how residuals count, the name of a record of `methods.losses`. starts: how many, the further ones random by
    `seed`. confidence: that of the intervals.
    """

    numbers: tuple[FitNumber, ...]
    series: tuple[Series, ...]
    loss: str = DEFAULT_LOSS
    starts: int = 1
    seed: int = 0
    confidence: float = 0.95
