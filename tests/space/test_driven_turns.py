"""Prescribed rotations in space, as arrays and in kernels that run as Python."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from mdstopo.case.reader import read_case
from mdstopo.general.scene import turning_drives
from mdstopo.general.scene.compile_general import GeneralScene, compile_general
from mdstopo.mechanics.kinematics import spatial_drives

from .in_python import KERNELS, STEP, in_python, same

__all__ = ["in_python"]

BODY = """
format: 1
dimension: 3
time: {start: 0.5, end: 2}
bodies:
  a: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}
  b:
    mass: 2
    inertia: [[2, 0.1, 0], [0.1, 3, 0.2], [0, 0.2, 4]]
    position: [0.1, 0.2, 0.3]
    orientation: {axis: [1, 2, 3], angle: 0.7}
    STATED
points:
  p: {body: b, grid: {list: [[0.5, 0.2, 0.3]]}}
  q: {body: ground, grid: {list: [[1, 1, 0]]}}
members:
  m: {from: p, to: q, law: {type: spring, stiffness: 300}}
motions:
  - {body: a, y: {velocity: 2}}
  - {body: b, rotation: ROTATION}
"""


def made(rotation: str, stated: str = "") -> GeneralScene:
    case = read_case(BODY.replace("ROTATION", rotation).replace("STATED", stated))
    return compile_general(case, case.load_cases[0])


def driven(scene: GeneralScene, t: float, segment: int | None = None) -> tuple[Rotation, np.ndarray, np.ndarray]:
    """By how much the second body has turned about global axes, its global angular velocity and acceleration."""
    model: Any = scene.model
    if segment is None:
        segment = min(int(np.searchsorted(model.times, t, side="right")) - 1, len(model.times) - 2)
    q, v, a = np.array(model.q0), np.array(model.v0), np.zeros(len(model.v0))
    KERNELS.drive_state(model, segment, t, q, v)
    KERNELS.drive_acceleration(model, segment, t, a)
    assert q[1] == pytest.approx(2.0 * (t - 0.5))
    assert np.linalg.norm(q[10:14]) == pytest.approx(1.0, abs=1e-14)
    home = Rotation.from_matrix(model.home[1, 3:12].reshape(3, 3))
    now = home * Rotation.from_quat(np.roll(q[10:14], -1))
    return now * home.inv(), now.apply(v[9:12]), now.apply(a[9:12])


def check_rates(scene: GeneralScene, t: float) -> None:
    """Angular velocity and acceleration are rates of the turn and of the velocity."""
    turns = [driven(scene, t + k * STEP)[0] for k in (-2, -1, 1, 2)]
    _, omega, alpha = driven(scene, t)
    here = driven(scene, t)[0]
    back2, back, on, on2 = ((each * here.inv()).as_rotvec() for each in turns)
    same((8.0 * (on - back) - (on2 - back2)) / (12.0 * STEP), omega, 1e-8)
    back2, back, on, on2 = (driven(scene, t + k * STEP)[1] for k in (-2, -1, 1, 2))
    same((8.0 * (on - back) - (on2 - back2)) / (12.0 * STEP), alpha, 1e-8)


@pytest.mark.usefixtures("in_python")
def test_roll_pitch_and_yaw_turn_one_after_the_other_about_global_axes() -> None:
    rows = np.array([[0.5, 0.0], [0.9, 0.7], [1.4, 3.5], [1.7, 4.0], [2.0, 9.0]])
    rotation = (
        f"{{roll: {{position: {{table: {rows.tolist()}}}}}, pitch: {{velocity: {{table: [[0, 1], [1, 2], [3, -4]]}}}}, "
        "yaw: {acceleration: 3}}"
    )
    spline = CubicSpline(*rows.T)  # not-a-knot
    scene = made(rotation, f"angular_velocity: [{float(spline(0.5, 1))}, 1.5, -0.4]")
    assert scene.model.driven.tolist() == [1, 9, 10, 11]
    assert "equations of motion of b" not in " ".join(scene.skipped)
    for t in (0.5, 0.77, 1.2, 1.99):
        tau, rest = t - 0.5, t - 1.0
        pitch = 1.5 * tau + 0.5 * tau**2 if t < 1.0 else 0.875 + 2.0 * rest - 1.5 * rest**2
        angles = [spline(t), pitch, -0.4 * tau + 1.5 * tau**2]
        turn, omega, _ = driven(scene, t)
        assert (turn * Rotation.from_euler("xyz", angles).inv()).magnitude() < 1e-14
        if t == 0.5:
            same(omega, [spline(0.5, 1), 1.5, -0.4], 1e-13)
        else:
            check_rates(scene, t)


@pytest.mark.usefixtures("in_python")
def test_a_body_turns_about_one_global_axis_and_starts_with_its_rate_along_that() -> None:
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    own = (-3.0 * axis).tolist()
    scene = made("{axis: [4, -2, 4], acceleration: {table: [[0, 6], [2, 18]]}}", f"angular_velocity: {own}")
    for t in (0.5, 1.1, 2.0):
        tau = t - 0.5
        turn, omega, alpha = driven(scene, t)
        angle = -3.0 * tau + 4.5 * tau**2 + tau**3
        assert (turn * Rotation.from_rotvec(angle * axis).inv()).magnitude() < 1e-14
        same(omega, (-3.0 + 9.0 * tau + 3.0 * tau**2) * axis, 1e-14)
        same(alpha, (9.0 + 6.0 * tau) * axis, 1e-14)
    turn, omega, alpha = driven(made("{axis: [0, 0, -2], velocity: 1e4}"), 2.0)
    assert (turn * Rotation.from_rotvec([0, 0, -1.5e4]).inv()).magnitude() < 1e-11
    same(omega, [0, 0, -1e4], 1e-15)
    same(alpha, [0, 0, 0], 1e-15)


@pytest.mark.usefixtures("in_python")
def test_an_angular_velocity_turns_a_body_as_an_integrator_says() -> None:
    table = np.array([[0.0, 3, -2, 1], [1.0, 20, 4, -8], [1.0, -5, 0, 40], [1.6, 0, 30, 0]])
    scene = made(f"{{angular_velocity: {{table: {table.tolist()}}}}}")

    def rate(t: float, side: int) -> np.ndarray:
        rows = table[:2] if side == 0 else table[2:]
        return np.array([np.interp(t, rows[:, 0], column) for column in rows[:, 1:].T])

    turn, start = Rotation.identity(), 0.5
    assert len(scene.model.drive_turn) > 10
    for end, side in ((0.8, 0), (1.0, 0), (1.3, 1), (1.6, 1), (1.9, 1)):
        found = solve_ivp(
            # every column of the turn is a vector that turns
            lambda t, m, side=side: np.cross(rate(t, side), m.reshape(3, 3), axisb=0).T.ravel(),
            (start, end),
            turn.as_matrix().ravel(),
            method="DOP853",
            rtol=1e-13,
            atol=1e-13,
        )
        turn, start = Rotation.from_matrix(found.y[:, -1].reshape(3, 3)), end
        seen, omega, _ = driven(scene, end, None if end != 1.0 else 0)
        assert (seen * turn.inv()).magnitude() < 1e-11, end
        same(omega, rate(end, side), 1e-14)
        if end not in (1.0, 1.6):
            check_rates(scene, end)
    same(driven(scene, 1.0)[1], table[2, 1:], 1e-15)
    assert (driven(scene, 1.0, 0)[0] * driven(scene, 1.0, 1)[0].inv()).magnitude() < 1e-12
    steady = made("{angular_velocity: [1, -2, 30]}")
    assert len(steady.model.drive_turn) == 1  # exact, however long
    assert (driven(steady, 2.0)[0] * Rotation.from_rotvec([1.5, -3.0, 45.0]).inv()).magnitude() < 1e-13


@pytest.mark.usefixtures("in_python")
def test_the_series_is_of_sixth_order() -> None:
    rate, slope = np.array([0.3, -0.5, 0.4]), np.array([-0.6, 0.2, 0.9])

    def over(start: float, end: float) -> Rotation:
        middle, h = rate + 0.5 * (start + end) * slope, end - start
        found = spatial_drives.linear_turn(tuple(h * middle), tuple(h * h * slope))
        same(found, turning_drives._over(rate, slope, start, end), 1e-15)
        return Rotation.from_quat(np.roll(found, -1))

    def error(count: int) -> float:
        ends = np.linspace(0.0, 3.0, count + 1)
        turn = Rotation.identity()
        for one, other in itertools.pairwise(ends):
            turn = over(one, other) * turn
        return float((turn * exact.inv()).magnitude())

    exact = Rotation.identity()
    fine = np.linspace(0.0, 3.0, 201)
    for one, other in itertools.pairwise(fine):
        exact = over(one, other) * exact
    errors = [error(count) for count in (2, 4, 8)]
    assert errors[0] / errors[1] == pytest.approx(64, rel=0.3)
    assert errors[1] / errors[2] == pytest.approx(64, rel=0.15)
