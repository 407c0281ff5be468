"""What a run asks of the engine, as protocols: the session can be tested without mechanics."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.scene.family import beyond_springs
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


def compiling(case: Case) -> str:
    """What is said before the kernels for such a case are compiled for the first time."""
    how_long = "some two minutes" if beyond_springs(case) else "up to half a minute"
    return f"compiling the kernels, once for this version: {how_long}"


def compilation_due(case: Case) -> bool:
    """Whether the kernels of this version have never been compiled here for such a case."""
    from mdstopo.compiler.store import cache_folder

    pattern = "mdstopo.general.*" if beyond_springs(case) else "mdstopo.integrators.*"
    return next(cache_folder().glob(pattern), None) is None


def make_engine(case: Case) -> Engine:
    """The real one; imported here, because it brings the compiler with it."""
    from mdstopo.evaluators import evaluator_of

    return evaluator_of(case)
