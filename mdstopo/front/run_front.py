"""A front from its request to its file: plan, solve what is not solved yet, keep, and go on."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import Case
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.threads import cores
from mdstopo.design_problem import sign_of
from mdstopo.evaluators import make_engine
from mdstopo.front.cluster import Cluster
from mdstopo.front.front_content import Quality, front_part, quality
from mdstopo.front.jobs import Setting, perform
from mdstopo.front.pool import Here, Pool, Processes
from mdstopo.optimizer.start_families import design_of_family
from mdstopo.optimizer.state import State
from mdstopo.plan.front_plan import Front, NoEndError, Planner, Request, Starts
from mdstopo.plan.priced_designs import in_case, packed, with_all
from mdstopo.plan.pricing_rounds import members_part
from mdstopo.plan.solve_task import Found, Result, Task, failed, front_key
from mdstopo.plan.stored_tasks import begun_part, read_begun, read_tasks, tasks_part
from mdstopo.session.compiling_apart import compile_apart
from mdstopo.session.shortfall import stalled_runs
from mdstopo.starts.callbacks import ignore, never
from mdstopo.starts.evaluator_interface import equal_weights
from mdstopo.starts.single_start import NOTHING_VARIES, first_design, replaced, unshared
from mdstopo.status import RunStatus, together
from mdstopo.store.admit import admit, admit_resume, prepare_place
from mdstopo.store.atomic import remove_leftovers
from mdstopo.store.checkpoint import INTERVAL, Checkpointer
from mdstopo.store.contents import Contents, case_part
from mdstopo.store.lock import Lock
from mdstopo.store.same_case import describe
from mdstopo.store.writing import write_result
from mdstopo.workers.worker_pool import Lost, StoppedError

Floats = NDArray[np.float64]
Stop = Callable[[], bool]

#: seconds of work from which on other processes are worth their start
WORTH_PROCESSES = 6.0
#: tasks that a point takes, and evaluations of a task, about: for guesses of the time that is left
TASKS, EVALUATIONS = 3.2, 11.0
#: iterations of the first task that are tried, and thrown away, to see how long the work takes
LOOK = 2


@dataclass(frozen=True)
class Ask:
    """The front that the user asks for. directions (W, m); method: of the case where empty; starts: of every solve."""

    directions: Floats
    method: str = ""
    starts: int = 1


@dataclass(frozen=True)
class Snapshot:
    """How far a front has come: best by point, points that are being worked on, tasks done.

    left: seconds that the solves will take which are still due, by the mean of those before; NaN before the first.
    more: the same of those that a front usually needs after these. Whether it will is known when these are done; NaN
    where it has needed more than usual already.
    """

    directions: Floats
    names: tuple[str, ...]
    best: dict[int, Found]
    running: tuple[int, ...]
    done: int
    evaluations: int
    left: float
    more: float = 0.0


@dataclass(frozen=True)
class FrontOutcome:
    """A front that has ended, or was stopped.

    tasks: all that were solved, in the plan's order. part: the front as the file has it under `pareto`.
    """

    case: Case
    directions: Floats
    method: str
    front: Front | None
    status: RunStatus
    reason: str
    tasks: tuple[Found, ...]
    evaluations: int
    quality: Quality | None
    part: Mapping[str, Any]
    seconds: float
    path: Path | None
    warnings: tuple[str, ...] = field(default=())


def run_front(
    case: Case,
    ask: Ask,
    *,
    path: Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[Snapshot], None] | None = None,
    stop_requested: Stop | None = None,
    notify: Callable[[str], None] | None = None,
    command: str = "",
    worth: float = WORTH_PROCESSES,
) -> FrontOutcome:
    """Compute a front and keep its result file up to date.

    case: the design problem, with several objectives.
    ask: the points, the method, and how many starts.
    path: the result file; None keeps everything in memory.
    resume, overwrite: continue the unfinished front in the file, or replace it.
    workers: processes at most (default: one a core).
    cluster: the address of a Dask scheduler in their place. No result depends on either.
    on_progress: called with the front in the making as it goes on.
    stop_requested: asked again and again whether to stop.
    notify: is given sentences for the user.
    command: the command line, for the record.
    worth: seconds of work from which on workers are started.

    Raises CaseError where the case is no front that can be computed, StoreError for an unusable file, ValueError for a
    direction that is given twice.
    """
    check(case)
    _check_starts(case, ask.starts)
    if len(np.unique(ask.directions, axis=0)) < len(ask.directions):
        raise ValueError("a direction is given twice")
    run = _FrontRun(case, ask, on_progress or ignore, stop_requested or never, notify or ignore, command)
    if path is None:
        return run.go(None, workers, cluster, worth)
    place = prepare_place(path)
    with Lock(place):
        remove_leftovers(place)
        if resume:
            view = admit_resume(place, case, run.notify, "pareto")
            if view is not None:
                run.solved, run.begun = read_tasks(view), read_begun(view)
        else:
            admit(place, case, "pareto", overwrite, run.notify)
        return run.go(place, workers, cluster, worth)


def check(case: Case) -> None:
    """Refuse a case that has no front. Raises CaseError."""
    mistakes = []
    if len(case.objectives) < 2:
        mistakes.append(case.marks.mistake("objectives", "a front needs at least two objectives"))
    if not case.n_design and not case.variables:
        mistakes.append(case.marks.mistake("members", NOTHING_VARIES))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))


def _check_starts(case: Case, starts: int) -> None:
    """Refuse several starts of each solve where candidates are priced. Raises CaseError."""
    if starts > 1 and case.priced_groups:
        words = f"priced goes with one start of each point of a front, not {starts}"
        mistakes = [case.marks.mistake(f"members.{each.name}.candidates", words) for each in case.priced_groups]
        raise CaseError(mistakes, str(case.path or case.name))


class _FrontRun:
    """One front: what it has reached, and how it is saved."""

    def __init__(
        self,
        case: Case,
        ask: Ask,
        on_progress: Callable[[Snapshot], None],
        stop: Stop,
        notify: Callable[[str], None],
        command: str,
    ) -> None:
        """Begin with nothing solved.

        case: the design problem, with several objectives.
        ask: the points, the method, and how many starts.
        on_progress: called with the front in the making as it goes on.
        stop: asked again and again whether to stop.
        notify: is given sentences for the user.
        command: the command line, for the record.
        """
        assert case.combine is not None
        self.case = case
        self.ask = ask
        self.on_progress = on_progress
        self.stop = stop
        self.notify = notify
        self.command = command
        self.method = ask.method or case.combine.method
        #: finished tasks by key: those of an earlier process, and those of this one in the plan's order
        self.solved: dict[str, Found] = {}
        self.taken: dict[str, Found] = {}
        #: the optimisers' states of tasks that are being worked on
        self.begun: dict[str, State] = {}
        self.warnings = tuple(mistake.message for mistake in case.warnings)
        self.pool: Pool | None = None

    def go(self, path: Path | None, workers: int | None, cluster: str | None, worth: float) -> FrontOutcome:
        """The whole front."""
        began = time.perf_counter()
        compile_apart(self.case, self.notify)
        self.planner = Planner(self.request())
        self.open(path)
        self.setting = Setting(self.case, front_key(self.case))
        self.workers, self.cluster, self.worth = workers, cluster, worth
        self.saver = None
        if path is not None:
            save = partial(self.save, path, RunStatus.RUNNING, "running", None)
            self.saver = Checkpointer(save, notify=self.notify)
        front, status, reason = None, RunStatus.INTERRUPTED, "stopped on request; what is finished is saved"
        try:
            front = self.work()
            status, reason = verdict(front)
        except StoppedError:
            pass
        except NoEndError as error:
            name = self.case.objectives[error.place].name
            status, reason = RunStatus.FAILED, f"objective {name} alone cannot be optimised: {error}"
        except Exception as error:  # what is finished is worth keeping, whatever it is that cannot go on
            if path is not None:
                self.save(path, status, str(error) or type(error).__name__, None)
            raise
        finally:
            if self.pool is not None:
                self.pool.close()
        self.quality = quality(self.case, front) if front is not None else None
        if front is not None:
            ends = [(each.status, each.kkt) for each in front.points if each is not None]
            self.warnings += stalled_runs(ends, "points", self.case.optimizer.tolerance)
        if path is not None:
            self.save(path, status, reason, front)
        tasks = tuple(self.taken.values())
        case, told = self.as_built(self.so_far() if front is None else front)
        part = front_part(case, self.ask.directions, told, tasks)
        return FrontOutcome(
            case, self.ask.directions, self.method, None if front is None else told, status, reason, tasks,
            sum(each.evaluations for each in tasks), self.quality,
            {name.removeprefix("pareto/"): value for name, value in part.items()},
            time.perf_counter() - began, path, self.warnings,
        )  # fmt: skip

    def request(self) -> Request:
        """The plan's request, with the designs to begin with."""
        assert self.case.combine is not None
        problem = make_engine(self.case).problem(equal_weights(self.case))
        stated, first = first_design(self.case, problem, None)
        if words := unshared(self.case, None):
            self.notify(words)
        if not np.array_equal(stated, first):
            self.notify(replaced(stated, first))
        combine, chosen = self.case.combine, self.case.optimizer
        draw = partial(design_of_family, problem, chosen.seed)
        first = packed(self.case, first) if self.case.priced_groups else first
        starts = Starts(first, self.ask.starts, draw, chosen.tolerance, self.case.n_design > 0)
        return Request(
            self.ask.directions, self.method, combine.exponent, combine.normalize,
            np.array([sign_of(objective) for objective in self.case.objectives]), starts, chosen.max_iterations,
        )  # fmt: skip

    def work(self) -> Front:
        """Go through the plan. Raises StoppedError where it is to stop."""
        rounds = self.planner.rounds()
        tasks = next(rounds)
        while True:
            try:
                tasks = rounds.send(self.round(tasks))
            except StopIteration as end:
                front: Front = end.value
                return front

    def round(self, tasks: Sequence[Task]) -> list[Result]:
        """Results of a round, in order: those that are known, and the others solved, or as far as they are to go.

        What the plan has decided about a state that a task comes with is kept with it.
        """
        keys = [task.key(self.setting.case_key) for task in tasks]
        for key, task in zip(keys, tasks, strict=True):
            if task.begun is not None and key not in self.solved:
                self.begun[key] = task.begun
        due = [i for i, key in enumerate(keys) if key not in self.solved and not self.has_come(tasks[i], key)]
        if due:
            if self.pool is None:
                self.pool = self.choose_pool(tasks[due[0]])
            running = {i: tasks[i].point for i in due}
            self.tell(running)  # the first of them, as many as there are workers
            jobs = [replace(tasks[i], begun=self.begun.get(keys[i])) for i in due]
            for place, result in self.pool.results(jobs, lambda place, state: self.hold(keys[due[place]], state)):
                i = due[place]
                running.pop(i)
                if isinstance(result, State):
                    self.hold(keys[i], result)
                    self.tell(running)
                else:
                    self.keep(keys[i], self.lost(tasks[i], result) if isinstance(result, Lost) else result, running)
            if running:
                raise StoppedError
        self.taken |= {key: self.solved[key] for key in keys if key in self.solved}
        return [self.solved[key] if key in self.solved else self.begun[key] for key in keys]

    def has_come(self, task: Task, key: str) -> bool:
        """Whether a task that is left at its quota has been brought there."""
        return task.quota is not None and key in self.begun and task.is_through(self.begun[key])

    def choose_pool(self, task: Task) -> Pool:
        """Who does the work: a cluster, this process, or others where a look at the task says that it is worth it."""
        if self.cluster is not None:
            return Cluster(self.setting, self.stop, self.cluster)
        wanted = cores() if self.workers is None else self.workers
        if wanted > 1 and self.case.priced_groups:  # a part of such a task tells little of the whole
            return Processes(self.setting, self.stop, wanted, self.notify)
        if wanted > 1:
            short = replace(task, iterations=LOOK, softened=False, iterate=-1, begun=None, quota=None)
            look = perform(self.setting, short, self.stop)
            left = look.seconds / max(look.evaluations, 1) * EVALUATIONS * self.expected
            left *= 1.0 - min(len(self.solved) / self.expected, 1.0)
            if left > self.worth:
                return Processes(self.setting, self.stop, wanted, self.notify)
        return Here(self.setting, self.stop)

    def lost(self, task: Task, result: Lost) -> Found:
        """What stands for a task that no worker finished; its key is empty, so that a resumed front tries again."""
        return failed(task.point, "", task.start, len(self.case.objectives), result.reason)

    def hold(self, key: str, state: State) -> None:
        """Keep the state that a task has reached, and write a checkpoint where one is due."""
        self.begun[key] = state
        if self.saver is not None:
            self.saver.offer()

    def keep(self, key: str, found: Found, running: dict[int, int]) -> None:
        """Take a result in, and write it."""
        self.solved[key] = found
        self.begun.pop(key, None)
        self.tell(running)
        if self.saver is not None:
            self.saver.offer(urgent=found.seconds > INTERVAL)

    def tell(self, running: dict[int, int]) -> None:
        """Tell `on_progress` how far the front is."""
        done = list(self.solved.values())
        mean = sum(each.seconds for each in done) / len(done) if done else float("nan")
        best: dict[int, Found] = dict(self.planner.best)
        for each in done:
            if each.point >= 0 and each.usable and each.iterate < 0:
                best.setdefault(each.point, each)
        at_once = self.pool.at_once if self.pool is not None else 1
        pace = mean / max(at_once, 1)
        to_come = self.expected - len(done) - len(running)
        self.on_progress(
            Snapshot(
                self.ask.directions,
                tuple(objective.name for objective in self.case.objectives),
                best,
                tuple(sorted({point for point in list(running.values())[: at_once or None] if point >= 0})),
                len(done),
                sum(each.evaluations for each in done),
                len(running) * pace,
                to_come * pace if to_come > 0 else float("nan"),
            )
        )

    @property
    def expected(self) -> float:
        """How many tasks there will be, about."""
        return (TASKS + self.ask.starts - 1) * len(self.ask.directions)

    # the file

    def open(self, path: Path | None) -> None:
        """Collect what every write repeats."""
        if path is None:
            return
        chosen = self.case.optimizer
        settings: dict[str, str | int | float | bool] = {
            "method": self.method,
            "solver_tolerance": self.case.solver.tolerance,
            "preset": chosen.preset,
            "max_iterations": chosen.max_iterations,
            "tolerance": chosen.tolerance,
            "starts": self.ask.starts,
            "seed": chosen.seed,
        }
        self.contents = Contents.begun(self.case, "pareto", self.command, case_part(self.case), settings)

    def save(self, path: Path, status: RunStatus, reason: str, front: Front | None) -> None:
        """Write the file as a whole. In the middle it holds all that is solved, in the end what the plan has taken."""
        tasks = (self.solved if front is None else self.taken).values()
        datasets = tasks_part(tasks, self.case)
        settings = dict(self.contents.settings)
        case, told = self.as_built(self.so_far() if front is None else front)
        datasets |= front_part(case, self.ask.directions, told, tasks)
        if case.priced_groups:
            datasets |= case_part(case) | {"resume/case": describe(self.case)} | members_part(case)
        if front is None:
            datasets |= begun_part(self.begun)
        else:
            assert self.quality is not None
            settings |= self.quality.numbers()
            datasets |= {"pareto/ideal": self.quality.ideal, "pareto/nadir": self.quality.nadir}
        contents = replace(self.contents, case=case, settings=settings)
        write_result(path, contents.now(status.value, reason, datasets, self.warnings))

    def as_built(self, front: Front) -> tuple[Case, Front]:
        """The case with all members that designs of a front have, where candidates are priced, and these designs as
        the optimiser's x in it; otherwise what there is."""
        if not self.case.priced_groups:
            return self.case, front
        case = with_all(self.case, [each.alpha for each in (*front.points, *front.ends) if each is not None])

        def told(found: Found) -> Found:
            return replace(found, alpha=in_case(case, found.alpha))

        points = tuple(None if each is None else told(each) for each in front.points)
        return case, replace(front, points=points, ends=tuple(told(each) for each in front.ends))

    def so_far(self) -> Front:
        """What the plan has reached; utopia and maxima are NaN before the ends are known."""
        planner = self.planner
        known = planner.request.signs if planner.scale_is_known else np.full(planner.m, np.nan)
        points = tuple(planner.best.get(j) for j in range(len(self.ask.directions)))
        return Front(points, tuple(planner.ends), known * planner.lowest, known * planner.highest)


def verdict(front: Front) -> tuple[RunStatus, str]:
    """The status of a front in words, and how many of its points ended how."""
    return together([RunStatus.FAILED if point is None else point.status for point in front.points], "points")
