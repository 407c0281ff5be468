"""Sweeps over steps that keep relative poses and sums over members, against those that keep stiffness matrices."""

from __future__ import annotations

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.general.driver.general_driver import GeneralDriver

#: springs between bodies, to ground and to a body that is moved, with two rows that are pulled back at once
SCENE = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.2}
bodies:
  one: {mass: 2, inertia: [1, 2, 1.5], position: [0.5, 0, 0], velocity: [0, 0.25, 1], angular_velocity: [1, -2, 0.5]}
  two: {mass: 1, inertia: [[0.1, 0.02, 0], [0.02, 0.1, 0], [0, 0, 0.12]], position: [1.2, 0.3, 0.1]}
  hand: {mass: 1, inertia: [1, 1, 1], position: [0.5, 1, 0.5]}
joints:
  - {type: spherical, bodies: [ground, one], at: [0, 0, 0]}
motions:
  - {body: hand, x: {velocity: {table: [[0, 0], [0.1, 1], [0.2, 0]]}}}
points:
  a: {body: one, grid: {line: {from: [0.2, 0.1, 0], to: [0.8, -0.1, 0.1], count: 3}}}
  b: {body: two, grid: {line: {from: [1, 0.1, 0.2], to: [1.4, 0.4, 0], count: 3}}}
  c: {body: hand, grid: {list: [[0.4, 1, 0.4], [0.7, 0.9, 0.6]]}}
  d: {body: ground, grid: {list: [[1, -1, 1], [2, 1, 0]]}}
members:
  between: {from: a, to: b, law: {type: spring, stiffness: 60}}
  held: {from: c, to: b, law: {type: spring, stiffness: 40}}
  moored: {from: d, to: a, law: {type: spring, stiffness: 30}}
design: {initial: 0.5}
solver: {integrator: runge_kutta, tolerance: 1e-9}
combine: {method: weighted_sum, weights: {energy: 1, away: 1}}
objectives:
  energy: {response: energy, over_time: final}
  away: {response: {displacement: {body: two, component: norm}}, over_time: final}
"""


def test_gradients_are_those_of_kept_stiffness_matrices(monkeypatch: pytest.MonkeyPatch) -> None:
    case = read_case(SCENE)
    alpha = np.random.default_rng(5).uniform(0.2, 0.9, case.n_design)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, alpha, method="direct")
    monkeypatch.setattr(GeneralDriver, "_keeps_poses", False)
    formed = mdstopo.evaluate(case, alpha)
    assert formed.objectives == found.objectives
    for name, gradient in found.gradients.items():
        size = np.abs(gradient).max()
        assert size > 0.0
        assert np.abs(formed.gradients[name] - gradient).max() < 1e-12 * size, name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-11 * size, name
