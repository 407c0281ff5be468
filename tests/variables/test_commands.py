"""The commands know variables of laws: what they say, write, and read again."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from mdstopo.cli.group import run_group

CASE = """
format: 1
time: {end: 0.1}
bodies: {cart: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, 0]}}
members:
  spring: {from: {body: ground, at: [0, 0]}, to: {body: cart, at: [1, 0]}, law: {type: spring, stiffness: 9}}
  pair: {from: {body: ground, at: [0, 0]}, to: {body: cart, at: [1, 0]}, law: {type: spring, stiffness: 4}}
design:
  mirrored: [[spring, pair]]
  variables: {k: {group: spring, parameter: stiffness, lower: 1, upper: 20, cost: 1}}
objectives:
  E: {response: energy, over_time: mean}
  X: {response: {displacement: {body: cart}}, over_time: mean}
combine: {weights: {E: 1, X: 1}, normalize: false}
constraints: [{volume: all, limit: 100}]
optimizer: {max_iterations: 1}
"""


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("cart.yaml").write_text(CASE)


def answer(capsys, *words):
    status = run_group([*words, "--json"])
    out = capsys.readouterr()
    assert status == 0, out.err
    return json.loads(out.out)


def test_check_lists_what_varies_and_what_is_one(capsys):
    assert answer(capsys, "check", "cart.yaml")["variables"] == {"k": {"values": 1, "initial": 9.0}}
    assert run_group(["check", "cart.yaml"]) == 0
    said = capsys.readouterr().out
    assert "1 different alphas; mirrored: spring, pair" in said
    assert "stiffness of spring" in said


def test_what_a_run_finds_goes_from_file_to_file(capsys):
    found = answer(capsys, "run", "cart.yaml")
    with h5py.File("results/cart.h5") as file:
        k, alpha = file["design/variables/k"][()], file["design/alpha"][()]
        assert file["sensitivities/variables/E/k"].shape == (1,)
    assert found["variables"] == {"k": k.tolist()}
    assert alpha[0] == alpha[1]
    assert answer(capsys, "show", "results/cart.h5")["variables"] == {"k": k.tolist()}
    np.savetxt("other.txt", [0.3, 0.3, 12.5])
    answer(capsys, "simulate", "cart.yaml", "--alpha", "other.txt")
    answer(capsys, "gradient", "cart.yaml", "--method", "adjoint", "--alpha", "results/cart.simulate.h5")
    with h5py.File("results/cart.gradient.h5") as file:
        assert file["design/variables/k"][()].tolist() == [12.5]
        assert file["design/alpha"][()].tolist() == [0.3, 0.3]


def test_gradient_compares_variables_with_differences(capsys):
    found = answer(capsys, "gradient", "cart.yaml", "--method", "adjoint", "--differences")
    assert max(found["methods"]["adjoint"]["differences"].values()) < 1e-7
    with h5py.File("results/cart.gradient.h5") as file:
        own, other = (file[f"{group}/variables/E/k"][()] for group in ("sensitivities/adjoint", "differences"))
    assert own == pytest.approx(other, rel=1e-7)
    assert run_group(["gradient", "cart.yaml", "--method", "constant_load"]) == 2
    words = "design.variables: constant_load gives no derivatives by parameters of laws; adjoint does, and direct"
    assert words in capsys.readouterr().err


def test_fronts_and_sweeps_keep_the_values_of_every_design(capsys):
    answer(capsys, "pareto", "cart.yaml", "--points", "2", "--starts", "1")
    with h5py.File("results/cart.pareto.h5") as file:
        values = file["pareto/variables/k"][()]
    assert values.shape == (2, 1)
    answer(capsys, "simulate", "cart.yaml", "--alpha", "results/cart.pareto.h5:1")
    with h5py.File("results/cart.simulate.h5") as file:
        assert file["design/variables/k"][()].tolist() == values[1].tolist()
    answer(capsys, "sweep", "set", "cart.yaml", "members.spring.law.stiffness=8,9")
    with h5py.File("results/cart.sweep.h5") as file:
        assert [file[f"sweep/variables/{i}/k"].shape for i in (0, 1)] == [(1,), (1,)]
        assert file["sweep/alpha/0"].shape == (2,)
