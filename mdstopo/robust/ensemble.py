"""Many variants of a case evaluated as one: an `Evaluator` whose objectives are measures over a sample.

Motions, frequencies and what else belongs to one scene are those of the nominal case.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.model import Case, ReducedResponse, ResponseRow
from mdstopo.case.objects.uncertain import Measure
from mdstopo.design_problem import competes, sign_of
from mdstopo.engine import Evaluator
from mdstopo.evaluation import USUAL, ErrorEstimate, Evaluation, FloatArray, Peak, Rows
from mdstopo.integrators.steps import WORK_NAMES
from mdstopo.robust.robust_measures import is_of_peaks, rows, slopes
from mdstopo.robust.sample import Sample, design_sample
from mdstopo.robust.sampled_case import evaluator_at, name_of, nominal_evaluator
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.robust.points_in_workers import PointWorkers

#: the nominal case's place among the points
NOMINAL = -1
#: numbers in the gradients of all peaks of one objective at all points, at most, where more peaks are asked for
ROOM_FOR_GRADIENTS = 20_000_000
#: where there is not room for so many peaks of a point, it is asked for its usual ones
FEWEST_PEAKS = 8


@dataclass(frozen=True)
class PointResult:
    """The results at one point: what competes, by objective and by constraint's place; how it ended; the work done."""

    peaks: Mapping[str, tuple[Peak, ...]]
    limits: Mapping[int, tuple[Peak, ...]]
    status: Status
    message: str
    work: Mapping[str, int]


