"""How the value of a response comes from what it is formed of: as it is, as an absolute value, or as a norm."""

from mdstopo.case.methods.over_time import ReductionKind
from mdstopo.evaluation import Shape
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.responses.general_responses import has_norm, is_absolute


def shape_of(model: GeneralModel, j: int, reduction: ReductionKind) -> Shape:
    """How the value of response j, with this reduction, is formed: plain, absolute or a norm (`evaluation.Peak`)."""
    if reduction.is_integral:
        return "plain"
    if has_norm(model, j):
        return "norm"
    return "absolute" if reduction.is_magnitude or is_absolute(model, j) else "plain"
