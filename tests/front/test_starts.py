"""Several starts of the solves of a front: families, quotas, and the same end whatever was stopped and resumed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, run_front
from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.start_families import Family, begins_at_best, family_of
from mdstopo.optimizer.state import State
from mdstopo.plan import race as races
from mdstopo.plan.front_plan import Planner, Request, Starts
from mdstopo.plan.race import in_contest, race
from mdstopo.plan.solve_task import Task, failed
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus
from mdstopo.store.result_reader import read_result
from tests.front.support import CASE
from tests.front.test_fronts import spread
from tests.optimizer.toys import compliance_problem
from tests.plan.test_plan import carried_out, convex, solver
from tests.result_files import assert_same_files, stop_after

STARTS = 4
U = Scalarisation("weighted_sum", np.ones(2))


#: so early that even the solves of the small case get there
QUOTAS = (3, 6)


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(races, "QUOTAS", QUOTAS)


@pytest.fixture(scope="module")
def first() -> State:
    return Gsao(compliance_problem()[0], settings("default")).start()


def tasks_of(count: int) -> list[Task]:
    return in_contest([Task(0, U, np.full(3, float(k)), 100) for k in range(count)])


def at(state: State, iteration: int, objective: float, level: float) -> State:
    """The state after so many iterations, with a best design of its own, where it goes on, too."""
    alpha = np.full_like(state.alpha, level)
    return replace(
        state, iteration=iteration, best_objective=objective, best_alpha=alpha, trial=alpha, objective=objective
    )


def found_of(task: Task):
    return replace(failed(task.point, "k", task.start, 2, ""), evaluations=1, status=RunStatus.CONVERGED)


def raced(contests, alone, answer):
    """Every round's tasks of a race, and what it comes to; answer: the result of a task."""
    going, rounds = race(alone, contests, 1e-6), []
    tasks = next(going)
    while True:
        rounds.append(tasks)
        try:
            tasks = going.send([answer(task) for task in tasks])
        except StopIteration as end:
            return rounds, end.value


def test_starts_of_a_solve_go_on_in_quotas_and_others_go_to_their_ends_beside_them(first: State) -> None:
    """Of four starts the best two go on; what lags ends at the first quota; nothing waits for what has no contest."""

    def answer(task: Task):
        if task.quota is None:
            return found_of(task)
        if task.begun is not None and not task.begun.running:
            return task.begun
        level = float(task.start[0])
        return at(first, task.quota, 1.0 + 0.1 * level, level)

    lonely = Task(7, U, np.zeros(3), 100)
    rounds, solved = raced([tasks_of(4), tasks_of(1)], [lonely], answer)
    assert [task.quota for task in rounds[0]] == [None, None, *[QUOTAS[0]] * 4]
    dropped = [[task.begun.dropped for task in each if task.begun is not None] for each in rounds]
    assert dropped == [[], [False, False, True, True], [False, False, True, True]]
    assert [task.quota for task in rounds[2]] == [None] * 4
    assert [task.point for task, _ in solved] == [7, 0, 0, 0, 0, 0]


def test_a_start_that_fails_does_not_stop_the_others(first: State) -> None:
    def answer(task: Task):
        if task.start[0] == 0.0:
            return failed(0, "", task.start, 2, "lost")
        if task.quota is None:
            return found_of(task)
        value = float(task.start[0])
        return at(first, task.quota, value, value)

    rounds, solved = raced([tasks_of(4)], [], answer)
    assert [found.status.value for _, found in solved] == ["failed", *["converged"] * 3]
    assert [task.begun.dropped for task in rounds[-1] if task.begun] == [False, False, True]


def test_what_an_earlier_process_has_decided_is_not_decided_again(first: State) -> None:
    """It ended one start, and was stopped: the other that was to go on lags by far behind none that is left."""
    states = {1.0: replace(first, iteration=QUOTAS[1], best_objective=1.0), 2.0: replace(first, iteration=QUOTAS[1])}
    states[2.0] = replace(states[2.0], best_objective=50.0, best_alpha=np.full_like(first.alpha, 0.5))

    def answer(task: Task):
        return found_of(task) if task.quota is None or task.start[0] == 0.0 else states[float(task.start[0])]

    rounds, _ = raced([tasks_of(3)], [], answer)
    assert [task.begun.dropped for task in rounds[-1] if task.begun] == [False, False]


def test_who_goes_on_depends_on_all_rivals_and_so_do_keys() -> None:
    three, four = tasks_of(3), tasks_of(4)
    assert three[0].key("c") != four[0].key("c")
    assert in_contest(tasks_of(1))[0].contest == ""
    task = four[0]
    assert replace(task, quota=20).key("c") == task.key("c")
    assert len({replace(task, **change).key("c") for change in ({}, {"softened": True}, {"iterate": 3})}) == 3


