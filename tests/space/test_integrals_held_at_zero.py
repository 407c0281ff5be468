"""Integrals over time of what joints hold at zero in space: rounding asks for no shorter steps."""

from __future__ import annotations

import pytest

from mdstopo import evaluate
from mdstopo.case.reader import read_case
from mdstopo.evaluation import Evaluation

#: two bodies that are fixed to each other, on a joint with an axis that is no axis of coordinates
HELD = """
format: 1
dimension: 3
gravity: [0.3, -9.81, 1.1]
time: {end: 0.5}
bodies:
  a: {mass: 1.3, inertia: [0.2, 0.31, 0.4], position: [0.5, 0.1, -0.2], orientation: {axis: [1, 2, 3], angle: 0.7}}
  b: {mass: 2, inertia: [0.5, 0.5, 0.5], position: [1.5, 0.2, 0.3], orientation: {axis: [0, 2, 3], angle: 0.9}}
joints:
  - {name: j, type: JOINT, bodies: [ground, a], at: [0, 0, 0], axis: [1, 0.4, -0.2]}
  - {type: fixed, bodies: [a, b]}
points:
  p: {body: a, grid: {list: [[0.1, 0.3, 0.1], [0.7, 0.2, 0]]}}
  q: {body: b, grid: {list: [[1.4, 0.5, 0.3], [1.9, -0.3, 0.1]]}}
members:
  g: {from: p, to: q, law: {type: spring, stiffness: 60, damping: 1}}
  s: {from: {body: ground, at: [0.5, -1, 0.4]}, to: {body: b, at: [1.5, 0.2, 0.3]}, law: {type: spring, stiffness: 90}}
design: {initial: 1}
objectives:
  U: {response: {displacement: {body: b, component: x}}, over_time: rms}
  X: {response: RESPONSE, over_time: mean}
combine: {weights: {U: 1, X: 1}}
solver: {tolerance: TOLERANCE}
"""
RESPONSES = {
    "prismatic": (
        "{member_force: {group: g}}",
        "{angular_velocity: {body: b}}",
        "{angular_acceleration: {body: b}}",
        "{velocity: {body: b, relative_to: a}}",
    ),
    "revolute": (
        "{member_force: {group: g}}",
        "{displacement: {body: b, relative_to: a}}",
        "{displacement: {body: b, relative_to: a, component: y}}",
        "{velocity: {body: b, relative_to: a}}",
        "{acceleration: {body: b, relative_to: a}}",
        "{acceleration: {body: b, relative_to: a, component: y}}",
    ),
}


def found(joint: str, response: str, tolerance: float) -> Evaluation:
    text = HELD.replace("JOINT", joint).replace("RESPONSE", response).replace("TOLERANCE", repr(tolerance))
    return evaluate(read_case(text), gradient=False)


@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-11])
@pytest.mark.parametrize(("joint", "response"), [(joint, each) for joint, some in RESPONSES.items() for each in some])
def test_the_mean_of_what_joints_hold_at_zero_takes_no_more_steps(joint: str, response: str, tolerance: float) -> None:
    """The means of forces and accelerations ended after a million steps, without a value."""
    held, moving = found(joint, response, tolerance), found(joint, "{displacement: {body: b}}", tolerance)
    assert held.status.ok, held.message
    assert held.work["steps"] <= moving.work["steps"]
    assert abs(held.objectives["X"]) <= 1e3 * tolerance


@pytest.mark.parametrize("joint", RESPONSES)
def test_what_joints_leave_free_is_followed(joint: str) -> None:
    """The mean of a velocity whose norm nothing holds is that of short steps."""
    response = "{velocity: {body: b}}"
    one, two = found(joint, response, 1e-7), found(joint, response, 1e-11)
    assert one.objectives["X"] == pytest.approx(two.objectives["X"], rel=1e-7)
    assert two.objectives["X"] > 0.1
