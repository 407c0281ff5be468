"""Who goes on of several starts: decided once for each quota, whatever is stopped and resumed."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.optimizer.start_families import Family
from mdstopo.optimizer.state import State
from mdstopo.starts.quotas import (
    LOOKS,
    QUOTAS,
    SECOND_TRIAL,
    TRIAL,
    all_found,
    came_to,
    distinct,
    drop,
    drop_twins,
    expected_optima,
    foresees_same,
    lags,
    left_behind,
    rounds,
)
from mdstopo.starts.single_start import LONG_FIRST_STEPS, make_optimizer
from mdstopo.status import RunStatus
from tests.fakes import FakeEngineWithEvaluations, hand_made_case, limited


@pytest.fixture
def first() -> State:
    case = limited(hand_made_case(), 60)
    return make_optimizer(case, FakeEngineWithEvaluations(case).problem()).start()


def at(state: State, iteration: int, objective: float, status: RunStatus = RunStatus.RUNNING) -> State:
    """The state after so many iterations, with a best design of its own for each objective, where it goes on, too."""
    alpha = np.full_like(state.alpha, objective)
    return replace(
        state, iteration=iteration, best_objective=objective, best_alpha=alpha, trial=alpha, objective=objective,
        predicted=0.0, status=status,
    )  # fmt: skip


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
            tasks |= {task.index: task for task in asked if task.index >= 4 and task.quota == 0}
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


def test_the_stated_design_goes_on_behind_all_others_where_it_was_dropped(first: State) -> None:
    """A run of several starts ended higher than one of the stated design alone, which had been dropped."""
    case = limited(hand_made_case(), 60)
    slow, slower = (falling(first, 9.0, value, value) for value in (5.0, 6.0))
    ended = replace(falling(first, 9.0, 1.0, 1.0), status=RunStatus.CONVERGED)
    states: list[State | None] = [slow, slower, ended]
    asked = []
    for tasks in rounds(case, states, ignore):
        asked.append([(task.index, task.quota) for task in tasks])
        for task in tasks:
            if task.index == 1:  # the softened start ends, too
                states[1] = replace(slower, iteration=QUOTAS[0] + 1, status=RunStatus.CONVERGED)
    assert (0, None) not in [each for tasks in asked[:-1] for each in tasks]
    assert asked[-1] == [(0, None)]
    taken = states[0]
    assert taken is not None
    assert taken.running
    assert left_behind(states) == []
    # stopped on its way, resumed: nothing is decided about it once more, and nothing else begins
    states[0] = on_its_way = replace(taken, iteration=TRIAL + 9)
    kept: list[int] = []
    again = list(rounds(case, states, lambda index, _: kept.append(index)))
    assert states[0] is on_its_way
    assert kept == []
    assert [task.index for task in again[-1]] == [0]
    assert 0 not in [task.index for tasks in again[1:-1] for task in tasks]


def test_a_stated_design_that_came_to_the_same_as_another_start_does_not_go_on(first: State) -> None:
    case = limited(hand_made_case(), 60)
    twin = replace(at(first, 6, 0.3), dropped=True, twin=1, status=RunStatus.MAX_ITERATIONS)
    ended = at(first, 30, 0.1, RunStatus.CONVERGED)
    states: list[State | None] = [twin, ended, ended]
    assert 0 not in [task.index for task in list(rounds(case, states, ignore))[-1]]


def test_starts_that_are_about_to_come_to_the_same_are_twins_and_others_are_not(first: State) -> None:
    """The same design next, of the same value by the models, whatever the best designs so far are."""
    one = at(first, SECOND_TRIAL, 0.5)
    far = replace(one, best_alpha=np.zeros_like(one.alpha), best_objective=9.0)
    assert foresees_same(far, one)
    assert foresees_same(replace(far, objective=0.7, predicted=0.2), one)  # a step that lowers 0.7 by 0.2
    assert not foresees_same(replace(far, objective=0.7, predicted=0.1), one)
    assert not foresees_same(replace(far, trial=one.trial + 0.03), one)
    assert not foresees_same(replace(far, restoring=True), one)  # its model is of the violation
    ended = replace(one, status=RunStatus.CONVERGED, trial=np.zeros_like(one.trial))
    assert foresees_same(far, ended)
    assert not foresees_same(replace(far, status=RunStatus.FAILED), ended)


def test_the_better_of_two_that_come_to_the_same_goes_on_and_who_has_ended_is_never_dropped(first: State) -> None:
    one, other = at(first, SECOND_TRIAL, 0.5), replace(at(first, SECOND_TRIAL, 0.5), best_objective=0.499)
    ended = replace(at(first, 2, 0.5, RunStatus.CONVERGED), best_objective=0.6)
    states: list[State | None] = [one, other, ended, at(first, SECOND_TRIAL, 0.8)]
    drop_twins(range(4), (), 0.0, states, ignore)
    assert [state is not None and state.dropped for state in states] == [True, False, False, False]
    assert states[0] is not None
    assert states[0].twin == 1


def test_the_table_of_optima_has_twins_with_what_they_came_to_and_leaves_out_who_was_left_behind(first: State) -> None:
    best, worse = at(first, 30, 0.1, RunStatus.CONVERGED), at(first, 30, 0.5, RunStatus.CONVERGED)
    twin = replace(at(first, 6, 0.3), dropped=True, twin=0, status=RunStatus.MAX_ITERATIONS)
    left = replace(twin, twin=-1)
    states: list[State | None] = [best, twin, worse, left, replace(twin, twin=1), replace(twin, twin=3), None]
    found = distinct(states, 0.0)
    assert [each.starts for each in found] == [(0, 1, 4), (2,)]
    assert found[0].evaluations == sum(state.evaluations for state in (best, twin, twin))
    assert left_behind(states) == [3, 5]


@pytest.mark.parametrize(
    ("starts", "found", "expected"), [(8, 1, 1.4), (7, 1, 1.5), (17, 2, 32 / 13), (16, 2, 2.5), (4, 2, np.inf)]
)
def test_how_many_optima_are_expected(starts: int, found: int, expected: float) -> None:
    assert expected_optima(starts, found) == pytest.approx(expected, rel=1e-12)


def test_the_estimate_is_the_posterior_mean_of_the_number_of_optima() -> None:
    """Boender and Rinnooy Kan's: all numbers of optima, and all sizes of their basins, alike likely beforehand. The sum
    over the posterior's terms, without the closed form."""
    from math import lgamma

    n, w = 12, 3
    numbers = np.arange(w, 200_000)
    # so many optima K: of the ways to put n starts into K basins, those that leave all but w empty
    terms = np.array([lgamma(k + 1) - lgamma(k - w + 1) - lgamma(k + n) + lgamma(k) for k in numbers])
    weights = np.exp(terms - terms.max())
    assert expected_optima(n, w) == pytest.approx(float(weights @ numbers / weights.sum()), rel=1e-6)


