"""Defined names as design variables in space: inertias, loads, velocities, points and laws follow from them."""

from __future__ import annotations

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from tests.variables.support import differences, whole, widths

SCENE = """
format: 1
dimension: 3
define: {k: 60, h: 2, turn: 1.5, far: 0.4}
gravity: [0, 0, "=-2*h"]
time: {end: 0.4}
bodies:
  b:
    mass: "=h"
    inertia: ["=0.12*h", 0.35, "=0.3 + far/2"]
    position: [0, 0, 1]
    velocity: [0.2, "=turn/5", 0]
    angular_velocity: ["=turn", 0.5, "=-turn^2"]
points:
  p: {body: b, grid: {list: [["=far", 0, 0.2], [-0.2, "=far/2", 0], [0.1, 0.1, -0.2]]}}
  q: {body: ground, grid: {list: [[1, 0, 1.5], ["=-2*far", 0.3, 1], [0, 0.2, 2]]}}
loads:
  - {body: b, at: ["=far/4", 0, 0.1], force: ["=h*3", 1, "=k/50"]}
  - {body: b, frame: body, moment: [0, "=turn", 0.2]}
  - {body: b, angular_acceleration: [0.3, 0, "=turn/3"]}
members:
  s: {from: p, to: q, law: {type: spring, stiffness: "=k", damping: "=sqrt(k)/20"}}
design:
  initial: 0.7
  variables:
    stiff: {of: define.k, lower: 20, upper: 90}
    heavy: {of: define.h, lower: 1.8, upper: 2.8}
    spun: {of: define.turn, lower: 1, upper: 2}
    wide: {of: define.far, lower: 0.3, upper: 0.5}
objectives:
  E: {response: energy, over_time: max}
  X: {response: {displacement: {body: b, at: [0.1, 0, 1]}}, over_time: final}
  W: {response: {angular_velocity: {body: b, component: y}}, over_time: mean}
  A: {response: {acceleration: {body: b, component: x}}, over_time: rms}
combine: {weights: {E: 1, X: 1, W: 1, A: 1}, normalize: false}
"""


@pytest.mark.parametrize("integrator", ["runge_kutta", "gauss"])
def test_gradients_by_names_are_slopes(integrator: str) -> None:
    case = read_case(SCENE, overrides={"solver.tolerance": "1e-11", "solver.integrator": integrator})
    found = mdstopo.evaluate(case)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, method="direct")
    for name in found.objectives:
        own = whole(found, name) * widths(case)
        assert np.abs(whole(direct, name) * widths(case) - own).max() <= 1e-9 * np.abs(own).max(), name
    for variable in case.variables:
        direction = np.zeros(len(case.start))
        direction[case.space.parts[variable.name]] = variable.upper - variable.lower
        for name, slope in differences(case, case.start, direction, 1e-3).items():
            values = whole(found, name) * widths(case)
            size = np.abs(values[case.n_design :]).max()
            assert abs(slope - whole(found, name) @ direction) <= 1e-7 * size, (variable.name, name)
