"""One number of many values, its slopes, and the rows by which an optimiser sees it.

y (S,) are the values at the points of a sample, worse where larger, with probabilities p of sum 1:

    mean              sum p y
    mean_deviation    m + k s,   m = sum p y,   s^2 = sum p (y - m)^2
    worst             max y
    quantile          the smallest y at or below which at least the share `level` of p lies (an order statistic)

Each y is itself the highest of the peaks that compete at its point, so a measure has kinks where peaks tie, and worst
and quantile also where points do. What competes becomes rows, whose maximum the optimiser lowers (bound formulation):

- `worst`: the peaks of all points.
- `quantile`: the peaks of all points that do not exceed it. The k-th smallest of y is the least, over sets of k
  points, of the set's maximum; so that maximum, over the points that are lowest now, is never below the quantile and
  equals it now. What lowers it lowers the quantile.
- `mean` and `mean_deviation`: the measure with other choices of one peak a point. Of the choices, which are as many as
  products of peaks, those are taken that trade one family of peaks against another: at every point the earliest, the
  latest, the second highest; then a change of one point's peak alone, those of the smallest loss first. The mean rises
  with every y, so none of these rows exceeds it. The mean with deviations falls where a value far on the good side
  rises; rows that exceed it for that reason are left out.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from pkgutil import resolve_name
from typing import cast

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.methods.measures import MEASURES
from mdstopo.case.objects.uncertain import Measure
from mdstopo.evaluation import USUAL, FloatArray, Peak, Rows
from mdstopo.robust.intervals import Estimate, order_statistics, student

#: rows of one measure, at most, where no number of peaks was asked for; of those of a mean, at most
ROWS, MEANS = 16, 8
#: rows of one measure, at most, for each peak that was asked for of one point: at several points other peaks compete
EACH = 4
#: how far below the highest a row may lie, relative to it, where nothing else was asked for: as the engine's peaks
WINDOW = 0.15
#: what rounding leaves of sums of probabilities; of a deviation that is none, relative to the largest value
_ROUNDING, _NONE = 1e-9, 1e-14


class Statistic(ABC):
    """The formula by which a measure follows from values; a record's `made_by` names it, and it has no state.

    In all functions, y (S,) are values, worse where larger, with probabilities p (S,) of sum 1.
    """

    #: whether its rows are peaks of single points
    of_peaks = False

    @abstractmethod
    def value(self, measure: Measure, y: FloatArray, p: FloatArray) -> float:
        """The measure of values y (S,) at points with probabilities p."""

    @abstractmethod
    def slopes(self, measure: Measure, y: FloatArray, p: FloatArray) -> FloatArray:
        """(S,) the derivatives of the measure by the values y at the points."""

    @abstractmethod
    def rows(
        self, measure: Measure, parts: Sequence[Sequence[Peak]], p: FloatArray, sign: float, asked: Rows
    ) -> tuple[Peak, ...]:
        """The rows that stand for the measure in the optimiser; see `rows`."""

    @abstractmethod
    def estimate(self, measure: Measure, y: FloatArray) -> Estimate:
        """Of equally likely independent values y (n,): the measure with its interval of confidence."""


class Mean(Statistic):
    """The mean m = sum p y."""

    def value(self, measure: Measure, y: FloatArray, p: FloatArray) -> float:
        """The measure of values y (S,) at points with probabilities p; see `Statistic.value`."""
        return float((p * y).sum())

    def slopes(self, measure: Measure, y: FloatArray, p: FloatArray) -> FloatArray:
        """(S,) the derivatives of the measure by the values y at the points; see `Statistic.slopes`."""
        return p.copy()

    def rows(
        self, measure: Measure, parts: Sequence[Sequence[Peak]], p: FloatArray, sign: float, asked: Rows
    ) -> tuple[Peak, ...]:
        """The measure with other choices of one peak a point, none above the one with the highest everywhere."""
        if asked != USUAL:  # because of another measure
            parts = [_near(part, sign, WINDOW) for part in parts]
        made = [_row(measure, parts, choice, p, sign) for choice in _choices(parts, p, sign)]
        least = sign * made[0].value - WINDOW * abs(made[0].value)
        most = sign * made[0].value
        others = [row for row in made[1:] if least <= sign * row.value <= most]
        return (made[0], *sorted(others, key=lambda row: -sign * row.value))

    def estimate(self, measure: Measure, y: FloatArray) -> Estimate:
        """The measure with an interval of confidence, by Student's distribution of the influences."""
        value, influences = self.influences(measure, y, float(y.mean()))
        half = student(len(y) - 1) * float(influences.std(ddof=1)) / math.sqrt(len(y))
        return Estimate(value, value - half, value + half)

    def influences(self, measure: Measure, y: FloatArray, mean: float) -> tuple[float, FloatArray]:
        """The estimate of the measure from values, and the influence function of each value (n,): its derivative by
        that value's weight."""
        return mean, y - mean


