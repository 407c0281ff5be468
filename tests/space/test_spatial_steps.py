"""Steps of bodies in space: the order of the method, and derivatives of a step and of the cubic between two states."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mdstopo.integrators.runge_kutta_tables import GENERAL, STAGES, runge_kutta_tables
from mdstopo.mechanics.kinematics import rotations
from mdstopo.mechanics.kinematics.spatial import SPATIAL

from .in_python import KERNELS, by_numbers, by_q, in_python, same

__all__ = ["in_python"]
pytestmark = pytest.mark.usefixtures("in_python")
TABLE, S, N, N_Q = runge_kutta_tables()[GENERAL], STAGES[GENERAL], 12, 14
RANDOM = np.random.default_rng(1)
#: of a scene, which tells how short a brief step is
SECOND = SimpleNamespace(times=np.array([0.0, 1.0]))
#: a made-up balance: accelerations as smooth functions of coordinates and velocities
BY_Q, BY_V = 0.8 * RANDOM.normal(size=(N, N_Q)), 0.4 * RANDOM.normal(size=(N, N))
START = SPATIAL.retract(np.tile(SPATIAL.at_home, 2), RANDOM.normal(size=N))
SPEED = RANDOM.normal(size=N)


def acceleration(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return 1.5 * np.sin(BY_Q @ q) + BY_V @ v


def step(q0: np.ndarray, v0: np.ndarray, h: float) -> tuple[np.ndarray, ...]:
    q, (v, a, slopes) = np.zeros((S, N_Q)), np.zeros((3, S, N))
    for i in range(S):
        KERNELS.stage_state(None, TABLE, h, i, q0, v0, q, v, a, slopes)
        a[i] = acceleration(q[i], v[i])
    end_q, end_v = np.zeros(N_Q), np.zeros(N)
    KERNELS.end_state(None, TABLE, S, h, q0, v0, q, v, a, slopes, end_q, end_v)
    return end_q, end_v, q, v


def test_steps_are_of_the_order_of_their_method() -> None:
    def end(count: int) -> tuple[np.ndarray, np.ndarray]:
        q, v = START, SPEED
        for _ in range(count):
            q, v, *_ = step(q, v, 1.0 / count)
        return q, v

    exact = end(32)
    errors = []
    for count in (2, 4, 8):
        q, v = end(count)
        errors.append(max(np.abs(SPATIAL.difference(q, exact[0])).max(), np.abs(v - exact[1]).max()))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders.min() > 7.0


def test_a_body_that_turns_evenly_is_followed_exactly() -> None:
    q, (v, a, slopes) = np.zeros((S, 7)), np.zeros((3, S, 6))
    start, speed = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), np.array([1.0, 2.0, 3.0, 0.7, -0.5, 0.3])
    for i in range(S):
        KERNELS.stage_state(None, TABLE, 1.0, i, start, speed, q, v, a, slopes)
    end_q, end_v = np.zeros(7), np.zeros(6)
    KERNELS.end_state(None, TABLE, S, 1.0, start, speed, q, v, a, slopes, end_q, end_v)
    same(end_q[3:], np.roll(Rotation.from_rotvec(speed[3:]).as_quat(), 1), 3e-15)


def test_derivatives_of_a_step_both_ways() -> None:
    h = 0.4
    end_q, _, q, v = step(START, SPEED, h)
    slopes = [by_q(lambda x, i=i: acceleration(x, v[i]), q[i], N) for i in range(S)]
    random = np.random.default_rng(2)
    dq, dv, bar_q, bar_v = random.normal(size=(4, N))
    changes = np.zeros((S, 3, N))
    for i in range(S):
        KERNELS.stage_jvp(None, TABLE, h, 0, i, q, v, dq, dv, changes)
        changes[i, 2] = slopes[i] @ changes[i, 0] + BY_V @ changes[i, 1]
    end_dq, end_dv = dq.copy(), dv.copy()
    KERNELS.end_jvp(None, TABLE, S, h, q, v, changes, end_dq, end_dv)

    def moved(e: np.ndarray) -> np.ndarray:
        there = step(SPATIAL.retract(START, e[0] * dq), SPEED + e[0] * dv, h)
        return np.concatenate([SPATIAL.difference(there[0], end_q), there[1]])

    same(np.concatenate([end_dq, end_dv]), by_numbers(moved, np.zeros(1))[:, 0])
    u, g, turns, z = np.zeros((S, N)), np.zeros((S, N)), np.full((S, N), np.nan), np.zeros(N)
    start_q, start_v = bar_q.copy(), bar_v.copy()
    for j in reversed(range(S)):
        KERNELS.stage_vjp(None, TABLE, h, j, q, v, start_q, start_v, u, g, turns, z)
        u[j], g[j] = slopes[j].T @ z, BY_V.T @ z
    KERNELS.start_vjp(None, TABLE, S, h, q, v, u, g, start_q, start_v)
    assert start_q @ dq + start_v @ dv == pytest.approx(bar_q @ end_dq + bar_v @ end_dv, rel=1e-12)


def test_slopes_by_a_shift_are_those_of_the_coordinates_behind_it() -> None:
    random = np.random.default_rng(4)
    shift, change, rows = random.normal(size=N), random.normal(size=N), random.normal(size=(1, 1, N))
    there = SPATIAL.retract(START, shift)
    tangents = np.empty((2, KERNELS.shift_size(None)))
    KERNELS.shift_tangents(None, START, there, tangents)
    exact = by_numbers(lambda s: SPATIAL.difference(SPATIAL.retract(START, s), there), shift)
    moved = np.zeros(N)
    KERNELS.add_shift(None, tangents, 0.7, change, moved)
    same(moved, 0.7 * exact @ change)
    found = [KERNELS.slope_by_shift(None, rows, 0, 0, i, tangents, i // 6) for i in range(N)]
    same(found, rows[0, 0] @ exact)
    turn = rows[0, :, 3:6]
    found = [KERNELS.turn_slope_by_shift(None, turn, 0, r, tangents, 0) for r in range(3)]
    same(found, turn[0] @ exact[3:6, 3:6])
    total, q = shift.copy(), there.copy()
    KERNELS.shift_further(None, START, total, change, q)
    same(SPATIAL.difference(q, SPATIAL.retract(START, shift + change)), np.zeros(N))


def test_how_a_shift_changes_with_the_coordinates_at_its_ends() -> None:
    random = np.random.default_rng(5)
    shift, mass = 0.6 * random.normal(size=N), random.uniform(1.0, 2.0, size=N)
    there = SPATIAL.retract(START, shift)
    by_end = by_q(lambda q: SPATIAL.difference(q, START), there, N)
    by_start = by_q(lambda q: SPATIAL.difference(there, q), START, N)
    k = np.diag(mass)
    for body in range(2):
        KERNELS.add_shift_curvature(None, shift, mass, body, 6 * body, k)
    same(k, -mass[:, None] * by_start)
    for transposed, exact in ((False, by_end), (True, by_end.T)):
        x = random.normal(size=N)
        expected = exact @ x
        KERNELS.turn_back(None, shift, np.bool_(transposed), x)
        same(x, expected)


@pytest.mark.parametrize("h", [0.37, 1e-9])
def test_derivatives_of_the_cubic_between_two_states(h: float) -> None:
    c = 0.3
    random = np.random.default_rng(3)
    ends = START, SPEED, SPATIAL.retract(START, 0.3 * random.normal(size=N)), random.normal(size=N)

    def cubic(*given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, v = np.empty(N_Q), np.empty(N)
        KERNELS.cubic(SECOND, c, h, *given, q, v)
        return q, v

    here, _ = cubic(*ends)
    blocks = []
    for k in range(4):

        def at(x: np.ndarray, k: int = k) -> np.ndarray:
            q, v = cubic(*ends[:k], x, *ends[k + 1 :])
            return np.concatenate([SPATIAL.difference(q, here), v])

        blocks.append(by_numbers(at, ends[k]) if k % 2 else by_q(at, ends[k], N))
    bar_q, bar_v = random.normal(size=(2, N))
    bars = np.empty((4, N))
    KERNELS.cubic_vjp(SECOND, c, h, *ends, bar_q, bar_v, *bars)
    for block, bar in zip(blocks, bars, strict=True):
        same(bar, block.T @ np.concatenate([bar_q, bar_v]), 1e-8)
    changes = random.normal(size=(4, N))
    dq, dv = changes[0].copy(), changes[1].copy()
    KERNELS.cubic_jvp(SECOND, c, h, *ends, dq, dv, changes[2], changes[3])
    expected = sum(block @ change for block, change in zip(blocks, changes, strict=True))
    same(np.concatenate([dq, dv]), expected, 1e-8)


def test_a_quintic_has_the_states_and_accelerations_of_both_ends() -> None:
    random = np.random.default_rng(6)
    q1 = SPATIAL.retract(START, 0.3 * random.normal(size=N))
    v1, a0, a1 = random.normal(size=(3, N))

    def at(c: float) -> tuple[np.ndarray, np.ndarray]:
        q, v = np.empty(N_Q), np.empty(N)
        KERNELS.quintic(SECOND, c, 0.4, START, SPEED, a0, q1, v1, a1, q, v)
        return q, v

    for c, q, v, a in ((0.0, START, SPEED, a0), (1.0, q1, v1, a1)):
        same(SPATIAL.difference(at(c)[0], q), np.zeros(N), 1e-14)
        same(at(c)[1], v, 1e-14)
        same(by_numbers(lambda x, c=c: at(c + x[0])[1], np.zeros(1))[:, 0] / 0.4, a, 1e-8)
    middle = by_numbers(lambda x: SPATIAL.difference(at(0.4 + x[0])[0], at(0.4)[0]), np.zeros(1))[:, 0] / 0.4
    same(middle, at(0.4)[1], 1e-8)


def test_velocities_in_a_brief_step_are_between_those_of_its_ends() -> None:
    """Rounding of the coordinates, which is more than bodies move by in it, does not show in them."""
    random = np.random.default_rng(8)
    v1, a0, a1, q, v = SPEED + 1e-6 * random.normal(size=N), *random.normal(size=(2, N)), np.empty(N_Q), np.empty(N)
    far = START.copy()
    far[[0, 1, 2, 7, 8, 9]] += 100.0
    for c in (0.0, 0.2, 0.7, 1.0):
        KERNELS.cubic(SECOND, c, 1e-16, far, SPEED, far, v1, q, v)
        same(v, (1.0 - c) * SPEED + c * v1, 1e-14)
        KERNELS.quintic(SECOND, c, 1e-16, far, SPEED, a0, far, v1, a1, q, v)
        same(v, (1.0 - c) * SPEED + c * v1, 1e-14)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 0.1, 0.316, 0.317, 1.0, 3.0])
def test_rotation_vectors_and_their_rates(size: float) -> None:
    random = np.random.default_rng(7)
    t, u, w, bar = random.normal(size=(4, 3))
    t = tuple(size * t / np.linalg.norm(t))
    quaternion = rotations.exponential(t)
    same(quaternion, np.roll(Rotation.from_rotvec(t).as_quat(), 1), 3e-16)
    same(rotations.logarithm(quaternion), t, 4e-16)
    same(rotations.turn_rate(t, rotations.vector_rate(t, u)), u, 1e-14)
    turned = by_numbers(lambda x: _between(t, tuple(np.array(t) + x[0] * u)), np.zeros(1))[:, 0]
    same(rotations.turn_rate(t, u), turned)
    for rate, change, back in (
        (rotations.turn_rate, rotations.turn_rate_jvp, rotations.turn_rate_vjp),
        (rotations.vector_rate, rotations.vector_rate_jvp, rotations.vector_rate_vjp),
    ):
        slopes = by_numbers(lambda x, rate=rate: rate(tuple(x), w), np.array(t))
        same(change(t, w, u), slopes @ u, 1e-8)
        same(back(t, w, bar), slopes.T @ bar, 1e-8)


def _between(one: tuple[float, ...], two: tuple[float, ...]) -> np.ndarray:
    return np.array(rotations.turn_between(rotations.exponential(one), rotations.exponential(two)))
