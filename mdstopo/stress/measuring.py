"""What scenes measure with: the engine's calls, whose refusals are raised, and errors relative to what is expected.

Every call compiles its case anew: `mdstopo.simulate` keeps the last cases with all their steps, which are many here.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdstopo.engine import Evaluator
from mdstopo.stress.scene import Refused

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.evaluation import Evaluation
    from mdstopo.integrators.trajectory import Trajectory

Floats = NDArray[np.float64]

ADAPTIVE = ("gauss", "runge_kutta")
INTEGRATORS = (*ADAPTIVE, "generalized_alpha")


def moved(case: "Case", alpha: ArrayLike | None = None) -> "Trajectory":
    """The motion; raises Refused where it ends early."""
    (load_case,) = case.load_cases
    motion = Evaluator(case).trajectory(_design(case, alpha), load_case.name)
    if not motion.status.ok:
        raise Refused(f"{motion.status.value}: {motion.message}")
    return motion


def valued(case: "Case", alpha: ArrayLike | None = None, gradient: bool = True) -> "Evaluation":
    """Objectives and gradients; raises Refused where there are none."""
    found = Evaluator(case).evaluate(_design(case, alpha), gradient)
    if not found.status.usable:
        raise Refused(f"{found.status.value}: {found.message}")
    return found


def _design(case: "Case", alpha: ArrayLike | None) -> Floats:
    return case.initial if alpha is None else np.asarray(alpha, dtype=np.float64)


def error(found: ArrayLike, expected: ArrayLike, scale: float | None = None) -> float:
    """Largest difference relative to `scale`, else to the largest expected; NaN where anything is not finite."""
    a, b = np.asarray(found, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    if a.shape != b.shape or not np.all(np.isfinite(a)):
        return float("nan")
    size = float(np.abs(b).max(initial=0.0)) if scale is None else scale
    difference = float(np.abs(a - b).max(initial=0.0))
    return difference / size if size > 0.0 else difference


def errors(case: "Case", expected: Callable[[Any], Any], alpha: ArrayLike | None = None, name: str = "G") -> float:
    """The larger error of an objective and its gradient, against a formula of alpha (N,).

    The formula is differentiated by complex steps, exact to rounding.
    """
    design = np.array(case.initial if alpha is None else alpha, dtype=np.float64)
    found = valued(case, design)
    value, gradient = differentiated(expected, design)
    return max(error(found.objectives[name], value), error(found.gradients[name], gradient))


def differentiated(formula: Callable[[Any], Any], at: Floats) -> tuple[float, Floats]:
    """Value and gradient of a formula, which has to take complex numbers."""
    step = 1e-200
    gradient = np.zeros(len(at))
    for i in range(len(at)):
        moved_on = at.astype(np.complex128)
        moved_on[i] += 1j * step
        gradient[i] = complex(formula(moved_on)).imag / step
    return complex(formula(at.astype(np.complex128))).real, gradient


def body(case: "Case", name: str) -> int:
    """The place in the coordinates at which those of a body begin: x, y, psi."""
    return 3 * [each.name for each in case.bodies].index(name)


def spring(start: list[float], to: str, at: list[float], **law: Any) -> dict[str, Any]:
    """A member from ground to a body; a spring unless `type` says another law."""
    return {"from": {"body": "ground", "at": start}, "to": {"body": to, "at": at}, "law": {"type": "spring", **law}}


def ball(x: float = 1.0, y: float = 0.0, **more: Any) -> dict[str, Any]:
    """The entry of a body of unit mass and inertia in a case."""
    return {"mass": 1.0, "inertia": 1.0, "position": [x, y], **more}


ENERGY: Mapping[str, Any] = {"G": {"response": "energy"}}
FULL: Mapping[str, Any] = {"initial": 1.0}
