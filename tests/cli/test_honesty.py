"""What is not reached is said: infeasible ends, differences that cannot be had, interrupts in the compiler."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo import cli
from mdstopo.case.reader import read_case
from mdstopo.cli.group import run_group
from mdstopo.session.final_design import judged
from mdstopo.status import RunStatus
from tests.front.support import CASE
from tests.session.test_combined_runs import single

LIMIT = (
    "\n  - {response: {displacement: {body: torso, relative_to: vehicle}}, over_time: max, load_case: rotation, "
    "limit: 1e-6}\n"
)


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_a_run_that_finds_no_feasible_design_fails_and_names_the_constraint(capsys):
    Path("probe.yaml").write_text(single().replace("equals: 7.2}", "equals: 7.2}" + LIMIT))
    status = run_group(["run", "probe.yaml", "--json"])
    content = json.loads(capsys.readouterr().out)
    what = "max displacement of torso relative to vehicle, rotation"
    assert f"no design was found that keeps the constraints: constraints[1] ({what}) is" in content["reason"]
    # which of the two, and why, is a matter of rounding here
    assert (status, content["status"]) in ((1, "failed"), (1, "max_iterations"))
    assert content["constraints"][1] > 0.0
    assert run_group(["run", "probe.yaml", "--overwrite"]) == status
    said = capsys.readouterr()
    assert "max displacement of torso relative to vehicle" in said.out
    assert "another start may find one: --starts 8" in said.err


@pytest.mark.parametrize("status", [RunStatus.FAILED, RunStatus.CONVERGED, RunStatus.MAX_ITERATIONS])
def test_the_violated_constraint_is_named_whatever_the_optimiser_ended_with(status):
    case = read_case(single().replace("equals: 7.2}", "equals: 7.2}" + LIMIT))
    constraints = np.array([1e-12, 0.5e-6])
    word, reason = judged(case, SimpleNamespace(best_violation=0.5), constraints, status, "why it ended")
    assert word is (RunStatus.FAILED if status is RunStatus.CONVERGED else status)
    assert (
        "no design was found that keeps the constraints: constraints[1] (max displacement of torso relative to vehicle"
        in reason
    )
    assert ") is 5e-07 m above its limit 1e-06 m (why it ended)" in reason
    assert reason.endswith("(why it ended)")
    kept = judged(case, SimpleNamespace(best_violation=0.0), constraints, status, "why it ended")
    assert kept == (status, "why it ended")


def test_constraints_and_objectives_of_the_output_are_of_one_design(capsys):
    Path("probe.yaml").write_text(CASE)
    assert run_group(["run", "probe.yaml", "--json", "--set", "optimizer.max_iterations=5"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert abs(content["constraints"][0]) < 1e-8
    assert len(content["utopia"]) == 2
    assert run_group(["gradient", "probe.yaml", "--alpha", "results/probe.h5", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)["methods"]["adjoint"]["objectives"]
    assert values == pytest.approx(content["objectives"], rel=1e-9)


HANGING = """
format: 1
gravity: [0, -10]
time: {end: 0.05}
define: {k: 400}
bodies: {load: {mass: 2, inertia: 1, position: [0, 0]}}
members:
  springs: {from: {body: ground, at: [0, 1]}, to: {body: load, at: [0, 0]}, law: {type: spring, stiffness: "=k"}}
design: {initial: 0.5, variables: {k: {of: define.k, lower: 200, upper: 800}}}
objectives: {G: {response: {velocity: {body: load}}}}
solver: {settle: true, integrator: runge_kutta}
optimizer: {max_iterations: 0}
"""


def test_a_run_tells_how_far_the_start_of_its_design_has_settled(capsys):
    Path("hanging.yaml").write_text(HANGING)
    assert run_group(["run", "hanging.yaml", "--json"]) == 0
    settled = json.loads(capsys.readouterr().out)["settled"]
    assert settled["default"]["moved"] == pytest.approx(2 * 10 / (0.5 * 400), rel=1e-9)  # m g / (alpha k)
    assert run_group(["run", "hanging.yaml", "--overwrite"]) == 0
    assert "settled by 0.1 m at most (body load)" in capsys.readouterr().out


def test_finalize_tells_which_variables_stay_as_the_result_has_them(capsys):
    Path("hanging.yaml").write_text(HANGING)
    assert run_group(["run", "hanging.yaml", "--quiet"]) == 0
    assert run_group(["finalize", "results/hanging.h5", "--keep", "1"]) == 0
    assert (
        "k keeps the value of the result: defined names and points are not optimised again" in capsys.readouterr().err
    )


def test_differences_of_fixed_steps_are_of_these_steps(capsys):
    Path("probe.yaml").write_text(single())
    words = ["gradient", "probe.yaml", "--differences", "--json"]
    words += ["--set", "solver.integrator=generalized_alpha", "--set", "solver.step=0.005"]
    assert run_group(words) == 0
    for found in json.loads(capsys.readouterr().out)["methods"].values():
        assert found["differences"]["G1"] < 1e-6


def test_an_interrupt_that_trips_the_compiler_is_an_interrupt(monkeypatch, capsys):
    def stumbles(arguments):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise RuntimeError("no compiled object yet") from None

    ended = []
    monkeypatch.setattr(cli, "_dispatch", stumbles)
    monkeypatch.setattr("os._exit", ended.append)
    monkeypatch.setattr("atexit._run_exitfuncs", lambda: None)
    monkeypatch.setattr("gc.set_threshold", lambda _: None)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    monkeypatch.setattr("sys.argv", ["mdstopo", "run", "my case.yaml"])
    cli.main()
    assert ended == [3]
    told = capsys.readouterr().err
    assert told == "interrupted, nothing is saved; to begin again: mdstopo run 'my case.yaml'\n"
