"""A run of the optimiser, judged: its value, what it took, its last word, and whether that is true."""

import re
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.optimum.kkt import residual, rows_of
from benchmarks.optimum.measure import excess, value_of
from benchmarks.optimum.problems import Problem
from mdstopo import Case, Result, optimize
from mdstopo.evaluation import Rows
from mdstopo.evaluators import evaluator_of
from mdstopo.status import RunStatus

Floats = NDArray[np.float64]

#: relative excess over a limit up to which a design keeps it; how often the tolerance a true residual may be
KEPT, RESIDUAL = 1e-5, 10.0
#: excess over the exact value, and of the least violation, that counts as reached
REACHED, LEAST = 1e-3, 1e-2
#: what a message says that calls a problem infeasible
INFEASIBLE = re.compile(
    r"no design (near this one |(is|was) found that )?keeps|infeasible|least (violation|excess)", re.IGNORECASE
)


@dataclass(frozen=True)
class Run:
    """A run, judged.

    value, excess: of its last word's design; reached: evaluations until the first design that keeps the limits within
    0.1 % of the reference, or, where they cannot be kept, violates them 1 % more than the least; None where none did.
    kkt: the residual recomputed. untrue: why the last word is not true, empty where it is.
    """

    problem: str
    start: str
    iterations: int
    value: float
    excess: float
    evaluations: int
    reached: int | None
    status: str
    reason: str
    kkt: float
    stated: float
    untrue: str
    seconds: float
    alpha: Floats
    visited: tuple[tuple[int, float, float], ...]

    @property
    def keeps(self) -> bool:
        """Whether the design keeps the limits."""
        return self.excess <= KEPT


def run(problem: Problem, start: str, iterations: int, best: float | None = None) -> Run:
    """Run one problem from one of its starts. best: what is known of a dynamic problem's optimum."""
    case = problem.case(max_iterations=iterations)
    began = time.perf_counter()
    result = optimize(case, initial=problem.starts()[start])
    seconds = time.perf_counter() - began
    return judged(problem, start, iterations, case, result, seconds, best)


def judged(
    problem: Problem, start: str, iterations: int, case: Case, result: Result, seconds: float, best: float | None = None
) -> Run:
    """What is to be said of a result."""
    visited = tuple(visits(case, result))
    value, over = value_of(case, result.objectives), excess(case, result.constraints)
    state = result.states[result.best_start]
    assert state is not None
    design = np.asarray(case.space.expand(state.best_alpha))
    found = Run(
        problem=problem.name,
        start=start,
        iterations=iterations,
        value=value,
        excess=over,
        evaluations=result.evaluations,
        reached=_reached(problem, visited, best),
        status=str(result.status),
        reason=result.reason,
        kkt=kkt_of(case, design, problem.kind == "convex"),
        stated=float(state.kkt),
        untrue="",
        seconds=seconds,
        alpha=design,
        visited=visited,
    )
    return Run(**{**vars(found), "untrue": untrue(problem, found, case.optimizer.tolerance, best)})


def visits(case: Case, result: Result) -> list[tuple[int, float, float]]:
    """Evaluations so far, value and excess of every design that a run evaluated, in order."""
    history = result.history
    names = [each.name for each in case.objectives]
    columns = zip(
        np.asarray(history["evaluations"]), np.asarray(history["objectives"]), np.asarray(history["constraints"]),
        strict=True,
    )  # fmt: skip
    return [
        (int(count), value_of(case, dict(zip(names, values.tolist(), strict=True))), excess(case, rows))
        for count, values, rows in columns
        if np.isfinite(values).all()
    ]


def kkt_of(case: Case, design: Floats, driven: bool = False) -> float:
    """The scaled KKT residual at a design, from an evaluation of its own that tells of all peaks which may carry a
    multiplier. driven: as of `rows_of`."""
    found = evaluator_of(case).evaluate(design, rows=Rows(window=0.02, most=100))
    return residual(rows_of(case, design, found, driven)).scaled if found.status.usable else float("nan")


def untrue(problem: Problem, run: Run, tolerance: float, best: float | None = None) -> str:
    """Why the last word of a run is not true; empty where it is."""
    feasible = problem.violation is None or problem.violation <= 0.0
    calls_infeasible = bool(INFEASIBLE.search(run.reason))
    if run.status == RunStatus.CONVERGED:
        if not run.keeps:
            return f"converged, and a limit is exceeded by {run.excess:.1e}"
        if run.kkt > RESIDUAL * tolerance:
            return f"converged at a residual of {run.kkt:.1e}"
        if problem.exact is not None and run.value > problem.exact * (1.0 + REACHED):
            return f"converged {100.0 * (run.value / problem.exact - 1.0):.2g} % above the optimum"
        return ""
    if calls_infeasible and run.status != "max_iterations":
        if feasible and (problem.violation is not None or best is not None):
            return "called infeasible, and designs keep the limits"
        if run.keeps:
            return "called infeasible, and its own design keeps the limits"
        least = problem.violation
        if least is not None and "least" in run.reason and run.excess > least * (1.0 + LEAST):
            return f"called the least violation, and is {run.excess / least:.3g} times that"
        return ""
    if run.status == RunStatus.FAILED:
        return "gave up" if feasible or not calls_infeasible else ""
    return ""


def _reached(problem: Problem, visited: Sequence[tuple[int, float, float]], best: float | None) -> int | None:
    reference = problem.exact if problem.exact is not None else best
    for count, value, over in visited:
        if problem.violation is not None and problem.violation > 0.0:
            if over <= problem.violation * (1.0 + LEAST):
                return count
        elif reference is not None and over <= KEPT and value <= reference + REACHED * abs(reference):
            return count
    return None
