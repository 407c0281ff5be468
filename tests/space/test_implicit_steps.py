"""generalized_alpha in space: its order on a closed loop, and its derivatives by every method."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.reader import read_case
from tests.general.support import check_adjoint, design_of

from .support import CASES, load

#: a crank and a rocker whose axes are skew, with a rod between them on a ball and a cross
LOOP = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.4}
bodies:
  crank: {mass: 1, inertia: [0.03, 0.05, 0.04], position: [0, 0.2, 0.1], orientation: {axis: [1, 0, 1], angle: 0.3}}
  rod: {mass: 2, inertia: [[0.3, 0.02, 0], [0.02, 0.1, 0.01], [0, 0.01, 0.3]], position: [0.5, 0.5, 0.3]}
  rocker: {mass: 1.5, inertia: [0.1, 0.07, 0.08], position: [1, 0.3, 0.3]}
joints:
  - {name: a, type: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [1, 0.1, 0]}
  - {name: b, type: spherical, bodies: [crank, rod], at: [0, 0.4, 0.2]}
  - {name: c, type: universal, bodies: [rod, rocker], at: [1, 0.6, 0.4], axes: [[0, 1, 0.5], [1, 0, 0]]}
  - {name: d, type: revolute, bodies: [rocker, ground], at: [1, 0, 0.1], axis: [0.7, 0.3, -0.2]}
points:
  rim: {body: rod, grid: {list: [[0.4, 0.6, 0.3], [0.6, 0.3, 0.5]]}}
  posts: {body: ground, grid: {list: [[0.3, 1.2, 1], [1.4, 0.8, 1.2], [-0.5, 0.4, -0.8]]}}
members:
  s: {from: rim, to: posts, law: {type: spring, stiffness: 60, damping: 4}}
loads:
  - {body: crank, moment: [6, 1, 2]}
  - {body: rod, force: [3, -2, 4], at: [0.7, 0.5, 0.4], frame: body}
design: {initial: 0.7}
objectives:
  turn: {response: {rotation: {body: rod, component: y}}, over_time: final}
  acceleration: {response: {acceleration: {body: rod, at: [0.6, 0.4, 0.5]}}, over_time: final}
  force: {response: {joint_force: {joint: c}}, over_time: final}
  mean: {response: {angular_velocity: {body: rocker, relative_to: rod, component: x}}, over_time: mean}
combine: {weights: {turn: 1, acceleration: 1, force: 1, mean: 1}}
"""


def quantities(**solver):
    """Final q, v, a, multipliers; objectives; gradients."""
    case = read_case(LOOP, overrides={f"solver.{key}": str(value) for key, value in solver.items()})
    motion, found = mdstopo.simulate(case), mdstopo.evaluate(case)
    assert motion.status.ok, motion.message
    return {
        "q": motion.q[-1],
        "v": motion.v[-1],
        "a": motion.a[-1],
        "lambda": motion.lam[-1],
        **{name: np.array([value]) for name, value in found.objectives.items()},
        **{f"d {name}": gradient for name, gradient in found.gradients.items()},
    }


def test_everything_is_of_second_order() -> None:
    exact = quantities(tolerance=1e-12)
    steps = [0.002, 0.001, 0.0005]
    errors = {name: [] for name in exact}
    for step in steps:
        for name, value in quantities(step=step, integrator="generalized_alpha").items():
            errors[name].append(np.abs(value - exact[name]).max())
    for name, error in errors.items():
        assert np.polyfit(np.log(steps), np.log(error), 1)[0] == pytest.approx(2.0, abs=0.05), name


@pytest.mark.parametrize("name", ["linkage", "laws"])
def test_three_exact_methods_agree(name: str) -> None:
    case = load(name, integrator="generalized_alpha", step=2e-3)
    alpha = design_of(case)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    for method in ("direct", "iterative"):
        other = mdstopo.evaluate(case, alpha, method=method)
        for objective, gradient in found.gradients.items():
            assert np.abs(other.gradients[objective] - gradient).max() <= 1e-9 * np.abs(gradient).max(), objective


def test_gradients_are_the_slopes_of_what_is_computed() -> None:
    """Integrals of norms are left out: steps end at their kinks, whose times move the steps, too."""
    content = yaml.safe_load((CASES / "linkage.yaml").read_text())
    content["solver"] = {"integrator": "generalized_alpha", "step": 2e-3}
    kept = ("tilt", "flat", "peak", "pull", "G")
    content["objectives"] = {name: content["objectives"][name] for name in kept}
    content["combine"]["weights"] = dict.fromkeys(kept, 1)
    check_adjoint(read_case(yaml.safe_dump(content, sort_keys=False)), 1e-4, 1e-8)


def test_through_all_laws_and_events_gradients_are_right_to_the_order_of_the_method() -> None:
    """The time of an event is differentiated as that of the motion: what is off falls with the square of the step."""
    exact = load("laws", tolerance=1e-11)
    alpha = design_of(exact)
    gradients = mdstopo.evaluate(exact, alpha).gradients
    errors = []
    for step in (2e-3, 2.5e-4):
        found = mdstopo.evaluate(load("laws", integrator="generalized_alpha", step=step), alpha).gradients
        errors.append([np.abs(found[name] - each).max() / np.abs(each).max() for name, each in gradients.items()])
    assert np.max(errors[0]) < 0.02
    assert np.median(np.divide(*errors)) > 30.0


def test_the_default_step_keeps_the_tolerance() -> None:
    exact = mdstopo.evaluate(read_case(LOOP, overrides={"solver.tolerance": "1e-11"}))
    solver = {"solver.integrator": "generalized_alpha", "solver.tolerance": "1e-5"}
    found = mdstopo.evaluate(read_case(LOOP, overrides=solver))
    for name, value in exact.objectives.items():
        assert abs(found.objectives[name] - value) <= 1e-4 * abs(value), name
