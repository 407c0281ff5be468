"""`mdstopo bench scaling`: time and memory against the number of members and of bodies."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from mdstopo.bench.scenes import STEPS, chain, plate
from mdstopo.bench.tables import Table, significant, verdict
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.starts.single_start import make_optimizer

if TYPE_CHECKING:
    from mdstopo.optimizer.problem import Floats, Problem, Sample

MEMBERS = (1_000, 10_000, 100_000, 1_000_000)
BODIES = (2, 10, 30, 100, 300, 1_000)
#: iterations that are timed at most, after the first, of many members and of few, and those of a whole run. In the
#: first eight, 100,000 and 1,000,000 members take as many passes as each other; fewer soon after, but the one before
#: the other
MANY_TIMED, FEW_TIMED, ITERATIONS = 8, 24, 5
#: from so many members on the update of the optimiser shall be small beside an evaluation
_LARGE = 100_000


@dataclass(frozen=True)
class Size:
    """What one number of members costs: seconds of reading, of a first evaluation's preparation, and medians of one
    evaluation with gradient, of one update of the optimiser and of one iteration; of a whole run from YAML to HDF5 the
    seconds, the peak memory and the size of the file, in bytes."""

    members: int
    read: float
    prepare: float
    evaluation: float
    update: float
    iteration: float
    run: float
    peak: int
    file: int


def scaling(
    largest: int = MEMBERS[-1], bodies: int = BODIES[-1], tell: Callable[[str], None] = print
) -> Iterator[Table]:
    """Two tables, members and bodies, up to a number of each; tell: given a sentence before what takes long."""
    counts = [n for n in MEMBERS if n <= largest]
    if counts:
        found = []
        for n in counts:
            tell(f"{n:,} members")
            found.append(_members(n))
        yield _member_table(found)
    chains = [n for n in BODIES if n <= bodies]
    if chains:
        times = []
        for n in chains:
            tell(f"{n:,} bodies")
            times.append(_bodies(n))
        yield _body_table(chains, times)


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """The power of the size with which values grow, by least squares of the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])


def _members(n: int) -> Size:
    text = plate(n)
    began = time.perf_counter()
    case = read_case(text)
    read = time.perf_counter() - began
    began = time.perf_counter()
    evaluator = Evaluator(case)
    problem = evaluator.problem()
    prepare = time.perf_counter() - began
    evaluator.evaluate(case.initial)
    timed = _Timed(problem)
    optimizer = make_optimizer(case, timed)
    state = optimizer.step(optimizer.start())
    iterations, evaluations = [], []
    for _ in range(MANY_TIMED if n >= 10_000 else FEW_TIMED):
        if not state.running:
            break
        began = time.perf_counter()
        state = optimizer.step(state)
        iterations.append(time.perf_counter() - began)
        evaluations.append(timed.seconds)
    updates = [whole - part for whole, part in zip(iterations, evaluations, strict=True)]
    run, peak, file = whole_run(text)
    medians = median(evaluations), median(updates), median(iterations)
    return Size(case.n_design, read, prepare, *medians, run, peak, file)


class _Timed:
    """A problem that keeps the seconds of its last evaluation."""

    def __init__(self, problem: "Problem") -> None:
        self.initial, self.linear = problem.initial, problem.linear
        self.lower, self.upper = problem.lower, problem.upper
        self._problem = problem
        self.seconds = 0.0

    def evaluate(self, x: "Floats", gradient: bool = True) -> "Sample":
        began = time.perf_counter()
        sample = self._problem.evaluate(x, gradient)
        self.seconds = time.perf_counter() - began
        return sample


#: Runs a command and prints its seconds and its peak memory. A process of its own, because a child begins with the peak
#: of the one that starts it.
_WATCH = """
import resource, subprocess, sys, time
began = time.perf_counter()
status = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
print(time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(status)
"""


def whole_run(text: str, iterations: int = ITERATIONS) -> tuple[float, int, int]:
    """`mdstopo run` of a case in a process of its own: seconds, peak memory and size of the file, bytes."""
    with tempfile.TemporaryDirectory() as folder:
        case, result = Path(folder) / "case.yaml", Path(folder) / "case.h5"
        case.write_text(text, encoding="utf-8")
        command = [sys.executable, "-m", "mdstopo", "run", str(case), "--out", str(result), "--quiet"]
        command += ["--set", f"optimizer.max_iterations={iterations}"]
        watched = [sys.executable, "-I", "-c", _WATCH, *command]
        done = subprocess.run(watched, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} ended with status {done.returncode}")
        seconds, peak = done.stdout.split()
        unit = 1 if sys.platform == "darwin" else 1024
        return float(seconds), int(peak) * unit, result.stat().st_size


