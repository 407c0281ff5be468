"""The commands on a small case with the real engine."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from mdstopo.cli.group import run_group
from mdstopo.cli.interrupt import Interrupts
from mdstopo.store import atomic, checkpoint
from tests.commands import call

CASE = """\
format: 1
title: Probe
gravity: [0, -9.8]
time: {end: 0.1}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0]}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 4}}}
  frame: {body: vehicle, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 3}}}
members:
  belts: {from: edge, to: frame, law: {type: spring, stiffness: 20000}}
loads:
  - {body: vehicle, acceleration: [9.8, 0], angular_acceleration: 20}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, equals: 1.2}
optimizer: {max_iterations: 6, move_limit: 0.01, tolerance: 0}
"""
OBJECTIVES = """\
objectives:
  G: {response: energy}
  slide: {response: {displacement: {body: torso, relative_to: vehicle}}, over_time: max_abs}
combine: {weights: {G: 1, slide: 1}}"""
ENDLESS = ["optimizer.max_iterations=100000", "optimizer.tolerance=0", "optimizer.move_limit=1e-5"]
ENDLESS += ["optimizer.decrease_tolerance=0"]


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder with the case in it; handlers of signals are put back."""
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(CASE)
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict[str, Any]:
    """The JSON object that a command prints, and nothing else."""
    status, out, _ = call(capsys, *words, "--json", "--quiet")
    assert status == 0
    assert out.count("\n") == 1
    found = json.loads(out)
    assert isinstance(found, dict)
    return found


def test_run_says_what_it_reached_and_writes_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call(capsys, "run", "probe.yaml")
    assert status == 0
    for word in (
        "Probe: max iterations",
        "7 evaluations",
        "volume of belts",
        "integrator",
        "results/probe.h5",
    ):
        assert word in out, word
    assert "Traceback" not in err
    with h5py.File("results/probe.h5", "r") as file:
        assert file.attrs["status"] == "max_iterations"
        assert file["iterations/objectives"].shape == (7, 1)
        assert file["trajectories/default/q"].shape[1] == 6
        assert file["trajectories/default/t"][[0, -1]].tolist() == [0.0, 0.1]
        assert file["sensitivities/G"].shape == file["design/alpha"].shape == (12,)
    assert os.listdir("results") == ["probe.h5"]


@pytest.mark.parametrize(("over_time", "lines"), [("mean", 0), ("integral", 0), ("final", 1), ("max", 1)])
def test_run_says_when_only_of_what_has_a_time(over_time: str, lines: int, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "run", "probe.yaml", "--set", f"objectives.G.over_time={over_time}")
    assert status == 0
    assert "nan" not in out
    said = [line.split() for line in out.splitlines() if line.startswith("    peak")]
    assert len(said) >= lines
    assert bool(said) == bool(lines)
    assert all(words[2] == "at" and 0.0 <= float(words[3]) <= 0.1 for words in said)


def test_run_for_machines_and_in_silence(capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "run", "probe.yaml")
    assert found["status"] == "max_iterations"
    assert found["evaluations"] == 7
    assert found["objectives"]["G"] < found["initial_objectives"]["G"]
    assert found["peaks"]["G"][0]["value"] == pytest.approx(found["objectives"]["G"], rel=1e-12)
    assert found["resume"] is None
    status, out, err = call(capsys, "run", "probe.yaml", "--quiet", "--out", "b.h5")
    assert (status, out, err) == (0, "", "")


