"""What constraints came to, iteration by iteration, from what an optimiser's history holds of them."""

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
