"""Sums over tiles of springs against the same sums written with NumPy, and against differences of the energy."""

import numba
import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.mechanics.laws import spring

with_vectors()
COUNT = 48


@numba.njit
def _force(member, pose):
    return spring.elastic_force(member.reshape(member.size), member.shape[1], member[5], 0, COUNT, pose)


@numba.njit
def _tangent(member, pose):
    return spring.elastic_tangent(member.reshape(member.size), member.shape[1], member[5], 0, COUNT, pose)


@numba.njit
def _design(member, poses, changes, out):
    spring.elastic_design(member[0], member[1], member[2], member[3], member[4], member[5], poses, changes, out)


def members(seed, count=COUNT):
    """Coordinates, free lengths, stiffness; the last third is padding: no stiffness, both ends at the origin."""
    rng = np.random.default_rng(seed)
    member = rng.normal(size=(6, count))
    member[4:] = np.abs(member[4:])
    member[:, 2 * count // 3 :] = 0.0
    return member


def lengths(member, x, y, theta):
    """Vectors r (complex) from P to Q and lengths, in the first body's frame."""
    r = x + 1j * y + np.exp(1j * theta) * (member[2] + 1j * member[3]) - (member[0] + 1j * member[1])
    return r, np.abs(r)


def energy(member, x, y, theta):
    return 0.5 * np.sum(member[5] * (lengths(member, x, y, theta)[1] - member[4]) ** 2)


def poses(seed, count):
    rng = np.random.default_rng(seed)
    found = rng.normal(size=(count, 3))
    return found, np.column_stack([found[:, :2], np.cos(found[:, 2]), np.sin(found[:, 2])])


@pytest.mark.parametrize("seed", range(4))
def test_forces_are_slopes_of_the_energy_and_tangents_of_the_forces(seed):
    member = members(seed)
    (own,), (pose,) = poses(seed, 1)
    found = np.array(_tangent(member, pose))
    np.testing.assert_allclose(_force(member, pose), found[:4], rtol=1e-14, atol=1e-14)
    assert found[3] == pytest.approx(energy(member, *own), rel=1e-13)
    h = 1e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # central differences of order 8
    slopes, rows = np.zeros(3), np.zeros((3, 3))
    for axis in range(3):
        for k, weight in weights.items():
            for sign in (1, -1):
                at = own.copy()
                at[axis] += sign * k * h
                there = np.array([at[0], at[1], np.cos(at[2]), np.sin(at[2])])
                slopes[axis] += sign * weight / h * energy(member, *at)
                rows[:, axis] -= sign * weight / h * np.array(_force(member, there)[:3])
    np.testing.assert_allclose(found[:3], -slopes, rtol=1e-9, atol=1e-9)
    xx, xy, yy, xt, yt, tt = found[4:]
    np.testing.assert_allclose(rows, [[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]], rtol=1e-8, atol=1e-8)


def test_work_of_each_member_is_summed_over_the_poses():
    member, changes = members(7), np.random.default_rng(8).normal(size=(5, 3))
    own, pose = poses(9, 5)
    out = np.ones(COUNT)
    _design(member, pose, changes, out)
    expected = np.ones(COUNT)
    for (x, y, theta), u in zip(own, changes, strict=True):
        r, length = lengths(member, x, y, theta)
        turned = 1j * np.exp(1j * theta) * (member[2] + 1j * member[3])
        along = ((u[0] + 1j * u[1] + u[2] * turned) * r.conj()).real / length
        expected += member[5] * (length - member[4]) * along
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)


def test_members_without_length_add_nothing():
    member = members(1)
    member[2:4] = member[:2]  # both ends of each at one place in the pose at rest
    still = np.array([0.0, 0.0, 1.0, 0.0])
    assert np.all(np.array(_force(member, still))[:3] == 0.0)
    found = np.array(_tangent(member, still))
    assert np.all(found[:3] == 0.0)
    assert np.isfinite(found).all()
