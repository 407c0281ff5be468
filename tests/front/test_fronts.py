"""Fronts with the real engine: good, the same however they are made, and never lost."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.cli.group import run_group
from mdstopo.front import cluster
from mdstopo.front.directions import weights_of_first
from mdstopo.front.front_content import _dominated
from mdstopo.front.run_front import Ask, run_front
from mdstopo.plan.front_measures import dominated, hypervolume, neighbour_gaps, scaled
from tests.front.support import CASE, THREE

ROOT = Path(__file__).parents[2]
#: best front known of cases/fig7.yaml: ideal, nadir, and the volume below 1.1 of it
IDEAL, NADIR, BEST_KNOWN = np.array([16.48, 35.19]), np.array([51.67, 122.87]), 0.9546


def spread(count):
    return weights_of_first(np.linspace(0.0, 1.0, count).tolist())


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    """A folder with a case in it; handlers of signals are put back."""
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(CASE)
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in kept.items():
        signal.signal(number, handler)


def contents(path):
    """Every dataset, without times and hosts."""
    found = {}

    def visit(name, node):
        if isinstance(node, h5py.Dataset) and name.split("/")[-1] not in ("seconds", "host"):
            found[name] = node[()]

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return found


def assert_equal(one, other):
    first, second = contents(one), contents(other)
    assert first.keys() == second.keys()
    for name, value in first.items():
        assert np.array_equal(value, second[name], equal_nan=getattr(value, "dtype", np.dtype("O")).kind == "f"), name


@pytest.mark.parametrize(
    ("method", "share", "evaluations", "gap"), [("", 0.95, 21 * 60, np.inf), ("nbi", 0.985, 21 * 40, 0.12)]
)
def test_21_points_reach_the_best_front_known_of_the_papers_case(method, share, evaluations, gap):
    case = mdstopo.load_case(ROOT / "cases/fig7.yaml")
    outcome = run_front(case, Ask(spread(21), method), workers=1)
    points = scaled(np.array([p.objectives for p in outcome.front.points]), IDEAL, NADIR)
    assert hypervolume(points, np.full(2, 1.1)) >= share * BEST_KNOWN
    assert outcome.evaluations <= evaluations
    assert neighbour_gaps(points[~dominated(points)]).max() <= gap
    for point in outcome.front.points:
        assert point.violation <= 1e-8
        assert point.kkt <= 1e-6 or "objective twice running" in point.reason or "no variable" in point.reason


def test_workers_change_nothing():
    case = read_case(CASE)
    for workers, name in ((1, "one.h5"), (2, "two.h5"), (5, "five.h5")):
        outcome = run_front(case, Ask(spread(5), "nbi"), path=Path(name), workers=workers, worth=0.0)
        assert outcome.status == "converged"
    assert_equal("one.h5", "two.h5")
    assert_equal("one.h5", "five.h5")


def test_a_front_that_is_stopped_goes_on_where_it_was_and_ends_the_same():
    case = read_case(CASE)
    ask = Ask(spread(5))
    run_front(case, ask, path=Path("whole.h5"), workers=1)
    solved = []

    def enough():
        return len(solved) >= 7

    def note(snapshot):
        solved[:] = range(snapshot.done)

    first = run_front(case, ask, path=Path("parts.h5"), workers=1, on_progress=note, stop_requested=enough)
    assert first.status == "interrupted"
    assert contents("parts.h5")["pareto/tasks/key"].shape == (7,)
    counts = []
    run_front(case, ask, path=Path("parts.h5"), resume=True, workers=1, on_progress=lambda s: counts.append(s.done))
    assert counts[0] >= 7
    assert_equal("whole.h5", "parts.h5")


@pytest.mark.parametrize(("solves", "known"), [(2, False), (5, True)], ids=["ends alone", "ends crossed"])
def test_a_front_that_is_stopped_tells_utopia_and_maxima_only_once_they_are_known(solves, known, capsys):
    """Each objective alone has been optimised after two solves; the ends are chosen once each was begun at the other's
    optimum, too. What stood in their places was 0 and 1."""
    done = [0]
    run_front(
        read_case(CASE), Ask(spread(5)), path=Path("parts.h5"), workers=1,
        on_progress=lambda snapshot: done.__setitem__(0, snapshot.done), stop_requested=lambda: done[0] >= solves,
    )  # fmt: skip
    part = contents("parts.h5")
    assert len(part["pareto/tasks/key"]) == solves
    for name in ("utopia", "maxima"):
        assert np.isfinite(part[f"pareto/{name}"]).all() == known
    assert run_group(["show", "parts.h5"]) == 0
    assert ("utopia" in capsys.readouterr().out) == known
    if known:
        ends = part["pareto/ends"]
        assert np.array_equal(part["pareto/utopia"][0], ends.min(axis=0))
        assert np.array_equal(part["pareto/maxima"][0], ends.max(axis=0))


def test_a_front_that_is_killed_goes_on_from_its_file():
    command = [sys.executable, "-m", "mdstopo", "pareto", "probe.yaml", "--points", "41", "--starts", "3", "--quiet"]
    whole = subprocess.run([*command, "--out", "whole.h5", "--workers", "1"], check=False)
    assert whole.returncode == 0
    process = subprocess.Popen([*command, "--out", "parts.h5", "--workers", "1"])

    def solved():
        return len(contents("parts.h5").get("pareto/tasks/key", ())) if Path("parts.h5").exists() else 0

    end = time.monotonic() + 60
    while not solved() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)
    process.kill()
    process.wait()
    before = solved()
    again = subprocess.run([*command, "--out", "parts.h5", "--resume", "--workers", "2"], check=False)
    assert again.returncode == 0
    assert len(contents("parts.h5")["pareto/tasks/key"]) > before > 0
    assert_equal("whole.h5", "parts.h5")


def test_ctrl_c_keeps_what_is_finished_and_says_how_to_go_on():
    line = "pareto probe.yaml --points 101 --starts 4 --workers 1"
    process = subprocess.Popen([sys.executable, "-m", "mdstopo", *line.split()], stderr=subprocess.PIPE, text=True)
    path = Path("results/probe.pareto.h5")
    end = time.monotonic() + 60
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 3
    again = next(text for text in said.splitlines() if text.startswith("interrupted; to go on: "))
    words = shlex.split(again.removeprefix("interrupted; to go on: "))
    assert words[-1] == "--resume"
    with h5py.File(path) as file:
        assert file.attrs["status"] == "interrupted"


def test_objectives_of_weight_zero_are_not_simulated_but_reported_at_the_end():
    outcome = run_front(read_case(CASE), Ask(spread(3)), workers=1)
    for i, end in enumerate(outcome.front.ends):
        assert np.isfinite(end.objectives).all()
        mine = next(task for task in outcome.tasks if task.point == -1 - i)
        assert np.isnan(mine.visited[:-1, 1 - i]).all()
        assert np.isfinite(mine.visited[:, i]).all()
        assert np.array_equal(mine.visited[-1], mine.objectives)


def test_a_point_that_breaks_a_constraint_beats_none_and_belongs_to_no_front():
    signed = np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]])
    words = ["converged", "converged", "running"]
    assert _dominated(signed, np.array([0.5, 0.0, 0.0]), words).tolist() == [True, False, False]
    assert _dominated(signed, np.array([0.0, 0.0, 0.0]), words).tolist() == [False, True, False]


def test_three_objectives_make_a_front():
    outcome = run_front(read_case(THREE), Ask(mdstopo_lattice(), "nbi"), workers=1)
    points = np.array([p.objectives for p in outcome.front.points])
    assert np.isfinite(points).all()
    assert (~dominated(points)).sum() >= 5


def mdstopo_lattice():
    from mdstopo.front.directions import lattice

    return lattice(3, 6)


def test_points_that_cannot_be_computed_fail_alone():
    """A product of an objective that is negative somewhere: the mean of a displacement that changes its sign."""
    text = CASE.replace(
        "  G2: {response: energy, load_case: translation}",
        "  G2: {response: {displacement: {body: torso, component: y}}, over_time: mean, load_case: translation}",
    )
    outcome = run_front(read_case(text), Ask(spread(3), "weighted_product"), workers=1)
    words = [p.status.value for p in outcome.front.points]
    assert words[1] == "failed"
    assert "objective G2, which weighted_product needs to be positive" in outcome.front.points[1].reason
    assert {words[0], words[2]} <= {"converged", "max_iterations"}


def test_the_command_tells_everything(capsys):
    assert run_group(["pareto", "probe.yaml", "--weights", "0,0.5,1", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["weights"] == [[0.0, 1.0], [0.5, 0.5], [1.0, 0.0]]
    assert np.array(content["objectives"]).shape == (3, 2)
    assert content["hypervolume"] > 0
    assert run_group(["show", content["path"]]) == 0
    said = capsys.readouterr().out
    assert "weight G1" in said
    assert "utopia" in said
    part = contents(content["path"])
    assert part["pareto/visited/1"].shape[1] == 2
    assert part["pareto/utopia"].shape == (3, 2)
    assert part["pareto/evaluations"].sum() == content["evaluations"]
    assert run_group(["sweep", "weights", "probe.yaml", "--weights", "0,0.5,1", "--quiet", "--out", "other.h5"]) == 0
    assert_equal(content["path"], "other.h5")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--weights 0:1:0.3", "does not divide"),
        ("--weights 0:2:1", "between 0 and 1"),
        ("--weights 0,1 --points 3", "exclude each other"),
        ("--cluster tcp://127.0.0.1:9", "no Dask scheduler answers"),
    ],
)
def test_what_is_no_front_is_refused(words, said, capsys, monkeypatch):
    monkeypatch.setattr(cluster, "ANSWERING", 0.5)
    assert run_group(["pareto", "probe.yaml", *words.split()]) == 2
    assert said in capsys.readouterr().err


def test_one_objective_is_no_front(capsys):
    assert run_group(["pareto", str(ROOT / "cases/fig6.yaml")]) == 2
    assert "at least two objectives" in capsys.readouterr().err


def test_the_front_of_another_case_is_not_resumed(capsys):
    assert run_group(["pareto", "probe.yaml", "--points", "3", "--quiet"]) == 0
    Path("probe.yaml").write_text(CASE.replace("3000", "3100"))
    assert run_group(["pareto", "probe.yaml", "--points", "3", "--resume"]) == 2
    assert "members.belts.law.stiffness" in capsys.readouterr().err
