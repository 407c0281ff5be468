"""The same front by a genetic algorithm: NSGA-II of pymoo (extra `ga`), for comparison only."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case
from mdstopo.engine import Evaluator

Floats = NDArray[np.float64]

POPULATION = 100


def genetic(case: Case, seconds: float, seed: int = 1) -> tuple[Floats, int]:
    """(raw objectives of the last population (W, m), evaluations) after so many seconds.

    The one volume row is kept by moving every design onto it, which is kinder than a penalty.
    """
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import ElementwiseProblem
    from pymoo.core.repair import Repair
    from pymoo.optimize import minimize

    evaluator = Evaluator(case)
    names = [objective.name for objective in case.objectives]
    (row,) = case.constraints
    spent = row.sense == "equals"

    class Problem(ElementwiseProblem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(n_var=case.n_design, n_obj=len(names), xl=case.lower, xu=case.upper)

        def _evaluate(self, x: Floats, out: dict[str, Any], *_: object, **__: object) -> None:
            found: Mapping[str, float] = evaluator.evaluate(x, gradient=False).objectives
            out["F"] = [found[name] for name in names]

    class OntoVolume(Repair):  # type: ignore[misc]
        def _do(self, problem: object, X: Floats, **_: object) -> Floats:
            return on_volume(X, case.lower, case.upper, row.bound, spent)

    result = minimize(
        Problem(), NSGA2(pop_size=POPULATION, repair=OntoVolume()), ("time", seconds), seed=seed, verbose=False
    )
    return np.asarray(result.pop.get("F"), dtype=np.float64), int(result.algorithm.evaluator.n_eval)


def on_volume(X: Floats, lower: Floats, upper: Floats, volume: float, spent: bool) -> Floats:
    """Designs (W, N) shifted and cut so that each sums to `volume`, or where it may be less, to no more."""
    low = np.full((len(X), 1), -float(np.max(upper - lower)))
    high = -low
    if not spent:
        high = np.zeros_like(low)
    for _ in range(60):
        middle = 0.5 * (low + high)
        much = np.clip(X + middle, lower, upper).sum(axis=1, keepdims=True) > volume
        high, low = np.where(much, middle, high), np.where(much, low, middle)
    # the upper end of what is left of the interval, unless that is too much: designs that need no shift keep theirs
    whole = np.clip(X + high, lower, upper)
    much = whole.sum(axis=1, keepdims=True) > volume * (1.0 + 1e-12)
    return np.asarray(np.where(much, np.clip(X + low, lower, upper), whole))
