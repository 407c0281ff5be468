"""Springs that share a law, in vectors, against sums written with NumPy and differences of these."""

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.laws import alike
from mdstopo.mechanics.passes import SUMS
from tests.compiled import compiled

with_vectors()
COUNT, START, STOP = 48, 16, 40
#: k, c, preload
LAWS = {"elastic": (3.0, 0.0, 0.0), "preloaded": (2.0, 0.0, -0.7), "damped": (1.5, 0.4, 0.3), "damper": (0.0, 0.8, 0.0)}


@compiled
def _sums(member, scale, start, stop, p, r, counted, o):
    rows = member.reshape(member.size)
    width = member.shape[1]
    alike.alike_sums(rows, width, scale, start, stop, p, r, counted, o)
    alike.alike_tangent(rows, width, scale, start, stop, p, r, o)
    alike.alike_damping(rows, width, scale, start, stop, p, r, o)


@compiled
def _design(member, start, stop, p, r, u, weight, out):
    alike.alike_design(member.reshape(member.size), member.shape[1], start, stop, p, r, u, weight, out)


@compiled
def _designs(member, start, stop, k, rel, u, pair, out):
    alike.elastic_designs(member.reshape(member.size), member.shape[1], start, stop, k, rel, u, pair, out)


@compiled
def _far(member, before, after):
    return alike.far(member.reshape(member.size), member.shape[1], START, STOP, before, after)


def scene(law, seed=0):
    """Members (6, COUNT), at home where the relative pose is none; their scales; parameters; a pose with its rate.

    The last six of the block are padding.
    """
    rng = np.random.default_rng(seed)
    member, scale = rng.normal(size=(6, COUNT)), rng.uniform(0.1, 1.0, COUNT)
    member[4] = np.abs(member[4])
    member[5] = (member[2] - member[0]) ** 2 + (member[3] - member[1]) ** 2 - member[4] ** 2
    member[:, STOP - 6 : STOP] = scale[STOP - 6 : STOP] = 0.0
    x, rate = rng.normal(size=3), rng.normal(size=3)
    return member, scale, np.array(LAWS[law]), x, rate


def pose(x, rate):
    r = np.zeros(POSE)
    r[:7] = x[0], x[1], np.cos(x[2]), np.sin(x[2]), *rate
    r[10:] = x[0], x[1], -2.0 * np.sin(0.5 * x[2]) ** 2, np.sin(x[2])
    return r


def sums(member, scale, p, x, rate, counted=True):
    o = np.zeros(SUMS)
    _sums(member, scale, START, STOP, p, pose(x, rate), counted, o)
    return o


def plain(member, p, x, rate):
    """f, V, b (3, n) and k Delta of the block's members at unit strength."""
    m = member[:, START:STOP]
    arm = np.exp(1j * x[2]) * (m[2] + 1j * m[3])
    r = x[0] + 1j * x[1] + arm - (m[0] + 1j * m[1])
    length = np.abs(r)
    e = r / length
    b = np.array([e.real, e.imag, arm.real * e.imag - arm.imag * e.real])
    pull = p[0] * (length - m[4])
    return pull + p[1] * (rate @ b) + p[2], 0.5 * pull * (length - m[4]), b, pull


@pytest.mark.parametrize("law", LAWS)
def test_forces_energy_and_its_slope_are_those_of_the_members(law):
    member, scale, p, x, rate = scene(law)
    s = scale[START:STOP]
    f, energy, b, pull = plain(member, p, x, rate)
    o = sums(member, scale, p, x, rate)
    assert o[:3] == pytest.approx(-(s * f * b).sum(axis=1), rel=1e-12, abs=1e-13)
    assert o[3] == pytest.approx((s * energy).sum(), rel=1e-12)
    assert o[4:7] == pytest.approx((s * pull * b).sum(axis=1), rel=1e-12, abs=1e-13)
    assert not sums(member, scale, p, x, rate, counted=False)[3:7].any()


