"""Bounds over all members beside closed forms, and beside the best of random designs of random scenes."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from benchmarks.bound_scenes import KINDS, Scene, case_of, designs, scene, with_limit
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.model import Case, VolumeRow
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.limiting.bounds import bounds

SCENES, DESIGNS = 200, 200
#: how far below a closed form a bound may be
BELOW = 0.01


def bound() -> Iterator[Table]:
    """Two tables."""
    yield closed_forms()
    yield random_scenes()


def closed_forms() -> Table:
    """Bounds of cases whose limiting performance is known."""
    rows = []
    for name, formula, exact, case in _known():
        found = bounds(case)["G"].value
        assert found is not None
        good = (1.0 - BELOW) * exact <= found <= exact * (1.0 + 1e-9)
        rows.append([name, formula, f"{exact:.6g}", f"{found:.6g}", f"{1.0 - found / exact:.1e}", verdict(good)])
    return Table(
        "Bounds over all members beside closed forms",
        ("case", "closed form", "its value", "bound", "below by", "met"),
        rows,
        ("The bar: never above, at most 1 % below. V: the speed at the start, D: the travel that is allowed.",),
    )


def _known() -> Iterator[tuple[str, str, float, Case]]:
    """Name, formula, value, case with one objective G."""
    speed, travel = 2.0, 0.1
    for name, end in (("velocity step", 1.0), ("the same, 40 s", 40.0)):
        yield name, "V^2 / (2 D)", speed**2 / (2 * travel), _stop("acceleration", "displacement", travel, "x", end)
    yield "in the plane", "V^2 / (2 D)", speed**2 / (2 * travel), _stop("acceleration", "displacement", travel, "norm")
    limit = 20.0
    yield "least travel", "V^2 / (2 a)", speed**2 / (2 * limit), _stop("displacement", "acceleration", limit, "x")
    a, travel = 100.0, 0.04
    for tau in (0.02, 0.05, 0.1):
        exact = a / (1.0 + 2.0 * travel / (a * tau**2))
        name = f"rectangular pulse of {1000 * tau:g} ms"
        yield name, "a / (1 + 2 D / (a tau^2))", exact, _pulse(a, tau, travel)
    slack, travel = 0.05, 0.2
    yield "a fall through slack s", "g s / (D - s)", 9.81 * slack / (travel - slack), _fall(slack, travel)


def _case(**sections: Any) -> Case:
    tie = {"from": {"body": "ground", "at": [-1, 0]}, "to": {"body": "load", "at": [0, 0]}}
    made = {
        "format": 1,
        "time": {"end": 1.0},
        "bodies": {"load": {"mass": 10, "inertia": 1, "position": [0, 0]}},
        "members": {"tie": {**tie, "law": {"type": "spring", "stiffness": 1000}}},
        **sections,
    }
    return read_case(json.dumps(made))


def _stop(objective: str, other: str, limit: float, component: str, end: float = 1.0) -> Case:
    over = "max" if component == "norm" else "max_abs"
    seen = {"body": "load", "component": component}
    return _case(
        time={"end": end},
        bodies={"load": {"mass": 10, "inertia": 1, "position": [0, 0], "velocity": [2, 0]}},
        objectives={"G": {"response": {objective: seen}, "over_time": over}},
        constraints=[{"response": {other: seen}, "over_time": over, "limit": limit}],
    )


def _pulse(a: float, tau: float, travel: float) -> Case:
    drive = {"acceleration": {"table": [[0, a], [tau, a], [tau, 0]]}}
    seen = {"body": "load", "component": "x"}
    return _case(
        bodies={
            "load": {"mass": 10, "inertia": 1, "position": [0, 0]},
            "sled": {"mass": 100, "inertia": 10, "position": [0, 0]},
        },
        motions=[{"body": "sled", "x": drive, "y": {"velocity": 0}, "angle": {"velocity": 0}}],
        objectives={"G": {"response": {"acceleration": seen}, "over_time": "max_abs"}},
        constraints=[
            {"response": {"displacement": {**seen, "relative_to": "sled"}}, "over_time": "max_abs", "limit": travel}
        ],
    )


def _fall(slack: float, travel: float) -> Case:
    law = {"type": "gap", "stiffness": 5000, "gap": slack, "clip": True}
    seen = {"body": "load", "component": "y"}
    return _case(
        gravity=[0, -9.81],
        members={"tie": {"from": {"body": "ground", "at": [0, 3]}, "to": {"body": "load", "at": [0, 0]}, "law": law}},
        objectives={"G": {"response": {"acceleration": seen}, "over_time": "max"}},
        constraints=[{"response": {"displacement": seen}, "over_time": "min", "at_least": -travel}],
    )


@dataclass(frozen=True)
class Tried:
    """A bound beside the best of random designs that keep the limit. bound: None where there is none."""

    kind: str
    bound: float | None
    best: float


def random_scenes(scenes: int = SCENES, count: int = DESIGNS) -> Table:
    """How near random designs come to the bounds of random scenes."""
    tried = [each for seed in range(scenes) for each in tries(seed, count)]
    rows = []
    for kind in KINDS:
        own = [each for each in tried if each.kind == kind]
        known = [(each.bound, each.best) for each in own if each.bound is not None]
        above = sum(bound > best for bound, best in known)
        ratios = sorted(best / bound for bound, best in known if bound > 0.0)
        near = f"{ratios[0]:.3g}, {median(ratios):.3g}" if ratios else "-"
        what = (KINDS[kind].__doc__ or "").partition(".")[0]
        rows.append([what, str(len(own)), str(len(known)), near, str(above), verdict(above == 0)])
    return Table(
        f"Bounds of {scenes} random scenes beside the best of {count} random designs of each",
        ("scenes", "limits tried", "with a bound", "best / bound: least, median", "bound above best", "met"),
        rows,
        (
            "For each scene: the least peak acceleration with a limit on the travel, and the least travel with a limit "
            "on the acceleration; a tenth or a half of the designs keep it. Scenes: benchmarks/bound_scenes.py.",
        ),
    )


def tries(seed: int, count: int) -> Iterator[Tried]:
    """One random scene: both objectives, each with a limit on the other."""
    rng = np.random.default_rng(seed)
    kind = list(KINDS)[seed % len(KINDS)]
    made = scene(rng, kind)
    values = _values(case_of(made), lambda case: designs(rng, case, count))
    if len(values) < 10:
        return
    for g, (objective, other) in enumerate((("acceleration", "travel"), ("travel", "acceleration"))):
        limit = float(np.quantile(values[:, 1 - g], (0.1, 0.5)[seed // len(KINDS) % 2]))
        best = float(values[values[:, 1 - g] <= limit, g].min())
        yield Tried(kind, _bound(made, objective, other, limit), best)


def _bound(made: Scene, objective: str, other: str, limit: float) -> float | None:
    return bounds(with_limit(made, objective, other, limit))[objective].value


def _values(case: Case, drawn: Callable[[Case], np.ndarray]) -> np.ndarray:
    """(K, 2) acceleration and travel of the designs that keep the scene's own limits and can be computed."""
    evaluator, found = Evaluator(case, in_background=False), []
    for design in drawn(case):
        seen = evaluator.evaluate(design, gradient=False)
        kept = all(
            seen.constraints[i] <= 0.0
            for i, row in enumerate(case.constraints)
            if not isinstance(row, VolumeRow)  # designs are drawn within those
        )
        if seen.status.ok and kept:
            found.append([seen.objectives["acceleration"], seen.objectives["travel"]])
    return np.array(found).reshape(-1, 2)
