"""Fits of bodies in space: derivatives through an impact against differences, and the truth found in noise."""

from __future__ import annotations

import numpy as np
import pytest

from mdstopo.fit.fit_problem import FitProblem
from mdstopo.fit.least_squares import fitted
from mdstopo.fit.statistics import statistics

from .scenes import measured, problem_of
from .test_derivatives import check

#: an arm that hangs at a ball joint, turns about all axes, and meets a stop beside its middle plane, twice
ARM = """
format: 1
dimension: 3
define: {spin: 0.5, m: 2}
gravity: [0, -9.81, 0]
time: {end: 0.6}
bodies:
  arm:
    mass: "=m"
    inertia: [0.2, 0.3, 0.25]
    position: [0.4, 0, 0]
    velocity: [0, "=0.4 * spin", -0.12]
    angular_velocity: [1.5, 0.3, "=spin"]
joints:
  - {name: ball, type: spherical, bodies: [ground, arm], at: [0, 0, 0]}
members:
  stop:
    {from: {body: ground, at: [0.8, -1, 0.1]}, to: {body: arm, at: [0.8, 0, 0.1]}, design: false,
     law: {type: gap, stiffness: 4000, damping: 8, gap: 0.06, side: compression}}
solver: {tolerance: 1.e-11}
fit:
  estimate:
    members.stop.law.stiffness: {lower: 1000, upper: 9000, initial: 3600}
    members.stop.law.gap: {lower: 0.01, upper: 0.1, initial: 0.05}
    bodies.arm.inertia[2]: {lower: 0.15, upper: 0.45, initial: 0.22}
    bodies.arm.angular_velocity[0]: {lower: 0, upper: 3, initial: 1.3}
    define.spin: {lower: 0, upper: 1, initial: 0.4}
    define.m: {lower: 1, upper: 4, initial: 1.9}
  measured:
    lift: {file: a.csv, response: {displacement: {body: arm, component: y, at: [0.8, 0, 0.1]}}, deviation: 0.0005}
    turn: {file: b.csv, response: {angular_velocity: {body: arm, component: x}}, deviation: 0.01}
    ball: {file: c.csv, response: {joint_force: {joint: ball}}, deviation: 0.5}
"""
TRUTH = np.array([4000.0, 0.06, 0.25, 1.5, 0.5, 2.0])
TIMES = np.linspace(0.02, 0.58, 24)


@pytest.fixture(scope="module")
def arm() -> FitProblem:
    return problem_of(ARM, dict.fromkeys(("lift", "turn", "ball"), TIMES))


def test_derivatives_through_an_impact_are_those_of_differences(arm: FitProblem) -> None:
    assert set(arm.derivatives) == {"exact"}
    check(arm, TRUTH)


def test_the_truth_is_found_in_noise(arm: FitProblem) -> None:
    problem = measured(arm, TRUTH, 1)
    found = fitted(problem, problem.initial)
    told = statistics(problem, found)
    assert found.status == "converged"
    assert np.all((told.low < TRUTH) & (told.high > TRUTH))
    assert np.all(told.deviation < 0.1 * TRUTH)
    assert problem.simulations < 40
