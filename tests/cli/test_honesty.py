"""What is not reached is said: infeasible ends, differences that cannot be had, interrupts in the compiler."""

import json
from pathlib import Path

import pytest

from mdstopo import cli
from mdstopo.cli.group import run_group
from tests.front.support import CASE
from tests.front.test_combined_runs import single

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
    assert "no design was found that keeps the constraints: constraints[1] is" in content["reason"]
    assert (status, content["status"]) in ((1, "failed"), (1, "max_iterations"))
    assert content["constraints"][1] > 0.0
    assert run_group(["run", "probe.yaml", "--overwrite"]) == status
    assert "max displacement of torso relative to vehicle" in capsys.readouterr().out


def test_constraints_and_objectives_of_the_output_are_of_one_design(capsys):
    Path("probe.yaml").write_text(CASE)
    assert run_group(["run", "probe.yaml", "--json", "--set", "optimizer.max_iterations=5"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert abs(content["constraints"][0]) < 1e-8
    assert len(content["utopia"]) == 2
    assert run_group(["gradient", "probe.yaml", "--alpha", "results/probe.h5", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)["methods"]["adjoint"]["objectives"]
    assert values == pytest.approx(content["objectives"], rel=1e-9)


def test_differences_of_fixed_steps_are_of_these_steps(capsys):
    Path("probe.yaml").write_text(single())
    words = ["gradient", "probe.yaml", "--differences", "--set", "solver.integrator=generalized_alpha", "--json"]
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
    cli.main()
    assert ended == [3]
    assert capsys.readouterr().err == "interrupted\n"
