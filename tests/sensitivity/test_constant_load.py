"""Constant dynamic loading, against equilibria found again after each change of a member."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo import evaluate, simulate
from tests.engine.plain import Plain
from tests.engine.scenes import random_design, random_scene, read

FEATURES = "damping", "ground", "preload", "follower", "power", "spin"


def scene_of(*features, over_time="final", **changes):
    scene = random_scene(12, *features, over_time=over_time) | changes
    case = read(scene, integrator="runge_kutta", step=0.02)
    return case, random_design(case, 12, low=0.4)


def test_it_is_the_derivative_of_the_equilibrium_under_the_forces_held_fixed():
    case, alpha = scene_of(*FEATURES)
    pose = simulate(case, alpha).q[-1]
    load = -Plain(case, alpha).member_force(pose, np.zeros_like(pose))

    def value(design):
        plain, q = Plain(case, design), pose.copy()

        def residual(q):
            return plain.member_force(q, np.zeros_like(q)) + load

        for _ in range(6):
            ahead, behind = (
                np.array([residual(q + sign * 1e-6 * e) for e in np.eye(len(q))]).T for sign in (1.0, -1.0)
            )
            q -= np.linalg.solve((ahead - behind) / 2e-6, residual(q))
        assert np.abs(residual(q)).max() <= 1e-9 * np.abs(load).max()
        return plain.energy(q)

    gradient = evaluate(case, alpha, method="constant_load").gradients["G"]
    for i in (0, len(alpha) // 2, len(alpha) - 1):
        e = 1e-4 * np.eye(len(alpha))[i]
        slope = (value(alpha + e) - value(alpha - e)) / 2e-4
        assert gradient[i] == pytest.approx(slope, rel=1e-6, abs=1e-7 * np.abs(gradient).max())


def test_rigid_motion_of_free_bodies_takes_no_part():
    """All bodies fall: what they do beside that is the same, and so is the gradient."""
    case, alpha = scene_of("spin", gravity=[0.0, 0.0])
    falling, _ = scene_of("spin", gravity=[3.0, -9.8])
    held, other = (evaluate(each, alpha, method="constant_load").gradients["G"] for each in (case, falling))
    assert np.abs(held).max() > 0.0
    assert np.abs(other - held).max() <= 1e-9 * np.abs(held).max()


def test_a_mean_is_that_of_gradients_of_final_values():
    """Of motions that end at the nodes of Gauss's rule."""
    case, alpha = scene_of(over_time="mean")
    (load_case,) = case.load_cases
    nodes, weights = np.polynomial.legendre.leggauss(16)
    mean = np.zeros(len(alpha))
    for node, weight in zip(nodes, weights, strict=True):
        end = load_case.start + 0.5 * (1.0 + node) * (load_case.end - load_case.start)
        shorter = replace(case, load_cases=(replace(load_case, end=end),))
        shorter = replace(shorter, objectives=(replace(case.objectives[0], over_time="final"),))
        mean += 0.5 * weight * evaluate(shorter, alpha, method="constant_load").gradients["G"]
    found = evaluate(case, alpha, method="constant_load").gradients["G"]
    assert np.abs(found - mean).max() <= 1e-3 * np.abs(mean).max()
