"""Where pieces of work are done: in this process, or in others on this machine.

A piece is anything that `jobs.perform` takes; results come back in the order in which they are done, with the place of
the piece. Workers are fresh interpreters that ignore the terminal's Ctrl-C and end when their input is closed. One that
dies is replaced once for each piece it had; then the piece comes back as an error.
"""

import queue
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.front.jobs import Job, Setting, perform
from mdstopo.front.tasks import StoppedError
from mdstopo.optimizer.state import State
from mdstopo.session.crew import WorkerProcess

Keep = Callable[[int, State], None]


def ignore_both(place: int, state: State) -> None:
    """Keep nothing."""


@dataclass(frozen=True)
class Reached:
    """What a worker says in the middle of a task: its optimiser's state as arrays."""

    arrays: Mapping[str, NDArray[np.generic]]


#: seconds between two looks at whether to stop
PATIENCE = 0.1


@dataclass(frozen=True)
class Lost:
    """What stands for the result of a piece that no worker could finish."""

    reason: str = "its worker process ended unexpectedly, twice"


class Pool(Protocol):
    """Does pieces of work. `results` yields (place, result) as they are done, and ends early where it is to stop.

    keep: is given (place, state) of tasks that are being worked on, as time goes by. at_once: how many pieces are
    worked on together; 0 where that is not known.
    """

    at_once: int

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]: ...
    def close(self) -> None: ...


class Here:
    """One piece after the other, in this process."""

    at_once = 1

    def __init__(self, setting: Setting, stop: Callable[[], bool]) -> None:
        self._setting = setting
        self._stop = stop

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]:
        """In order."""
        for place, job in enumerate(jobs):
            if self._stop():
                return
            try:
                result = perform(self._setting, job, self._stop, partial(keep, place))
            except StoppedError:
                return
            yield place, result

    def close(self) -> None:
        """Nothing is held."""


class Processes:
    """Several processes on this machine, started when there is something to do."""

    def __init__(self, setting: Setting, stop: Callable[[], bool], workers: int) -> None:
        self._setting = setting
        self._stop = stop
        self._workers = self.at_once = workers
        self._crew: list[WorkerProcess] = []
        self._inbox: queue.Queue[tuple[WorkerProcess, Any]] = queue.Queue()

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]:
        """As they are done."""
        todo = list(range(len(jobs)))
        doing: dict[WorkerProcess, int] = {}
        tried = [0] * len(jobs)
        while todo or doing:
            if self._stop():
                return
            while todo and len(doing) < min(self._workers, len(jobs)):
                worker = self._idle(doing)
                place = todo.pop(0)
                tried[place] += 1
                doing[worker] = place
                worker.send(jobs[place])
            try:
                worker, message = self._inbox.get(timeout=PATIENCE)
            except queue.Empty:
                continue
            if message is None:
                self._crew = [each for each in self._crew if each is not worker]
                worker.close()
                place = doing.pop(worker, -1)
                if place >= 0 and tried[place] < 2:
                    todo.insert(0, place)
                elif place >= 0:
                    yield place, Lost()
                continue
            if isinstance(message, Reached):
                keep(doing[worker], State.from_arrays(message.arrays))
                continue
            yield doing.pop(worker), message

    def _idle(self, doing: dict[WorkerProcess, int]) -> WorkerProcess:
        for worker in self._crew:
            if worker not in doing:
                return worker
        worker = WorkerProcess("mdstopo.front.worker", self._setting, self._workers, self._inbox)
        self._crew.append(worker)
        return worker

    def close(self) -> None:
        """End the workers, in the middle of what they do."""
        for worker in self._crew:
            worker.kill()
        self._crew = []
