"""Tasks given to worker processes, and their results taken in.

A worker is a fresh interpreter that is given a setup, what all tasks have in common, and one task after the other. It
ignores the terminal's Ctrl-C and ends when its input is closed, so that it neither spoils a clean stop nor outlives a
parent that is killed. Where a worker ends before its task is done, whoever asks is told its process id, and the task is
done again by another one.

What a task comes to must not depend on the worker, nor on what that has done before: then no result depends on how many
there are, or on what happens to them.
"""

import os
import pickle
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import IO, Any, Protocol

from mdstopo.children import command
from mdstopo.compiler.threads import VARIABLE, cores

#: seconds from one check whether to stop to the next, and of tasks that take too long
PATIENCE = 0.1
#: seconds that a worker with nothing to do is given to end by itself
ENDING = 5.0


class WorkerError(Exception):
    """A task could not be finished by worker processes; the message is a sentence for the user."""

    exit_status = 1


class StoppedError(Exception):
    """A task was left in the middle, as it was asked to."""


class Parent(Protocol):
    """What a task in a worker may ask of the process that gave it the task."""

    def stopped(self) -> bool:
        """Whether the task is to end as soon as it can."""
        ...

    def keep(self, state: Callable[[], object]) -> None:
        """Report how far the task has come; `state` is called now and then, and what it returns is sent."""
        ...


#: does one task; raises StoppedError where it is left because it was to stop
Perform = Callable[[Any, Parent], Any]
#: a function of a module, called once in each worker with what all tasks have in common
Setup = Callable[[Any], Perform]


@dataclass(frozen=True)
class Lost:
    """What stands for the result of a task that no worker finished. status: which the last one ended with."""

    reason: str
    status: int = 0


@dataclass(frozen=True)
class TooLong:
    """What stands for the result of a task that took longer than it may. seconds: after which it was ended."""

    seconds: float


@dataclass
class _Round:
    """Tasks that are done together: task(place) is called whenever one is given to a worker.

    waiting: places of those that no worker has; attempts: how often each was given to one.
    """

    task: Callable[[int], object]
    waiting: list[int]
    keep: Callable[[int, Any], None]
    stop: Callable[[], bool]
    limit: float
    pinned: bool
    attempts: dict[int, int] = field(default_factory=dict)


def _nothing_kept(_place: int, _state: object) -> None:
    """Take what a task has kept and do nothing with it."""


def _never() -> bool:
    return False


def _ignore(_words: str) -> None:
    """Take a sentence and do nothing with it."""


