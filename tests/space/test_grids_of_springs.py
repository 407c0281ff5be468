"""Springs between whole grids of points in space, against the same springs one by one and as a block of any springs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo import Evaluation, evaluate
from mdstopo.case.reader import read_case
from mdstopo.general.scene import compile_general
from mdstopo.mechanics.kinematics import spatial_grids
from mdstopo.mechanics.kinematics.spatial_poses import POSE
from mdstopo.mechanics.laws.law_table import SPRING

from .in_python import KERNELS, in_python, same, scene, state

__all__ = ["in_python"]
START, ROWS, WIDTH = 8, 3, 64
SUMS = 13 + 36 + 21
FORCE, ENERGY, PULL, K = slice(0, 6), 6, slice(7, 13), slice(13, 49)
LAWS = {"elastic": (3.0, 0.0, 0.0), "preloaded": (2.0, 0.0, -0.7), "damped": (1.5, 0.4, 0.3)}
#: members of a row: two vectors that overlap, one vector, two whole ones
LENGTHS = (11, 8, 16)
#: members of a row and rows where vectors have members of several rows: columns come again after five vectors, in every
#: vector, after three of which the last is incomplete, in the first vector alone
SHORT = ((10, 9), (4, 5), (6, 9), (2, 3))
Q, V, _ = state()


def grid(length: int, rows: int = ROWS, width: int = WIDTH) -> tuple[Any, np.ndarray]:
    """A model whose pair 0 has rows of springs from START on, other members around them, and their states."""
    model, rng = scene(), np.random.default_rng(length)
    member = rng.normal(size=(8, width))
    of = slice(START, START + rows * length)
    member[:3, of] = np.repeat(rng.normal(size=(3, rows)), length, axis=1)
    member[3:6, of] = np.tile(rng.normal(size=(3, length)), rows)
    one, two = model.pair[0]
    ends = [
        model.home[b, :3, None] + model.home[b, 3:12].reshape(3, 3) @ p
        for b, p in ((one, member[:3]), (two, member[3:6]))
    ]
    member[6] = rng.uniform(0.5, 1.5, width)
    member[7] = ((ends[1] - ends[0]) ** 2).sum(axis=0) - member[6] ** 2
    model.member = member
    states = np.zeros((3, width))
    states[0] = rng.uniform(0.1, 1.0, width)
    return model, states


def pose(model: Any, near: float) -> np.ndarray:
    """The relative pose of pair 0 at a share of the way from home."""
    home = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], len(model.home))
    shift, q, rel = np.zeros(len(V)), np.empty_like(Q), np.zeros((2, POSE))
    KERNELS.difference(model, Q, home, shift)
    KERNELS.retract(model, home, near * shift, q)
    KERNELS.relative_pose(model, q, V, rel)
    return rel[0]


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("near", [1.0, 1e-7])
def test_sums_are_those_of_the_springs_one_by_one(law: str, length: int, near: float) -> None:
    model, states = grid(length)
    r, p, count = pose(model, near), np.array([*LAWS[law], 0.0, 0.0, 0.0, 0.0, 0.0]), ROWS * length
    found, expected, bare = np.zeros((3, SUMS))
    KERNELS.spring_sums(model, p, START, count, length, True, states, r, False, bare)
    KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
    if p[1] != 0.0:  # dampers are summed over whole vectors: what lies behind the block must not count
        states[0, START + count :] = 0.0
    KERNELS.spring_sums(model, p, START, count, length, True, states, r, True, found)
    for part in (FORCE, ENERGY, PULL, K, slice(49, 70)):
        same(found[part], expected[part], 4e-15 * count)
    same(bare[:13], found[:13], 1e-15)
    assert not bare[13:].any()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("length", "rows"), SHORT)
@pytest.mark.parametrize("near", [1.0, 1e-7])
def test_sums_of_short_rows_are_those_of_the_springs_one_by_one(law: str, length: int, rows: int, near: float) -> None:
    model, states = grid(length, rows, 128)
    count = rows * length
    states[0, START + count :] = 0.0  # padding
    r, p = pose(model, near), np.array([*LAWS[law], 0.0, 0.0, 0.0, 0.0, 0.0])
    found, expected, bare = np.zeros((3, SUMS))
    KERNELS.spring_sums(model, p, START, count, -length, True, states, r, True, found)
    KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
    for part in (FORCE, ENERGY, PULL, K, slice(49, 70)):
        same(found[part], expected[part], 4e-15 * count)
    KERNELS.spring_sums(model, p, START, count, -length, False, states, r, False, bare)
    same(bare[FORCE], found[FORCE], 1e-15)
    assert not bare[6:].any()


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("tile", [(2, 16), (3, 64)])
def test_sums_at_many_poses_are_those_at_each_whatever_the_tiles(
    monkeypatch: pytest.MonkeyPatch, tile: tuple[int, int]
) -> None:
    model, states = grid(18)
    count, p = ROWS * 18, np.array([*LAWS["damped"], 0.0, 0.0, 0.0, 0.0, 0.0])
    states[0, START + count :] = 0.0
    rel = np.zeros((3, 2, POSE))
    for j in range(3):
        rel[j, 0] = pose(model, 0.3 * (j + 1))
    found, expected = np.zeros((2, 3, 2, SUMS))
    for j in range(3):
        KERNELS.spring_sums(model, p, START, count, 18, True, states, rel[j, 0], True, expected[j, 0])
    monkeypatch.setattr(spatial_grids, "ROWS", tile[0])
    monkeypatch.setattr(spatial_grids, "PLACES", tile[1])
    KERNELS.spring_sums_at_poses(model, p, START, count, 18, True, states, rel, 0, 3, True, found)
    same(found, expected, 1e-13)


@pytest.mark.usefixtures("in_python")
def test_springs_without_stiffness_are_summed_as_any() -> None:
    model, states = grid(11)
    count, r, p = ROWS * 11, pose(model, 1.0), np.array([0.0, 0.4, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    states[0, START + count :] = 0.0
    found, expected = np.zeros((2, SUMS))
    KERNELS.spring_sums(model, p, START, count, 11, True, states, r, True, found)
    KERNELS.member_sums(model, SPRING, p, START, count, True, 0.0, 0.0, states, r, True, expected)
    same(found, expected, 4e-15 * count)


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("length", LENGTHS)
def test_ends_of_a_grid_keep_apart_where_those_of_a_block_do(length: int) -> None:
    model, _ = grid(length)
    count, before = ROWS * length, pose(model, 0.5)
    shares = 0.5 + np.geomspace(1e-3, 10.0, 12)
    apart = []
    for share in shares:
        after = pose(model, share)
        apart.append(KERNELS.keep_apart(model, START, count, length, before, after))
        moved = [KERNELS.member_motion(model, i, after)[0] for i in range(START, START + count)]
        assert np.isfinite(moved).all()
        lengths, ways = np.array([ends(model, i, before, after) for i in range(START, START + count)]).T
        assert apart[-1] == bool(np.all(lengths > np.sqrt(1.001) * ways))
    assert any(apart)
    assert not all(apart)


def ends(model: Any, i: int, before: np.ndarray, after: np.ndarray) -> tuple[float, float]:
    """The length of member i at a pose, and by how much its vector changes on the way to another one."""
    one, two = (r[:3] + r[3:12].reshape(3, 3) @ model.member[3:6, i] - model.member[:3, i] for r in (before, after))
    return float(np.linalg.norm(one)), float(np.linalg.norm(two - one))


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize(("length", "rows", "sign"), [(n, ROWS, 1) for n in LENGTHS] + [(*each, -1) for each in SHORT])
def test_the_derivative_of_many_poses_is_the_sum_of_theirs(length: int, rows: int, sign: int) -> None:
    model, states = grid(length, rows, 128)
    rng, p, count = np.random.default_rng(3), np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), rows * length
    rel, u = np.zeros((4, 2, POSE)), rng.normal(size=(4, 2, 6))
    for s in range(4):
        rel[s, 0] = pose(model, 0.2 * (s + 1))
    found, expected = np.zeros((2, 128))
    KERNELS.spring_designs(model, p, START, count, sign * length, rel, u, 0, found)
    for s in range(4):
        KERNELS.member_designs(
            model, SPRING, p, START, count, 0.0, 0.0, states, states[1], rel[s, 0], u[s, 0], 0.0, expected
        )
    behind = START + count if sign > 0 else START + -(-count // 8) * 8  # padding is written to
    found[START + count : behind] = 0.0
    same(found, expected, 1e-13)
    assert not found[:START].any()
    assert not found[behind:].any()


@pytest.mark.usefixtures("in_python")
def test_a_spring_of_a_grid_without_length_adds_nothing() -> None:
    model, states = grid(11)
    r, p, who = pose(model, 1.0), np.array([1.5, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0]), START + 15
    r[:3], r[3:12] = (0.5, 0.25, -1.0), np.eye(3).ravel()  # few digits leave exactly no length
    member = model.member.copy()
    member[3:6, START + 4 : START + 33 : 11] = np.array([[1.0], [2.0], [3.0]])
    member[:3, START + 11 : START + 22] = np.array([[1.5], [2.25], [2.0]])
    moved = SimpleNamespace(**{**vars(model), "member": member})
    found, without = np.zeros((2, SUMS))
    KERNELS.spring_sums(moved, p, START, 33, 11, True, states, r, True, found)
    states[0, who] = 0.0
    KERNELS.spring_sums(moved, p, START, 33, 11, True, states, r, True, without)
    assert np.isfinite(found).all()
    same(found, without, 1e-15)


CASE = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.4}
bodies:
  lower: {mass: 40, inertia: [3, 4, 5], position: [0, 0, 0], velocity: [1, 0.2, 0], angular_velocity: [0.4, -0.3, 0.5]}
  upper: {mass: 20, inertia: [2, 3, 2.5], position: [0, 0, 1]}
points:
  low: {body: lower, grid: {plane: {corner: [-1, -1, 0.2], edges: [[2, 0, 0], [0, 2, 0]], count: [5, 4]}}}
  high: {body: upper, grid: {circle: {center: [0, 0, 0.9], radius: 0.5, normal: [0, 0, 1], start: [1, 0, 0],
                                      count: 21}}}
members:
  net: {from: low, to: high, law: {type: spring, stiffness: 40, DAMPING}}
design: {initial: 0.3, lower: 0.01, upper: 1}
objectives:
  energy: {response: energy, over_time: max}
  force: {response: {member_force: {group: net}}, over_time: max}
  turn: {response: {rotation: {body: upper, relative_to: lower, component: norm}}, over_time: max}
combine: {method: weighted_sum, weights: {energy: 1, force: 1, turn: 1}}
constraints:
  - {volume: net, fraction: 0.3}
solver: {tolerance: 1.0e-10}
"""
#: collocation goes through the springs at several poses at once
INTEGRATORS = ("runge_kutta", "gauss")


