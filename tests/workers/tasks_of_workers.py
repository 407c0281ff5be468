"""What workers of the pool's tests do: a module of its own, so that none of them has to import pytest."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mdstopo.compiler.threads import VARIABLE
from mdstopo.workers.worker_pool import Parent, StoppedError, WorkerPool


def open_numbers(factor: int) -> Callable[[Any, Parent], Any]:
    """What the workers of these tests do: a number, multiplied; or what a word says."""
    done: list[Any] = []

    def perform(task: Any, parent: Parent) -> Any:
        done.append(task)
        match task:
            case int():
                return factor * task
            case "pid":
                return os.getpid()
            case "done":
                return done[:-1]
            case "threads":
                return os.environ[VARIABLE], os.environ["NUMBA_NUM_THREADS"]
            case "print":
                print("this must not disturb")
                return "printed"
            case "sleep":
                time.sleep(60.0)
            case "raise":
                raise ValueError("no such number")
            case "local":
                raise type("LocalError", (Exception,), {})("cannot be sent")
            case "until stopped":
                while not parent.stopped():
                    parent.keep(lambda: "on the way")
                    time.sleep(0.01)
                raise StoppedError
            case ("die", path):
                parent.keep(lambda: "nearly")
                if not Path(path).exists():
                    Path(path).touch()
                    os.kill(os.getpid(), signal.SIGKILL)
                return "done by another one"
            case ("always die", status):
                os._exit(status)
        raise AssertionError(task)

    return perform


def open_broken(_: object) -> Callable[[Any, Parent], Any]:
    raise RuntimeError("cannot get ready")


def pool(workers: int, **more: Any) -> WorkerPool:
    return WorkerPool(open_numbers, 10, workers, **more)