class Ensemble(Evaluator):
    """An uncertain case, compiled at all points of its sample, whose designs can be evaluated again and again.

    points: evaluators of those points of the sample that this process computes, and of the nominal case, by place.
    Raises CaseError where the case at a point is none, with the point and its values.
    """

    def __init__(
        self,
        case: Case,
        in_background: bool = True,
        points: dict[int, Evaluator] | None = None,
        workers: "PointWorkers | None" = None,
        share: Sequence[str] = (),
    ) -> None:
        assert case.uncertainty is not None
        super().__init__(case, in_background, share)
        self.uncertainty = case.uncertainty
        self.sample: Sample = design_sample(case.uncertainty)
        self.workers = workers
        self._bounds_here = [row.bound for row in case.constraints]
        measures = [self.uncertainty.objectives[name] for name in self._names]
        measures += [self.uncertainty.constraints[i] for i in self._limits]
        self._nominal_too = any(not measure.is_sampled for measure in measures)
        self._of_peaks = any(map(is_of_peaks, measures))
        #: what the last evaluation asked its points for
        self._asked = USUAL
        self._wanted = range(len(self.sample)) if any(measure.is_sampled for measure in measures) else range(0)
        if points is None:
            points = {i: evaluator_at(case, self.sample, i) for i in range(len(self.sample))}
            points[NOMINAL] = nominal_evaluator(case, in_background=False)
        self.points = points

    # -- what a run asks

    def evaluate(
        self, alpha: FloatArray, gradient: bool = True, sensitivity: str | None = None, rows: Rows = USUAL
    ) -> Evaluation:
        """The measures of all objectives and constraints at a design alpha (N,), and on demand their gradients.

        A point that cannot be computed fails the evaluation; the message names it and its values. Rows of a measure are
        what it makes of the rows of the points, of which none is a norm: rows by themselves would do where one motion
        has norms.
        """
        design = self._design.take(alpha)
        wanted = [*([NOMINAL] if self._nominal_too else []), *self._wanted]
        self._asked = self._of_each(rows)
        results = self._results(wanted, design, gradient, sensitivity, self._asked)
        status, message = self._verdict_of(results)
        counts = {name: sum(result.work[name] for result in results.values()) for name in WORK_NAMES}
        all_peaks: dict[str, tuple[Peak, ...]] = {}
        if status.usable or status is Status.NO_GRADIENT:
            all_peaks = self._measured_peaks(results)
        found = self._evaluation(all_peaks, gradient and status.usable, counts, status, message)
        return found._replace(all_compete=True)

    def _of_each(self, rows: Rows) -> Rows:
        """The rows that each point is asked for: those that its measures can use and memory has room for."""
        if rows.most is None or not self._of_peaks:
            return USUAL
        room = ROOM_FOR_GRADIENTS // (len(self.points) * max(self.case.space.length, 1))
        return Rows(rows.window, min(rows.most, room)) if room >= FEWEST_PEAKS else USUAL

    def with_errors(self, alpha: FloatArray, found: Evaluation, sensitivity: str | None = None) -> Evaluation:
        """What `evaluate` found, and estimates of its errors: those of the points, weighted as the measure does.

        A gradient's error leaves out that the weights of a deviation change with the values.
        """
        design = self.design(alpha)
        values: dict[str, list[float]] = {name: [] for name in self._names}
        errors: dict[str, list[ErrorEstimate]] = {name: [] for name in self._names}
        nominal: Mapping[str, ErrorEstimate] = {}
        for i, point in sorted(self.points.items()):
            each = point.with_errors(design, point.evaluate(design, bool(found.gradients), sensitivity), sensitivity)
            if not each.errors:
                return found._replace(errors={})
            if i == NOMINAL:
                nominal = each.errors
                continue
            for name in self._names:
                values[name].append(each.objectives[name])
                errors[name].append(each.errors[name])
        return found._replace(errors={n: self._error(n, values[n], errors[n], nominal[n]) for n in self._names})

    def _error(
        self, name: str, values: Sequence[float], errors: Sequence[ErrorEstimate], nominal: ErrorEstimate
    ) -> ErrorEstimate:
        measure = self.uncertainty.objectives[name]
        if not measure.is_sampled:
            return nominal
        sign = next(sign_of(each) for each in self.case.objectives if each.name == name)
        weights = np.abs(slopes(measure, sign * np.array(values), self.sample.probability))
        return ErrorEstimate(
            float(weights @ np.array([each.value for each in errors])),
            float(weights @ np.array([each.gradient for each in errors])),
        )

    def otherwise(self, sample: int = 0, **solver: Any) -> "Ensemble":
        """See `Evaluator.otherwise`; every point has the settings, and is rounded otherwise as that sample says."""
        key = (sample, *sorted(solver.items()))
        if key not in self._others:
            case = replace(self.case, solver=replace(self.case.solver, **solver))
            points = {i: point.otherwise(sample, **solver) for i, point in self.points.items()}
            self._others[key] = Ensemble(case, self._compiles_in_background, points)
        found = self._others[key]
        assert isinstance(found, Ensemble)
        return found

    def with_objectives(self, objectives: Sequence[str]) -> "Ensemble":
        """An evaluator of some of the objectives alone; see `Evaluator.with_objectives`."""
        names = tuple(objectives)
        if names == self._names:
            return self
        if names not in self._narrower:
            chosen = tuple(objective for objective in self.case.objectives if objective.name in names)
            points = {i: point.with_objectives(names) for i, point in self.points.items()}
            self._narrower[names] = Ensemble(replace(self.case, objectives=chosen), False, points, self.workers)
        found = self._narrower[names]
        assert isinstance(found, Ensemble)
        return found

    @property
    def held(self) -> int:
        """How many bytes of steps are kept between calls."""
        return super().held + sum(point.held for point in self.points.values())

    def pricing_states(self, weights: Mapping[str, Sequence[float]]) -> Any:
        """See `Evaluator.pricing_states`; every point is evaluated once more in this process."""
        wanted = [*([NOMINAL] if self._nominal_too else []), *self._wanted]
        design = self._design.values.copy()
        results = {i: self.result_at(i, design, True, None, self._asked) for i in wanted}
        counts = {(i, *place): len(peaks) for i, result in results.items() for place, peaks in _places(result)}
        unit = iter(np.eye(sum(counts.values())))
        # the same results with one number a peak in the place of its gradient: how a measure is made of them
        marked = {i: _marked(result, unit) for i, result in results.items()}
        all_peaks = self._measured_peaks(marked)
        shares = np.zeros(sum(counts.values()))
        for key, factors in weights.items():
            for factor, peak in zip(factors, all_peaks[key], strict=False):
                assert peak.gradient is not None
                shares += factor * peak.gradient
        states = []
        pieces = iter(np.split(shares, np.cumsum(list(counts.values()))[:-1]))
        for i, result in results.items():
            own = {_key(place): next(pieces).tolist() for place, _ in _places(result)}
            states.append(self.points[i].pricing_states(own))
        return type(states[0]).of_all(states)

    # -- points

    def spread(self, workers: "PointWorkers | None") -> None:
        """Let other processes compute most of the points from now on; None: this process alone."""
        self.workers = workers
        self._narrower.clear()

    def results_at_points(self, alpha: FloatArray) -> dict[int, PointResult]:
        """What every point of the sample gives for a design alpha (N,), without gradients."""
        return self._results(range(len(self.sample)), self.design(alpha), False, None, USUAL)

    @property
    def kinds(self) -> list[Case]:
        """Cases at points that need other kernels than the nominal one, one of each kind."""
        found = {bool(point.beyond): point.case for point in self.points.values()}
        return [case for beyond, case in found.items() if beyond != bool(self.beyond)]

    def result_at(self, i: int, design: FloatArray, gradient: bool, sensitivity: str | None, rows: Rows) -> PointResult:
        """The result at point i for a design, NOMINAL: of the nominal case, with so many rows.

        gradient, sensitivity: whether there are to be gradients, and by which method; None: the case's.
        """
        point = self.points[i]
        found = point.evaluate(design, gradient, sensitivity, rows)
        limits = dict(found.constraint_peaks)
        for place in limits:  # where the bound itself is uncertain, what counts is the distance to it
            shift = point.case.constraints[place].bound - self._bounds_here[place]
            if shift != 0.0:
                limits[place] = tuple(peak._replace(value=peak.value - shift) for peak in limits[place])
        return PointResult(found.peaks, limits, found.status, found.message, found.work)

    def _results(
        self, wanted: Sequence[int], design: FloatArray, gradient: bool, sensitivity: str | None, rows: Rows
    ) -> dict[int, PointResult]:
        if self.workers is None:
            return {i: self.result_at(i, design, gradient, sensitivity, rows) for i in wanted}
        return self.workers.results(self, wanted, design, gradient, sensitivity, rows)

    def _verdict_of(self, results: Mapping[int, PointResult]) -> tuple[Status, str]:
        """How the points ended as one: as the first that is not usable, else the first whose gradient is one-sided."""
        wrong = [i for i in sorted(results) if not results[i].status.usable]
        wrong += [i for i in sorted(results) if not results[i].status.ok]
        if not wrong:
            return Status.OK, next((result.message for result in results.values() if result.message), "")
        (i, *_), first = wrong, results[wrong[0]]
        where = "in the nominal case" if i == NOMINAL else name_of(self.case, self.sample, i)
        return first.status, f"{first.message}, {where}" if first.message else where

    def _measured_peaks(self, results: Mapping[int, PointResult]) -> dict[str, tuple[Peak, ...]]:
        """The rows of each measure."""
        all_peaks = {}
        for objective in self.case.objectives:
            found = {i: result.peaks[objective.name] for i, result in results.items()}
            measure = self.uncertainty.objectives[objective.name]
            all_peaks[objective.name] = self._measured(objective, measure, found, sign_of(objective))
        for place in self._limits:
            row = self.case.constraints[place]
            assert isinstance(row, ResponseRow)
            found = {i: result.limits[place] for i, result in results.items()}
            measure = self.uncertainty.constraints[place]
            sign = -1.0 if row.sense == "at_least" else 1.0
            made = self._measured(row, measure, found, sign)
            # an equality has one row for each of its sides, so that no others may stand in for it
            all_peaks[f"constraints[{place}]"] = made[:1] if row.sense == "equals" else made
        return all_peaks

    def _measured(
        self, of: ReducedResponse, measure: Measure, found: Mapping[int, tuple[Peak, ...]], sign: float
    ) -> tuple[Peak, ...]:
        # what bounds a value from the good side is no row: the value itself stands for it
        own = {i: peaks if competes(of, sign) else peaks[:1] for i, peaks in found.items()}
        if not measure.is_sampled:
            return own[NOMINAL]
        return rows(measure, [own[i] for i in self._wanted], self.sample.probability, sign, self._asked)

    @property
    def _limits(self) -> list[int]:
        return [i for i, row in enumerate(self.case.constraints) if isinstance(row, ResponseRow)]


#: an objective by its name, or a constraint by its place
Place = tuple[str, int]


def _places(result: PointResult) -> list[tuple[Place, tuple[Peak, ...]]]:
    """The peaks of a result: of objectives, then of constraints."""
    objectives = [((name, -1), peaks) for name, peaks in result.peaks.items()]
    return objectives + [(("", place), peaks) for place, peaks in result.limits.items()]


def _key(place: Place) -> str:
    """An objective's name, or a constraint's key path."""
    name, number = place
    return name or f"constraints[{number}]"


def _marked(result: PointResult, unit: Iterator[FloatArray]) -> PointResult:
    """The same result with the next unit vectors in the places of its gradients."""
    found = [tuple(Peak(peak.time, peak.value, next(unit)) for peak in peaks) for _, peaks in _places(result)]
    names = len(result.peaks)
    return replace(
        result,
        peaks=dict(zip(result.peaks, found[:names], strict=True)),
        limits=dict(zip(result.limits, found[names:], strict=True)),
    )
