"""A piece of work: a task of a front that is solved, or a case of a sweep that is run. The same in every process."""

import platform
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mdstopo.case.model import Case, FloatArray
from mdstopo.case.text.errors import CaseError
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.state import State
from mdstopo.plan.priced_designs import packed
from mdstopo.plan.solve_task import Found, Task, failed, solve
from mdstopo.session.combining import NoUtopiaError
from mdstopo.session.compiling_apart import compile_apart
from mdstopo.session.run_session import run_session
from mdstopo.starts.callbacks import ignore
from mdstopo.starts.evaluator_interface import Engine, equal_weights, problem_of
from mdstopo.starts.getting_ready import get_ready
from mdstopo.status import RunStatus
from mdstopo.workers.worker_pool import Parent, Perform, StoppedError


@dataclass(frozen=True)
class Setting:
    """What all jobs have in common: the case, and its hash; jobs of a sweep bring a case of their own."""

    case: Case
    case_key: str


@dataclass(frozen=True)
class Trial:
    """One run of a sweep: a case with values for the keys that vary."""

    case: Case
    key: str


Job = Task | Trial

#: engines that a process keeps, by the hash of their case
_KEPT = 2
_engines: OrderedDict[str, Engine] = OrderedDict()


def perform(
    setting: Setting, job: Job, stop: Callable[[], bool] | None = None, keep: Callable[[State], None] | None = None
) -> Any:
    """The result of one job; whatever goes wrong in it becomes its status, so that nothing else fails.

    keep: is given the states of a task's optimiser. Raises StoppedError where `stop` says so before the end.
    """
    try:
        if isinstance(job, Trial):
            return run_trial(job, stop)
        return solve(ready_engine(setting), setting.case, job, job.key(setting.case_key), stop, keep)
    except StoppedError:
        raise
    except Exception as error:
        words = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        if isinstance(job, Trial):
            return failed(0, job.key, first(job.case), len(job.case.objectives), words)
        return failed(job.point, job.key(setting.case_key), job.start, len(setting.case.objectives), words)


def open_jobs(setting: Setting) -> Perform:
    """In a worker: make the function that does one job after the other."""

    def work(job: Job, parent: Parent) -> Any:
        return perform(setting, job, parent.stopped, lambda state: parent.keep(state.to_arrays))

    return work


def first(case: Case) -> FloatArray:
    """The optimiser's x of the initial design; where candidates are priced with its members (`priced_designs`)."""
    x = case.space.reduce(case.start)
    return packed(case, x) if case.priced_groups else x


def ready_engine(setting: Setting) -> Engine:
    """The case's engine, its kernels loaded in the one order that makes results repeat to the bit (`get_ready`)."""
    found = _engines.get(setting.case_key)
    if found is None:
        compile_apart(setting.case, ignore)  # on a machine where nothing has been compiled yet
        found = make_engine(setting.case)
        if setting.case.uncertainty is not None:
            from mdstopo.robust.uncertain_run import kinds

            for kind in kinds(found):
                compile_apart(kind, ignore)
        get_ready(setting.case, found, problem_of(found, equal_weights(setting.case)), None)
        _engines[setting.case_key] = found
        if len(_engines) > _KEPT:
            _engines.popitem(last=False)
    return found


def run_trial(trial: Trial, stop: Callable[[], bool] | None = None) -> Found:
    """The whole run of one case of a sweep; mistakes that only it has become its status."""
    began = time.perf_counter()
    m = len(trial.case.objectives)
    try:
        outcome = run_session(trial.case, stop_requested=stop)
    except KeyboardInterrupt as error:
        raise StoppedError from error
    except CaseError as error:
        return failed(0, trial.key, first(trial.case), m, "; ".join(mistake.message for mistake in error.mistakes))
    except NoUtopiaError as error:
        return failed(0, trial.key, first(trial.case), m, str(error))
    if outcome.status is RunStatus.INTERRUPTED:
        raise StoppedError
    objectives = np.array([outcome.objectives[each.name] for each in trial.case.objectives])
    state = outcome.states[outcome.best_start]
    assert state is not None
    x = packed(outcome.case, state.best_alpha) if outcome.case.priced_groups else state.best_alpha
    return Found(
        point=0,
        key=trial.key,
        alpha=x,
        objectives=objectives,
        combined=float(state.best_objective),
        status=outcome.status,
        reason=outcome.reason,
        evaluations=outcome.evaluations,
        kkt=float(state.kkt),
        violation=float(state.best_violation),
        visited=np.array(outcome.history["objectives"], dtype=np.float64),
        seconds=time.perf_counter() - began,
        host=platform.node(),
    )
