"""mdstopo itself on the seated occupant, from the case file."""

from typing import Any

import numpy as np

from benchmarks.peers.problem import Floats
from benchmarks.peers.scenes import SEAT, SEAT_CHANGES
from benchmarks.peers.table import Objective


def make(_problem: Any, tolerance: float = 1e-8) -> Objective:
    """As the table says. Raises RuntimeError where an evaluation fails."""
    from mdstopo.case.reader import load_case
    from mdstopo.evaluators import evaluator_of

    return objective_of(evaluator_of(load_case(SEAT, overrides=SEAT_CHANGES | {"solver.tolerance": tolerance})))


def objective_of(evaluator: Any) -> Objective:
    """G = (chest x excursion)^(1/2), with both gradients where one is wanted."""

    def objective(alpha: Floats, gradient: bool) -> tuple[float, Floats | None]:
        found = evaluator.evaluate(alpha, gradient)
        if not found.status.ok:
            raise RuntimeError(f"{found.status.value} {found.message}".rstrip())
        chest, excursion = (found.objectives[name] for name in ("chest", "excursion"))
        value = float(np.sqrt(chest * excursion))
        if not gradient:
            return value, None
        slopes = found.gradients["chest"] / chest + found.gradients["excursion"] / excursion
        return value, 0.5 * value * slopes

    return objective
