"""mdstopo beside other optimisers on the dynamic problems, each with several starts.

The others get the same first designs, one after another, each with so many evaluations; mdstopo is run with `starts`.
What is kept of an attempt is each improvement: evaluations so far of all starts, and the best value that keeps the
limits.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.optimum.problems import Problem
from benchmarks.optimum.runs import KEPT
from mdstopo import optimize
from mdstopo.session.outcome import Progress

Floats = NDArray[np.float64]
#: evaluations of all starts so far, best value so far
Improvements = list[tuple[int, float]]

#: where the others' results are kept; `python -m benchmarks.optimum --other-solvers` writes it
KEPT_RESULTS = Path(__file__).with_name("other_solvers.json")
#: starts and evaluations of each, unless asked otherwise
STARTS, BUDGET = 20, 150
#: methods that need a dense matrix of all variables squared are left out beyond so many
DENSE = 300
#: share above the best of all that counts as reaching it
NEAR = 0.01


def first_designs(problem: Problem, count: int) -> list[Floats]:
    """First x: the case's own, the far one, then random ones, some with few members and some with many."""
    case = problem.case()
    lower, upper = case.space.bounds(case.lower, case.upper)
    far = problem.starts()["far"]
    assert far is not None
    found = [case.space.reduce(case.start), case.space.reduce(far)]
    for index in range(2, count):
        rng = np.random.default_rng([7, index])
        found.append(lower + (upper - lower) * rng.random(len(lower)) ** rng.choice([0.5, 1.0, 2.0, 4.0]))
    return found[:count]


def improvements(visited: Sequence[tuple[int, float, float]], before: int = 0) -> Improvements:
    """Of designs in order (evaluations, value, excess) those that keep the limits and are better than all earlier."""
    best, found = float("inf"), []
    for count, value, over in visited:
        if over <= KEPT and value < best:
            best = value
            found.append((before + count, value))
    return found


def ours(problem: Problem, starts: int, iterations: int) -> tuple[Improvements, int, str]:
    """mdstopo's improvements with so many starts, its evaluations, and its last word."""
    case = problem.case(max_iterations=iterations)
    spent: dict[int, int] = {}
    visited: list[tuple[int, float, float]] = []

    def seen(progress: Progress) -> None:
        spent[progress.start] = progress.evaluations
        if np.isfinite(progress.objective):
            visited.append((sum(spent.values()), progress.objective, progress.violation))

    result = optimize(case, starts=starts, on_iteration=seen)
    return improvements(visited), result.evaluations, str(result.status)


def race(problem: Problem, starts: int, budget: int) -> dict[str, Any]:
    """What the others reach. Needs CasADi and NLopt."""
    from benchmarks.optimum.other_solvers import METHODS, attempt

    case = problem.case()
    entry: dict[str, Any] = {"digest": problem.digest, "starts": starts, "budget": budget, "methods": {}}
    for method in METHODS:
        if method == "SLSQP" and case.space.size > DENSE:
            continue
        visited: list[tuple[int, float, float]] = []
        bests = []
        for first in first_designs(problem, starts):
            try:
                own = attempt(case, method, first, budget)
            except ValueError:
                own = []  # the first design cannot be computed
            before = len(visited)
            visited += [(before + count, value, over) for count, value, over in own]
            kept = [value for _, value, over in own if over <= KEPT]
            bests.append(min(kept) if kept else None)
        entry["methods"][method] = {
            "evaluations": len(visited),
            "improvements": improvements(visited),
            "bests": bests,
        }
    return entry


def write_other_solvers(chosen: Sequence[Problem], starts: int, budget: int) -> None:
    """Race the others and keep what they reach, and the best of mdstopo with as many starts."""
    for problem in chosen:
        if problem.kind != "dynamic":
            continue
        kept = json.loads(KEPT_RESULTS.read_text()) if KEPT_RESULTS.exists() else {}
        kept[problem.name] = entry = race(problem, starts, budget)
        own, _, _ = ours(problem, starts, budget)
        entry["ours"] = own[-1][1] if own else None
        KEPT_RESULTS.write_text(json.dumps(kept, separators=(",", ":")).replace('},"', '},\n"') + "\n")
        for method, each in entry["methods"].items():
            last = each["improvements"][-1] if each["improvements"] else None
            print(f"{problem.name:20} {method:6} {each['evaluations']} evaluations, best {last}", flush=True)


def other_solvers_of(problem: Problem) -> dict[str, Any] | None:
    """What the others reached; None where it is not kept, or was reached on another text."""
    kept = json.loads(KEPT_RESULTS.read_text()).get(problem.name) if KEPT_RESULTS.exists() else None
    return kept if kept is not None and kept["digest"] == problem.digest else None


def best_known(problem: Problem) -> float | None:
    """The exact value, or the best that is kept of anybody; None where nobody found any design."""
    if problem.exact is not None:
        return problem.exact
    entry = other_solvers_of(problem)
    if entry is None:
        return None
    lasts = [each["improvements"][-1][1] for each in entry["methods"].values() if each["improvements"]]
    own = entry.get("ours")
    return min([*lasts, *([] if own is None else [own])], default=None)


def within(found: Sequence[Sequence[float]], best: float) -> int | None:
    """Evaluations until a value is within 1 % of the best; None where none is."""
    return next((int(count) for count, value in found if value <= best + NEAR * abs(best)), None)
