"""The losses that a fit may have (`fit.loss`): how residuals count. One record a loss.

What a record names is in `fit.loss_functions`, because reading a case computes nothing.
"""

from __future__ import annotations

from typing import NamedTuple


class LossKind(NamedTuple):
    """A loss rho(r) of residuals r, each divided by its standard deviation; a fit minimises half the sum of it.

    name: as case files have it; doc: a sentence for the case reference. function: module:function, as of
    `fit.loss_functions.linear`. is_robust: whether large residuals count less than their squares, so that intervals and
    deviations have to be estimated otherwise; False of least squares alone, for which SciPy has a way of its own.
    """

    name: str
    doc: str
    function: str
    is_robust: bool = True


_HERE = "mdstopo.fit.loss_functions"

#: the losses by their name
LOSSES: dict[str, LossKind] = {
    kind.name: kind
    for kind in (
        LossKind("linear", "least squares", f"{_HERE}:linear", is_robust=False),
        LossKind("huber", "squares up to one standard deviation, beyond it the absolute value", f"{_HERE}:huber"),
        LossKind("soft_l1", "a smooth one like huber", f"{_HERE}:soft_l1"),
        LossKind("cauchy", "outliers count less and less", f"{_HERE}:cauchy"),
    )
}
#: the loss of fits that name none
DEFAULT_LOSS = next(iter(LOSSES))


def names() -> dict[str, str]:
    """The losses by the words of `fit.loss`, with what they mean."""
    return {kind.name: kind.doc for kind in LOSSES.values()}
