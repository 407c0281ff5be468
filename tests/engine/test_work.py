"""What an evaluation does, and what it does not do."""

import numpy as np
import pytest

import mdstopo.case.reader
import mdstopo.integrators.driver
import mdstopo.scene.compile_scene
import mdstopo.sensitivity.springs_driver
from mdstopo import evaluate, simulate
from mdstopo.engine import Evaluator
from tests.engine.scenes import interior, paper, random_design, random_scene, read, spring_scene, with_solver

BOTH = pytest.mark.parametrize("integrator", ["gauss", "runge_kutta"])


@BOTH
def test_the_reverse_sweep_starts_at_the_peak(integrator):
    # two periods are simulated, the first peak is at half of one
    loads = [{"body": "mass", "force": [{"table": [[0.0, 20.0], [0.7, 20.0], [0.7, 0.5], [2.0, 0.0]]}, 0.0]}]
    case = read(spring_scene(2.0, 200.0, end=2.0, loads=loads), integrator=integrator, tolerance=1e-10)
    found = evaluate(case)
    steps = simulate(case).t
    before = int(np.searchsorted(steps, found.peak_times["G"]))
    assert len(found.peaks["G"]) == 1
    assert 0 < found.work["reverse_steps"] <= before + 1
    assert found.work["reverse_steps"] < found.work["steps"]


def test_without_a_gradient_nothing_is_differentiated():
    case = paper("fig6")
    explicit = with_solver(case, integrator="runge_kutta")
    plain = Evaluator(explicit).evaluate(case.initial, gradient=False)
    assert plain.work["tangents"] == 0
    assert plain.work["reverse_steps"] == plain.work["design_states"] == 0
    assert plain.gradients == {}
    full = Evaluator(explicit).evaluate(case.initial)
    assert full.work["tangents"] > 0
    assert full.objectives == pytest.approx(plain.objectives, rel=1e-14)
    implicit = Evaluator(with_solver(case, integrator="gauss")).evaluate(case.initial, gradient=False)
    assert implicit.work["reverse_steps"] == implicit.work["design_states"] == 0


def test_an_evaluation_of_the_papers_scene_costs_few_force_sums():
    found = evaluate(paper("fig6"))
    assert found.work["force_sums"] <= 60
    assert found.work["design_states"] <= 20


def test_the_second_evaluation_reads_and_compiles_nothing(monkeypatch):
    case = paper("fig7-g1")
    alpha = random_design(case, 1)
    first = evaluate(case, alpha)

    def refuse(*args, **kwargs):
        raise AssertionError("compiled or read again")

    for module, name in (
        (mdstopo.case.reader, "parse"), (mdstopo.scene.compile_scene, "compile_scene"),
        (mdstopo.sensitivity.springs_driver, "compile_scene"), (mdstopo.sensitivity.springs_driver, "compile_members"),
        (mdstopo.sensitivity.springs_driver, "SpringsDriver"), (mdstopo.integrators.driver.Driver, "__init__"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, refuse)
    again = evaluate(case, alpha)
    assert again.objectives == first.objectives
    for name, gradient in first.gradients.items():
        assert np.array_equal(again.gradients[name], gradient)


def test_load_cases_that_nobody_looks_at_are_not_simulated():
    scene = spring_scene(load_cases={
        "pull": {"loads": [{"body": "mass", "force": [10.0, 0.0]}]},
        "idle": {"loads": [{"body": "mass", "force": [-10.0, 0.0]}]},
    })  # fmt: skip
    scene["objectives"] = {"G": {"response": "energy", "load_case": "pull"}}
    evaluator = Evaluator(read(scene))
    both = {**scene, "combine": {"weights": {"G": 1, "H": 1}}}
    both["objectives"] = {**scene["objectives"], "H": {"response": "energy", "load_case": "idle"}}
    alone, together = evaluator.evaluate(np.ones(1)), Evaluator(read(both)).evaluate(np.ones(1))
    assert alone.work["force_sums"] < together.work["force_sums"]
    assert any("idle" in note for note in evaluator.skipped)


def test_objectives_of_one_load_case_share_its_simulation():
    scene = spring_scene(loads=[{"body": "mass", "force": [10.0, 0.0]}])
    one = Evaluator(read(scene)).evaluate(np.ones(1), gradient=False)
    scene["objectives"] = {name: {"response": "energy", "over_time": name} for name in ("max", "mean", "final")}
    scene["combine"] = {"weights": dict.fromkeys(scene["objectives"], 1)}
    three = Evaluator(read(scene)).evaluate(np.ones(1), gradient=False)
    assert three.work["steps"] == one.work["steps"]
    assert three.objectives["max"] == one.objectives["G"]
    assert three.work["force_sums"] <= one.work["force_sums"] + 2


def test_peaks_are_looked_for_in_the_motion_that_was_simulated():
    # evaluating the same design twice gives the same numbers to the last bit
    case = interior()
    alpha = random_design(case, 3)
    one, other = Evaluator(case).evaluate(alpha), Evaluator(case).evaluate(alpha)
    assert one.objectives == other.objectives
    assert np.array_equal(one.gradients["G"], other.gradients["G"])


def _with_absent(case, share, seed=7):
    """A design of which a share, spread at random, is absent."""
    rng = np.random.default_rng(seed)
    design = rng.uniform(0.1, 1.0, case.n_design)
    design[rng.permutation(case.n_design)[: round(share * case.n_design)]] = 0.0
    return design


@pytest.mark.parametrize("integrator", ["gauss", "runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("features", [(), ("damping", "preload", "several", "fixed", "ground")])
def test_absent_members_cost_the_motion_nothing_and_have_the_same_gradient(integrator, features):
    solver = {"tolerance": 1e-9} if integrator != "generalized_alpha" else {"step": 1e-3}
    case = read(random_scene(11, *features, bodies=3), integrator=integrator, **solver)
    evaluator = Evaluator(case)
    fixed = sum(len(group) for group in case.members if not group.design)
    total = case.n_design + fixed
    design = _with_absent(case, 0.5 * total / case.n_design)
    few = evaluator.evaluate(design)
    assert few.status.ok, few.message
    assert few.work["spring_states"] == few.work["force_sums"] * (np.count_nonzero(design) + fixed)
    # of all members next to nothing is something
    all_of_them = evaluator.evaluate(np.where(design == 0.0, 1e-200, design))
    assert all_of_them.work["spring_states"] == all_of_them.work["force_sums"] * total
    assert few.objectives["G"] == pytest.approx(all_of_them.objectives["G"], rel=1e-11)
    gradient, other = few.gradients["G"], all_of_them.gradients["G"]
    assert np.abs(gradient - other).max() <= 1e-8 * np.abs(other).max()
    assert np.abs(gradient[design == 0.0]).max() > 0.0


def test_few_absent_members_are_summed_with_the_others():
    case = paper("fig6")
    found = Evaluator(case).evaluate(_with_absent(case, 0.2))
    assert found.work["spring_states"] == found.work["force_sums"] * case.n_design


def test_where_nothing_is_left_the_bodies_move_freely():
    case = paper("fig6")
    found = Evaluator(case).evaluate(np.zeros(case.n_design))
    assert found.status.ok, found.message
    assert found.work["spring_states"] == 0
    assert found.objectives["G"] == 0.0
