"""Units of responses, for axes and attributes."""

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.objects.aims import Objective, Response, ResponseRow
from mdstopo.case.responses.response_kinds import kind_of


def unit_of(response: Response) -> str:
    """The unit of a response; that of an expression as the case states it, `-` where it does not."""
    return response.unit or kind_of(response).unit


def unit_of_value(aim: Objective | ResponseRow) -> str:
    """The unit of a response reduced over time."""
    return REDUCTIONS[aim.over_time].unit_from(unit_of(aim.response))


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
