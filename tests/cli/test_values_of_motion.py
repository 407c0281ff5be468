"""`simulate` tells what the motion comes to: objectives and constraints, with units and bounds."""

import json
from pathlib import Path

import numpy as np
import pytest

from mdstopo.cli.group import run_group

#: a mass of 1 kg on a spring of 100 N/m: x = sin(10 t)/10, so its energy is sin(10 t)^2/2
OSCILLATOR = """
format: 1
time: {end: 0.2}
bodies: {mass: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
members:
  spring: {from: {body: ground, at: [0, 0]}, to: {body: mass, at: [1, 0]}, law: {type: spring, stiffness: 100}, cost: 3}
load_cases:
  usual: {}
  short: {time: {end: 0.1}}
design: {initial: 1}
objectives:
  G: {response: energy, load_case: usual}
constraints:
  - {volume: all, limit: 4}
  - {response: energy, over_time: final, load_case: usual, limit: 0.1}
  - {response: energy, over_time: mean, load_case: short, at_least: 0.1}
"""


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("oscillator.yaml").write_text(OSCILLATOR)


def test_simulate_tells_objectives_and_constraints_with_unit_and_bound(capsys):
    assert run_group(["simulate", "oscillator.yaml"]) == 0
    lines = {line.strip() for line in capsys.readouterr().out.splitlines()}
    told = {" ".join(line.split()) for line in lines}
    assert "G 0.5 J, max energy at 0.15708 s" in told
    assert "volume of spring 3, at most 4" in told
    assert any(each.startswith("final energy, usual 0.4134") and each.endswith("at most 0.1 J: not kept")
               for each in told)  # fmt: skip
    assert any(each.startswith("mean energy, short 0.136") and each.endswith("at least 0.1 J") for each in told)


def test_the_values_that_simulate_tells_are_those_of_the_closed_form(capsys):
    assert run_group(["simulate", "oscillator.yaml", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["objectives"]["G"]["value"] == pytest.approx(0.5, rel=1e-7)
    assert content["objectives"]["G"]["time"] == pytest.approx(np.pi / 20.0, rel=1e-3)
    assert content["objectives"]["G"]["unit"] == "J"
    volume, final, mean = content["constraints"]
    assert (volume["value"], volume["kept"], volume["bound"]) == (3.0, True, 4.0)
    assert final["value"] == pytest.approx(0.5 * np.sin(2.0) ** 2, rel=1e-7)
    assert (final["what"], final["unit"], final["sense"], final["kept"]) == (
        "final energy, usual", "J", "at most", False,
    )  # fmt: skip
    # the mean of sin(10 t)^2/2 up to 0.1 s
    assert mean["value"] == pytest.approx(0.25 - 2.5 * np.sin(2.0) / 20.0, rel=1e-7)
    assert mean["kept"]


def test_only_what_looks_at_the_load_cases_that_are_simulated_is_told(capsys):
    assert run_group(["simulate", "oscillator.yaml", "--json", "--load-case", "short"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["objectives"] == {}
    assert [each["constraint"] for each in content["constraints"]] == [0, 2]
    assert content["constraints"][1]["value"] == pytest.approx(0.25 - 2.5 * np.sin(2.0) / 20.0, rel=1e-7)


def test_a_case_without_objectives_and_constraints_is_simulated_as_ever(capsys):
    text = OSCILLATOR.partition("design:")[0]
    Path("plain.yaml").write_text(text)
    assert run_group(["simulate", "plain.yaml", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["objectives"], content["constraints"]) == ({}, [])


@pytest.mark.parametrize("command", ["simulate", "check", "run"])
def test_a_volume_of_many_groups_has_a_short_name(command, capsys):
    one = OSCILLATOR[OSCILLATOR.index("  spring:") : OSCILLATOR.index("load_cases:")]
    many = "".join(one.replace("spring:", f"spring_{i}:", 1) for i in range(9))
    Path("many.yaml").write_text(OSCILLATOR.replace(one, many))
    assert run_group([command, "many.yaml", "--set", "constraints[0].limit=40"]) in (0, 1)
    told = capsys.readouterr().out
    assert "spring_0, spring_1 and 7 more groups" in told
    assert "spring_0, spring_1, spring_2" not in told
