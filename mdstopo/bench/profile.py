"""`mdstopo bench profile`: where an evaluation of a case with its gradients spends its force sums and its time.

Force sums are counted by the engine (`integrators.steps`). Times are those of whole calls into compiled code; what is
left of an evaluation is Python's. The motion is computed without tangents, too, and one balance (a force sum, with the
solution for accelerations and multipliers) is timed at the ends of the steps: so the motion falls into balances,
tangents, and the rest, which is choosing steps and finding and meeting switches. All times are processor time, so
that other programs on the machine do not count.
"""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any

import numpy as np

from mdstopo.bench.tables import Table, significant
from mdstopo.case.model import Case
from mdstopo.compiler.entry import Entry
from mdstopo.engine import Evaluator
from mdstopo.general.driver.general_driver import GeneralDriver

#: what force sums are for, by the name of their count, beside the stages of the steps
PURPOSES = {
    "sums_of_starts": "start, and behind switches and breakpoints",
    "sums_of_rejected_steps": "steps that were rejected",
    "sums_of_switches": "where within a step a member switches",
    "sums_of_samples": "samples of responses",
    "sums_of_points": "responses inside steps, as at peaks",
}
#: what the compiled calls of an evaluation are for, by their names; others stand by themselves
PHASES = {
    "simulate": "motion",
    "peaks_of_steps": "responses",
    "peaks_of_pieces": "responses",
    "rank_rows": "responses",
    "compare": "responses",
    "sample_responses": "responses",
    "rows_vjp": "reverse sweeps",
    "rows_with_gradients": "responses with their reverse sweeps",
    "integral_with_gradient": "integrals with their reverse sweeps",
}
ROUNDS = 7


class Clock:
    """Seconds spent in each compiled call since `restart`, by its name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._depth = 0

    def restart(self) -> None:
        self.seconds.clear()

    def watched(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """A call whose time is taken; one inside another counts as the outer one's."""

        @wraps(call)
        def timed(*arguments: Any) -> Any:
            began = time.process_time()
            self._depth += 1
            try:
                return call(*arguments)
            finally:
                self._depth -= 1
                if self._depth == 0:
                    self.seconds[name] += time.process_time() - began

        return timed


@contextmanager
def compiled_calls() -> Iterator[Clock]:
    """A clock for all calls into compiled code; those that were prepared before are not seen."""
    clock = Clock()
    call: Callable[..., Any] = Entry.__call__
    prepare: Callable[..., Any] = Entry.prepare

    def timed_call(entry: Entry, *arguments: Any) -> Any:
        return clock.watched(entry.py_func.__name__, call)(entry, *arguments)

    def timed_prepare(entry: Entry, *arguments: Any) -> Callable[..., Any]:
        return clock.watched(entry.py_func.__name__, prepare(entry, *arguments))

    timed: dict[str, Callable[..., Any]] = {"__call__": timed_call, "prepare": timed_prepare}
    try:
        for name, function in timed.items():
            setattr(Entry, name, function)
        yield clock
    finally:
        for name, function in (("__call__", call), ("prepare", prepare)):
            setattr(Entry, name, function)


def profile(case: Case) -> Iterator[Table]:
    """Two tables of a case's initial design: force sums by what they are for, and milliseconds.

    Raises RuntimeError where the evaluation fails.
    """
    with compiled_calls() as clock:
        evaluator = Evaluator(case)
        evaluator.threads = 1  # load cases one after the other: a clock is for one thread
        found = evaluator.evaluate(case.start)
        if not found.status.ok:
            raise RuntimeError(f"{case.name}: {found.status.value} {found.message}".rstrip())
        yield sums_table(case, found.work)
        whole, phases = _timed(clock, lambda: evaluator.evaluate(case.start))
        _, bare = _timed(clock, lambda: evaluator.evaluate(case.start, gradient=False))
        balance, in_motion = _balances(evaluator, case, clock)
    yield _time_table(case, whole, phases, bare.get("motion", 0.0), balance * in_motion)


def sums_table(case: Case, work: Mapping[str, int]) -> Table:
    """Force sums by what they are for, from the counts of an evaluation (`Evaluation.work`)."""
    total, steps = work["force_sums"], max(work["steps"], 1)
    rest = total - sum(work[name] for name in PURPOSES)
    counts = {"stages of steps": rest, **{text: work[name] for name, text in PURPOSES.items()}, "all": total}
    rows = [
        [text, f"{count:,}", significant(count / steps), f"{count / max(total, 1):.0%}"]
        for text, count in counts.items()
    ]
    notes = (f"{work['steps']:,} steps, {work['rejected_steps']:,} rejected, {work['tangents']:,} tangents.",)
    return Table(f"Force sums, {case.name}", ("for", "sums", "a step", "share"), rows, notes)


def _timed(clock: Clock, call: Callable[[], object]) -> tuple[float, dict[str, float]]:
    """Milliseconds of a call, and of its compiled phases: those of the fastest of some rounds."""
    best, phases = np.inf, {}
    for _ in range(ROUNDS):
        clock.restart()
        began = time.process_time()
        call()
        whole = 1e3 * (time.process_time() - began)
        own: dict[str, float] = defaultdict(float)
        for name, seconds in clock.seconds.items():
            own[PHASES.get(name, name)] += 1e3 * seconds
        if whole < best:
            best, phases = whole, dict(own)
    return best, phases


def _balances(evaluator: Evaluator, case: Case, clock: Clock) -> tuple[float, int]:
    """Milliseconds of one balance, and how many the motions of all load cases have; 0, 0 for springs between free
    bodies, whose engine has no balance that can be called by itself."""
    milliseconds, counted, made = 0.0, 0, 0
    for name in evaluator.scenes:
        driver = evaluator.driver(name)
        if not isinstance(driver, GeneralDriver):
            return 0.0, 0
        _, count, _ = driver.run(np.asarray(case.start), False)
        made += int(driver.work[0])
        places = np.column_stack([np.arange(count, dtype=np.float64), np.ones(count)])

        def look(driver: GeneralDriver = driver, places: np.ndarray = places, count: int = count) -> object:
            return driver.sample_response(-1, places, True, count)

        milliseconds += _timed(clock, look)[1].get("responses", 0.0)
        counted += count
    return milliseconds / max(counted, 1), made


def _time_table(case: Case, whole: float, phases: dict[str, float], bare: float, balances: float) -> Table:
    """Milliseconds by phase; bare: of the motion without tangents, balances: of the balances in it."""
    motion = phases.pop("motion", 0.0)
    parts = {"motion: tangents": max(motion - bare, 0.0)}
    if balances > 0.0:
        parts |= {
            "motion: force sums, with solutions for accelerations": min(balances, bare),
            "motion: choosing steps, finding and meeting switches": max(bare - balances, 0.0),
        }
    else:
        parts["motion: all else"] = min(bare, motion)
    parts |= phases
    parts["Python"] = max(whole - motion - sum(phases.values()), 0.0)
    parts["all"] = whole
    rows = [[text, significant(each), f"{each / whole:.0%}"] for text, each in parts.items()]
    notes = (
        f"Processor time of the fastest of {ROUNDS} evaluations with gradient; tangents are for the reverse sweeps.",
    )
    return Table(f"Time, {case.name}", ("part", "ms", "share"), rows, notes)
