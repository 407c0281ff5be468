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


#: a crate that is thrown onto a ground with friction: its corners meet it one after the other, a belt becomes taut
THROWN = """
format: 1
gravity: [0, -9.81]
time: {end: 0.3}
bodies:
  crate: {mass: 2, inertia: 0.3, position: [0, 0.3], velocity: [1, -1], angular_velocity: 0.8}
points:
  corners: {body: crate, grid: {list: [[-0.3, 0.1], [0.3, 0.15]]}}
contacts:
  - points: corners
    on: {body: ground, from: [-2, 0], to: [2, 0]}
    stiffness: 3000
    damping: 10
    friction: 0.3
    slip: 0.1
members:
  belt:
    from: {body: ground, at: [-0.6, 1]}
    to: {body: crate, at: [0, 0.5]}
    law: {type: gap, stiffness: 600, gap: 0.05}
  spring:
    from: {body: ground, at: [0.8, 0.9]}
    to: {body: crate, at: [0.2, 0.3]}
    law: {type: spring, stiffness: 200, damping: 3}
design: {initial: 0.7}
objectives:
  height: {response: {displacement: {body: crate, component: y}}, over_time: final}
  speed: {response: {velocity: {body: crate, component: x}}, over_time: final}
  energy: {response: energy, over_time: mean}
combine: {weights: {height: 1, speed: 1, energy: 1}}
"""


def quantities(scene=LOOP, **solver):
    """Final q, v, a, multipliers; objectives; gradients."""
    case = read_case(scene, overrides={f"solver.{key}": str(value) for key, value in solver.items()})
    motion, found = mdstopo.simulate(case), mdstopo.evaluate(case)
    assert motion.status.ok
    lam = {"lambda": motion.lam[-1]} if case.joints else {}
    return {
        "q": motion.q[-1],
        "v": motion.v[-1],
        "a": motion.a[-1],
        **lam,
        **{name: np.array([value]) for name, value in found.objectives.items()},
        **{f"d {name}": gradient for name, gradient in found.gradients.items()},
    }


@pytest.fixture(scope="module")
def reference():
    return quantities(tolerance=1e-12)


def orders(steps, reference, scene=LOOP, **solver):
    """The order of each quantity: how its error falls with the step, on logarithmic axes."""
    errors = {name: [] for name in reference}
    for step in steps:
        for name, value in quantities(scene, step=step, **solver).items():
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


def test_impacts_and_friction_cost_generalized_alpha_no_order():
    reference = quantities(THROWN, tolerance=1e-12)
    found = orders([0.002, 0.001, 0.0005, 0.00025], reference, THROWN, integrator="generalized_alpha")
    for name in ("q", "v", "d height", "d speed", "d energy"):
        assert found[name] == pytest.approx(2.0, abs=0.1), name


def test_impacts_and_friction_cost_runge_kutta_no_order():
    reference = quantities(THROWN, tolerance=1e-12)
    found = orders([0.01, 0.005, 0.0025, 0.00125], reference, THROWN, integrator="runge_kutta")
    for name in ("q", "v", "d height", "d speed", "d energy"):
        assert found[name] >= 7.5, name
