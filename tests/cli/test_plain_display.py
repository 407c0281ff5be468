"""What is told on a log of work that takes long."""

import time
from collections.abc import Callable

import pytest

from mdstopo.cli import display


class Words(display.Plain[str]):
    """A display that says what it is told."""

    def _words(self, progress: str) -> str:
        return progress


def wait_until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 20.0
    while not holds() and time.monotonic() < end:
        time.sleep(0.002)
    assert holds()


def test_silence_is_broken_while_work_goes_on_and_not_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    said = list[str]()
    monkeypatch.setattr(display, "write", lambda _, text: said.append(text))
    with Words(silent=0.01):
        wait_until(lambda: len(said) > 1)
    assert all(line.startswith("at work for ") for line in said)
    count = len(said)
    time.sleep(0.05)
    assert len(said) <= count + 1  # the one that was about to be said
