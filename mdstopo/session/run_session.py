"""A run from start to end. What it has reached is in `run_state`, its file in `run_file`, its last part in
`final_design`."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.design.stages import stage_count
from mdstopo.case.model import Case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.words import count_text
from mdstopo.evaluators import make_engine
from mdstopo.optimizer.problem import Problem
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.session.compiling_apart import compile_apart
from mdstopo.session.final_design import NOT_COMPUTED, FinalDesign, final_design, judged
from mdstopo.session.near_zero import NearZeroNotice
from mdstopo.session.outcome import Callbacks, Outcome, Progress
from mdstopo.session.run_file import RunFile
from mdstopo.session.run_state import RunState
from mdstopo.session.saved_states import best_row, iteration_columns
from mdstopo.session.sizes import Sizes, excess_at_prices
from mdstopo.session.start_in_stages import (
    ROUND,
    Marked,
    continued,
    first_row,
    iterations_of,
    run_stages,
)
from mdstopo.session.starts_in_workers import open_starts, run_in_workers
from mdstopo.starts.callbacks import Notify, ignore, never
from mdstopo.starts.evaluator_interface import Engine, MakeEngine, equal_weights, problem_of
from mdstopo.starts.getting_ready import get_ready
from mdstopo.starts.quotas import rounds
from mdstopo.starts.single_start import NOTHING_VARIES, is_moved, make_optimizer, replaced, unshared
from mdstopo.status import RunStatus
from mdstopo.store.admit import admit, admit_resume, prepare_place
from mdstopo.store.atomic import remove_leftovers
from mdstopo.store.lock import Lock
from mdstopo.workers.worker_pool import StoppedError, WorkerPool

Floats = NDArray[np.float64]


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
    Sizes(case).refuse()
    state = RunState(case, initial)
    callbacks = Callbacks(on_iteration or ignore, stop_requested or never, notify or ignore)
    if path is None:
        return _Run(state, RunFile(None, state, callbacks.notify, command), callbacks, engine, workers or 1).go()
    place = prepare_place(Path(path))
    with Lock(place):
        remove_leftovers(place)
        if resume:
            previous = admit_resume(place, case, callbacks.notify)
            if previous is not None:
                state.restore(previous, callbacks.notify)
        else:
            admit(place, case, "run", overwrite, callbacks.notify)
        return _Run(state, RunFile(place, state, callbacks.notify, command), callbacks, engine, workers or 1).go()


class _Run:
    """One run from start to end: get ready, combine objectives, advance all starts, look at the final design, save."""

    def __init__(
        self, state: RunState, file: RunFile, callbacks: Callbacks, make_engine: MakeEngine, workers: int
    ) -> None:
        """Begin where the state is.

        state: how far the run has come.
        file: where it is saved.
        callbacks: what the run asks and tells its caller.
        make_engine: makes the evaluator of a case.
        workers: how many processes starts are done on.
        """
        self.state = state
        self.file = file
        self.make_engine = make_engine
        self.workers = workers
        self.on_iteration = callbacks.on_iteration
        self.stop_requested = callbacks.stop_requested
        self.notify = callbacks.notify
        #: closes other processes in the end
        self.helpers = ExitStack()
        #: what optimising has taken, and what came before it (s)
        self.seconds = self.compile_seconds = 0.0

    def go(self) -> Outcome:
        """Go through the whole run. Raises what `run_session` does."""
        with self.helpers:
            return self._go()

    def _go(self) -> Outcome:
        state = self.state
        began = time.perf_counter()
        engine = self._compiled()
        # a run that goes on in a later round begins where it once began, with other members
        started = self.make_engine(state.stated) if state.rounds.count else engine
        problem = problem_of(started, equal_weights(state.stated))
        stated, first, motions_before = get_ready(state.stated, started, problem, state.initial)
        self._tell_first_design(stated, first)
        compiled = time.perf_counter()
        self.file.open(engine)
        opened = time.perf_counter()
        scalarisation = self._combine(started, first)
        if scalarisation is not None or started is not engine:
            problem = problem_of(engine, scalarisation)
        with self.file.saved_without_worker():
            engine = self._optimize(engine, problem, scalarisation)
        self.seconds, self.compile_seconds = time.perf_counter() - opened, compiled - began
        if state.best_state is None:
            if state.combining.solved:
                self.file.save(RunStatus.INTERRUPTED, "stopped on request; the individual optima are saved")
            raise KeyboardInterrupt
        status, reason = state.conclude()
        final = NOT_COMPUTED
        if status not in (RunStatus.RUNNING, RunStatus.INTERRUPTED):
            with self.file.saved_without_worker():
                final = final_design(state.case, engine, state.best_state, motions_before)
            status, reason = judged(state.case, state.best_state, final.constraints, status, reason)
        self.file.save(status, reason, final)
        return self._outcome(engine, final, status, reason)

    def _compiled(self) -> Engine:
        """The case's evaluator, its kernels compiled; of an uncertain case other processes evaluate its points."""
        case = self.state.case
        if self.make_engine is make_engine:
            compile_apart(case, self.notify)
        engine = self.make_engine(case)
        if case.uncertainty is not None:
            from mdstopo.robust.uncertain_run import kinds, spread

            for kind in kinds(engine):
                compile_apart(kind, self.notify)
            self.workers = spread(engine, case, self.workers, self.helpers, self.notify)
        return engine

    def _tell_first_design(self, stated: Floats, nearest: Floats) -> None:
        """A notice where the first design is not the stated one."""
        if self.state.states[0] is not None:
            return
        if words := unshared(self.state.case, self.state.initial):
            self.notify(words)
        if is_moved(stated, nearest):
            self.notify(replaced(stated, nearest))

    def _combine(self, engine: Engine, first: Floats) -> Scalarisation | None:
        """U of several objectives, its utopia found first; what is found is kept at once. None for one objective."""
        combining, save = self.state.combining, self.file.saver()
        try:
            return combining.scalarisation(engine, first, save, self.stop_requested, self.notify)
        except StoppedError:
            self.file.save(RunStatus.INTERRUPTED, "stopped on request; the individual optima so far are saved")
            raise KeyboardInterrupt from None

    def _optimize(self, engine: Engine, problem: Problem, scalarisation: Scalarisation | None) -> Engine:
        """Advance all starts to their ends, where candidates are priced in rounds, and choose sizes behind them.

        engine: the evaluator of the members that are built. problem: what the optimiser sees of it. Returns the
        evaluator of the members that are built in the end.
        """
        state, near_zero = self.state, NearZeroNotice(self.state.case, engine, self.notify)
        self._iterate(self._marked(problem), scalarisation, near_zero)
        while state.case.priced_groups and state.has_ended and self._price(problem):
            engine = self.make_engine(state.case)
            problem = problem_of(engine, scalarisation)
            self._open_round(self._marked(problem))
            self._iterate(self._marked(problem), scalarisation, near_zero)
        self._choose_sizes(problem)
        return engine

    def _marked(self, problem: Problem) -> Problem:
        """The problem, which says which round of pricing it is of, if it is of one."""
        return Marked(problem, ROUND, self.state.rounds.count) if self.state.case.priced_groups else problem

    def _price(self, problem: Problem) -> bool:
        """Price all candidates at the optimum of the members; whether some of them enter, which then are built."""
        state, rounds = self.state, self.state.rounds
        best = state.best_state
        if best is None or self.stop_requested():
            state.has_ended = False
            return False
        self.notify(f"round {rounds.count + 1}: pricing {count_text(rounds.candidates)} candidates")
        goes_on = rounds.go_on(problem, best)
        state.case = rounds.case
        return goes_on

    def _open_round(self, problem: Problem) -> None:
        """Go on with the members that a round of pricing has built, from the best design before: other starts have
        shown where that is, and end here."""
        state = self.state
        before = state.best_state
        assert before is not None
        self.file.take_members()
        state.states = [continued(before, make_optimizer(state.case, problem).start(state.rounds.design))]
        state.has_ended = False

    def _iterate(self, problem: Problem, scalarisation: Scalarisation | None, near_zero: NearZeroNotice) -> None:
        """Advance every start, saving as time goes by."""
        case, states, initial = self.state.case, self.state.states, self.state.initial
        save = self.file.saver()
        known = states[0]
        most = case.optimizer.max_iterations * stage_count(case)
        if case.priced_groups and known is not None:
            most += iterations_of(known)

        def keep(index: int, state: State) -> None:
            states[index] = state
            near_zero.look()
            self.on_iteration(Progress.of(state, index, len(states), most))
            save()

        if self.workers > 1 and case.optimizer.starts == 1:
            self.notify("one start needs one process: the other workers are not used")
        pool: WorkerPool | None = None
        for tasks in rounds(case, states, keep):
            if self.workers > 1 and len(tasks) > 1:
                if pool is None:
                    job = (case, initial, self.make_engine, scalarisation)
                    pool = WorkerPool(open_starts, job, min(self.workers, len(tasks)), notify=self.notify)
                    self.helpers.callback(pool.close)
                run_in_workers(pool, states, tasks, keep, self.stop_requested)
            else:
                for task in tasks:
                    if self.stop_requested():
                        break
                    state = states[task.index]
                    states[task.index] = run_stages(
                        case, self.make_engine, problem, task, state, initial, keep, self.stop_requested
                    )
            # who goes on is decided only where all have come as far as they were to: not in a run that is stopped
            if not all(self.state.is_through(task) for task in tasks):
                break
        else:
            self.state.has_ended = True

    def _choose_sizes(self, problem: Problem) -> None:
        """Choose sizes from the case's catalogue behind the best optimum, where there is one."""
        sizes, best, optimum = self.state.sizes, self.state.best, self.state.best_state
        if not (sizes.asked and self.state.has_ended) or best is None or optimum is None:
            return
        if optimum.status is RunStatus.FAILED or sizes.is_chosen(optimum):
            return
        save = self.file.saver()
        self.state.states[best] = sizes.choose(problem, optimum, self.stop_requested, save, self.notify)

    def _outcome(self, engine: Engine, final: FinalDesign, status: RunStatus, reason: str) -> Outcome:
        """The run as its caller gets it.

        engine: the case's evaluator, which knows the integrator.
        final: what has been computed of the final design.
        status, reason: how the run ended, and why in words.
        """
        run, case, space = self.state, self.state.case, self.state.case.space
        best, state, sizes = run.best, run.best_state, run.sizes
        assert best is not None
        assert state is not None
        before = run.combining.evaluations
        columns = iteration_columns(case, state, before, final.objectives)
        names = [objective.name for objective in case.objectives]
        design = space.expand(state.best_alpha if sizes.best is None else sizes.best)
        objectives = dict(zip(names, columns["objectives"][best_row(state)].tolist(), strict=True))
        constraints = columns["constraints"][best_row(state)]
        if sizes.best is not None and not sizes.is_chosen(state):  # stopped on the way: no iterate has these sizes
            found = engine.evaluate(design, gradient=False)
            objectives = dict(found.objectives)
            constraints = excess_at_prices(case, design, np.asarray(found.constraints, dtype=np.float64))
        begun = [each for each in run.states if each is not None]
        first = first_row(state, 1 if sizes.is_chosen(state) else 0)
        return Outcome(
            case=case,
            alpha=design[: space.n_alpha],
            variables=space.named(design),
            objectives=objectives,
            initial_objectives=dict(zip(names, columns["objectives"][first].tolist(), strict=True)),
            peaks=final.peaks,
            constraints=constraints if final.constraints is None else final.constraints,
            utopia=run.combining.utopia,
            maxima=run.combining.maxima,
            combined=float(state.best_objective) if len(names) > 1 else None,
            history=columns,
            status=status,
            reason=reason,
            path=self.file.path,
            warnings=self.file.warnings + final.warnings,
            states=tuple(run.states),
            best_start=best,
            evaluations=before + sum(int(each.evaluations) for each in begun),
            iterations=sum(iterations_of(each) for each in begun),
            seconds=self.seconds,
            compile_seconds=self.compile_seconds,
            integrator=engine.integrator,
            integrator_reason=engine.integrator_reason,
            conclusion=final.conclusion,
            pricing=run.rounds.outcome,
            sizes=sizes.outcome,
        )


def _check_optimizable(case: Case) -> None:
    mistakes = []
    if not case.objectives:
        mistakes.append(case.marks.mistake("objectives", "an optimisation needs at least one objective"))
    if not case.n_design and not case.variables:
        mistakes.append(case.marks.mistake("members", NOTHING_VARIES))
    if mistakes:
        raise CaseError(mistakes, str(case.path or case.name))
