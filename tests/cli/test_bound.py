"""`mdstopo bound`, and what `show` and `report` tell of bounds."""

import json
from pathlib import Path

import h5py
import pytest

from mdstopo.cli.group import run_group

CASE = """\
format: 1
title: A load that is stopped
time: {end: 0.3}
bodies:
  load: {mass: 10, inertia: 1, position: [0, 0], velocity: [2, 0]}
members:
  stop:
    from: {body: ground, at: [-1, 0]}
    to: {body: load, at: [0, 0]}
    law: {type: spring, stiffness: 8000, damping: 60}
objectives:
  peak: {response: {acceleration: {body: load, component: x}}, over_time: max_abs}
constraints:
  - {response: {displacement: {body: load, component: x}}, over_time: max_abs, limit: 0.1}
design: {initial: 0.8}
optimizer: {max_iterations: 4}
"""
FRONT = CASE.replace("objectives:\n", "objectives:\n  stored: {response: energy}\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bound")
    (folder / "stop.yaml").write_text(CASE)
    (folder / "front.yaml").write_text(FRONT + "combine: {weights: {stored: 1, peak: 1}}\n")
    assert run_group(["run", str(folder / "stop.yaml"), "--quiet", "--out", str(folder / "run.h5")]) == 0
    words = ["--points", "3", "--quiet", "--out", str(folder / "front.h5")]
    assert run_group(["pareto", str(folder / "front.yaml"), *words]) == 0
    return folder


def answer(capsys, *words):
    """Exit status, the JSON object, what is on standard error."""
    status = run_group([*words, "--json"])
    out, err = capsys.readouterr()
    return status, json.loads(out), err


def test_the_json_object_has_a_bound_and_why_for_each_objective(folder, capsys):
    status, found, err = answer(capsys, "bound", str(folder / "front.yaml"))
    assert (status, err) == (0, "")
    assert set(found) == {"objectives"}
    assert list(found["objectives"]) == ["stored", "peak"]
    assert found["objectives"]["stored"].pop("why").startswith("stored energy depends")
    assert found["objectives"]["stored"] == {"bound": None, "best": None, "gap": None}
    peak = found["objectives"]["peak"]
    assert 0.99 * 20.0 <= peak["bound"] <= 20.0
    assert (peak["best"], peak["gap"]) == (None, None)


def test_a_result_is_compared_by_its_best_design_that_keeps_the_limits(folder, capsys):
    _, found, err = answer(capsys, "bound", str(folder / "stop.yaml"), "--result", str(folder / "run.h5"))
    assert err == ""
    peak = found["objectives"]["peak"]
    with h5py.File(folder / "run.h5") as file:
        values, excess = file["iterations/objectives"][:, 0], file["iterations/constraints"][:, 0]
    assert peak["best"] == values[excess <= 1e-7].min()
    assert peak["gap"] == pytest.approx((peak["best"] - peak["bound"]) / peak["best"])
    assert 0.0 < peak["gap"] < 1.0


def test_a_design_beyond_its_limits_is_no_best(folder, tmp_path, capsys):
    tight = tmp_path / "tight.yaml"
    tight.write_text(CASE.replace("limit: 0.1}", "limit: 0.01}").replace("max_iterations: 4", "max_iterations: 0"))
    run_group(["run", str(tight), "--quiet", "--out", str(tmp_path / "tight.h5")])
    capsys.readouterr()
    _, found, _ = answer(capsys, "bound", str(tight), "--result", str(tmp_path / "tight.h5"))
    assert found["objectives"]["peak"]["best"] is None
    assert found["objectives"]["peak"]["gap"] is None
    assert found["objectives"]["peak"]["bound"] == pytest.approx(200.0, rel=1e-2)


def test_a_front_is_compared_by_its_points(folder, capsys):
    _, found, _ = answer(capsys, "bound", str(folder / "front.yaml"), "--result", str(folder / "front.h5"))
    assert found["objectives"]["peak"]["best"] > found["objectives"]["peak"]["bound"]
    assert found["objectives"]["stored"]["best"] is not None
    assert found["objectives"]["stored"]["gap"] is None


def test_another_case_s_result_is_told_or_refused(folder, capsys):
    words = ["bound", str(folder / "stop.yaml"), "--result"]
    assert run_group([*words, str(folder / "front.h5")]) == 2
    assert "its objectives are stored, peak; the case has peak" in capsys.readouterr().err
    changed = folder / "changed.yaml"
    changed.write_text(CASE.replace("limit: 0.1}", "limit: 0.2}"))
    assert run_group(["bound", str(changed), "--result", str(folder / "run.h5")]) == 0
    assert "another version of the case" in capsys.readouterr().err


def test_in_words_and_with_other_values(folder, capsys):
    assert run_group(["bound", str(folder / "stop.yaml"), "--set", "constraints[0].limit=0.05"]) == 0
    out = capsys.readouterr().out
    assert "peak: at least 39.9" in out or "peak: at least 40 m/s^2" in out
    assert "displacement x of load at most 0.05" in out
    assert run_group(["bound", str(folder / "front.yaml"), "--set", "constraints=[]"]) == 0
    out = capsys.readouterr().out
    assert "stored: no bound: stored energy" in out
    assert "peak: no bound: without a limit on the travel of load" in out


def test_show_tells_the_bound_and_the_gap(folder, capsys):
    assert run_group(["show", str(folder / "run.h5")]) == 0
    assert "bounds over all members" in capsys.readouterr().out
    _, found, _ = answer(capsys, "show", str(folder / "run.h5"))
    assert found["bounds"]["peak"]["gap"] > 0.0


def test_the_page_of_a_result_has_the_bound(folder):
    out = Path(folder / "page.html")
    assert run_group(["report", str(folder / "front.h5"), "--out", str(out), "--quiet"]) == 0
    data = json.loads(
        out.read_text().partition('<script id="data" type="application/json">')[2].partition("</script>")[0]
    )
    stored, peak = data["objectives"]
    assert stored["bound"] is None
    assert peak["bound"]["value"] == pytest.approx(20.0, rel=1e-2)
    assert peak["bound"]["best"] > peak["bound"]["value"]
