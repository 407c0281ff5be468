"""Where pieces of work are done: in this process, or in others on this machine.

A piece is anything that `jobs.perform` takes; results come back in the order in which they are done, with the place of
the piece.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mdstopo.front.jobs import Job, Setting, open_jobs, perform
from mdstopo.optimizer.state import State
from mdstopo.plan.solve_task import Task
from mdstopo.starts.callbacks import ignore
from mdstopo.workers.worker_pool import StoppedError, WorkerPool

Keep = Callable[[int, State], None]


def ignore_both(place: int, state: State) -> None:
    """Do nothing with the state of a job: it is not saved."""


class Pool(Protocol):
    """Does jobs. `results` yields (place, result) as they are done, and ends early where it is to stop.

    keep: is given (place, state) of tasks that are being worked on, as time goes by. at_once: how many pieces are
    worked on together; 0 where that is not known.
    """

    at_once: int

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]: ...
    def close(self) -> None: ...


class Here:
    """A pool that does one job after the other, in this process."""

    at_once = 1

    def __init__(self, setting: Setting, stop: Callable[[], bool]) -> None:
        self._setting = setting
        self._stop = stop

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]:
        """Yield the results of jobs, in the order of these."""
        for place, job in enumerate(jobs):
            if self._stop():
                return
            try:
                result = perform(self._setting, job, self._stop, partial(keep, place))
            except StoppedError:
                return
            yield place, result

    def close(self) -> None:
        """Do nothing: this pool has no processes."""


class Processes:
    """Several processes on this machine, started when there is something to do."""

    def __init__(
        self, setting: Setting, stop: Callable[[], bool], workers: int, notify: Callable[[str], None] = ignore
    ) -> None:
        self._stop = stop
        self._pool = WorkerPool(open_jobs, setting, workers, notify=notify)
        self.at_once = workers

    def results(self, jobs: Sequence[Job], keep: Keep = ignore_both) -> Iterator[tuple[int, Any]]:
        """Yield the results of jobs as these are done, by processes beside this one."""
        reached: dict[int, State] = {}

        def job(place: int) -> Job:
            """The piece; from where it had come, where a worker is lost."""
            piece = jobs[place]
            return replace(piece, begun=reached[place]) if isinstance(piece, Task) and place in reached else piece

        def hold(place: int, arrays: Mapping[str, NDArray[np.generic]]) -> None:
            reached[place] = State.from_arrays(arrays)
            keep(place, reached[place])

        return self._pool.results(len(jobs), job, keep=hold, stop=self._stop)

    def close(self) -> None:
        """End the workers, in the middle of what they do."""
        self._pool.close()
