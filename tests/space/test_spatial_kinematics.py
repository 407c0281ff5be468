"""What bodies in space give the balance, against differences of it: poses, members, loads, joints, points."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.mechanics.kinematics.spatial_joints import ROWS, ROWS_OF
from mdstopo.mechanics.kinematics.spatial_poses import POSE, S, W
from mdstopo.mechanics.laws.law_table import SPRING

from .in_python import BODIES, KERNELS, N, by_numbers, by_q, in_python, same, scene, state

__all__ = ["in_python"]
pytestmark = pytest.mark.usefixtures("in_python")
MODEL = scene()
Q, V, A = state()
SUMS = 13 + 36 + 21
#: stiffness, damping and preload of springs
LAW = np.array([3.0, 0.7, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
STRENGTHS = np.array([[0.8, 1.1, 0.6, 1.4], [0.0] * 4, [0.0] * 4])


def poses(q: np.ndarray, v: np.ndarray = V) -> np.ndarray:
    rel = np.zeros((2, POSE))
    KERNELS.relative_pose(MODEL, q, v, rel)
    return rel


def places(p: int) -> list[int]:
    """The freedoms of both bodies of a pair."""
    return [6 * int(body) + d for body in MODEL.pair[p] for d in range(6)]


def members(p: int) -> int:
    """The only member of the scene that is meant with pair p: its excess is that of this pair."""
    return p


def test_a_retraction_leads_where_the_difference_says() -> None:
    shift = 0.4 * np.random.default_rng(2).normal(size=N)
    there, back = np.empty_like(Q), np.empty(N)
    KERNELS.retract(MODEL, Q, shift, there)
    KERNELS.difference(MODEL, there, Q, back)
    same(back, shift, 1e-14)
    same(SPATIAL.difference(there, Q), shift, 1e-14)
    same(np.linalg.norm(there.reshape(BODIES, 7)[:, 3:], axis=1), np.ones(BODIES), 3e-16)


def test_derivatives_of_a_retraction() -> None:
    random = np.random.default_rng(4)
    shift, bar, dq, dshift = 0.4 * random.normal(size=(4, N))
    there = SPATIAL.retract(Q, shift)
    first = by_q(lambda q: SPATIAL.difference(SPATIAL.retract(q, shift), there), Q)
    second = by_numbers(lambda s: SPATIAL.difference(SPATIAL.retract(Q, s), there), shift)
    bar_q, bar_shift, out = np.empty((3, N))
    KERNELS.retract_vjp(MODEL, Q, there, bar, bar_q, bar_shift)
    same(bar_q, first.T @ bar)
    same(bar_shift, second.T @ bar)
    KERNELS.retract_jvp(MODEL, Q, there, dq, dshift, out)
    same(out, first @ dq + second @ dshift)


@pytest.mark.parametrize("p", [0, 1])
def test_relative_poses_change_with_both_bodies(p: int) -> None:
    rel = poses(Q)
    slopes = np.stack([_displacement(rel, p, e) for e in np.eye(N)], axis=1)
    numeric = by_q(lambda q: poses(q)[p], Q)
    own = rel[p, S : S + 9].reshape(3, 3)
    turns = [numeric[S : S + 9, d].reshape(3, 3) @ own.T for d in range(N)]
    same(slopes[:3], numeric[:3])
    same(slopes[3:], np.array([[t[2, 1], t[0, 2], t[1, 0]] for t in turns]).T)
    same(rel[p, W - 3 : W + 3], slopes @ V)  # xi' = T v
    # what has changed since home changes as the pose does
    same(numeric[30:33], numeric[:3])
    same(numeric[33:42], numeric[S : S + 9])


def _displacement(rel: np.ndarray, p: int, dq: np.ndarray) -> np.ndarray:
    out = np.empty(6)
    KERNELS.pair_displacement(MODEL, rel, p, dq, out)
    return out


@pytest.mark.parametrize("p", [0, 1])
def test_accelerations_of_a_pose_are_the_rates_of_its_velocities(p: int) -> None:
    out = np.empty(6)
    KERNELS.pose_acceleration(MODEL, poses(Q), p, A, out)

    def rates(t: np.ndarray) -> Any:
        return poses(SPATIAL.retract(Q, t[0] * V + 0.5 * t[0] ** 2 * A), V + t[0] * A)[p, W - 3 : W + 3]

    same(out, by_numbers(rates, np.zeros(1))[:, 0], 1e-6)


def _sums(p: int, q: np.ndarray, v: np.ndarray, tangent: bool) -> np.ndarray:
    o = np.zeros(SUMS)
    i = members(p)
    KERNELS.member_sums(MODEL, SPRING, LAW, i, 1, True, 0.0, 0.0, STRENGTHS, poses(q, v)[p], tangent, o)
    return o


def _pair_force(p: int, sums: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    f = np.zeros(N)
    KERNELS.add_pair_force(MODEL, poses(q, v), p, sums, 0, f)
    return f


@pytest.mark.parametrize("p", [0, 1])
def test_members_and_their_tangents(p: int) -> None:
    rel, i = poses(Q), members(p)
    row, rate_row = np.empty((2, 12))
    stretch, rate = KERNELS.member_rows(MODEL, p, i, Q, V, row, rate_row)
    same([stretch, rate], KERNELS.stretch_of(MODEL, i, rel[p]), 1e-14)
    same(row, by_q(lambda q: KERNELS.stretch_of(MODEL, i, poses(q)[p])[0], Q)[places(p)])
    same(rate_row, by_q(lambda q: KERNELS.stretch_of(MODEL, i, poses(q)[p])[1], Q)[places(p)])
    assert rate == pytest.approx(row @ V[places(p)], rel=1e-13)
    acceleration = np.empty(6)
    KERNELS.pose_acceleration(MODEL, rel, p, A, acceleration)
    second = row @ A[places(p)] + rate_row @ V[places(p)]
    assert KERNELS.second_rate(MODEL, i, rel[p], acceleration) == pytest.approx(second, rel=1e-12)
    sums = np.zeros((2, SUMS))
    sums[p] = _sums(p, Q, V, True)
    force = -(LAW[0] * stretch + LAW[1] * rate + LAW[2]) * STRENGTHS[0, i] * row
    same(_pair_force(p, sums[p], Q, V)[places(p)], force, 1e-13)
    k, c = np.zeros((2, 2, 12, 12))
    KERNELS.pair_tangent(MODEL, p, rel, sums, True, k, c)
    every = np.ix_(places(p), places(p))
    same(k[p], -by_q(lambda q: _pair_force(p, _sums(p, q, V, False), q, V), Q)[every])
    same(c[p], -by_numbers(lambda v: _pair_force(p, _sums(p, Q, v, False), Q, v), V)[every])


def test_inerters_and_their_tangents() -> None:
    p, i = 0, 0
    both = places(p)

    def taken(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        row, bias = np.empty(12), np.empty(1)
        KERNELS.inerter_row(MODEL, q, v, i, p, row, bias)
        return 1.3 * STRENGTHS[0, i] * row * (row @ A[both] + bias[0])

    k, c = np.zeros((2, 2, 12, 12))
    KERNELS.add_inerter_tangents(MODEL, p, i, 1, 1.3, STRENGTHS, Q, V, A, k, c)
    same(k[p], by_q(lambda q: taken(q, V), Q)[:, both])
    same(c[p], by_numbers(lambda v: taken(Q, v), V)[:, both])


def test_bushings_and_their_tangents() -> None:
    def force(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        sums = np.zeros((2, SUMS))
        KERNELS.add_bushings(MODEL, poses(q, v), q, False, sums)
        return _pair_force(0, sums[0], q, v)

    sums = np.zeros((2, SUMS))
    KERNELS.add_bushings(MODEL, poses(Q), Q, True, sums)
    k, c = np.zeros((2, 2, 12, 12))
    KERNELS.pair_tangent(MODEL, 0, poses(Q), sums, True, k, c)
    every = np.ix_(places(0), places(0))
    same(k[0], -by_q(lambda q: force(q, V), Q)[every])
    same(c[0], -by_numbers(lambda v: force(Q, v), V)[every])


def test_loads_and_gyroscopic_moments() -> None:
    def loads(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        f = np.zeros(N)
        KERNELS.add_loads(MODEL, 0, 0.3, q, v, f)
        return f

    turn = np.zeros((N, 6))
    KERNELS.load_tangent(MODEL, 0, 0.3, Q, V, turn)
    expected = np.zeros((2, N, N))
    for d in range(N):
        own = 6 * (d // 6) + 3
        expected[0, d, own : own + 3], expected[1, d, own : own + 3] = turn[d, :3], turn[d, 3:]
    same(expected[0], by_q(lambda q: loads(q, V), Q))
    same(expected[1], by_numbers(lambda v: loads(Q, v), V))
    z, bar_q, bar_v = np.random.default_rng(8).normal(size=(3, N))
    back_q, back_v = bar_q.copy(), bar_v.copy()
    KERNELS.loads_vjp(MODEL, 0, 0.3, Q, V, z, back_q, back_v)
    same(back_q - bar_q, expected[0].T @ z, 1e-13)
    same(back_v - bar_v, expected[1].T @ z, 1e-13)
    own = MODEL.mass[3:6] * V[3:6]
    still = loads(Q, np.zeros(N))
    same((loads(Q, V) - still)[3:6], np.cross(own, V[3:6]), 1e-14)


@pytest.mark.parametrize("j", range(8))
def test_joints(j: int) -> None:
    rows = ROWS_OF[j]

    def placed(q: np.ndarray) -> np.ndarray:
        w = np.empty(42)
        KERNELS.place_joint_alone(MODEL, j, q, w)
        return w

    def phi(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, slopes = np.zeros(ROWS), np.zeros((ROWS, 12))
        KERNELS.joint_rows(MODEL, j, placed(q), values, slopes)
        return values[:rows], slopes[:rows]

    def second(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        gamma = np.zeros(ROWS)
        KERNELS.joint_gamma(MODEL, j, placed(q), v[:12], gamma)
        return phi(q)[1] @ A[:12] + gamma[:rows]

    same(phi(Q)[1], by_q(lambda q: phi(q)[0], Q)[:, :12])
    velocity, of_q, of_v = np.zeros((3, ROWS, 12))
    KERNELS.joint_velocity_slope(MODEL, j, placed(Q), V[:12], velocity)
    slopes = by_q(lambda q: phi(q)[1] @ V[:12], Q)[:, :12]
    same(velocity[:rows], slopes)
    same(second(Q, V), phi(Q)[1] @ A[:12] + slopes @ V[:12])
    KERNELS.joint_acceleration_slopes(MODEL, j, placed(Q), V[:12], A[:12], of_q, of_v)
    same(of_q[:rows], by_q(lambda q: second(q, V), Q)[:, :12])
    same(of_v[:rows], by_numbers(lambda v: second(Q, v), V)[:, :12])
    lam, stiffness = np.random.default_rng(j).normal(size=ROWS), np.zeros((12, 12))
    KERNELS.joint_stiffness(MODEL, j, placed(Q), lam, stiffness)
    same(stiffness, by_q(lambda q: phi(q)[1].T @ lam[:rows], Q)[:, :12])


def test_joints_of_a_point_alone_are_pulled_back_as_their_slopes_say() -> None:
    (j,) = (j for j in range(8) if KERNELS.joint_is_point(MODEL, j))
    assert ROWS_OF[j] == 3
    rng, w, w_dot, w_ddot = np.random.default_rng(4), np.empty(42), V[:12], A[:12]
    KERNELS.place_joint_alone(MODEL, j, Q, w)
    turned = np.empty((3, 18))
    KERNELS.turn_bodies(MODEL, Q, turned)
    of_q, of_v, stiffness = np.zeros((ROWS, 12)), np.zeros((ROWS, 12)), np.zeros((12, 12))
    KERNELS.joint_acceleration_slopes(MODEL, j, w, w_dot, w_ddot, of_q, of_v)
    z, begun = rng.normal(size=N), rng.normal(size=(2, N))
    for left_out in (None, 1):  # a row that others imply has no place among the solved ones
        row, lam, y = np.array([2, 0, 3, -1, -1, -1]), rng.normal(size=ROWS), rng.normal(size=4)
        kept = [r for r in range(3) if r != left_out]
        if left_out is not None:
            row[left_out], lam[left_out] = -1, 0.0
        stiffness[:] = 0.0
        KERNELS.joint_stiffness(MODEL, j, w, lam, stiffness)
        found, expected = begun.copy(), begun.copy()
        expected[0, :12] -= stiffness.T @ z[:12] + of_q[kept].T @ y[row[kept]]
        expected[1, :12] -= of_v[kept].T @ y[row[kept]]
        model = SimpleNamespace(**{**vars(MODEL), "row": np.tile(row, (8, 1))})
        of_rows = np.zeros(4)
        of_rows[row[kept]] = lam[kept]
        KERNELS.point_joint_vjp(model, j, np.empty((4, 0)), turned, V, A, of_rows, z, y, *found)
        same(found, expected, 1e-14)


@pytest.mark.parametrize("p", [0, 1])
def test_a_matrix_of_a_pair_is_multiplied_transposed(p: int) -> None:
    rng = np.random.default_rng(6)
    m, z, bar = rng.normal(size=(12, 12)), rng.normal(size=N), rng.normal(size=N)
    both = [6 * int(body) + d for body in MODEL.pair[p] for d in range(6)]
    expected = bar.copy()
    expected[both] -= m.T @ z[both]
    KERNELS.pair_matrix_vjp(MODEL, p, m, z, bar)
    same(bar, expected, 1e-14)


@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL])
@pytest.mark.parametrize("bodies", [(0, 1), (1, 0)])
def test_a_pair_pulls_back_by_its_pose_and_sums_as_by_its_tangent(
    kinematics: Kinematics, bodies: tuple[int, int]
) -> None:
    rng, each = np.random.default_rng(8), kinematics.freedoms
    kernels = SimpleNamespace(**kinematics.kernels)
    if kinematics is SPATIAL:
        model, q, v = SimpleNamespace(**{**vars(MODEL), "pair": np.array([[0, 1], bodies])}), Q, V
    else:
        home = np.zeros((3, 5))
        model = SimpleNamespace(pair=np.array([[0, 1], bodies]), home=home)
        q, v = rng.normal(size=(2, 3 * each))
    rel = np.zeros((2, kinematics.pose_size))
    kernels.relative_pose(model, q, v, rel)
    sums = rng.normal(size=(2, 2 * each + 1 + each * each + each * (each + 1) // 2))
    k, c = np.zeros((2, 2, 2 * each, 2 * each))
    kernels.pair_tangent(model, 1, rel, sums, False, k, c)
    z, bar = rng.normal(size=(2, 3 * each))
    expected = bar.copy()
    kernels.pair_matrix_vjp(model, 1, k[1], z, expected)
    kernels.pair_pose_vjp(model, 1, rel, sums, z, bar)
    same(bar, expected, 1e-14)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("component", [0, 1, 4, 2])
@pytest.mark.parametrize("of", ["point", "turn"])
def test_responses(of: str, component: int, order: int) -> None:
    at, since = np.array([0.3, -0.2, 0.5]), np.array([0.2, -0.1, 0.3])

    def response(order: int, q: np.ndarray, v: np.ndarray, a: np.ndarray, bars: np.ndarray | None = None) -> float:
        bars = np.zeros((3, N)) if bars is None else bars
        if of == "turn":
            return float(KERNELS.turn_motion(MODEL, order, component, 0, 1, q, v, a, bars))
        return float(KERNELS.point_motion(MODEL, order, component, at, since, 0, 1, q, v, a, bars))

    bars = np.zeros((3, N))
    value = response(order, Q, V, A, bars)
    same(bars[0], by_q(lambda q: response(order, q, V, A), Q))
    same(bars[1], by_numbers(lambda v: response(order, Q, v, A), V))
    same(bars[2], by_numbers(lambda a: response(order, Q, V, a), A))
    if component == 2 or order == 0 or (of, order) == ("turn", 1):
        return

    def before(t: np.ndarray) -> float:
        return response(order - 1, SPATIAL.retract(Q, t[0] * V + 0.5 * t[0] ** 2 * A), V + t[0] * A, A)

    assert value == pytest.approx(by_numbers(before, np.zeros(1))[0], rel=1e-5)


def test_what_a_displacement_counts_from_is_taken_from_its_components() -> None:
    at, since, scratch = np.array([0.3, -0.2, 0.5]), np.array([0.2, -0.1, 0.3]), np.zeros((3, N))

    def seen(component: int, since: np.ndarray) -> float:
        return float(KERNELS.point_motion(MODEL, 0, component, at, since, 0, 1, Q, V, A, scratch))

    whole = np.array([seen(component, np.zeros(3)) for component in (0, 1, 4)])
    same([seen(component, since) for component in (0, 1, 4)], whole - since)
    assert seen(2, since) == pytest.approx(np.linalg.norm(whole - since), rel=1e-12)


def test_a_tilt() -> None:
    axis, bars = np.array([0.6, 0.8, 0.0]), np.zeros((3, N))
    KERNELS.tilt_motion(MODEL, axis, 0, 1, Q, V, A, bars)
    same(bars[0], by_q(lambda q: KERNELS.tilt_motion(MODEL, axis, 0, 1, q, V, A, np.zeros((3, N))), Q))
