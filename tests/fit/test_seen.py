"""The result of a fit in words, pictures, tables, on a page and on the page that follows it while it runs."""

from __future__ import annotations

import json
import re
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import load_case
from mdstopo.cli.group import run_group
from mdstopo.engine import Evaluator
from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.fit_record import FitFile, content
from mdstopo.fit.run_fit import FitRun, run_fit
from mdstopo.plots.fit_plot import folded
from mdstopo.plots.plot_table import fitting
from mdstopo.plots.source import Source
from mdstopo.report import report_content
from mdstopo.report.watching import state_of
from mdstopo.store.result_reader import read_result
from tests.browser import BROWSER, look

from .test_fits import stop_after

#: a stone thrown up in two tests: of one the clock began late, of the other the ruler's zero is off
THROWN = """\
format: 1
title: A stone is thrown up
time: {end: 1}
bodies:
  stone: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 2]}
load_cases:
  here: {gravity: [0, -9]}
  there: {gravity: [0, -1.5]}
fit:
  estimate:
    load_cases.here.gravity[1]: {lower: -12, upper: -6}
    load_cases.there.gravity[1]: {lower: -3, upper: -1}
    bodies.stone.velocity[1]: {lower: 0, upper: 5}
  measured:
    earth:
      file: earth.csv
      load_case: here
      response: {displacement: {body: stone, component: y}}
      deviation: 0.002
      delay: {lower: -0.1, upper: 0.1}
    moon:
      file: moon.csv
      load_case: there
      response: {displacement: {body: stone, component: y}}
      offset: {lower: -0.1, upper: 0.1}
"""
TRUTH = {"here": (9.81, 0.02, 0.0), "there": (1.62, 0.0, 0.03)}
PROBE = """
seen.circles = ["measured", "residual"].map((name) => document.querySelectorAll(`circle.${name}`).length);
seen.squares = document.querySelectorAll("svg.correlation rect").length;
seen.charts = document.querySelectorAll("svg").length;
seen.rows = [...document.querySelectorAll("#results table")].map((t) => t.rows.length);
seen.ticks = [...document.querySelectorAll("svg text")].map((t) => t.textContent);
const loadcase = document.getElementById("loadcase");
loadcase.value = "there"; loadcase.dispatchEvent(new Event("change"));
seen.heads = [...document.querySelectorAll("#plots h2")].map((h) => h.textContent);
"""


