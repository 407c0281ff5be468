"""One piece of work: an optimisation of one scalarisation from one design. What comes out depends on nothing else.

It may be done in parts (`Task.quota`): then the optimiser's state comes back, and goes into the next part. And it may
be done again up to one of its designs (`Task.iterate`): designs are not kept on the way, as few are ever asked for.
"""

import hashlib
import json
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from mdstopo._version import __version__
from mdstopo.case.model import Case
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.interface import Optimizer, run
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.plan.priced_designs import packed, unpacked
from mdstopo.plan.pricing_rounds import Rounds
from mdstopo.starts.callbacks import never
from mdstopo.starts.constraint_columns import constraint_values, relative_violations
from mdstopo.starts.evaluator_interface import Engine
from mdstopo.starts.single_start import make_optimizer, soften, with_evaluations_before
from mdstopo.status import RunStatus
from mdstopo.store.same_case import describe
from mdstopo.workers.worker_pool import StoppedError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Task:
    """One solve of a front. point: which point it is for, or -1 - i for the optimum of objective i alone.

    start (n,): the optimiser's x to begin with; softened: the optimum from there with less strong members is, in its
    place. iterations: at most so many. contest: the hash of the starts that it competes with, for who goes on depends
    on them all; empty where it competes with none. iterate: the design that is evaluated in this iteration is what is
    found; -1: the best of all. begun: the optimiser's state where an earlier process, or an earlier part, left the
    task; quota: iterations after which it is left again, None: it goes on to its end. What is found does not depend on
    these two.
    """

    point: int
    scalarisation: Scalarisation
    start: Floats
    iterations: int
    softened: bool = False
    contest: str = ""
    iterate: int = -1
    begun: State | None = None
    quota: int | None = None

    def key(self, case_key: str) -> str:
        """The hash of all that the result depends on."""
        digest = hashlib.blake2b(digest_size=16)
        one = self.scalarisation
        words = [case_key, self.point, one.method, one.exponent, self.iterations]
        digest.update(json.dumps([*words, self.softened, self.contest, self.iterate]).encode())
        for array in (one.weights, one.lowest, one.highest, one.anchor, one.normal, one.planes, self.start):
            digest.update(b"-" if array is None else np.ascontiguousarray(array, dtype=np.float64).tobytes() + b"|")
        return digest.hexdigest()

    def is_through(self, state: State) -> bool:
        """Whether a state has come as far as this part of the task goes."""
        return not state.running or (self.quota is not None and state.iteration >= self.quota)


