"""One interleaved run with programs in a folder outside of this repository: their own benchmark, joined by ours.

The folder holds a `bench.py TABLE ... --join MODULE:key=value`, which prints a Markdown table with a row for each
setting. It runs in an interpreter that has both the peers and what mdstopo needs.
"""

import os
import re
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.speed import LEVELS
from mdstopo.bench.tables import Table, significant, verdict

TABLES = ("fig6", "random", "interior", "interior_random")
OURS = "benchmarks.join_peers"
TOLERANCES = (1e-3, 2e-4, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)
#: share of the fastest peer's time that is allowed
BAR = 0.2

_ROW = re.compile(r"^\| (?P<label>[^|]+?) \| (?P<value>[^|]*) \| (?P<error>[^|]*) \| (?P<ms>[0-9.]+) \(")


@dataclass(frozen=True)
class Timed:
    """A setting of a program: relative error of its gradient, median ms."""

    label: str
    error: float
    ms: float

    @property
    def ours(self) -> bool:
        """Whether it is mdstopo."""
        return self.label.startswith(OURS)


def outside(folder: str, python: str) -> Iterator[Table]:
    """A table for each of theirs. Raises FileNotFoundError where there is no bench.py, RuntimeError where it fails."""
    place = Path(folder).resolve()
    if not (place / "bench.py").exists():
        raise FileNotFoundError(f"{folder} has no bench.py")
    for name in TABLES:
        yield _compare(name, _run(place, python, name))


def _run(place: Path, python: str, name: str) -> str:
    command = [python, str(place / "bench.py"), name]
    for tolerance in TOLERANCES:
        command += ["--join", f"{OURS}:tolerance={tolerance}"]
    here = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
    done = subprocess.run(
        command, cwd=place, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{place / 'bench.py'} failed: {done.stderr.strip()[-500:]}")
    print(done.stdout, flush=True)
    return done.stdout


def _compare(name: str, printed: str) -> Table:
    timed = [
        Timed(found["label"], float(found["error"]), float(found["ms"]))
        for line in printed.splitlines()
        if (found := _ROW.match(line)) and found["error"].strip()
    ]
    rows = []
    for level in LEVELS:
        good = [each for each in timed if each.error <= level]
        own = min((each for each in good if each.ours), key=lambda each: each.ms, default=None)
        other = min((each for each in good if not each.ours), key=lambda each: each.ms, default=None)
        rows.append(
            [
                f"{level:.0e}",
                *_cells(own, f"{OURS} "),
                *_cells(other, ""),
                "" if own is None or other is None else significant(own.ms / other.ms, 2),
                verdict(own is not None and (other is None or own.ms <= BAR * other.ms)),
            ]
        )
    return Table(
        f"{name}: objective and exact gradient beside the fastest peer",
        ("error at most", "mdstopo", "ms", "fastest peer", "ms", "ratio", f"at most {BAR:g}"),
        rows,
    )


def _cells(each: Timed | None, prefix: str) -> list[str]:
    return ["none", ""] if each is None else [each.label.removeprefix(prefix), f"{each.ms:.3f}"]
