"""Scenes computed in a process of their own, which is ended where one of them hangs."""

import contextlib
import json
import math
import select
import subprocess
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType

from mdstopo.children import command
from mdstopo.stress.scene import Outcome, Scene

#: s that a scene may take beside its limit where kernels have still to be compiled for it
COMPILING = 300.0


def _marker() -> Path:
    """An empty file that says that the kernels of all scenes are cached."""
    from mdstopo.compiler.store import cache_folder

    return cache_folder() / "ready-stress"


def compiled() -> bool:
    """Whether all scenes have been computed here with this version."""
    return _marker().exists()


class Watch:
    """Computes scenes one after another; a context manager, because a process belongs to it."""

    def __init__(self) -> None:
        self._compiling = 0.0 if compiled() else COMPILING
        self._done: set[str] = set()
        self._worker: subprocess.Popen[str] | None = None

    def __enter__(self) -> "Watch":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        from mdstopo.stress.registry import scenes

        if self._done >= {name for name, each in scenes().items() if not each.long}:
            with contextlib.suppress(OSError):
                _marker().touch()

    def outcomes(self, scenes: Iterable[Scene]) -> Iterator[Outcome]:
        """How each scene ends, in order."""
        for scene in scenes:
            yield self.outcome(scene)

    def outcome(self, scene: Scene) -> Outcome:
        """How a scene ends; it hangs where it does not within its limit."""
        if self._worker is None:
            self._worker = _started()
        worker = self._worker
        assert worker.stdin is not None
        assert worker.stdout is not None
        began = time.perf_counter()
        print(scene.name, file=worker.stdin, flush=True)
        ready, _, _ = select.select([worker.stdout], [], [], scene.limit + self._compiling)
        line = worker.stdout.readline() if ready else ""
        seconds = time.perf_counter() - began
        if not line:
            code = self._end()
            if not ready:
                return Outcome(scene, "hangs", None, f"not done after {seconds:.0f} s", seconds)
            return Outcome(scene, "crashes", None, f"the process ended with {code}", seconds)
        outcome, error, message, seconds, note = json.loads(line)
        self._done.add(scene.name)
        return Outcome(scene, outcome, math.nan if outcome == "not finite" else error, message, seconds, note)

    def _end(self) -> int:
        """End the worker; what it ended with."""
        worker, self._worker = self._worker, None
        if worker is None:
            return 0
        if worker.poll() is None:
            worker.kill()
        for stream in (worker.stdin, worker.stdout):
            if stream is not None:
                stream.close()
        return worker.wait()


def _started() -> "subprocess.Popen[str]":
    return subprocess.Popen(command("mdstopo.stress.worker"), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
