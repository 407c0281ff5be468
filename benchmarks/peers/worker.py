"""One program in a process of its own: `python -m benchmarks.peers.worker`, which talks JSON, a line each way.

    {"do": "open", "module", "folder", "core"} -> {"seconds"}: the packages are loaded
    {"do": "make", "setting", "gradient"}     -> {"seconds", "errors", "memory"}: of G and gradient at each design
    {"do": "time", "which", "design", "seconds"} -> {"times", "processor"}: seconds of each call, and of one on the mean

An answer {"failed"} says in a sentence what did not work. The folder has what `race` wrote.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from benchmarks.peak_memory import peak_memory

#: fewest calls of a round, unless they have taken so many seconds
CALLS, LONG = 3, 1.0


class Worker:
    """What has been opened and made."""

    def __init__(self) -> None:
        self._calls: list[Callable[[int], object]] = []

    def open(self, module: str, folder: str, core: int | None) -> dict[str, Any]:
        """Load the data and the program's packages, on one core where one is given."""
        if core is not None and hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {core})
        began = time.perf_counter()
        from importlib import import_module

        import numpy as np

        from benchmarks.peers.problem import Problem

        self._module = import_module(module)
        place = Path(folder)
        self._problem = Problem.load(place / "problem.npz")
        with np.load(place / "truth.npz") as truth:
            self._alpha, self._value, self._gradient = truth["alpha"], truth["value"], truth["gradient"]
        return {"seconds": time.perf_counter() - began}

    def make(self, setting: dict[str, Any], gradient: bool) -> dict[str, Any]:
        """Make an objective and call it for every design; what the first call took counts as compiling."""
        import numpy as np

        began = time.perf_counter()
        objective = self._module.make(self._problem, **setting)
        objective(self._alpha[0], gradient)
        seconds = time.perf_counter() - began
        errors: list[tuple[float, float | None]] = []
        for alpha, value, slopes in zip(self._alpha, self._value, self._gradient, strict=True):
            found, own = objective(alpha, gradient)
            wrong = None if own is None else float(np.max(np.abs(own - slopes)) / np.max(np.abs(slopes)))
            errors.append((float(abs(found - value) / abs(value)), wrong))
        self._calls.append(lambda design: objective(self._alpha[design], gradient))
        return {"seconds": seconds, "errors": errors, "memory": peak_memory() / 1024**2}

    def time(self, which: int, design: int, seconds: float) -> dict[str, Any]:
        """Call for so many seconds, and a few times unless that takes long; once at least."""
        call, times = self._calls[which], []
        call(design)  # what a program keeps from the last call is of this design, as in an optimisation
        start, busy = time.perf_counter(), time.process_time()
        while (spent := time.perf_counter() - start) < seconds or (len(times) < CALLS and spent < LONG) or not times:
            began = time.perf_counter()
            call(design)
            times.append(time.perf_counter() - began)
        # once for all calls: asking for it takes as long as a part of the shortest
        return {"times": times, "processor": (time.process_time() - busy) / len(times)}


def serve(requests: TextIO, answers: TextIO) -> None:
    """Answer until there are no more requests."""
    worker = Worker()
    for line in requests:
        request = json.loads(line)
        act = {"open": worker.open, "make": worker.make, "time": worker.time}[request.pop("do")]
        try:
            answer = act(**request)
        except Exception as error:  # whatever a program raises is told, and the others go on
            answer = {"failed": f"{type(error).__name__}: {' '.join(str(error).split())[-300:]}"}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    # whatever a program prints goes to standard error
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    serve(sys.stdin, answers)
