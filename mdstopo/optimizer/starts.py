"""Several independent runs from different designs: these problems are multimodal.

Start 0 is the problem's own initial design, the others are random feasible designs that depend on the seed
and their number alone. A run is the same whether this process does it or a worker, and whatever the number of
workers.
"""

import signal
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mdstopo.optimizer.driver import Gsao, run
from mdstopo.optimizer.presets import Settings
from mdstopo.optimizer.problem import Floats, Problem
from mdstopo.optimizer.projection import project
from mdstopo.optimizer.state import State

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

POLL = 0.1
SHARPNESS = 4


@dataclass(frozen=True, slots=True)
class Starts:
    """All runs in the order of the starts, None where one was not begun, and the index of the best."""

    runs: tuple[State | None, ...]
    best: int

    @property
    def complete(self) -> bool:
        """Whether every run has ended."""
        return all(state is not None and not state.running for state in self.runs)


def random_feasible(problem: Problem, seed: int, index: int) -> Floats:
    """The design of random start `index` >= 1: few thick members and many thin ones, projected on the linear
    rows.

    The shares of the range are powers of uniform numbers. Good designs are nearly 0/1, and such starts find
    the better basins more often than uniform or sparser ones (measured on the two-body scenes).
    """
    share = np.random.default_rng([seed, index]).uniform(size=len(problem.lower)) ** SHARPNESS
    draw = problem.lower + share * (problem.upper - problem.lower)
    return project(draw, problem.lower, problem.upper, problem.linear)


def start_design(problem: Problem, seed: int, index: int) -> Floats:
    """Where start `index` begins."""
    return problem.initial if index == 0 else random_feasible(problem, seed, index)


def run_start(
    problem: Problem,
    settings: Settings,
    seed: int,
    index: int,
    *,
    state: State | None = None,
    on_iteration: Callable[[State], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
) -> State:
    """One of the runs, from its beginning or from a state of it."""
    optimizer = Gsao(problem, settings)
    if state is None:
        state = optimizer.start(start_design(problem, seed, index))
        if on_iteration is not None:
            on_iteration(state)
    else:
        state = optimizer.reopen(state)
    return run(optimizer, state, on_iteration=on_iteration, stop_requested=stop_requested)


def run_starts(
    make_problem: Callable[[], Problem],
    settings: Settings,
    n: int,
    *,
    seed: int = 0,
    workers: int = 1,
    states: Sequence[State | None] | None = None,
    on_start: Callable[[int, State], None] | None = None,
    stop_requested: Callable[[], bool] | None = None,
) -> Starts:
    """Run `n` starts, in this process or in `workers` spawned ones.

    make_problem: picklable; called once in every process. states: where runs of an earlier call were, to be
    continued. on_start(index, state) is called in this process as each run ends or is interrupted, in the
    order of ending. After stop_requested says yes, runs stop between iterations and no new one begins.
    Workers ignore SIGINT: it is this process that decides to stop.
    """
    before: list[State | None] = list(states) if states is not None else []
    before += [None] * (n - len(before))
    if workers <= 1 or n <= 1:
        runs = _here(make_problem, settings, before, seed, on_start, stop_requested)
    else:
        runs = _in_workers(make_problem, settings, before, seed, min(workers, n), on_start, stop_requested)
    return Starts(tuple(runs), best_run(runs, settings.tolerance))


def best_run(runs: Sequence[State | None], tolerance: float) -> int:
    """The index of the best run: feasible before infeasible, then the lowest objective, then the first."""

    def key(item: tuple[int, State | None]) -> tuple[bool, float, float, int]:
        index, state = item
        if state is None or not np.isfinite(state.best_objective):
            return True, float("inf"), float("inf"), index
        infeasible = state.best_violation > tolerance
        return infeasible, state.best_violation if infeasible else 0.0, state.best_objective, index

    return min(enumerate(runs), key=key)[0]


def _here(
    make_problem: Callable[[], Problem],
    settings: Settings,
    before: list[State | None],
    seed: int,
    on_start: Callable[[int, State], None] | None,
    stop_requested: Callable[[], bool] | None,
) -> list[State | None]:
    problem = make_problem()
    runs = list(before)
    for index, state in enumerate(before):
        if stop_requested is not None and stop_requested():
            break
        runs[index] = done = run_start(
            problem, settings, seed, index, state=state, stop_requested=stop_requested
        )
        if on_start is not None:
            on_start(index, done)
    return runs


def _in_workers(
    make_problem: Callable[[], Problem],
    settings: Settings,
    before: list[State | None],
    seed: int,
    workers: int,
    on_start: Callable[[int, State], None] | None,
    stop_requested: Callable[[], bool] | None,
) -> list[State | None]:
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from multiprocessing import get_context

    context = get_context("spawn")
    stop = context.Event()
    runs = list(before)
    with ProcessPoolExecutor(workers, context, _prepare, (make_problem, settings, seed, stop)) as pool:
        pending = {pool.submit(_work, index, state): index for index, state in enumerate(before)}
        while pending:
            done, _ = wait(pending, timeout=POLL, return_when=FIRST_COMPLETED)
            for future in done:
                index = pending.pop(future)
                state = future.result()
                if state is not None:
                    runs[index] = state
                    if on_start is not None:
                        on_start(index, state)
            if stop_requested is not None and not stop.is_set() and stop_requested():
                stop.set()
    return runs


@dataclass(frozen=True, slots=True)
class _Bench:
    """What a worker process keeps from run to run."""

    problem: Problem
    settings: Settings
    seed: int
    stop: "Event"


# Set once in each worker process by `_prepare`, before its first run; empty in every other process.
_bench: list[_Bench] = []


def _prepare(make_problem: Callable[[], Problem], settings: Settings, seed: int, stop: "Event") -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _bench.append(_Bench(make_problem(), settings, seed, stop))


def _work(index: int, state: State | None) -> State | None:
    bench = _bench[0]
    if bench.stop.is_set():
        return state
    return run_start(
        bench.problem, bench.settings, bench.seed, index, state=state, stop_requested=bench.stop.is_set
    )
