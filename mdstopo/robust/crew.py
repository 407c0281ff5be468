"""Points of a sample on several processes: each has its share for good, this one the first.

What a point gives does not depend on where it is computed, and parts are put together by place, so that no result
depends on the number of processes.
"""

import queue
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mdstopo.case.model import Case
from mdstopo.evaluation import FloatArray
from mdstopo.robust.sample import Sample
from mdstopo.session.crew import WorkerProcess
from mdstopo.session.errors import WorkerError

if TYPE_CHECKING:
    from mdstopo.robust.ensemble import Ensemble, Part
    from mdstopo.robust.trial import Trial


class Crew:
    """workers - 1 processes beside this one. Close it in the end."""

    def __init__(self, case: Case, points: int, workers: int) -> None:
        self._count = max(1, min(workers, points))
        self._inbox: queue.Queue[tuple[WorkerProcess, Any]] = queue.Queue()
        self._workers = [
            WorkerProcess("mdstopo.robust.worker", (case, self._share(points, k)), self._count, self._inbox)
            for k in range(1, self._count)
        ]

    def parts(
        self, ensemble: "Ensemble", wanted: Sequence[int], design: FloatArray, gradient: bool, sensitivity: str | None
    ) -> "dict[int, Part]":
        """What the wanted points give, by place. Raises WorkerError where a process has ended."""
        names = tuple(objective.name for objective in ensemble.case.objectives)
        for worker in self._workers:
            worker.send(("parts", names, design, gradient, sensitivity, tuple(wanted)))
        found = {i: ensemble.part(i, design, gradient, sensitivity) for i in wanted if self._is_own(i)}
        for reply in self._replies():
            found |= reply
        return {i: found[i] for i in wanted}

    def trials(self, case: Case, sample: Sample, design: FloatArray) -> "list[Trial]":
        """The points of another sample, tried with a design, in order."""
        from mdstopo.robust.trial import tried

        for k, worker in enumerate(self._workers, start=1):
            worker.send(("trials", sample, design, self._share(len(sample), k)))
        found = {i: tried(case, sample, i, design) for i in self._share(len(sample), 0)}
        for reply in self._replies():
            found |= reply
        return [found[i] for i in range(len(sample))]

    def close(self) -> None:
        """End the processes."""
        for worker in self._workers:
            worker.close()
        self._workers = []

    def _share(self, points: int, k: int) -> tuple[int, ...]:
        return tuple(range(k, points, self._count))

    def _is_own(self, i: int) -> bool:
        return i < 0 or i % self._count == 0

    def _replies(self) -> list[Any]:
        replies: dict[WorkerProcess, Any] = {}
        while len(replies) < len(self._workers):
            worker, message = self._inbox.get()
            if message is None:
                raise WorkerError(f"a worker process (pid {worker.pid}) ended unexpectedly")
            replies[worker] = message
        return [replies[worker] for worker in self._workers]
