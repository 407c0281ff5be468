"""Convergence orders on a closed loop with damping and a driven base: motion, multipliers, responses, gradients."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case

LOOP = """
format: 1
gravity: [0, -9.81]
time: {end: 0.5}
bodies:
  crank: {mass: 1, inertia: 0.1, position: [0.25, 0.3]}
  rod: {mass: 2, inertia: 0.3, position: [1, 0.5]}
  rocker: {mass: 1.5, inertia: 0.2, position: [1.55, 0.2]}
joints:
  - {name: a, type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {name: b, type: revolute, bodies: [crank, rod], at: [0.5, 0.6]}
  - {name: c, type: revolute, bodies: [rod, rocker], at: [1.5, 0.4]}
  - {name: d, type: revolute, bodies: [rocker, base], at: [1.6, 0]}
motions:
  - {body: base, x: {acceleration: {table: [[0, 0], [0.5, 6]]}}, y: {velocity: 0}, angle: {velocity: 0}}
members:
  s:
    from: {body: ground, at: [0.2, 1.5]}
    to: {body: rod, at: [1, 0.7]}
    law: {type: spring, stiffness: 60, damping: 4}
  r:
    from: {body: base, at: [2.5, 0.5]}
    to: {body: rocker, at: [1.5, 0.3]}
    law: {type: spring, stiffness: 90, damping: 2}
design: {initial: 0.7}
objectives:
  angle: {response: {angle: {body: rod}}, over_time: final}
  acceleration: {response: {acceleration: {body: rod, at: [1.2, 0.5]}}, over_time: final}
  force: {response: {joint_force: {joint: c}}, over_time: final}
  mean: {response: {velocity: {body: rod, relative_to: base}}, over_time: mean}
combine: {weights: {angle: 1, acceleration: 1, force: 1, mean: 1}}
"""
LOOP = LOOP.replace("joints:\n", "  base: {mass: 4, inertia: 1, position: [1.8, 0]}\njoints:\n", 1)


def quantities(**solver):
    """Final q, v, a, multipliers; objectives; gradients."""
    case = read_case(LOOP, overrides={f"solver.{key}": str(value) for key, value in solver.items()})
    motion, found = mdstopo.simulate(case), mdstopo.evaluate(case)
    assert motion.status.ok
    return {
        "q": motion.q[-1],
        "v": motion.v[-1],
        "a": motion.a[-1],
        "lambda": motion.lam[-1],
        **{name: np.array([value]) for name, value in found.objectives.items()},
        **{f"d {name}": gradient for name, gradient in found.gradients.items()},
    }


@pytest.fixture(scope="module")
def reference():
    return quantities(tolerance=1e-12)


def orders(steps, reference, **solver):
    errors = {name: [] for name in reference}
    for step in steps:
        for name, value in quantities(step=step, **solver).items():
            errors[name].append(np.abs(value - reference[name]).max())
    return {name: np.polyfit(np.log(steps), np.log(error), 1)[0] for name, error in errors.items()}


def test_everything_is_of_second_order_with_generalized_alpha(reference):
    found = orders([0.002, 0.001, 0.0005, 0.00025], reference, integrator="generalized_alpha")
    for name, order in found.items():
        assert order == pytest.approx(2.0, abs=0.1), name


def test_joints_cost_runge_kutta_no_order(reference):
    found = orders([0.0625, 0.05, 0.04, 0.03125], reference, integrator="runge_kutta")
    for name, order in found.items():
        assert order >= 7.5, name


def test_the_diagonally_implicit_method_is_of_fourth_order(reference):
    found = orders([0.02, 0.0125, 0.01, 0.00625], reference, integrator="esdirk")
    for name, order in found.items():
        assert order == pytest.approx(4.0, abs=0.3), name
