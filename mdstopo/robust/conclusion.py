"""What became of an uncertain case: nominal and robust values of the final design, and what a fresh sample says."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mdstopo.case.model import Case, Objective, ReducedResponse, ResponseRow
from mdstopo.case.objects.uncertain import Measure
from mdstopo.case.responses.response_units import constrained
from mdstopo.design_problem import sign_of
from mdstopo.evaluation import Evaluation, FloatArray
from mdstopo.robust.ensemble import NOMINAL, Ensemble
from mdstopo.robust.intervals import ROUNDING, Estimate
from mdstopo.robust.points_in_workers import PointWorkers
from mdstopo.robust.robust_measures import estimate
from mdstopo.robust.sample import Sample, check_sample
from mdstopo.robust.trial import Trial, tried
from mdstopo.store.contents import Datasets


@dataclass(frozen=True)
class Robust:
    """One objective, or one bounded response, of the final design.

    name: of the objective, or `constraints[i]`. measure: in words. nominal: the value of the case as it is written.
    value: the measure over the design's sample. check: the measure over the fresh sample, None without one. worse:
    share of that sample which is worse than `value` by more than the rounding of sums, 1e-12 of it. kept: share of it
    that keeps the constraint; None for objectives. sign: 1 where larger is worse, else -1.
    """

    name: str
    measure: str
    nominal: float
    value: float
    check: Estimate | None
    worse: float | None
    kept: float | None
    sign: float = 1.0

    @property
    def is_fitted(self) -> bool:
        """Whether the value is better than the whole interval: then the design fits its own sample."""
        if self.check is None or self.agrees:
            return False
        return (self.value < self.check.low) == (self.sign > 0.0)

    @property
    def agrees(self) -> bool | None:
        """Whether the value is within the interval of the fresh sample's; None without one."""
        return None if self.check is None else self.check.holds(self.value)


@dataclass(frozen=True)
class Conclusion:
    """The results of the final design on samples, by objective, then by bounded response.

    points: of the fresh sample; lost: those of it that could not be computed.
    """

    results: tuple[Robust, ...]
    points: int
    lost: int
    part: Datasets
    warnings: tuple[str, ...]

    def of(self, name: str) -> Robust | None:
        """The result of an objective or a constraint; None where there is none."""
        return next((each for each in self.results if each.name == name), None)


def conclude(engine: Ensemble, alpha: FloatArray, found: Evaluation, workers: PointWorkers | None) -> Conclusion:
    """Try the final design alpha (N,), which `found` evaluated, on the nominal case, every point and a fresh sample."""
    case, sample = engine.case, engine.sample
    places = range(len(sample))
    at_points = engine.results_at_points(alpha)
    rows = {i: row for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)}
    objectives = np.array([[at_points[i].peaks[each.name][0].value for each in case.objectives] for i in places])
    responses = _responses(case, found, [{j: at_points[i].limits[j][0].value for j in rows} for i in places])
    nominal = engine.points[NOMINAL].evaluate(alpha, gradient=False)
    fresh = check_sample(engine.uncertainty)
    trials = [] if fresh is None else _trials(case, fresh, alpha, workers)
    usable = [trial for trial in trials if not trial.reason]
    lost = len(trials) - len(usable)
    warnings: tuple[str, ...] = ()
    if not nominal.status.usable:
        warnings = (f"the nominal case cannot be computed: {nominal.status.value} {nominal.message}".rstrip(),)
    if lost:
        reason = next(trial.reason for trial in trials if trial.reason)
        warnings += (f"{lost} of {len(trials)} points of the fresh sample cannot be computed: {reason}",)
    enough = len(usable) > 1
    results = []
    for j, objective in enumerate(case.objectives):
        measure = engine.uncertainty.objectives[objective.name]
        values = np.array([trial.objectives[j] for trial in usable])
        results.append(
            _robust(
                objective.name,
                objective,
                measure,
                nominal=nominal.objectives[objective.name],
                value=found.objectives[objective.name],
                values=objectives[:, j],
                fresh=values if enough else None,
                sample=sample,
            )
        )
    for i, row in rows.items():
        values = np.array([trial.responses[i] for trial in usable]) + row.bound
        measure, here = engine.uncertainty.constraints[i], responses[:, i] + row.bound
        results.append(
            _robust(
                f"constraints[{i}]",
                row,
                measure,
                nominal=float(nominal.constraints[i]) + row.bound,
                value=float(found.constraints[i]) + row.bound,
                values=here,
                fresh=values if enough else None,
                sample=sample,
                tolerance=case.optimizer.tolerance * (abs(row.bound) or 1.0),
            )
        )
    warnings += tuple(_fitted(case, each) for each in results if each.is_fitted)
    part = _part(case, sample, objectives, responses, results)
    if fresh is not None:
        part |= _check_part(case, fresh, trials, results)
    return Conclusion(tuple(results), len(trials), lost, part, warnings)


def _trials(case: Case, fresh: Sample, alpha: FloatArray, workers: PointWorkers | None) -> list[Trial]:
    if workers is not None:
        return workers.trials(case, fresh, alpha)
    return [tried(case, fresh, i, alpha) for i in range(len(fresh))]


