"""Kernels run as Python: derivatives of small functions are checked in no time, without compiling anything."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mdstopo.compiler.choice_by_code import Choice
from mdstopo.compiler.kernel import Kernel
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.mechanics.kinematics.spatial_bushings import WIDTH as BUSHING
from mdstopo.mechanics.kinematics.spatial_joints import WIDTH
from mdstopo.mechanics.kinematics.spatial_poses import HOME

#: the functions of bodies in space, by their names in the interface
KERNELS: Any = SimpleNamespace(**SPATIAL.kernels)
#: bodies of `scene`, the last one is ground; their freedoms
BODIES, N = 3, 18
#: a central difference of fourth order with this step is right to 1e-10 or so
STEP = 1e-3


def _call(kernel: Any, *arguments: Any) -> Any:
    return (_branches(kernel) if isinstance(kernel, Choice) else kernel.py_func)(*arguments)


@cache
def _branches(choice: Any) -> Any:
    return choice._branches()


@pytest.fixture
def in_python(monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels can be called."""
    monkeypatch.setattr(Kernel, "__call__", _call)


def turn(seed: int) -> np.ndarray:
    """A random turning matrix by rows, nine numbers."""
    return np.asarray(Rotation.random(random_state=seed).as_matrix()).ravel()


def scene(seed: int = 3, members: int = 4) -> Any:
    """Arrays of a model with two bodies and ground: members, loads of each kind, a bushing, a joint of each kind."""
    random = np.random.default_rng(seed)
    home = np.zeros((BODIES, HOME))
    home[:, 3:12] = home[:, 12:21] = np.eye(3).ravel()
    for b in range(BODIES - 1):
        home[b] = [*random.normal(size=3), *turn(b), *turn(b + 9)]
    pair = np.array([[0, 1], [2, 0]])
    joint_par = random.normal(size=(8, WIDTH))
    for j in range(8):
        joint_par[j, 6:24] = [*turn(20 + j), *turn(40 + j)]
        ends = [home[b, :3] + home[b, 3:12].reshape(3, 3) @ joint_par[j, 3 * b : 3 * b + 3] for b in range(2)]
        joint_par[j, 24:28] = [*(ends[1] - ends[0]), 1.3]
    member = random.normal(size=(8, members))
    member[6] = 1.0
    for i in range(members):  # L^2 - l0^2 at home, of pair i % 2
        one, two = pair[i % 2]
        ends = [home[b, :3] + home[b, 3:12].reshape(3, 3) @ p for b, p in ((one, member[:3, i]), (two, member[3:6, i]))]
        member[7, i] = np.sum((ends[1] - ends[0]) ** 2) - 1.0
    return SimpleNamespace(
        home=home, pair=pair, reach=np.ones(2), member=member, mass=random.uniform(1.0, 3.0, N), curves=np.zeros(1),
        times=np.array([0.0, 1.0]), force=random.normal(size=(1, N, 2)), load_body=np.array([0, 1, 0]),
        load_follows=np.array([0, 1, 2]), load_arm=random.normal(size=(3, 3)),
        load_force=random.normal(size=(1, 3, 6, 2)), timed_load=np.zeros((0, 3), dtype=np.int64),
        driven=np.zeros(0, dtype=np.int64),
        joint=np.array([[code, 0, 1, 0, 0] for code in range(8)]), joint_par=joint_par,
        bushing_pair=np.array([0]), bushing=np.abs(random.normal(size=(1, BUSHING))),
    )  # fmt: skip


def state(seed: int = 5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates, velocities and accelerations."""
    random = np.random.default_rng(seed)
    q = SPATIAL.retract(np.tile(SPATIAL.at_home, BODIES), 0.5 * random.normal(size=N))
    v, a = random.normal(size=(2, N))
    return q, v, a


def by_q(function: Callable[[np.ndarray], Any], q: np.ndarray, n: int = N) -> np.ndarray:
    """(..., n): slopes of a function of coordinates, by differences along small turns and shifts."""
    return _slopes(lambda shift: function(SPATIAL.retract(q, shift)), np.zeros(n))


def by_numbers(function: Callable[[np.ndarray], Any], x: np.ndarray) -> np.ndarray:
    """(..., n): slopes of a function of numbers."""
    return _slopes(function, x)


def _slopes(function: Callable[[np.ndarray], Any], x: np.ndarray) -> np.ndarray:
    columns = []
    for d in range(len(x)):
        e = np.zeros(len(x))
        e[d] = STEP
        one, two = (np.asarray(function(x + k * e)) - np.asarray(function(x - k * e)) for k in (1, 2))
        columns.append((8.0 * one - two) / (12.0 * STEP))
    return np.stack(columns, axis=-1)


def same(found: Any, expected: Any, tolerance: float = 1e-9) -> None:
    """Assert that arrays agree, relative to the largest number, or to 1."""
    found, expected = np.asarray(found), np.asarray(expected)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max(initial=0.0) <= tolerance * max(1.0, np.abs(expected).max(initial=0.0))
