"""What a run asks of the engine, as protocols: runs can be tested without mechanics."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.settings.scalarisations import SUM
from mdstopo.status import Status
from mdstopo.store.contents import Motion

Floats = NDArray[np.float64]


class Peak(Protocol):
    """A time that competes for an objective, and the value there."""

    @property
    def time(self) -> float: ...
    @property
    def value(self) -> float: ...


class Evaluation(Protocol):
    """One design, evaluated: gradients (N,) and competing peaks by objective."""

    @property
    def objectives(self) -> Mapping[str, float]: ...
    @property
    def constraints(self) -> Floats: ...
    @property
    def gradients(self) -> Mapping[str, Floats]: ...
    @property
    def peaks(self) -> Mapping[str, Sequence[Peak]]: ...
    @property
    def status(self) -> Status: ...


class Engine(Protocol):
    """A case, compiled: what `mdstopo.engine.Evaluator` offers to a run."""

    @property
    def integrator(self) -> str: ...
    @property
    def integrator_reason(self) -> str: ...
    @property
    def sensitivity(self) -> str: ...
    def problem(self, scalarisation: Scalarisation | None = None) -> Problem: ...
    def evaluate(self, alpha: Floats, gradient: bool = True) -> Evaluation: ...
    def trajectory(self, alpha: Floats, load_case: str) -> Motion: ...


MakeEngine = Callable[[Case], Engine]


def equal_weights(case: Case) -> Scalarisation | None:
    """A scalarisation with equal weights of raw values, which needs no utopia, to load kernels with. None for one
    objective."""
    count = len(case.objectives)
    return Scalarisation(SUM, np.full(count, 1.0 / count)) if count > 1 else None


def problem_of(engine: Engine, scalarisation: Scalarisation | None) -> Problem:
    """The optimisation problem that an evaluator of a case is."""
    return engine.problem() if scalarisation is None else engine.problem(scalarisation)
