"""What is said, where, and how often."""

import json
import math
from typing import Any

import numpy as np
import pytest

from mdstopo.cli.interrupt import Interrupts
from mdstopo.cli.output import Output, aligned, duration
from mdstopo.cli.progress import Live, Plain, Silent, display, line
from mdstopo.cli.show import condensed
from mdstopo.session.outcome import Progress
from mdstopo.store.json_values import json_value


def progress(iteration: int = 3, **changes: Any) -> Progress:
    values = {
        "start": 0, "starts": 1, "iteration": iteration, "max_iterations": 10, "objective": 7.5, "best": 7.25,
        "violation": 1e-3, "change": 0.2, "evaluations": iteration + 1,
    }  # fmt: skip
    return Progress(**(values | changes))


def test_json_is_alone_on_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(json=True)
    output.say("for people")
    output.table([["a", "b"]])
    output.notice("a notice")
    output.document({"x": np.array([1.0, np.nan]), "n": np.int64(3), "status": "done", "worst": math.inf})
    said = capsys.readouterr()
    assert json.loads(said.out) == {"x": [1.0, None], "n": 3, "status": "done", "worst": None}
    assert said.err == "a notice\n"


def test_quiet_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    output = Output(quiet=True)
    output.say("for people")
    output.notice("a notice")
    output.document({"x": 1})
    said = capsys.readouterr()
    assert (said.out, said.err) == ("", "")


def test_numbers_of_every_kind_become_plain() -> None:
    found = json_value({"a": (1, np.float64(2.5)), "b": [np.bool_(True), None], 3: np.zeros((1, 2))})
    assert found == {"a": [1, 2.5], "b": [True, None], "3": [[0.0, 0.0]]}


def test_columns_are_aligned_numbers_to_the_right() -> None:
    assert aligned([["name", "mass"], ["a", "1.5"], ["long", "10"]], "") == [
        "name  mass",
        "a      1.5",
        "long    10",
    ]


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.0123, "12.3 ms"), (3.21, "3.21 s"), (200.0, "3 min 20 s"), (7500.0, "2 h 5 min"), (math.inf, "?")],
)
def test_times_are_said_as_people_say_them(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_plain_progress_is_a_line_every_few_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    now = [0.0]
    show = Plain(lambda: now[0])
    for iteration in range(100):
        now[0] += 0.1
        show(progress(iteration))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "objective 7.5, best 7.25, constraint 0.001, change 0.2, 10/s" in lines[0]


def test_progress_is_live_only_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(display(quiet=True), Silent)
    assert isinstance(display(quiet=False), Plain)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert isinstance(display(quiet=False), Live)


def test_live_progress_shows_everything_that_plain_progress_does(capsys: pytest.CaptureFixture[str]) -> None:
    from rich.console import Console

    with Live() as live:
        picture = live._picture(progress(start=1, starts=3))
    console = Console(width=200)
    with console.capture() as capture:
        console.print(picture)
    for word in ("2/3", "3/10", "7.5", "7.25", "0.001", "0.2"):
        assert word in capture.get(), word


def test_several_starts_are_counted() -> None:
    assert line(progress(start=1, starts=8)).startswith("start 2/8, iteration 3/10")
    assert line(progress()).startswith("iteration 3/10")


def test_progress_says_that_an_iterate_has_no_value() -> None:
    assert "objective none (failed), best" in line(progress(objective=float("nan")))
    assert "nan" not in line(progress(objective=float("nan")))


def test_progress_says_why_an_iterate_has_no_value() -> None:
    said = line(progress(objective=float("nan"), failure="the step became too small (belts[3])"))
    assert "objective none (failed): the step became too small (belts[3]), best" in said


def test_a_condensed_history_has_both_ends_and_few_rows() -> None:
    for count in (1, 2, 11, 12, 13, 51, 1000):
        rows = condensed(count)
        assert rows[0] == 0
        assert rows[-1] == count - 1
        assert len(rows) <= 12
        assert rows == sorted(set(rows))


def test_signals_interrupt_at_once_until_iterations_begin() -> None:
    import os
    import signal

    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        interrupts = Interrupts(quiet=True)
        for number in kept:
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), number)
        interrupts = Interrupts(quiet=True)
        assert not interrupts.stop_requested()
        os.kill(os.getpid(), signal.SIGTERM)
        assert interrupts.stop_requested()
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        for number, handler in kept.items():
            signal.signal(number, handler)
