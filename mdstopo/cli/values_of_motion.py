"""What objectives and constraints of a case come to with one design, as `simulate` tells it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mdstopo.cli.output import number

if TYPE_CHECKING:
    from mdstopo.case.model import Case, FloatArray, ResponseRow, VolumeRow
    from mdstopo.engine import Evaluator


@dataclass(frozen=True)
class Values:
    """Values of one design, objectives by name, constraints by their place in the case.

    objectives: value and the time of its peak (s; NaN of an integral or a mean). constraints: values. failure: why
    responses have none, empty where they have.
    """

    objectives: "dict[str, tuple[float, float]]"
    constraints: dict[int, float]
    failure: str = ""


def values_of(case: "Case", engine: "Evaluator", design: "FloatArray", load_cases: Sequence[str]) -> Values:
    """Values of what looks at these load cases, and of volumes, with a design (N + P,); of the case as it is written
    where numbers are uncertain."""
    from mdstopo.case.model import ResponseRow, VolumeRow
    from mdstopo.engine import Evaluator
    from mdstopo.scene.moving_volumes import spent

    design = engine.design(design)
    stated = list(enumerate(case.constraints))
    volumes = {i: spent(case, row, design) for i, row in stated if isinstance(row, VolumeRow)}
    objectives = tuple(each for each in case.objectives if each.load_case in load_cases)
    rows = {i: row for i, row in stated if isinstance(row, ResponseRow) and row.load_case in load_cases}
    if not objectives and not rows:
        return Values({}, volumes)
    if set(load_cases) != {each.name for each in case.load_cases}:
        engine = Evaluator(replace(case, objectives=objectives, constraints=tuple(rows.values())), in_background=False)
        found = engine.evaluate(design, gradient=False)
        excess = dict(zip(rows, found.constraints.tolist(), strict=True))
    else:
        found = engine.evaluate(design, gradient=False)
        excess = {i: float(found.constraints[i]) for i in rows}
    if not found.status.usable:
        return Values({}, volumes, f"{found.status.value} {found.message}".rstrip())
    constraints = volumes | {i: excess[i] + row.bound for i, row in rows.items()}
    return Values(
        {each.name: (found.objectives[each.name], found.peak_times[each.name]) for each in objectives},
        dict(sorted(constraints.items())),
    )


def is_kept(row: "VolumeRow | ResponseRow", value: float, tolerance: float) -> bool:
    """Whether a value keeps its bound, up to that share of it."""
    excess = {"limit": value - row.bound, "at_least": row.bound - value, "equals": abs(value - row.bound)}[row.sense]
    return excess <= tolerance * (abs(row.bound) or 1.0)


def rows_of(case: "Case", found: Values) -> list[list[str]]:
    """The values as rows of a table."""
    from mdstopo.case.responses.response_units import bounded, constrained, unit_of_value, words

    rows = []
    for each in case.objectives:
        if each.name in found.objectives:
            value, time = found.objectives[each.name]
            when = "" if math.isnan(time) else f" at {number(time)} s"
            unit = unit_of_value(each).removeprefix("-")
            shown = f"{number(value, 9)} {unit}".rstrip()
            rows.append([each.name, f"{shown}, {each.over_time} {words(each.response)}{when}"])
    for i, value in found.constraints.items():
        row = case.constraints[i]
        broken = "" if is_kept(row, value, case.optimizer.tolerance) else ": not kept"
        rows.append([constrained(case, row), f"{number(value, 9)}, {bounded(row)}{broken}"])
    if found.failure:
        rows.append(["responses", f"not known: {found.failure}"])
    return rows


def document_of(case: "Case", found: Values) -> dict[str, Any]:
    """The values for JSON."""
    from mdstopo.case.responses.response_units import BOUNDED, constrained, unit_of_bound, unit_of_value

    units = {each.name: unit_of_value(each) for each in case.objectives}
    return {
        "objectives": {
            name: {"value": value, "unit": units[name], "time": time}
            for name, (value, time) in found.objectives.items()
        },
        "constraints": [
            {
                "constraint": i,
                "what": constrained(case, case.constraints[i]),
                "value": value,
                "unit": unit_of_bound(case.constraints[i]),
                "sense": BOUNDED[case.constraints[i].sense],
                "bound": case.constraints[i].bound,
                "kept": is_kept(case.constraints[i], value, case.optimizer.tolerance),
            }
            for i, value in found.constraints.items()
        ],
    } | ({"responses": f"not known: {found.failure}"} if found.failure else {})
