"""Bodies in space whose motion is prescribed: what they do to others, what drives them, and gradients."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.finalize.lift_case import lifted
from mdstopo.status import Status
from tests.general.support import slopes

from .newton_euler import Scene, states
from .support import CASES, load

CONTENT = yaml.safe_load((CASES / "driven.yaml").read_text())


def rotor(t: float) -> tuple[np.ndarray, Rotation]:
    """Where the rotor's centre of mass is by the case's motions, and by how much it has turned."""
    table = {"y": CONTENT["motions"][0]["y"], "roll": CONTENT["motions"][0]["rotation"]["roll"]}
    y, roll = (CubicSpline(*np.array(each["position"]["table"]).T)(t) for each in table.values())
    late = max(t - 0.4, 0.0)
    early = min(t, 0.4)
    pitch = 0.5 * early + 0.5 * 6.25 * early**2 + 3.0 * late - 0.5 * (5.0 / 0.6) * late**2
    early, late = min(t, 0.5), max(t - 0.5, 0.0)
    yaw = 6.0 * early**2 + 26.0 / 6.0 * early**3 + (12.0 * 0.5 + 26.0 * 0.125) * late + 12.5 * late**2
    return np.array([0.3 * t, float(y), -0.2 * t**2]), Rotation.from_euler("xyz", [float(roll), pitch, yaw])


def spinner(t: float) -> Rotation:
    """By how much the spinner has turned."""
    table = np.array(CONTENT["motions"][1]["rotation"]["angular_velocity"]["table"])
    turn = np.eye(3).ravel()
    ends = [0.0, *(each for each in (0.2, 0.6) if each < t), t]
    for start, end in itertools.pairwise(ends):
        turn = solve_ivp(
            lambda s, m: np.cross(
                [np.interp(s, table[:, 0], column) for column in table[:, 1:].T], m.reshape(3, 3), axisb=0
            ).T.ravel(),
            (start, end), turn, method="DOP853", rtol=1e-13, atol=1e-13,
        ).y[:, -1]  # fmt: skip
    return Rotation.from_matrix(turn.reshape(3, 3))


def carried(scene: Scene, body: int, at: Any, x: Any, turns: Any, v: Any, omega: Any) -> tuple[np.ndarray, np.ndarray]:
    """Place and velocity of a point at the start."""
    place, rate, _ = scene.carried(body, scene.point(body, at), x, turns, v, omega)
    return place, rate


def wrenches(scene: Scene, x: Any, turns: Any, v: Any, omega: Any, alpha: float) -> np.ndarray:
    """(n_bodies, 6): what members and loads of the case do about the centres of mass, global."""
    out = np.zeros((len(x), 6))

    def push(body: int, force: Any, spot: Any) -> None:
        if body >= 0:
            out[body] += [*force, *np.cross(spot - x[body], force)]

    for group in CONTENT["members"].values():
        ends = []
        for end in (group["from"], group["to"]):
            points = CONTENT["points"][end]
            body = -1 if points["body"] == "ground" else scene.names.index(points["body"])
            ends.append([(body, at) for at in points["grid"]["list"]])
        for one, p0 in ends[0]:
            for two, q0 in ends[1]:
                (p, p_rate), (q, q_rate) = (
                    carried(scene, body, at, x, turns, v, omega) for body, at in ((one, p0), (two, q0))
                )
                length = np.linalg.norm(q - p)
                along = (q - p) / length
                law = group["law"]
                stretch = length - np.linalg.norm(np.array(q0) - p0)
                force = law["stiffness"] * stretch + law.get("damping", 0.0) * along @ (q_rate - p_rate)
                push(one, alpha * force * along, p)
                push(two, -alpha * force * along, q)
    spot = carried(scene, 0, CONTENT["loads"][0]["at"], x, turns, v, omega)[0]
    push(0, np.array([1.0, 2.0, 3.0]), spot)
    out[0, 3:] += [0.3, -0.2, 0.5]
    out[2, 3:] += turns[2] @ [0.5, 0.0, 1.0]
    return out


def test_driven_bodies_move_as_stated_and_others_as_newton_and_euler_say() -> None:
    case = load("driven")
    scene = Scene(CONTENT)
    motion = mdstopo.simulate(case)
    assert motion.status.ok, motion.message
    alpha = float(case.initial[0])
    for t in range(0, len(motion.t), 6):
        x, turns, v, omega = states(motion.q[t], motion.v[t])
        place, turned = rotor(motion.t[t])
        assert np.abs(x[0] - place).max() < 1e-14
        assert np.abs(turns[0] - turned.as_matrix() @ scene.turns[0]).max() < 1e-13
        assert np.abs(turns[2] - spinner(motion.t[t]).as_matrix() @ scene.turns[2]).max() < 1e-11
        # rows: three of the ball, then of the rotor x, y, z and its rotation, then the spinner's rotation
        forces = wrenches(scene, x, turns, v, omega, alpha)
        forces[0] -= motion.lam[t, 3:9]
        forces[2, 3:] -= motion.lam[t, 9:12]
        a, of_joints = scene.accelerations(x, turns, v, omega, forces)
        assert np.abs(motion.a[t] - a.ravel()).max() < 1e-9 * np.abs(a).max(), t
        assert np.abs(motion.reactions["ball"][t] - of_joints[0]).max() < 1e-9 * np.abs(of_joints[0]).max()


def test_a_body_pulled_by_a_driven_one_moves_as_an_integrator_says() -> None:
    scene = Scene(CONTENT)
    motion = mdstopo.simulate(load("driven"))
    assert motion.status.ok
    inertia = scene.inertias[1]
    home = scene.turns[0]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        turn = y[3:12].reshape(3, 3)
        x, v, turns, omega = np.zeros((4, 3)), np.zeros((4, 3)), np.array(scene.turns), np.zeros((4, 3))
        place, turned = rotor(t)
        h = 1e-4
        ahead, back = rotor(t + h), rotor(t - h)
        x[0], v[0] = place, (ahead[0] - back[0]) / (2.0 * h)
        turns[0], omega[0] = turned.as_matrix() @ home, (ahead[1] * back[1].inv()).as_rotvec() / (2.0 * h)
        x[1], v[1], turns[1], omega[1] = y[:3], y[12:15], turn, y[15:]
        push = wrenches(scene, x, turns, v, omega, 0.1)[1]
        now = turn @ inertia @ turn.T
        spin = np.linalg.solve(now, push[3:] - np.cross(y[15:], now @ y[15:]))
        speed = np.cross(y[15:], turn, axisb=0).T.ravel()
        return np.concatenate([y[12:15], speed, push[:3] / scene.masses[1] + scene.gravity, spin])

    body = CONTENT["bodies"]["weight"]
    y = np.concatenate([body["position"], scene.turns[1].ravel(), np.zeros(3), body["angular_velocity"]])
    for start, end in ((0.0, 0.4), (0.4, 0.5), (0.5, 0.8)):
        y = solve_ivp(rates, (start, end), y, method="DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    x, turns, v, omega = states(motion.q[-1], motion.v[-1])
    for found, expected in ((x[1], y[:3]), (turns[1].ravel(), y[3:12]), (v[1], y[12:15]), (omega[1], y[15:])):
        assert np.abs(found - expected).max() < 1e-6


def test_gradients_with_driven_bodies_are_slopes() -> None:
    case = load("driven")
    rng = np.random.default_rng(3)
    alpha = np.array(case.initial) * rng.uniform(0.7, 1.3, case.n_design)
    direction = rng.normal(size=case.n_design) * alpha
    check_gradients(case, alpha, direction, 2e-3, 1e-7)


def check_gradients(case: Any, alpha: np.ndarray, direction: np.ndarray, h: float, bound: float) -> None:
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, alpha, method="direct")
    differences = slopes(case, alpha, direction, h)
    for name, gradient in found.gradients.items():
        size = np.abs(gradient).max()
        assert size > 0.0, name
        assert abs(differences[name] - gradient @ direction) < bound * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-9 * size, name


@pytest.mark.parametrize("rate", [150.0, 200.0 * np.pi])
def test_a_body_may_turn_by_more_than_half_a_turn_in_a_step(rate: float) -> None:
    content = {key: CONTENT[key] for key in ("format", "dimension", "bodies", "points", "members")}
    content |= {
        "time": {"end": 0.4},
        "solver": {"step": 0.04},  # by 6 rad, or four whole turns
        "motions": [
            {"body": "rotor", "rotation": {"axis": [1, 2, -1], "velocity": float(rate)}},
            {"body": "spinner", "rotation": {"angular_velocity": [[0, rate, 0, 9], [0.4, 0, rate, 0]]}},
        ],
        "objectives": {
            name: {"response": {"displacement": {"body": name}}, "over_time": "final"} for name in ("weight", "spinner")
        },
        "combine": {"weights": {"weight": 1, "spinner": 1}},
    }
    case = read_case(yaml.safe_dump(content, sort_keys=False))
    motion = mdstopo.simulate(case)
    assert motion.status.ok, motion.message
    axis = np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0)
    start = Rotation.from_matrix(Scene(CONTENT).turns[0])
    for t, q in zip(motion.t, motion.q, strict=True):
        now = Rotation.from_quat(np.roll(q[3:7], -1))
        assert (now * (Rotation.from_rotvec(rate * t * axis) * start).inv()).magnitude() < 1e-12
    rng = np.random.default_rng(5)
    alpha = np.array(case.initial) * rng.uniform(0.7, 1.3, case.n_design)
    # gradients are those of the steps, however long these are
    check_gradients(case, alpha, rng.normal(size=case.n_design) * alpha, 1e-3, 1e-7)


PLANAR = """
format: 1
gravity: [0, -9.81]
time: {end: 0.7}
solver: {tolerance: 1e-11}
bodies:
  crank: {mass: 2, inertia: 0.3, position: [0.4, 0.3], velocity: CRANK}
  rod: {mass: 1, inertia: 0.1, position: [1.3, 0.4], velocity: ROD}
  wheel: {mass: 3, inertia: 0.2, position: [3, 0], angular_velocity: 4}
