"""What goes wrong in one piece stays there, and nothing that was finished is lost."""

import os
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
from mdstopo.front import jobs
from mdstopo.front import run_front as fronts
from mdstopo.front.directions import weights_of_first
from mdstopo.front.run_front import Ask, run_front
from mdstopo.front.run_sweep import run_sweep
from mdstopo.workers.worker_pool import Lost
from tests.front.support import CASE
from tests.front.test_fronts import assert_equal, contents, spread

#: seconds of the processor after which a worker has imported what it needs and is in the middle of a solve
IN_A_SOLVE = 1.2
LIMITED = CASE.replace(
    "  - {volume: all, equals: 7.2}",
    "  - {volume: all, equals: 7.2}\n"
    "  - {response: {displacement: {body: torso, relative_to: vehicle}}, over_time: max, load_case: translation, "
    "limit: 0.12}",
)


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(CASE)


def test_an_error_in_one_task_is_its_status(monkeypatch):
    real = jobs.solve

    def solve(engine, case, task, key, *more):
        if task.point == 1:
            raise np.linalg.LinAlgError("singular")
        return real(engine, case, task, key, *more)

    monkeypatch.setattr(jobs, "solve", solve)
    outcome = run_front(read_case(CASE), Ask(spread(4)), workers=1)
    assert [point.status.value for point in outcome.front.points].count("failed") == 1
    assert outcome.front.points[1].reason == "LinAlgError: singular"


def test_what_no_worker_finished_is_tried_again(monkeypatch):
    """A pool that loses the pieces of one point: the file is failed there, and whole after a resumption."""
    case, ask = read_case(CASE), Ask(spread(4))
    run_front(case, ask, path=Path("whole.h5"), workers=1)

    class Loses(fronts.Here):
        def results(self, tasks, *more):
            for place, found in super().results(tasks, *more):
                yield place, Lost("a worker process (pid 1) ended unexpectedly") if tasks[place].point == 1 else found

    with monkeypatch.context() as patch:
        patch.setattr(fronts, "Here", Loses)
        run_front(case, ask, path=Path("parts.h5"), workers=1)
    with h5py.File("parts.h5") as file:
        assert file["pareto/status"].asstr()[1] == "failed"
        assert "ended unexpectedly" in file["pareto/reason"].asstr()[1]
    run_front(case, ask, path=Path("parts.h5"), workers=1, resume=True)
    assert_equal("whole.h5", "parts.h5")


def test_an_error_of_the_program_leaves_what_was_finished(monkeypatch):
    def broken(self):
        yield from self._ends()
        raise RuntimeError("a bug")

    with monkeypatch.context() as patch:
        patch.setattr(fronts.Planner, "rounds", broken)
        with pytest.raises(RuntimeError, match="a bug"):
            run_front(read_case(CASE), Ask(spread(3)), path=Path("front.h5"), workers=1)
    assert len(contents("front.h5")["pareto/tasks/key"]) == 4
    run_front(read_case(CASE), Ask(spread(3)), path=Path("front.h5"), workers=1, resume=True)


def test_one_combination_of_a_sweep_of_several_objectives_fails_alone():
    sets = {"members.belts.law.stiffness": "3000,1e200"}
    outcome = run_sweep(Path("probe.yaml"), {}, sets, path=Path("s.h5"), workers=1)
    assert [found.status.value for found in outcome.found][1] == "failed"
    assert "alone cannot be optimised" in outcome.found[1].reason
    assert outcome.found[0].status.value != "failed"


def test_a_sweep_over_the_number_of_members_goes_on_where_it_was():
    sets = {"points.edge.grid.rectangle.count": "4,8,12"}
    done = []
    options = {"path": Path("s.h5"), "workers": 1, "on_progress": lambda s: done.append(s.done)}
    run_sweep(Path("probe.yaml"), {}, sets, stop_requested=lambda: len(done) >= 2, **options)
    before = len(done)
    outcome = run_sweep(Path("probe.yaml"), {}, sets, resume=True, **options)
    assert len(done) == before + 1 == 3
    assert [len(found.alpha) for found in outcome.found] == [36, 72, 108]


