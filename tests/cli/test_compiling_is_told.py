"""Every command says that it compiles, once and then now and then, and nothing where it is quiet."""

import pytest

from mdstopo.cli import output as outputs
from mdstopo.cli.output import Output
from mdstopo.compiler import told


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
