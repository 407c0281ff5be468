"""Springs between whole grids of points in a plane, against the same springs one by one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.general.model.general_model import MEMBER_EXCESS
from mdstopo.mechanics.kinematics import planar_grids
from mdstopo.mechanics.kinematics.planar import PLANAR
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from mdstopo.mechanics.laws.law_table import SPRING
from mdstopo.mechanics.laws.spring import NEAR_AT
from mdstopo.mechanics.passes import SUMS
from tests.space.in_python import in_python, same

__all__ = ["in_python"]
KERNELS: Any = SimpleNamespace(**PLANAR.kernels)
START, ROWS, WIDTH = 8, 3, 64
LAWS = {"elastic": (3.0, 0.0, 0.0), "preloaded": (2.0, 0.0, -0.7), "damped": (1.5, 0.4, 0.3)}
#: members of a row: two vectors that overlap, one vector, two whole ones
LENGTHS = (11, 8, 16)
PAIR = np.array([[0, 1], [1, 0]])
#: x, y, angle at home, cos and sin of it
HOME = np.array([[0.0, 0.0, 0.3, np.cos(0.3), np.sin(0.3)], [1.0, -0.4, -0.2, np.cos(-0.2), np.sin(-0.2)]])


def grid(length: int) -> tuple[Any, np.ndarray]:
    """A model whose pair 0 has ROWS rows of springs from START on, other members around them, and their states."""
    rng = np.random.default_rng(length)
    member = rng.normal(size=(6, WIDTH))
    of = slice(START, START + ROWS * length)
    member[:2, of] = np.repeat(rng.normal(size=(2, ROWS)), length, axis=1)
    member[2:4, of] = np.tile(rng.normal(size=(2, length)), ROWS)
    ends = []
    for (x, y, _, c, s), (u, v) in zip(HOME, (member[:2], member[2:4]), strict=True):
        ends.append(np.array([x + c * u - s * v, y + s * u + c * v]))
    member[4] = rng.uniform(0.5, 1.5, WIDTH)
    member[5] = ((ends[1] - ends[0]) ** 2).sum(axis=0) - member[4] ** 2
    states = np.zeros((3, WIDTH))
    states[0] = rng.uniform(0.1, 1.0, WIDTH)
    return SimpleNamespace(member=member, curves=np.zeros(1), pair=PAIR, home=HOME), states


def pose(near: float) -> np.ndarray:
    """The relative pose of pair 0 at a share of the way from home."""
    rng = np.random.default_rng(7)
    q, v, rel = near * rng.normal(size=6), rng.normal(size=6), np.zeros((2, POSE))
    relative_pose(PAIR, HOME, q, v, rel)
    return rel[0]


def law(name: str) -> np.ndarray:
    return np.array([*LAWS[name], 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("near", [1.0, 1e-7])
def test_sums_are_those_of_the_springs_one_by_one(name: str, length: int, near: float) -> None:
    (model, states), r, p, count = grid(length), pose(near), law(name), ROWS * length
    found, expected, bare, uncounted = np.zeros((4, SUMS))
    KERNELS.spring_sums(model, p, START, count, length, True, states, r, False, bare)
    KERNELS.spring_sums(model, p, START, count, length, False, states, r, False, uncounted)
    KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
    if p[1] != 0.0:  # dampers are summed over whole vectors: what lies behind the block must not count
        states[0, START + count :] = 0.0
    KERNELS.spring_sums(model, p, START, count, length, True, states, r, True, found)
    same(found, expected, 4e-15 * count)
    same(bare[:7], found[:7], 1e-15)
    assert not bare[7:].any()
    same(uncounted[:3], found[:3], 1e-15)
    assert not uncounted[3:].any()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("tile", [(2, 16), (3, 64)])
def test_sums_at_many_poses_are_those_at_each_whatever_the_tiles(
    monkeypatch: pytest.MonkeyPatch, tile: tuple[int, int]
) -> None:
    (model, states), count, p = grid(18), ROWS * 18, law("damped")
    states[0, START + count :] = 0.0
    rel = np.zeros((3, 2, POSE))
    for j in range(3):
        rel[j, 0] = pose(0.3 * (j + 1))
    found, expected = np.zeros((2, 3, 2, SUMS))
    for j in range(3):
        KERNELS.spring_sums(model, p, START, count, 18, True, states, rel[j, 0], True, expected[j, 0])
    monkeypatch.setattr(planar_grids, "ROWS", tile[0])
    monkeypatch.setattr(planar_grids, "PLACES", tile[1])
    KERNELS.spring_sums_at_poses(model, p, START, count, 18, True, states, rel, 0, 3, True, found)
    same(found, expected, 1e-13)


@pytest.mark.usefixtures("in_python")
def test_springs_without_stiffness_are_summed_as_any() -> None:
    (model, states), count, r, p = grid(11), ROWS * 11, pose(1.0), np.array([0.0, 0.4, 0.3, *[0.0] * 5])
    states[0, START + count :] = 0.0
    found, expected = np.zeros((2, SUMS))
    KERNELS.spring_sums(model, p, START, count, 11, True, states, r, True, found)
    KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
    same(found, expected, 4e-15 * count)


@pytest.mark.usefixtures("in_python")
def test_a_spring_of_a_grid_without_length_has_no_force() -> None:
    (model, states), r, p, who = grid(11), pose(1.0), law("preloaded"), START + 15
    r[:4] = 0.5, 0.25, 1.0, 0.0  # few digits leave exactly no length
    member = model.member.copy()
    member[2:4, START + 4 : START + 33 : 11] = np.array([[1.0], [2.0]])
    member[:2, START + 11 : START + 22] = np.array([[1.5], [2.25]])
    moved = SimpleNamespace(**{**vars(model), "member": member})
    found, without = np.zeros((2, SUMS))
    KERNELS.spring_sums(moved, p, START, 33, 11, True, states, r, True, found)
    stored = 0.5 * p[0] * states[0, who] * member[4, who] ** 2  # its elongation stores energy
    states[0, who] = 0.0
    KERNELS.spring_sums(moved, p, START, 33, 11, True, states, r, True, without)
    without[3] += stored
    assert np.isfinite(found).all()
    same(found, without, 1e-14)


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("length", LENGTHS)
def test_the_derivative_of_many_poses_is_the_sum_of_theirs(length: int) -> None:
    (model, _), p, count = grid(length), law("elastic"), ROWS * length
    rel, u = np.zeros((4, 2, POSE)), np.random.default_rng(3).normal(size=(4, 2, 3))
    for s in range(4):
        rel[s, 0] = pose(0.2 * (s + 1))
    found, expected = np.zeros((2, WIDTH))
    KERNELS.spring_designs(model, p, START, count, length, rel, u, 0, found)
    for s in range(4):
        for i in range(START, START + count):
            _, x, work = KERNELS.member_work(model, i, rel[s, 0], u[s, 0])
            expected[i] += p[0] * x * work
    same(found, expected, 1e-13)
    assert not found[:START].any()
    assert not found[START + count :].any()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("row", [11, 0])
def test_far_from_home_elongations_are_differences_of_lengths_and_the_same(row: int) -> None:
    """Springs one by one always take displacements; close to home those with a row of `Model.near` do so, too.

    Lengths alone need no excess, so another one shows what elongations came from.
    """
    (model, states), count, p = grid(11), ROWS * 11, law("elastic")
    p[NEAR_AT:] = 1e-8
    member = model.member.copy()
    member[MEMBER_EXCESS] += 1.0
    other = SimpleNamespace(**{**vars(model), "member": member})
    rel, u = np.zeros((2, 2, POSE)), np.random.default_rng(3).normal(size=(2, 2, 3))
    states[0, START + count :] = 0.0
    for s, near in enumerate((1.0, 1e-7)):
        r = rel[s, 0] = pose(near)
        found, seen, expected = np.zeros((3, SUMS))
        KERNELS.spring_sums(model, p, START, count, row, True, states, r, True, found)
        KERNELS.spring_sums(other, p, START, count, row, True, states, r, True, seen)
        KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
        same(found, expected, 1e-12)
        assert np.array_equal(found, seen) == (near == 1.0)
    found, expected = np.zeros((2, WIDTH))
    KERNELS.spring_designs(model, p, START, count, row, rel, u, 0, found)
    KERNELS.spring_designs(model, law("elastic"), START, count, row, rel, u, 0, expected)
    same(found, expected, 1e-12)
    found, expected = np.zeros((2, WIDTH))
    KERNELS.spring_designs(other, p, START, count, row, rel, u, 0, found)
    far = model if row else other  # one by one, derivatives always take displacements
    KERNELS.spring_designs(far, p, START, count, row, rel[:1], u[:1], 0, expected)
    KERNELS.spring_designs(other, p, START, count, row, rel[1:], u[1:], 0, expected)
    same(found, expected, 1e-12)
