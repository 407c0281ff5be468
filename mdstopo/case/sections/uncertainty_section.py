"""The section `uncertainty`: keys that lead to numbers, distributions that make sense, measures that fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.methods.measures import MEASURES, OF_LIMITS, OF_OBJECTIVES, having
from mdstopo.case.methods.number_distributions import DISTRIBUTIONS, ROUNDED, Distribution, scaled_to_one
from mdstopo.case.model import ResponseRow, VolumeRow
from mdstopo.case.objects.uncertain import Measure, Scenario, UncertainNumber, Uncertainty
from mdstopo.case.text.key_paths import led_to, number_at, stands, why_fixed
from mdstopo.case.text.nodes import Node
from mdstopo.case.text.overrides import WrongPathError, as_yaml, steps_of
from mdstopo.case.text.reading import BAD, Fields, Reading, found, is_good
from mdstopo.case.text.words import inside, listed, number_text, shown

#: points that an interval of confidence needs at least
LEAST_VALIDATION = 30

#: sections of which no number may be uncertain
_CERTAIN = frozenset({"format", "title", "design", "combine", "optimizer", "solver", "uncertainty"})


def build_uncertainty(
    top: Fields, constraints: Sequence[VolumeRow | ResponseRow], root: Node, reading: Reading
) -> Uncertainty | None:
    """The section `uncertainty`; None where it could not be read. root: the whole case."""
    fields = top["uncertainty"]
    if not isinstance(fields, Fields):
        return None
    numbers = _numbers(fields, root, reading)
    scenarios = _scenarios(fields, root, {each.key for each in numbers}, reading)
    objectives = _objectives(fields, top, reading)
    rows = _constraints(fields, top, constraints, reading)
    if fields["validation"] is not BAD and 0 < fields["validation"] < LEAST_VALIDATION:
        message = f"found {fields['validation']}, allowed is 0 or at least {LEAST_VALIDATION}"
        reading.mistake(inside(fields.path, "validation"), message)
    if not fields["parameters"] and fields["parameters"] is not BAD:
        for key in ("sample", "validation", "seed"):
            if key in fields.stated:
                message = "ignored: without `parameters` the scenarios are all there is"
                reading.warning(inside(fields.path, key), message)
    if not is_good(fields):
        return None
    return Uncertainty(
        numbers=tuple(numbers),
        scenarios=tuple(scenarios),
        sample=fields["sample"],
        seed=fields["seed"],
        validation=fields["validation"],
        objectives=FrozenDict(objectives),
        constraints=FrozenDict(rows),
    )


# Numbers.


def _numbers(fields: Fields, root: Node, reading: Reading) -> list[UncertainNumber]:
    """What varies by itself; mistakes are noted."""
    path = inside(fields.path, "parameters")
    if fields["parameters"] == {}:
        reading.mistake(path, "found {}, needed is at least one key of the case with its distribution")
    built: dict[str, UncertainNumber] = {}
    for stated, keys in _items(fields["parameters"]):
        here = inside(path, stated)
        try:
            key, node = _led_to(stated, root)
        except WrongPathError as error:
            reading.mistake(here, error.message)
            continue
        nominal = number_at(node)
        if not math.isfinite(nominal):
            reading.mistake(here, f"found {found(node)} at {key}; a distribution belongs to one number")
        elif key in built:
            reading.mistake(here, f"{key} has a distribution already")
        elif key in reading.followed:
            owner = reading.followed[key]
            reading.mistake(here, f"{key} cannot be uncertain: it follows from the design variable {owner}")
        elif keys is not BAD and keys.good():
            distribution = _distribution(keys, nominal, reading)
            if distribution is not None:
                built[key] = UncertainNumber(key, nominal, distribution)
    return list(built.values())


def _items(stated: Any) -> list[tuple[str, Any]]:
    return list(stated.items()) if isinstance(stated, dict) else []


def _led_to(stated: str, root: Node) -> tuple[str, Node]:
    """The key path as messages write it, and what stands there. Raises WrongPathError with the reason."""
    path, node = led_to(stated, root)
    _refuse_fixed(path, [str(step) for step in steps_of(stated)], root)
    return path, node


def _refuse_fixed(path: str, steps: list[str], root: Node) -> None:
    """Numbers that say what the problem is, not what the scene is like."""
    section = steps[0]
    why = why_fixed(steps, root, _CERTAIN)
    if section == "constraints" and len(steps) > 1 and stands([*steps[:2], "volume"], root):
        why = "a volume is as certain as the design"
    elif section in ("constraints", "objectives") and len(steps) < 3:
        why = f"only single numbers in `{section}` can be, not what they ask for"
    if why:
        raise WrongPathError(path, f"{path} cannot be uncertain: {why}")


def _distribution(keys: Fields, nominal: float, reading: Reading) -> Distribution | None:
    (kind,) = keys.stated & DISTRIBUTIONS.keys()
    return DISTRIBUTIONS[kind].made(keys[kind], nominal, inside(keys.path, kind), reading)


# Scenarios.


def _scenarios(fields: Fields, root: Node, numbers: set[str], reading: Reading) -> list[Scenario]:
    path = inside(fields.path, "scenarios")
    stated = {name: keys for name, keys in _items(fields["scenarios"]) if isinstance(keys, Fields)}
    given = [name for name, keys in stated.items() if keys["probability"] is not None]
    shares = [1.0] * len(stated)
    if given and len(given) < len(stated):
        lacking = listed(name for name in stated if name not in given)
        reading.mistake(path, f"the probability of {lacking} is missing; either all scenarios state one, or none does")
    elif given and all(stated[name]["probability"] is not BAD for name in given):
        shares = [keys["probability"] for keys in stated.values()]
        if abs(math.fsum(shares) - 1.0) > ROUNDED:
            total = number_text(math.fsum(shares))
            reading.mistake(path, f"found probabilities of sum {total}, allowed are such of sum 1")
    built = []
    for (name, keys), share in zip(stated.items(), scaled_to_one(shares) if shares else (), strict=True):
        where = inside(keys.path, "set")
        values = {}
        for key, value in _items(keys["set"]):
            here = inside(where, key)
            try:
                path_set = _path_set(key, root)
            except WrongPathError as error:
                reading.mistake(here, error.message)
                continue
            below = f"{path_set}.", f"{path_set}["
            for both in sorted(each for each in numbers if each == path_set or each.startswith(below)):
                reading.mistake(here, f"{both} has a distribution; it varies by itself or by scenario, not both")
            _include(steps_of(key)[-1], value, reading)
            values[path_set] = as_yaml(value)
        built.append(Scenario(name, share, FrozenDict(values)))
    return built


def _include(key: str | int, value: Any, reading: Reading) -> None:
    """Read the files that a scenario's value names: they are part of the case. What cannot be read is refused there."""
    if key == "file" and isinstance(value, str):
        reading.include(value)
    if isinstance(value, Mapping):
        for name, below in value.items():
            _include(name, below, reading)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for below in value:
            _include("", below, reading)


