"""The case that is simulated for a fit: responses are what was measured, nothing is designed, numbers are put in."""

from collections.abc import Sequence
from dataclasses import replace

from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.model import Case, MemberGroup, Objective, Variable
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.words import inside
from mdstopo.scene.springs_model import FloatArray

#: a parameter of a law: group, place of the law, parameter
LawPlace = tuple[str, int, str]


def case_at(case: Case, keys: Sequence[str], x: FloatArray) -> Case:
    """The case with other numbers at some keys, prepared. Raises CaseError at the key in `fit` that is to blame."""
    values = {key: float(value) for key, value in zip(keys, x, strict=True)}
    try:
        changed = read_case(case.text, path=case.path, overrides={**case.overrides, **values})
    except CaseError as error:
        told: list[Mistake] = []
        for mistake in error.mistakes:
            stated = mistake.path_key
            blamed = [key for key in values if key == stated or key.startswith((f"{stated}.", f"{stated}["))]
            if stated and blamed:
                at = ", ".join(f"{values[key]:.10g}" for key in blamed)
                place, words = inside("fit.estimate", blamed[0]), f"at {at}: {mistake.message}"
            else:
                place, words = stated, mistake.message
            told.append(case.marks.mistake(place, words))
        raise CaseError(told, error.file) from None
    return prepared(changed)


def prepared(case: Case) -> Case:
    """The case with the measured responses alone, with its design variables at their initial values."""
    assert case.fit is not None
    # the reduction is never computed: one that only kernels of general scenes have makes the case such a scene
    general = next(kind.name for kind in REDUCTIONS.values() if not kind.springs)
    objectives = tuple(Objective(each.name, each.response, general, each.load_case) for each in case.fit.series)
    return replace(
        case,
        members=tuple(_at_initial_values(case, group) for group in case.members),
        objectives=objectives,
        combine=None,
        constraints=(),
        uncertainty=None,
        variables=(),
        movable=(),
        follows=None,
    )


def _at_initial_values(case: Case, group: MemberGroup) -> MemberGroup:
    """The group with the initial values of design variables in its laws."""
    laws = list(group.laws)
    for variable in case.variables:
        for name, place in zip(variable.groups, variable.laws, strict=True):
            if name == group.name:
                laws[place] = replace(laws[place], **{variable.parameter: float(variable.initial)})
    return replace(group, laws=tuple(laws))


def varying(case: Case, places: Sequence[LawPlace]) -> Case:
    """A prepared case in which parameters of laws are variables, in this order."""
    groups = {group.name: group for group in case.members}
    variables = []
    for number, (group, law, parameter) in enumerate(places):
        value = float(getattr(groups[group].laws[law], parameter))
        name = f"p{number}"
        variables.append(Variable(name, (group,), (law,), parameter, "group", 1, value, value, value))
    return replace(case, variables=tuple(variables))
