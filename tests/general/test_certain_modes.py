"""Bounds of what all members of a part of a tile do: every one of them is within, and none is much too wide."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.general.driver.general_pricing import _frames
from mdstopo.general.pricing.certain_modes import (
    BULGE,
    FASTEST,
    FREE,
    HIGH,
    LOCAL,
    LOW,
    PART_NUMBERS,
    REACH,
    SERIES_NUMBERS,
    SLOWEST,
    STATED,
    V_OFF,
    V_Q,
    V_S,
    X_OFF,
    X_Q,
    X_QQ,
    X_S,
    X_SQ,
    X_SS,
    V,
    X,
    _fill_bounds,
    _fill_line,
    _fill_part,
)
from mdstopo.mechanics.kinematics.kinematics_interface import ALONG, ELONGATION, INVERSE, RATE, WORKS
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.planar_poses import COS, COS_A, DX, DY, SIN, VT, VX, VY
from mdstopo.mechanics.kinematics.planar_poses import POSE as PLANAR_POSE
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D, S, W
from mdstopo.mechanics.kinematics.spatial_poses import POSE as SPATIAL_POSE
from tests.space.in_python import in_python, turn

__all__ = ["in_python"]
COUNT = 16


def random_pose(kinematics, rng):
    """A relative pose with its rates, at which bodies are at home."""
    if kinematics is PLANAR:
        r = np.zeros(PLANAR_POSE)
        angle = rng.uniform(-3, 3)
        r[[COS, SIN, COS_A]] = np.cos(angle), np.sin(angle), 1.0
        r[[DX, DY, VX, VY, VT]] = rng.normal(size=5)
        return r
    r = np.zeros(SPATIAL_POSE)
    r[D : D + 3], r[D_RATE : D_RATE + 3], r[W : W + 3] = rng.normal(size=(3, 3))
    r[S : S + 9] = turn(int(rng.integers(1000)))
    return r


def members(kinematics, first, second, r, free):
    """A model with members from first points (n, d) to second ones, of free lengths (n,), at home at the pose r."""
    length = np.diagonal(moved(kinematics, first, second, r)[0])
    rows = [*first.T, *second.T, free, length**2 - free**2]
    return SimpleNamespace(member=np.ascontiguousarray(rows))


def moved(kinematics, first, second, r):
    """Lengths and their rates, (n, m), of members between points at the pose r, from the vectors between their ends."""
    place, turned, speed, spin = (each[0] for each in kinematics.ends(r[None]))
    apart = place + second @ turned.T - first[:, None]
    rate = speed + second @ spin.T
    length = np.linalg.norm(apart, axis=2)
    return length, np.einsum("nmd,md->nm", apart, rate) / length


def drawn(kinematics, rng, size, bent):
    """First and second points on lines, `bent` of their length beside these, and where their case has them."""
    axes = len(kinematics.ends(random_pose(kinematics, rng)[None])[0][0])
    points = []
    for count in (7, COUNT):
        begin, along, beside = rng.normal(size=(3, axes))
        t = np.linspace(-0.5, 0.5, count)[:, None]
        points.append(begin + size * (t * along + bent * (t * t) * beside))
    place, turned, _, _ = (each[0] for each in kinematics.ends(random_pose(kinematics, rng)[None]))
    return points, (points[0], place + points[1] @ turned.T)


def bounds(kinematics, points, stated, rest, r):
    """Bounds by the kernels, or None, the part's numbers, and its series."""
    axes = points[0].shape[1]
    rows, line, number = np.zeros((2, 2, axes)), np.zeros((2, 2, axes)), np.zeros(PART_NUMBERS)
    off = [0.0, 0.0]
    for which, grids in ((LOCAL, points), (STATED, stated)):
        for side, out in ((0, rows), (1, line)):
            grid = np.ascontiguousarray(grids[side].T)
            off[side] = max(off[side], _fill_line(grid, 0, grid.shape[1], out[which]))
    w, bound, series = np.zeros((4, axes)), np.zeros(4), np.zeros(SERIES_NUMBERS)
    _fill_part(rest, line, rows, sum(off), number, w)
    frame = _frames(kinematics, r[None])
    found = _fill_bounds(axes, frame, 0, line, rows, number, w, series, bound)
    return bound if found else None, number, series


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL], ids=["plane", "space"])
@settings(max_examples=60, derandomize=True, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-3.0, 0.5), st.sampled_from([0.0, 0.1, 1.0]), st.booleans())
def test_every_member_of_a_part_is_within_its_bounds(kinematics, seed, size, bent, is_stated):
    rng = np.random.default_rng(seed)
    points, stated = drawn(kinematics, rng, 10.0**size, bent)
    rest = -1.0 if is_stated else 0.8
    r = random_pose(kinematics, rng)
    bound, number, _ = bounds(kinematics, points, stated, rest, r)
    length, rate = moved(kinematics, *points, r)
    free = np.linalg.norm(stated[1] - stated[0][:, None], axis=2) if is_stated else np.full(length.shape, rest)
    if bound is None:
        # ends may meet, or lie as near as the part is large
        assert min(length.min(), free.min() if is_stated else np.inf) <= 3.0 * 10.0**size * 10.0
        return
    assert bound[LOW] <= (length - free).min()
    assert bound[HIGH] >= (length - free).max()
    assert bound[SLOWEST] <= rate.min()
    assert bound[FASTEST] >= rate.max()
    assert number[FREE] == pytest.approx(free.mean(), abs=number[REACH])


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL], ids=["plane", "space"])
def test_bounds_are_wider_than_what_members_do_by_the_square_of_the_part(kinematics):
    over = []
    for size in (1e-2, 1e-3):
        rng = np.random.default_rng(3)
        points, stated = drawn(kinematics, rng, size, 0.0)
        r = random_pose(kinematics, rng)
        bound, number, _ = bounds(kinematics, points, stated, -1.0, r)
        length, rate = moved(kinematics, *points, r)
        x = length - np.linalg.norm(stated[1] - stated[0][:, None], axis=2)
        assert number[BULGE] <= 1e-15
        assert bound[HIGH] - bound[LOW] <= 1.1 * np.ptp(x)
        over.append([bound[HIGH] - bound[LOW] - np.ptp(x), bound[FASTEST] - bound[SLOWEST] - np.ptp(rate)])
    assert (np.array(over[1]) <= 0.02 * np.array(over[0])).all()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("is_stated", [False, True], ids=["free length", "as stated"])
