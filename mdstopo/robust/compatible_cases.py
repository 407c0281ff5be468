"""Whether a point of a sample poses the same problem as its case: designs and reduced responses are alike."""

from collections.abc import Iterator

import numpy as np

from mdstopo.case.model import Case, Objective, Response, ResponseRow, VolumeRow


def other_problem(case: Case, made: Case) -> str:
    """What the case at a point has otherwise than the case, though designs have to fit both; empty where nothing is."""
    return next(_members(case, made), "") or next(_rows(case, made), "")


def _members(case: Case, made: Case) -> Iterator[str]:
    for stated, found in zip(case.members, made.members, strict=False):
        if stated.name != found.name:
            break
        if len(stated) != len(found):
            yield f"the group {stated.name} has {len(found)} members, not {len(stated)}: a design would not fit both"
        elif not (
            np.array_equal(stated.from_index, found.from_index) and np.array_equal(stated.to_index, found.to_index)
        ):
            yield f"the group {stated.name} has as many members, but others: a design would not fit both"
        if stated.design != found.design:
            now = "designed" if found.design else "fixed"
            yield f"the group {stated.name} is {now}, which it is not in the case: a design would not fit both"
    if [group.name for group in case.members] != [group.name for group in made.members]:
        yield "groups of members are missing, new, or in another order"
    groups = {group.name: group for group in made.members}
    moving = {variable.name: variable for variable in made.variables if variable.points}
    for variable in case.variables:
        twin = moving.get(variable.name)
        if variable.points and not (twin and np.array_equal(variable.initials, twin.initials)):
            yield (
                f"points {variable.points} are set, but they are movable: the design states {variable.name}, not the "
                "sample"
            )
    for variable in case.variables:
        for name, place in zip(variable.groups, variable.laws, strict=True):
            own = next(group for group in case.members if group.name == name)
            if getattr(own.laws[place], variable.parameter) != getattr(groups[name].laws[place], variable.parameter):
                yield (
                    f"{variable.parameter} of {name} is set, but it is the design variable {variable.name}, "
                    "whose value the design states"
                )


def _rows(case: Case, made: Case) -> Iterator[str]:
    objectives = {objective.name: objective for objective in made.objectives}
    for stated in case.objectives:
        found = objectives.get(stated.name)
        if found is None:
            yield f"the objective {stated.name} is missing"
        elif _asked(stated) != _asked(found):
            yield f"the objective {stated.name} asks for something else than in the case"
    if len(case.constraints) != len(made.constraints):
        yield f"there are {len(made.constraints)} constraints, not {len(case.constraints)}"
    for i, (row, other) in enumerate(zip(case.constraints, made.constraints, strict=False)):
        if _limited(row) != _limited(other):
            yield f"constraints[{i}] limits something else than in the case, or otherwise"


def _asked(objective: Objective) -> tuple[object, ...]:
    return _seen(objective.response), objective.over_time, objective.load_case, objective.sense


def _limited(row: VolumeRow | ResponseRow) -> tuple[object, ...]:
    """All of a constraint but numbers that may be uncertain: a bound on a response."""
    if isinstance(row, VolumeRow):
        return row.groups, row.sense
    return _seen(row.response), row.over_time, row.load_case, row.sense


def _seen(response: Response) -> tuple[object, ...]:
    """A response without the place of its point on the body."""
    of = response
    parts = tuple((name, _seen(each)) for name, each in of.of)
    return of.kind, of.body, of.relative_to, of.component, of.group, of.joint, of.since, of.formula, parts
