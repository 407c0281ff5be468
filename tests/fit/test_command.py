"""`mdstopo fit`: what it writes, says and refuses, and how it goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mdstopo.case.reader import load_case
from mdstopo.cli.group import run_group
from mdstopo.fit import run_fit as module
from mdstopo.fit.solve import StoppedError

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
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def test_it_writes_result_case_and_picture(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib")
    assert run_group(["fit", "fall.yaml", "--plot", "fall.svg", "--profile", "2"]) == 0
    said = capsys.readouterr()
    found = result(folder / "results" / "fall.fit.json")
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
    before = (folder / "results" / "fall.fit.json").read_bytes()
    assert run_group(["fit", "fall.yaml"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert (folder / "results" / "fall.fit.json").read_bytes() == before
    assert run_group(["fit", "fall.yaml", "--overwrite", "--quiet"]) == 0


def test_json_is_one_object(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_group(["fit", "fall.yaml", "--json", "--out", "there/own.json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["command"] == "fit"
    assert said["path"] == "there/own.json"
    assert [each["name"] for each in said["estimates"]] == ["gravity[1]", "bodies.stone.velocity[1]"]


def test_a_run_that_is_stopped_goes_on(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    many = ["--set", "fit.starts=3"]
    assert run_group(["fit", "fall.yaml", *many, "--out", "whole.json"]) == 0
    whole = result(folder / "whole.json")
    own = module.fitted
    calls = []

    def interrupted(problem: Any, start: Any, stop: Callable[[], bool]) -> Any:
        calls.append(start)
        if len(calls) == 2:
            raise StoppedError
        return own(problem, start, stop)

    monkeypatch.setattr(module, "fitted", interrupted)
    assert run_group(["fit", "fall.yaml", *many]) == 3
    assert "--resume" in capsys.readouterr().err
    place = folder / "results" / "fall.fit.json"
    assert [len(result(place)["starts"]), result(place)["status"]] == [1, "interrupted"]
    assert (folder / "results" / "fall.fitted.yaml").exists()
    monkeypatch.setattr(module, "fitted", own)
    assert run_group(["fit", "fall.yaml", *many, "--resume"]) == 0
    again = result(place)
    assert [each["x"] for each in again["starts"]] == [each["x"] for each in whole["starts"]]
    assert again["estimates"] == whole["estimates"]
    # another case is not gone on with
    assert run_group(["fit", "fall.yaml", "--set", "fit.starts=4", "--resume"]) == 2
    assert "not the same" in capsys.readouterr().err


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
        (["--resume"], "there is no result to go on with"),
        (["--resume", "--overwrite"], "say --resume or --overwrite, not both"),
    ],
)
def test_what_cannot_be_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    assert run_group(["fit", "fall.yaml", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said
    assert "Traceback" not in said
    assert not (folder / "results" / "fall.fit.json").exists()


def test_a_case_without_a_fit_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "plain.yaml").write_text(FALL[: FALL.index("fit:")], encoding="utf-8")
    assert run_group(["fit", "plain.yaml"]) == 2
    assert "plain.yaml:1:1: the key 'fit' is missing" in capsys.readouterr().err


def test_a_file_that_is_no_result_is_not_gone_on_with(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for text in ("no json", "[]", '{"kind": "mdstopo fit", "version": 99}'):
        (folder / "own.json").write_text(text, encoding="utf-8")
        assert run_group(["fit", "fall.yaml", "--out", "own.json", "--resume"]) == 2
        assert "own.json: " in capsys.readouterr().err


def test_other_commands_take_a_case_with_a_fit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "fall.csv").unlink()
    assert run_group(["check", "fall.yaml"]) == 0
    said = capsys.readouterr().out
    assert "2 numbers to fit" in said
    assert "displacement y of stone" in said
