"""Designs as evaluations take them: which are refused, and what their volume rows are."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mdstopo.case.reader import load_case
from mdstopo.engine import Evaluator
from mdstopo.scene.design import Design
from tests.engine.scenes import CASES, interior, paper, random_design


def test_volume_rows_are_sums_over_all_members_less_their_bounds():
    case = paper("fig6")
    rng = np.random.default_rng(3)
    rows = tuple(replace(case.constraints[0], coefficients=rng.uniform(0.1, 2.0, 1020), bound=b) for b in (102.0, 0.5))
    alpha = random_design(case, 3)
    found = Evaluator(replace(case, constraints=rows)).evaluate(alpha, gradient=False)
    for row, excess, slope in zip(rows, found.constraints, found.constraint_gradients, strict=True):
        total = math.fsum(c * a for c, a in zip(row.coefficients, alpha, strict=True))
        assert excess == pytest.approx(total - row.bound, rel=1e-13)
        assert np.array_equal(slope, row.coefficients)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf, -1e-300])
@pytest.mark.parametrize("place", [0, 517, 1019])
def test_one_wrong_number_is_found_wherever_it_stands(place, wrong):
    design = Design(paper("fig6"))
    alpha = np.full(1020, 0.1)
    alpha[place] = wrong
    with pytest.raises(ValueError, match=rf"alpha must be finite and at least 0; alpha\[{place}\] is {wrong}"):
        design.take(alpha)


def test_zeros_of_either_sign_are_designs():
    design = Design(paper("fig6"))
    assert np.array_equal(design.take(np.full(1020, -0.0)), np.zeros(1020))
    assert design.excess == pytest.approx([-102.0])


def test_values_of_variables_have_any_sign_but_are_finite():
    case = load_case(CASES / "catch.yaml")
    design = Design(case)
    whole = case.start.copy()
    whole[case.n_design :] *= -1.0
    assert np.array_equal(design.take(whole), whole)
    assert np.array_equal(design.take(whole[: case.n_design]), case.start)
    whole[-1] = -np.inf
    with pytest.raises(ValueError, match="values of variables must be finite"):
        design.take(whole)


def test_constraints_outlive_the_next_evaluation():
    evaluator = Evaluator(paper("fig6"))
    first = evaluator.evaluate(np.full(1020, 0.1))
    kept = first.constraints.copy()
    assert evaluator.evaluate(np.full(1020, 0.2)).constraints[0] > kept[0] + 1.0
    assert np.array_equal(first.constraints, kept)


def test_values_of_variables_outlive_the_next_evaluation():
    case = load_case(CASES / "catch.yaml")
    evaluator = Evaluator(case)
    first = evaluator.evaluate(case.start, gradient=False)
    other = case.start.copy()
    other[case.n_design :] *= 1.01
    evaluator.evaluate(other, gradient=False)
    assert np.array_equal(np.concatenate(list(first.variables.values())), case.start[case.n_design :])


def test_the_first_evaluation_is_of_its_own_design_where_the_step_is_found_with_the_initial_one():
    case = interior(integrator="generalized_alpha", tolerance=1e-3)
    evaluator = Evaluator(case)
    alpha = random_design(case, 5)
    assert not np.array_equal(alpha, case.initial)
    first, second = evaluator.evaluate(alpha), evaluator.evaluate(alpha)
    assert first.objectives == second.objectives
    assert np.array_equal(first.gradients["G"], second.gradients["G"])
    assert np.array_equal(first.constraints, second.constraints)
