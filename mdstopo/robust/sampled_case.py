"""The case at a point of a sample: its text read once more, with the point's values."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from mdstopo.case.model import Case, Uncertainty
from mdstopo.case.reader import read_case
from mdstopo.case.scene.candidates import pairs_of, with_members
from mdstopo.case.text.errors import CaseError, Mistake
from mdstopo.case.text.words import inside
from mdstopo.engine import Evaluator
from mdstopo.robust.compatible_cases import other_problem
from mdstopo.robust.sample import Sample
from mdstopo.scene.family import beyond_springs
from mdstopo.scene.refusals import refusals

#: numbers of a point that are told in a message
_TOLD = 4


def nominal_case(case: Case) -> Case:
    """The case as it is written, without anything uncertain."""
    return replace(case, uncertainty=None)


def case_at(case: Case, sample: Sample, i: int) -> Case:
    """The case at point i. Raises CaseError, at the section's place, where it would be no case, or another problem."""
    own = values_by_key(_uncertainty(case), sample, i)
    # those of the point come last, also where one of the same key came earlier
    overrides: dict[str, Any] = {key: value for key, value in case.overrides.items() if key not in own} | own
    try:
        made = read_case(case.text, path=case.path, overrides=overrides, without=("uncertainty",))
    except CaseError as error:
        raise _refused(case, sample, i, error.mistakes) from None
    made = with_members(made, pairs_of(case)) if case.priced_groups else made
    other = other_problem(case, made)
    if other:
        raise _refused(case, sample, i, [Mistake("", other, 1, 1)])
    names = {objective.name for objective in case.objectives}
    made = replace(
        made,
        objectives=tuple(objective for objective in made.objectives if objective.name in names),
        solver=case.solver,
        optimizer=case.optimizer,
        warnings=(),
    )
    refused = refusals(made)
    if refused:
        raise _refused(case, sample, i, refused)
    return made


def evaluator_at(case: Case, sample: Sample, i: int) -> Evaluator:
    """The evaluator of point i, ready to run. Raises CaseError as `case_at`, also for joints that do not fit there."""
    there = case_at(case, sample, i)
    try:
        made = Evaluator(there, in_background=False, beyond=beyond_of(case))
        for load_case in made.scenes if made.beyond else ():
            made.driver(load_case)
    except CaseError as error:
        raise _refused(case, sample, i, error.mistakes) from None
    return made


def nominal_evaluator(case: Case, in_background: bool = True) -> Evaluator:
    """The evaluator of the case as it is written; in_background: as of `Evaluator`."""
    return Evaluator(nominal_case(case), in_background, beyond=beyond_of(case))


def beyond_of(case: Case) -> str:
    """Why the points of an uncertain case need the general kernels, where one alone does not: all have to be priced
    together."""
    return beyond_springs(case) if case.priced_groups else ""


def values_by_key(uncertainty: Uncertainty, sample: Sample, i: int) -> dict[str, Any]:
    """Keys of the case and their values at point i: those of its scenario, then those of uncertain numbers."""
    place = int(sample.scenario[i])
    stated: dict[str, Any] = dict(uncertainty.scenarios[place].values) if place >= 0 else {}
    numbers = zip(uncertainty.numbers, sample.values[i].tolist(), strict=True)
    return stated | {number.key: value for number, value in numbers}


def name_of(case: Case, sample: Sample, i: int) -> str:
    """Point i of a sample in words, with its values."""
    uncertainty = _uncertainty(case)
    place = int(sample.scenario[i])
    parts = [f"scenario {uncertainty.scenarios[place].name}"] if place >= 0 else []
    pairs = list(zip(uncertainty.numbers, sample.values[i].tolist(), strict=True))
    parts += [f"{number.key} = {value:.6g}" for number, value in pairs[:_TOLD]]
    parts += ["..."] if len(pairs) > _TOLD else []
    return f"at point {i} of the sample ({', '.join(parts)})"


def _uncertainty(case: Case) -> Uncertainty:
    assert case.uncertainty is not None
    return case.uncertainty


def _refused(case: Case, sample: Sample, i: int, mistakes: Sequence[Mistake]) -> CaseError:
    """The mistakes that only a point has, at the place of what makes it."""
    place = int(sample.scenario[i])
    numbers = {number.key for number in _uncertainty(case).numbers}
    default = "uncertainty.parameters"
    if not sample.values.shape[1]:
        default = f"uncertainty.scenarios.{_uncertainty(case).scenarios[place].name}"
    found = []
    for mistake in mistakes:
        path = inside("uncertainty.parameters", mistake.path_key) if mistake.path_key in numbers else default
        if place >= 0 and mistake.path_key in _uncertainty(case).scenarios[place].values:
            path = f"uncertainty.scenarios.{_uncertainty(case).scenarios[place].name}"
        key = f"{mistake.path_key}: " if mistake.path_key else ""
        found.append(case.marks.mistake(path, f"{name_of(case, sample, i)}: {key}{mistake.message}"))
    return CaseError(found, str(case.path or case.name))
