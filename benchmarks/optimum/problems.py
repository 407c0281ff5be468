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
from benchmarks.optimum.motions import (
    acceleration,
    angle,
    arm,
    belts,
    displacement,
    force,
    isolator,
    jerked,
    larger,
    limit,
    machine,
    most,
    product,
    restraint,
    shaken,
    stopped,
    wires,
)
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


_OCCUPANT = displacement("occupant", "vehicle")
_TIGHT: Document = {"f": most(force("wires0")), "g": most(force("wires1"))}

DYNAMIC: Mapping[str, Callable[[], Document]] = {
    "isolator": isolator,
    "machine": lambda: machine(
        [limit(displacement("machine", "floor"), 0.09), limit(angle("machine", "floor"), 0.045)],
        {"shock": shaken(30, 20)},
        objectives={"a": most(acceleration("machine"))},
    ),
    "machine two shocks": lambda: machine(
        [
            limit(displacement("machine", "floor"), 0.11, load_case="side"),
            limit(angle("machine", "floor"), 0.02, load_case="turn"),
            limit(displacement("machine", "floor"), 0.02, load_case="turn"),
        ],
        {"side": shaken(40, 0), "turn": shaken(10, 20, 15)},
        objectives={
            "a": most(acceleration("machine"), load_case="side"),
            "b": most(acceleration("machine", at=[0.05, 0.6]), load_case="turn"),
        },
        **larger({"a": 1, "b": 1}),
    ),
    "belts": lambda: belts({"a": most(acceleration("occupant"))}, [limit(_OCCUPANT, 0.1)]),
    "belts turn": lambda: belts(
        {"a": most(acceleration("occupant"))}, [limit(_OCCUPANT, 0.15), limit(angle("occupant", "vehicle"), 0.03)]
    ),
    "belts force": lambda: belts({"f": most(force("belts"))}, [limit(_OCCUPANT, 0.15)]),
    "belts two stops": lambda: belts(
        {"a": most(acceleration("occupant"), load_case="front"), "b": most(acceleration("occupant"), load_case="side")},
        [limit(_OCCUPANT, 0.15, load_case="front"), limit(_OCCUPANT, 0.1, load_case="side")],
        {"front": stopped(-100), "side": stopped(-30, -60, 40)},
        **larger({"a": 1, "b": 1.5}),
    ),
    "belts product": lambda: belts(
        {"a": most(acceleration("occupant")), "d": most(_OCCUPANT)},
        [limit(angle("occupant", "vehicle"), 0.06)],
        **product({"a": 1, "d": 1}),
    ),
    "six wires": lambda: wires({"f": most(force("wires0"))}, []),
    "wires travel": lambda: wires({"f": most(force("wires0"))}, [limit(displacement("block"), 0.05)], 9),
    "wires groups": lambda: wires(
        _TIGHT, [limit(displacement("block"), 0.06), limit(angle("block"), 0.05)], 8, 2, **larger({"f": 1, "g": 1})
    ),
    "arm": lambda: arm(
        {"r": most({"joint_force": {"joint": "root"}})}, [limit(angle("lower", "base"), 0.15)], **jerked(60, 10)
    ),
    "arm members": lambda: arm(
        {"f": most(force("stays")), "g": most(force("guys")), "h": most(force("ties"))},
        [limit(angle("lower", "base"), 0.1), most({"joint_force": {"joint": "elbow"}}, limit=100)],
        **jerked(60, 10),
        **larger({"f": 1, "g": 2, "h": 1}),
    ),
    "arm two jerks": lambda: arm(
        {
            "r": most({"joint_force": {"joint": "root"}}, load_case="left"),
            "s": most({"joint_force": {"joint": "root"}}, load_case="right"),
        },
        [limit(angle("lower", "base"), 0.15, load_case=name) for name in ("left", "right")],
        load_cases={"left": jerked(60, 10), "right": jerked(-40, -30)},
        **larger({"r": 1, "s": 1}),
    ),
    "restraint": lambda: restraint({"G": most("energy")}, [limit(angle("torso", "vehicle"), 0.2)], 8),
    "thousand": lambda: restraint(
        {"G": most("energy")}, [limit(angle("torso", "vehicle"), 0.3), limit(displacement("torso", "vehicle"), 0.15)]
    ),
}
#: optima of dynamic problems that are known in closed form
CLOSED = {"isolator": 0.5205986 * 4.0**2 / 0.1}


def all() -> list[Problem]:
    """All problems, with what is known of their optima."""
    return [*convex(), *dynamic()]


@cache
def convex() -> tuple[Problem, ...]:
    """The driven linkages."""
    return tuple(_known(Problem(name, "convex", json.dumps(make()))) for name, make in CONVEX.items())


@cache
def dynamic() -> tuple[Problem, ...]:
    """The motions that depend on the design."""
    return tuple(Problem(name, "dynamic", json.dumps(make()), CLOSED.get(name)) for name, make in DYNAMIC.items())


def named(names: "list[str] | None") -> list[Problem]:
    """The problems of these names, or whose names begin so where none has the name; all without. Raises ValueError for
    a name that none begins with."""
    everything = all()
    if not names:
        return everything
    chosen = []
    for name in names:
        own = [each for each in everything if each.name == name] or [
            each for each in everything if each.name.startswith(name)
        ]
        if not own:
            raise ValueError(f"no problem {name!r}; there are: {', '.join(each.name for each in everything)}")
        chosen += [each for each in own if each not in chosen]
    return chosen


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
