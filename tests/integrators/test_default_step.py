"""The default step of generalized-alpha keeps the tolerance, for the design it was measured on and for others."""

from pathlib import Path

import numpy as np
import pytest

from mdstopo.case.reader import load_case
from mdstopo.engine import Evaluator

FIG6 = Path(__file__).parents[2] / "cases" / "fig6.yaml"


@pytest.fixture(scope="module")
def exact():
    return Evaluator(load_case(FIG6, overrides={"solver.integrator": "gauss", "solver.tolerance": 1e-10}))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-6])
def test_errors_stay_below_ten_tolerances(exact, tolerance):
    overrides = {"solver.integrator": "generalized_alpha", "solver.tolerance": tolerance}
    evaluator = Evaluator(load_case(FIG6, overrides=overrides))
    for alpha in (np.full(1020, 0.1), np.random.default_rng(7).uniform(0.01, 1.0, 1020)):
        truth, found = exact.evaluate(alpha), evaluator.evaluate(alpha)
        assert abs(found.objectives["G"] / truth.objectives["G"] - 1.0) <= 10 * tolerance
        largest = np.abs(truth.gradients["G"]).max()
        assert np.abs(found.gradients["G"] - truth.gradients["G"]).max() <= 10 * tolerance * largest


def test_a_stated_step_is_taken_as_it_is():
    overrides = {"solver.integrator": "generalized_alpha", "solver.step": 0.01}
    evaluator = Evaluator(load_case(FIG6, overrides=overrides))
    assert evaluator.evaluate(np.full(1020, 0.1)).work["steps"] == 20
