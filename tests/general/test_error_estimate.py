"""Error estimates of scenes with joints, motions, events and every kind of response."""

from pathlib import Path

import numpy as np
import pytest

import mdstopo
from tests.engine.scenes import with_solver

CASES = sorted((Path(__file__).parent / "cases").glob("*.yaml"))


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8])
def test_estimates_are_within_a_factor_of_ten(path, tolerance):
    case = mdstopo.load_case(path)
    exact = mdstopo.evaluate(with_solver(case, tolerance=1e-12))
    found = mdstopo.evaluate(with_solver(case, tolerance=tolerance), error_estimate=True)
    assert set(found.errors) == set(found.objectives)
    for name, error in found.errors.items():
        value = abs(found.objectives[name] - exact.objectives[name])
        gradient = float(np.abs(found.gradients[name] - exact.gradients[name]).max())
        assert 0.1 * value <= error.value <= 10.0 * value + 1e-14 * abs(exact.objectives[name]), name
        largest = float(np.abs(exact.gradients[name]).max())
        assert 0.1 * gradient <= error.gradient <= 10.0 * gradient + 1e-14 * largest, name
