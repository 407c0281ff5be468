"""Curves in motion: steps end at their knots, so values and gradients keep the tolerance."""

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.case.reader import read_case
from tests.general.support import slopes

#: two members whose forces have second derivatives that jump at every knot that they pass
CURVES = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0.3]}}
members:
  g:
    from: {body: ground, at: [-2, 0]}
    to: {body: a, at: [0, 0]}
    law: {type: curve, curve: [[-2, -40], [-0.5, -9], [-0.1, -1], [0, 0], [0.05, 1], [0.2, 6], [2, 30]]}
  h:
    from: {body: ground, at: [0, -2]}
    to: {body: a, at: [0, 0.1]}
    law: {type: curve, curve: [[-2, -20], [-0.3, -9], [0.1, 2], [2, 30]]}
design: {initial: 0.8}
objectives:
  X: {response: {displacement: {body: a, component: x}}, over_time: final}
  E: {response: energy, over_time: max}
  M: {response: {displacement: {body: a, component: x}}, over_time: mean}
combine: {weights: {X: 1, E: 1, M: 1}}
solver: {integrator: runge_kutta}
"""


@pytest.mark.parametrize("alpha", [[0.8, 0.7], [0.5, 0.9]])
def test_gradients_of_curves_keep_the_tolerance(alpha):
    """At the default tolerance they were off by 39 millionths where steps passed over the knots."""
    alpha, direction = np.array(alpha), np.array([0.6, -0.3])
    tight = read_case(CURVES, overrides={"solver.tolerance": 1e-12})
    found, better = evaluate(read_case(CURVES), alpha), evaluate(tight, alpha, gradient=False)
    for name, slope in slopes(tight, alpha, direction, 1e-4).items():
        assert found.objectives[name] == pytest.approx(better.objectives[name], rel=1e-8)
        gradient = found.gradients[name]
        assert abs(gradient @ direction - slope) < 1e-7 * np.abs(gradient).max(), name


def test_a_body_that_rests_on_a_knot_stays_there():
    """No force, no motion, and no events by rounding."""
    text = CURVES.replace("velocity: [1, 0.3]", "velocity: [0, 0]").replace("[0.1, 2]", "[0, 0]")
    found = evaluate(read_case(text))
    assert found.status.ok
    assert found.objectives["X"] == 0.0
    assert found.work["steps"] < 10
