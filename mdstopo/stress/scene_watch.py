"""Scenes computed in a process of their own, which is ended where one of them hangs.

Compiled kernels cannot be interrupted from inside.
"""

import contextlib
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType

from mdstopo.compiler.store import cache_folder, is_kept
from mdstopo.stress.judge import judge
from mdstopo.stress.registry import scenes
from mdstopo.stress.scene import Outcome, Scene
from mdstopo.workers.worker_pool import Lost, Parent, Perform, Setup, TooLong, WorkerPool

#: s that a scene may take beside its limit where kernels have still to be compiled for it
COMPILING = 300.0


def _marker() -> Path:
    """An empty file that says that the kernels of all scenes are cached."""
    return cache_folder() / "ready-stress"


def compiled() -> bool:
    """Whether all scenes have been computed here with this version."""
    return is_kept(_marker().name)


def open_scenes(_: object) -> Perform:
    """In the other process: what computes a scene by its name."""
    known = scenes()

    def perform(name: str, _parent: Parent) -> tuple[str, float | None, str, float, str]:
        found = judge(known[name])
        return found.outcome, found.error, found.message, found.seconds, found.note

    return perform


class Watch:
    """Computes scenes in another process, which ends with this context manager. setup: called once in that process."""

    def __init__(self, setup: Setup = open_scenes) -> None:
        self._compiling = 0.0 if compiled() else COMPILING
        self._done: set[str] = set()
        self._pool = WorkerPool(setup, None, 1, attempts=1)

    def __enter__(self) -> "Watch":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.close()
        if self._done >= {name for name, each in scenes().items() if not each.long}:
            with contextlib.suppress(OSError):
                _marker().touch()

    def outcomes(self, chosen: Iterable[Scene]) -> Iterator[Outcome]:
        """How each scene ends, in order."""
        for scene in chosen:
            yield self.outcome(scene)

    def outcome(self, scene: Scene) -> Outcome:
        """How a scene ends; it hangs where it does not within its limit."""
        began = time.perf_counter()
        ((_, found),) = self._pool.results(1, lambda _: scene.name, limit=scene.limit + self._compiling)
        seconds = time.perf_counter() - began
        if isinstance(found, TooLong):
            return Outcome(scene, "hangs", None, f"not done after {found.seconds:.0f} s", seconds)
        if isinstance(found, Lost):
            return Outcome(scene, "crashes", None, f"the process ended with {found.status}", seconds)
        self._done.add(scene.name)
        return Outcome(scene, *found)