def _path_set(key: str, root: Node) -> str:
    """A key path of a scenario as messages write it; what the case does not state may be set all the same."""
    try:
        return _led_to(key, root)[0]
    except WrongPathError:
        steps = [str(step) for step in steps_of(key)]
        if stands(steps, root):
            raise
        _refuse_fixed(key, steps, root)
        return ".".join(steps)


# Measures.


def _measure(keys: Any, default: Measure, reading: Reading) -> Measure:
    if not isinstance(keys, Fields) or not keys.good():
        return default
    kind = MEASURES[keys["measure"]]
    for key in ("factor", "level"):
        if key in keys.stated and key not in kind.keys:
            reading.mistake(inside(keys.path, key), f"{key} belongs to {listed(having(key))}, not to {kind.name}")
    factor = 1.0 if keys["factor"] is None else keys["factor"]
    level = 0.9 if keys["level"] is None else keys["level"]
    if kind.at_level_one and level == 1.0:
        kind = MEASURES[kind.at_level_one]  # a quantile's interval would have no upper end
    return Measure(kind.name, factor if "factor" in kind.keys else 0.0, level if "level" in kind.keys else 1.0)


def _objectives(fields: Fields, top: Fields, reading: Reading) -> dict[str, Measure]:
    stated = dict(_items(fields["objectives"]))
    named = top["objectives"] if isinstance(top["objectives"], dict) else {}
    return {name: _measure(stated.get(name), Measure(OF_OBJECTIVES), reading) for name in named}


def _constraints(
    fields: Fields, top: Fields, constraints: Sequence[VolumeRow | ResponseRow], reading: Reading
) -> dict[int, Measure]:
    path = inside(fields.path, "constraints")
    stated: dict[int, Any] = {}
    count = len(top["constraints"]) if isinstance(top["constraints"], (list, tuple)) else 0
    for text, keys in _items(fields["constraints"]):
        here = inside(path, text)
        place = int(text) if text.isascii() and text.isdigit() else -1
        if not 0 <= place < count:
            allowed = f"a place below {count}" if count else "none: there are no constraints"
            reading.mistake(here, f"found {shown(text)}, allowed is {allowed}")
            continue
        stated[place] = keys
        if len(constraints) != count or keys is BAD:
            continue
        row = constraints[place]
        if isinstance(row, VolumeRow):
            reading.mistake(here, f"constraints[{place}] bounds a volume, which is as certain as the design")
        elif row.sense == "equals" and keys["measure"] is not BAD and not MEASURES[keys["measure"]].for_equalities:
            allowed = " or ".join(kind.name for kind in MEASURES.values() if kind.for_equalities)
            message = f"found {keys['measure']}, allowed is {allowed}: not every value can equal a bound"
            reading.mistake(inside(here, "measure"), message)
    return {
        place: _measure(stated.get(place), Measure(OF_OBJECTIVES if row.sense == "equals" else OF_LIMITS), reading)
        for place, row in enumerate(constraints)
        if isinstance(row, ResponseRow)
    }
