"""What a design is worth: the combined value, and the excess over the limits."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdstopo import Case

Floats = NDArray[np.float64]


def value_of(case: Case, objectives: Mapping[str, float]) -> float:
    """U of raw objectives, to be minimised. Raises ValueError where U needs a utopia."""
    signed = np.array([_sign(each.sense) * objectives[each.name] for each in case.objectives])
    if len(signed) == 1:
        return float(signed[0])
    combine = case.combine
    assert combine is not None
    weights = np.array([combine.weights[each.name] for each in case.objectives])
    weights = weights / weights.sum()
    if combine.method == "weighted_product":
        return float(np.prod(signed**weights))
    if combine.normalize:
        raise ValueError("normalised objectives need a utopia")
    if combine.method == "weighted_min_max":
        return float((weights * signed).max())
    if combine.method == "weighted_sum":
        return float(weights @ signed)
    return float(weights @ signed**combine.exponent)


def slopes_of(case: Case, objectives: Mapping[str, float]) -> tuple[Floats, bool]:
    """dU/dG of each objective, to be minimised, and whether they compete for one maximum (then factors of their
    values)."""
    if len(case.objectives) == 1:
        return np.ones(1), False
    combine = case.combine
    assert combine is not None
    value_of(case, objectives)  # refuses what needs a utopia
    signed = np.array([_sign(each.sense) * objectives[each.name] for each in case.objectives])
    weights = np.array([combine.weights[each.name] for each in case.objectives])
    weights = weights / weights.sum()
    if combine.method == "weighted_product":
        return weights * float(np.prod(signed**weights)) / signed, False
    if combine.method == "weighted_exponential":
        return weights * combine.exponent * signed ** (combine.exponent - 1.0), False
    return weights, combine.method == "weighted_min_max"


def _sign(sense: str) -> float:
    return -1.0 if sense == "maximize" else 1.0


def excess(case: Case, constraints: ArrayLike) -> float:
    """The largest excess over a bound, relative to it; 0 where all hold. constraints (n_con,): h_j - h_0j."""
    over = [
        {"limit": value, "at_least": -value, "equals": abs(value)}[row.sense] / (abs(row.bound) or 1.0)
        for row, value in zip(case.constraints, np.asarray(constraints).tolist(), strict=True)
    ]
    return float(np.max([0.0, *over]))
