"""The result file of a run, kept up to date while the run goes on."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from mdstopo.session.final_design import NOT_COMPUTED, FinalDesign
from mdstopo.session.run_state import RunState
from mdstopo.starts.callbacks import Notify
from mdstopo.starts.evaluator_interface import Engine
from mdstopo.status import RunStatus
from mdstopo.store.checkpoint import Checkpointer
from mdstopo.store.contents import Contents
from mdstopo.store.writing import write_result
from mdstopo.workers.worker_pool import WorkerError

_DISK_SPEED = 2e8  # bytes a second: a first guess of what a checkpoint costs, until one has been timed
_STATE_ARRAYS = 16  # arrays of N numbers that a checkpoint holds for each start, roughly


class RunFile:
    """The file of a run; without a path nothing is written.

    path: a place that this process may write, or None. state: what is saved. notify: is given a sentence where a
    checkpoint cannot be written. command: the command line, for the record.
    warnings: those of the case, as sentences.
    """

    def __init__(self, path: Path | None, state: RunState, notify: Notify, command: str) -> None:
        self.path = path
        self._state = state
        self._notify = notify
        self._command = command
        self.warnings = tuple(mistake.message for mistake in state.stated.warnings)
        self._contents: Contents | None = None

    def open(self, engine: Engine) -> None:
        """Collect what is the same each time the file is written. engine: the case's evaluator."""
        if self.path is None:
            return
        state = self._state
        case, chosen = state.case, state.case.optimizer
        settings: dict[str, str | int | float | bool] = {
            "integrator": engine.integrator,
            "integrator_reason": engine.integrator_reason,
            "sensitivity": engine.sensitivity,
            "solver_tolerance": case.solver.tolerance,
            "preset": chosen.preset,
            "max_iterations": chosen.max_iterations,
            "tolerance": chosen.tolerance,
            "starts": chosen.starts,
            "seed": chosen.seed,
        }
        fixed = state.members_part()
        if state.initial is not None:
            fixed["design/initial"] = state.initial
        self._contents = Contents.begun(case, "run", self._command, fixed, settings)

    def take_members(self) -> None:
        """Hold the members that a round of pricing has built."""
        if self._contents is not None:
            datasets = self._contents.datasets | self._state.members_part()
            self._contents = replace(self._contents, case=self._state.case, datasets=datasets)

    def save(self, status: RunStatus, reason: str, final: FinalDesign = NOT_COMPUTED) -> None:
        """Write the file as a whole, where there is one. Raises StoreError."""
        if self.path is None:
            return
        assert self._contents is not None
        part = final.datasets | self._state.part(final.objectives)
        write_result(self.path, self._contents.now(status.value, reason, part, self.warnings + final.warnings))

    def saver(self) -> Callable[[], None]:
        """What is called after each step of the run, and saves it when it is time."""
        if self.path is None:
            return lambda: None
        case = self._state.case
        size = 8.0 * case.space.size * _STATE_ARRAYS * case.optimizer.starts
        checkpointer = Checkpointer(
            lambda: self.save(RunStatus.RUNNING, "running"), size / _DISK_SPEED, notify=self._notify
        )

        def offer() -> None:
            checkpointer.offer()

        return offer

    @contextmanager
    def saved_without_worker(self) -> Iterator[None]:
        """What has been reached is saved where a worker is lost; the WorkerError goes on."""
        try:
            yield
        except WorkerError as error:
            if self._state.best is not None:
                self.save(RunStatus.INTERRUPTED, str(error))
            raise
