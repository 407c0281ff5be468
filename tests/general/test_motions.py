"""Prescribed motions are followed to rounding, cost no unknowns, and leave their reactions."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.general.support import simulate_text

SCENE = """
format: 1
gravity: [0, -9.81]
time: {{end: 0.8}}
bodies:
  base: {{mass: 5, inertia: 0.4, position: [0, 0]}}
  ball: {{mass: 1, inertia: 0.05, position: [1, 0.6]}}
motions:
  - {{body: base, {motion}}}
points:
  p: {{body: base, grid: {{list: [[0.2, 0.1], [0.3, -0.4]]}}}}
  b: {{body: ball, grid: {{list: [[1, 0.7], [0.9, 0.5]]}}}}
members:
  m: {{from: p, to: b, law: {{type: spring, stiffness: 40, damping: 1}}}}
"""
T = np.linspace(0.0, 0.8, 33)


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_positions_velocities_and_accelerations_are_followed(integrator):
    rows = [[0.0, 0.0], [0.2, 0.1], [0.4, 0.3], [0.6, 0.2], [0.8, 0.0]]
    motion = simulate_text(
        SCENE.format(
            motion=f"x: {{acceleration: {{table: [[0, 0], [0.4, 4], [0.8, 4]]}}}}, y: {{velocity: 0.3}}, "
            f"angle: {{position: {{table: {rows}}}}}"
        ),
        integrator=integrator,
    )
    seen = motion.at(T)
    spline = CubicSpline(*np.array(rows).T, bc_type="not-a-knot")
    early = T <= 0.4
    x = np.where(early, 10.0 * T**3 / 6.0, 0.64 / 6.0 + 0.8 * (T - 0.4) + 2.0 * (T - 0.4) ** 2)
    assert seen.q[:, 0] == pytest.approx(x, abs=1e-13)
    assert seen.q[:, 1] == pytest.approx(0.3 * T, abs=1e-13)
    assert seen.q[:, 2] == pytest.approx(spline(T), abs=1e-13)
    assert seen.v[:, 2] == pytest.approx(spline(T, 1), abs=1e-12)


def test_the_multiplier_is_what_the_motion_takes():
    motion = simulate_text(SCENE.format(motion="x: {acceleration: 2}, y: {velocity: 0}, angle: {velocity: 0}"))
    free = simulate_text(SCENE.format(motion="angle: {velocity: 0}"))
    assert motion.lam.shape[1] == 3
    assert free.lam.shape[1] == 1
    # M a + Phi_q^T lam = F for both bodies together: members cancel
    total = motion.a[:, 0] * 5.0 + motion.a[:, 3] * 1.0 + motion.lam[:, 0]
    assert total == pytest.approx(np.zeros_like(total), abs=1e-10)


def test_a_driven_vehicle_moves_as_an_infinitely_heavy_one():
    import mdstopo

    loads = mdstopo.load_case("cases/fig6.yaml", overrides={"gravity": "[0, 0]", "bodies.vehicle.mass": "2e9"})
    case = mdstopo.load_case("cases/fig6-motion.yaml")
    seen = mdstopo.simulate(case).at([0.05, 0.1, 0.2])
    heavy = mdstopo.simulate(
        mdstopo.load_case("cases/fig6.yaml", overrides={"bodies.vehicle.mass": "2e9", "bodies.vehicle.inertia": "6e9"})
    ).at([0.05, 0.1, 0.2])
    assert loads.n_design == case.n_design
    assert seen.q == pytest.approx(heavy.q, abs=2e-6)