joints:
  - {name: pin, type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {name: elbow, type: revolute, bodies: [crank, rod], at: [0.8, 0.6]}
motions:
  - {body: crank, angle: {position: {table: [[0, 0.3], [0.2, 1.1], [0.5, 2.9], [0.7, 5]]}}}
  - {body: wheel, angle: {acceleration: {table: [[0, 30], [0.4, -20]]}}}
points:
  tip: {body: rod, grid: {list: [[1.8, 0.2], [1.5, 0.6]]}}
  rim: {body: wheel, grid: {circle: {center: [3, 0], radius: 0.4, count: 3}}}
  posts: {body: ground, grid: {list: [[2.5, 2], [3.5, 1.5]]}}
members:
  cords: {from: tip, to: rim, law: {type: spring, stiffness: 50, damping: 0.5}}
  stays: {from: rim, to: posts, law: {type: spring, stiffness: 300}}
objectives:
  G1: {response: energy, over_time: mean}
  G2: {response: {displacement: {body: wheel}}, over_time: max}
  G3: {response: {angular_velocity: {body: rod}}, over_time: rms}
  G4: {response: {joint_force: {joint: elbow}}, over_time: max}
  G5: {response: {velocity: {body: rod, at: [1.8, 0.2], relative_to: wheel}}, over_time: max}
combine: {weights: {G1: 1, G2: 1, G3: 1, G4: 1, G5: 1}}
"""


def test_a_planar_scene_with_driven_angles_is_the_same_in_a_tilted_plane() -> None:
    rate = float(CubicSpline([0, 0.2, 0.5, 0.7], [0.3, 1.1, 2.9, 5])(0.0, 1))
    text = PLANAR.replace("CRANK", str([-0.3 * rate, 0.4 * rate])).replace("ROD", str([-0.6 * rate, 0.8 * rate]))
    planar = read_case(text)
    spatial = read_case(lifted(planar, (1.0, -2.0, 0.5), 0.7))
    alpha = np.array(planar.initial) * np.random.default_rng(2).uniform(0.7, 1.3, planar.n_design)
    flat, tilted = (mdstopo.evaluate(case, alpha) for case in (planar, spatial))
    assert flat.status is tilted.status is Status.OK
    for name, value in flat.objectives.items():
        assert tilted.objectives[name] == pytest.approx(value, rel=1e-10), name
        gradient = flat.gradients[name]
        assert np.abs(tilted.gradients[name] - gradient).max() < 1e-9 * np.abs(gradient).max(), name