def _member_table(found: Sequence[Size]) -> Table:
    rows = [
        [
            f"{each.members:,}",
            *(significant(1e3 * t) for t in (each.read, each.prepare, each.evaluation, each.update, each.iteration)),
            significant(each.update / each.evaluation, 2),
            significant(each.run),
            f"{each.peak / 1e6:.0f}",
            f"{each.file / 1e6:.1f}",
        ]
        for each in found
    ]
    columns = ("read", "prepare", "evaluation", "update", "iteration", "", "run", "peak", "file")
    names = ("read", "prepare", "evaluation", "update", "iteration", "ratio", "run", "peak", "file")
    for title, part in (("all", found), ("from 1e5 on", [each for each in found if each.members >= 0.9 * _LARGE])):
        if len(part) > 1:
            sizes = [float(each.members) for each in part]
            values = {name: [getattr(each, name) for each in part] for name in columns if name}
            fits = [f"{exponent(sizes, values[name]):.2f}" if name else "" for name in columns]
            rows.append([f"exponent, {title}", *fits])
    notes = [
        "Times in ms, that of the run in s, sizes in MB.",
        f"Medians of {MANY_TIMED} iterations of the optimiser after the first ({FEW_TIMED} of 1,000 members), of the "
        "evaluations with gradient in them, and of the rest, which is the update.",
        f"A run is `mdstopo run` with {ITERATIONS} iterations in a process of its own, from YAML to HDF5.",
        *_bars(found),
    ]
    return Table("Members, two bodies", ("members", *names), rows, notes)


def _bars(found: Sequence[Size]) -> list[str]:
    """The limits that were set, and a verdict on each."""
    notes = []
    sizes, times = [float(each.members) for each in found], [each.iteration for each in found]
    large = [i for i, each in enumerate(found) if each.members >= 0.9 * _LARGE]
    if len(found) > 1:
        value = exponent(sizes, times)
        notes.append(f"Exponent of an iteration at most 1.1: {verdict(value <= 1.1)}.")
    if len(large) > 1:
        value = exponent([sizes[i] for i in large], [times[i] for i in large])
        notes.append(f"From 1e5 on at most 1.05: {verdict(value <= 1.05)}.")
    if large:
        worst = max(found[i].update / found[i].evaluation for i in large)
        notes.append(f"Update below a quarter of an evaluation from 1e5 on: {verdict(worst < 0.25)}.")
    small = found[0]
    if small.members < 2_000:
        ratio = small.update / small.evaluation
        notes.append(f"Below two evaluations at 1e3: {verdict(ratio < 2.0)}.")
    notes.append(f"Peak memory below 1 GB: {verdict(max(each.peak for each in found) < 1e9)}.")
    return notes


def _bodies(n: int) -> tuple[float, float, float]:
    """Seconds of reading, of an evaluation without and of one with gradient, of a chain."""
    began = time.perf_counter()
    case = read_case(chain(n))
    read = time.perf_counter() - began
    evaluator = Evaluator(case)
    found = []
    for gradient in (False, True):
        status = evaluator.evaluate(case.initial, gradient).status
        if not status.ok:
            raise RuntimeError(f"a chain of {n} bodies: {status.value}")
        times = []
        for _ in range(3):
            began = time.perf_counter()
            evaluator.evaluate(case.initial, gradient)
            times.append(time.perf_counter() - began)
        found.append(median(times))
    return read, found[0], found[1]


def _body_table(counts: Sequence[int], times: Sequence[tuple[float, float, float]]) -> Table:
    rows = [[f"{n:,}", *(significant(1e3 * t) for t in each)] for n, each in zip(counts, times, strict=True)]
    large = [i for i, n in enumerate(counts) if n >= 30]
    if len(large) > 1:
        fits = [exponent([counts[i] for i in large], [times[i][k] for i in large]) for k in range(3)]
        rows.append(["exponent, from 30 on", *(f"{value:.2f}" for value in fits)])
    note = f"Times in ms; {STEPS} fixed steps of runge_kutta, a joint and a member for each body."
    return Table("Bodies, a chain", ("bodies", "read", "objective", "with gradient"), rows, (note,))
