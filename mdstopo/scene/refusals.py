"""What the format allows and the engine cannot compute yet, refused by name and place."""

from __future__ import annotations

from collections.abc import Iterator

from mdstopo.case.errors import Mistake
from mdstopo.case.model import Case, MemberGroup, Response, ResponseRow

LAWS = frozenset({"spring"})
RESPONSES = frozenset({"energy"})
OVER_TIME = frozenset({"max", "min", "mean", "integral", "final"})


def refusals(case: Case, optimizing: bool = False) -> list[Mistake]:
    """Every part of `case` that the engine cannot compute yet, each at its place in the file.

    optimizing: whether an optimisation is asked for, which needs a single objective and volume rows only.
    """
    found = [
        case.marks.mistake(path, f"{what} not computed yet") for path, what in _refused(case, optimizing)
    ]
    return sorted(found, key=lambda mistake: (bool(mistake.origin), mistake.line, mistake.column))


def _refused(case: Case, optimizing: bool) -> Iterator[tuple[str, str]]:
    for joint in case.joints:
        yield f"joints[{joint.index}]", f"joints ({joint.type}) are"
    for bushing in case.bushings:
        yield f"bushings[{bushing.index}]", "bushings are"
    yield from _motions(case)
    for group in case.members:
        yield from _laws(case, group)
    for objective in case.objectives:
        path = f"objectives.{objective.name}"
        yield from _response(objective.response, f"{path}.response")
        if objective.over_time not in OVER_TIME:
            yield f"{path}.over_time", f"over_time: {objective.over_time} is"
    for index, row in enumerate(case.constraints):
        if isinstance(row, ResponseRow):
            yield f"constraints[{index}]", "constraints on a response are"
    if optimizing and len(case.objectives) > 1:
        path = "combine" if "combine" in case.marks else "objectives"
        yield path, "an optimisation of several objectives is"
    if case.solver.assemble:
        yield "solver.assemble", "assemble: true is"


def _motions(case: Case) -> Iterator[tuple[str, str]]:
    told = False
    if "motions[0]" in case.marks:
        told = True
        yield "motions", "prescribed motions are"
    for load_case in case.load_cases:
        path = f"load_cases.{load_case.name}.motions"
        if f"{path}[0]" in case.marks:
            told = True
            yield path, "prescribed motions are"
    if not told and any(load_case.motions for load_case in case.load_cases):
        yield "motions", "prescribed motions are"


def _laws(case: Case, group: MemberGroup) -> Iterator[tuple[str, str]]:
    path = f"members.{group.name}.law"
    if len(group.laws) > 1:
        yield path, "a list of laws (a multi-functional member) is"
    for index, law in enumerate(group.laws):
        each = f"{path}[{index}]" if f"{path}[{index}]" in case.marks else path
        if law.type not in LAWS:
            yield f"{each}.type", f"the law {law.type} is"
        for key in ("active_from", "active_until"):
            if getattr(law, key) is not None:
                yield f"{each}.{key}", f"{key} is"


def _response(response: Response, path: str) -> Iterator[tuple[str, str]]:
    if response.kind not in RESPONSES:
        yield path, f"the response {response.kind} is"