def test_no_further_starts_begin_where_all_optima_are_found_and_that_is_seen_the_same_way_later(first: State) -> None:
    """Eight of twelve starts begin away from the best: seven come to the same, one is left behind."""
    case = limited(hand_made_case(), 60, starts=12)
    twin = replace(at(first, LOOKS[1], 0.3), dropped=True, twin=0, status=RunStatus.MAX_ITERATIONS)
    early: list[State | None] = [at(first, QUOTAS[0], 0.1), *[twin] * 7, replace(twin, twin=-1)]
    assert came_to(early) == (8, 1)
    assert all_found(early)
    states = [*early, None, None, None]
    asked = [task.index for tasks in rounds(case, states, ignore) for task in tasks]
    assert max(asked) == 8
    # later: the first has come to the end, or another one was as far and was dropped as worse or for the same optimum
    for last in (at(first, 55, 0.1), replace(at(first, 55, 0.1), status=RunStatus.CONVERGED)):
        assert came_to([last, *early[1:]]) == (8, 1)
    worse = at(first, QUOTAS[0], 0.5)
    late_twin = replace(worse, iteration=24, dropped=True, twin=0, status=RunStatus.MAX_ITERATIONS)
    assert came_to([*early, worse]) == came_to([*early, late_twin]) == (9, 2)
    assert not all_found([*early, late_twin])


def test_random_designs_begin_with_long_steps_where_the_case_states_none() -> None:
    case = limited(hand_made_case(), 60)
    problem = FakeEngineWithEvaluations(case).problem()
    boxes = {family: make_optimizer(case, problem, family).start().trust for family in Family}
    assert boxes.pop(Family.RANDOM) == LONG_FIRST_STEPS
    assert set(boxes.values()) == {make_optimizer(case, problem).start().trust}
    assert 2.0 * boxes[Family.STATED] < LONG_FIRST_STEPS
    stated = replace(case, optimizer=replace(case.optimizer, options=(("trust_start", 0.1),)))
    assert make_optimizer(stated, problem, Family.RANDOM).start().trust == 0.1
