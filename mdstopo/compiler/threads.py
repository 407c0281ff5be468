"""Threads, where they pay: one kernel on several of them (`mechanics.passes`), or a few calls side by side (`engine`).

The threads are the system's own. They are made when a pass begins and have ended when it is over, which costs some 30
microseconds; so none waits or spins in between, and an error or Ctrl-C finds none. Nothing here imports Numba.
"""

import os
from collections import deque
from collections.abc import Callable, Sequence
from contextvars import copy_context
from threading import Thread
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdstopo.compiler.kernel import when_compiling

#: threads of one pass at most
MOST_THREADS = 64
VARIABLE = "MDSTOPO_THREADS"


class ThreadsError(Exception):
    """The environment asks for a number of threads that is none."""

    exit_status = 2


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def allowed() -> int:
    """How many threads a pass may take: MDSTOPO_THREADS, else one a core. Raises ThreadsError."""
    asked = os.environ.get(VARIABLE, "")
    if not asked:
        return min(cores(), MOST_THREADS)
    if not (asked.isascii() and asked.isdigit() and 1 <= int(asked) <= MOST_THREADS):
        raise ThreadsError(f"MDSTOPO_THREADS is {asked!r}, not a number of threads from 1 to {MOST_THREADS}")
    return int(asked)


class CallOutcome(NamedTuple):
    """What a call returned, or the error that it raised."""

    value: Any = None
    error: Exception | None = None

    def result(self) -> Any:
        """The value; raises the error."""
        if self.error is not None:
            raise self.error
        return self.value


def side_by_side(calls: Sequence[Callable[[], Any]], threads: int) -> list[CallOutcome]:
    """Make calls on so many threads, of which this is one, taken in their order; returns the outcome of each.

    Compiled code lets other threads run meanwhile, Python does not. An interrupt of this thread (Ctrl-C) is raised once
    the calls that have begun are over; the others are not made.
    """
    waiting = deque(enumerate(calls))
    found = [CallOutcome()] * len(calls)

    def work() -> None:
        while waiting:
            try:
                place, call = waiting.popleft()
            except IndexError:  # another thread has taken the last one
                return
            try:
                found[place] = CallOutcome(call())
            except Exception as error:
                found[place] = CallOutcome(error=error)

    others = [Thread(target=copy_context().run, args=(work,)) for _ in range(min(threads, len(calls)) - 1)]
    for other in others:
        other.start()
    try:
        work()
    finally:
        waiting.clear()
        for other in others:
            other.join()
    return found


def shared(kernel: Callable[..., None], threads: int, job: tuple[Any, ...]) -> None:
    """Call kernel(*job) on so many threads, of which this is one; back when all calls are.

    The kernel takes pieces of the work by `taken` until there are none, so no result depends on how many threads there
    are: where the system refuses one, the others do its work. In kernels only; the kernel returns nothing.
    """
    raise TypeError("kernels share work; Python calls them")


def taken(counter: NDArray[np.int64]) -> int:
    """The next piece of work, each given once: the first number of an array, and one more there, as one operation."""
    counter[0] += 1
    return int(counter[0]) - 1


@when_compiling
def _register() -> None:
    """Make `shared` and `taken` known to Numba."""
    from mdstopo.compiler.tried import way

    way().enter_threads()
