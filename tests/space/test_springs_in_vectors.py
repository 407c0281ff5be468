"""Springs in space that share a law, in vectors, against the same one by one and differences of their forces."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.mechanics.kinematics.spatial_poses import D_RATE, D_SINCE, POSE, D, S
from mdstopo.mechanics.laws.law_table import SPRING

from .in_python import BODIES, KERNELS, N, by_numbers, by_q, in_python, same, scene, state

__all__ = ["in_python"]
pytestmark = pytest.mark.usefixtures("in_python")
#: the block begins at START and has COUNT springs, then padding; others stand around it
START, COUNT, WIDTH = 16, 11, 48
PADDED = slice(START + COUNT, START + 16)
SUMS = 13 + 36 + 21
FORCE, ENERGY, PULL, K, C = slice(0, 6), 6, slice(7, 13), slice(13, 49), slice(49, 70)
#: k, c, preload
LAWS = {"elastic": (3.0, 0.0, 0.0), "preloaded": (2.0, 0.0, -0.7), "damped": (1.5, 0.4, 0.3), "damper": (0.0, 0.8, 0.0)}
Q, V, _ = state()


def block() -> tuple[Any, np.ndarray]:
    """Springs of pair 0 with their lengths at home, and their states."""
    model = scene()
    rng = np.random.default_rng(8)
    member = rng.normal(size=(8, WIDTH))
    one, two = model.pair[0]
    ends = [
        model.home[b, :3, None] + model.home[b, 3:12].reshape(3, 3) @ p
        for b, p in ((one, member[:3]), (two, member[3:6]))
    ]
    member[6] = rng.uniform(0.5, 1.5, WIDTH)
    member[7] = ((ends[1] - ends[0]) ** 2).sum(axis=0) - member[6] ** 2
    states = np.zeros((3, WIDTH))
    states[0] = rng.uniform(0.1, 1.0, WIDTH)
    member[:, PADDED] = states[0, PADDED] = 0.0
    model.member = member
    return model, states


MODEL, STATES = block()


def parameters(law: str) -> np.ndarray:
    return np.array([*LAWS[law], 0.0, 0.0, 0.0, 0.0, 0.0])


def pose(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    rel = np.zeros((2, POSE))
    KERNELS.relative_pose(MODEL, q, v, rel)
    return rel[0]


def together(
    p: np.ndarray, r: np.ndarray, counted: bool = True, tangent: bool = True, model: Any = MODEL
) -> np.ndarray:
    o = np.zeros(SUMS)
    KERNELS.spring_sums(model, p, START, COUNT, 0, counted, STATES, r, tangent, o)
    return o


def one_by_one(
    p: np.ndarray, r: np.ndarray, counted: bool = True, tangent: bool = True, model: Any = MODEL
) -> np.ndarray:
    o = np.zeros(SUMS)
    KERNELS.member_sums(model, SPRING, p, START, COUNT, counted, 0.0, 0.0, STATES, r, tangent, o)
    return o


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("far", [1.0, 1e-7])
def test_sums_are_those_of_the_springs_one_by_one(law: str, far: float) -> None:
    shift = np.zeros(N)
    home = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], BODIES)
    KERNELS.difference(MODEL, Q, home, shift)
    q = np.empty_like(Q)
    KERNELS.retract(MODEL, home, far * shift, q)
    r, p = pose(q, V), parameters(law)
    found, expected = together(p, r), one_by_one(p, r)
    for part in (FORCE, ENERGY, PULL, K, C):
        same(found[part], expected[part], 3e-15 * COUNT)
    bare = together(p, r, counted=False, tangent=False)
    same(bare[FORCE], found[FORCE], 1e-15)
    assert not bare[6:].any()


@pytest.mark.parametrize("law", LAWS)
def test_tangents_are_minus_the_slopes_of_the_forces(law: str) -> None:
    p = parameters(law)
    rel, o = np.zeros((2, POSE)), np.zeros((2, SUMS))
    KERNELS.relative_pose(MODEL, Q, V, rel)
    o[0] = together(p, rel[0])
    k, c = np.zeros((2, 2, 12, 12))
    KERNELS.pair_tangent(MODEL, 0, rel, o, True, k, c)

    def force(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        f, poses = np.zeros(N), np.zeros((2, POSE))
        KERNELS.relative_pose(MODEL, q, v, poses)
        KERNELS.add_pair_force(MODEL, poses, 0, together(p, poses[0], False, False), 0, f)
        return f

    both = [6 * int(body) + d for body in MODEL.pair[0] for d in range(6)]
    every = np.ix_(both, both)
    same(k[0], -by_q(lambda q: force(q, V), Q)[every], 1e-8)
    same(c[0], -by_numbers(lambda v: force(Q, v), V)[every])


def test_a_spring_without_length_adds_nothing() -> None:
    r, p = pose(Q, V), parameters("damped")
    member = MODEL.member.copy()
    # coordinates of few digits leave exactly no length; this pose is home
    r[D : D + 3] = 0.5, 0.25, -1.0
    r[S : S + 9] = np.eye(3).ravel()
    r[D_SINCE:] = 0.0
    member[3:6, START] = 1.0, 2.0, 3.0
    member[:3, START] = 1.5, 2.25, 2.0
    x = r[D : D + 3, None] + member[3:6] - member[:3]
    member[7] = (x * x).sum(axis=0) - member[6] ** 2
    member[:, PADDED] = 0.0
    model = SimpleNamespace(**{**vars(MODEL), "member": member})
    found, expected = together(p, r, model=model), one_by_one(p, r, model=model)
    same(found, expected, 3e-14)
    strengths = STATES.copy()
    strengths[0, START] = 0.0
    without = np.zeros(SUMS)
    KERNELS.spring_sums(model, p, START, COUNT, 0, True, strengths, r, True, without)
    same(found, without, 1e-15)


def test_the_derivative_of_many_poses_is_the_sum_of_theirs() -> None:
    rng = np.random.default_rng(3)
    p = parameters("elastic")
    rel, u = np.zeros((5, 2, POSE)), rng.normal(size=(5, 2, 6))
    for s in range(5):
        KERNELS.relative_pose(MODEL, turned_by(s), V, rel[s])
    found, expected = np.zeros((2, WIDTH))
    KERNELS.spring_designs(MODEL, p, START, COUNT, 0, rel, u, 0, found)
    for s in range(5):
        KERNELS.member_designs(
            MODEL, SPRING, p, START, COUNT, 0.0, 0.0, STATES, STATES[1], rel[s, 0], u[s, 0], 0.0, expected
        )
    inside = slice(START, START + COUNT)
    same(found[inside], expected[inside], 1e-13)
    assert not found[:START].any()
    assert not found[START + 16 :].any()


def turned_by(seed: int) -> np.ndarray:
    """Coordinates that differ with the seed."""
    return state(20 + seed)[0]


@pytest.mark.parametrize("who", [0, COUNT - 1])
def test_ends_that_meet_on_the_way_are_not_far(who: int) -> None:
    """The second body moves by what its end is away: that spring's ends meet there."""
    before = pose(Q, V)
    i = START + who
    x = before[D : D + 3] + before[S : S + 9].reshape(3, 3) @ MODEL.member[3:6, i] - MODEL.member[:3, i]
    near, there, past = before.copy(), before.copy(), before.copy()
    near[D : D + 3] += 1e-6
    there[D : D + 3] -= x
    past[D : D + 3] -= 2.0 * x
    assert KERNELS.keep_apart(MODEL, START, COUNT, 0, before, near)
    for after in (there, past):
        assert not KERNELS.keep_apart(MODEL, START, COUNT, 0, before, after)
        assert KERNELS.ends_meet(MODEL, i, before, past)


def test_dampers_take_power() -> None:
    """Dampers push against the relative velocity, and only while there is one."""
    r, p = pose(Q, V), parameters("damper")
    still = r.copy()
    still[D_RATE : D_RATE + 6] = 0.0
    assert not together(p, still)[FORCE].any()
    assert together(p, r)[FORCE] @ r[D_RATE : D_RATE + 6] < 0.0
