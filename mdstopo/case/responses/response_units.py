"""Units of responses, for axes and attributes."""

from typing import TYPE_CHECKING

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.objects.problem_parts import ReducedResponse, Response, ResponseRow, VolumeRow
from mdstopo.case.responses.response_kinds import kind_of

if TYPE_CHECKING:
    from mdstopo.case.model import Case

#: how a constraint bounds its value, in words
BOUNDED = {"limit": "at most", "equals": "equal to", "at_least": "at least"}


def unit_of(response: Response) -> str:
    """The unit of a response; that of an expression as the case states it, `-` where it does not."""
    return response.unit or kind_of(response).unit


def unit_of_value(reduced: ReducedResponse) -> str:
    """The unit of a response reduced over time."""
    return REDUCTIONS[reduced.over_time].unit_from(unit_of(reduced.response))


def words(response: Response) -> str:
    """A response in words: `displacement x of torso relative to vehicle`."""
    if response.formula:
        return response.formula
    parts = [response.kind.replace("_", " ")]
    if response.component not in (None, "norm"):
        parts.append(str(response.component))
    for key, value in (("of", response.body or response.joint), ("in", response.group)):
        if value is not None:
            parts.append(f"{key} {value}")
    if response.relative_to not in (None, "ground"):
        parts.append(f"relative to {response.relative_to}")
    if response.since == "settled":
        parts.append("since it has settled")
    return " ".join(parts)


def constrained(case: "Case", row: VolumeRow | ResponseRow) -> str:
    """What a constraint bounds, in words: `volume of belts`, `max displacement x of torso, braking`."""
    if isinstance(row, VolumeRow):
        return f"volume of {', '.join(row.groups)}"
    where = f", {row.load_case}" if len(case.load_cases) > 1 else ""
    return f"{row.over_time} {words(row.response)}{where}"


def unit_of_bound(row: VolumeRow | ResponseRow) -> str:
    """The unit of a constraint's value; empty of a volume, and of an expression whose unit the case does not state."""
    return "" if isinstance(row, VolumeRow) else unit_of_value(row).removeprefix("-")


def bounded(row: VolumeRow | ResponseRow) -> str:
    """The bound of a constraint, in words: `at most 0.1 m`."""
    return f"{BOUNDED[row.sense]} {row.bound:.9g} {unit_of_bound(row)}".rstrip()
