"""Every command says that it compiles, once and then now and then, and nothing where it is quiet."""

import pytest

from mdstopo import warm
from mdstopo.case.reader import read_case
from mdstopo.cli import output as outputs
from mdstopo.cli.check import _say_what_stays_open
from mdstopo.cli.output import Output
from mdstopo.compiler import told

BODY = "{format: 1, time: {end: 1}, bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}"
GOAL = ", objectives: {G: {response: energy}}"


@pytest.fixture
def times(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(outputs.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(told, "listeners", outputs.listeners)
    return now


def test_the_first_kernel_is_told_and_then_one_in_ten_seconds(
    times: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    Output()
    for second in (0.0, 3.0, 12.0, 13.0, 30.0):
        times[0] = second
        told.compiling(f"general.step.k{second:.0f}")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split()[0] for line in lines] == ["compiling", "still", "still"]
    assert "general.step.k0" in lines[0]
    assert "general.step.k12 is number 3, after 12 s" in lines[1]


def test_what_was_announced_is_not_told_twice_and_quiet_is_quiet(
    times: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    Output().announce("compiling the kernels")
    told.compiling("a")
    assert capsys.readouterr().err == "compiling the kernels\n"
    outputs.listeners.clear()
    Output(quiet=True)
    told.compiling("a")
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("due", "goals", "said"), [(True, GOAL, True), (False, GOAL, False), (True, "", False)])
def test_check_says_before_it_compiles_that_it_will_not_know_the_cost(
    due: bool, goals: str, said: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(warm, "compilation_due", lambda case: due)
    _say_what_stays_open(Output(), read_case(f"{BODY}{goals}}}"))
    told_before = capsys.readouterr().err
    assert told_before.startswith("what one evaluation costs will not be known: ") is said
    assert ("the first `gradient` or `run` compiles them" in told_before) is said
