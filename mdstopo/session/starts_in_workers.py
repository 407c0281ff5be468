"""Several starts on several processes.

Each worker is given the case and sends back the optimiser's states; only this process writes. What a start computes
does not depend on where it runs.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.session.start_in_stages import ROUND, Marked, run_stages
from mdstopo.starts.evaluator_interface import MakeEngine, equal_weights, problem_of
from mdstopo.starts.getting_ready import get_ready
from mdstopo.starts.single_start import StartTask
from mdstopo.workers.worker_pool import Lost, Parent, Perform, WorkerError, WorkerPool

Floats = NDArray[np.float64]
Arrays = Mapping[str, NDArray[np.generic]]

#: the case, the first design, what makes the engine, and U of several objectives
Job = tuple[Case, Floats | None, MakeEngine, Scalarisation | None]


def open_starts(job: Job) -> Perform:
    """In a worker: get ready for the starts of a case. A task is a `StartTask` with the state to go on from."""
    case, initial, make_engine, scalarisation = job
    engine = make_engine(case)
    get_ready(case, engine, problem_of(engine, equal_weights(case)), initial)
    problem = problem_of(engine, scalarisation)
    if case.priced_groups:  # several starts are of the first round
        problem = Marked(problem, ROUND, 0)

    def perform(asked: tuple[StartTask, Arrays | None], parent: Parent) -> Arrays | None:
        task, arrays = asked
        state = None if arrays is None else State.from_arrays(arrays)

        def keep(_index: int, state: State) -> None:
            parent.keep(state.to_arrays)

        last = run_stages(case, make_engine, problem, task, state, initial, keep, parent.stopped)
        return None if last is None else last.to_arrays()

    return perform


def run_in_workers(
    pool: WorkerPool,
    states: Sequence[State | None],
    tasks: Sequence[StartTask],
    keep: Callable[[int, State], None],
    stop_requested: Callable[[], bool],
) -> None:
    """Work on every task until its end; `keep` gets their states as they arrive, the last one of each always.

    pool: of `open_starts`. states: of all starts, which `keep` brings up to date.

    Raises
    ------
    WorkerError
        if no worker can finish a task; the states kept so far are good.
    """

    def task(place: int) -> tuple[StartTask, Arrays | None]:
        state = states[tasks[place].index]
        return tasks[place], None if state is None else state.to_arrays()

    def hold(place: int, arrays: Any) -> None:
        keep(tasks[place].index, State.from_arrays(arrays))

    for place, last in pool.results(len(tasks), task, keep=hold, stop=stop_requested):
        if isinstance(last, Lost):
            raise WorkerError(last.reason)
        if last is not None:
            hold(place, last)
