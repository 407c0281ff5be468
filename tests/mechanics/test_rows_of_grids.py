"""Kernels that go through a grid row by row: strengths, gradients, lengths, and a member without one."""

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.compiler.threads import shared
from mdstopo.engine import Evaluator
from mdstopo.mechanics.kinematics.planar_poses import POSE
from mdstopo.mechanics.laws.spring import shortest_in
from mdstopo.mechanics.laws.spring_grid import grid_shortest
from mdstopo.mechanics.passes import SUMS, _scale_chunks, _unscale_chunks, member_sums
from mdstopo.scene.grid_members import places_of
from mdstopo.scene.packing import chunks_of
from mdstopo.scene.springs_model import EXCESS, L0, START, STIFFNESS, STOP, WIDTH, Springs
from tests.compiled import compiled
from tests.engine.scenes import read
from tests.mechanics.test_grids import grids

GUARD = 16
with_vectors()


@compiled
def _scaled(threads, chunk, block, power, member, alpha, strength):
    shared(_scale_chunks, threads, (np.zeros(1, np.int64), chunk, block, power, member, alpha, strength))


@compiled
def _unscaled(threads, chunk, block, power, alpha, padded, out):
    shared(_unscale_chunks, threads, (np.zeros(1, np.int64), chunk, block, power, alpha, padded, out))


@compiled
def _sums(block, member, near, strength, rel, sums):
    springs = Springs(block, member, np.zeros((0, 3), np.int64), 0, np.full((block.shape[0], 2), near))
    member_sums(springs, strength, rel, rel.shape[0], True, sums)


@compiled
def _shortest(px, py, qx, qy, width, r):
    whole = px.shape[0] // width * width
    return (
        grid_shortest(px[:whole], py[:whole], qx, qy, width, r[0], r[1], r[2], r[3]),
        shortest_in(px, py, qx, qy, r[0], r[1], r[2], r[3]),
    )


def guarded(n, value):
    """An array (n,) with values before and behind it that nobody may write, and all of it."""
    held = np.full(n + 2 * GUARD, value)
    return held[GUARD:-GUARD], held


def model_of(p, q, power=1, last=False):
    """One grid among other groups, or the last of them: nothing lies behind its last variable."""
    scene = grids(p, q, design={"initial": 0.4, "power": power})
    if last:
        del scene["members"]["after"]
    return Evaluator(read(scene)).scenes["default"].model


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("power", [1, 2])
@pytest.mark.parametrize(("p", "q", "last"), [(20, 51, True), (20, 51, False), (4, 32, True), (150, 151, True)])
def test_strengths_and_gradients_are_each_variable_s_own(p, q, last, power, threads):
    model = model_of(p, q, power, last)
    block, member = np.array(model.block), np.array(model.member)
    chunk, power_of = chunks_of(block), np.array(model.power)
    places = np.concatenate([places_of(row) for row in block.tolist()])
    rng = np.random.default_rng(p)
    alpha, _ = guarded(len(places), np.nan)  # a number behind it that is read shows
    alpha[:] = rng.uniform(0.1, 1.0, len(places))
    strength = np.zeros((3, member.shape[1]))
    _scaled(threads, chunk, block, power_of, member, alpha, strength)
    expected = np.zeros(member.shape[1])
    expected[places] = alpha**power * member[STIFFNESS, places]
    np.testing.assert_allclose(strength[0], expected, rtol=1e-15, atol=0.0)
    assert not strength[1:].any()
    padded = rng.uniform(0.1, 1.0, member.shape[1])
    out, held = guarded(len(places), 7.0)
    _unscaled(threads, chunk, block, power_of, alpha, padded, out)
    np.testing.assert_allclose(out, power * alpha ** (power - 1) * padded[places], rtol=1e-15)
    assert (held[:GUARD] == 7.0).all()
    assert (held[-GUARD:] == 7.0).all()


@pytest.mark.parametrize("near", [0.0, 1.0])
def test_a_member_of_a_grid_without_length_adds_what_one_of_no_grid_does(near):
    model = model_of(20, 51)
    block, member = np.array(model.block), np.array(model.member)
    _, start, _, _, _, _, width, _ = block[1].tolist()
    place = start + 3 * width + 7
    member[0, place - 7 : place - 7 + width] = member[2, start + 7 : start + 20 * width : width] = 0.25
    member[1, place - 7 : place - 7 + width] = member[3, start + 7 : start + 20 * width : width] = -0.5
    member[EXCESS] = (member[2] - member[0]) ** 2 + (member[3] - member[1]) ** 2 - member[L0] ** 2
    rng = np.random.default_rng(2)
    strength = rng.uniform(0.5, 1.0, (3, member.shape[1])) * member[STIFFNESS]
    rel = np.zeros((1, 1, POSE))
    rel[0, 0, 2] = 1.0
    plain = block.copy()
    plain[:, WIDTH] = 0
    found, expected = np.zeros((2, 1, 1, SUMS))
    _sums(block, member, near, strength, rel, found)
    _sums(plain, member, near, strength, rel, expected)
    size = np.abs(expected).max()
    assert np.abs(found - expected).max() <= 1e-13 * size
    # and it would be seen: its stiffness is a good part of the tangent
    assert strength[0, place] > 1e-4 * size


@pytest.mark.parametrize(("p", "q"), [(20, 51), (4, 32), (30, 15)])
def test_the_shortest_of_a_grid_is_the_shortest_of_its_members(p, q):
    model = model_of(p, q)
    row = np.array(model.block)[1]
    member = np.array(model.member)[:, row[START] : row[STOP]]
    rng = np.random.default_rng(q)
    for _ in range(20):
        angle = rng.uniform(-3.0, 3.0)
        r = np.array([*rng.uniform(-1.0, 1.0, 2), np.cos(angle), np.sin(angle)])
        found, expected = _shortest(*(np.ascontiguousarray(member[k]) for k in range(4)), int(row[WIDTH]), r)
        assert found == pytest.approx(expected, rel=1e-12)
