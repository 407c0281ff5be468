"""Whether parts of our own pay beside what a library offers: each left out in a process of its own, timed in turns.

A part stays where it saves at least 5 % on a scene that users have.
"""

import importlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.scenes import CASES
from mdstopo.bench.tables import Table, verdict

#: rounds through all processes, and seconds that each is timed for in a round
ROUNDS, SECONDS = 31, 0.15
BAR = 1.05


def _with_libm_powers() -> None:
    def one_by_one(t, exponent, out, room):  # type: ignore[no-untyped-def]
        for i in range(len(t)):
            out[i] = t[i] ** exponent

    kernel: Any = importlib.import_module("mdstopo.optimizer.powers").powers
    kernel.py_func = one_by_one


def _with_numba_counting() -> None:
    from mdstopo.compiler.kernel import way

    way()
    passes: Any = importlib.import_module("mdstopo.compiler.numba_private.function_passes")
    del passes.LEANER[passes.NativeLowering]


#: by part: the case, its integrator, what is timed, and how the part is left out
PARTS: dict[str, tuple[str, str, str, Callable[[], None]]] = {
    "own powers": ("fig7-g1", "gauss", "optimize", _with_libm_powers),
    "own powers, where few are needed": ("fig6", "gauss", "optimize", _with_libm_powers),
    "own counting of what arrays hold": ("fig6", "runge_kutta", "evaluate", _with_numba_counting),
}


def parts(names: str = "") -> Iterator[Table]:
    """One table: what each part saves. names: of the parts, separated by semicolons; all without."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for part in names.split(";") if names else PARTS:
            whole, bare = _Child(part, True, Path(folder)), _Child(part, False, Path(folder))
            times: list[tuple[float, float]] = [(whole.time(), bare.time()) for _ in range(ROUNDS)]
            ratios = sorted(other / own for own, other in times)
            low, middle, high = (ratios[round(share * (ROUNDS - 1))] for share in (0.25, 0.5, 0.75))
            case, integrator, what, _ = PARTS[part]
            rows.append(
                [
                    part,
                    f"{what} {case}, {integrator}",
                    *(f"{1e3 * median(column):.3f}" for column in zip(*times, strict=True)),
                    f"{middle:.3f} ({low:.3f} - {high:.3f})",
                    f"{whole.compiling:.0f} / {bare.compiling:.0f}",
                    verdict(middle >= BAR),
                ]
            )
            for child in (whole, bare):
                child.end()
    compiling = "compiling with / without, s of the processor"
    columns = ("part", "what", "with, ms", "without, ms", "ratio, median (quartiles)", compiling, "pays")
    yield Table("What parts of our own save", columns, rows)


class _Child:
    """A process that computes a case with a part or without it, and times that when it is asked to."""

    def __init__(self, part: str, kept: bool, folder: Path) -> None:
        environment = os.environ | {"MDSTOPO_CACHE_DIR": tempfile.mkdtemp(dir=folder)}
        words = [sys.executable, "-m", "benchmarks.parts", part, "whole" if kept else "bare"]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, env=environment, text=True)
        self.compiling = self._answer()

    def _answer(self) -> float:
        assert self._process.stdout is not None
        return float(self._process.stdout.readline())

    def time(self) -> float:
        """Seconds a call."""
        assert self._process.stdin is not None
        print("time", file=self._process.stdin, flush=True)
        return self._answer()

    def end(self) -> None:
        """Let it go."""
        self._process.communicate()


def _call(case: str, integrator: str, what: str) -> Callable[[], object]:
    import yaml

    import mdstopo
    from mdstopo.case.reader import read_case

    stated = yaml.safe_load((CASES / f"{case}.yaml").read_text(encoding="utf-8"))
    stated.setdefault("solver", {})["integrator"] = integrator
    made = read_case(yaml.safe_dump(stated))
    if what == "evaluate":
        return lambda: mdstopo.evaluate(made)
    place = Path(tempfile.mkdtemp()) / "result.h5"
    return lambda: mdstopo.optimize(made, path=place, overwrite=True, workers=1)


class _NoProcess(subprocess.Popen[bytes]):
    """In place of a process that would compile beside this one, where nothing is left out."""

    def __init__(self, *_: object, **__: object) -> None:
        raise OSError("no process beside this one")


def _serve(part: str, kept: bool) -> None:
    """Compute the case once, then time it whenever a line arrives."""
    case, integrator, what, leave_out = PARTS[part]
    if not kept:
        leave_out()
    subprocess.Popen = _NoProcess  # type: ignore[assignment,misc]
    call = _call(case, integrator, what)
    began = time.process_time()
    call()
    compiling = time.process_time() - began
    from mdstopo.compiler.kernel import way  # not before the call: what it loads would be missing from its time

    if way().__name__ != "mdstopo.compiler.numba_private":
        raise RuntimeError(f"without {part} Numba compiles in its own way, which is another comparison")
    print(compiling, flush=True)
    for _ in sys.stdin:
        times = []
        end = time.perf_counter() + SECONDS
        while len(times) < 3 or time.perf_counter() < end:
            began = time.perf_counter()
            call()
            times.append(time.perf_counter() - began)
        print(median(times), flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1], sys.argv[2] == "whole")
