"""A fit from start to end: starts, the best of them, its statistics, profiles; each is saved as soon as it is done.

A run goes on from what was saved: starts and profiles that are done are not done again.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mdstopo.case.arrays import FloatArray
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.least_squares import Evaluated, Minimum, StoppedError, fitted, minimum, starts
from mdstopo.fit.profile_likelihood import Profile, profile
from mdstopo.fit.statistics import Statistics, statistics

#: fits whose levels differ by less than this, relative to the number of values, have found the same minimum
SAME_LEVEL = 1e-6


@dataclass(frozen=True)
class Start:
    """A start that has ended.

    begin, x (p,): the estimates at its beginning and its end. deviation (n,): of each measured value. The other fields
    are those of `Minimum`.
    """

    begin: FloatArray
    x: FloatArray
    deviation: FloatArray
    level: float
    status: str
    reason: str
    evaluations: int


@dataclass(frozen=True)
class Tried:
    """One evaluation of a start: the start's number, the estimates x (p,), the root mean square of the misfit in each
    series (S,)."""

    start: int
    x: FloatArray
    root_mean_squares: FloatArray


@dataclass
class FitRun:
    """What is known of a fit so far.

    starts: those that are done. trace: all evaluations of the starts. latest: the last of them. minimum, statistics:
    the best, and its statistics; None where none has a motion, or before all starts are done. profiles: by the name of
    the estimate. status: running | converged | max_iterations | failed | interrupted; reason: in words. simulations:
    motions that were computed. concluded: whether the one at the minimum of these starts is among them.
    """

    problem: FitProblem
    starts: list[Start] = field(default_factory=list)
    trace: list[Tried] = field(default_factory=list)
    latest: Evaluated | None = None
    minimum: Minimum | None = None
    statistics: Statistics | None = None
    profiles: dict[str, Profile] = field(default_factory=dict)
    status: str = "running"
    reason: str = ""
    simulations: int = 0
    concluded: bool = False

    @property
    def shown(self) -> Evaluated | None:
        """The state of the fit that is displayed: the minimum, or before there is one the last evaluation."""
        if self.minimum is None:
            return self.latest
        return Evaluated(self.minimum.x, self.minimum.misfit, self.minimum.deviation)

    @property
    def best(self) -> int:
        """Which start is the best; of equal ones the first."""
        return int(np.argmin([each.level for each in self.starts]))

    @property
    def agreeing(self) -> int:
        """How many starts have found the best minimum."""
        least = min(each.level for each in self.starts)
        return sum(each.level <= least + SAME_LEVEL * self.problem.count for each in self.starts)


def run_fit(
    problem: FitProblem,
    points: int = 0,
    before: FitRun | None = None,
    save: Callable[[FitRun], None] = lambda _: None,
    stop: Callable[[], bool] = lambda: False,
    passing: Callable[[FitRun], None] = lambda _: None,
) -> FitRun:
    """Fit the numbers of a case to measurements.

    problem: what is fitted.
    points: of profiles, on each side of an estimate; 0: none.
    before: what is known from a run that was stopped.
    save: is given what is known when a start or a profile is done, so that it need not be done again.
    stop: whether to end, which is asked before each motion.
    passing: is given what is known after each evaluation of a start.
    """
    run = FitRun(problem) if before is None else before
    counted = problem.simulations  # motions that `run.simulations` has of this problem already
    run.status, run.minimum, run.statistics = "running", None, None
    run.trace = [each for each in run.trace if each.start < len(run.starts)]

    def count() -> None:
        nonlocal counted
        run.simulations += problem.simulations - counted
        counted = problem.simulations

    def keep() -> None:
        count()
        save(run)

    def conclude() -> None:
        nonlocal counted
        count()
        _conclude(run)
        if run.concluded:  # the run that is resumed has counted the motion at this minimum
            counted = problem.simulations
        run.concluded = True

    def seen(evaluated: Evaluated) -> None:
        run.latest = evaluated
        run.trace.append(Tried(len(run.starts), evaluated.x, problem.root_mean_squares(evaluated.misfit)))
        count()
        passing(run)

    try:
        for begin in starts(problem)[len(run.starts) :]:
            end = fitted(problem, begin, stop, seen)
            run.starts.append(Start(begin, end.x, end.deviation, end.level, end.status, end.reason, end.evaluations))
            run.concluded = False
            keep()
        conclude()
        keep()
        for name in _unprofiled(run, points) if points else ():
            _profile(run, name, points, stop)
            keep()
        assert run.starts
        run.status, run.reason = run.starts[run.best].status, run.starts[run.best].reason
    except StoppedError:
        if run.starts and run.minimum is None:
            conclude()
        run.status, run.reason = "interrupted", "stopped on request; what is done is kept"
    count()
    return run


def _conclude(run: FitRun) -> None:
    """The best minimum so far, with everything that is known there."""
    best = run.starts[run.best]
    if best.status == "failed":
        run.latest = None
        return
    problem = run.problem
    at = minimum(problem, best.x, best.deviation, held=np.arange(len(best.x)))
    run.minimum = at
    run.statistics = statistics(problem, at)


def _profile(run: FitRun, name: str, points: int, stop: Callable[[], bool]) -> None:
    assert run.minimum is not None
    assert run.statistics is not None
    problem = run.problem
    run.profiles[name] = profile(problem, run.minimum, run.statistics, problem.names.index(name), points, stop)


def _unprofiled(run: FitRun, points: int) -> list[str]:
    """Estimates that have a profile and do not have one of so many points on each side yet."""
    if run.statistics is None:
        return []
    known = np.isfinite(run.statistics.deviation)
    done = {name for name, each in run.profiles.items() if len(each.values) == 2 * points + 1}
    return [name for name, has in zip(run.problem.names, known, strict=True) if has and name not in done]


def restored(problem: FitProblem, content: Mapping[str, Any]) -> FitRun:
    """What a run that was stopped had done, from what `fit_record.content` made of it."""
    concluded = content["freedom"] is not None
    run = FitRun(problem, simulations=int(content["simulations"] or 0), concluded=concluded)
    for each in content["starts"]:
        level = float("inf") if each["level"] is None else float(each["level"])
        deviation = _deviations(problem, each["deviation"])
        end = each["status"], each["reason"], int(each["evaluations"])
        run.starts.append(Start(np.array(each["begin"]), np.array(each["x"]), deviation, level, *end))
    for each in content["evaluations"]:
        run.trace.append(Tried(int(each["start"]), np.array(each["x"]), np.array(each["root_mean_square"])))
    for each in content["estimates"]:
        if each.get("profile") is not None:
            own = {key: np.array(value, dtype=np.float64) for key, value in each["profile"].items()}
            ends = float(own["low"]), float(own["high"])
            run.profiles[each["name"]] = Profile(own["values"], own["t"], *ends)
    return run


def _deviations(problem: FitProblem, stated: list[float | None]) -> FloatArray:
    """(n,) deviations of values, where those of series that are estimated are given and the others None."""
    pieces = [
        np.full(len(each.t), np.nan if value is None else value) if each.deviation is None else each.deviation
        for each, value in zip(problem.measured, stated, strict=True)
    ]
    return np.concatenate(pieces)
