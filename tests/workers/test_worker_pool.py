"""The worker pool: nothing is lost with a worker, nothing outlives the parent, nothing hangs."""

import io
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from mdstopo.compiler.threads import VARIABLE, cores
from mdstopo.store.checkpoint import Checkpointer
from mdstopo.workers import worker_pool
from mdstopo.workers.worker_pool import Lost, TooLong, WorkerError, WorkerPool
from mdstopo.workers.worker_program import ToParent, _told
from tests.workers.tasks_of_workers import open_broken, pool

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers find what they are to do."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT))


@pytest.mark.parametrize("workers", [1, 3])
def test_every_task_has_its_result(workers: int) -> None:
    with pool(workers) as some:
        assert sorted(some.results(7, lambda place: place)) == [(place, 10 * place) for place in range(7)]
        assert sorted(some.results(2, lambda place: place)) == [(0, 0), (1, 10)]


def test_processes_are_started_when_there_is_something_to_do_and_not_more() -> None:
    with pool(5) as some:
        assert list(some.results(0, lambda place: place)) == []
        assert some._workers == [None] * 5
        list(some.results(2, lambda place: place))
        assert sum(worker is not None for worker in some._workers) == 2


def test_a_pinned_task_goes_to_the_worker_that_had_it_before() -> None:
    with pool(2) as some:
        for _ in range(2):
            list(some.results(2, lambda place: place, pinned=True))
        assert sorted(some.results(2, lambda _: "done", pinned=True)) == [(0, [0, 0]), (1, [1, 1])]


def test_the_task_of_a_worker_that_is_killed_is_done_again_and_the_worker_named(tmp_path: Path) -> None:
    told: list[str] = []
    with pool(2, notify=told.append) as some:
        pids = {pid for _, pid in some.results(2, lambda _: "pid", pinned=True)}
        tasks: list[Any] = [("die", str(tmp_path / "died")), 4]
        assert sorted(some.results(2, tasks.__getitem__, pinned=True)) == [(0, "done by another one"), (1, 40)]
    (words,) = told
    assert words.endswith("ended unexpectedly: another one does its task")
    assert any(f"(pid {pid})" in words for pid in pids)


def test_what_is_asked_of_the_next_worker_may_depend_on_what_was_kept(tmp_path: Path) -> None:
    state = {"from": "the beginning"}

    def task(_: int) -> tuple[str, str]:
        asked.append(dict(state))
        return "die", str(tmp_path / "died")

    asked: list[dict[str, str]] = []
    with pool(1) as some:
        list(some.results(1, task, keep=lambda place, kept: state.update({"from": kept})))
    assert asked[0] == {"from": "the beginning"}
    assert len(asked) == 2


@pytest.mark.parametrize("attempts", [1, 2])
def test_a_task_that_no_worker_survives_is_lost_and_the_others_are_not(attempts: int) -> None:
    tasks: list[Any] = [("always die", 3), 1, 2]
    with pool(1, attempts=attempts) as some:
        results = dict(some.results(3, tasks.__getitem__))
    lost = results.pop(0)
    assert isinstance(lost, Lost)
    assert lost.status == 3
    assert lost.reason.startswith("a worker process (pid ")
    assert results == {1: 10, 2: 20}


def test_a_task_that_takes_too_long_is_ended_and_the_next_one_done() -> None:
    began = time.perf_counter()
    with pool(1) as some:
        list(some.results(1, lambda _: 1))
        ((_, first),) = some.results(1, lambda _: "sleep", limit=0.3)
        ((_, second),) = some.results(1, lambda _: 2, limit=30.0)
    assert isinstance(first, TooLong)
    assert first.seconds >= 0.3
    assert second == 20
    assert time.perf_counter() - began < 40.0


def test_tasks_that_are_asked_to_stop_say_how_far_they_have_come() -> None:
    kept: list[Any] = []
    began = threading.Event()

    def keep(place: int, state: Any) -> None:
        kept.append((place, state))
        began.set()

    with pool(2) as some:
        results = list(some.results(5, lambda _: "until stopped", keep=keep, stop=began.is_set))
    assert results == []
    assert {state for _, state in kept} == {"on the way"}


def test_nothing_begins_where_it_is_to_stop_from_the_beginning() -> None:
    with pool(2) as some:
        assert list(some.results(3, lambda place: place, stop=lambda: True)) == []
        assert some._workers == [None, None]


