"""Variables that are small numbers, as areas in square metres are: a run of them is the run of the same in shares."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.optimizer.gsao import Gsao
from mdstopo.optimizer.interface import run
from mdstopo.optimizer.problem import LinearRows, scale_of
from mdstopo.settings.optimizer_presets import settings
from mdstopo.status import RunStatus

from .test_wide import Many
from .toys import compliance_problem, shaken_block, two_peaks

#: a square millimetre, nearly: a power of two, of which rounding does not take anything
SMALL = 2.0**-20


class Scaled:
    """A problem whose variables are told as so much smaller numbers."""

    def __init__(self, problem, scale):
        self.problem, self.scale = problem, scale
        self.initial, self.lower, self.upper = scale * problem.initial, scale * problem.lower, scale * problem.upper
        linear = problem.linear
        self.linear = LinearRows(linear.A / scale, linear.b, linear.equal)
        for name in ("competes", "smooth", "even", "competitors"):
            if hasattr(problem, name):
                setattr(self, name, getattr(problem, name))

    def evaluate(self, x, gradient=True):
        sample = self.problem.evaluate(x / self.scale, gradient)
        return replace(
            sample,
            gradients=sample.gradients / self.scale,
            constraint_gradients=sample.constraint_gradients / self.scale,
        )


def limited(problem):
    """The same with a limit on the first variables, whose rows compete from the start."""
    n = len(problem.initial)

    def most(x):
        slope = np.zeros((1, n))
        slope[0, :3] = 2.0 * x[:3]
        return np.array([x[:3] @ x[:3] - 0.1]), slope

    problem.constraints = most
    problem.competes = True
    return problem


PROBLEMS = {
    "separable": lambda: compliance_problem()[0],
    "peaks": lambda: two_peaks()[0],
    "limits": lambda: limited(two_peaks()[0]),
    "smooth": lambda: shaken_block(12, 0.4),
    "many": lambda: Many(1, False),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_run_of_small_variables_is_that_of_the_same_in_shares(name):
    """The residual was measured in units of the variables, so that any design of millionths was an optimum."""
    chosen = settings(max_iterations=60)
    expected = run(Gsao(PROBLEMS[name](), chosen))
    found = run(Gsao(Scaled(PROBLEMS[name](), SMALL), chosen))
    assert expected.evaluations > 3
    assert found.status is expected.status
    assert found.best_objective == pytest.approx(expected.best_objective, rel=1e-9)
    assert found.history.kkt[0] == pytest.approx(expected.history.kkt[0], rel=1e-6)
    assert found.best_alpha / SMALL == pytest.approx(expected.best_alpha, abs=1e-5)


def test_runs_of_small_variables_that_converge_are_at_the_optimum():
    problem, _, _ = two_peaks()
    ended = run(Gsao(Scaled(problem, SMALL), settings(max_iterations=60)))
    assert ended.status is RunStatus.CONVERGED
    assert ended.best_objective < 0.5 * float(ended.history.objective[0])


def test_moves_are_judged_by_the_largest_bound():
    assert scale_of(np.zeros(3), np.array([2e-6, 1e-6, 0.0])) == 2e-6
    assert scale_of(np.array([-0.5]), np.array([0.2])) == 0.5
    assert scale_of(np.zeros(2), np.array([1.0, 9.0])) == 1.0
    assert scale_of(np.zeros(2), np.zeros(2)) == 1.0
