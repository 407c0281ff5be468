"""`mdstopo fit`: what it writes, says and refuses, and how it goes on."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mdstopo.case.reader import load_case
from mdstopo.cli.group import run_group
from mdstopo.fit import run_fit as module
from mdstopo.fit.fit_record import content
from mdstopo.store.output_file import output_file
from mdstopo.store.result_reader import read_result

from .test_fits import stop_after

FALL = """\
format: 1
gravity: [0, -9]          # to be measured
time: {end: 1}
bodies:
  stone: {mass: 1, inertia: 1, position: [0, 0]}
fit:
  estimate:
    gravity[1]: {lower: -12, upper: -6}
    bodies.stone.velocity[1]: {lower: -3, upper: 3}
  measured:
    height:
      file: fall.csv
      time: t
      value: y
      response: {displacement: {body: stone, component: y}}
"""
#: of a stone thrown up at 2 m/s that falls at 9.81 m/s2, rounded to mm
ROWS = "t,y\n0.1,0.151\n0.2,0.204\n0.3,0.159\n0.4,0.015\n0.5,-0.226\n0.6,-0.566\n0.7,-1.003\n0.8,-1.539\n0.9,-2.173\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    text = FALL.replace("position: [0, 0]}", "position: [0, 0], velocity: [0, 1]}")
    (tmp_path / "fall.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "fall.csv").write_text(ROWS, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def result(path: Path) -> dict[str, Any]:
    return content(read_result(path))


def test_it_writes_result_case_and_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    assert run_group(["fit", "fall.yaml", "--plot", "fall.svg", "--profile", "2"]) == 0
    said = capsys.readouterr()
    found = result(folder / "results" / "fall.fit.h5")
    gravity, velocity = found["estimates"]
    assert found["status"] == "converged"
    assert gravity["low"] < -9.81 < gravity["high"]
    assert velocity["low"] < 2.0 < velocity["high"]
    assert velocity["derivative"] == "exact"
    # straight in both numbers, so that the profile is the interval
    assert gravity["profile"]["low"] == pytest.approx(gravity["low"], abs=1e-3 * gravity["deviation"])
    assert "gravity[1]" in said.out
    assert "correlation" in said.out
    fitted = load_case(folder / "results" / "fall.fitted.yaml")
    assert fitted.load_cases[0].gravity[1] == gravity["value"]
    assert "<svg" in (folder / "fall.svg").read_text(encoding="utf-8")


def test_a_result_is_replaced_and_a_fitted_case_that_was_changed_is_not(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place, case = folder / "results" / "fall.fit.h5", folder / "results" / "fall.fitted.yaml"
    assert run_group(["fit", "fall.yaml", "--quiet"]) == 0
    written = case.read_bytes()
    assert run_group(["fit", "fall.yaml"]) == 0
    assert "the finished result in" in capsys.readouterr().err
    before = place.read_bytes()
    case.write_bytes(written + b"# mine\n")
    assert run_group(["fit", "fall.yaml"]) == 2
    assert "is not as the fit in fall.fit.h5 has written it" in capsys.readouterr().err
    assert place.read_bytes() == before
    assert case.read_bytes() == written + b"# mine\n"
    assert run_group(["fit", "fall.yaml", "--overwrite", "--quiet"]) == 0
    assert case.read_bytes() == written


def test_json_is_one_object(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["fit", "fall.yaml", "--json", "--out", "there/own.h5"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["command"] == "fit"
    assert said["path"] == "there/own.h5"
    assert said["fitted_case"] == "there/own.fitted.yaml"  # another fit of the case has another one
    assert [each["name"] for each in said["estimates"]] == ["gravity[1]", "bodies.stone.velocity[1]"]


def test_a_fit_that_is_killed_goes_on_beside_the_fitted_case_of_the_one_before(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its checkpoints knew nothing of that case, and `--resume` was refused."""
    command = ["fit", "fall.yaml", "--set", "fit.starts=3"]
    assert run_group(command) == 0
    whole = result(folder / "results" / "fall.fit.h5")
    own, calls = module.fitted, []

    class KilledError(Exception):
        pass

    def killed(problem: Any, start: Any, stop: Callable[[], bool], seen: Callable[[Any], None]) -> Any:
        calls.append(start)
        if len(calls) == 2:
            raise KilledError
        return own(problem, start, stop, seen)

    monkeypatch.setattr(module, "fitted", killed)
    with pytest.raises(KilledError):
        run_group(command)
    monkeypatch.setattr(module, "fitted", own)
    assert result(folder / "results" / "fall.fit.h5")["status"] == "running"
    assert run_group([*command, "--resume"]) == 0
    assert result(folder / "results" / "fall.fit.h5")["estimates"] == whole["estimates"]