class WorkerPool:
    """A context manager with at most so many worker processes, started when there is something to do."""

    def __init__(
        self,
        setup: Setup,
        common: object,
        workers: int,
        *,
        sharing: int = 0,
        attempts: int = 2,
        notify: Callable[[str], None] = _ignore,
    ) -> None:
        """Start no process yet.

        setup: a function of a module, called once in each worker with `common`; it returns what does a task.
        common: what all tasks have in common.
        workers: how many processes at most.
        sharing: how many processes share the machine's cores; 0: the workers.
        attempts: how often a task is given to a worker.
        notify: is given a sentence for each worker that is lost.
        """
        self._first = pickle.dumps((setup, common))
        self._threads = max(1, cores() // (sharing or workers))
        self._attempts = attempts
        self._notify = notify
        self._inbox: queue.Queue[tuple[_Worker, Any]] = queue.Queue()
        self._workers: list[_Worker | None] = [None] * workers

    def __enter__(self) -> "WorkerPool":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def results(
        self,
        count: int,
        task: Callable[[int], object],
        *,
        keep: Callable[[int, Any], None] = _nothing_kept,
        stop: Callable[[], bool] = _never,
        limit: float = float("inf"),
        pinned: bool = False,
    ) -> Iterator[tuple[int, Any]]:
        """(place, result) of the tasks 0 to count - 1 as they are done; work begins at once.

        count: how many tasks there are.
        task: gives what a worker is sent for task k; called whenever it is given to one.
        keep: is given (place, what a task has kept).
        stop: is asked again and again; then tasks that have begun end when they can, others do not begin, and what has
          no result is left out.
        limit: seconds after which a task is ended.
        pinned: task k is for worker k alone, which may remember what it did before.

        A result is `Lost` where no worker finished the task, and `TooLong` where it took longer than it may. What a
        task raises is raised here.
        """
        self._leave()
        if stop():
            return iter(())
        work = _Round(task, list(range(count)), keep, stop, limit, pinned)
        self._give(work)
        return self._take(work)

    def close(self) -> None:
        """End the workers, in the middle of what they do."""
        for worker in self._workers:
            if worker is not None:
                worker.close()
        self._workers = [None] * len(self._workers)

    def _leave(self) -> None:
        """End workers whose results are not wanted any more."""
        for slot, worker in enumerate(self._workers):
            if worker is not None and (worker.place is not None or worker.has_ended):
                worker.close()
                self._workers[slot] = None

    def _give(self, work: _Round) -> None:
        """Give tasks that wait to workers that have none."""
        for slot, worker in enumerate(self._workers):
            mine = [place for place in work.waiting if not work.pinned or place == slot]
            if not mine or (worker is not None and worker.place is not None):
                continue
            if worker is None:
                worker = self._workers[slot] = _Worker(self._first, self._threads, self._inbox)
            place = mine[0]
            work.waiting.remove(place)
            work.attempts[place] = work.attempts.get(place, 0) + 1
            worker.give(place, work.task(place))

    def _take(self, work: _Round) -> Iterator[tuple[int, Any]]:
        stopping = False
        while self._busy:
            if not stopping and work.stop():
                stopping = True
                work.waiting.clear()
                for worker in self._busy:
                    worker.send(("stop", None))
            for worker in self._busy:
                if time.perf_counter() - worker.began > work.limit:
                    place, seconds = worker.place, time.perf_counter() - worker.began
                    self._drop(worker)
                    assert place is not None
                    yield place, TooLong(seconds)
            try:
                worker, message = self._inbox.get(timeout=PATIENCE if self._busy else 0.0)
            except queue.Empty:
                self._give(work)
                continue
            if worker not in self._workers:
                continue  # it was ended
            if message is None:
                yield from self._lost(work, worker, stopping)
            else:
                yield from self._told(work, worker, *message)
            self._give(work)

    def _told(self, work: _Round, worker: "_Worker", kind: str, what: Any) -> Iterator[tuple[int, Any]]:
        """What a worker says of its task."""
        place = worker.place
        assert place is not None
        if kind == "kept":
            work.keep(place, what)
            return
        worker.place = None
        if kind == "raised":
            raise what
        if kind == "done":
            yield place, what

    def _lost(self, work: _Round, worker: "_Worker", stopping: bool) -> Iterator[tuple[int, Any]]:
        """Have another worker do the task of one that has ended by itself, or give the task up."""
        place = worker.place
        status = self._drop(worker)
        if place is None:
            return
        if work.attempts[place] >= self._attempts:
            yield place, Lost(f"a worker process (pid {worker.pid}) ended unexpectedly", status)
        elif not stopping:
            self._notify(f"a worker process (pid {worker.pid}) ended unexpectedly: another one does its task")
            work.waiting.insert(0, place)

    def _drop(self, worker: "_Worker") -> int:
        """End a worker; what it ended with."""
        self._workers[self._workers.index(worker)] = None
        return worker.close()

    @property
    def _busy(self) -> "list[_Worker]":
        return [worker for worker in self._workers if worker is not None and worker.place is not None]


class _Worker:
    """One process, and a thread that listens to it: messages arrive in `inbox` as (this, message), None at its end.

    place: of the task that it has, since `began`.
    """

    def __init__(self, first: bytes, threads: int, inbox: "queue.Queue[tuple[_Worker, Any]]") -> None:
        own = {"NUMBA_NUM_THREADS": str(threads), VARIABLE: str(threads)}
        self._process = subprocess.Popen(
            command("mdstopo.workers.worker_program"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **own},
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._input: IO[bytes] = self._process.stdin
        self._output: IO[bytes] = self._process.stdout
        self._inbox = inbox
        self.pid = self._process.pid
        self.place: int | None = None
        self.began = 0.0
        self._send(first)
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    @property
    def has_ended(self) -> bool:
        """Whether the process is gone."""
        return self._process.poll() is not None

    def give(self, place: int, task: object) -> None:
        """Send it a task."""
        self.place, self.began = place, time.perf_counter()
        self.send(("task", task))

    def send(self, message: object) -> None:
        """Send a message; that the worker is gone is told by the thread that listens to it."""
        self._send(pickle.dumps(message))

    def _send(self, message: bytes) -> None:
        with suppress(BrokenPipeError, ValueError):
            pickle.dump(message, self._input)
            self._input.flush()

    def close(self) -> int:
        """Let it end, or end it where it has a task; what it ended with."""
        with suppress(BrokenPipeError):
            self._input.close()
        try:
            if self.place is not None:
                self._process.kill()
            self._process.wait(timeout=ENDING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._listener.join()
        return self._process.returncode

    def _listen(self) -> None:
        with self._output:
            while True:
                try:
                    message = pickle.load(self._output)
                except (EOFError, OSError, ValueError, pickle.UnpicklingError):
                    message = None
                self._inbox.put((self, message))
                if message is None:
                    return
