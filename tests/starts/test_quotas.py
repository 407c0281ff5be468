"""Who goes on of several starts: decided once for each quota, whatever is stopped and resumed."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.optimizer.start_families import Family
from mdstopo.optimizer.state import State
from mdstopo.starts.quotas import QUOTAS, drop, rounds
from mdstopo.starts.single_start import LONG_FIRST_STEPS, make_optimizer
from mdstopo.status import RunStatus
from tests.fakes import FakeEngineWithEvaluations, hand_made_case, limited


@pytest.fixture
def first() -> State:
    case = limited(hand_made_case(), 60)
    return make_optimizer(case, FakeEngineWithEvaluations(case).problem()).start()


def at(state: State, iteration: int, objective: float, status: RunStatus = RunStatus.RUNNING) -> State:
    """The state after so many iterations, with a best design of its own for each objective."""
    alpha = np.full_like(state.alpha, objective)
    return replace(state, iteration=iteration, best_objective=objective, best_alpha=alpha, status=status)


def decided(states: list[State | None]) -> list[bool]:
    def keep(index: int, state: State) -> None:
        assert states[index] is state

    drop(0.0, states, QUOTAS[0], keep)
    return [state is not None and state.dropped for state in states]


def test_starts_that_lag_behind_are_dropped_at_their_quota(first: State) -> None:
    states: list[State | None] = [at(first, QUOTAS[0], value) for value in (0.3, 0.1, 0.11, 0.9)]
    assert decided(states) == [True, False, False, True]
    assert states[3] is not None
    assert states[3].status is RunStatus.MAX_ITERATIONS


def test_what_one_start_finds_afterwards_does_not_change_who_goes_on(first: State) -> None:
    """The second start was to go on; the run was stopped when the first one had ended, and far better by then."""
    ended = at(first, QUOTAS[0] + 9, 0.01, RunStatus.CONVERGED)
    states: list[State | None] = [ended, at(first, QUOTAS[0], 0.11), None]
    assert decided(states) == [False, False, False]


def test_starts_that_begin_at_the_best_do_so_at_that_of_the_others_also_when_resumed(first: State) -> None:
    """Six starts, the last two from the best: one of these had begun when the run was stopped, and found better."""
    case = limited(hand_made_case(), 60)
    early: list[State | None] = [at(first, QUOTAS[0], value) for value in (0.3, 0.1, 0.2, 0.4)]
    for late in (None, at(first, QUOTAS[0], 0.01)):
        going = rounds(case, [*early, late, None], lambda index, state: None)
        tasks = [next(going)[0] for _ in range(3)][1:]
        assert [task.index for task in tasks] == [4, 5]
        assert all(task.best is not None and task.best[0] == 0.1 for task in tasks)


def test_random_designs_begin_with_long_steps_where_the_case_states_none() -> None:
    case = limited(hand_made_case(), 60)
    problem = FakeEngineWithEvaluations(case).problem()
    boxes = {family: make_optimizer(case, problem, family).start().trust for family in Family}
    assert boxes.pop(Family.RANDOM) == LONG_FIRST_STEPS
    assert set(boxes.values()) == {make_optimizer(case, problem).start().trust}
    assert 2.0 * boxes[Family.STATED] < LONG_FIRST_STEPS
    stated = replace(case, optimizer=replace(case.optimizer, options=(("trust_start", 0.1),)))
    assert make_optimizer(stated, problem, Family.RANDOM).start().trust == 0.1
