"""How far an evaluation is from the exact motion's: the same once more, much finer, and the difference.

An embedded estimate would be cheaper, but it is of the motion, not of responses: peaks, events and the reverse
sweep have errors of their own. A finer evaluation has them all, smaller. Adaptive steps are computed to a thousandth of
the tolerance, and again to a thousandth of that where no step has changed. Fixed steps are halved; where the method is
of second order a third is added, which is what the halved steps still lack.

A finer evaluation rounds elongations as the first one did. So the same steps are made twice more of the scene as it is
rounded otherwise (`scene.rounding`), and the larger difference is added. How far from each other two roundings are is
chance: both differences are less than a tenth of the error in fewer than one of a hundred.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.model import Case
from mdstopo.evaluation import ErrorEstimate, Evaluation, FloatArray
from mdstopo.integrators.scene_driver import Scene, SceneDriver

FINER = 1e-3
#: the tightest tolerance that double precision lets be kept, and where one that does no more for a result is given up
TIGHTEST, COARSEST = 1e-13, 1e-6
#: what rounding leaves in sums over a motion, relative
ROUNDING = 1e-15
#: other roundings that are computed
SAMPLES = 1, 2


class AnyEvaluator(Protocol):
    """What an error estimate needs of `engine.Evaluator`, where each function is described."""

    case: Case

    @property
    def integrator(self) -> str: ...
    @property
    def scenes(self) -> Mapping[str, Scene]: ...
    def driver(self, name: str) -> SceneDriver: ...
    def otherwise(self, sample: int = 0, **solver: Any) -> "AnyEvaluator": ...
    def evaluate(self, alpha: FloatArray, gradient: bool = True, sensitivity: str | None = None) -> Evaluation: ...


class Estimator:
    """Error estimates for the evaluations of one evaluator."""

    def __init__(self, evaluator: AnyEvaluator) -> None:
        self._evaluator = evaluator
        #: why there was no estimate the last time
        self.why = ""

    def errors(self, alpha: FloatArray, found: Evaluation, sensitivity: str | None) -> dict[str, ErrorEstimate]:
        """Error estimates of an evaluation at alpha (N,), by objective; empty where it, or the finer one, failed."""
        if not found.status.usable:
            return {}
        kind = INTEGRATORS[self._evaluator.integrator]
        if not kind.adaptive or self._evaluator.case.solver.step is not None:
            finer = self._halved.evaluate(alpha, bool(found.gradients), sensitivity)
        else:
            finer = self._finer(alpha, found, sensitivity)
        self.why = "" if finer.status.usable else f"{finer.status.value} ({finer.message})"
        if self.why:
            return {}
        factor = 1.0 if kind.adaptive else 2.0**kind.order / (2.0**kind.order - 1.0)
        rounded = self._rounded(alpha, found, sensitivity)
        return {
            name: _sum(_difference(found, finer, name, factor), [_difference(found, each, name) for each in rounded])
            for name in found.objectives
        }

    def _rounded(self, alpha: FloatArray, found: Evaluation, sensitivity: str | None) -> list[Evaluation]:
        """The same evaluation with other roundings, those that can be used."""
        own = self._evaluator
        others = [own.otherwise(sample=sample, integrator=own.integrator) for sample in SAMPLES]
        if INTEGRATORS[own.integrator].finds_step and own.case.solver.step is None:
            for other in others:  # a step that is chosen would be another one
                for load_case in other.scenes:
                    other.driver(load_case).settings[2] = own.driver(load_case).settings[2]
        samples = [other.evaluate(alpha, bool(found.gradients), sensitivity) for other in others]
        return [each for each in samples if each.status.usable]

    def _finer(self, alpha: FloatArray, found: Evaluation, sensitivity: str | None) -> Evaluation:
        tolerance = self._evaluator.case.solver.tolerance
        while tolerance > TIGHTEST:
            tolerance = max(FINER * tolerance, TIGHTEST)
            finer = self._at(tolerance).evaluate(alpha, bool(found.gradients), sensitivity)
            if not _same_steps(finer, found):
                return finer
        # nothing finer can be had: a coarser one is farther off than what was found, once its steps are others
        while True:
            tolerance *= 10.0
            coarser = self._at(tolerance).evaluate(alpha, bool(found.gradients), sensitivity)
            if not _same_steps(coarser, found) or tolerance >= COARSEST:
                return coarser

    def _at(self, tolerance: float) -> AnyEvaluator:
        return self._evaluator.otherwise(integrator=self._evaluator.integrator, tolerance=tolerance)

    @cached_property
    def _halved(self) -> AnyEvaluator:
        """The same evaluator with half its fixed steps."""
        coarse, solver = self._evaluator, self._evaluator.case.solver
        if solver.step is not None:
            return coarse.otherwise(integrator=coarse.integrator, step=0.5 * solver.step)
        # a step of its own that no one else asks for, so that none is chosen anew: half of each load case's goes in
        halved = coarse.otherwise(integrator=coarse.integrator, step=np.inf)
        for load_case in halved.scenes:
            halved.driver(load_case).settings[2] = 0.5 * coarse.driver(load_case).settings[2]
        return halved


def _same_steps(one: Evaluation, other: Evaluation) -> bool:
    """Whether two evaluations differ at most in how far linear iterations were taken."""
    return all(one.work[name] == other.work[name] for name in one.work if name != "body_iterations")


def _difference(found: Evaluation, other: Evaluation, name: str, factor: float = 1.0) -> ErrorEstimate:
    """How far an objective and its gradient are from those of another evaluation, times a factor."""
    value, better = found.objectives[name], other.objectives[name]
    of_value = factor * abs(value - better) + ROUNDING * abs(value)
    if name not in found.gradients or name not in other.gradients:
        return ErrorEstimate(of_value, np.nan)
    gradient = found.gradients[name]
    off = float(np.abs(gradient - other.gradients[name]).max(initial=0.0))
    return ErrorEstimate(of_value, factor * off + ROUNDING * float(np.abs(gradient).max(initial=0.0)))


def _sum(error: ErrorEstimate, rounding: list[ErrorEstimate]) -> ErrorEstimate:
    """An error estimate, and the largest of what rounding may do beside it."""
    value = max((each.value for each in rounding), default=0.0)
    gradient = max((each.gradient for each in rounding if not np.isnan(each.gradient)), default=0.0)
    return ErrorEstimate(error.value + value, error.gradient + gradient)