@pytest.mark.parametrize("law", LAWS)
def test_tangents_are_minus_the_slopes_of_the_forces(law):
    member, scale, p, x, rate = scene(law, 1)
    o = sums(member, scale, p, x, rate)
    stiffness = o[7:16].reshape(3, 3)
    damping = np.array([[o[16], o[17], o[19]], [o[17], o[18], o[20]], [o[19], o[20], o[21]]])
    h = 1e-3
    for column in range(3):
        e = np.zeros(3)
        by_x, by_rate = np.zeros(3), np.zeros(3)
        for step, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
            e[column] = step * h
            by_x -= weight * (sums(member, scale, p, x + e, rate) - sums(member, scale, p, x - e, rate))[:3] / h
            by_rate -= weight * (sums(member, scale, p, x, rate + e) - sums(member, scale, p, x, rate - e))[:3] / h
        assert stiffness[:, column] == pytest.approx(by_x, abs=1e-9 * np.abs(stiffness).max())
        assert damping[:, column] == pytest.approx(by_rate, abs=1e-9 * np.abs(stiffness).max())


@pytest.mark.parametrize("law", LAWS)
def test_the_design_gradient_is_each_member_s_work_and_energy(law):
    member, _, p, x, rate = scene(law, 2)
    u, weight, out = np.array([0.3, -0.2, 0.5]), 0.7, np.ones(COUNT)
    f, energy, b, _ = plain(member, p, x, rate)
    _design(member, START, STOP, p, pose(x, rate), u, weight, out)
    assert out[START : STOP - 6] == pytest.approx((1.0 + f * (u @ b) + weight * energy)[:-6], rel=1e-12, abs=1e-13)
    assert np.all(np.delete(out, np.arange(START, STOP)) == 1.0)


def test_a_member_without_length_has_energy_but_no_force():
    member, scale, p, x, rate = scene("damped", 3)
    member[:4, START:STOP] = 0.0
    member[5] = -(member[4] ** 2)
    x[:] = 0.0
    o = sums(member, scale, p, x, rate)
    assert o[3] == pytest.approx((scale * 0.5 * p[0] * member[4] ** 2)[START:STOP].sum(), rel=1e-13)
    assert not np.delete(o, 3).any()


def test_the_design_gradient_of_many_poses_is_the_sum_of_theirs():
    member, _, p, _, _ = scene("elastic", 4)
    rng = np.random.default_rng(4)
    rel, u = np.zeros((3, 2, POSE)), rng.normal(size=(3, 2, 3))
    for j in range(3):
        rel[j, 1] = pose(rng.normal(size=3), rng.normal(size=3))
    one, all_at_once = np.zeros(COUNT), np.zeros(COUNT)
    for j in range(3):
        _design(member, START, STOP, p, rel[j, 1], u[j, 1], 0.0, one)
    _designs(member, START, STOP, p[0], rel, u, 1, all_at_once)
    assert all_at_once == pytest.approx(one, rel=1e-12, abs=1e-13)
    assert np.any(one[START:STOP] != 0.0)


@pytest.mark.parametrize("who", range(START, STOP - 6, 5))
def test_ends_that_meet_on_the_way_are_not_far(who):
    """The second body moves and turns so that one member's end goes through the other, wherever on the way."""
    member, _, _, x, _ = scene("elastic", 5)
    x *= 0.1
    arm = np.exp(1j * x[2]) * complex(*member[2:4, who])
    gone = complex(*member[:2, who]) - complex(*x[:2]) - arm
    still, near = pose(x, x), pose(x + 1e-3, x)
    for overshoot in (1.0, 1.5, 10.0):
        moved = complex(*x[:2]) + overshoot * gone
        assert not _far(member, still, pose(np.array([moved.real, moved.imag, x[2]]), x))
    member[:, STOP - 6 : STOP] = member[:, START : START + 1]  # padding is short where bodies are near
    assert _far(member, still, near)
