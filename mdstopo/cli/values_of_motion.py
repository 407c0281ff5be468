"""What objectives and constraints of a case come to with one design, as `simulate` tells it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mdstopo.cli.output import number

if TYPE_CHECKING:
    from mdstopo.case.model import Case, FloatArray, ResponseRow, VolumeRow
    from mdstopo.evaluation import MotionValues

#: groups of a volume row from which on a table names the first two
MANY_GROUPS = 4


@dataclass(frozen=True)
class Values:
    """Values of one design, objectives by name, constraints by their place in the case.

    objectives: value and the time of its peak (s; NaN of an integral or a mean). constraints: values. failure: why
    responses have none, empty where they have.
    """

    objectives: "dict[str, tuple[float, float]]"
    constraints: dict[int, float]
    failure: str = ""


def values_of(case: "Case", design: "FloatArray", evaluated: "Sequence[MotionValues]") -> Values:
    """Values of what looks at the load cases that were simulated, and of volumes; of the case as it is written where
    numbers are uncertain.

    design (N + P,): the design. evaluated: of each of these load cases.
    """
    from mdstopo.case.model import VolumeRow
    from mdstopo.scene.moving_volumes import spent

    volumes = {i: spent(case, row, design) for i, row in enumerate(case.constraints) if isinstance(row, VolumeRow)}
    for each in evaluated:
        if not each.status.usable:
            return Values({}, volumes, f"{each.status.value} {each.message}".rstrip())
    peaks = {key: peak for each in evaluated for key, peak in each.peaks.items()}
    objectives = {each.name: peaks[each.name] for each in case.objectives if each.name in peaks}
    keys = {i: f"constraints[{i}]" for i in range(len(case.constraints))}
    constraints = volumes | {i: peaks[key].value for i, key in keys.items() if key in peaks}
    return Values(
        {name: (peak.value, peak.time) for name, peak in objectives.items()}, dict(sorted(constraints.items()))
    )


def is_kept(row: "VolumeRow | ResponseRow", value: float, tolerance: float) -> bool:
    """Whether a value keeps its bound, up to that share of it."""
    import numpy as np

    from mdstopo.starts.constraint_columns import exceeded

    excess = float(exceeded(row.sense, np.array(value - row.bound)))
    return excess <= tolerance * (abs(row.bound) or 1.0)


def group_names(row: "VolumeRow") -> str:
    """The groups of a volume row, of many the first two: a final case has one for each member, and no line for all."""
    if len(row.groups) <= MANY_GROUPS:
        return ", ".join(row.groups)
    return f"{', '.join(row.groups[:2])} and {len(row.groups) - 2} more groups"


def bounded_name(case: "Case", row: "VolumeRow | ResponseRow") -> str:
    """What a constraint bounds, for a table: `volume of belts`, `max displacement x of torso, braking`."""
    from mdstopo.case.model import VolumeRow
    from mdstopo.case.responses.response_units import constrained

    return f"volume of {group_names(row)}" if isinstance(row, VolumeRow) else constrained(case, row)


def rows_of(case: "Case", found: Values) -> list[list[str]]:
    """The values as rows of a table."""
    from mdstopo.case.responses.response_units import bounded, unit_of_value, words

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
        rows.append([bounded_name(case, row), f"{number(value, 9)}, {bounded(row)}{broken}"])
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
