"""How the value of a response comes from what it is formed of: as it is, as an absolute value, or as a norm."""

from mdstopo.evaluation import Shape
from mdstopo.general.general_model import GeneralModel
from mdstopo.general.general_responses import has_norm, is_absolute
from mdstopo.sensitivity.reductions import INTEGRALS


def shape_of(model: GeneralModel, j: int, reduction: str) -> Shape:
    """The shape (`evaluation.Peak`) of the values of response j, reduced over time so."""
    if reduction in INTEGRALS:
        return "plain"
    if has_norm(model, j):
        return "norm"
    return "absolute" if reduction == "max_abs" or is_absolute(model, j) else "plain"