def _robust(
    name: str,
    of: ReducedResponse,
    measure: Measure,
    *,
    nominal: float,
    value: float,
    values: FloatArray,
    fresh: FloatArray | None,
    sample: Sample,
    tolerance: float = 0.0,
) -> Robust:
    """What an objective or a constraint comes to over the sample, and what a fresh sample says of that.

    name: the result's.
    of: the objective or the constraint.
    measure: what is taken of the sample.
    nominal: the value of the case as it is written.
    value: the measure over the design's sample.
    values (S,): at the points of that sample.
    fresh (V,): at the points of the fresh one; None where there are not enough.
    sample: the design's.
    tolerance: by how much a constraint may be missed and counts as kept, as for the optimiser.
    """
    sign = sign_of(of) if isinstance(of, Objective) else (-1.0 if of.sense == "at_least" else 1.0)
    if fresh is None or not measure.is_sampled:
        return Robust(name, measure.words, nominal, value, None, None, None, sign)
    level = measure.level if "level" in measure.kind.keys else _level_of_worst(sign * values, sample)
    found = estimate(replace(measure, level=level), sign * fresh)
    low, high = (found.low, found.high) if sign > 0.0 else (-found.high, -found.low)
    kept = None
    if isinstance(of, ResponseRow) and of.sense != "equals":
        kept = float(np.mean(sign * fresh <= sign * of.bound + tolerance))
    worse = float(np.mean(sign * fresh > sign * value + ROUNDING * abs(value)))
    return Robust(name, measure.words, nominal, value, Estimate(sign * found.value, low, high), worse, kept, sign)


def told(case: Case | None, name: str) -> str:
    """What a result is called in words: an objective by its name, `constraints[i]` with what it bounds.

    Without the case a constraint is told by its place alone.
    """
    place = None if case is None else re.fullmatch(r"constraints\[(\d+)\]", name)
    if case is None or place is None:
        return name
    return f"{name} ({constrained(case, case.constraints[int(place[1])])})"


def _fitted(case: Case, found: Robust) -> str:
    assert found.check is not None
    interval = f"{found.check.low:.6g} to {found.check.high:.6g}"
    return (
        f"{told(case, found.name)} is {found.value:.6g} over its own sample, better than the interval {interval} "
        "of the fresh one: the design fits its sample; take a larger uncertainty.sample"
    )


def _level_of_worst(y: FloatArray, sample: Sample) -> float:
    """The level of the quantile that the worst of the sample is: of its points, or of those of its scenario."""
    scenario = sample.scenario == sample.scenario[int(np.argmax(y))]
    return 1.0 - float(sample.probability[scenario].sum()) / (int(scenario.sum()) + 1)


def _responses(case: Case, found: Evaluation, limits: Sequence[Mapping[int, float]]) -> FloatArray:
    """(S, n_con): values less bounds at each point; volume rows are the same everywhere."""
    responses = np.tile(found.constraints, (len(limits), 1))
    for i, each in enumerate(limits):
        for j, value in each.items():
            responses[i, j] = value - case.constraints[j].bound
    return responses


def _part(
    case: Case,
    sample: Sample,
    objectives: FloatArray,
    responses: FloatArray,
    results: Sequence[Robust],
) -> Datasets:
    assert case.uncertainty is not None
    return {
        "uncertainty/keys": [number.key for number in case.uncertainty.numbers],
        "uncertainty/sample": sample.values,
        "uncertainty/probability": sample.probability,
        "uncertainty/scenario": _scenarios(case, sample),
        "uncertainty/objectives": objectives,
        "uncertainty/constraints": responses,
        "uncertainty/measures": [each.measure for each in results],
        "uncertainty/results": [each.name for each in results],
        "uncertainty/nominal": np.array([each.nominal for each in results]),
        "uncertainty/robust": np.array([each.value for each in results]),
    }


def _check_part(case: Case, fresh: Sample, trials: Sequence[Trial], results: Sequence[Robust]) -> Datasets:
    nothing = float("nan")
    checks = [each.check or Estimate(nothing, nothing, nothing) for each in results]
    return {
        "uncertainty/validation/sample": fresh.values,
        "uncertainty/validation/scenario": _scenarios(case, fresh),
        "uncertainty/validation/objectives": np.array([trial.objectives for trial in trials]),
        "uncertainty/validation/constraints": np.array([trial.responses for trial in trials]),
        "uncertainty/validation/measured": np.array([each.value for each in checks]),
        "uncertainty/validation/interval": np.array([[each.low, each.high] for each in checks]),
        "uncertainty/validation/worse": np.array([nothing if r.worse is None else r.worse for r in results]),
        "uncertainty/validation/kept": np.array([nothing if r.kept is None else r.kept for r in results]),
    }


def _scenarios(case: Case, sample: Sample) -> list[str]:
    assert case.uncertainty is not None
    names = [scenario.name for scenario in case.uncertainty.scenarios]
    return [names[place] if place >= 0 else "" for place in sample.scenario.tolist()]
