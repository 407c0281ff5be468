"""References, and errors against them.

A reference is the objective and gradient by the *other* adaptive integrator at a tolerance of 1e-13: what collocation
gives is measured against the explicit Nystroem method and the other way round. The two share the force sums, but
neither steps, stages nor reverse sweeps. How far they agree is part of what is printed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import design, scene
from mdstopo import Case, evaluate

ADAPTIVE = ("gauss", "runge_kutta")
TIGHTEST = 1e-13


@dataclass(frozen=True)
class Reference:
    """G and dG/dalpha (N,)."""

    value: float
    gradient: NDArray[np.float64]

    def errors(self, value: float, gradient: NDArray[np.float64]) -> tuple[float, float]:
        """Relative errors of G and of the gradient's largest entry."""
        largest = float(np.max(np.abs(self.gradient)))
        return (
            abs(value - self.value) / abs(self.value),
            float(np.max(np.abs(gradient - self.gradient))) / largest,
        )


def solution(case: Case, alpha: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """G and its gradient of a case with one objective. Raises RuntimeError where the evaluation fails."""
    found = evaluate(case, alpha)
    if not found.status.ok:
        raise RuntimeError(f"{case.name}: {found.status.value} {found.message}")
    ((name, value),) = found.objectives.items()
    return value, np.array(found.gradients[name])


def reference(name: str, design_name: str, integrator: str) -> Reference:
    """The reference for a scene, a design and the integrator that is to be measured."""
    other = "runge_kutta" if integrator != "runge_kutta" else "gauss"
    case = scene(name, integrator=other, tolerance=TIGHTEST)
    return Reference(*solution(case, design(design_name, case.n_design)))


def agreement(name: str, design_name: str) -> float:
    """Relative difference of the two references' gradients, largest entry."""
    one, two = (reference(name, design_name, integrator) for integrator in ADAPTIVE)
    return one.errors(two.value, two.gradient)[1]
