"""Objectives, constraints, combination and the design's numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.design.catalogue import with_catalogue
from mdstopo.case.design.stages import check_powers, lowest, powers_of
from mdstopo.case.design.volume import check_feasible, prices
from mdstopo.case.methods.over_time import DEFAULT_REDUCTION
from mdstopo.case.model import Combine, MemberGroup, Objective, Response, ResponseRow, Variable, VolumeRow
from mdstopo.case.objects.frames import Frames
from mdstopo.case.responses.response_kinds import response_of
from mdstopo.case.scene.candidates import coefficients_of
from mdstopo.case.scene.load_case_times import DEFAULT
from mdstopo.case.schema.schema_case import SENSES
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, listed, number_text, shown
from mdstopo.settings.scalarisations import SCALARISATIONS

DESIGN_KEYS = ("initial", "lower", "upper", "power")
DESIGN_DEFAULTS = {"initial": 0.1, "lower": 0.001, "upper": 1.0, "power": 1.0}


def apply_design(top: Fields, groups: dict[str, MemberGroup], reading: Reading) -> dict[str, MemberGroup] | None:
    """The groups of members with the numbers of the section `design`; None where those are wrong.

    A case without design, objectives and constraints is simulated with alpha = 1: its initial design is 1.
    """
    design = top["design"]
    if design is BAD:
        return None
    if design is None:
        optimised = {"objectives", "constraints"} & top.stated
        return groups if optimised else {name: replace(g, initial=1.0) for name, g in groups.items()}
    good = design.good()
    sections = top["members"] if isinstance(top["members"], dict) else {}
    for key in DESIGN_KEYS:
        for name in design[key] if isinstance(design[key], dict) else ():
            fields = sections.get(name)
            if isinstance(fields, Fields) and fields["design"] is False:
                path = inside(inside(design.path, key), name)
                reading.mistake(path, f"{shown(name)} has `design: false`: its alpha is 1 and no variable")
                good = False
    good &= check_powers(design, top, reading)
    numbers = {}
    for name, fields in sections.items():
        if fields is BAD or fields["design"] is not True:
            continue
        values = {key: _for_group(design[key], name, key) for key in DESIGN_KEYS}
        values |= powers_of(values["power"])
        numbers[name] = values
        good &= _check_numbers(values, name, design, reading)
    if not good:
        return None
    designed = {name: replace(group, **numbers.get(name, {})) for name, group in groups.items()}
    chosen = with_catalogue(top, designed, reading)
    if chosen is None:
        return None
    for name, (sizes, prices_of_sizes) in chosen.items():
        designed[name] = replace(designed[name], sizes=sizes, prices=prices_of_sizes)
    return designed


def _for_group(stated: Any, group: str, key: str) -> Any:
    if isinstance(stated, dict):
        return stated.get(group, DESIGN_DEFAULTS[key])
    return stated


def _check_numbers(values: dict[str, Any], group: str, design: Fields, reading: Reading) -> bool:
    """Whether bounds, start and power of one group go together; notes what does not."""
    initial, lower, upper = (values[key] for key in DESIGN_KEYS[:-1])
    power = lowest(values)

    def tell(key: str, message: str) -> None:
        path = inside(design.path, key)
        if isinstance(design[key], dict) and group in design[key]:
            path = inside(path, group)
        given = "" if key in design.stated else " (the default)"
        reading.mistake(path, f"found {number_text(values[key])}{given} for {group!r}, {message}")

    good = True
    if BAD not in (lower, upper) and lower > upper:
        key = "lower" if "lower" in design.stated else "upper"
        other = f"lower {number_text(lower)} is above upper {number_text(upper)}"
        tell(key, f"but {other}")
        return False
    if initial is not BAD:
        if lower is not BAD and initial < lower:
            tell("initial", f"allowed is at least lower {number_text(lower)}")
            good = False
        if upper is not BAD and initial > upper:
            tell("initial", f"allowed is at most upper {number_text(upper)}")
            good = False
    if BAD not in (power, lower) and power < 1.0 and not lower > 0.0:
        tell("lower", f"allowed is > 0 where power is below 1 (here {number_text(power)})")
        good = False
    return good


def build_objectives(top: Fields, frames: Frames, reading: Reading) -> tuple[Objective, ...]:
    """The objectives of the case, without those that cannot be made; mistakes are noted."""
    built = []
    for name, fields in (top["objectives"] or {}).items() if top["objectives"] is not BAD else ():
        if fields is BAD:
            continue
        response = build_response(fields, frames, reading)
        case = load_case_of(fields, top, reading)
        if response is not None and case is not None and fields.good():
            built.append(Objective(name, response, fields["over_time"], case, fields["sense"]))
    return tuple(built)


def load_case_of(fields: Fields, top: Fields, reading: Reading) -> str | None:
    """The load case of a reduced response or of a measurement; None where there is a mistake, which is noted."""
    cases, stated = top["load_cases"], fields["load_case"]
    if cases is BAD or stated is BAD:
        return None
    names = list(cases or ())
    path = inside(fields.path, "load_case")
    if stated is None:
        if len(names) > 1:
            reading.mistake(path, f"the key 'load_case' is missing; there are {listed(names)}")
            return None
        return names[0] if names else DEFAULT
    if stated == DEFAULT and names:
        reading.mistake(path, f"no load case is called 'default'; there are {listed(names)}")
        return None
    return str(stated)


def build_response(fields: Fields, frames: Frames, reading: Reading) -> Response | None:
    """The response of an objective or a constraint."""
    return response_of(fields["response"], frames, reading)


def build_constraints(
    top: Fields,
    groups: dict[str, MemberGroup] | None,
    variables: tuple[Variable, ...],
    frames: Frames,
    reading: Reading,
) -> tuple[VolumeRow | ResponseRow, ...]:
    """The constraints of the case, without those that cannot be made, checked against the bounds.

    groups: None where members could not be read.
    """
    built: list[VolumeRow | ResponseRow] = []
    volumes: list[tuple[str, VolumeRow]] = []
    for fields in top["constraints"] if isinstance(top["constraints"], list) else ():
        if fields is BAD:
            continue
        sense = next((key for key in SENSES if key in fields.stated and fields[key] is not BAD), None)
        if "response" in fields.stated and fields["response"] is not BAD:
            row = _response_row(fields, sense, top, frames, reading)
            if row is not None:
                built.append(row)
        elif "volume" in fields.stated and fields["volume"] is not BAD:
            volume = _volume_row(fields, sense, top, groups, variables, reading)
            if volume is not None:
                built.append(volume)
                if not _lengths_vary(volume, groups, variables):
                    volumes.append((inside(fields.path, sense or ""), volume))
    if groups is not None:
        check_feasible(volumes, [group for group in groups.values() if group.design], variables, reading)
    return tuple(built)


def _lengths_vary(row: VolumeRow, groups: dict[str, MemberGroup] | None, variables: tuple[Variable, ...]) -> bool:
    """Whether members of a volume row cost their length, and their ends are design variables: the volume that the row
    limits can then not be told from alpha alone."""
    moving = {each.points for each in variables if each.points}.union(*(each.moved for each in variables))
    return any(groups[name].cost_varies(moving) for name in row.groups if groups is not None and name in groups)


def _response_row(
    fields: Fields, sense: str | None, top: Fields, frames: Frames, reading: Reading
) -> ResponseRow | None:
    response = build_response(fields, frames, reading)
    case = load_case_of(fields, top, reading)
    if response is None or case is None or sense is None or not fields.good() or sense == "fraction":
        return None
    return ResponseRow(response, fields["over_time"] or DEFAULT_REDUCTION, case, fields[sense], sense)


def _volume_row(
    fields: Fields,
    sense: str | None,
    top: Fields,
    groups: dict[str, MemberGroup] | None,
    variables: tuple[Variable, ...],
    reading: Reading,
) -> VolumeRow | None:
    """The volume row of a constraint; None where it cannot be made, with the mistakes noted.

    fields: the constraint in the file.
    sense: its key with the bound: limit, equals, at_least or fraction; None where there is none that can be read.
    top: the whole file.
    groups: by name; None where members could not be read.
    variables: the case's design variables, of which some have a cost.
    reading: takes the mistakes.
    """
    stated, path = fields["volume"], inside(fields.path, "volume")
    named = [stated] if isinstance(stated, str) else stated
    good = sense is not None and not any(name is BAD for name in named)
    sections = top["members"] if isinstance(top["members"], dict) else {}
    priced = {name: None for each in variables if each.cost > 0.0 for name in (*each.groups, *each.reached)}
    for index, name in enumerate(named):
        where = path if isinstance(stated, str) else f"{path}[{index}]"
        section = sections.get(name) if name is not BAD else None
        if name is not BAD and name in named[:index]:
            reading.mistake(where, f"{shown(name)} is in the list already")
            good = False
        elif isinstance(section, Fields) and section["design"] is False and name not in priced:
            reading.mistake(where, f"{shown(name)} has `design: false`: it has no variables and no cost")
            good = False
    if stated == "all" and groups is not None and not priced and not any(g.design for g in groups.values()):
        reading.mistake(path, "no member is a design variable: there is no volume")
        good = False
    if not good or groups is None or sense is None:
        return None
    design = {name: group for name, group in groups.items() if group.design}
    names = tuple(design | priced) if stated == "all" else tuple(named)
    if not all(name in design or name in priced for name in names):
        return None
    coefficients = coefficients_of(tuple(design.values()), names)
    bound = fields[sense]
    if sense == "fraction":
        unbuilt = [name for name in names if name in design and design[name].candidates is not None]
        if unbuilt:
            message = f"a share of all candidates of {listed(unbuilt)} is not known, which are priced; "
            reading.mistake(inside(fields.path, sense), message + "allowed are limit, equals, at_least")
            return None
        bound = bound * math.fsum(float(design[name].cost.sum()) for name in names if name in design)
        if not math.isfinite(bound):
            reading.mistake(inside(fields.path, sense), "times sum V_i it is too large for a number")
            return None
    own = prices(variables, names) if priced else np.zeros(0)
    return VolumeRow(names, coefficients, bound, "limit" if sense == "fraction" else sense, own)


def build_combine(top: Fields, reading: Reading) -> Combine | None:
    """The combination; a mistake where several objectives have none, or weights are missing."""
    objectives, fields = top["objectives"], top["combine"]
    if objectives is BAD or fields is BAD:
        return None
    names = list(objectives or ())
    if fields is None:
        if len(names) > 1:
            reading.mistake("objectives", "several objectives need the key 'combine' with their weights")
        return None
    weights = fields["weights"]
    if weights is BAD:
        return None
    path = inside(fields.path, "weights")
    missing = [name for name in names if name not in weights]
    if missing:
        reading.mistake(path, f"the weight of {listed(missing)} is missing; every objective has one")
    elif any(value is BAD for value in weights.values()):
        return None
    elif not any(weights[name] > 0.0 for name in names):
        reading.mistake(path, "all weights are zero; at least one must be positive")
    elif fields.good():
        _warn_ignored(fields, reading)
        largest = max(weights[name] for name in names)
        scaled = {name: weights[name] / largest for name in names}
        total = math.fsum(scaled.values())
        shares = FrozenDict({name: value / total for name, value in scaled.items()})
        return Combine(fields["method"], shares, fields["exponent"], fields["normalize"])
    return None


def _warn_ignored(fields: Fields, reading: Reading) -> None:
    method = fields["method"]
    kind = SCALARISATIONS[method]
    if "exponent" in fields.stated and not kind.takes_exponent:
        reading.warning(inside(fields.path, "exponent"), f"the method {method} ignores exponent")
    if "normalize" in fields.stated and fields["normalize"] and not kind.scaled:
        message = f"the method {method} ignores normalize: it takes raw values"
        reading.warning(inside(fields.path, "normalize"), message)
