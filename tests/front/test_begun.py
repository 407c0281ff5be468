"""What a front, or the individual optima of a run, has reached within a solve is kept, and gone on from."""

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.front.pool import Processes
from mdstopo.front.run_front import Ask, run_front
from mdstopo.optimizer.scalarisation import Scalarisation
from mdstopo.optimizer.state import State
from mdstopo.plan import solve_task as tasks
from mdstopo.session.run_session import run_session
from mdstopo.store.result_reader import read_result
from tests.front.support import CASE
from tests.result_files import assert_same_files, stop_after


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def starts(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many designs had been evaluated where each solve of this process began."""
    found: list[int] = []
    run = tasks.run

    def noted(optimizer: Any, state: State, **more: Any) -> State:
        found.append(int(state.evaluations))
        return run(optimizer, state, **more)

    monkeypatch.setattr(tasks, "run", noted)
    return found


def spread(count: int) -> np.ndarray:
    share = np.linspace(0.0, 1.0, count)
    return np.stack([share, 1.0 - share], axis=1)


def test_a_front_that_is_stopped_within_a_solve_goes_on_within_it(starts: list[int]) -> None:
    case, ask = read_case(CASE), Ask(spread(3))
    run_front(case, ask, path=Path("whole.h5"), workers=1)
    first = run_front(case, ask, path=Path("parts.h5"), workers=1, stop_requested=stop_after(9))
    assert first.status == "interrupted"
    with h5py.File("parts.h5") as file:
        assert list(file["pareto/tasks/begun"]) == ["0"]
    starts.clear()
    run_front(case, ask, path=Path("parts.h5"), resume=True, workers=1)
    assert starts[0] > 2
    assert set(starts[1:]) == {1}
    assert_same_files("whole.h5", "parts.h5")


def test_individual_optima_of_a_run_go_on_within_a_solve(starts: list[int]) -> None:
    case = read_case(CASE)
    run_session(case, path="whole.h5")
    with pytest.raises(KeyboardInterrupt):
        run_session(case, path="parts.h5", stop_requested=stop_after(9))
    starts.clear()
    run_session(case, path="parts.h5", resume=True)
    assert starts[0] > 2
    assert_same_files("whole.h5", "parts.h5")


def test_a_front_that_is_killed_in_its_first_solve_has_saved_what_it_had() -> None:
    """A solve of many seconds: something is there after the first of them, and goes on."""
    slow = CASE.replace("max_iterations: 40", "max_iterations: 4000, tolerance: 0").replace("end: 0.2", "end: 3")
    Path("slow.yaml").write_text(slow)
    command = [sys.executable, "-m", "mdstopo", "pareto", "slow.yaml", "--points", "2", "--quiet", "--workers", "1"]
    process = subprocess.Popen([*command, "--out", "slow.h5"])
    end = time.monotonic() + 120
    while not Path("slow.h5").exists() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    process.kill()
    process.wait()
    view = read_result("slow.h5")
    assert view.lines("pareto/tasks/key") == ()
    assert view.array("pareto/tasks/begun/0/evaluations") >= 1


def reached() -> State:
    """A state of an optimiser."""
    found: list[State] = []
    case = read_case(CASE)
    run_front(case, Ask(spread(2)), path=Path("x.h5"), workers=1, stop_requested=stop_after(4))
    from mdstopo.plan.stored_tasks import read_begun

    found += read_begun(read_result("x.h5")).values()
    return found[0]


def test_a_piece_whose_worker_is_lost_goes_on_from_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    state, kept, asked = reached(), [], []

    class OneIsLost:
        """A pool in which the worker of the first piece is lost after it has said how far it is."""

        def results(self, count: int, task: Any, *, keep: Any, stop: Any) -> Iterator[tuple[int, Any]]:
            asked.extend([task(0), task(1)])
            keep(0, state.to_arrays())
            asked.append(task(0))
            yield from ((0, "first"), (1, "second"))

    pieces = [tasks.Task(point, Scalarisation("weighted_sum", np.ones(2)), np.ones(3), 5) for point in (0, 1)]
    pool = Processes(None, lambda: False, 1)  # type: ignore[arg-type]
    monkeypatch.setattr(pool, "_pool", OneIsLost())
    results = pool.results(pieces, lambda place, each: kept.append((place, each.evaluations)))
    assert list(results) == [(0, "first"), (1, "second")]
    assert kept == [(0, state.evaluations)]
    assert asked[:2] == pieces
    assert asked[2].begun is not None
    assert asked[2].begun.evaluations == state.evaluations


def test_where_a_task_was_left_does_not_change_its_key() -> None:
    state = reached()
    task = tasks.Task(0, Scalarisation("weighted_sum", np.ones(2)), np.ones(3), 5)
    assert replace(task, begun=state).key("k") == task.key("k")
