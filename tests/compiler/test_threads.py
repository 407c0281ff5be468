"""Threads of one pass: every piece done once whatever their number, errors that arrive, none left behind."""

import threading
from pathlib import Path

import numpy as np
import pytest

from mdstopo.cli.group import run_group
from mdstopo.compiler.jit import entry, kernel
from mdstopo.compiler.threads import MOST_THREADS, VARIABLE, ThreadsError, allowed, cores, shared, taken


@kernel
def _fill(counter, out, bad):
    i = taken(counter)
    while i < out.shape[0]:
        if i == bad:
            raise ValueError("a bad piece")
        for _ in range(200):
            out[i] += 1.0
        i = taken(counter)


@entry
def fill(out, count, bad):
    """Pieces done, and how often one was asked for."""
    counter = np.zeros(1, np.int64)
    shared(_fill, count, (counter, out, bad))
    return counter[0]


def _system_threads():
    return len(list(Path("/proc/self/task").iterdir()))


@pytest.mark.parametrize("count", [1, 2, 3, MOST_THREADS, MOST_THREADS + 5])
def test_every_piece_is_done_once_and_all_threads_have_ended(count):
    fill(np.zeros(1), 1, -1)  # compiled
    before = _system_threads() if Path("/proc/self/task").exists() else threading.active_count()
    out = np.zeros(1000)
    asked = fill(out, count, -1)
    assert np.all(out == 200.0)
    # each thread finds out once that nothing is left
    assert asked == len(out) + min(count, MOST_THREADS)
    after = _system_threads() if Path("/proc/self/task").exists() else threading.active_count()
    assert after == before


@pytest.mark.parametrize("count", [1, 2, 3])
def test_an_error_in_any_thread_arrives_after_all_have_ended(count):
    with pytest.raises((ValueError, RuntimeError), match=r"a bad piece|a thread of a pass over the members failed"):
        fill(np.zeros(64), count, 40)
    out = np.zeros(64)
    fill(out, count, -1)
    assert np.all(out == 200.0)


def test_a_piece_is_taken_once_in_python_too():
    counter = np.zeros(1, np.int64)
    assert [taken(counter) for _ in range(3)] == [0, 1, 2]


def test_the_environment_says_how_many(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    assert allowed() == min(cores(), MOST_THREADS)
    monkeypatch.setenv(VARIABLE, "3")
    assert allowed() == 3
    for wrong in ("0", "-1", "two", "1.5", str(MOST_THREADS + 1)):
        monkeypatch.setenv(VARIABLE, wrong)
        with pytest.raises(ThreadsError, match="not a number of threads from 1 to"):
            allowed()


def test_a_wrong_number_of_threads_is_a_users_mistake(monkeypatch, capsys):
    monkeypatch.setenv(VARIABLE, "many")
    case = Path(__file__).parents[2] / "cases" / "fig6.yaml"
    assert run_group(["simulate", str(case)]) == 2
    error = capsys.readouterr().err
    assert f"{VARIABLE} is 'many'" in error
    assert "Traceback" not in error