def test_a_run_computes_nothing_with_code_that_its_process_has_just_compiled(
    capsys: pytest.CaptureFixture[str],
) -> None:
    # Such code may differ in the last bits from the same kernels out of the cache, and with it a resumed run.
    script = (
        "import sys\n"
        "from numba.core import event\n"
        "recorder = event.RecordingListener()\n"
        "event.register('numba:compile', recorder)\n"
        "from mdstopo.cli.group import run_group\n"
        "assert run_group(['run', 'probe.yaml', '--quiet']) == 0\n"
        "sys.exit(len(recorder.buffer))\n"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_a_finished_file_is_replaced_with_a_notice_and_an_unfinished_one_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    call(capsys, "run", "probe.yaml")
    status, _, err = call(capsys, "run", "probe.yaml")
    assert status == 0
    assert "is replaced" in err
    with h5py.File("results/probe.h5", "r+") as file:
        file.attrs["status"] = "interrupted"
    status, out, err = call(capsys, "run", "probe.yaml")
    assert (status, out) == (2, "")
    assert "--resume continues it" in err
    assert call(capsys, "run", "probe.yaml", "--overwrite")[0] == 0


def test_more_iterations_resumed_equal_a_straight_run(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "run", "probe.yaml", "--set", "optimizer.max_iterations=3")
    call(capsys, "run", "probe.yaml", "--resume")
    call(capsys, "run", "probe.yaml", "--out", "straight.h5")
    with h5py.File("results/probe.h5", "r") as one, h5py.File("straight.h5", "r") as other:
        for name in ("design/alpha", "iterations/objectives", "trajectories/default/q", "sensitivities/G"):
            assert one[name][()].tobytes() == other[name][()].tobytes(), name
    status, _, err = call(capsys, "run", "probe.yaml", "--resume", "--set", "members.belts.law.stiffness=7")
    assert status == 2
    assert "differs in members.belts.law.stiffness" in err


def test_a_design_goes_in_and_out_through_files(capsys: pytest.CaptureFixture[str]) -> None:
    np.save("a.npy", np.full(12, 0.1))
    found = answer(capsys, "run", "probe.yaml", "--alpha", "a.npy")
    assert found["iterations"] == 6
    simulated = answer(capsys, "simulate", "probe.yaml", "--alpha", "results/probe.h5")
    assert simulated["path"] == "results/probe.simulate.h5"
    with h5py.File("results/probe.h5", "r") as run, h5py.File("results/probe.simulate.h5", "r") as simulate:
        assert run["trajectories/default/q"][()].tobytes() == simulate["trajectories/default/q"][()].tobytes()
    np.save("short.npy", np.ones(3))
    status, _, err = call(capsys, "simulate", "probe.yaml", "--alpha", "short.npy")
    assert status == 2
    assert "holds 3 values; the case has 12" in err


def test_check_says_what_is_in_the_case(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "check", "probe.yaml")
    assert status == 0
    for word in (
        "2 bodies",
        "load case default: 6 degrees of freedom",
        "12 members",
        "2060 kg",
        "omega t1",
        "integrator",
        "left out",
    ):
        assert word in out, word
    found = answer(capsys, "check", "probe.yaml")
    assert found["design_variables"] == 12
    assert len(found["frequencies"][0]["initial"]) == 3
    assert not Path("results").exists()


def test_check_describes_what_cannot_be_computed_and_refuses_it(capsys: pytest.CaptureFixture[str]) -> None:
    joints = "joints:\n  - {type: revolute, bodies: [torso, ground], at: [0, 0]}\n"
    Path("joint.yaml").write_text(CASE + joints + "solver: {integrator: gauss}\n")
    status, out, err = call(capsys, "check", "joint.yaml")
    assert status == 2
    assert "2 bodies" in out
    assert err.startswith("joint.yaml:")
    assert "gauss does not compute joints; runge_kutta does" in err


def test_simulate_says_where_the_bodies_end(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "simulate", "probe.yaml")
    assert status == 0
    assert "load case default" in out
    assert "torso" in out
    status, _, err = call(capsys, "simulate", "probe.yaml", "--load-case", "other")
    assert status == 2
    assert "there are default" in err


def test_gradient_compares_with_differences(capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "gradient", "probe.yaml", "--method", "adjoint", "--differences", "--members", "4")
    method = found["methods"]["adjoint"]
    assert method["differences"]["G"] < 1e-6
    assert method["seconds"] > 0.0
    with h5py.File("results/probe.gradient.h5", "r") as file:
        assert file["sensitivities/adjoint/G"].shape == (12,)
        assert file["differences/G"].shape == (4,)


def test_gradient_estimates_its_errors_when_asked(capsys: pytest.CaptureFixture[str]) -> None:
    words = ("gradient", "probe.yaml", "--error-estimate", "--set", "solver.tolerance=1e-5")
    errors = answer(capsys, *words)["methods"]["direct"]["errors"]["G"]
    assert 0.0 < errors["value"] < 1e-4
    assert 0.0 < errors["gradient"] < 1e-4
    _, out, _ = call(capsys, *words)
    assert "error of value" in out.splitlines()[1]


def test_gradient_stores_histories_of_the_direct_method(capsys: pytest.CaptureFixture[str]) -> None:
    found = answer(capsys, "gradient", "probe.yaml", "--history")
    assert list(found["methods"]) == ["adjoint", "direct"]
    assert found["methods"]["direct"]["disagreement"]["G"] < 1e-9
    with h5py.File("results/probe.gradient.h5", "r") as file:
        t = file["trajectories/default/t"][()]
        history = file["sensitivities/direct/history/G"][()]
        assert history.shape == (len(t), 12)
        # at the start nothing is strained, but for the rounding of lengths
        assert abs(history[0]).max() < 1e-20 * abs(history).max()
    status, _, err = call(capsys, "gradient", "probe.yaml", "--method", "adjoint", "--history")
    assert status == 2
    assert "--history needs --method direct" in err


def test_a_method_that_does_not_go_with_the_integrator_is_a_mistake(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ("gradient", "probe.yaml", "--method", "iterative", "--set", "solver.integrator=gauss")
    status, _, err = call(capsys, *words)
    assert status == 2
    assert err.startswith("--set solver.integrator: solver.integrator: the iterative method")


def test_show_says_what_a_file_holds(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "run", "probe.yaml")
    status, out, _ = call(capsys, "show", "results/probe.h5", "--members", "3")
    assert status == 0
    for word in (
        "max iterations",
        "6 iterations, 7 evaluations",
        "the 3 largest of 12",
        "belts",
        "numpy",
        "seed",
    ):
        assert word in out, word
    found = answer(capsys, "show", "results/probe.h5")
    assert len(found["objectives"]["G"]) == 7
    assert found["datasets"]["design/alpha"] == [12]


def test_show_tells_by_how_much_iterates_break_their_constraints(capsys: pytest.CaptureFixture[str]) -> None:
    """More than an `at_least` asks for breaks nothing, and less than it does."""
    volumes = "{volume: all, at_least: 0.5}, {volume: all, limit: 3}"
    moved = "{response: {displacement: {body: torso, relative_to: vehicle}}, at_least: 1}"
    for more in ("", f", {moved}"):
        call(
            capsys, "run", "probe.yaml", "--set", f"constraints=[{volumes}{more}]", "--out", "bounded.h5", "--overwrite"
        )
        with h5py.File("bounded.h5") as file:
            excess = file["iterations/constraints"][0]
        assert excess[0] > 0.1
        _, out, _ = call(capsys, "show", "bounded.h5")
        header, first = (line.split() for line in out.splitlines()[3:5])
        assert header[2] == "violation"
        assert float(first[2]) == pytest.approx(-excess[2] if more else 0.0, rel=0.01)


def test_a_full_disk_is_a_sentence_and_status_1(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic.os, "fsync", full)
    for name in ("run", "simulate"):
        status, _, err = call(capsys, name, "probe.yaml")
        assert status == 1
        assert err.strip().endswith("No space left on device")


def test_a_place_that_cannot_be_written_is_refused_before_anything_runs(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("run", "simulate", "gradient"):
        status, out, err = call(capsys, name, "probe.yaml", "--out", "probe.yaml/x.h5")
        assert (status, out) == (2, "")
        assert "cannot be made" in err
        status, _, err = call(capsys, name, "probe.yaml", "--out", "probe.yaml", "--overwrite")
        assert status == 2
        assert "this is the case file" in err
    assert Path("probe.yaml").read_text() == CASE


def begin(*words: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-m", "mdstopo", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def wait_for_checkpoint(process: "subprocess.Popen[str]", path: Path) -> None:
    while not path.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


def test_an_interrupted_run_is_status_3_and_its_command_resumes_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sets = [word for pair in ENDLESS for word in ("--set", pair)]
    process = begin("run", "probe.yaml", "--out", "my file.h5", *sets)
    wait_for_checkpoint(process, Path("my file.h5"))
    status, _, err = call(capsys, "run", "probe.yaml", "--out", "my file.h5", *sets)
    assert status == 2
    assert f"is in use by process {process.pid}" in err
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate()
    assert process.returncode == 3
    assert "Probe: interrupted" in out
    command = shlex.split(err.strip().splitlines()[-1].removeprefix("interrupted; to go on: "))
    with h5py.File("my file.h5", "r") as file:
        reached = len(file["iterations/combined"]) - 1
        assert file.attrs["status"] == "interrupted"
    status, out, _ = call(capsys, *command[1:], "--set", f"optimizer.max_iterations={reached + 5}")
    assert status == 0
    with h5py.File("my file.h5", "r") as file:
        assert len(file["iterations/combined"]) - 1 == reached + 5


class _Presses:
    """Ctrl-C, `times` times, at the first question whether to stop after something has been saved in a file."""

    def __init__(self, path: str, times: int) -> None:
        self.path, self.times = Path(path), times

    def asks(self, interrupts: Interrupts) -> bool:
        while self.times and self.path.exists():
            self.times -= 1
            signal.raise_signal(signal.SIGINT)
        return asks(interrupts)


asks = Interrupts.stop_requested
MANY = CASE.replace("objectives:\n  G: {response: energy}", OBJECTIVES).replace("tolerance: 0", "tolerance: 1e-9")


@pytest.mark.parametrize("words", [("run",), ("pareto", "--points", "3", "--workers", "1")], ids=lambda words: words[0])
@pytest.mark.parametrize("presses", [1, 2])
def test_interrupted_individual_optima_tell_the_command_that_goes_on(
    words: tuple[str, ...], presses: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("many.yaml").write_text(MANY)
    for limit in ("INTERVAL", "_COST_FACTOR"):  # each optimum is saved at once
        monkeypatch.setattr(checkpoint, limit, 0.0)
    control = _Presses("m.h5", presses)
    monkeypatch.setattr(Interrupts, "stop_requested", lambda self: control.asks(self))
    # commands read their own line from the process's
    line = [words[0], "many.yaml", "--out", "m.h5", *words[1:]]
    monkeypatch.setattr(sys, "argv", ["mdstopo", *line])
    assert run_group([*line, "--json"]) == 3
    said = capsys.readouterr()
    document, last = json.loads(said.out), said.err.strip().splitlines()[-1]
    assert last.startswith("interrupted; to go on: mdstopo")
    again = shlex.split(last.removeprefix("interrupted; to go on: "))
    assert document["status"] == "interrupted"
    assert shlex.split(document["resume"]) == again
    monkeypatch.setattr(Interrupts, "stop_requested", asks)
    assert "--resume" in again
    assert call(capsys, *(word for word in again[1:] if word != "--json"))[0] == 0
    assert call(capsys, *line[:3], "whole.h5", *line[4:])[0] == 0
    name = "design/alpha" if words[0] == "run" else "pareto/alpha"
    with h5py.File("m.h5", "r") as one, h5py.File("whole.h5", "r") as other:
        assert np.array_equal(one[name][()], other[name][()])


def test_what_saved_nothing_is_interrupted_without_a_command(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call(capsys, "run", "probe.yaml", "--out", "a.h5")[0] == 0

    def press(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("mdstopo.session.run_session.run_session", press)
    for words in (["--out", "a.h5", "--overwrite"], ["--out", "b.h5"]):
        with pytest.raises(KeyboardInterrupt):
            run_group(["run", "probe.yaml", *words])


def test_workers_end_when_their_parent_is_killed() -> None:
    sets = [word for pair in ENDLESS for word in ("--set", pair)]
    process = begin("run", "probe.yaml", "--starts", "2", "--workers", "2", *sets)
    wait_for_checkpoint(process, Path("results/probe.h5"))
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    if not children.exists():
        pytest.skip("the children of a process cannot be listed here")
    workers = [int(word) for word in children.read_text().split()]
    process.kill()
    process.communicate()
    assert len(workers) == 2
    deadline = time.monotonic() + 10.0
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_where_no_member_is_present_the_largest_alpha_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    less = ["--set", "constraints[0].equals=0.6", "--set", "optimizer.max_iterations=0", "--set", "design.initial=0.05"]
    assert run_group(["run", "probe.yaml", *less]) == 0
    assert "0 present, 0 grey, 12 absent of 12; the largest alpha is 0.05\n" in capsys.readouterr().out
    assert (
        run_group(["run", "probe.yaml", *less, "--set", "design.initial=0.4", "--set", "constraints[0].equals=4.8"])
        == 0
    )
    assert "0 present, 12 grey, 0 absent of 12\n" in capsys.readouterr().out