def test_ends_and_gaps_begin_from_the_families_of_a_run() -> None:
    drawn: list[tuple[int, Family, float]] = []

    def draw(number: int, family: Family, best):
        drawn.append((number, family, float("nan") if best is None else float(best[0])))
        return None if family in (Family.STATED, Family.SOFTENED) else np.array([0.1 * (len(drawn) % 9)])

    starts = Starts(np.array([0.5]), 6, draw)
    weights = weights_of_first([0.0, 0.5, 1.0])
    request = Request(weights, "weighted_sum", 2.0, True, np.ones(2), starts, 10)
    solve = solver(convex, np.linspace(0.0, 1.0, 401)[:, None])
    asked: list[Task] = []

    def noted(task: Task):
        asked.append(task)
        return solve(task)

    front, _ = carried_out(request, noted)
    families = [family_of(index, 6) for index in range(6)]
    early, late = families[1:4], families[4:]
    assert [begins_at_best(family) for family in families] == [False] * 4 + [True] * 2
    assert [family for _, family, _ in drawn] == [*early, *early, *late, *late, *early, *late]
    # at the best of each objective, when that is known; at a point between at the best there, other designs than there
    assert [(number, best) for number, _, best in drawn[6:10]] == [(4, 0.0), (5, 0.0), (4, 1.0), (5, 1.0)]
    assert [number for number, _, _ in drawn[10:]] == [13, 14, 15, 16, 17]
    softened = [task.point for task in asked if task.softened and task.quota == QUOTAS[0]]
    assert softened == [-1, -2, 1]
    first = [task.point for task in asked[:2] if task.quota is None and task.start[0] == 0.5]
    assert first == [-1, -2]  # what one start would do is done all the same
    assert front.points[1].alpha[0] == pytest.approx(0.5, abs=3e-3)


def test_a_front_of_one_start_asks_for_nothing_more() -> None:
    planner = Planner(Request(spread(3), "nbi", 2.0, True, np.ones(2), Starts(np.zeros(1)), 10))
    tasks = next(planner.rounds())
    assert [(task.point, task.quota, task.contest) for task in tasks] == [(-1, None, ""), (-2, None, "")]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("starts") / "whole.h5"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(races, "QUOTAS", QUOTAS)
        run_front(read_case(CASE), Ask(spread(3), starts=STARTS), path=path, workers=1)
    return path


def test_starts_are_dropped_at_quotas_and_the_best_go_on(whole: Path) -> None:
    view = read_result(whole)
    dropped = [line for line in view.lines("pareto/tasks/reason") if line.startswith("dropped after")]
    assert dropped
    assert all(f"after {QUOTAS[0]} " in line or f"after {QUOTAS[1]} " in line for line in dropped)
    assert not any(line.startswith("dropped") for line in view.lines("pareto/reason"))
    assert "pareto/tasks/begun/0/key" not in view.texts


@pytest.mark.parametrize("asked", [3, 15, 28, 41, 54, 67, 80, 92])
def test_a_front_with_several_starts_ends_the_same_wherever_it_was_stopped(asked: int, whole: Path) -> None:
    case, ask, path = read_case(CASE), Ask(spread(3), starts=STARTS), Path("parts.h5")
    assert run_front(case, ask, path=path, workers=1, stop_requested=stop_after(asked)).status == "interrupted"
    run_front(case, ask, path=path, workers=1, stop_requested=stop_after(asked // 2), resume=True)
    run_front(case, ask, path=path, workers=1, resume=True)
    assert_same_files(whole, "parts.h5")


def test_workers_change_nothing_with_several_starts(whole: Path) -> None:
    run_front(read_case(CASE), Ask(spread(3), starts=STARTS), path=Path("two.h5"), workers=2, worth=0.0)
    assert_same_files(whole, "two.h5")


@pytest.mark.parametrize("asked", [40, 10_000])
def test_a_front_resumed_with_another_number_of_starts_ends_as_one_that_had_them(asked: int, whole: Path) -> None:
    case = read_case(CASE)
    run_front(case, Ask(spread(3), starts=2), path=Path("more.h5"), workers=1, stop_requested=stop_after(asked))
    run_front(case, Ask(spread(3), starts=STARTS), path=Path("more.h5"), workers=1, resume=True)
    assert_same_files(whole, "more.h5")


def test_more_starts_find_ends_that_are_no_worse() -> None:
    case = read_case(CASE)
    one, more = (run_front(case, Ask(spread(5), "nbi", starts), workers=1) for starts in (1, STARTS))
    assert one.quality is not None
    assert more.quality is not None
    for i in range(2):
        assert more.front.utopia[i] <= one.front.utopia[i] * (1.0 + 1e-9)
