"""What the format allows and the engine cannot compute, or not with the chosen method: refused by name and place."""

from __future__ import annotations

from collections.abc import Iterator

from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.methods.sensitivities import chosen, having
from mdstopo.case.model import Case, MemberGroup, ReducedResponse, Response, ResponseRow, VolumeRow
from mdstopo.case.scene.candidates import mirrored_groups
from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.words import listed, number_text, shown
from mdstopo.scene.family import beyond_collocation, beyond_springs
from mdstopo.scene.moving_volumes import moving_volumes
from mdstopo.settings.optimizers import OPTIMIZERS


def no_derivatives(case: Case, method: str) -> tuple[str, str]:
    """The place of a design variable by which a method does not differentiate, and why not."""
    if all(each.points for each in case.variables):
        place, what = f"points.{case.movable[0].grid}.movable", "coordinates of points"
    else:
        named = not any(each.groups for each in case.variables)
        place, what = "design.variables", "defined names" if named else "parameters of laws"
    does = ", and ".join(f"{name} does" if not i else name for i, name in enumerate(having("by_parameters")))
    return place, f"{method} gives no derivatives by {what}; {does}"


def refusals(case: Case) -> list[Mistake]:
    """Every part of `case` that the engine cannot compute, each at its place in the file."""
    found = [case.marks.mistake(path, what) for path, what in _refused(case)]
    return sorted(found, key=lambda mistake: (bool(mistake.origin), mistake.line, mistake.column))


def _refused(case: Case) -> Iterator[tuple[str, str]]:
    beyond = beyond_springs(case)
    solver = case.solver
    kind = INTEGRATORS.get(solver.integrator)
    if kind is not None and beyond and kind.free_only:
        refused = beyond_collocation(case)
    elif kind is not None and kind.planar and case.dimension > 2:
        refused = "bodies in space"
    else:
        goes = kind is None or (kind.general if beyond else kind.springs)
        refused = "" if goes else beyond or "springs between free bodies"
    if kind is not None and refused:
        what = refused
        yield "solver.integrator", f"{kind.name} does not compute {what}; runge_kutta does, and auto takes it"
    if kind is not None and not (kind.adaptive or kind.finds_step) and solver.step is None:
        yield "solver.integrator", f"{kind.name} needs a `step`, which is not given"
    optimizer = OPTIMIZERS[case.optimizer.name]
    moving = moving_volumes(case)
    for i, row in enumerate(case.constraints):
        volume = isinstance(row, VolumeRow) and i not in moving
        needed = "takes_volumes" if volume else "takes_limits"
        if not getattr(optimizer, needed):
            others = " or ".join(kind.name for kind in OPTIMIZERS.values() if getattr(kind, needed))
            what = "volumes" if volume else "sums of lengths that vary" if i in moving else "responses"
            yield f"constraints[{i}]", f"the optimiser {optimizer.name} takes no limits on {what}; {others} does"
    if case.variables and not chosen(solver.sensitivity).by_parameters:
        yield "solver.sensitivity", no_derivatives(case, solver.sensitivity)[1]
    for group in case.priced_groups:
        yield from _unpriced(case, group)
    for path, response in _responses(case):
        if response.since == "settled" and not solver.settle:
            yield f"{path}.response.{response.kind}.since", "settled needs `solver: {settle: true}`"
        for name, part in response.of:
            if part.since == "settled":
                key = f"{path}.response.expression.of.{name}.{part.kind}.since"
                yield key, "within an expression displacements count from where the case has them: stated"
            if part.group is not None:
                yield from _several_members(case, part.group, f"{path}.response.expression.of.{name}.{part.kind}.group")


def _several_members(case: Case, name: str, path: str) -> Iterator[tuple[str, str]]:
    """A group in an expression that has not one member: the largest force of several is not followed there."""
    group = next(group for group in case.members if group.name == name)
    count = len(group.length) if group.candidates is None else group.candidates.count
    if count != 1:
        yield path, f"found {shown(name)} with {count} members; allowed in an expression are groups of one member"


def rows_of_responses(case: Case) -> Iterator[tuple[str, ReducedResponse]]:
    """The objectives, and the constraints on responses, with their key paths."""
    yield from ((f"objectives.{each.name}", each) for each in case.objectives)
    for i, row in enumerate(case.constraints):
        if isinstance(row, ResponseRow):
            yield f"constraints[{i}]", row


def _responses(case: Case) -> Iterator[tuple[str, Response]]:
    """All responses of a case, with the key path of the objective or constraint that has them."""
    yield from ((path, row.response) for path, row in rows_of_responses(case))
    if case.fit is not None:
        yield from ((f"fit.measured.{each.name}", each.response) for each in case.fit.series)


def _unpriced(case: Case, group: MemberGroup) -> Iterator[tuple[str, str]]:
    """What does not go with candidates that are priced."""
    name = group.name
    if group.lower != 0.0:
        yield (
            "design.lower",
            f"found {number_text(group.lower)} for {name!r}, allowed is 0 where candidates are priced: "
            "one that is not built is one with alpha = 0",
        )
    if group.power != 1.0 or group.powers:
        yield (
            "design.power",
            f"found {number_text(group.power)} for {name!r}, allowed is 1 where candidates are priced: "
            "with another power the slope at alpha = 0 is zero or infinite",
        )
    if not len(group):
        yield (
            f"members.{name}",
            "no candidate of a coarse subset of the points, with which a run begins, is within the stated lengths",
        )
    where = f"members.{name}.candidates"
    tied = {each.name for groups in mirrored_groups(case) if group in groups for each in groups}
    if tied & set(case.shared):
        yield where, "priced does not go with design.shared of the group: all candidates would have one alpha"
    if case.variables:
        yield where, "priced does not go with design.variables"
    if case.solver.settle:
        yield where, "priced does not go with static settling: a little of any candidate moves the start"
    if not chosen(case.solver.sensitivity).of_candidates:
        needed = listed(having("of_candidates"))
        yield where, f"priced needs sensitivity: {needed}, not {case.solver.sensitivity}"
