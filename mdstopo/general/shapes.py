"""How the value of a response comes from what it is formed of: as it is, as an absolute value, or as a norm."""

from mdstopo.evaluation import Shape
from mdstopo.general.landings import INTEGRALS
from mdstopo.general.model import GeneralModel
from mdstopo.general.responses import JOINT_FORCE, JOINT_MOMENT, MEMBER_FORCE, is_norm

#: responses that are absolute values, whatever their reduction over time
ABSOLUTE = (MEMBER_FORCE, JOINT_FORCE, JOINT_MOMENT)


def shape_of(model: GeneralModel, j: int, reduction: str) -> Shape:
    """The shape (`evaluation.Peak`) of the values of response j, reduced over time so."""
    if reduction in INTEGRALS:
        return "plain"
    if is_norm.py_func(model, j):  # type: ignore[attr-defined]
        return "norm"
    return "absolute" if reduction == "max_abs" or int(model.response[j, 0]) in ABSOLUTE else "plain"