def test_a_run_that_is_stopped_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    many = ["--set", "fit.starts=3"]
    assert run_group(["fit", "fall.yaml", *many, "--out", "whole.h5"]) == 0
    whole = result(folder / "whole.h5")
    own = module.fitted
    calls = []

    def interrupted(problem: Any, start: Any, stop: Callable[[], bool], seen: Callable[[Any], None]) -> Any:
        calls.append(start)
        if len(calls) == 2:
            own(problem, start, stop_after(2), seen)
        return own(problem, start, stop, seen)

    monkeypatch.setattr(module, "fitted", interrupted)
    assert run_group(["fit", "fall.yaml", *many]) == 3
    assert "--resume" in capsys.readouterr().err
    place = folder / "results" / "fall.fit.h5"
    stopped = result(place)
    assert [len(stopped["starts"]), stopped["status"]] == [1, "interrupted"]
    assert [each["start"] for each in stopped["evaluations"]].count(1) == 2
    assert run_group(["show", str(place)]) == 0
    assert f"mdstopo fit fall.yaml --resume --out {place.resolve()}" in capsys.readouterr().out
    assert run_group(["fit", "fall.yaml", *many]) == 2
    assert "holds an unfinished run (interrupted)" in capsys.readouterr().err
    assert (folder / "results" / "fall.fitted.yaml").exists()
    monkeypatch.setattr(module, "fitted", own)
    assert run_group(["fit", "fall.yaml", *many, "--resume"]) == 0
    again = result(place)
    assert [each["x"] for each in again["starts"]] == [each["x"] for each in whole["starts"]]
    for key in ("estimates", "series", "correlation", "evaluations"):
        assert again[key] == whole[key]
    # of one that is finished, nothing is computed that was not
    assert run_group(["fit", "fall.yaml", *many, "--resume"]) == 0
    assert result(place)["simulations"] == again["simulations"]
    # another fit, and another case, are not gone on with
    assert run_group(["fit", "fall.yaml", "--set", "fit.starts=4", "--resume"]) == 2
    assert "not the same" in capsys.readouterr().err
    assert run_group(["fit", "fall.yaml", *many, "--set", "bodies.stone.mass=2", "--resume"]) == 2
    assert "it differs in bodies.stone.mass" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--set", "fit.measured.height.file=no.csv"], "fit.measured.height.file: there is no file 'no.csv'"),
        (
            ["--set", "fit.measured.height.value=z"],
            "fit.measured.height.value: found the column 'z', the file has t, y",
        ),
        (["--set", "time.end=0.5"], "found the time 0.6, and 3 more such times, allowed is 0 to 0.5 s"),
        (["--plot", "fall.txt"], "a picture ends in"),
        (["--resume", "--overwrite"], "--resume and --overwrite exclude each other"),
    ],
)
def test_what_cannot_be_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    assert run_group(["fit", "fall.yaml", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert "Traceback" not in said
    assert not (folder / "results" / "fall.fit.h5").exists()


def test_a_case_without_a_fit_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "plain.yaml").write_text(FALL[: FALL.index("fit:")], encoding="utf-8")
    assert run_group(["fit", "plain.yaml"]) == 2
    assert "plain.yaml:1:1: the key 'fit' is missing" in capsys.readouterr().err


def test_a_file_that_is_no_fit_is_not_gone_on_with(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "own.h5").write_text("no result", encoding="utf-8")
    assert run_group(["fit", "fall.yaml", "--out", "own.h5", "--resume"]) == 2
    assert "own.h5: not a result file of mdstopo" in capsys.readouterr().err
    with output_file(folder / "motion.h5", load_case("fall.yaml"), "simulate", overwrite=False, notify=print) as file:
        file.write("converged", "", {}, {})
    assert run_group(["fit", "fall.yaml", "--out", "motion.h5", "--resume"]) == 2
    assert "motion.h5 holds a result of `simulate`" in capsys.readouterr().err
    assert run_group(["fit", "fall.yaml", "--out", "fall.yaml", "--overwrite"]) == 2
    assert "this is the case file" in capsys.readouterr().err
    assert (folder / "fall.yaml").read_text(encoding="utf-8").startswith("format: 1")


def test_other_commands_take_a_case_with_a_fit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "fall.csv").unlink()
    assert run_group(["check", "fall.yaml"]) == 0
    said = capsys.readouterr().out
    assert "2 numbers to fit" in said
    assert "displacement y of stone" in said


@pytest.mark.parametrize("key", ["deviation=1e-300", "offset=1e308"])
def test_values_that_are_off_by_more_deviations_than_can_be_squared_fail_by_the_name_of_their_series(
    folder: Path, capsys: pytest.CaptureFixture[str], key: str
) -> None:
    changes = ["--set", "fit.measured.height.deviation=0.001", "--set", f"fit.measured.height.{key}"]
    assert run_group(["fit", "fall.yaml", *changes]) == 1
    assert "failed - height is more than 1e+100 of its deviations off" in capsys.readouterr().out


def test_a_series_of_zeros_that_is_met_exactly_is_fitted_without_an_overflow(folder: Path) -> None:
    """Nothing is left of it, so that its deviation is the least there is: a share of a unit."""
    (folder / "fall.csv").write_text("t,y\n" + "".join(f"0.{i},0\n" for i in range(1, 8)), encoding="utf-8")
    across = {"displacement": {"body": "stone", "component": "x"}}
    changes = [f"fit.measured.height.response={json.dumps(across)}", "fit.measured.height.offset={lower: -1, upper: 1}"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert run_group(["fit", "fall.yaml", *(word for each in changes for word in ("--set", each))]) == 0
    found = result(folder / "results" / "fall.fit.h5")
    assert found["series"][0]["deviation"] == [1e-12] * 7
    assert abs(found["estimates"][2]["value"]) < 1e-12