def write_measured(folder: Path) -> Path:
    random = np.random.default_rng(3)
    for name, place in (("earth", "here"), ("moon", "there")):
        g, delay, offset = TRUTH[place]
        t = np.linspace(0.1, 0.9, 18)
        s = t - delay
        y = 2.0 * s - 0.5 * g * s**2 + offset + random.normal(scale=0.002, size=len(t))
        rows = "".join(f"{a:.6f}, {b:.6f}\n" for a, b in zip(t, y, strict=True))
        (folder / f"{name}.csv").write_text(rows, encoding="utf-8")
    path = folder / "thrown.yaml"
    path.write_text(THROWN, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The result of a fit, and what the command prints."""
    folder = tmp_path_factory.mktemp("seen")
    case, out = write_measured(folder), folder / "thrown.h5"
    with redirect_stdout(StringIO()) as printed:
        assert run_group(["fit", str(case), "--profile", "2", "--out", str(out)]) == 0
    return out, printed.getvalue()


@pytest.fixture
def fitted(told: tuple[Path, str]) -> Path:
    """The result of the fit."""
    return told[0]


def test_it_is_said_in_words_as_the_command_says_it(told: tuple[Path, str], capsys: pytest.CaptureFixture[str]) -> None:
    fitted, printed = told
    said = [line for line in printed.splitlines() if not re.match(" +(result|fitted case)", line)]
    assert run_group(["show", str(fitted)]) == 0
    shown = capsys.readouterr().out
    assert len(said) > 10
    assert [line for line in said[1:] if re.sub(" +", " ", line) not in re.sub(" +", " ", shown)] == []
    assert "motion here" in shown
    assert run_group(["show", str(fitted), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["fit"] == content(read_result(fitted))
    low, high = found["fit"]["estimates"][0]["low"], found["fit"]["estimates"][0]["high"]
    assert low < -9.81 < high


def test_its_motion_is_that_of_the_fitted_case(fitted: Path) -> None:
    view = read_result(fitted)
    case = load_case(fitted.with_name("thrown.fitted.yaml"))
    for name in ("here", "there"):
        motion = Evaluator(case).trajectory(case.start, name)
        t = view.array(f"trajectories/{name}/t")
        np.testing.assert_allclose(view.array(f"trajectories/{name}/q"), motion.at(t).q, atol=1e-9)


def test_all_pictures_are_drawn(fitted: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    assert fitting(Source(fitted).view) == ["fit", "correlation", "profiles", "layout"]
    for name in fitting(Source(fitted).view):
        out = tmp_path / f"{name}.svg"
        assert run_group(["plot", str(fitted), name, "--out", str(out), "--quiet"]) == 0
        text = out.read_text(encoding="utf-8")
        assert {"fit": "moon", "correlation": "delay of earth", "profiles": "offset of moon"}.get(name, "") in text


def test_long_names_are_written_in_lines_that_have_room() -> None:
    name = "load_cases.in_the_laboratory.loads[0].moment.parameters.amplitude of the first test"
    lines = folded(name, 30).split("\n")
    assert "".join(lines).replace(" ", "") == name.replace(" ", "")
    assert max(map(len, lines)) <= 30
    assert all(line[-1] in "_." for line in lines[:-1] if " " not in line)
    assert folded("angle of arm, rad", 30) == "angle of arm, rad"


def test_the_fitted_curve_is_what_the_instrument_would_record(fitted: Path) -> None:
    data = report_content.content(Source(fitted))["fit"]
    value = {each["name"]: each["value"] for each in data["estimates"]}
    v = value["bodies.stone.velocity[1]"]
    for each, key, delay, offset in (
        (data["series"][0], "load_cases.here.gravity[1]", value["delay of earth"], 0.0),
        (data["series"][1], "load_cases.there.gravity[1]", 0.0, value["offset of moon"]),
    ):
        t, y = (np.array(part) for part in each["curve"])
        s = t - delay
        np.testing.assert_allclose(y, v * s + 0.5 * value[key] * s**2 + offset, atol=1e-5)  # six digits
        measured, predicted = np.array(each["measured"]), np.interp(each["t"], t, y)
        deviation = each["deviation"][0]
        np.testing.assert_allclose((predicted - measured) / deviation, each["residual"], atol=0.02)


def test_profiles_meet_the_parabola_where_the_scene_is_straight(fitted: Path) -> None:
    data = report_content.content(Source(fitted))["fit"]
    (own,) = (each for each in data["profiles"] if each["name"] == "offset of moon")
    np.testing.assert_allclose(own["rise"], np.interp(own["values"], own["fine"], own["parabola"]), atol=0.05)
    assert own["end"] == pytest.approx(2.03951**2, rel=1e-5)  # Student's quantile, of 31 degrees of freedom


@pytest.mark.skipif(BROWSER is None, reason="no browser on this machine")
def test_the_page_shows_all_of_it(fitted: Path, tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    assert run_group(["report", str(fitted), "--out", str(out), "--quiet"]) == 0
    seen = look(out, PROBE, tmp_path)
    assert seen["errors"] == []
    assert seen["overlaps"] == []
    assert seen["circles"] == [18, 18]
    assert seen["squares"] == 25
    assert seen["charts"] == 8  # a series and its residuals, correlations, five profiles
    assert seen["rows"] == [6, 3]
    assert "NaN" not in seen["ticks"]
    assert seen["heads"][:2] == ["moon, measured and fitted: displacement y of stone", "moon, what is left"]


def test_tables_have_estimates_series_and_what_was_tried(fitted: Path, tmp_path: Path) -> None:
    assert run_group(["export", str(fitted), "--csv", "--out", str(tmp_path / "tables"), "--quiet"]) == 0
    estimates = (tmp_path / "tables" / "estimates.csv").read_text(encoding="utf-8").splitlines()
    assert estimates[0].startswith("estimate,value,deviation,low,high")
    assert len(estimates) == 6
    measured = (tmp_path / "tables" / "measured-earth.csv").read_text(encoding="utf-8").splitlines()
    assert len(measured) == 19
    tried = (tmp_path / "tables" / "evaluations.csv").read_text(encoding="utf-8").splitlines()
    assert "root_mean_square earth,root_mean_square moon" in tried[0]


def test_it_can_be_followed_from_the_first_motion_on(tmp_path: Path) -> None:
    problem = FitProblem(load_case(write_measured(tmp_path)))
    place = tmp_path / "running.h5"
    file, states = FitFile(place, problem), []

    def passing(run: FitRun) -> None:
        file.checkpoint(run)
        source = Source(place)
        states.append(state_of(source.view, source))

    run = run_fit(problem, stop=stop_after(3), passing=passing)
    assert run.status == "interrupted"
    assert len(states) == 3
    first: dict[str, Any] = states[0]["fit"]
    assert [states[0]["kind"], states[0]["finished"]] == ["fit", False]
    assert [each["value"] for each in first["estimates"]] == problem.initial.tolist()
    assert all("low" not in each for each in first["estimates"])
    assert [[len(column) for column in state["fit"]["left"]] for state in states] == [[1, 1], [2, 2], [3, 3]]
    found = problem.predicted(problem.initial)
    np.testing.assert_allclose(first["series"][1]["predicted"], found[1], atol=1e-12)
    left = np.sqrt(np.mean((found[1] - problem.measured[1].y) ** 2))
    assert first["left"][1][0] == pytest.approx(left, rel=1e-12)
    # where no start is done, a result says where the fit has come to, without intervals
    file.conclude(run, None, ())
    whole = content(read_result(place))
    assert whole["status"] == "interrupted"
    assert whole["correlation"] is None
    assert [each["value"] for each in whole["estimates"]] == run.trace[-1].x.tolist()
