"""The inerter adds to the mass matrix: closed forms. Its gradients are checked with all others (test_gradients)."""

import numpy as np
import pytest

import mdstopo
from tests.general.support import load, simulate_text

OSCILLATOR = """
format: 1
time: {{end: 2}}
bodies: {{mass: {{mass: 2, inertia: 1, position: [0, 1], velocity: [0, 0.3]}}}}
motions:
  - {{body: mass, x: {{velocity: 0}}, angle: {{velocity: 0}}}}
members:
  both:
    from: {{body: ground, at: [0, 0]}}
    to: {{body: mass, at: [0, 1]}}
    law: [{{type: spring, stiffness: 50}}, {{type: inerter, inertance: {b}}}]
"""


@pytest.mark.parametrize("b", [0.0, 0.5, 6.0])
def test_an_inerter_slows_the_vibration_like_a_mass(b):
    motion = simulate_text(OSCILLATOR.format(b=b), tolerance=1e-11)
    omega = np.sqrt(50.0 / (2.0 + b))
    t = np.linspace(0.0, 2.0, 21)
    assert motion.at(t).q[:, 1] - 1.0 == pytest.approx(0.3 / omega * np.sin(omega * t), abs=1e-10)


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_inerters_between_moving_bodies_keep_momentum(integrator):
    text = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 2, inertia: 0.3, position: [0, 0], velocity: [1, 0.5], angular_velocity: 2}
  b: {mass: 1, inertia: 0.1, position: [1, 0.2], velocity: [-0.5, 0.2], angular_velocity: -1}
points:
  p: {body: a, grid: {list: [[0.1, 0.2], [0.2, -0.1]]}}
  q: {body: b, grid: {list: [[0.9, 0.1], [1.1, 0.3]]}}
members:
  m: {from: p, to: q, law: {type: inerter, inertance: 1.5}}
"""
    motion = simulate_text(text, integrator=integrator)
    q, v = motion.q.reshape(-1, 2, 3), motion.v.reshape(-1, 2, 3)
    mass = np.array([2.0, 1.0])
    linear = np.einsum("b,tbi->ti", mass, v[:, :, :2])
    assert np.abs(linear - linear[0]).max() <= 1e-12
    spin = v[:, :, 2] @ np.array([0.3, 0.1]) + np.einsum(
        "b,tb->t", mass, q[:, :, 0] * v[:, :, 1] - q[:, :, 1] * v[:, :, 0]
    )
    tolerance = 1e-9 if integrator == "runge_kutta" else 1e-4
    assert np.abs(spin - spin[0]).max() <= tolerance * np.abs(spin[0])


def test_natural_frequencies_count_it_as_mass():
    from mdstopo.case.reader import read_case
    from mdstopo.engine import Evaluator

    case = read_case(OSCILLATOR.format(b=3.0))
    found = Evaluator(case).natural_frequencies(np.zeros(0) if case.n_design == 0 else np.ones(1), "default")
    assert found == pytest.approx([np.sqrt(50.0 / 5.0)], rel=1e-9)
    assert mdstopo.evaluate(load("everything")).status.ok
