"""Rotors that turn many times in what could be one step: whole turns count, although orientations do not tell them."""

from __future__ import annotations

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case

#: rad/s of the rotor: 20 turns in the 0.1 s in which nothing else happens, before the frame is pushed
RATE = 400.0 * np.pi
GYROSCOPE = """
format: 1
dimension: 3
time: {end: 0.12}
bodies:
  frame: {mass: 12, inertia: [0.5, 0.3, 0.4], position: [0, 0, 0]}
  rotor: {mass: 40, inertia: [0.55, 0.55, 0.9], position: [0, 0, 0], angular_velocity: [0, 0, "=400*pi"]}
joints:
  - {type: universal, bodies: [ground, frame], at: [0, 0, 0], axes: [[1, 0, 0], [0, 1, 0]]}
  - {type: revolute, bodies: [frame, rotor], at: [0, 0, 0], axis: [0, 0, 1]}
points:
  ring:
    body: frame
    grid: {circle: {center: [0, 0, -0.1], radius: 0.25, normal: [0, 0, 1], start: [1, 0, 0], count: 6}}
  floor:
    body: ground
    grid: {circle: {center: [0, 0, -0.3], radius: 0.4, normal: [0, 0, 1], start: [1, 0, 0], count: 6}}
members:
  struts: {from: ring, to: floor, max_length: 0.45, law: {type: spring, stiffness: 2.0e5, damping: 800}}
loads:
  - {body: frame, moment: {table: [[0, 0, 0, 0], [0.1, 0, 0, 0], [0.1, 30, 0, 0]]}}
objectives: {tilted: {response: {tilt: {body: frame}}, over_time: max}}
"""


@pytest.mark.parametrize("share", [0.3, 0.39, 0.4, 0.400001])
def test_a_gyroscope_that_has_spun_before_the_push_tilts_as_one_that_has_not(share: float) -> None:
    spun, pushed = read_case(GYROSCOPE), read_case(GYROSCOPE, overrides={"time.start": 0.1})
    alpha = np.full(spun.n_design, share)
    one, other = mdstopo.evaluate(spun, alpha), mdstopo.evaluate(pushed, alpha)
    assert other.objectives["tilted"] == pytest.approx(5e-4, rel=0.1)  # rad, a tilt that is there to be missed
    assert one.objectives["tilted"] == pytest.approx(other.objectives["tilted"], rel=1e-6)
    largest = np.abs(other.gradients["tilted"]).max()
    assert np.abs(one.gradients["tilted"] - other.gradients["tilted"]).max() < 1e-5 * largest


def test_no_step_turns_a_rotor_by_much_more_than_a_radian() -> None:
    case = read_case(GYROSCOPE)
    for share in (0.3, 0.39, 0.4, 0.400001):
        steps = np.diff(mdstopo.simulate(case, np.full(case.n_design, share)).t)
        assert RATE * steps.max() < 1.2
