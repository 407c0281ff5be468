"""Errors of values and gradients, relative to a reference."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdstopo.api import evaluate
from mdstopo.case.model import Case

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """An objective's value G and its gradient dG/dalpha (N,)."""

    value: float
    gradient: Floats

    def errors(self, value: float, gradient: Floats) -> tuple[float, float]:
        """Relative errors of G and of the gradient's largest entry."""
        largest = float(np.max(np.abs(self.gradient)))
        return (
            abs(value - self.value) / (abs(self.value) or 1.0),
            float(np.max(np.abs(gradient - self.gradient))) / (largest or 1.0),
        )


def solution(case: Case, alpha: Floats, method: str = "auto") -> tuple[float, Floats]:
    """The first objective and its gradient. Raises RuntimeError where the evaluation fails."""
    found = evaluate(case, alpha, method=method)
    if not found.status.ok:
        raise RuntimeError(f"{case.name}: {found.status.value} {found.message}".rstrip())
    name = case.objectives[0].name
    return found.objectives[name], np.array(found.gradients[name])
