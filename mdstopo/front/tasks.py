"""One piece of work: an optimisation of one scalarisation from one design. What comes out depends on nothing else."""

import hashlib
import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mdstopo._version import __version__
from mdstopo.case.model import Case
from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import settings
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.session.engine import Engine
from mdstopo.status import RunStatus
from mdstopo.store.compare import describe

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """point: which point of the front it is for, or -1 - i for the optimum of objective i alone.

    start (n,): the optimiser's x to begin with; iterations: at most so many. begun: the optimiser's state where an
    earlier process left the task; what is found does not depend on it.
    """

    point: int
    scalarisation: Scalarisation
    start: Floats
    iterations: int
    begun: State | None = None

    def key(self, case_key: str) -> str:
        """The hash of all that the result depends on."""
        digest = hashlib.blake2b(digest_size=16)
        one = self.scalarisation
        words = [case_key, self.point, one.method, one.exponent, self.iterations]
        digest.update(json.dumps(words).encode())
        for array in (one.weights, one.lowest, one.highest, one.anchor, one.normal, one.planes, self.start):
            digest.update(b"-" if array is None else np.ascontiguousarray(array, dtype=np.float64).tobytes() + b"|")
        return digest.hexdigest()


@dataclass(frozen=True)
class Found:
    """What a task has found.

    alpha (n,): its best design, as the optimiser's x (`case.space`); objectives (m,): all raw G there, NaN where it
    could not be evaluated; combined: U; visited (K, m): raw G of every iterate, NaN of objectives that were not
    simulated; the last row is the design that is kept and has all. kkt: the projected residual at the last iterate,
    relative to the largest gradient entry, NaN where another design is kept; violation: the largest excess over a
    constraint, relative to its bound. key: empty for what is not to be used again (a lost one).
    """

    point: int
    key: str
    alpha: Floats
    objectives: Floats
    combined: float
    status: RunStatus
    reason: str
    evaluations: int
    kkt: float
    violation: float
    visited: Floats
    seconds: float = 0.0
    host: str = field(default="")

    @property
    def usable(self) -> bool:
        """Whether there is a design with values."""
        return bool(np.isfinite(self.objectives).all())


def case_key(case: Case) -> str:
    """The hash of a case and of what else decides: the version, the tolerance, the settings of the optimiser."""
    return hashlib.blake2b(f"{__version__}\n{describe(case)}".encode(), digest_size=16).hexdigest()


def failed(point: int, key: str, alpha: Floats, m: int, reason: str) -> Found:
    """What stands for a task that came to nothing."""
    nothing = np.full(m, np.nan)
    return Found(
        point, key, alpha, nothing, float("nan"), RunStatus.FAILED, reason, 0, float("nan"), float("nan"),
        np.zeros((0, m)),
    )  # fmt: skip


class StoppedError(Exception):
    """A task was left in the middle."""


def solve(
    engine: Engine,
    case: Case,
    task: Task,
    key: str,
    stop: Callable[[], bool] | None = None,
    keep: Callable[[State], None] | None = None,
) -> Found:
    """Run the task to its end. Never raises because of a design: a failure is a status.

    keep: is given every state, from which the task could go on. Raises StoppedError where `stop` says so before the
    end.
    """
    began = time.perf_counter()
    chosen = case.optimizer
    problem = engine.problem(task.scalarisation)
    optimizer = Gsao(
        problem,
        settings(chosen.preset, dict(chosen.options), max_iterations=task.iterations, tolerance=chosen.tolerance),
    )
    first = optimizer.start(task.start) if task.begun is None else task.begun
    state = run(optimizer, first, on_iteration=keep, stop_requested=stop)
    if state.running:
        raise StoppedError
    visited = np.array(state.history.info["objectives"]).reshape(-1, len(case.objectives))
    objectives, excess = _final(engine, case, state.best_alpha)
    kept = np.array_equal(state.best_alpha, state.alpha)
    if not kept or not len(visited):
        visited = np.concatenate([visited, objectives[None]])
    visited[-1] = objectives
    status, reason = state.status, state.reason
    if status is not RunStatus.FAILED and not np.isfinite(objectives).all():
        status, reason = RunStatus.FAILED, "the design that was found cannot be evaluated in every load case"
    return Found(
        task.point, key, state.best_alpha, objectives, float(state.best_objective), status, reason,
        int(state.evaluations), float(state.kkt) if kept else float("nan"), excess, visited,
        time.perf_counter() - began, platform.node(),
    )  # fmt: skip


def _final(engine: Engine, case: Case, alpha: Floats) -> tuple[Floats, float]:
    """All raw objectives of a design, and its largest excess over a constraint."""
    evaluation = engine.evaluate(case.space.expand(alpha), gradient=False)
    values = np.array([evaluation.objectives[objective.name] for objective in case.objectives])
    worst = 0.0
    for row, excess in zip(case.constraints, evaluation.constraints.tolist(), strict=True):
        own = {"limit": excess, "at_least": -excess, "equals": abs(excess)}[row.sense] / (abs(row.bound) or 1.0)
        worst = own if not own <= worst else worst  # what is not known stays so
    return values, worst
