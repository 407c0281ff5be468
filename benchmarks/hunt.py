"""A hunt for wrong results: random mixed scenes against a second model, differences, invariances and the estimates.

Every scene is evaluated at the default tolerance, and then

- its values against those of `hunt_model`, which shares nothing with the package,
- its gradients along a random direction against differences of the program's own values at a tolerance of 1e-12,
- its values against those of the same scene moved, turned, mirrored, renamed, with swapped ends, in other units,
- its error estimates against what the second model says the errors are.

Values are compared relative to the largest size that the response has in the motion, gradients relative to the largest
part of the slope along the direction (and to a thousandth of that size where they are smaller). What joints hold at
zero is zero to rounding, so that no size is below a millionth. A difference that two step sizes do not agree on decides
nothing.
"""

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

import mdstopo
from benchmarks.hunt_model import Model
from benchmarks.hunt_reductions import SMALLEST
from benchmarks.hunt_scenes import CHANGES, scene
from mdstopo.bench.tables import Table, significant, verdict
from mdstopo.case.reader import read_case

#: the default tolerance, and that of the values that differences are taken of
TOLERANCE, FINE = 1e-8, 1e-12
#: steps of differences, relative to the design
STEPS = (4e-3, 1e-3, 2.5e-4)
#: what the second model is good to, relative and, where it rounds what is zero, absolute: smaller errors cannot be told
RESOLVED, ROUNDED = 1e-11, 1e-13


@dataclass
class Found:
    """What the hunt has found: errors in tolerances by kind, with scene and objective; and how much was seen."""

    values: list[tuple[float, int, str]] = field(default_factory=list)
    gradients: list[tuple[float, int, str]] = field(default_factory=list)
    changes: list[tuple[float, int, str]] = field(default_factory=list)
    estimates: list[tuple[float, int, str]] = field(default_factory=list)
    statuses: Counter[str] = field(default_factory=Counter)
    undecided: int = 0


class Kind(NamedTuple):
    """A kind of scenes: their document by seed and change, their second model, changes, and whether one can be made."""

    name: str
    scene: Callable[..., dict[str, Any]]
    model: type[Model]
    changes: Mapping[str, Any]
    covariant: Callable[[dict[str, Any], Any], bool] = lambda document, change: True


PLANAR = Kind("", scene, Model, CHANGES)


def hunt(minutes: float = 10.0, first: int = 0, kind: Kind = PLANAR) -> Iterator[Table]:
    """Go through scenes, from seed `first` on, for so many minutes; then the bars and the worst of what was found."""
    found, began, seed = Found(), time.monotonic(), first
    while time.monotonic() < began + 60.0 * minutes:
        look(seed, found, kind)
        seed += 1
    yield bars(found, seed - first, kind)
    yield worst(found)


@dataclass
class Scene:
    """A scene's document and case, its design x (N + P,): alpha, then the values of variables; what was found there."""

    seed: int
    document: dict[str, Any]
    case: Any
    x: Any
    result: Any = None
    sizes: dict[str, float] = field(default_factory=dict)

    def parts(self, x: Any) -> tuple[Any, dict[str, Any]]:
        """alpha (N,) of a design, and the values of its variables by name."""
        n = self.case.n_design
        return x[:n], {name: x[part] for name, part in self.case.space.parts.items()} if self.case.variables else {}

    def values_at(self, x: Any, tolerance: float) -> dict[str, float]:
        """Objectives of a design at a tolerance; a ValueError where it cannot be computed."""
        case = read_case(json.dumps(self.document), overrides={"solver.tolerance": tolerance})
        alpha, values = self.parts(x)
        result = mdstopo.evaluate(case, alpha, variables=values, gradient=False)
        if not result.status.ok:
            raise ValueError(result.status.name)
        return dict(result.objectives)

    def slopes(self, name: str, direction: Any) -> Any:
        """What each part of a direction (N + P,) does to an objective by its gradient."""
        found = np.zeros(len(self.x))
        found[: self.case.n_design] = self.result.gradients[name]
        for key, part in (self.case.space.parts if self.case.variables else {}).items():
            found[part] = self.result.variable_gradients[name][key]
        return found * direction


def drawn(seed: int, document: dict[str, Any]) -> Scene:
    """A scene's document with a random design; a CaseError where it is refused."""
    case = read_case(json.dumps(document))
    rng = np.random.default_rng(seed)
    x = np.array(case.whole(rng.uniform(0.4, 1.0, case.n_design)))
    x[case.n_design :] *= rng.uniform(0.8, 1.2, len(x) - case.n_design)
    return Scene(seed, document, case, x)


def look(seed: int, found: Found, kind: Kind = PLANAR) -> None:
    """Everything about one scene."""
    try:
        own = drawn(seed, kind.scene(seed))
        alpha, values = own.parts(own.x)
        own.result = result = mdstopo.evaluate(own.case, alpha, variables=values, error_estimate=True)
    except mdstopo.CaseError as refused:
        found.statuses[f"refused: {refused.mistakes[0].message}"] += 1
        return
    found.statuses[result.status.name] += 1
    if not result.status.ok:
        return
    model = kind.model(own.document, alpha, values)
    try:
        model.solve()
    except ArithmeticError as given_up:
        found.statuses[f"second model: {given_up}"] += 1
        return
    for name, keys in own.document["objectives"].items():
        value, size = model.objective(keys["response"], keys["over_time"])
        own.sizes[name] = size = max(size, abs(value), SMALLEST)
        label = f"{keys['over_time']} of {keys['response']}"
        error = abs(result.objectives[name] - value) / size
        found.values.append((error / TOLERANCE, seed, label))
        if error > RESOLVED and error * size > ROUNDED and name in result.errors:
            found.estimates.append((result.errors[name].value / (error * size), seed, label))
    _gradients(own, found)
    _changes(own, found, kind)


