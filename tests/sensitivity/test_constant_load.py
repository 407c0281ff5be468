"""Constant dynamic loading, against equilibria found again after each change of a member."""

import numpy as np
import pytest

from mdstopo.scene.packing import pack
from mdstopo.sensitivity.springs_constant_load import constant_load
from tests.integrators.scenes import Group, energies, random_scene


def internal_force(scene, alpha, q):
    """-dU/dq (n,) of all members, U their energy with preload, by a complex-free high-order difference."""

    def potential(q):
        unit, power = energies(scene, q)
        return np.sum(alpha**power * unit)

    out = np.zeros_like(q)
    for d in range(len(q)):
        h = 1e-3
        e = np.zeros_like(q)
        e[d] = h
        pieces = [potential(q + k * e) - potential(q - k * e) for k in (1, 2, 3)]
        out[d] = -(45 * pieces[0] - 9 * pieces[1] + pieces[2]) / (60 * h)
    return out


@pytest.fixture
def held():
    scene = random_scene([Group(0, 2, 20), Group(1, 0, 15, power=3.0)], [(3, 0.5), (5, 1.0)], ground=True)
    rng = np.random.default_rng(4)
    pose = scene.model.q0 + 0.05 * rng.standard_normal(9) * (scene.model.inv_mass > 0)
    return scene, rng.uniform(0.4, 1.0, 35), pose


def test_it_is_the_derivative_of_the_equilibrium_under_the_forces_held_fixed(held):
    scene, alpha, pose = held
    load = -internal_force(scene, alpha, pose)
    moving = np.flatnonzero(scene.model.inv_mass > 0)

    def value(design):
        q = pose.copy()
        for _ in range(8):
            residual = (internal_force(scene, design, q) + load)[moving]
            jacobian = np.zeros((len(moving), len(moving)))
            for column, d in enumerate(moving):
                e = np.zeros(9)
                e[d] = 1e-5
                ahead, behind = internal_force(scene, design, q + e), internal_force(scene, design, q - e)
                jacobian[:, column] = (ahead - behind)[moving] / 2e-5
            q[moving] -= np.linalg.solve(jacobian, residual)
        unit, power = energies(scene, q)
        return np.sum(design**power * unit)

    gradient = constant_load(pack(scene.model), alpha, pose[None], np.ones(1))
    for i in (0, 7, 22, 34):
        e = np.zeros(35)
        e[i] = 1e-3
        assert (value(alpha + e) - value(alpha - e)) / 2e-3 == pytest.approx(gradient[i], rel=1e-4, abs=1e-5)


def test_rigid_motion_of_free_bodies_takes_no_part():
    scene = random_scene([Group(0, 1, 20)], [(3, 0.5), (5, 1.0)])
    pose = scene.model.q0 + np.array([0.0, 0, 0, 0.05, 0.02, 0.1])
    alpha = np.full(20, 0.5)
    packed = pack(scene.model)
    shifted = pose + np.array([0.3, -0.2, 0, 0.3, -0.2, 0])
    gradient = constant_load(packed, alpha, pose[None], np.ones(1))
    assert np.abs(gradient).max() > 0.0
    assert np.allclose(constant_load(packed, alpha, shifted[None], np.ones(1)), gradient, rtol=1e-9)


def test_a_mean_is_the_weighted_sum_of_its_nodes(held):
    scene, alpha, pose = held
    packed = pack(scene.model)
    poses, weights = np.array([pose, scene.model.q0 + 0.01 * (pose != 0)]), np.array([0.3, 0.7])
    single = [constant_load(packed, alpha, pose[None], np.ones(1)) for pose in poses]
    assert np.allclose(constant_load(packed, alpha, poses, weights), 0.3 * single[0] + 0.7 * single[1])
