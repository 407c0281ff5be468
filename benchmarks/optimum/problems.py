"""The problems by which the optimiser is judged, with what is known of their optima.

`convex`: driven linkages, whose exact optimum a cone program gives (`exact.json`). `dynamic`: motions that depend on
the design; what is known of them is the best that anybody found (`peers.json`).
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.optimum import linkages
from mdstopo import Case
from mdstopo.case.reader import read_case

Floats = NDArray[np.float64]
Document = dict[str, Any]

#: where exact optima are kept; `python -m benchmarks.optimum --exact` writes it
EXACT = Path(__file__).with_name("exact.json")
#: share of members that a far start has, seeds of far starts
PRESENT, SEED = 0.3, 20


@dataclass(frozen=True)
class Problem:
    """One problem. text: of the case; kind: `convex` or `dynamic`; exact: the optimal value, None where it is unknown
    or no design keeps the limits; violation: the least relative excess over the limits, 0 where they can be kept, None
    where it is unknown."""

    name: str
    kind: str
    text: str
    exact: float | None = None
    violation: float | None = None

    @property
    def digest(self) -> str:
        """What tells whether a number that was kept belongs to this text."""
        return hashlib.sha256(self.text.encode()).hexdigest()[:16]

    def case(self, **optimizer: Any) -> Case:
        """The case, with other settings of the optimiser."""
        return read_case(self.text, overrides={f"optimizer.{key}": value for key, value in optimizer.items()})

    def starts(self) -> dict[str, Floats | None]:
        """First designs (alpha, with the values of variables behind it) by name: the case's own, and a far one, in
        which a few members are whole and the others absent."""
        case = self.case()
        rng = np.random.default_rng(SEED)
        alpha = np.where(rng.random(case.n_design) < PRESENT, case.upper, case.lower)
        far = case.whole(alpha) if case.variables else alpha
        for variable in case.variables:
            part = case.space.parts[variable.name]
            far[part] = rng.choice([variable.lower, variable.upper], part.stop - part.start)
        return {"default": None, "far": far}


_MIN_MAX: Document = {"combine": {"method": "weighted_min_max", "weights": {"F1": 1, "F2": 1.5}, "normalize": False}}
_GROUPS: Document = {
    "combine": {"method": "weighted_min_max", "weights": {"F1": 1, "F2": 1, "F3": 2}, "normalize": False}
}
_SUM: Document = {"combine": {"method": "weighted_sum", "weights": {"F1": 1, "F2": 1}, "normalize": False}}
_WORK: Document = {
    "load_cases": {
        "idle": {"loads": []},
        "work": {"loads": [{"body": "rocker", "force": {"table": [[0, 0, -150], [0.2, 60, -150], [0.6, 60, -150]]}}]},
    }
}

CONVEX: Mapping[str, Callable[[], Document]] = {
    "four-bar loose": lambda: linkages.four_bar(["D"], {"A": 400}),
    "four-bar tight": lambda: linkages.four_bar(["D"], {"A": 40}),
    "four-bar very tight": lambda: linkages.four_bar(["D"], {"A": 20, "B": 25}),
    "four-bar impossible": lambda: linkages.four_bar(["D"], {"A": 15}),
    "four-bar members": lambda: linkages.four_bar(["springs"], {"A": 40, "taut": 30}),
    "four-bar two loads": lambda: linkages.four_bar(["D/work"], {"A/idle": 120, "A/work": 150}, **_WORK),
    "slider-crank no limit": lambda: linkages.slider_crank(["A"], {}),
    "slider-crank members": lambda: linkages.slider_crank(["springs"], {"A": 40}),
    "slider-crank tight": lambda: linkages.slider_crank(["A"], {"springs": 4}),
    "slider-crank impossible": lambda: linkages.slider_crank(["C"], {"A": 25, "springs": 2}),
    "Watt tight": lambda: linkages.watt(["A"], {"D": 60, "G": 60}),
    "Watt members": lambda: linkages.watt(["springs", "levers", "rockers"], {"A": 45, "D": 90}, **_GROUPS),
    "Watt impossible": lambda: linkages.watt(["A"], {"D": 15, "G": 25}),
    "Watt floating tight": lambda: linkages.watt_floating(["F"], {"A": 240, "D": 200}),
    "Stephenson tight": lambda: linkages.stephenson(["G"], {"A": 250, "D": 130}),
    "Stephenson min-max": lambda: linkages.stephenson(["A", "D"], {"G": 35}, **_MIN_MAX),
    "Stephenson impossible": lambda: linkages.stephenson(["D"], {"A": 150, "G": 25}),
    "six-bar slider sum": lambda: linkages.six_bar_slider(["A", "D"], {"F": 80, "rods": 40}, **_SUM),
}


def all() -> list[Problem]:
    """All problems, with what is known of their optima."""
    return [*convex()]


@cache
def convex() -> tuple[Problem, ...]:
    """The driven linkages."""
    return tuple(_known(Problem(name, "convex", json.dumps(make()))) for name, make in CONVEX.items())


def named(names: "list[str] | None") -> list[Problem]:
    """The problems whose names begin with one of `names`; all of them without. Raises ValueError for a name that none
    has."""
    everything = all()
    for name in names or []:
        if not any(each.name.startswith(name) for each in everything):
            raise ValueError(f"no problem {name!r}; there are: {', '.join(each.name for each in everything)}")
    return [each for each in everything if not names or each.name.startswith(tuple(names))]


def _known(problem: Problem) -> Problem:
    kept = json.loads(EXACT.read_text()).get(problem.name) if EXACT.exists() else None
    if kept is None or kept["digest"] != problem.digest:
        return problem
    return replace(problem, exact=kept["value"], violation=kept["violation"])


def write_exact(chosen: list[Problem]) -> None:
    """Solve the cone programs of convex problems and keep what they give, checked by an evaluation of the design.

    Raises ValueError where the evaluation gives something else.
    """
    from benchmarks.optimum.cone import exact
    from benchmarks.optimum.measure import excess, value_of
    from mdstopo import evaluate

    kept = json.loads(EXACT.read_text()) if EXACT.exists() else {}
    for problem in chosen:
        if problem.kind != "convex":
            continue
        case = problem.case()
        found = exact(case)
        check = evaluate(case, np.clip(found.alpha, case.lower, case.upper), gradient=False)
        value, over = value_of(case, check.objectives), excess(case, check.constraints)
        print(f"{problem.name:28} {found.value} violation {found.violation:.6g}; evaluated {value:.8g} {over:.2g}")
        if abs(over - found.violation) > 1e-4 or (found.value is not None and abs(value / found.value - 1.0) > 1e-4):
            raise ValueError(f"{problem.name}: the design's evaluation gives {value:.8g} with an excess of {over:.3g}")
        kept[problem.name] = {"digest": problem.digest, "value": found.value, "violation": found.violation}
        EXACT.write_text(json.dumps({name: kept[name] for name in CONVEX if name in kept}, indent=1) + "\n")
    convex.cache_clear()