def _gradients(own: Scene, found: Found) -> None:
    direction = np.random.default_rng([own.seed, 2]).normal(size=len(own.x)) * own.x
    slopes: list[dict[str, float]] = []
    try:
        for h in STEPS:
            total: dict[str, float] = {}
            for m, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
                for sign in (1.0, -1.0):
                    for name, value in own.values_at(own.x + sign * m * h * direction, FINE).items():
                        total[name] = total.get(name, 0.0) + sign * weight * value / h
            slopes.append(total)
    except ValueError:  # a design nearby cannot be computed, or touches something only just
        found.undecided += len(own.result.objectives)
        return
    for name in own.result.gradients:
        if own.sizes[name] <= SMALLEST:  # zero to rounding at every time, and rounding has no slope
            found.undecided += 1
            continue
        candidates = [(abs(a[name] - b[name]), b[name]) for a, b in pairwise(slopes)]
        doubt, slope = min(candidates)
        along = own.slopes(name, direction)
        scale = max(float(np.abs(along).max()), 1e-3 * own.sizes[name])
        error = abs(float(along.sum()) - slope)
        if doubt > TOLERANCE * scale and doubt > 0.1 * error:
            found.undecided += 1
            continue
        keys = own.document["objectives"][name]
        label = f"{keys['over_time']} of {keys['response']}"
        found.gradients.append((error / scale / TOLERANCE, own.seed, label))


def _changes(own: Scene, found: Found, kind: Kind) -> None:
    """The same scene written in another way, a different one for each seed."""
    label, change = list(kind.changes.items())[own.seed % len(kind.changes)]
    if not kind.covariant(own.document, change):
        return
    document = kind.scene(own.seed, change)
    if not document["objectives"]:
        return
    other = drawn(own.seed, document)  # the same design: variables have the unit of the forces
    alpha, values = other.parts(other.x)
    again = mdstopo.evaluate(other.case, alpha, variables=values, gradient=False)
    if not again.status.ok:
        found.changes.append((np.inf, own.seed, f"{label}: {again.status.name}"))
        return
    for name in document["objectives"]:
        keys = own.document["objectives"][name]
        response = keys["response"]
        forceful = response == "energy" or bool({"member_force", "joint_force", "joint_moment"} & set(response))
        factor = change.force if forceful else 1.0
        error = abs(again.objectives[name] / factor - own.result.objectives[name]) / own.sizes[name]
        found.changes.append((error / TOLERANCE, own.seed, f"{label}: {keys['over_time']} of {response}"))


def bars(found: Found, scenes: int, kind: Kind = PLANAR) -> Table:
    """What is promised, and what was found."""
    rows = []

    def bar(what: str, entries: list[tuple[float, int, str]], limit: float, share: float) -> None:
        beyond = sum(error > limit for error, _, _ in entries)
        allowed = share * len(entries)
        promised = "none" if share == 0.0 else f"at most {100 * share:g} %"
        rows.append([what, f"{len(entries)}", promised, f"{beyond}", verdict(beyond <= allowed)])

    bar("values beyond ten tolerances", found.values, 10.0, 0.0)
    bar("gradients beyond ten tolerances", found.gradients, 10.0, 0.02)
    bar("gradients beyond a thousand", found.gradients, 1000.0, 0.0)
    bar("values of a scene written in another way, beyond ten", found.changes, 10.0, 0.0)
    off = [(max(ratio, 1.0 / max(ratio, 1e-300)), seed, label) for ratio, seed, label in found.estimates]
    low = [(1.0 / max(ratio, 1e-300), seed, label) for ratio, seed, label in found.estimates]
    bar("estimates of values off by more than a factor of ten", off, 10.0, 0.02)
    bar("estimates below a hundredth of the error", low, 100.0, 0.0)
    statuses = ", ".join(f"{name} {count}" for name, count in sorted(found.statuses.items()))
    return Table(
        f"Hunt: {scenes} random scenes{kind.name}",
        ["what", "of", "allowed", "found", "met"],
        rows,
        [
            f"Statuses: {statuses}. Gradients that differences could not decide on: {found.undecided}.",
            f"Estimates are compared where the second model can tell the error, from {RESOLVED:g} of the size on.",
        ],
    )


def worst(found: Found) -> Table:
    """The three worst of each kind, to be looked into by `benchmarks.hunt_scenes.scene(seed)`."""
    rows = []
    kinds = (("value", found.values), ("gradient", found.gradients), ("written in another way", found.changes))
    for kind, entries in kinds:
        for error, seed, label in sorted(entries, reverse=True)[:5]:
            rows.append([kind, f"{seed}", significant(error), label])
    for ratio, seed, label in sorted(found.estimates)[:3]:
        rows.append(["estimate / error", f"{seed}", significant(ratio), label])
    return Table("Hunt: the worst, in tolerances", ["kind", "seed", "off by", "of what"], rows, detail=True)
