"""Times at which expressions of responses have kinks or jumps by time alone, as that of step(t - 2).

Segments end there, as at kinks of loads: such a time is given, and nobody has to look for it along the motion.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from mdstopo.case.methods.over_time import ReductionKind
from mdstopo.case.model import LoadCase, Response
from mdstopo.case.responses.expression_response import program_of
from mdstopo.compiler.formulas import FormulaCalls, address_of
from mdstopo.formula.response_formulas import ResponseProgram
from mdstopo.general.responses.sampled_roots import roots_on_grid
from mdstopo.general.scene.timed_loads import PARTS
from mdstopo.scene.springs_model import FloatArray


def switch_times(
    responses: Sequence[Response], reductions: Sequence[ReductionKind], load_case: LoadCase
) -> list[float]:
    """The times (s) within a load case at which responses that are evaluated in it switch by time alone; of those whose
    last value alone is asked for none."""
    found: list[float] = []
    for response, reduction in zip(responses, reductions, strict=True):
        if response.of and not reduction.at_end:
            program = program_of(response)
            numbers = np.array([*[0.0] * len(response.of), *(value for _, value in response.parameters)])
            for switch in np.flatnonzero(program.by_time_alone).tolist():
                found += _roots(program, numbers, switch, (load_case.start, load_case.end))
    return found


def _roots(program: ResponseProgram, numbers: FloatArray, switch: int, span: tuple[float, float]) -> Iterator[float]:
    """Where the margin of a switch vanishes.

    program: the formula. numbers: of responses, which do not matter, and of parameters.
    switch: which one. span: between which times (s).
    """
    calls, group = FormulaCalls(float(address_of(program.groups)), numbers), program.margin_group(switch)
    grid = np.linspace(*span, PARTS + 1)

    def margins(times: FloatArray) -> FloatArray:
        return np.array([calls.numbers(0.0, 0.0, time, 0.0, 0, group)[:2] for time in times.tolist()])

    values, rates = margins(grid).T
    return roots_on_grid(grid, values, rates, lambda times: margins(times)[:, 0])
