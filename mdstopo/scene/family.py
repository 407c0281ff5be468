"""Which family of kernels a case needs: that of springs between free bodies, or the general one."""

from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.methods.sensitivities import chosen
from mdstopo.case.model import Case, MemberGroup, ResponseRow, SpringLaw
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.scene.candidates import mirrored_groups
from mdstopo.scene.signal_segments import formulas_of


def beyond_springs(case: Case) -> str:
    """What in the case only the general kernels compute, in words; empty where nothing is."""
    if case.dimension > 2:
        return "bodies in space"
    if case.joints:
        return "joints"
    if case.solver.settle:
        return "static settling"
    if not chosen(case.solver.sensitivity).comes_with_values:
        return f"the sensitivity method {case.solver.sensitivity}"
    kind = INTEGRATORS.get(case.solver.integrator)
    if kind is not None and kind.general and not kind.springs:
        return f"the integrator {kind.name}"
    if case.contacts:
        return "contacts"
    if case.bushings:
        return "bushings"
    if any(load_case.motions for load_case in case.load_cases):
        return "prescribed motions"
    if any(formulas_of(load_case) for load_case in case.load_cases):
        return "loads that are formulas of time"
    if case.priced_groups and case.uncertainty is not None:
        return "priced candidates of an uncertain case"
    if any(len(groups) > 1 for groups in mirrored_groups(case)):
        return "priced candidates of mirrored groups"
    if case.variables:
        if all(each.points for each in case.variables):
            return "movable points"
        if all(each.points or each.defined for each in case.variables):
            return "design variables of defined names"
        return "design variables of laws"
    for group in case.members:
        found = _law(group)
        if found:
            return found
    for objective in case.objectives:
        if not kind_of(objective.response).is_energy:
            return f"the response {objective.response.kind}"
        if not REDUCTIONS[objective.over_time].springs:
            return f"over_time: {objective.over_time}"
    if any(isinstance(row, ResponseRow) for row in case.constraints):
        return "constraints on a response"
    return ""


def beyond_collocation(case: Case) -> str:
    """What in the case cannot be computed in steps of collocation, in words; empty where nothing is: bodies have to be
    free, and forces smooth."""
    if case.joints:
        return "joints"
    if case.contacts:
        return "contacts"
    if any(load_case.motions for load_case in case.load_cases):
        return "prescribed motions"
    for group in case.members:
        for law in group.laws:
            if not law.is_smooth:
                return f"the law {law.type}"
    return ""


def collocates(case: Case) -> bool:
    """Whether a case can be computed in steps of collocation: free bodies, smooth forces."""
    return not beyond_collocation(case)


def _law(group: MemberGroup) -> str:
    if len(group.laws) > 1:
        return "a list of laws"
    for law in group.laws:
        if not isinstance(law, SpringLaw):
            return f"the law {law.type}"
        if law.active_from is not None or law.active_until is not None:
            return "a law that acts for a time"
    return ""