def test_what_a_task_raises_is_raised_with_where_it_was() -> None:
    with pool(1) as some, pytest.raises(ValueError, match="no such number") as raised:
        list(some.results(1, lambda _: "raise"))
    assert "in perform" in raised.value.__notes__[0]
    with pool(1) as some, pytest.raises(WorkerError, match="LocalError in a worker process: cannot be sent"):
        list(some.results(1, lambda _: "local"))
    with WorkerPool(open_broken, None, 1) as some, pytest.raises(RuntimeError, match="cannot get ready"):
        list(some.results(1, lambda _: 1))


def test_a_round_that_nobody_waits_for_any_more_does_not_disturb_the_next() -> None:
    with pool(2) as some:
        some.results(2, lambda place: place)  # an error elsewhere: no result was taken
        assert sorted(some.results(2, lambda place: place + 5)) == [(0, 50), (1, 60)]


def test_what_a_task_prints_is_no_message() -> None:
    with pool(1) as some:
        assert list(some.results(1, lambda _: "print")) == [(0, "printed")]


@pytest.mark.parametrize(("workers", "sharing"), [(1, 0), (2, 0), (1, 64)])
def test_workers_share_the_cores_among_them(workers: int, sharing: int) -> None:
    with pool(workers, sharing=sharing) as some:
        ((_, found),) = some.results(1, lambda _: "threads")
    assert found == (str(max(1, cores() // (sharing or workers))),) * 2


def test_closing_ends_workers_in_the_middle_of_what_they_do() -> None:
    began = time.perf_counter()
    some = pool(2)
    results = some.results(2, lambda place: ("sleep", 1)[place])
    assert next(results) == (1, 10)
    processes = [worker._process for worker in some._workers if worker is not None]
    some.close()
    assert all(process.poll() is not None for process in processes)
    assert time.perf_counter() - began < 30.0


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks Linux for its processes")
@pytest.mark.parametrize("how", ["kill", "exit"])
def test_workers_end_with_their_parent_however_it_ends(how: str) -> None:
    code = """
        import sys
        from tests.workers.tasks_of_workers import pool
        some = pool(2)
        results = some.results(3, lambda place: ("pid", "sleep", "sleep")[place])
        print(next(results)[1], flush=True)
        print([worker.pid for worker in some._workers], flush=True)
        if sys.argv[1] == "exit":
            raise SystemExit(0)
        import time
        time.sleep(60)
    """
    parent = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), how], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert parent.stdout is not None
    parent.stdout.readline()
    pids = [int(word) for word in parent.stdout.readline().strip("[]\n").split(",")]
    assert len(pids) == 2
    if how == "kill":
        parent.kill()
    parent.communicate()
    until = time.monotonic() + 30
    while any(is_running(pid) for pid in pids) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(is_running(pid) for pid in pids)


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_workers_leave_signals_to_their_parent(number: signal.Signals) -> None:
    with pool(1) as some:
        ((_, pid),) = some.results(1, lambda _: "pid")
        os.kill(pid, number)
        assert list(some.results(1, lambda _: "pid")) == [(0, pid)]


def test_states_are_sent_now_and_then_and_not_of_the_task_before() -> None:
    output, now = io.BytesIO(), [0.0]
    parent = ToParent(output, threading.Event(), lambda save: Checkpointer(save, clock=lambda: now[0]))
    for task in ("first", "second"):
        parent.begin()
        parent.flush()
        for _ in range(10):
            now[0] += 0.1
            parent.keep(lambda task=task: task)  # type: ignore[misc]
    output.seek(0)
    messages = []
    while output.tell() < len(output.getvalue()):
        messages.append(pickle.load(output))
    told = [task for kind, task in messages if kind == "kept"]
    assert told == sorted(told)
    assert 1 <= told.count("first") <= 3
    assert 1 <= told.count("second") <= 3


def test_an_exception_that_cannot_be_sent_is_told_in_words() -> None:
    kept = _told(KeyError("a"))
    assert isinstance(kept, KeyError)
    assert isinstance(_told(type("LocalError", (Exception,), {})("why")), WorkerError)


def test_the_pool_asks_for_no_more_than_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment of a worker is this one's, with the number of threads."""
    seen: dict[str, Any] = {}

    class AskedError(Exception):
        pass

    def popen(words: list[str], env: dict[str, str], **rest: Any) -> None:
        seen.update(env=env, words=words)
        raise AskedError

    monkeypatch.setattr(worker_pool.subprocess, "Popen", popen)
    with pytest.raises(AskedError):
        pool(2).results(1, lambda place: place)
    assert seen["words"][-1] == "mdstopo.workers.worker_program"
    assert {key: value for key, value in seen["env"].items() if key not in (VARIABLE, "NUMBA_NUM_THREADS")} == {
        key: value for key, value in os.environ.items() if key not in (VARIABLE, "NUMBA_NUM_THREADS")
    }