@dataclass(frozen=True, kw_only=True)
class Found:
    """What a task has found.

    alpha (n,): its best design, as the optimiser's x (`case.space`), or where candidates are priced with its members
    (`priced_designs`), as `Task.start` is; objectives (m,): all raw G there, NaN where it could not be evaluated;
    combined: U; visited (K, m): raw G of every iterate, NaN of objectives that were not
    simulated; the last row is the design that is kept and has all. violations (K,): the largest excess of each over a
    constraint, relative to its bound; violation: that of alpha. kkt: the projected residual at the last iterate,
    relative to the largest gradient entry, NaN where another design is kept. key: empty for what is not to be used
    again (a lost one). iterate: which iterate alpha is where that was asked for (`Task.iterate`), else -1.
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
    violations: Floats = field(default_factory=lambda: np.zeros(0))
    iterate: int = -1

    @property
    def usable(self) -> bool:
        """Whether there is a design with values."""
        return bool(np.isfinite(self.objectives).all())


#: of a task: what it has found, or of a part of it the state that it ends with
Result = Found | State


def case_key(case: Case) -> str:
    """The hash of a case and of what else decides: the version, the tolerance, the settings of the optimiser."""
    return hashlib.blake2b(f"{__version__}\n{describe(case)}".encode(), digest_size=16).hexdigest()


def front_key(case: Case) -> str:
    """The hash of `case_key` without the number of starts, on which no single solve depends."""
    return case_key(replace(case, optimizer=replace(case.optimizer, starts=1)))


def failed(point: int, key: str, alpha: Floats, m: int, reason: str) -> Found:
    """The result of a task that failed."""
    nothing = np.full(m, np.nan)
    return Found(
        point=point,
        key=key,
        alpha=alpha,
        objectives=nothing,
        combined=float("nan"),
        status=RunStatus.FAILED,
        reason=reason,
        evaluations=0,
        kkt=float("nan"),
        violation=float("nan"),
        visited=np.zeros((0, m)),
    )


def solve(
    engine: Engine,
    case: Case,
    task: Task,
    key: str,
    stop: Callable[[], bool] | None = None,
    keep: Callable[[State], None] | None = None,
) -> Result:
    """Run a task to its end, or a part of it. Never raises because of a design: a failure is a status.

    engine: the case's evaluator.
    case: the design problem.
    task: what is optimised, from where, and how far.
    key: the task's hash, which its result carries.
    stop: asked after each iteration whether to stop; None never stops.
    keep: is given every state, from which the task could go on.

    Returns what was found, or of a part the state with which it ends. Raises StoppedError where `stop` says so before
    the end.
    """
    began = time.perf_counter()
    if case.priced_groups:
        found = _priced(engine, case, task, key, stop, keep)
        return replace(found, seconds=time.perf_counter() - began, host=platform.node())
    problem = engine.problem(task.scalarisation)
    state = _gone(case, problem, task, stop, keep)
    if task.iterate >= 0:
        found = _iterate(engine, case, task, key, state)
    elif task.quota is not None:
        return state
    else:
        found = _end(engine, case, task, key, state)
    return replace(found, seconds=time.perf_counter() - began, host=platform.node())


def _gone(
    case: Case, problem: Problem, task: Task, stop: Callable[[], bool] | None, keep: Callable[[State], None] | None
) -> State:
    """The state of the optimiser as far as a task goes; arguments as of `solve`. Raises StoppedError."""
    optimizer = make_optimizer(case, problem, max_iterations=task.iterations)
    first = task.begun if task.begun is not None else _first(optimizer, task, stop)
    latest = first

    def reached(state: State) -> None:
        nonlocal latest
        latest = state
        if keep is not None:
            keep(state)

    def left() -> bool:
        return _is_there(task, latest) or (stop is not None and stop())

    state = run(optimizer, first, on_iteration=reached, stop_requested=left)
    if not _is_there(task, state):
        raise StoppedError
    return state


def _priced(
    engine: Engine,
    case: Case,
    task: Task,
    key: str,
    stop: Callable[[], bool] | None,
    keep: Callable[[State], None] | None,
) -> Found:
    """What a task comes to where candidates are priced; its designs are those of `priced_designs`.

    States are kept of the first round, from whose end later ones are gone through again. Of the designs on the way only
    the last is told: each round has members of its own.

    engine: the evaluator of the case as it was read.
    case: the design problem.
    task: what is optimised, and from where.
    key: the task's hash, which its result carries.
    stop: asked after each iteration whether to stop; None never stops.
    keep: is given every state of the first round.
    """
    built, alpha = unpacked(case, task.start)
    if built.n_design != case.n_design:
        engine = make_engine(built)
    rounds = Rounds(built)
    problem = engine.problem(task.scalarisation)
    state = _gone(built, problem, replace(task, start=alpha), stop, keep)
    evaluations = int(state.evaluations)
    while rounds.go_on(problem, state):
        engine = make_engine(rounds.case)
        problem = engine.problem(task.scalarisation)
        state = _gone(rounds.case, problem, replace(task, start=rounds.design, begun=None), stop, None)
        evaluations += int(state.evaluations)
    status, reason = rounds.conclude(state)
    objectives, excess = _final(engine, rounds.case, state.best_alpha)
    if not np.isfinite(objectives).all():
        status, reason = RunStatus.FAILED, "the design that was found cannot be evaluated in every load case"
    kept = np.array_equal(state.best_alpha, state.alpha)
    return Found(
        point=task.point,
        key=key,
        alpha=packed(rounds.case, state.best_alpha),
        objectives=objectives,
        combined=float(state.best_objective),
        status=status,
        reason=reason,
        evaluations=evaluations,
        kkt=float(state.kkt) if kept else float("nan"),
        violation=excess,
        visited=objectives[None],
        violations=np.array([excess]),
    )


def _is_there(task: Task, state: State) -> bool:
    """Whether a state has come to the end of the task or of its part, or just before the iterate that is wanted."""
    return task.is_through(state) or (task.iterate >= 0 and state.iteration >= task.iterate - 1)


def _first(optimizer: Optimizer, task: Task, stop: Callable[[], bool] | None) -> State:
    """The state with which a task begins. Raises StoppedError where it is stopped before there is one."""
    if not (task.softened and hasattr(optimizer.problem, "softened")):
        return optimizer.start(task.start)
    soft = soften(optimizer.settings, optimizer.problem, task.start, stop or never)
    if soft is None:
        raise StoppedError
    return with_evaluations_before(optimizer.start(soft.best_alpha), soft.evaluations)


def _end(engine: Engine, case: Case, task: Task, key: str, state: State) -> Found:
    """What a task that has ended has found: its best design."""
    visited = np.array(state.history.info["objectives"]).reshape(-1, len(case.objectives))
    violations = _violations(case, state)
    objectives, excess = _final(engine, case, state.best_alpha)
    kept = np.array_equal(state.best_alpha, state.alpha)
    if not kept or not len(visited):
        visited = np.concatenate([visited, objectives[None]])
        violations = np.append(violations, excess)
    visited[-1], violations[-1] = objectives, excess
    status, reason = state.status, state.reason
    if status is not RunStatus.FAILED and not np.isfinite(objectives).all():
        status, reason = RunStatus.FAILED, "the design that was found cannot be evaluated in every load case"
    return Found(
        point=task.point,
        key=key,
        alpha=state.best_alpha,
        objectives=objectives,
        combined=float(state.best_objective),
        status=status,
        reason=reason,
        evaluations=int(state.evaluations),
        kkt=float(state.kkt) if kept else float("nan"),
        violation=excess,
        visited=visited,
        violations=violations,
    )


def _iterate(engine: Engine, case: Case, task: Task, key: str, state: State) -> Found:
    """The design that is evaluated in the iteration that the task names; state: before it, or the first one."""
    alpha = state.trial if task.iterate > 0 else state.alpha
    objectives, excess = _final(engine, case, alpha)
    return Found(
        point=task.point,
        key=key,
        alpha=alpha,
        objectives=objectives,
        combined=float("nan"),
        status=RunStatus.VISITED,
        reason=f"iterate {task.iterate}",
        evaluations=int(state.evaluations) + (task.iterate > 0),
        kkt=float("nan"),
        violation=excess,
        visited=np.zeros((0, len(objectives))),
        iterate=task.iterate,
    )


def _final(engine: Engine, case: Case, alpha: Floats) -> tuple[Floats, float]:
    """All raw objectives of a design, and its largest excess over a constraint."""
    evaluation = engine.evaluate(case.space.expand(alpha), gradient=False)
    values = np.array([evaluation.objectives[objective.name] for objective in case.objectives])
    return values, float(_largest(case, np.array(evaluation.constraints, dtype=np.float64)[None])[0])


def _violations(case: Case, state: State) -> Floats:
    """The largest excess over a constraint (K + 1,) of every design that was evaluated; NaN where it is not known."""
    values = constraint_values(case, state.history.to_arrays())
    if values.shape[1] != len(case.constraints):  # not even the first evaluation came to its constraints
        return np.full(len(values), np.nan)
    return _largest(case, values)


def _largest(case: Case, values: Floats) -> Floats:
    """The largest excess (K,) of constraint values (K, n_con), relative to the bounds; 0 where all are kept, NaN where
    one is not known."""
    return np.asarray(relative_violations(case, values).max(axis=1, initial=0.0))
