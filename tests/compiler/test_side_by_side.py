"""Calls side by side on threads: what each has come to, in order, whatever happens to the others."""

from threading import Barrier, Event, current_thread

import pytest

from mdstopo.compiler.threads import side_by_side


def test_calls_run_at_the_same_time_and_outcomes_keep_their_order():
    together = Barrier(3, timeout=30)

    def meet(value):
        together.wait()  # broken unless all three wait at once
        return value, current_thread()

    outcomes = side_by_side([lambda k=k: meet(k) for k in range(3)], 3)
    values, threads = zip(*(outcome.result() for outcome in outcomes), strict=True)
    assert values == (0, 1, 2)
    assert len(set(threads)) == 3
    assert current_thread() in threads


def test_one_thread_does_all_calls_in_turn():
    outcomes = side_by_side([current_thread] * 3, 1)
    assert [outcome.result() for outcome in outcomes] == [current_thread()] * 3


def test_an_error_is_that_of_its_call_alone():
    def fail():
        raise ValueError("no such thing")

    first, second, third = side_by_side([lambda: 1, fail, lambda: 3], 2)
    assert (first.result(), third.result()) == (1, 3)
    with pytest.raises(ValueError, match="no such thing"):
        second.result()


def test_an_interrupt_goes_on_when_what_has_begun_is_over():
    begun, ended, never = Event(), Event(), Event()

    def long():
        begun.set()
        ended.wait(0.2)
        ended.set()

    def interrupted():
        assert begun.wait(30)
        raise KeyboardInterrupt

    def either():
        (interrupted if current_thread().name == "MainThread" else long)()

    with pytest.raises(KeyboardInterrupt):
        side_by_side([either, either, never.set], 2)
    assert ended.is_set()
    assert not never.is_set()
