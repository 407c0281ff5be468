"""Sums over tiles of springs against the same sums written with NumPy, and against differences of the energy."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.laws import spring
from tests.compiled import compiled

with_vectors()
COUNT = 48


@compiled
def _force(member, pose, close=True):
    return spring.elastic_force(member.reshape(member.size), member.shape[1], member[6], 0, COUNT, pose, close)


@compiled
def _tangent(member, pose, close=True):
    return spring.elastic_tangent(member.reshape(member.size), member.shape[1], member[6], 0, COUNT, pose, close)


@compiled
def _design(member, poses, changes, out):
    spring.elastic_design(
        member[0], member[1], member[2], member[3], member[4], member[5], member[6], poses, changes, out
    )


def members(seed, count=COUNT):
    """Coordinates, free lengths, their excess at home (a pose of no shift and no turn), stiffness.

    The last third is padding: no stiffness, both ends at the origin.
    """
    rng = np.random.default_rng(seed)
    member = rng.normal(size=(7, count))
    member[4:] = np.abs(member[4:])
    member[5] = (member[2] - member[0]) ** 2 + (member[3] - member[1]) ** 2 - member[4] ** 2
    member[:, 2 * count // 3 :] = 0.0
    return member


def lengths(member, x, y, theta):
    """Vectors r (complex) from P to Q and lengths, in the first body's frame."""
    r = x + 1j * y + np.exp(1j * theta) * (member[2] + 1j * member[3]) - (member[0] + 1j * member[1])
    return r, np.abs(r)


def energy(member, x, y, theta):
    return 0.5 * np.sum(member[6] * (lengths(member, x, y, theta)[1] - member[4]) ** 2)


def poses(seed, count):
    rng = np.random.default_rng(seed)
    found = rng.normal(size=(count, 3))
    return found, np.array([pose_of(*each) for each in found])


def pose_of(x, y, theta):
    """Of bodies that stand still, with what has changed since home."""
    pose = np.zeros(POSE)
    pose[:4] = x, y, np.cos(theta), np.sin(theta)
    pose[10:] = x, y, -2.0 * np.sin(0.5 * theta) ** 2, np.sin(theta)
    return pose


@pytest.mark.parametrize("seed", range(4))
def test_forces_are_slopes_of_the_energy_and_tangents_of_the_forces(seed):
    member = members(seed)
    (own,), (pose,) = poses(seed, 1)
    found = np.array(_tangent(member, pose))
    np.testing.assert_allclose(_force(member, pose), found[:4], rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(_tangent(member, pose, False), found, rtol=1e-11, atol=1e-11)
    assert found[3] == pytest.approx(energy(member, *own), rel=1e-13)
    h = 1e-3
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}  # central differences of order 8
    slopes, rows = np.zeros(3), np.zeros((3, 3))
    for axis in range(3):
        for k, weight in weights.items():
            for sign in (1, -1):
                at = own.copy()
                at[axis] += sign * k * h
                there = pose_of(*at)
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
        expected += member[6] * (length - member[4]) * along
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-12)


def test_members_without_length_add_nothing():
    member = members(1)
    member[2:4] = member[:2]  # both ends of each at one place in the pose at rest
    member[5] = -(member[4] ** 2)
    still = pose_of(0.0, 0.0, 0.0)
    assert np.all(np.array(_force(member, still))[:3] == 0.0)
    found = np.array(_tangent(member, still))
    assert np.all(found[:3] == 0.0)
    assert np.isfinite(found).all()


def exact_stretch(member, x, y, theta):
    """Delta in 60 digits; what is free of strain is what the excess says, not what the length rounds to."""
    with localcontext() as context:
        context.prec = 60
        px, py, qx, qy, _, excess, _ = (Decimal(value) for value in member)
        x, y, theta = Decimal(x), Decimal(y), Decimal(theta)
        cos = sum((-1) ** k * theta ** (2 * k) / math.factorial(2 * k) for k in range(12))
        sin = sum((-1) ** k * theta ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12))
        free = ((qx - px) ** 2 + (qy - py) ** 2 - excess).sqrt()
        return ((x + cos * qx - sin * qy - px) ** 2 + (y + sin * qx + cos * qy - py) ** 2).sqrt() - free


@pytest.mark.parametrize("size", [1e-3, 1e-8, 1e-13])
@pytest.mark.parametrize("preload", [0.0, 1e-9])
def test_elongations_keep_their_digits_however_small_they_are(size, preload):
    """Against 60 digits: bodies that move by `size`, members as long as at home or strained by a billionth."""
    rng = np.random.default_rng(3)
    member = np.zeros((7, COUNT))
    member[:4] = rng.normal(size=(4, COUNT))
    long = np.hypot(member[2] - member[0], member[3] - member[1])
    member[4] = long * (1.0 - preload)
    member[5] = (long - member[4]) * (long + member[4])
    x, y, theta = size * rng.normal(size=3)
    for i in range(COUNT):
        member[6] = 0.0
        member[6, i] = 1.0
        stretch = exact_stretch(member[:, i].tolist(), x, y, theta)
        expected = float(stretch**2 / 2)
        for found in (_force(member, pose_of(x, y, theta)), _tangent(member, pose_of(x, y, theta))):
            along = abs(float(stretch)) / (size * (1.0 + np.hypot(*member[2:4, i])) + preload * long[i])
            assert found[3] == pytest.approx(expected, rel=1e-14 / along)
