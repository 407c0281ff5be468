"""A bushing that only damps turning damps all the same, in the motion and in its derivatives."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case

CASE = """
format: 1
time: {{end: 0.5}}
bodies: {{a: {{mass: 2, inertia: 0.3, position: [0.4, 0], velocity: [0, 1.2], angular_velocity: 3}}}}
joints: [{{type: revolute, bodies: [a, ground], at: [0, 0]}}]
bushings: [{{bodies: [a, ground], at: [0, 0], stiffness: [0, 0, {stiffness}], damping: [0, 0, {damping}]}}]
members:
  s: {{from: {{body: ground, at: [0.4, -1]}}, to: {{body: a, at: [0.7, 0]}}, law: {{type: spring, stiffness: 300}}}}
design: {{initial: 0.7}}
objectives: {{turn: {{response: {{angular_velocity: {{body: a}}}}, over_time: final}}}}
solver: {{integrator: {integrator}, tolerance: 1e-9{step}}}
"""


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_its_gradient_is_that_of_differences(integrator: str) -> None:
    step = ", step: 0.005" if integrator == "generalized_alpha" else ""
    case = read_case(CASE.format(stiffness=0, damping=4, integrator=integrator, step=step))
    found = mdstopo.evaluate(case)
    size = 1e-4
    ends = [
        mdstopo.evaluate(case, found_at, gradient=False).objectives["turn"]
        for found_at in (np.array([0.7 - size]), np.array([0.7 + size]))
    ]
    free = mdstopo.evaluate(read_case(CASE.format(stiffness=0, damping=0, integrator=integrator, step=step)))
    assert abs(found.objectives["turn"] - free.objectives["turn"]) > 0.1  # it does damp
    assert found.gradients["turn"][0] == pytest.approx((ends[1] - ends[0]) / (2 * size), rel=1e-5)
