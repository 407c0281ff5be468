"""Programs timed together: a process for each, rounds that go through all settings of all of them in turn."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

import numpy as np

from benchmarks.peers.problem import Floats, Problem
from benchmarks.peers.seat_problem import SeatProblem
from benchmarks.peers.table import PEERS, Peer
from mdstopo.bench.reference import Reference

ROUNDS, SECONDS = 7, 0.05


@dataclass(frozen=True)
class Field:
    """What all run on. designs (D, N); truths: G and gradient at each; one_core: whether all share one core in turn."""

    problem: Problem | SeatProblem
    designs: Sequence[Floats]
    truths: Sequence[Reference]
    one_core: bool = True


@dataclass(frozen=True)
class Entry:
    """A program with a setting, with or without the gradient."""

    peer: str
    setting: Mapping[str, Any] = field(default_factory=dict)
    gradient: bool = True

    @property
    def label(self) -> str:
        """The setting in words."""
        return ", ".join(f"{key} {_plain(value)}" for key, value in self.setting.items())


@dataclass(frozen=True)
class Measured:
    """An entry's errors (relative; of the gradient None where there is none), medians of its rounds in seconds.

    processor: the same, of what its process had of the processors, which hardly depends on what else the machine does;
    loading: seconds until its packages are there; making: until the first result; memory: peak of its process, MiB.
    """

    entry: Entry
    value_error: float
    gradient_error: float | None
    rounds: Sequence[float]
    processor: Sequence[float]
    loading: float
    making: float
    memory: float

    @property
    def seconds(self) -> float:
        """The median."""
        return median(self.rounds)

    @property
    def processor_seconds(self) -> float:
        """The median of processor times."""
        return median(self.processor)

    @property
    def quartiles(self) -> tuple[float, float]:
        """Lower and upper."""
        if len(self.rounds) < 2:
            return self.seconds, self.seconds
        low, _, high = quantiles(self.rounds, n=4, method="inclusive")
        return low, high

    @property
    def error(self) -> float:
        """Of the gradient, or of G where there is no gradient."""
        return self.value_error if self.gradient_error is None else self.gradient_error


def race(
    course: Field,
    entries: Sequence[Entry],
    tell: Callable[[str], None] = print,
    rounds: int = ROUNDS,
    seconds: float = SECONDS,
    peers: Mapping[str, Peer] = PEERS,
) -> list[list[Measured]]:
    """For each design everything that works, in the order of the entries.

    course: what all run on.
    entries: programs with their settings.
    tell: given a sentence before what takes long, and for whatever is left out, and why.
    rounds, seconds: how often all are timed in turn, and how long each is then repeated.
    peers: all programs by name.
    """
    with TemporaryDirectory() as folder, ExitStack() as stack:
        _write(course, Path(folder))
        core = _core() if course.one_core else None
        made: list[_Made] = []
        for name in dict.fromkeys(entry.peer for entry in entries):
            why = _unable(peers[name], course.problem)
            process = None if why else stack.enter_context(_Process(peers[name].module, folder, core))
            if process is None or process.failed:
                tell(f"{name} is left out: {why or (process and process.failed)}")
                continue
            made += _make(process, [entry for entry in entries if entry.peer == name], tell)
        return [_timed(made, design, rounds, seconds) for design in range(len(course.designs))]


@dataclass(frozen=True)
class _Made:
    """An entry that its process has made ready. which: its number there; answer: what the process has said of it."""

    entry: Entry
    process: "_Process"
    which: int
    answer: dict[str, Any]


def _make(process: "_Process", entries: Sequence[Entry], tell: Callable[[str], None]) -> Iterator[_Made]:
    for entry in entries:
        name = f"{entry.peer}, {entry.label}"
        tell(name)
        answer = process.ask(do="make", setting=dict(entry.setting), gradient=entry.gradient)
        if "failed" in answer:
            tell(f"{name}, is left out: {answer['failed']}")
        else:
            yield _Made(entry, process, process.count(), answer)


def _timed(made: Sequence[_Made], design: int, rounds: int, seconds: float) -> list[Measured]:
    found: list[tuple[list[float], list[float]]] = [([], []) for _ in made]
    for _ in range(rounds):
        for each, own in zip(made, found, strict=True):
            answer = each.process.ask(do="time", which=each.which, design=design, seconds=seconds)
            if "failed" not in answer:
                own[0].append(median(answer["times"]))
                own[1].append(answer["processor"])
    return [
        Measured(
            each.entry, *each.answer["errors"][design], *own, each.process.loading, each.answer["seconds"],
            each.answer["memory"],
        )
        for each, own in zip(made, found, strict=True)
        if own[0]
    ]  # fmt: skip


def _unable(peer: Peer, problem: Problem | SeatProblem) -> str:
    missing = peer.missing()
    if missing:
        return f"{' and '.join(missing)} not installed (pip install 'mdstopo[peers]')"
    if len(problem.hinges) and not peer.hinges:
        return "not written for hinges"
    return ""


def _write(course: Field, folder: Path) -> None:
    course.problem.save(folder / "problem.npz")
    truth = {"value": [each.value for each in course.truths], "gradient": [each.gradient for each in course.truths]}
    np.savez(folder / "truth.npz", alpha=np.array(course.designs), **{k: np.array(v) for k, v in truth.items()})


def _core() -> int | None:
    """The last core that this process may use: the first is where most of the system's own work lands."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _plain(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


class _Process:
    """A worker and what is said to it."""

    def __init__(self, module: str, folder: str, core: int | None) -> None:
        root = str(Path(__file__).resolve().parent.parent.parent)
        threads = {} if core is None else dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
        self._child = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.peers.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            cwd=folder,
            env=os.environ | threads | {"PYTHONPATH": path},
        )
        self._made = -1
        answer = self.ask(do="open", module=module, folder=folder, core=core)
        self.failed: str = answer.get("failed", "")
        self.loading: float = answer.get("seconds", 0.0)

    def ask(self, **request: Any) -> dict[str, Any]:
        """The answer, which tells where the process has died."""
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        try:
            self._child.stdin.write(json.dumps(request) + "\n")
            self._child.stdin.flush()
            line = self._child.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            return {"failed": f"its process ended with status {self._child.wait()}"}
        answer: dict[str, Any] = json.loads(line)
        return answer

    def count(self) -> int:
        """Which of what it made was made last."""
        self._made += 1
        return self._made

    def __enter__(self) -> "_Process":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # what still computes when this ends has been interrupted
        self._child.kill()
        self._child.communicate()
