"""One point of a sample tried with one design, and forgotten."""

from dataclasses import dataclass

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.text.errors import CaseError
from mdstopo.evaluation import FloatArray
from mdstopo.robust.sample import Sample
from mdstopo.robust.sampled_case import evaluator_at, name_of


@dataclass(frozen=True)
class Trial:
    """A design tried at one point: objectives (m,), raw; responses (n_con,): what constraints bound, less the bound;
    NaN, and the reason, where it cannot be computed."""

    objectives: FloatArray
    responses: FloatArray
    reason: str = ""


def tried(case: Case, sample: Sample, i: int, alpha: FloatArray) -> Trial:
    """The case at point i of a sample, evaluated at the design alpha (N,)."""
    lost = np.full(len(case.objectives), np.nan), np.full(len(case.constraints), np.nan)
    try:
        found = evaluator_at(case, sample, i).evaluate(alpha, gradient=False)
    except CaseError as error:
        return Trial(*lost, error.mistakes[0].message)
    if not found.status.usable:
        words = found.status.value + (f" ({found.message})" if found.message else "")
        return Trial(*lost, f"{words}, {name_of(case, sample, i)}")
    return Trial(np.array([found.objectives[each.name] for each in case.objectives]), found.constraints)
