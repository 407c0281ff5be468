"""States of kernels become those of the contract: global places, quaternions of the case's own axes, global rates."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mdstopo.case.model import SpatialBody
from mdstopo.scene.border import SpatialBorder, border_of
from mdstopo.scene.quaternions import principal, product, quaternions_of, rotations_of

RANDOM = np.random.default_rng(7)


def quaternion(turn: Rotation) -> np.ndarray:
    """w, x, y, z of a rotation of SciPy, which has w last."""
    return np.roll(turn.as_quat(), 1, axis=-1)


def a_body(name: str, tensor: bool) -> SpatialBody:
    own = np.diag([2.0, 3.0, 4.0])
    if tensor:
        own = own + np.array([[0.0, 0.3, 0.1], [0.3, 0.0, -0.2], [0.1, -0.2, 0.0]])
    rotation = Rotation.random(random_state=int(RANDOM.integers(1000))).as_matrix()
    return SpatialBody(name, 2.0, own, tuple(RANDOM.normal(size=3).tolist()), rotation)


class Spatial:
    """A case as far as the border asks for it."""

    dimension = 3


def test_quaternions_and_matrices_are_those_of_scipy() -> None:
    turns = Rotation.random(200, random_state=3)
    matrices = turns.as_matrix()
    found = quaternions_of(matrices)
    assert np.abs(np.abs(np.sum(found * quaternion(turns), axis=1)) - 1.0).max() < 1e-15 * 4
    assert np.abs(rotations_of(found) - matrices).max() < 2e-15
    assert np.abs(np.linalg.norm(found, axis=1) - 1.0).max() < 4e-16
    pairs = turns[:100] * turns[100:]
    both = product(quaternion(turns[:100]), quaternion(turns[100:]))
    assert np.abs(rotations_of(both) - pairs.as_matrix()).max() < 2e-15


@pytest.mark.parametrize(
    ("turn", "first"),
    [
        (Rotation.from_rotvec([0.0, 0.0, np.pi]), [0.0, 0.0, 0.0, 1.0]),
        (Rotation.from_rotvec([0.0, -np.pi, 0.0]), [0.0, 0.0, 1.0, 0.0]),
        (Rotation.from_rotvec([0.0, 0.0, 3.5]), None),
        (Rotation.identity(), [1.0, 0.0, 0.0, 0.0]),
    ],
)
def test_the_first_number_that_is_not_zero_is_positive(turn: Rotation, first: list[float] | None) -> None:
    found = quaternions_of(turn.as_matrix())
    assert found[np.abs(found) > 1e-14][0] > 0.0
    if first is not None:
        assert np.abs(found - first).max() < 1e-15


def test_principal_axes_are_right_handed_and_diagonal_inertias_keep_theirs() -> None:
    own = a_body("b", tensor=True).inertia
    moments, axes = principal(own)
    assert np.abs(axes @ np.diag(moments) @ axes.T - own).max() < 1e-14
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-14)
    moments, axes = principal(np.diag([4.0, 1.0, 2.0]))
    assert moments.tolist() == [4.0, 1.0, 2.0]
    assert np.array_equal(axes, np.eye(3))


def test_states_become_those_of_the_bodies_own_axes() -> None:
    bodies = (a_body("one", tensor=True), a_body("two", tensor=False))
    border = border_of(Spatial(), bodies)  # type: ignore[arg-type]
    turns = Rotation.random(10, random_state=5)
    q, v, a = np.zeros((5, 21)), RANDOM.normal(size=(5, 18)), RANDOM.normal(size=(5, 18))
    q[:, 17] = 1.0  # ground
    for b in range(2):
        q[:, 7 * b : 7 * b + 3] = RANDOM.normal(size=(5, 3))
        q[:, 7 * b + 3 : 7 * b + 7] = quaternion(turns[5 * b : 5 * b + 5])
    told = border.places(q)
    assert told.shape == (5, 14)
    for name, rates in (("v", v), ("a", a)):
        seen = border.rates(q, rates)
        assert seen.shape == (5, 12)
        for b, body in enumerate(bodies):
            axes = principal(body.inertia)[1]
            for t in range(5):
                at_home = body.rotation @ axes
                now = at_home @ turns[5 * b + t].as_matrix()  # of the principal axes
                own = Rotation.from_matrix(now @ axes.T)
                found = told[t, 7 * b : 7 * b + 7]
                assert np.abs(found[:3] - q[t, 7 * b : 7 * b + 3] - body.position).max() < 1e-15 * 4
                assert abs(abs(found[3:] @ quaternion(own)) - 1.0) < 1e-14
                part = slice(6 * b, 6 * b + 3)
                assert np.array_equal(seen[t, part], rates[t, part]), name
                turn = slice(6 * b + 3, 6 * b + 6)
                assert np.abs(seen[t, turn] - now @ rates[t, turn]).max() < 1e-14


def test_quaternions_go_on_through_a_whole_turn_without_a_jump() -> None:
    body = a_body("one", tensor=True)
    border = border_of(Spatial(), (body,))  # type: ignore[arg-type]
    assert isinstance(border, SpatialBorder)
    angle = np.linspace(0.0, 4.0 * np.pi, 201)
    axis = np.array([0.6, 0.0, 0.8])
    q = np.zeros((len(angle), 7))
    q[:, 3], q[:, 4:] = np.cos(0.5 * angle), np.sin(0.5 * angle)[:, None] * axis
    told = border.places(q)[:, 3:]
    assert np.abs(np.diff(told, axis=0)).max() < 0.04
    assert told[0][np.abs(told[0]) > 1e-14][0] > 0.0
    assert np.abs(told[100] + told[0]).max() < 1e-14  # a whole turn is the other quaternion of the same attitude
    assert np.abs(told[200] - told[0]).max() < 1e-14


def test_rates_are_derivatives_of_places() -> None:
    body = a_body("one", tensor=True)
    border = border_of(Spatial(), (body,))  # type: ignore[arg-type]
    omega = np.array([0.3, -0.8, 0.5])  # in principal axes, constant

    def at(t: float) -> np.ndarray:
        size = np.linalg.norm(omega)
        q = np.zeros((1, 7))
        q[0, 3], q[0, 4:] = np.cos(0.5 * size * t), np.sin(0.5 * size * t) * omega / size
        return q

    h = 1e-4
    before, now, after = (Rotation.from_matrix(rotations_of(border.places(at(t))[0, 3:])) for t in (1 - h, 1.0, 1 + h))
    v = np.concatenate([np.zeros(3), omega])[None]
    seen = border.rates(at(1.0), v)[0, 3:]
    assert np.abs(((after * before.inv()).as_rotvec() / (2.0 * h)) - seen).max() < 1e-8
    assert now.magnitude() > 0.0