def test_points_beyond_a_constraint_are_off_the_front_and_say_so(capsys):
    Path("limited.yaml").write_text(LIMITED)
    assert run_group(["pareto", "limited.yaml", "--points", "5", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    part = contents("results/limited.pareto.h5")
    wrong = part["pareto/violation"] > 1e-6
    assert part["pareto/dominated"][wrong].all() or not wrong.any()
    assert said.count("exceeds a constraint") == int((part["pareto/violation"] > 1e-8).sum())
    kept = part["pareto/objectives"][~part["pareto/dominated"]]
    assert (part["pareto/ideal"] == kept.min(axis=0)).all()


def test_the_start_that_is_replaced_is_told_and_starts_are_the_cases():
    told = []
    case = read_case(CASE.replace("optimizer: {", "optimizer: {starts: 2, ") + "design: {initial: 0.3}\n")
    run_front(case, Ask(spread(2)), workers=1, notify=told.append)
    assert any("replaced by the nearest" in line for line in told)
    Path("probe.yaml").write_text(CASE.replace("optimizer: {", "optimizer: {starts: 2, "))
    assert run_group(["pareto", "probe.yaml", "--points", "2", "--quiet"]) == 0
    with h5py.File("results/probe.pareto.h5") as file:
        assert file["settings"].attrs["starts"] == 2


def test_resuming_without_options_asks_for_what_was_asked_before():
    command = ["pareto", "probe.yaml", "--quiet", "--workers", "1"]
    assert run_group([*command, "--weights", "0,0.25,1", "--method", "nbi"]) == 0
    assert run_group([*command, "--resume"]) == 0
    with h5py.File("results/probe.pareto.h5") as file:
        assert file["pareto/weights"].shape == (3, 2)
        assert file["settings"].attrs["method"] == "nbi"


def test_a_run_that_goes_on_with_more_iterations_keeps_its_utopia():
    short = read_case(CASE, overrides={"optimizer.max_iterations": 3})
    mdstopo.optimize(short, path=Path("run.h5"))
    first = contents("run.h5")
    longer = read_case(CASE, overrides={"optimizer.max_iterations": 12})
    mdstopo.optimize(longer, path=Path("run.h5"), resume=True)
    second = contents("run.h5")
    assert np.array_equal(first["combine/utopia"], second["combine/utopia"])
    assert np.array_equal(first["iterations/evaluations"], second["iterations/evaluations"][:4])


def test_workers_end_with_a_parent_that_is_killed():
    large = CASE.replace("count: 8}", "count: 200}").replace("count: 3}", "count: 60}").replace("7.2", "3600")
    Path("probe.yaml").write_text(large)
    code = (
        "from pathlib import Path; from mdstopo import load_case; from mdstopo.front.run_front import Ask, run_front;"
        "from mdstopo.front.directions import weights_of_first;"
        "run_front(load_case('probe.yaml'), Ask(weights_of_first([0.0, 0.5, 1.0])), workers=2, worth=0.0)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code])

    def children():
        """By the numbers of the workers that live, seconds of the processor that they have had."""
        found = {}
        for place in Path("/proc").glob("[0-9]*/stat"):
            try:
                words = place.read_text().rpartition(")")[2].split()
                command = place.with_name("cmdline").read_text()
            except OSError:
                continue
            own = words[1] == str(parent.pid) or place.parent.name in known
            if "mdstopo.workers.worker_program" in command and own:
                found[place.parent.name] = (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
        return found

    known: set[str] = set()
    if not Path("/proc/self/stat").exists():
        parent.kill()
        parent.wait()
        pytest.skip("needs /proc")
    end = time.monotonic() + 60
    while len(children()) < 2 and parent.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    known |= set(children())
    assert len(known) == 2
    while min(children().values(), default=IN_A_SOLVE) < IN_A_SOLVE and time.monotonic() < end:
        time.sleep(0.05)
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    end = time.monotonic() + 10
    while children() and time.monotonic() < end:
        time.sleep(0.1)
    assert not children()


def test_a_direction_that_is_given_twice_is_refused():
    with pytest.raises(ValueError, match="given twice"):
        run_front(read_case(CASE), Ask(np.array([[0.5, 0.5], [0.5, 0.5]])), workers=1)
    assert len(weights_of_first([0.0, 1.0])) == 2


def test_a_point_of_a_front_is_a_design_for_other_commands(capsys):
    assert run_group(["pareto", "probe.yaml", "--points", "3", "--quiet", "--out", "f.h5"]) == 0
    assert run_group(["simulate", "probe.yaml", "--alpha", "f.h5:1", "--quiet", "--out", "s.h5"]) == 0
    assert np.array_equal(contents("s.h5")["design/alpha"], contents("f.h5")["pareto/alpha"][1])
    for words, said in (("f.h5", "write f.h5:K"), ("f.h5:7", "there is no point 7")):
        assert run_group(["simulate", "probe.yaml", "--alpha", words]) == 2
        assert said in capsys.readouterr().err
