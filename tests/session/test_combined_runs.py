"""`run` with several objectives: utopia first, one U, and all of it in the file."""

from pathlib import Path

import h5py
import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.session.combining import Combining
from tests.front.support import CASE, THREE


def test_a_run_finds_utopia_first_and_counts_it():
    result = mdstopo.optimize(read_case(CASE), path=None)
    assert result.status == "converged"
    evaluations = result.history["evaluations"]
    assert evaluations[0] > 4
    assert result.evaluations == evaluations[-1]
    assert result.history["objectives"].shape[1] == 2
    assert result.history["combined"][-1] == pytest.approx(min(result.history["combined"]))


def test_the_file_holds_utopia_maxima_and_what_was_better(tmp_path):
    path = tmp_path / "run.h5"
    result = mdstopo.optimize(read_case(CASE), path=path)
    with h5py.File(path) as file:
        utopia, maxima = file["combine/utopia"][()], file["combine/maxima"][()]
        best = file["combine/best_found"][()]
        g = (np.array(list(result.objectives.values())) - utopia) / (maxima - utopia)
        # Eq. 23 with p = 2, weights 1/4 and 3/4
        assert file["iterations/combined"][-1] == pytest.approx(0.25 * g[0] ** 2 + 0.75 * g[1] ** 2, rel=1e-9)
    assert (utopia <= maxima).all()
    assert (best <= utopia + 1e-12).all()


def test_a_run_that_is_stopped_in_the_individual_optima_goes_on_to_the_same_end(tmp_path):
    case = read_case(CASE)
    whole = mdstopo.optimize(case, path=tmp_path / "whole.h5")
    half = whole.history["evaluations"][0] // 2
    asked = []

    def stop():
        asked.append(1)
        return len(asked) > half

    with pytest.raises(KeyboardInterrupt):
        mdstopo.optimize(case, path=tmp_path / "parts.h5", stop_requested=stop)
    mdstopo.optimize(case, path=tmp_path / "parts.h5", resume=True)
    with h5py.File(tmp_path / "whole.h5") as one, h5py.File(tmp_path / "parts.h5") as other:
        for name in ("design/alpha", "combine/utopia", "iterations/objectives", "iterations/evaluations"):
            assert np.array_equal(one[name][()], other[name][()]), name


def test_no_save_holds_less_of_the_individual_optima_than_the_one_before(monkeypatch):
    whole = Combining.scalarisation
    saved = []

    def watched(self, engine, first, keep, stop, notify):
        def look():
            part = self.part(np.zeros((0, 2)))
            counts = [each for name, each in part.items() if name.endswith(("tasks/evaluations", "/0/evaluations"))]
            saved.append(int(sum(np.sum(each) for each in counts)))
            keep()

        return whole(self, engine, first, look, stop, notify)

    monkeypatch.setattr(Combining, "scalarisation", watched)
    result = mdstopo.optimize(read_case(CASE))
    assert saved == sorted(saved)
    assert saved[-1] == result.history["evaluations"][0] - 1  # and the first design


def test_workers_and_starts_share_one_utopia(tmp_path):
    case = read_case(CASE)
    one, two = (mdstopo.optimize(case, starts=3, workers=workers) for workers in (1, 2))
    assert np.array_equal(one.alpha, two.alpha)
    assert one.objectives == two.objectives


@pytest.mark.parametrize("method", ["weighted_sum", "weighted_min_max", "weighted_product"])
def test_every_method_runs(method):
    text = CASE.replace("combine: {", f"combine: {{method: {method}, ")
    result = mdstopo.optimize(read_case(text))
    start = mdstopo.evaluate(read_case(text), np.full(72, 0.1), gradient=False).objectives
    assert any(result.objectives[name] < start[name] for name in start)


def test_min_max_ties_weighted_objectives_where_they_conflict():
    text = CASE.replace("combine: {", "combine: {method: weighted_min_max, ")
    case = read_case(text)
    result = mdstopo.optimize(case)
    assert result.status == "converged"
    assert result.history["combined"][-1] > 0


def test_weight_zero_leaves_a_load_case_out_until_the_end():
    case = read_case(CASE.replace("G2: 3", "G2: 0"))
    result = mdstopo.optimize(case)
    objectives = result.history["objectives"]
    assert np.isnan(objectives[0, 1])
    assert np.isfinite(objectives[-1]).all()
    assert np.isfinite(list(result.objectives.values())).all()
    alone = mdstopo.optimize(read_case(single()))
    assert result.objectives["G1"] == pytest.approx(alone.objectives["G1"], rel=1e-9)


def single():
    keep = CASE.replace("  G2: {response: energy, load_case: translation}\n", "")
    return keep.replace("combine: {weights: {G1: 1, G2: 3}}\n", "")


def test_three_objectives_of_two_kinds_are_combined():
    result = mdstopo.optimize(read_case(THREE))
    assert set(result.objectives) == {"G1", "G2", "G3"}
    assert all(np.isfinite(value) for value in result.objectives.values())


def test_an_objective_that_is_maximised_is_not_minimised():
    text = CASE.replace("load_case: translation}", "load_case: translation, sense: maximize}")
    case = read_case(text)
    result = mdstopo.optimize(case)
    other = mdstopo.optimize(read_case(CASE))
    assert result.objectives["G2"] > other.objectives["G2"]


def test_a_product_of_something_negative_fails_with_its_name():
    text = CASE.replace("combine: {", "combine: {method: weighted_product, ").replace(
        "  G2: {response: energy, load_case: translation}",
        "  G2: {response: {displacement: {body: torso, component: y}}, over_time: mean, load_case: translation}",
    )
    result = mdstopo.optimize(read_case(text))
    assert result.status == "failed"
    assert "objective G2" in result.reason


def test_show_and_the_command_work_on_it(tmp_path, monkeypatch, capsys):
    from mdstopo.cli.group import run_group

    monkeypatch.chdir(tmp_path)
    Path("probe.yaml").write_text(CASE)
    assert run_group(["run", "probe.yaml"]) == 0
    assert run_group(["show", "results/probe.h5"]) == 0
    said = capsys.readouterr().out
    assert "G1" in said
    assert "G2" in said
