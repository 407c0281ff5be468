"""`mdstopo sweep set`: every combination a run, in one table."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

import mdstopo
from mdstopo.cli.group import run_group
from mdstopo.front.run_sweep import combinations, run_sweep
from mdstopo.store.result_reader import read_result
from mdstopo.store.stored_case import case_of
from tests.session.test_combined_runs import single


@pytest.fixture(autouse=True)
def workplace(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(single())


def test_combinations_run_through_the_last_key_fastest():
    assert combinations({"a": "1:2:1", "b": "x, y"}) == (("1", "x"), ("1", "y"), ("2", "x"), ("2", "y"))
    with pytest.raises(ValueError, match="a value is missing"):
        combinations({"a": "1,,2"})
    with pytest.raises(ValueError, match="more than"):
        combinations({"a": "0:1:0.001", "b": "0:1:0.001"})


def test_every_run_is_the_run_of_its_case(capsys):
    words = ["members.belts.law.stiffness=3000:6000:3000", "optimizer.preset=default,mma"]
    assert run_group(["sweep", "set", "probe.yaml", *words, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert len(content["runs"]) == 4
    for run in content["runs"]:
        alone = mdstopo.optimize(mdstopo.load_case("probe.yaml", overrides=run["values"]))
        assert run["objectives"] == [alone.objectives["G1"]]
    with h5py.File("results/probe.sweep.h5") as file:
        assert file["sweep/objectives"].shape == (4, 1)
        assert file["sweep/values/optimizer.preset"].asstr()[()].tolist() == ["default", "mma"] * 2
    assert run_group(["show", "results/probe.sweep.h5"]) == 0


def test_it_goes_on_where_it_was_and_workers_change_nothing():
    sets = {"members.belts.law.stiffness": "3000:6000:1000"}
    done = []
    options = {"path": Path("parts.h5"), "on_progress": lambda s: done.append(s.done), "workers": 1}
    first = run_sweep(Path("probe.yaml"), {}, sets, stop_requested=lambda: len(done) >= 2, **options)
    assert first.status == "interrupted"
    second = run_sweep(Path("probe.yaml"), {}, sets, resume=True, **options)
    assert len(done) == 4
    both = run_sweep(Path("probe.yaml"), {}, sets, path=Path("two.h5"), workers=2, worth=0.0)
    for one, other in zip(second.found, both.found, strict=True):
        assert np.array_equal(one.alpha, other.alpha)
        assert np.array_equal(one.objectives, other.objectives)


def test_the_file_has_the_case_with_the_values_that_all_runs_have():
    sets = {"members.belts.law.stiffness": "3000"}
    run_sweep(Path("probe.yaml"), {"optimizer.max_iterations": "2"}, sets, path=Path("kept.h5"), workers=1)
    assert case_of(read_result("kept.h5")).optimizer.max_iterations == 2


def test_mistakes_of_all_combinations_are_told_at_once(capsys):
    assert run_group(["sweep", "set", "probe.yaml", "optimizer.preset=default,mmma", "time.end=0.1,-1"]) == 2
    said = capsys.readouterr().err
    assert "did you mean 'mma'" in said
    assert "time.end" in said
    assert not Path("results/probe.sweep.h5").exists()
    assert run_group(["sweep", "set", "probe.yaml", "nonsense"]) == 2


def test_a_run_that_fails_fails_alone(capsys):
    words = ["members.belts.law.stiffness=3000,1e200"]
    assert run_group(["sweep", "set", "probe.yaml", *words, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [run["status"] for run in content["runs"]][1] == "failed"
    assert content["runs"][1]["reason"]
