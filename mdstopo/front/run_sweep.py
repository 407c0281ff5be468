"""A case run over values of its keys: every combination is a run of its own, and one table holds what they found."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from mdstopo.case.model import Case
from mdstopo.case.reader import load_case
from mdstopo.case.scene.candidates import pairs_of
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.threads import cores
from mdstopo.front.cluster import Cluster
from mdstopo.front.directions import MOST_POINTS, parse_range
from mdstopo.front.jobs import Setting, Trial, first
from mdstopo.front.pool import Here, Pool, Processes
from mdstopo.front.run_front import WORTH_PROCESSES, Snapshot
from mdstopo.plan.priced_designs import in_case, with_all
from mdstopo.plan.solve_task import Found, case_key, failed
from mdstopo.plan.stored_tasks import read_tasks, tasks_part
from mdstopo.session.compiling_apart import compile_apart
from mdstopo.session.shortfall import stalled_runs
from mdstopo.starts.callbacks import ignore, never
from mdstopo.status import RunStatus, together
from mdstopo.store.admit import admit, admit_resume, prepare_place
from mdstopo.store.atomic import remove_leftovers
from mdstopo.store.checkpoint import INTERVAL, Checkpointer
from mdstopo.store.contents import Contents, Datasets, case_part
from mdstopo.store.lock import Lock
from mdstopo.store.writing import write_result
from mdstopo.workers.worker_pool import Lost


@dataclass(frozen=True)
class SweepOutcome:
    """A sweep that has ended, or was stopped: keys, their values (W) as written, and what was found, None if not."""

    case: Case
    keys: tuple[str, ...]
    values: tuple[tuple[str, ...], ...]
    found: tuple[Found | None, ...]
    status: RunStatus
    reason: str
    seconds: float
    path: Path | None
    warnings: tuple[str, ...] = ()


def combinations(sets: Mapping[str, str]) -> tuple[tuple[str, ...], ...]:
    """Every combination of the values of some keys, the last key fastest. Raises ValueError with a sentence."""
    columns = []
    for key, text in sets.items():
        if ":" in text:
            columns.append([shortest(value) for value in parse_range(text)])
        else:
            columns.append([word.strip() for word in text.split(",")])
        if "" in columns[-1]:
            raise ValueError(f"{key}: found {text!r}; a value is missing")
    count = int(np.prod([len(column) for column in columns]))
    if count > MOST_POINTS:
        raise ValueError(f"{count} combinations are more than {MOST_POINTS}")
    return tuple(product(*columns))


def run_sweep(
    case_path: Path,
    overrides: Mapping[str, str],
    sets: Mapping[str, str],
    *,
    path: Path,
    resume: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[Snapshot], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
    notify: Callable[[str], None] | None = None,
    command: str = "",
    worth: float = WORTH_PROCESSES,
) -> SweepOutcome:
    """Run a case with every combination of values of some keys, and keep the result file up to date.

    case_path: the case file.
    overrides: values of other keys, the same in all runs.
    sets: by key, its values "a:b:step" or "x,y,z".
    path: the result file.
    resume, overwrite: continue the unfinished sweep in the file, or replace it.
    workers: processes at most (default: one a core).
    cluster: the address of a Dask scheduler in their place. No result depends on either.
    on_progress: called with how far it is after each run.
    stop_requested: asked again and again whether to stop.
    notify: is given sentences for the user.
    command: the command line, for the record.
    worth: seconds of work from which on workers are started.

    Raises CaseError where a combination is no case (all their mistakes at once), ValueError where `sets` cannot be read
    or has too many combinations, StoreError for an unusable file.
    """
    values = combinations(sets)
    base = load_case(case_path, dict(overrides))
    cases = _cases(case_path, overrides, tuple(sets), values)
    sweep = _Sweep(base, tuple(sets), values, cases, command)
    tell = notify or ignore
    place = prepare_place(path)
    with Lock(place):
        remove_leftovers(place)
        solved: dict[str, Found] = {}
        if resume:
            view = admit_resume(place, base, tell, "sweep")
            solved = {} if view is None else read_tasks(view, "sweep/tasks")
        else:
            admit(place, base, "sweep", overwrite, tell)
        began = time.perf_counter()
        for case in cases:
            compile_apart(case, tell)
        sweep.solved = solved
        wanted = cores() if workers is None else workers
        pools = _Pools(Setting(base, case_key(base)), stop_requested or never, wanted, cluster, worth, tell)
        try:
            saver = Checkpointer(lambda: sweep.save(place, RunStatus.RUNNING, "running"), notify=tell)
            sweep.solve(pools, saver, on_progress or ignore)
        except Exception as error:  # what is finished is worth keeping, whatever it is that cannot go on
            sweep.save(place, RunStatus.INTERRUPTED, str(error) or type(error).__name__)
            raise
        whole = all(key in sweep.solved for key in sweep.runs)
        status, reason = sweep.verdict() if whole else (RunStatus.INTERRUPTED, "stopped; what is finished is saved")
        sweep.warnings = sweep.stalled() if whole else ()
        sweep.save(place, status, reason)
    found = tuple(sweep.solved.get(key) for key in sweep.runs)
    return SweepOutcome(
        base, tuple(sets), values, found, status, reason, time.perf_counter() - began, place, sweep.warnings
    )


def _cases(
    case_path: Path, overrides: Mapping[str, str], keys: Sequence[str], values: Sequence[tuple[str, ...]]
) -> list[Case]:
    cases, mistakes, seen = [], [], set()
    for row in values:
        try:
            cases.append(load_case(case_path, {**overrides, **dict(zip(keys, row, strict=True))}))
        except CaseError as error:
            new = [mistake for mistake in error.mistakes if str(mistake) not in seen]
            seen |= {str(mistake) for mistake in new}
            mistakes += new
    if mistakes:
        raise CaseError(mistakes, str(case_path))
    return cases


@dataclass(frozen=True)
class _Pools:
    """Who does the runs.

    setting: what they have in common. stop: asked whether to stop. workers: processes at most. cluster: the address of
    a Dask scheduler in their place. worth: seconds of work from which on workers are started. notify: is given
    sentences for the user.
    """

    setting: Setting
    stop: Callable[[], bool]
    workers: int
    cluster: str | None
    worth: float
    notify: Callable[[str], None]

    def first(self) -> Pool:
        """The pool to begin with: the cluster, or this process."""
        return Here(self.setting, self.stop) if self.cluster is None else Cluster(self.setting, self.stop, self.cluster)

    def following(self, pool: Pool, left: float) -> Pool:
        """The pool for what is left, so many seconds of work: workers instead of this process where that pays."""
        if isinstance(pool, Here) and self.workers > 1 and left > self.worth:
            return Processes(self.setting, self.stop, self.workers, self.notify)
        return pool


class _Sweep:
    """What a sweep has reached, and how it is saved."""

    def __init__(
        self, base: Case, keys: tuple[str, ...], values: Sequence[tuple[str, ...]], cases: list[Case], command: str
    ) -> None:
        self.base = base
        self.keys = keys
        self.values = values
        self.runs = [case_key(case) for case in cases]
        self.cases = cases
        self.solved: dict[str, Found] = {}
        self.contents = Contents.begun(base, "sweep", command, case_part(base))
        self.warnings: tuple[str, ...] = ()

    def due(self) -> list[int]:
        """The runs that are still to be done."""
        return [i for i, key in enumerate(self.runs) if key not in self.solved]

    def solve(self, pools: _Pools, saver: Checkpointer, on_progress: Callable[[Snapshot], None]) -> None:
        """Do all runs that are due, or as many as come before it is to stop."""
        due = self.due()
        pool: Pool | None = None
        try:
            while due:
                now = due
                if pool is None:
                    pool = pools.first()
                    if isinstance(pool, Here) and pools.workers > 1:
                        now = due[:1]  # the time of one says who does the others
                if not self.take(pool, now, saver, on_progress):
                    break
                due = self.due()
                spent = sum(each.seconds for each in self.solved.values()) / max(len(self.solved), 1)
                pool = pools.following(pool, spent * len(due))
        finally:
            if pool is not None:
                pool.close()

    def take(
        self, pool: Pool, due: Sequence[int], saver: Checkpointer, on_progress: Callable[[Snapshot], None]
    ) -> bool:
        """Have these runs done, and take in each result as it comes; False where it is to stop before the last."""
        count = 0
        for k, result in pool.results([Trial(self.cases[i], self.runs[i]) for i in due]):
            i = due[k]
            count += 1
            found = lost(self.cases[i], result) if isinstance(result, Lost) else result
            self.solved[self.runs[i]] = found
            on_progress(self.snapshot())
            saver.offer(urgent=found.seconds > INTERVAL)
        return count == len(due)

    def stalled(self) -> tuple[str, ...]:
        """The warning about runs that stalled; their tolerances may differ."""
        found = [self.solved[key] for key in self.runs]
        return stalled_runs([(each.status, each.kkt) for each in found], "runs")

    def verdict(self) -> tuple[RunStatus, str]:
        """How the runs have ended."""
        return together([self.solved[key].status for key in self.runs], "runs")

    def snapshot(self) -> Snapshot:
        """Progress."""
        done = {i: self.solved[key] for i, key in enumerate(self.runs) if key in self.solved}
        mean = sum(each.seconds for each in done.values()) / max(len(done), 1)
        return Snapshot(
            np.arange(len(self.runs), dtype=np.float64)[:, None], tuple(o.name for o in self.base.objectives), done, (),
            len(done), sum(each.evaluations for each in done.values()), mean * (len(self.runs) - len(done)),
        )  # fmt: skip

    def save(self, path: Path, status: RunStatus, reason: str) -> None:
        """Write the file as a whole."""
        done = [self.solved.get(key) for key in self.runs]
        m = len(self.base.objectives)
        part: Datasets = {
            "keys": list(self.keys),
            "objectives": np.array([np.full(m, np.nan) if each is None else each.objectives for each in done]),
            "status": ["running" if each is None else each.status.value for each in done],
            "reason": ["" if each is None else each.reason for each in done],
            "kkt": np.array([np.nan if each is None else each.kkt for each in done]),
            "evaluations": np.array([0 if each is None else each.evaluations for each in done], dtype=np.int64),
        }
        for k, key in enumerate(self.keys):
            part[f"values/{key}"] = [row[k] for row in self.values]
        tasks = [each for each in done if each is not None]
        for i, (each, case) in enumerate(zip(done, self.cases, strict=True)):
            if each is not None:
                space, x = case.space, each.alpha
                if case.priced_groups:  # each run has members of its own
                    built = with_all(case, [x])
                    space, x = built.space, in_case(built, x)
                    for name, ends in pairs_of(built).items():
                        part |= {
                            f"members/{i}/{name}/{end}": index for end, index in zip(("from", "to"), ends, strict=True)
                        }
                design = space.expand(x)
                part[f"alpha/{i}"] = design[: space.n_alpha]
                part |= {f"variables/{i}/{name}": values for name, values in space.named(design).items()}
        datasets: Datasets = {f"sweep/{name}": value for name, value in part.items()}
        datasets |= tasks_part(tasks, self.base, "sweep/tasks")
        write_result(path, self.contents.now(status.value, reason, datasets, self.warnings))


def shortest(value: float) -> str:
    """A number as a user would write it."""
    text = f"{value:.15g}"
    return text if float(text) == value else repr(value)


def lost(case: Case, result: Lost) -> Found:
    """The entry of a run that no worker finished; its key is empty, so that a resumed sweep tries again."""
    return failed(0, "", first(case), len(case.objectives), result.reason)
