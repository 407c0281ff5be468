"""Values of constraints, iteration by iteration, from an optimiser's history; and by how much they break bounds."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case, VolumeRow


def constraint_values(case: Case, columns: Mapping[str, NDArray[np.generic]]) -> NDArray[np.float64]:
    """h - h0 of all constraints (K + 1, n_con), in the case's order, from the columns of an optimiser's history."""
    constraints = columns.get("info/constraints")
    if constraints is None:
        signs = [-1.0 if row.sense == "at_least" else 1.0 for row in case.constraints if isinstance(row, VolumeRow)]
        constraints = columns["constraints"].reshape(len(columns["objective"]), len(signs)) * np.array(signs)
    return np.asarray(constraints, dtype=np.float64)


def exceeded(sense: str, excess: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much values break a bound, positive where they do, in their own unit. excess: the values less the bound;
    sense: what it asks for, `limit`, `at_least` or `equals`."""
    over: NDArray[np.float64] = {"limit": excess, "at_least": -excess, "equals": np.abs(excess)}[sense]
    return over


def relative_violations(case: Case, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much each of K designs breaks each constraint (K, n_con), relative to the bound (to 1 where that is 0);
    positive where it does. values (K, n_con): h - h0, NaN where they are not known."""
    columns = [
        exceeded(row.sense, excess) / (abs(row.bound) or 1.0)
        for row, excess in zip(case.constraints, values.T, strict=True)
    ]
    return np.array(columns).T.reshape(values.shape)
