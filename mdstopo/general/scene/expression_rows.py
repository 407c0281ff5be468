"""Expressions of responses as rows of `GeneralModel.response`, with their data among those of laws."""

from mdstopo.case.objects.problem_parts import Response
from mdstopo.case.responses.expression_response import program_of
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.compiler.formulas import address_of
from mdstopo.general.model.expressions import BALANCED, BY_STATE, ENERGETIC, EXPRESSION, FORCED, ROOT, TIMED
from mdstopo.general.responses.general_responses import LISTED, code_of


def expression_codes(response: Response, first: int) -> list[int]:
    """The integers that describe an expression to kernels; first: place of the first of the responses that it is of."""
    kinds = [kind_of(each) for each in response.parts]
    kernels = [LISTED[code_of(kind)] for kind in kinds]
    made = program_of(response)
    known = 0
    for holds, bit in (
        (any(each.needs_accelerations for each in kernels), BALANCED),
        (all(each.by_state for each in kernels), BY_STATE),
        (made.is_norm, ROOT),
        (any(kind.is_energy for kind in kinds), ENERGETIC),
        (made.is_timed, TIMED),
        (any(kind.of_members for kind in kinds), FORCED),
    ):
        known += bit if holds else 0
    return [EXPRESSION, first, len(kinds), known, max(kind.order for kind in kinds), made.switches]


def expression_data(response: Response) -> list[float]:
    """The numbers that describe an expression to kernels: where its formulas are, groups of slopes, and its
    parameters."""
    made = program_of(response)
    numbers = [value for _, value in response.parameters]
    return [float(address_of(made.groups)), float(made.parts), float(len(numbers)), *numbers]
