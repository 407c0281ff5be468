"""Points against surfaces in space: slopes of all that kernels compute, and forces against global coordinates."""

from __future__ import annotations

import numpy as np
import pytest

from mdstopo.mechanics.contact import CLOSED, drag_by_slide
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.mechanics.kinematics.spatial_contacts import (
    CYLINDER,
    FIRST_AXIS,
    NORMAL,
    ORIGIN,
    PLANE,
    POINT,
    RECTANGLE,
    SECOND_AXIS,
    SHAPE,
    SIDE,
    SIZES,
    SPHERE,
    WIDTH,
)
from mdstopo.mechanics.kinematics.spatial_poses import POSE

from .in_python import KERNELS, N, by_numbers, by_q, in_python, same, scene, state, turn

__all__ = ["in_python"]

SHAPES = [(PLANE, 1), (RECTANGLE, 1), (SPHERE, 1), (SPHERE, -1), (CYLINDER, 1), (CYLINDER, -1)]
K, DAMPING, MU, SLIP = 5.0, 0.3, 0.6, 0.4


def with_contact(shape, side, friction=MU, seed=8):
    """The scene with one contact of its first pair, that a point is a little way behind, and a state."""
    random = np.random.default_rng(seed)
    model = scene()
    q, v, a = state()
    model.contact_pair = np.array([0])
    c = np.zeros(WIDTH)
    c[:4] = K, DAMPING, friction, SLIP
    c[POINT : POINT + 3] = random.normal(size=3)
    axes = turn(70).reshape(3, 3)
    c[FIRST_AXIS : FIRST_AXIS + 3], c[SECOND_AXIS : SECOND_AXIS + 3], c[NORMAL : NORMAL + 3] = axes
    c[SHAPE], c[SIDE] = shape, side
    model.contact = c[None]
    z = np.array(seen(model, q, v)[0])
    where = {
        PLANE: (0.3, 0.1, -0.2, 1.0, 1.0), RECTANGLE: (0.6, -0.2, -0.1, 1.0, 0.7),
        SPHERE: (0.5, 0.3, 0.4, 0.72 - 0.1 * (side < 0), 0.0), CYLINDER: (0.5, 0.3, 0.4, 0.6 - 0.1 * (side < 0), 1.1),
    }[shape]  # fmt: skip
    c[ORIGIN : ORIGIN + 3] = z - np.array(where[:3]) @ axes
    c[SIZES : SIZES + 2] = where[3:]
    return model, q, v, a


def seen(model, q, v):
    """Place and velocity of the point as the first body sees it, from global coordinates."""
    one, two = model.pair[0]
    turns = [model.home[b, 3:12].reshape(3, 3) @ _turn(q[7 * b + 3 : 7 * b + 7]) for b in (one, two)]
    places = [model.home[b, :3] + q[7 * b : 7 * b + 3] for b in (one, two)]
    arm = turns[1] @ model.contact[0, POINT : POINT + 3]
    off = places[1] + arm - places[0]
    spins = [turns[i] @ v[6 * b + 3 : 6 * b + 6] for i, b in enumerate((one, two))]
    speed = v[6 * two : 6 * two + 3] + np.cross(spins[1], arm) - v[6 * one : 6 * one + 3] - np.cross(spins[0], off)
    return turns[0].T @ off, turns[0].T @ speed, turns, arm, off


def _turn(e):
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(e, -1)).as_matrix()


def pose(model, q, v):
    rel = np.zeros((2, POSE))
    KERNELS.relative_pose(model, q, v, rel)
    return rel


def height_and_normal(c, z):
    """Written once more, from what the shapes are."""
    w, axis = z - c[ORIGIN : ORIGIN + 3], c[NORMAL : NORMAL + 3]
    if c[SHAPE] in (PLANE, RECTANGLE):
        return axis @ w, axis
    if c[SHAPE] == CYLINDER:
        w = w - (w @ axis) * axis
    return c[SIDE] * (np.linalg.norm(w) - c[SIZES]), c[SIDE] * w / np.linalg.norm(w)


def pushed(model, q, v, tangent=False):
    f, k, d = np.zeros(N), np.zeros((12, 12)), np.zeros((12, 12))
    KERNELS.add_contact(model, 0, pose(model, q, v)[0], q, v, tangent, f, k, d)
    return f, k, d


@pytest.mark.parametrize(("shape", "side"), SHAPES)
@pytest.mark.usefixtures("in_python")
def test_the_force_is_that_of_global_coordinates(shape, side) -> None:
    model, q, v, _ = with_contact(shape, side)
    c = model.contact[0]
    z, u, turns, arm, off = seen(model, q, v)
    height, n = height_and_normal(c, z)
    assert height < 0.0
    rise = n @ u
    sliding = u - rise * n
    size = np.linalg.norm(sliding)
    normal = -K * height - DAMPING * rise
    force = turns[0] @ (normal * n - MU * normal * np.tanh(size / SLIP) * sliding / size)
    expected = np.zeros(N)
    expected[:3], expected[6:9] = -force, force
    expected[3:6], expected[9:12] = turns[0].T @ np.cross(off, -force), turns[1].T @ np.cross(arm, force)
    same(pushed(model, q, v)[0], expected, 1e-12)
    found = KERNELS.contact_seen(model, 0, pose(model, q, v)[0])
    same(found[:2], (height, rise), 1e-12)
    rows = np.zeros((3, 12))
    drag = KERNELS.contact_drag(model, 0, q, v, rows)
    same(drag[:2], (height, rise), 1e-12)
    same(drag[2], sliding, 1e-12)
    same(rows @ v[:12], (size, 0.0, rise), 1e-12)
    distance = KERNELS.contact_distance(model, 0, pose(model, q, v)[0])
    assert distance == (np.inf if shape < SPHERE else pytest.approx(side * height + c[SIZES]))


