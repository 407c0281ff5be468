"""Several starts on several processes.

Each worker is given the case and indices of starts, and sends back the optimiser's states; only this process
writes. What a start computes does not depend on where it runs.
"""

import queue
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.session.crew import WorkerProcess
from mdstopo.session.engine import MakeEngine
from mdstopo.session.errors import WorkerError
from mdstopo.session.starts import StartTask

Floats = NDArray[np.float64]

Job = tuple[Case, Floats | None, MakeEngine, Scalarisation | None]

_PATIENCE = 0.1  # seconds between two looks at whether to stop


def run_in_workers(
    job: Job,
    states: Sequence[State | None],
    tasks: Sequence[StartTask],
    workers: int,
    keep: Callable[[int, State], None],
    stop_requested: Callable[[], bool],
) -> None:
    """Go every task; `keep` gets their states as they arrive, the last one of each always.

    job: the case, the first design, what makes the engine, and U of several objectives.

    Raises
    ------
    WorkerError
        if a worker dies; the states kept so far are good.
    """
    todo = list(tasks)
    inbox: queue.Queue[tuple[WorkerProcess, Any]] = queue.Queue()
    crew = [WorkerProcess("mdstopo.session.worker", job, workers, inbox) for _ in range(min(workers, len(todo)))]
    try:
        idle, stopping = list(crew), False
        while idle or todo or any(worker.busy for worker in crew):
            if not stopping and stop_requested():
                stopping = True
                todo.clear()
                for worker in crew:
                    worker.stop()
            while idle and todo:
                task = todo.pop(0)
                state = states[task.index]
                worker = idle.pop(0)
                worker.busy = True
                worker.send((task, None if state is None else state.to_arrays()))
            if not any(worker.busy for worker in crew):
                break
            try:
                worker, message = inbox.get(timeout=_PATIENCE)
            except queue.Empty:
                continue
            if message is None and not worker.busy:
                continue  # asked to stop, it has
            if message is None:
                raise WorkerError(f"a worker process (pid {worker.pid}) ended unexpectedly")
            kind, index, arrays = message
            if arrays is not None:
                keep(index, State.from_arrays(arrays))
            if kind == "done":
                worker.busy = False
                idle.append(worker)
    finally:
        for worker in crew:
            worker.close()
