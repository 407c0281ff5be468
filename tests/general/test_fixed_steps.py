"""What a step of generalized-alpha leaves behind where it is looked at for a switch and no member has one."""

import numpy as np

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Evaluation

#: a pendulum on two springs, with a member that acts from an elongation of GAP on
CASE = """
format: 1
gravity: [0, -9.8]
time: {end: 1}
solver: {integrator: generalized_alpha, step: 0.02}
bodies: {rod: {mass: 1, inertia: 0.1, position: [0.5, 0]}}
joints:
  - {type: revolute, bodies: [ground, rod], at: [0, 0]}
members:
  spring: {from: {body: ground, at: [1, 1]}, to: {body: rod, at: [1, 0]}, law: {type: spring, stiffness: 50}}
  stay: {from: {body: ground, at: [0, 1]}, to: {body: rod, at: [0.5, 0]}, law: {type: spring, stiffness: 30}}
  rope: {from: {body: ground, at: [0.3, 1.2]}, to: {body: rod, at: [0.9, 0]}, law: {type: gap, stiffness: 9, gap: GAP}}
objectives:
  speed: {response: {velocity: {body: rod, component: y}}, over_time: final}
"""


def evaluated(gap: float) -> tuple[Evaluation, float]:
    """The evaluation, and the largest elongation of the rope at the ends of steps."""
    case = read_case(CASE.replace("GAP", repr(gap)))
    evaluator = Evaluator(case)
    found = evaluator.evaluate(case.start)
    assert found.status.ok
    steps = evaluator.driver("default").simulate(case.start)[1]
    x, y, turn = steps.q[:, :3].T
    end = np.array([0.5 + x + 0.4 * np.cos(turn), y + 0.4 * np.sin(turn)])
    length = np.hypot(*(end - np.array([[0.3], [1.2]])))
    return found, float((length - length[0]).max())


def test_a_member_that_comes_near_its_switch_and_has_none_changes_no_gradient() -> None:
    far, longest = evaluated(5.0)
    near, same = evaluated(longest * (1.0 + 1e-6))
    assert same == longest
    assert near.work != far.work  # the step was cut where it is nearest, and looked at
    assert near.objectives["speed"] == far.objectives["speed"]
    np.testing.assert_array_equal(near.gradients["speed"], far.gradients["speed"])
