"""Who goes on of several starts: decided once for each quota, whatever is stopped and resumed."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.optimizer.start_families import Family
from mdstopo.optimizer.state import State
from mdstopo.starts.quotas import QUOTAS, TRIAL, drop, lags, rounds
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


def ignore(_index: int, _state: State) -> None:
    """Keep nothing."""


def test_starts_that_begin_at_the_best_do_so_one_after_the_other_also_when_resumed(first: State) -> None:
    """Six starts, the last two from the best: the second of these from what the first one has found, and neither from
    what later ones had found when the run was stopped."""
    case = limited(hand_made_case(), 60)
    early: list[State | None] = [at(first, QUOTAS[0], value) for value in (0.3, 0.1, 0.2, 0.4)]
    later = at(first, QUOTAS[0], 0.01)
    for states in ([*early, None, None], [*early, None, later], [*early, at(first, 3, 0.09), later]):
        tasks = {}
        for asked in rounds(case, states, ignore):
            tasks |= {task.index: task for task in asked if task.index >= 4 and task.quota == TRIAL}
            if 4 in tasks and states[4] is None:
                states[4] = at(first, TRIAL, 0.09)
            if 5 in tasks:
                break
        assert [None if task.best is None else task.best[0] for task in tasks.values()] == [0.1, 0.09]
        assert [task.family for task in tasks.values()] == [Family.OTHER_FROM, Family.OTHER_TO]


def falling(state: State, *objectives: float) -> State:
    """The state with a history of these objectives."""
    history = replace(state.history, objective=list(objectives))
    return replace(at(state, TRIAL, min(objectives)), history=history)


def test_a_start_that_is_far_behind_at_the_first_look_is_dropped_unless_it_falls_fast(first: State) -> None:
    best = falling(first, 9.0, 3.0, 3.0)
    assert not lags(falling(first, 9.0, 3.9, 3.9), best, 0.0)
    assert lags(falling(first, 9.0, 4.1, 4.1), best, 0.0)
    assert not lags(falling(first, 9.0, 9.0, 4.1), best, 0.0)
    broken = [replace(best, best_violation=1.0, best_plain=excess) for excess in (0.3, 0.4, 0.6)]
    assert [lags(each, best, 0.0) for each in broken] == [False, True, True]
    assert [lags(each, broken[0], 0.0) for each in broken] == [False, False, False]
    assert lags(replace(best, best_violation=1.0, best_plain=0.7), broken[0], 0.0)


def test_who_is_far_behind_is_decided_once_and_never_of_a_softened_start(first: State) -> None:
    case = limited(hand_made_case(), 60)
    slow = falling(first, 9.0, 5.0, 5.0)
    states: list[State | None] = [falling(first, 9.0, 1.0, 1.0), slow, slow]
    going = rounds(case, states, ignore)
    assert [task.index for task in next(going)] == [0, 1, 2]
    assert [task.index for task in next(going)] == [0, 1]
    assert states[2] is not None
    assert states[2].dropped
    states = [at(first, TRIAL + 1, 0.1), slow, slow]  # resumed: the first has gone on, so the others were to
    going = rounds(case, states, ignore)
    next(going)
    assert [task.index for task in next(going)] == [0, 1, 2]


def test_random_designs_begin_with_long_steps_where_the_case_states_none() -> None:
    case = limited(hand_made_case(), 60)
    problem = FakeEngineWithEvaluations(case).problem()
    boxes = {family: make_optimizer(case, problem, family).start().trust for family in Family}
    assert boxes.pop(Family.RANDOM) == LONG_FIRST_STEPS
    assert set(boxes.values()) == {make_optimizer(case, problem).start().trust}
    assert 2.0 * boxes[Family.STATED] < LONG_FIRST_STEPS
    stated = replace(case, optimizer=replace(case.optimizer, options=(("trust_start", 0.1),)))
    assert make_optimizer(stated, problem, Family.RANDOM).start().trust == 0.1