@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL], ids=["plane", "space"])
def test_the_series_of_a_member_is_off_by_the_cube_of_the_part_in_elongation_and_the_square_in_rate(
    kinematics, is_stated
):
    allowed = []
    for size in (1e-1, 1e-2):
        rng = np.random.default_rng(3)
        points, stated = drawn(kinematics, rng, size, 0.0)
        r = random_pose(kinematics, rng)
        _, _, series = bounds(kinematics, points, stated, -1.0 if is_stated else 0.8, r)
        length, rate = moved(kinematics, *points, r)
        free = np.linalg.norm(stated[1] - stated[0][:, None], axis=2) if is_stated else 0.8
        q, s = np.linspace(-1.0, 1.0, len(points[0]))[:, None], np.linspace(-1.0, 1.0, len(points[1]))
        x = series[X] + series[X_S] * s + series[X_Q] * q
        x = x + series[X_SS] * s**2 + series[X_SQ] * s * q + series[X_QQ] * q**2
        assert np.abs(x - (length - free)).max() <= series[X_OFF]
        assert np.abs(series[V] + series[V_S] * s + series[V_Q] * q - rate).max() <= series[V_OFF]
        allowed.append([series[X_OFF], series[V_OFF]])
    assert (np.array(allowed[1]) <= np.array([2e-3, 2e-2]) * np.array(allowed[0])).all()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("kinematics", [PLANAR, SPATIAL], ids=["plane", "space"])
def test_many_members_at_once_do_what_each_of_them_does(kinematics):
    rng = np.random.default_rng(4)
    points, _ = drawn(kinematics, rng, 1.0, 0.3)
    r, u = random_pose(kinematics, rng), rng.normal(size=kinematics.freedoms)
    first = np.repeat(points[0][:1], COUNT, axis=0)
    place, turned, _, _ = (each[0] for each in kinematics.ends(r[None]))
    first[3] = place + turned @ points[1][3]  # no length
    with np.errstate(invalid="ignore"):
        model = members(kinematics, first, points[1], r, rng.uniform(0.1, 1.0, COUNT))
        lengths, rates = (np.diagonal(each) for each in moved(kinematics, first, points[1], r))
    out = np.zeros((WORKS, COUNT))
    kinematics.kernels["member_works"](model, 0, COUNT, r, u, out)
    assert out[INVERSE, 3] == 0.0
    for i in np.delete(np.arange(COUNT), 3):
        length, x, rate = kinematics.kernels["member_motion"](model, i, r)
        _, _, along = kinematics.kernels["member_work"](model, i, r, u)
        assert out[:, i][[ELONGATION, RATE, ALONG, INVERSE]] == pytest.approx([x, rate, along, 1.0 / length], rel=1e-11)
        assert x == pytest.approx(lengths[i] - model.member[-2, i], rel=1e-11)
        assert (length, rate) == pytest.approx((lengths[i], rates[i]), rel=1e-11)
