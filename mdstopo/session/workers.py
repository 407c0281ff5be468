"""Several starts on several processes.

Each worker is a fresh interpreter that is given the case and indices of starts, and sends back the
optimiser's states; only this process writes. Workers ignore the terminal's Ctrl-C and end when their input
is closed, so that they neither spoil a clean stop nor outlive a killed parent. What a start computes does
not depend on where it runs.
"""

import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.optimizer.state import State
from mdstopo.session.engine import MakeEngine
from mdstopo.session.errors import WorkerError

Floats = NDArray[np.float64]

_PATIENCE = 0.1  # seconds between two looks at whether to stop


def run_in_workers(
    case: Case,
    states: Sequence[State | None],
    initial: Floats | None,
    engine: MakeEngine,
    workers: int,
    keep: Callable[[int, State], None],
    stop_requested: Callable[[], bool],
) -> None:
    """Advance every start; `keep` gets their states as they arrive, the last one of each always.

    Raises
    ------
    WorkerError
        if a worker dies; the states kept so far are good.
    """
    todo = list(range(len(states)))
    inbox: queue.Queue[tuple[_Worker, Any]] = queue.Queue()
    crew = [_Worker((case, initial, engine), workers, inbox) for _ in range(min(workers, len(todo)))]
    try:
        idle, stopping = list(crew), False
        while idle or todo or any(worker.busy for worker in crew):
            if not stopping and stop_requested():
                stopping = True
                todo.clear()
                for worker in crew:
                    worker.stop()
            while idle and todo:
                index = todo.pop(0)
                idle.pop(0).begin(index, states[index])
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
            keep(index, State.from_arrays(arrays))
            if kind == "done":
                worker.busy = False
                idle.append(worker)
    finally:
        for worker in crew:
            worker.close()


class _Worker:
    """One process, and a thread that listens to it."""

    def __init__(
        self,
        job: tuple[Case, Floats | None, MakeEngine],
        crew: int,
        inbox: "queue.Queue[tuple[_Worker, Any]]",
    ) -> None:
        threads = max(1, (os.cpu_count() or 1) // crew)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "mdstopo.session.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "NUMBA_NUM_THREADS": str(threads)},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        self._inbox = inbox
        self.busy = False
        self.pid = self._process.pid
        self._send(job)
        threading.Thread(target=self._listen, daemon=True).start()

    def begin(self, index: int, state: State | None) -> None:
        """Give it a start."""
        self.busy = True
        self._send((index, None if state is None else state.to_arrays()))

    def stop(self) -> None:
        """Ask it to end after the iteration it is in."""
        with suppress(BrokenPipeError):  # where it is gone, the listener says so
            self._input.close()

    def close(self) -> None:
        """Let it end; end it if it does not."""
        self.stop()
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._output.close()

    def _send(self, message: object) -> None:
        with suppress(BrokenPipeError, ValueError):
            pickle.dump(message, self._input)
            self._input.flush()

    def _listen(self) -> None:
        while True:
            try:
                message = pickle.load(self._output)
            except (EOFError, OSError, ValueError, pickle.UnpicklingError):
                message = None
            self._inbox.put((self, message))
            if message is None:
                return