@pytest.mark.parametrize("still", [False, True])
@pytest.mark.parametrize(("shape", "side"), SHAPES)
@pytest.mark.usefixtures("in_python")
def test_tangents_are_the_slopes_of_the_forces(shape, side, still) -> None:
    """Also where the point does not slide, or hardly."""
    model, q, v, _ = with_contact(shape, side)
    if still:
        v = 1e-9 * v
    _, k, d = pushed(model, q, v, tangent=True)
    same(k, -by_q(lambda at: pushed(model, at, v)[0], q)[:12, :12], 1e-8)
    same(d, -by_numbers(lambda at: pushed(model, q, at)[0], v)[:12, :12], 1e-8)


@pytest.mark.parametrize(("shape", "side"), SHAPES)
@pytest.mark.usefixtures("in_python")
def test_heights_and_rooms_have_these_slopes_and_rates(shape, side) -> None:
    model, q, v, a = with_contact(shape, side)

    def place(at):
        height, _, room, _, _ = KERNELS.contact_seen(model, 0, pose(model, at, v)[0])
        return height, room if np.isfinite(room) else 0.0

    rows, rate = np.zeros((2, 12)), np.zeros(12)
    found = KERNELS.contact_ends(model, 0, q, v, rows, rate)
    height, rise, room, room_rate, _ = KERNELS.contact_seen(model, 0, pose(model, q, v)[0])
    assert found == (height, room)
    same(rows[::-1], by_q(place, q)[:, :12])
    same(rate, by_q(lambda at: KERNELS.contact_seen(model, 0, pose(model, at, v)[0])[1], q)[:12], 1e-8)
    same((rows[1] @ v[:12], rows[0] @ v[:12]), (rise, room_rate))
    acc = np.zeros(6)
    rel = pose(model, q, v)
    KERNELS.pose_acceleration(model, rel, 0, a, acc)
    same(KERNELS.contact_second_rise(model, 0, rel[0], acc), rows[1] @ a[:12] + rate @ v[:12])


@pytest.mark.usefixtures("in_python")
def test_a_moving_point_rises_as_its_second_rate_says() -> None:
    model, q, v, a = with_contact(CYLINDER, 1)

    def rise(t):
        at = SPATIAL.retract(q, t[0] * v + 0.5 * t[0] ** 2 * a)
        # the turning rate of a rotation vector t omega + t^2 a / 2 is omega + t a + O(t^2) at t = 0
        return KERNELS.contact_seen(model, 0, pose(model, at, v + t[0] * a)[0])[1]

    rel, acc = pose(model, q, v), np.zeros(6)
    KERNELS.pose_acceleration(model, rel, 0, a, acc)
    same(KERNELS.contact_second_rise(model, 0, rel[0], acc), by_numbers(rise, np.zeros(1))[0])


@pytest.mark.usefixtures("in_python")
def test_rooms_of_rectangles_and_cylinders_end_at_their_ends() -> None:
    c = with_contact(RECTANGLE, 1)[0].contact[0]
    for number, (x, y) in enumerate(((0.9, 0.1), (-0.9, 0.1), (0.1, 0.65), (0.1, -0.65))):
        z = c[ORIGIN : ORIGIN + 3] + x * c[FIRST_AXIS : FIRST_AXIS + 3] + y * c[SECOND_AXIS : SECOND_AXIS + 3]
        _, _, _, room, inward, end = _surface(c, z)
        assert end == number
        assert room == pytest.approx(min(1.0 - abs(x), 0.7 - abs(y)))
        assert _surface(c, z + 0.01 * np.array(inward))[3] == pytest.approx(room + 0.01)
    c = with_contact(CYLINDER, 1)[0].contact[0]
    for along, left in ((0.2, 0.2), (1.0, 0.1), (-0.3, -0.3), (1.3, -0.2)):
        z = c[ORIGIN : ORIGIN + 3] + along * c[NORMAL : NORMAL + 3] + 0.4 * c[FIRST_AXIS : FIRST_AXIS + 3]
        assert _surface(c, z)[3] == pytest.approx(left)


def _surface(c, z):
    from mdstopo.mechanics.kinematics.spatial_contacts import surface_at

    return surface_at(c, tuple(z))


@pytest.mark.usefixtures("in_python")
def test_the_drag_is_smooth_where_its_series_ends_and_where_nothing_slides() -> None:
    c = (K, DAMPING, MU, SLIP)
    for slide in (1e-12, 0.02, 0.0399999, 0.0400001, 0.3, 2.0, 50.0):
        share = np.tanh(slide / SLIP)
        grip, slope = drag_by_slide(c, slide)
        assert grip == pytest.approx(MU * share / slide, rel=1e-14)
        if slide > 0.01:
            assert slope == pytest.approx(MU * ((1.0 - share**2) / SLIP - share / slide) / slide**2, rel=1e-11)
    assert drag_by_slide(c, 0.0) == pytest.approx((MU / SLIP, -2.0 / 3.0 * MU / SLIP**3), rel=1e-15)
    assert CLOSED == 1
