"""Every joint and every law in space against Newton's and Euler's equations with multipliers (`newton_euler`)."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

import mdstopo
from mdstopo.case.reader import read_case

from .newton_euler import Scene, states

SCENE = """
format: 1
dimension: 3
gravity: [0.5, -1.0, -9.81]
time: {end: 0.3}
solver: {tolerance: 1.0e-10}
bodies:
  a:
    mass: 3
    inertia: [[0.4, 0.05, -0.02], [0.05, 0.6, 0.03], [-0.02, 0.03, 0.5]]
    position: [0.4, 0.1, -0.2]
    orientation: [{axis: [0, 1, 0], angle: 0.4}, {axis: [1, 0, 2], angle: 1.1}]
  b:
    mass: 2
    inertia: [[0.3, -0.04, 0.01], [-0.04, 0.2, 0.02], [0.01, 0.02, 0.25]]
    position: [1.1, 0.5, 0.3]
    orientation: {quaternion: [0.5, -0.5, 0.5, 0.5]}
joints: []
loads:
  - {body: b, force: [3, -2, 1], at: [1.2, 0.7, 0.2], moment: [0.3, 0.2, -0.5]}
  - {body: a, force: [1, 4, 2], at: [0.1, -0.1, 0.2], moment: [0.1, -0.2, 0.3], frame: body}
  - {body: a, acceleration: [1, 0, 2], angular_acceleration: [1, 2, -3]}
"""
BASE = {
    "name": "base",
    "type": "universal",
    "bodies": ["a", "ground"],
    "at": [0, 0.1, 0],
    "axes": [[0, 1, 1], [1, 0, 0]],
}
JOINTS = {
    "spherical": {"at": [0.8, 0.2, 0.1]},
    "revolute": {"at": [0.8, 0.2, 0.1], "axis": [1, 2, -1]},
    "universal": {"at": [0.8, 0.2, 0.1], "axes": [[1, 2, 0], [-2, 1, 3]]},
    "prismatic": {"at": [0.8, 0.2, 0.1], "axis": [1, -1, 3]},
    "cylindrical": {"at": [0.8, 0.2, 0.1], "axis": [1, -1, 3]},
    "planar": {"at": [0.8, 0.2, 0.1], "normal": [1, -1, 3]},
    "fixed": {},
    "distance": {"at": [[0.5, 0.2, 0.1], [1.3, 0.8, -0.2]]},
}


def applied(scene: Scene, turns):
    """What the loads of SCENE give, (2, 6) about the centres of mass."""
    inertia = turns[0] @ scene.inertias[0] @ turns[0].T
    follower = turns[0] @ [1.0, 4.0, 2.0]
    arm = turns[0] @ [0.1, -0.1, 0.2]
    first = follower + scene.masses[0] * np.array([1.0, 0.0, 2.0])
    moment = np.cross(arm, follower) + turns[0] @ [0.1, -0.2, 0.3] + inertia @ [1.0, 2.0, -3.0]
    push = np.array([3.0, -2.0, 1.0])
    arm = turns[1] @ scene.point(1, [1.2, 0.7, 0.2])
    couple = np.cross(arm, push) + np.array([0.3, 0.2, -0.5])
    return np.array([[*first, *moment], [*push, *couple]])


def with_fitting_velocities(content, seed: int) -> Scene:
    """Velocities of SCENE that its joints allow."""
    scene = Scene(content)
    rows = np.array([scene.slopes(row, scene.places, scene.turns) for row in scene.rows])
    some = np.random.default_rng(seed).normal(size=12)
    some -= np.linalg.pinv(rows, rcond=1e-10) @ (rows @ some)
    for number, body in enumerate(content["bodies"].values()):
        body["velocity"] = some[6 * number : 6 * number + 3].tolist()
        body["angular_velocity"] = some[6 * number + 3 : 6 * number + 6].tolist()
    return scene


@pytest.mark.parametrize("bodies", [["a", "b"], ["b", "a"], ["ground", "b"], ["b", "ground"]])
@pytest.mark.parametrize("kind", JOINTS)
def test_joints_move_and_pull_as_newton_and_euler_say(kind: str, bodies: list[str]) -> None:
    content = yaml.safe_load(SCENE)
    content["joints"] = [BASE, {"name": "joint", "type": kind, "bodies": bodies, **JOINTS[kind]}]
    scene = with_fitting_velocities(content, len(kind))
    motion = mdstopo.simulate(read_case(yaml.safe_dump(content, sort_keys=False)))
    assert motion.status.ok, motion.message
    for t in range(0, len(motion.t), 3):
        state = states(motion.q[t], motion.v[t])
        off, rate = scene.violations(*state)
        assert max(np.abs(off).max(), np.abs(rate).max()) < 1e-9
        a, wrenches = scene.accelerations(*state, applied(scene, state[1]))
        assert np.abs(motion.a[t] - a.ravel()).max() < 1e-9 * np.abs(a).max()
        for name, wanted in zip(("base", "joint"), wrenches, strict=True):
            if not np.isnan(wanted).any():
                assert np.abs(motion.reactions[name][t] - wanted).max() < 1e-9 * max(1.0, np.abs(wrenches[0]).max())


@pytest.mark.parametrize("kind", ["universal", "cylindrical"])
def test_stored_velocities_and_accelerations_are_rates_of_the_motion(kind: str) -> None:
    content = yaml.safe_load(SCENE)
    content["joints"] = [BASE, {"type": kind, "bodies": ["a", "b"], **JOINTS[kind]}]
    with_fitting_velocities(content, 5)
    motion = mdstopo.simulate(read_case(yaml.safe_dump(content, sort_keys=False)))
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for start, end in zip(motion.t[:-1], motion.t[1:], strict=True):
        half = 0.5 * (end - start)
        inside = motion.at(np.concatenate([[start, end], start + half * (1.0 + nodes)]))
        gained = half * (weights @ inside.a[2:])
        assert np.abs(inside.v[1] - inside.v[0] - gained).max() < 1e-7
        for body in range(2):
            travel = half * (weights @ inside.v[2:, 6 * body : 6 * body + 3])
            moved = inside.q[1, 7 * body : 7 * body + 3] - inside.q[0, 7 * body : 7 * body + 3]
            assert np.abs(moved - travel).max() < 1e-8
            turn = [states(q, v)[1][body] for q, v in zip(inside.q, inside.v, strict=True)]
            spun = half * sum(
                w * np.cross(v[6 * body + 3 : 6 * body + 6], r.T).T
                for w, v, r in zip(weights, inside.v[2:], turn[2:], strict=True)
            )
            assert np.abs(turn[1] - turn[0] - spun).max() < 1e-8
