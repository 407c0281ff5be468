"""Points of a sample on several processes: each has its share for good, this one the first.

What a point gives does not depend on where it is computed, and results are put together by place, so that no result
depends on the number of processes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from mdstopo.case.model import Case
from mdstopo.evaluation import FloatArray, Rows
from mdstopo.robust.ensemble import Ensemble, PointResult
from mdstopo.robust.sample import Sample, design_sample
from mdstopo.robust.sampled_case import evaluator_at, nominal_case, nominal_evaluator
from mdstopo.robust.trial import Trial, tried
from mdstopo.starts.evaluator_interface import equal_weights, problem_of
from mdstopo.starts.getting_ready import get_ready
from mdstopo.workers.worker_pool import Lost, Parent, Perform, WorkerError, WorkerPool


class PointWorkers:
    """Processes beside this one that compute points of a sample: workers - 1 of them, to be closed in the end.

    notify: is given a sentence for each process that is lost; its share is computed again by another one.
    """

    def __init__(self, case: Case, points: int, workers: int, notify: Callable[[str], None]) -> None:
        self._count = max(1, min(workers, points))
        self._pool = WorkerPool(open_points, case, self._count - 1, sharing=self._count, notify=notify)

    def results(
        self,
        ensemble: Ensemble,
        wanted: Sequence[int],
        design: FloatArray,
        gradient: bool,
        sensitivity: str | None,
        rows: Rows,
    ) -> dict[int, PointResult]:
        """What the wanted points of an ensemble give for a design, by place; see `Ensemble.result_at` for gradient,
        sensitivity and rows. Raises WorkerError where no process can compute a share."""
        names = tuple(objective.name for objective in ensemble.case.objectives)
        shares = [tuple(i for i in wanted if self._owner(i) == k) for k in range(self._count)]
        task = ("results", names, design, gradient, sensitivity, rows)
        replies = self._replies([(*task, share) for share in shares[1:]])
        found = {i: ensemble.result_at(i, design, gradient, sensitivity, rows) for i in shares[0]}
        for reply in replies:
            found |= reply
        return {i: found[i] for i in wanted}

    def trials(self, case: Case, sample: Sample, design: FloatArray) -> list[Trial]:
        """The points of another sample, tried with a design, in order."""
        shares = [tuple(range(k, len(sample), self._count)) for k in range(self._count)]
        replies = self._replies([("trials", sample, design, share) for share in shares[1:]])
        found = {i: tried(case, sample, i, design) for i in shares[0]}
        for reply in replies:
            found |= reply
        return [found[i] for i in range(len(sample))]

    def close(self) -> None:
        """End the processes."""
        self._pool.close()

    def _owner(self, i: int) -> int:
        """Whose a point is: 0 is this process, which has the nominal case, too."""
        return max(i, 0) % self._count

    def _replies(self, requests: Sequence[tuple[Any, ...]]) -> Iterator[Mapping[int, Any]]:
        """Have the workers begin, each with its own; what they answer, by place of the point."""
        results = self._pool.results(len(requests), requests.__getitem__, pinned=True)
        return (_answered(found) for _, found in results)


def _answered(found: Any) -> Mapping[int, Any]:
    if isinstance(found, Lost):
        raise WorkerError(found.reason)
    answer: Mapping[int, Any] = found
    return answer


def open_points(case: Case) -> Perform:
    """In a worker: get ready for points of the case's sample, or of another one."""
    assert case.uncertainty is not None
    nominal = nominal_case(case)
    engine = nominal_evaluator(case)
    # the kernels in the one order in which every process loads them
    get_ready(nominal, engine, problem_of(engine, equal_weights(nominal)), None)
    sample = design_sample(case.uncertainty)
    kept: dict[tuple[int, ...], Ensemble] = {}

    def perform(request: tuple[Any, ...], _parent: Parent) -> dict[int, Any]:
        kind, *rest = request
        if kind == "trials":
            other, design, places = rest
            return {i: tried(case, other, i, design) for i in places}
        names, design, gradient, sensitivity, rows, share = rest
        if share not in kept:
            kept[share] = Ensemble(case, False, {i: evaluator_at(case, sample, i) for i in share})
        chosen = kept[share].with_objectives(names)
        return {i: chosen.result_at(i, design, gradient, sensitivity, rows) for i in share}

    return perform