def evaluated(text: str, integrator: str = "auto") -> Evaluation:
    case = read_case(text, overrides={"solver.integrator": integrator})
    return evaluate(case, np.random.default_rng(1).uniform(0.05, 1.0, case.n_design))


@pytest.mark.parametrize("law", ["free_length: 0.6", "damping: 2"])
def test_a_case_has_the_same_values_and_gradients_without_the_kernels_for_grids(
    monkeypatch: pytest.MonkeyPatch, law: str
) -> None:
    text, rows = CASE.replace("DAMPING", law), []

    def none(*arguments: Any, **options: Any) -> tuple[int, int]:
        rows.append(row_of(*arguments, **options))
        return 0, 0

    row_of = compile_general.row_of
    with_rows = evaluated(text)
    monkeypatch.setattr(compile_general, "row_of", none)
    monkeypatch.setattr(compile_general, "short_row_of", lambda group: 0)
    without = evaluated(text)
    assert rows == [(24, 21)]
    for name, value in without.objectives.items():
        assert with_rows.objectives[name] == pytest.approx(value, rel=1e-11)
        assert with_rows.gradients[name] == pytest.approx(
            without.gradients[name], rel=1e-9, abs=1e-9 * np.abs(without.gradients[name]).max()
        )


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_pass_over_very_many_springs_is_the_same_with_any_number_of_threads(
    monkeypatch: pytest.MonkeyPatch, integrator: str
) -> None:
    text = CASE.replace("DAMPING", "free_length: 0.6").replace("count: [5, 4]", "count: [10, 10]")
    text = text.replace("count: 21", "count: 170")  # 17,000 springs
    text = text.replace("{end: 0.4}", "{end: 0.05}").replace("1.0e-10", "1.0e-6")
    found = []
    for threads in ("1", "3"):
        monkeypatch.setenv("MDSTOPO_THREADS", threads)
        found.append(evaluated(text, integrator))
    monkeypatch.setattr(compile_general, "row_of", lambda *arguments, **options: (0, 0))
    monkeypatch.setattr(compile_general, "short_row_of", lambda group: 0)
    without = evaluated(text, integrator)
    one, three = found
    assert one.objectives == three.objectives
    for name, value in without.objectives.items():
        assert np.array_equal(one.gradients[name], three.gradients[name])
        assert one.objectives[name] == pytest.approx(value, rel=1e-10)
        most = np.abs(without.gradients[name]).max()
        assert one.gradients[name] == pytest.approx(without.gradients[name], rel=1e-8, abs=1e-8 * most)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("ends", ["from: low, to: posts", "from: posts, to: low"])
def test_springs_to_a_grid_on_the_ground_are_those_of_another_law(ends: str, integrator: str) -> None:
    grid = "{plane: {corner: [-2, -2, -1], edges: [[4, 0, 0], [0, 4, 0]], count: [6, 3]}}"
    added = f"  posts: {{body: ground, grid: {grid}}}\nmembers:\n  stays: {{{ends}, law: STAY}}\n"
    text = CASE.replace("DAMPING", "damping: 2").replace("members:\n", added)
    springs, others = (
        evaluated(text.replace("STAY", law), integrator)
        for law in ("{type: spring, stiffness: 30}", "{type: cubic, stiffness: 30, cubic: 0}")
    )
    for name, value in others.objectives.items():
        assert springs.objectives[name] == pytest.approx(value, rel=1e-9)
        assert springs.gradients[name] == pytest.approx(
            others.gradients[name], rel=1e-8, abs=1e-8 * np.abs(others.gradients[name]).max()
        )
