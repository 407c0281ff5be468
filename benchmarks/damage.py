"""Kills and damages at random: nothing that was saved is lost, nothing hangs, nothing ends in a traceback.

`python -m benchmarks damage` kills runs and fronts in the middle of what they do and goes on from their files, and
damages result files, the cache of machine code and lock files, reading each in a process of its own.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from mdstopo.bench.tables import Table, verdict

#: how many of each: kills of forked processes that save after every iteration, kills of whole commands; damages
KILLS, COMMANDS = 450, 50
RESULTS, CODES, LOCKS, RUNS = 600, 250, 130, 20
SEED = 1
#: seconds after which something counts as hanging
LIMIT = 120.0

CASE = """
format: 1
title: Two bodies, two load cases
gravity: [0, -9.8]
time: {end: 0.2}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0]}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 8}}}
  frame: {body: vehicle, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 5}}}
members:
  belts: {from: edge, to: frame, law: {type: spring, stiffness: 3000}}
load_cases:
  turn: {loads: [{body: vehicle, angular_acceleration: 20}]}
  brake: {loads: [{body: vehicle, acceleration: [20, 0]}]}
objectives:
  G1: {response: energy, load_case: turn}
  G2: {response: energy, load_case: brake}
combine: {weights: {G1: 1, G2: 3}}
constraints: [{volume: all, equals: 4}]
optimizer: {max_iterations: 25, tolerance: 0, decrease_tolerance: 0}
"""

#: what ends differently from one run to the next
_WALL_TIMES = {"seconds"}


def damage() -> Iterator[Table]:
    """Kills, then damages."""
    memory = "/dev/shm" if Path("/dev/shm").is_dir() else None  # where writing takes no time, more is killed in it
    with tempfile.TemporaryDirectory(dir=memory) as name:
        folder = Path(name)
        (folder / "case.yaml").write_text(CASE, encoding="utf-8")
        yield kills(folder, KILLS, COMMANDS)
        yield damages(folder, RESULTS, CODES, LOCKS, RUNS)


# processes


def apart(work: Callable[[], object], log: Path, after: float | None = None) -> tuple[int, bool]:
    """Do something in a forked process: its status (minus the number of a signal), and whether it was killed.

    log: gets what it says, a traceback too. after: seconds until it is killed; None waits up to `LIMIT`.
    """
    child = os.fork()
    if child == 0:
        status = 99
        try:
            out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(out, 1)
            os.dup2(out, 2)
            result = work()
            status = result if isinstance(result, int) else 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    until = time.monotonic() + (LIMIT if after is None else after)
    while time.monotonic() < until:
        done, state = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(state), False
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), True


def ready(folder: Path) -> None:
    """Import and load here what the forked processes need, so that they are killed in their work."""
    import mdstopo.cli.show
    import mdstopo.front.run_front  # noqa: F401
    from mdstopo.case.reader import load_case
    from mdstopo.session.run_session import run_session

    run_session(load_case(folder / "case.yaml"))


def _go_on(path: Path, front: bool) -> int:
    """Resume a run or a front, saved after nearly every iteration."""
    import mdstopo.store.checkpoint as checkpoint
    from mdstopo.case.reader import load_case
    from mdstopo.front.run_front import Ask, run_front
    from mdstopo.session.run_session import run_session

    checkpoint.INTERVAL, checkpoint._COST_FACTOR = 0.01, 0.0
    case = load_case(path.parent / "case.yaml")
    if front:
        share = np.linspace(0.0, 1.0, 3)
        run_front(case, Ask(np.stack([share, 1.0 - share], axis=1)), path=path, resume=True, workers=1)
    else:
        run_session(case, path=path, resume=True)
    return 0


# kills


def kills(folder: Path, count: int, commands: int) -> Table:
    """Runs and fronts, killed and gone on from until they end; each end is compared with an undisturbed one."""
    rng, log = np.random.default_rng(SEED), folder / "log"
    rows = []
    ready(folder)
    for front, share in ((False, 0.5), (True, 0.5)):
        whole, path = folder / f"whole-{front}.h5", folder / f"killed-{front}.h5"
        began = time.monotonic()
        assert apart(lambda whole=whole, front=front: _go_on(whole, front), log) == (0, False), log.read_text()  # type: ignore[misc]
        typical = time.monotonic() - began
        found: Counter[str] = Counter()
        reached = 0
        while found["kills"] < count * share:
            status, killed = apart(
                lambda front=front, path=path: _go_on(path, front),
                log,
                float(rng.uniform(0.0, 0.7 * typical)),  # type: ignore[misc]
            )
            found["kills"] += killed
            found["tracebacks"] += not killed and status != 0
            reached = _look(path, whole, reached, found)
        rows.append(["front" if front else "run", "every 0.01 s", *_counts(found)])
    rows.append(["run, front", "whole commands", *_counts(_commands(folder, commands, rng))])
    bad = sum(int(cell) for row in rows for cell in row[3:4] + row[5:])
    return Table(
        f"Killed {sum(int(row[2]) for row in rows)} times at random, and gone on",
        ["what", "saves", "kills", "files that cannot be read", "ends", "other ends", "steps lost", "tracebacks"],
        [*rows, ["bar: nothing lost, no traceback", "", "", "", "", "", "", verdict(bad == 0)]],
        [
            "Ends: runs and fronts that got to their end in between and were begun anew; other ends: those that differ "
            "in a bit from one that was never killed. Steps lost: saved evaluations that a later file does not have."
        ],
    )


def _counts(found: "Counter[str]") -> list[str]:
    return [str(found[name]) for name in ("kills", "unreadable", "ends", "other", "lost", "tracebacks")]


def _look(path: Path, whole: Path, reached: int, found: "Counter[str]") -> int:
    """What a file holds after a kill: evaluations so far. A finished one is compared, and begun anew."""
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError

    if not path.exists():
        found["lost"] += reached > 0
        return 0
    try:
        view = read_result(path)
    except StoreError:
        found["unreadable"] += 1
        path.unlink()
        return 0
    done = sum(int(np.sum(array)) for name, array in view.arrays.items() if name.endswith("tasks/evaluations"))
    done += sum(int(array) for name, array in view.arrays.items() if name.endswith("/evaluations") and not array.ndim)
    found["lost"] += done < reached
    if not view.finished:
        return done
    found["ends"] += 1
    found["other"] += not same(path, whole)
    path.unlink()
    return 0


def same(one: Path, other: Path) -> bool:
    """Whether two results hold the same to the bit, wall times aside."""
    from mdstopo.store.result_reader import read_result

    first, second = read_result(one), read_result(other)
    return first.texts == second.texts and _numbers(first.arrays) == _numbers(second.arrays)


def _numbers(arrays: object) -> dict[str, bytes]:
    assert isinstance(arrays, dict)
    return {
        name: np.asarray(array).tobytes() for name, array in arrays.items() if name.split("/")[-1] not in _WALL_TIMES
    }


def _commands(folder: Path, count: int, rng: np.random.Generator) -> "Counter[str]":
    """Whole commands, ended by every signal that ends one. One that got to its end is begun anew."""
    found: Counter[str] = Counter()
    signals = (signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
    words = ["--set", "optimizer.max_iterations=100000", "--resume", "--quiet"]
    starts = {"run": ["--starts", "100"], "pareto": []}
    k = 0
    while found["kills"] < count:
        what = ("run", "pareto")[k % 2]
        path = folder / f"command-{what}.h5"
        line = [sys.executable, "-m", "mdstopo", what, str(folder / "case.yaml"), "--out", str(path)]
        process = subprocess.Popen(
            [*line, *words, *starts[what]], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        until = time.monotonic() + LIMIT
        while not path.exists() and process.poll() is None and time.monotonic() < until:
            time.sleep(0.01)
        time.sleep(float(rng.uniform(0.0, 1.0)))
        if process.poll() is None:
            process.send_signal(signals[(k // 2) % len(signals)])
            found["kills"] += 1
        try:
            _, said = process.communicate(timeout=LIMIT)
        except subprocess.TimeoutExpired:
            process.kill()
            _, said = process.communicate()
            found["tracebacks"] += 1
        # a signal may come while Python itself begins, before anything of this package is imported
        found["tracebacks"] += "Traceback" in said and "Fatal Python error: init_" not in said
        done, finished = _evaluations(path, found)
        found["lost"] += done < found[f"reached {what}"]
        found[f"reached {what}"] = 0 if finished else done
        found["ends"] += finished
        if finished:
            path.unlink()
        k += 1
    return found


def _evaluations(path: Path, found: "Counter[str]") -> tuple[int, bool]:
    """How many evaluations a file knows of, of solves that have ended and of those that go on; whether it has ended.

    A file that cannot be read counts as such, and knows of none.
    """
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError

    try:
        view = read_result(path)
    except StoreError:
        found["unreadable"] += 1
        return 0, False
    counts = [
        int(np.sum(array))
        for name, array in view.arrays.items()
        if name.endswith("/evaluations") and ("tasks/" in name or name.startswith("optimizer/"))
        if "/history/" not in name  # which counts up to the same
    ]
    return sum(counts), view.finished


# damages


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """The same bytes with one thing wrong."""
    size = len(data)
    place, length = int(rng.integers(size)), int(rng.integers(1, 4097))
    kind = int(rng.integers(8))
    if kind <= 2:  # a bit
        return data[:place] + bytes([data[place] ^ (1 << int(rng.integers(8)))]) + data[place + 1 :]
    if kind == 3:  # cut off
        return data[:place]
    if kind == 4:  # a block that was never written
        return data[:place] + bytes(len(data[place : place + length])) + data[place + length :]
    if kind == 5:  # a block of something else
        return data[:place] + rng.bytes(len(data[place : place + length])) + data[place + length :]
    if kind == 6:  # a block that is missing
        return data[:place] + data[place + length :]
    return data + rng.bytes(length)  # something behind it


def damages(folder: Path, results: int, codes: int, locks: int, runs: int) -> Table:
    """Result files, machine code, lock files; and runs from a damaged cache."""
    rng, rows = np.random.default_rng(SEED), []
    ready(folder)
    cache = _own_cache(folder)
    rows.append(["result files", *_tally(_damaged_results(folder, results, rng))])
    rows.append(["files of the cache", *_tally(_damaged_codes(folder, cache, codes, rng))])
    rows.append(["lock files", *_tally(_damaged_locks(folder, locks, rng))])
    rows.append(["runs from a damaged cache", *_tally(_damaged_runs(folder, cache, runs, rng))])
    bad = sum(int(cell) for row in rows for cell in row[4:])
    return Table(
        f"Damaged {sum(int(row[1]) for row in rows)} times at random",
        ["what", "damages", "refused or made anew", "harmless", "taken for good", "hang", "crash", "traceback"],
        [*rows, ["bar: none of the last four", "", "", "", "", "", "", verdict(bad == 0)]],
        ["Harmless: what is read is what was written, to the bit. Each is read in a process of its own."],
    )


def _tally(found: "Counter[str]") -> list[str]:
    names = ("refused", "harmless", "wrong", "hang", "crash", "traceback")
    return [str(sum(found.values())), *(str(found[name]) for name in names)]


def _outcome(status: int, killed: bool, log: Path) -> str:
    """In a word: how a process ended that read something damaged. 0: as it was, 2: refused, 3: something else."""
    if killed:
        return "hang"
    if status < 0:
        return "crash"
    if "Traceback" in log.read_text(errors="replace"):
        return "traceback"
    return {0: "harmless", 2: "refused", 3: "wrong"}.get(status, "traceback")


def _damaged_results(folder: Path, count: int, rng: np.random.Generator) -> "Counter[str]":
    found: Counter[str] = Counter()
    path, log = folder / "damaged.h5", folder / "log"
    wholes = [folder / f"whole-{front}.h5" for front in (False, True)]
    for front, whole in zip((False, True), wholes, strict=True):
        if not whole.exists():
            apart(lambda whole=whole, front=front: _go_on(whole, front), log)  # type: ignore[misc]
    for k in range(count):
        whole = wholes[k % 2]
        path.write_bytes(damaged(whole.read_bytes(), rng))

        def work(whole: Path = whole) -> int:
            from mdstopo.cli.group import run_group

            status = run_group(["show", str(path)])
            return status if status else (0 if same(path, whole) else 3)

        found[_outcome(*apart(work, log), log)] += 1
    return found


def _own_cache(folder: Path) -> Path:
    """A copy of what the case needs of the cache of machine code."""
    from mdstopo.compiler.store import cache_folder

    place = folder / "cache"
    place.mkdir(mode=0o700, exist_ok=True)
    if not (place / cache_folder().name).exists():
        shutil.copytree(cache_folder(), place / cache_folder().name)
    return place


def _damaged_codes(folder: Path, cache: Path, count: int, rng: np.random.Generator) -> "Counter[str]":
    from mdstopo.compiler import store

    found: Counter[str] = Counter()
    files = sorted(each for each in cache.glob("*/*") if each.suffix in (".code", ".kept"))
    path, log = folder / "damaged.code", folder / "log"
    for k in range(count):
        original = files[int(rng.integers(len(files)))] if k else files[0]
        whole = store.read_checked(original)
        path.write_bytes(damaged(original.read_bytes(), rng))
        path.chmod(0o600)

        def work(whole: bytes | None = whole) -> int:
            now = store.read_checked(path)
            return 2 if now is None else 0 if now == whole else 3

        found[_outcome(*apart(work, log), log)] += 1
    return found


def _damaged_locks(folder: Path, count: int, rng: np.random.Generator) -> "Counter[str]":
    from mdstopo.store.lock import Lock
    from mdstopo.store.store_errors import StoreError

    found: Counter[str] = Counter()
    result, log, precious = folder / "locked.h5", folder / "log", folder / "precious"
    lock = folder / ".locked.h5.lock"
    content = b"what a link in the place of the lock points to"
    for k in range(count):
        precious.write_bytes(content)
        kind = k % 6
        if kind == 0:
            lock.symlink_to(precious)
        elif kind == 1:
            lock.hardlink_to(precious)
        elif kind == 2:
            os.mkfifo(lock)
        elif kind == 3:
            lock.mkdir()
        else:
            lock.write_bytes(rng.bytes(int(rng.integers(1, 500))))

        def work() -> int:
            try:
                with Lock(result):
                    return 0
            except StoreError:
                return 2

        outcome = _outcome(*apart(work, log), log)
        found[outcome if precious.read_bytes() == content else "wrong"] += 1
        if lock.is_dir() and not lock.is_symlink():
            lock.rmdir()
        lock.unlink(missing_ok=True)
    return found


def _damaged_runs(folder: Path, cache: Path, count: int, rng: np.random.Generator) -> "Counter[str]":
    """Whole commands with a file of the cache damaged: they compile it anew, and find the same."""
    found: Counter[str] = Counter()
    log, out = folder / "log", folder / "again.h5"
    line = [sys.executable, "-m", "mdstopo", "run", str(folder / "case.yaml"), "--out", str(out), "--overwrite", "-q"]
    used = [each for each in sorted(cache.glob("*/*.code")) if ".general." not in each.name]
    for _ in range(count):
        victim = used[int(rng.integers(len(used)))]
        victim.write_bytes(damaged(victim.read_bytes(), rng))
        with log.open("w") as stream:
            try:
                status = subprocess.run(
                    line,
                    stdout=stream,
                    stderr=stream,
                    env={**os.environ, "MDSTOPO_CACHE_DIR": str(cache)},
                    timeout=LIMIT,
                    check=False,
                ).returncode
                killed = False
            except subprocess.TimeoutExpired:
                status, killed = -9, True
        found[_outcome(status, killed, log)] += 1
    return found