class MeanAndDeviation(Mean):
    """The mean and k standard deviations: m + k s, with s^2 = sum p (y - m)^2."""

    def value(self, measure: Measure, y: FloatArray, p: FloatArray) -> float:
        """The measure of values y (S,) at points with probabilities p; see `Statistic.value`."""
        mean = super().value(measure, y, p)
        return mean + measure.factor * _deviation(y, p, _apart(y, p))

    def slopes(self, measure: Measure, y: FloatArray, p: FloatArray) -> FloatArray:
        """(S,) the derivatives of the measure by the values y; those of the mean where all values are the same."""
        apart = _apart(y, p)
        deviation = _deviation(y, p, apart)
        if deviation > 0.0:
            return np.asarray(p * (1.0 + measure.factor * apart / deviation))
        return super().slopes(measure, y, p)

    def influences(self, measure: Measure, y: FloatArray, mean: float) -> tuple[float, FloatArray]:
        """The estimate of the measure, and the influence function of each value; see `Mean.influences`."""
        deviation = float(y.std(ddof=1))
        value, influences = mean + measure.factor * deviation, y - mean
        if deviation > 0.0:
            influences = influences + measure.factor * ((y - mean) ** 2 - deviation**2) / (2.0 * deviation)
        return value, influences


class Quantile(Statistic):
    """The smallest y at or below which at least the share `level` of p lies."""

    of_peaks = True

    def value(self, measure: Measure, y: FloatArray, p: FloatArray) -> float:
        """The measure of values y (S,) at points with probabilities p; see `Statistic.value`."""
        return float(y[self.ranked(measure, y, p)[-1]])

    def slopes(self, measure: Measure, y: FloatArray, p: FloatArray) -> FloatArray:
        """(S,) the derivatives of the measure by the values y: 1 at the point whose value it is."""
        found = np.zeros(len(y))
        found[self.ranked(measure, y, p)[-1]] = 1.0
        return found

    def rows(
        self, measure: Measure, parts: Sequence[Sequence[Peak]], p: FloatArray, sign: float, asked: Rows
    ) -> tuple[Peak, ...]:
        """The peaks of the points whose values are no larger than the quantile."""
        y = sign * np.array([part[0].value for part in parts])
        found = [peak for s in np.sort(self.ranked(measure, y, p)).tolist() for peak in parts[s]]
        found.sort(key=lambda peak: -sign * peak.value)
        most = ROWS if asked.most is None else EACH * asked.most
        return tuple(_near(found[:most], sign, WINDOW if asked.window is None else asked.window))

    def estimate(self, measure: Measure, y: FloatArray) -> Estimate:
        """The quantile with an interval of confidence between two order statistics."""
        value = float(y[_ranked(measure.level, y, np.full(len(y), 1.0 / len(y)))[-1]])
        return Estimate(value, *order_statistics(np.sort(y), measure.level))

    def ranked(self, measure: Measure, y: FloatArray, p: FloatArray) -> NDArray[np.intp]:
        """The points that do not exceed it; the last one has its value."""
        return _ranked(measure.level, y, p)


class Worst(Quantile):
    """The largest value. That of a sample is estimated as a quantile of the measure's level."""

    def ranked(self, measure: Measure, y: FloatArray, p: FloatArray) -> NDArray[np.intp]:
        """The points in an order in which the one that decides the measure is last: the first of the worst."""
        return np.roll(np.arange(len(y)), -1 - int(np.argmax(y)))


@cache
def _statistic_of(name: str) -> Statistic:
    """How a measure follows, by its name."""
    return cast(Statistic, resolve_name(MEASURES[name].made_by)())


