"""The run itself, each step a verb: admit, restore, iterate, conclude, save."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case
from mdstopo.case.responses.response_units import constrained, unit_of_bound
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.words import count_text
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.plan.pricing_rounds import Rounds
from mdstopo.plan.stored_tasks import read_begun, read_tasks
from mdstopo.session.advice import advise, without_slope
from mdstopo.session.coarse_steps import coarse_steps
from mdstopo.session.combining import Combining
from mdstopo.session.compiling_apart import compile_apart
from mdstopo.session.near_zero import near_zero
from mdstopo.session.outcome import Outcome, Progress
from mdstopo.session.saved_states import best_of, best_row, iteration_columns, restore, run_part
from mdstopo.session.shortfall import stalled_run
from mdstopo.session.sizes import Sizes, excess_at_prices
from mdstopo.session.start_in_stages import (
    ROUND,
    Marked,
    continued,
    first_row,
    is_done,
    iterations_of,
    run_stages,
    stage_of,
)
from mdstopo.session.starts_in_workers import open_starts, run_in_workers
from mdstopo.starts.callbacks import ignore, never
from mdstopo.starts.constraint_columns import relative_violations
from mdstopo.starts.evaluator_interface import Engine, MakeEngine, equal_weights, problem_of
from mdstopo.starts.getting_ready import get_ready, motions
from mdstopo.starts.quotas import carried_over, rounds
from mdstopo.starts.single_start import NOTHING_VARIES, StartTask, is_moved, make_optimizer, replaced, unshared
from mdstopo.status import RunStatus
from mdstopo.store.admit import admit, admit_resume, prepare_place
from mdstopo.store.atomic import remove_leftovers
from mdstopo.store.checkpoint import Checkpointer
from mdstopo.store.contents import (
    Datasets,
    case_part,
    sensitivity_part,
    trajectory_part,
)
from mdstopo.store.lock import Lock
from mdstopo.store.provenance import Provenance
from mdstopo.store.result_reader import ResultView
from mdstopo.store.same_case import describe
from mdstopo.store.set_keys import set_keys
from mdstopo.store.store_errors import DifferentCaseError, WriteError
from mdstopo.store.stored_case import built_case
from mdstopo.store.writing import write_result
from mdstopo.workers.worker_pool import StoppedError, WorkerError, WorkerPool

if TYPE_CHECKING:
    from mdstopo.robust.conclusion import Conclusion

Floats = NDArray[np.float64]
Notify = Callable[[str], None]

_DISK_SPEED = 2e8  # bytes a second: a first guess of what a checkpoint costs, until one has been timed
_STATE_ARRAYS = 16  # arrays of N numbers that a checkpoint holds for each start, roughly


def run_session(
    case: Case,
    *,
    path: Path | str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    starts: int | None = None,
    workers: int | None = None,
    initial: Floats | None = None,
    on_iteration: Callable[[Progress], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
    notify: Notify | None = None,
    command: str = "",
    engine: MakeEngine = make_engine,
) -> Outcome:
    """Optimise a case and keep its result file up to date.

    case: the design problem.
    path: the result file; None keeps everything in memory.
    resume, overwrite: continue the unfinished run in the file, or replace it.
    starts, workers: how many starts (default: the case's) on how many processes (default 1); no result depends on the
      latter.
    initial (N,) or (N + P,): the design to begin with in place of the case's; with the values of variables or without.
    on_iteration: called after each iteration.
    stop_requested: asked after each iteration whether to stop.
    notify: is given sentences for the user.
    command: the command line, for the record.
    engine: makes the case's evaluator.

    Raises
    ------
    CaseError
        if there is nothing to vary or nothing to improve, or no design keeps the volume rows.
    ValueError
        if `starts` is below 1, or `initial` has another length or a number that is not finite.
    NoUtopiaError
        if one of several objectives cannot be optimised alone.
    WorkerError
        if a worker process dies; what has been reached is saved.
    StoreError
        if the file must not or cannot be written, is in use, or holds a run that cannot be resumed.
    KeyboardInterrupt
        if the run is stopped before there is anything to save.
    """
    _check_optimizable(case)
    if starts is not None:
        if starts < 1:
            raise ValueError(f"starts must be at least 1, not {starts}")
        case = replace(case, optimizer=replace(case.optimizer, starts=starts))
    if initial is not None:
        initial = case.whole(initial)
        if initial.shape != (case.space.length,) or not np.isfinite(initial).all():
            raise ValueError(f"initial must be {case.n_design} finite numbers, one for each design variable")
    tell = notify or ignore
    Sizes(case).refuse()
    run = _Run(case, initial, on_iteration or ignore, stop_requested or never, tell, command)
    if path is None:
        with run.helpers:
            return run.go(engine, None, None, workers or 1)
    place = prepare_place(Path(path))
    with Lock(place), run.helpers:
        remove_leftovers(place)
        if resume:
            previous = admit_resume(place, case, tell)
            run.begin_with(previous)
        else:
            previous = None
            admit(place, case, "run", overwrite, tell)
        return run.go(engine, place, previous, workers or 1)


class _Run:
    """One run: what it has reached, and how it is saved."""

    def __init__(
        self,
        case: Case,
        initial: Floats | None,
        on_iteration: Callable[[Progress], None],
        stop_requested: Callable[[], bool],
        notify: Notify,
        command: str,
    ) -> None:
        """Begin with no state of any start.

        case: the design problem.
        initial (N + P,): the design to begin with in place of the case's; None takes that.
        on_iteration: called after each iteration.
        stop_requested: asked after each iteration whether to stop.
        notify: is given sentences for the user.
        command: the command line, for the record.
        """
        self.case = case
        self.initial = initial
        self.on_iteration = on_iteration
        self.stop_requested = stop_requested
        self.notify = notify
        self.command = command
        self.states: list[State | None] = [None] * case.optimizer.starts
        #: whether every start has gone its way, or is not needed
        self.has_ended = False
        self.warnings: tuple[str, ...] = tuple(mistake.message for mistake in case.warnings)
        self.finals: Datasets = {}
        self.final_objectives: Floats | None = None
        self.constraints: Floats | None = None
        self.combining = Combining(case)
        #: the rounds in which candidates are priced; the case as it was read, whose members are where they begin
        self.rounds = Rounds(case)
        self.sizes = Sizes(case)
        self.stated = case
        self.peaks: dict[str, tuple[tuple[float, float], ...]] = {}
        self.conclusion: Conclusion | None = None
        #: the case's evaluator, until it is told that integrals are near to zero
        self.watched: Engine | None = None
        #: what is to be closed in the end
        self.helpers = ExitStack()

    def begin_with(self, previous: ResultView | None) -> None:
        """Take the members that an earlier process has built, where candidates are priced."""
        if previous is not None and self.case.priced_groups and "iterations/round" in previous.arrays:
            self.case = self.rounds.case = built_case(previous, self.case)
            self.rounds.restore(previous)

    def go(self, make: MakeEngine, path: Path | None, previous: ResultView | None, workers: int) -> Outcome:
        """Go through the whole run."""
        if previous is not None:
            self.restore(previous)
        began = time.perf_counter()
        if make is make_engine:
            compile_apart(self.case, self.notify)
        engine = make(self.case)
        if self.case.uncertainty is not None:
            from mdstopo.robust.uncertain_run import kinds, spread

            for kind in kinds(engine):
                compile_apart(kind, self.notify)
            workers = spread(engine, self.case, workers, self.helpers, self.notify)
        # a run that goes on in a later round begins where it once began, with other members
        started = make(self.stated) if self.rounds.count else engine
        problem = problem_of(started, equal_weights(self.stated))
        stated, begin, self.before = get_ready(self.stated, started, problem, self.initial)
        self.compare(stated, begin)
        compiled = time.perf_counter()
        if path is not None:
            self.open(path, engine)
        self.watched = engine
        opened = time.perf_counter()
        scalarisation = self.combine(started, begin, path)
        if scalarisation is not None or started is not engine:
            problem = problem_of(engine, scalarisation)
        with self.saved_without_worker(path):
            self.iterate(make, self.marked(problem), path, workers, scalarisation)
            while self.case.priced_groups and self.has_ended and self.price(problem):
                engine = make(self.case)
                problem = problem_of(engine, scalarisation)
                self.open_round(self.marked(problem))
                self.iterate(make, self.marked(problem), path, workers, scalarisation)
            self.choose_sizes(problem, path)
        ended = time.perf_counter()
        best = best_of(self.case, self.states)
        if best is None:
            if path is not None and self.combining.solved:
                self.save(path, RunStatus.INTERRUPTED, "stopped on request; the individual optima are saved")
            raise KeyboardInterrupt
        status, reason = self.conclude(best)
        if status not in (RunStatus.RUNNING, RunStatus.INTERRUPTED):
            with self.saved_without_worker(path):
                self.complete(engine, best)
            status, reason = self.judge(best, status, reason)
            ended_at = self.states[best]
            assert ended_at is not None
            self.warnings += stalled_run(self.case, ended_at)
        if path is not None:
            self.save(path, status, reason)
        return self.outcome(engine, path, best, status, reason, ended - opened, compiled - began)

    def choose_sizes(self, problem: Problem, path: Path | None) -> None:
        """Choose sizes from the case's catalogue behind the best optimum, where there is one."""
        best = best_of(self.case, self.states)
        state = None if best is None else self.states[best]
        if not (self.sizes.asked and self.has_ended) or best is None or state is None:
            return
        if state.status is RunStatus.FAILED or self.sizes.is_chosen(state):
            return
        saver = None if path is None else Checkpointer(lambda: self.checkpoint(path))

        def keep() -> None:
            if saver is not None:
                saver.offer()

        self.states[best] = self.sizes.choose(problem, state, self.stop_requested, keep, self.notify)

    def marked(self, problem: Problem) -> Problem:
        """The problem, which says which round of pricing it is of, if it is of one."""
        return Marked(problem, ROUND, self.rounds.count) if self.case.priced_groups else problem

    def price(self, problem: Problem) -> bool:
        """Price all candidates at the optimum of the members; whether some of them enter, which then are built."""
        best = best_of(self.case, self.states)
        state = None if best is None else self.states[best]
        if state is None or self.stop_requested():
            self.has_ended = False
            return False
        self.notify(f"round {self.rounds.count + 1}: pricing {count_text(self.rounds.candidates)} candidates")
        goes_on = self.rounds.go_on(problem, state)
        self.case = self.rounds.case
        return goes_on

    def open_round(self, problem: Problem) -> None:
        """Go on with the members that a round of pricing has built, from the best design before: other starts have
        shown where that is, and end here."""
        best = best_of(self.case, self.states)
        before = None if best is None else self.states[best]
        assert before is not None
        if hasattr(self, "fixed"):
            self.fixed |= self.members_part()
        self.states = [continued(before, make_optimizer(self.case, problem).start(self.rounds.design))]
        self.has_ended = False

    def members_part(self) -> Datasets:
        """The members of the file; a run is resumed with the case as it was read."""
        return case_part(self.case) | {"resume/case": describe(self.stated)} | self.rounds.part()

    @contextmanager
    def saved_without_worker(self, path: Path | None) -> Iterator[None]:
        """What has been reached is saved where a worker is lost; the WorkerError goes on."""
        try:
            yield
        except WorkerError as error:
            if path is not None and best_of(self.case, self.states) is not None:
                self.save(path, RunStatus.INTERRUPTED, str(error))
            raise

    def combine(self, engine: Engine, begin: Floats, path: Path | None) -> Scalarisation | None:
        """U of several objectives, its utopia found first; what is found is kept at once. None for one objective."""
        saver = None if path is None else Checkpointer(lambda: self.checkpoint(path))

        def keep() -> None:
            if saver is not None:
                saver.offer()

        try:
            return self.combining.scalarisation(engine, begin, keep, self.stop_requested, self.notify)
        except StoppedError:
            if path is not None:
                self.save(path, RunStatus.INTERRUPTED, "stopped on request; the individual optima so far are saved")
            raise KeyboardInterrupt from None

    def restore(self, view: ResultView) -> None:
        """Take up the states of an earlier process."""
        if len(self.case.objectives) > 1:
            self.combining.solved = read_tasks(view, "combine/tasks")
            self.combining.begun = read_begun(view, "combine/tasks")
        before = view.arrays.get("design/initial")
        if self.initial is not None and (before is None or not np.array_equal(before, self.initial)):
            raise DifferentCaseError(
                f"{view.path} cannot be resumed with another --alpha: it began with another design",
                ("--alpha",),
            )
        if before is not None:
            self.initial = np.asarray(before, dtype=np.float64)
        starts, earlier = self.case.optimizer.starts, int(view.settings.get("starts", 1))
        known = restore(view, starts)
        self.states = known[:1] if self.rounds.count else carried_over(self.case, known, earlier)
        best = best_of(self.case, self.states)
        self.sizes.restore(view, None if best is None else self.states[best])
        again = [str(k + 1) for k, each in enumerate(self.states) if known[k] is not None and each is None]
        if again:
            self.notify(
                f"{view.path} had {earlier} as the number of starts: with {starts} it is decided anew who goes on, "
                f"from the beginning for {', '.join(again)}"
            )
        if any(state is not None for state in self.states) and "combine/utopia" in view.arrays:
            utopia, maxima = (
                np.asarray(view.array(f"combine/{name}"), dtype=np.float64) for name in ("utopia", "maxima")
            )
            self.combining.fixed = utopia, maxima

    def open(self, path: Path, engine: Engine) -> None:
        """Collect what every checkpoint repeats."""
        chosen = self.case.optimizer
        self.fixed = self.members_part()
        if self.initial is not None:
            self.fixed["design/initial"] = self.initial
        self.provenance = Provenance.collect(self.command)
        self.settings: dict[str, str | int | float | bool] = {
            "integrator": engine.integrator,
            "integrator_reason": engine.integrator_reason,
            "sensitivity": engine.sensitivity,
            "solver_tolerance": self.case.solver.tolerance,
            "preset": chosen.preset,
            "max_iterations": chosen.max_iterations,
            "tolerance": chosen.tolerance,
            "starts": chosen.starts,
            "seed": chosen.seed,
        }
        self.settings |= set_keys(self.case)

    def compare(self, stated: Floats, nearest: Floats) -> None:
        """A notice where the first design is not the stated one."""
        if self.states[0] is not None:
            return
        if words := unshared(self.case, self.initial):
            self.notify(words)
        if is_moved(stated, nearest):
            self.notify(replaced(stated, nearest))

    def iterate(
        self, make: MakeEngine, problem: Problem, path: Path | None, workers: int, scalarisation: Scalarisation | None
    ) -> None:
        """Advance every start, checkpointing as time goes by."""
        chosen = self.case.optimizer
        size = 8.0 * self.case.space.size * _STATE_ARRAYS * chosen.starts
        saver = None if path is None else Checkpointer(lambda: self.checkpoint(path), size / _DISK_SPEED)

        known = self.states[0]
        most = chosen.max_iterations * stage_count(self.case)
        if self.case.priced_groups and known is not None:
            most += iterations_of(known)

        def keep(index: int, state: State) -> None:
            self.states[index] = state
            self.tell_near_zero()
            self.on_iteration(Progress.of(state, index, len(self.states), most))
            if saver is not None:
                saver.offer()

        if workers > 1 and chosen.starts == 1:
            self.notify("one start needs one process: the other workers are not used")
        pool: WorkerPool | None = None
        for tasks in rounds(self.case, self.states, keep):
            if workers > 1 and len(tasks) > 1:
                if pool is None:
                    job = (self.case, self.initial, make, scalarisation)
                    pool = WorkerPool(open_starts, job, min(workers, len(tasks)), notify=self.notify)
                    self.helpers.callback(pool.close)
                run_in_workers(pool, self.states, tasks, keep, self.stop_requested)
            else:
                for task in tasks:
                    if self.stop_requested():
                        break
                    state = self.states[task.index]
                    self.states[task.index] = run_stages(
                        self.case, make, problem, task, state, self.initial, keep, self.stop_requested
                    )
            # who goes on is decided only where all have come as far as they were to: not in a run that is stopped
            if not all(self.is_through(task) for task in tasks):
                break
        else:
            self.has_ended = True

    def tell_near_zero(self) -> None:
        """Say once that an integral is so near to zero that it makes evaluations slow."""
        if self.watched is not None and (sentence := near_zero(self.case, self.watched)):
            self.notify(f"warning: {sentence}")
            self.watched = None

    def is_through(self, task: StartTask) -> bool:
        """Whether a start has gone the part of its way that it was to go."""
        state = self.states[task.index]
        if state is None:
            return False
        return is_done(self.case, state) or (task.quota is not None and state.iteration >= task.quota)

    def conclude(self, best: int) -> tuple[RunStatus, str]:
        """The run's status and why it ended."""
        if not self.has_ended:
            return RunStatus.INTERRUPTED, "stopped on request; the last iteration is saved"
        state = self.states[best]
        assert state is not None
        if self.case.priced_groups:
            return self.rounds.conclude(state)
        if ended := self.sizes.conclude(state):
            return ended
        if self.sizes.is_chosen(state):
            return state.status, state.reason
        stage, count = stage_of(state) + 1, stage_count(self.case)
        return state.status, state.reason if stage == count else f"stage {stage} of {count}: {state.reason}"

    def complete(self, engine: Engine, best: int) -> None:
        """Add what only the final design has: its motion, its sensitivities, advice."""
        state = self.states[best]
        assert state is not None
        space = self.case.space
        design = space.expand(state.best_alpha)
        evaluation = engine.evaluate(design, gradient=True)
        message = getattr(evaluation, "message", "")
        if not evaluation.status.ok:
            lacks = "the sensitivities of the final design: " if evaluation.gradients else "no sensitivities: "
            whose = f": {message}" if message else ""
            self.warnings += (f"{lacks}{evaluation.status.value}{whose}",)
        elif message:
            self.warnings += (message,)
        self.peaks = {
            name: tuple((peak.time, peak.value) for peak in found) for name, found in evaluation.peaks.items()
        }
        if evaluation.status.usable:
            self.constraints = np.asarray(evaluation.constraints, dtype=np.float64)
            if self.sizes.is_chosen(state):
                self.constraints = excess_at_prices(self.case, design, self.constraints)
        if evaluation.status.usable and len(self.case.objectives) > 1:
            names = [objective.name for objective in self.case.objectives]
            last = evaluation
            if not np.array_equal(state.alpha, state.best_alpha):
                last = engine.evaluate(space.expand(state.alpha), gradient=False)
            self.final_objectives = np.array([[each.objectives[name] for name in names] for each in (evaluation, last)])
        after = motions(self.case, engine, design)
        for name, motion in after.items():
            if not motion.status.ok:
                self.warnings += (f"the motion in load case {name} is not whole: {motion.status.value}",)
        self.warnings += advise(self.case, design, self.before, after)
        self.warnings += tuple(filter(None, (coarse_steps(self.case, *each) for each in after.items())))
        if evaluation.status.usable:
            self.warnings += without_slope(self.case, evaluation)
        by_variable = getattr(evaluation, "variable_gradients", {})
        self.finals = trajectory_part(after) | sensitivity_part(evaluation.gradients, by_variable=by_variable)
        if self.case.uncertainty is not None and evaluation.status.usable:
            from mdstopo.robust.uncertain_run import concluded

            self.conclusion = concluded(engine, design)
            self.finals |= self.conclusion.part
            self.warnings += self.conclusion.warnings

    def judge(self, best: int, status: RunStatus, reason: str) -> tuple[RunStatus, str]:
        """The status, where no design keeps the constraints: then the optimiser has converged to nothing of use."""
        state = self.states[best]
        assert state is not None
        if state.best_violation <= self.case.optimizer.tolerance or self.constraints is None:
            return status, reason
        excess = relative_violations(self.case, self.constraints[None])[0]
        i = int(np.argmax(excess))
        if not (np.isfinite(state.best_violation) and excess[i] > 0.0):  # no design was ever evaluated
            return status, reason
        row = self.case.constraints[i]
        word = {"limit": "above its limit", "at_least": "below its least", "equals": "away from its"}[row.sense]
        unit = unit_of_bound(row)
        sentence = (
            f"no design was found that keeps the constraints: constraints[{i}] ({constrained(self.case, row)}) is "
            f"{f'{abs(self.constraints[i]):.6g} {unit}'.rstrip()} {word} {f'{row.bound:.6g} {unit}'.rstrip()}"
        )
        if row.bound == 0.0:  # the optimiser takes it as it is
            reason = reason.replace(" of its bound", "")
        return (RunStatus.FAILED if status is RunStatus.CONVERGED else status), f"{sentence} ({reason})"

    def checkpoint(self, path: Path) -> None:
        """Save in mid-run; a full disk then is no reason to lose the run, it may have room at the end."""
        try:
            self.save(path, RunStatus.RUNNING, "running")
        except WriteError as error:
            self.notify(f"no checkpoint: {error}")

    def save(self, path: Path, status: RunStatus, reason: str) -> None:
        """Write the file as a whole."""
        datasets = self.fixed | self.finals | self.rounds.part()
        visited = np.zeros((0, len(self.case.objectives)))
        if best_of(self.case, self.states) is not None:
            part = run_part(self.case, self.states, self.combining.evaluations, self.final_objectives)
            datasets |= part | self.sizes.part()
            visited = np.asarray(part["iterations/objectives"], dtype=np.float64)
        if len(self.case.objectives) > 1:
            datasets |= self.combining.part(visited)
        write_result(
            path, self.case, "run", status.value, reason, datasets, self.provenance, self.settings, self.warnings
        )

    def outcome(
        self,
        engine: Engine,
        path: Path | None,
        best: int,
        status: RunStatus,
        reason: str,
        seconds: float,
        compile_seconds: float,
    ) -> Outcome:
        """The run as its caller gets it.

        engine: the case's evaluator, which knows the integrator.
        path: the result file; None where there is none.
        best: which start has the best design.
        status, reason: how the run ended, and why in words.
        seconds: that the iterations took (s).
        compile_seconds: that it took to get ready (s).
        """
        state = self.states[best]
        assert state is not None
        before = self.combining.evaluations
        columns = iteration_columns(self.case, state, before, self.final_objectives)
        names = [objective.name for objective in self.case.objectives]
        space = self.case.space
        chosen = self.sizes.best
        design = space.expand(state.best_alpha if chosen is None else chosen)
        objectives = dict(zip(names, columns["objectives"][best_row(state)].tolist(), strict=True))
        constraints = columns["constraints"][best_row(state)]
        if chosen is not None and not self.sizes.is_chosen(state):  # stopped on the way: no iterate has these sizes
            found = engine.evaluate(design, gradient=False)
            objectives = dict(found.objectives)
            constraints = excess_at_prices(self.case, design, np.asarray(found.constraints, dtype=np.float64))
        begun = [each for each in self.states if each is not None]
        begin = first_row(state, 1 if self.sizes.is_chosen(state) else 0)
        return Outcome(
            case=self.case,
            alpha=design[: space.n_alpha],
            variables=space.named(design),
            objectives=objectives,
            initial_objectives=dict(zip(names, columns["objectives"][begin].tolist(), strict=True)),
            peaks=self.peaks,
            constraints=constraints if self.constraints is None else self.constraints,
            utopia=self.combining.utopia,
            maxima=self.combining.maxima,
            combined=float(state.best_objective) if len(names) > 1 else None,
            history=columns,
            status=status,
            reason=reason,
            path=path,
            warnings=self.warnings,
            states=tuple(self.states),
            best_start=best,
            evaluations=before + sum(int(each.evaluations) for each in begun),
            iterations=sum(iterations_of(each) for each in begun),
            seconds=seconds,
            compile_seconds=compile_seconds,
            integrator=engine.integrator,
            integrator_reason=engine.integrator_reason,
            conclusion=self.conclusion,
            pricing=self.rounds.outcome,
            sizes=self.sizes.outcome,
        )


def _check_optimizable(case: Case) -> None:
    mistakes = []
    if not case.objectives:
        mistakes.append(case.marks.mistake("objectives", "an optimisation needs at least one objective"))
    if not case.n_design and not case.variables:
        mistakes.append(case.marks.mistake("members", NOTHING_VARIES))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))
