"""Runs that design parameters of laws: known optima, files, resuming, and what other commands make of them."""

from pathlib import Path

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.session.run_session import run_session
from mdstopo.store.design_files import read_design
from mdstopo.store.result_reader import read_result
from mdstopo.store.store_errors import StoreError
from tests.variables.support import whole_and_resumed

CATCH = Path(__file__).parents[2] / "cases" / "catch.yaml"
#: a mass on a spring of which x0 is stretched at the start, and a damper; axis x, nothing turns
DAMPED = """
format: 1
time: {end: 12}
bodies: {m: {mass: 2, inertia: 1, position: [0, 0]}}
members:
  spring: {from: {body: ground, at: [-5, 0]}, to: {body: m, at: [0, 0]},
           law: {type: spring, stiffness: 50, free_length: 4.8}}
  damper: {from: {body: ground, at: [-5, 0]}, to: {body: m, at: [0, 0]}, design: false,
           law: {type: spring, stiffness: 0, damping: 1}}
design:
  initial: 1
  lower: 1
  variables: {c: {group: damper, parameter: damping, lower: 0.1, upper: 60, cost: 2}}
objectives: {J: {response: energy, over_time: integral}}
optimizer: {max_iterations: 80, tolerance: 1e-9}
solver: {tolerance: 1e-11}
"""


def test_the_best_damper_of_a_mass_on_a_spring_is_half_of_critical():
    """x'' + 2 zeta w x' + w^2 x = 0 from rest at x0: the integral of x^2 is x0^2 (1 + 4 zeta^2)/(4 zeta w)."""
    result = mdstopo.optimize(read_case(DAMPED))
    m, k, x0 = 2.0, 50.0, 0.2
    w = np.sqrt(k / m)
    assert result.objectives["J"] == pytest.approx(0.5 * k * x0**2 / w, rel=1e-6)
    assert result.variables["c"][0] == pytest.approx(2 * 0.5 * m * w, rel=1e-3)
    for c in (4.0, 2 * 0.5 * m * w, 30.0):
        zeta = c / (2 * m * w)
        found = mdstopo.evaluate(read_case(DAMPED), variables={"c": c})
        assert found.objectives["J"] == pytest.approx(0.5 * k * x0**2 * (1 + 4 * zeta**2) / (4 * zeta * w), rel=1e-8)
        slope = 0.5 * k * x0**2 * (1 - 1 / (4 * zeta**2)) / w / (2 * m * w)
        assert found.variable_gradients["J"]["c"][0] == pytest.approx(slope, rel=1e-7, abs=1e-9)


def test_what_a_value_costs_is_in_volume_rows():
    text = DAMPED.replace("objectives:", "constraints: [{volume: damper, limit: 12}]\nobjectives:")
    case = read_case(text)
    result = mdstopo.optimize(case)
    assert result.variables["c"][0] == pytest.approx(6.0, rel=1e-9)
    assert result.constraints[0] == pytest.approx(0.0, abs=1e-9)
    found = mdstopo.evaluate(case, variables={"c": 4})
    assert found.constraints[0] == pytest.approx(-4.0)
    assert found.constraint_variable_gradients["c"].tolist() == [[2.0]]


def test_a_run_that_is_stopped_and_resumed_is_the_same_to_the_bit(tmp_path):
    case = mdstopo.load_case(CATCH, overrides={"optimizer.max_iterations": "8"})
    whole, resumed = whole_and_resumed(case, tmp_path)
    assert {name: each.tolist() for name, each in resumed.variables.items()} == {
        name: each.tolist() for name, each in whole.variables.items()
    }
    one, other = (read_result(tmp_path / name) for name in ("whole.h5", "parts.h5"))
    assert one.array("iterations/objectives").tobytes() == other.array("iterations/objectives").tobytes()
    for name in case.space.parts:
        assert one.array(f"design/variables/{name}").tobytes() == other.array(f"design/variables/{name}").tobytes()
        assert one.array(f"sensitivities/variables/acceleration/{name}").shape == (1,)


def test_a_result_file_brings_its_variables_to_the_next_evaluation(tmp_path):
    case = mdstopo.load_case(CATCH, overrides={"optimizer.max_iterations": "4"})
    outcome = run_session(case, path=tmp_path / "a.h5")
    design = case.whole(read_design(tmp_path / "a.h5", case.n_design, case.space.parts))
    assert {name: each.tolist() for name, each in case.space.named(design).items()} == {
        name: each.tolist() for name, each in outcome.variables.items()
    }
    again = run_session(case, initial=design)
    assert again.initial_objectives["acceleration"] == pytest.approx(outcome.objectives["acceleration"], rel=1e-9)
    np.savetxt(tmp_path / "a.txt", design, fmt="%.17g")
    assert read_design(tmp_path / "a.txt", case.n_design, case.space.parts).tolist() == design.tolist()
    other = mdstopo.load_case(CATCH, overrides={"design.variables.damping.each": "member", "design.initial": "0.1"})
    assert read_design(tmp_path / "a.h5", 0, other.space.parts).tolist() == design.tolist()
    with pytest.raises(StoreError, match="holds no values of the design variable more"):
        read_design(tmp_path / "a.h5", 0, {**case.space.parts, "more": slice(4, 5)})


def test_the_catch_keeps_its_displacement_and_comes_near_the_gentlest_there_is():
    case = mdstopo.load_case(CATCH)
    result = mdstopo.optimize(case)
    assert result.constraints[0] >= -1e-6
    assert 16.0 / 1.2 < result.objectives["acceleration"] < 14.2
    tight = mdstopo.load_case(CATCH, overrides={"solver.tolerance": "1e-10"})
    again = mdstopo.evaluate(tight, variables=result.variables)
    assert again.objectives["acceleration"] == pytest.approx(result.objectives["acceleration"], rel=1e-6)
    assert again.constraints[0] >= -1e-6


def test_random_starts_of_values_are_anywhere_between_their_bounds():
    from mdstopo.engine import Evaluator
    from mdstopo.optimizer.start_families import random_feasible

    problem = Evaluator(mdstopo.load_case(CATCH)).problem()
    draws = np.array([random_feasible(problem, 0, index) for index in range(1, 400)])
    assert np.abs(draws.mean(axis=0) - 0.5).max() < 0.06


def test_methods_without_derivatives_by_parameters_are_refused():
    case = mdstopo.load_case(CATCH)
    with pytest.raises(mdstopo.CaseError, match="iterative gives no derivatives by parameters of laws"):
        mdstopo.evaluate(case, method="iterative")
    with pytest.raises(mdstopo.CaseError, match="constant_load gives no derivatives by parameters of laws"):
        mdstopo.evaluate(mdstopo.load_case(CATCH, overrides={"solver.sensitivity": "constant_load"}))
    with pytest.raises(mdstopo.CaseError, match="gauss does not compute the law gap"):
        mdstopo.evaluate(mdstopo.load_case(CATCH, overrides={"solver.integrator": "gauss"}))


def test_values_that_are_none_are_refused():
    case = mdstopo.load_case(CATCH)
    with pytest.raises(ValueError, match="no design variable 'stifness'; there are stiffness, slack"):
        mdstopo.evaluate(case, variables={"stifness": 1})
    with pytest.raises(ValueError, match="stiffness has 1 values"):
        mdstopo.evaluate(case, variables={"stiffness": [1.0, 2.0]})
    with pytest.raises(ValueError, match="values of variables must be finite"):
        mdstopo.evaluate(case, variables={"stiffness": np.nan})