def statistic(measure: Measure, y: FloatArray, p: FloatArray) -> float:
    """The measure of values y (S,) at points with probabilities p; larger values are worse."""
    return _statistic_of(measure.name).value(measure, y, p)


def slopes(measure: Measure, y: FloatArray, p: FloatArray) -> FloatArray:
    """(S,) the derivatives of a measure by the values y at the points."""
    return _statistic_of(measure.name).slopes(measure, y, p)


def rows(
    measure: Measure, parts: Sequence[Sequence[Peak]], p: FloatArray, sign: float, asked: Rows = USUAL
) -> tuple[Peak, ...]:
    """The rows of a measure, the worst first, which is the measure itself.

    parts: at each point what competes there, worst first. sign: 1 where larger values are worse, else -1. asked: what
    the points were asked for. A row's time is NaN where it is of several points.
    """
    return _statistic_of(measure.name).rows(measure, parts, p, sign, asked)


def is_of_peaks(measure: Measure) -> bool:
    """Whether the rows of a measure are peaks of single points, so that it can have more of them."""
    return not measure.is_sampled or _statistic_of(measure.name).of_peaks


def estimate(measure: Measure, y: FloatArray) -> Estimate:
    """Of equally likely independent values y (n,), worse where larger; the worst as a quantile of its level."""
    return _statistic_of(measure.name).estimate(measure, y)


def _near(peaks: Sequence[Peak], sign: float, window: float) -> list[Peak]:
    """Those of the peaks, worst first, that are at most that far from the first, relative to it."""
    least = sign * peaks[0].value - window * abs(peaks[0].value)
    return [peak for peak in peaks if sign * peak.value >= least]


def _row(
    measure: Measure, parts: Sequence[Sequence[Peak]], choice: tuple[int, ...], p: FloatArray, sign: float
) -> Peak:
    """The measure with one choice of peaks, and its gradient."""
    chosen = [part[j] for part, j in zip(parts, choice, strict=True)]
    y = sign * np.array([peak.value for peak in chosen])
    gradient: FloatArray | None = None
    for slope, peak in zip(slopes(measure, y, p).tolist(), chosen, strict=True):
        if peak.gradient is None:
            gradient = None
            break
        gradient = slope * peak.gradient if gradient is None else gradient + slope * peak.gradient
    if gradient is not None:
        gradient.flags.writeable = False
    return Peak(float("nan"), sign * statistic(measure, y, p), gradient)


def _choices(parts: Sequence[Sequence[Peak]], p: FloatArray, sign: float) -> list[tuple[int, ...]]:
    """Which peak of each point, for each row; the highest everywhere first."""
    highest = (0,) * len(parts)
    found = {highest: None}
    if any(len(part) > 1 for part in parts):
        found[tuple(min(range(len(part)), key=lambda j: part[j].time) for part in parts)] = None
        found[tuple(max(range(len(part)), key=lambda j: part[j].time) for part in parts)] = None
        found[tuple(min(1, len(part) - 1) for part in parts)] = None
        losses = [
            (float(p[s]) * sign * (part[0].value - part[j].value), s, j)
            for s, part in enumerate(parts)
            for j in range(1, len(part))
        ]
        for _, s, j in sorted(losses)[: MEANS - len(found)]:
            found[(*highest[:s], j, *highest[s + 1 :])] = None
    return list(found)


def _apart(y: FloatArray, p: FloatArray) -> FloatArray:
    """(S,) by how much values exceed their mean, with a mean of zero to rounding of these, not of the values: slopes by
    nearly equal values would else not add up to 1."""
    apart = y - (p * y).sum()
    return np.asarray(apart - (p * apart).sum())


def _deviation(y: FloatArray, p: FloatArray, apart: FloatArray) -> float:
    """The standard deviation; exactly 0 where values differ by rounding alone, so that it has no slope."""
    deviation = float(np.sqrt((p * apart**2).sum()))
    return deviation if deviation > _NONE * float(np.abs(y).max()) else 0.0


def _ranked(level: float, y: FloatArray, p: FloatArray) -> NDArray[np.intp]:
    """The points that make up the share `level` from the good end, in order; the last is the quantile's."""
    order = np.argsort(y, kind="stable")
    reached = np.cumsum(p[order]) >= level - _ROUNDING
    count = int(np.argmax(reached)) + 1 if reached.any() else len(y)
    return order[:count]
