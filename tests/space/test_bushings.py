"""Bushings in space: what they pull with, their gradients, and where they end a run."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.finalize.lift_case import lifted
from mdstopo.status import Status
from tests.general.support import slopes

from .newton_euler import Scene, states

CASE = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.6}
solver: {tolerance: 1e-10}
bodies:
  a:
    mass: 2
    inertia: [[0.3, 0.02, -0.01], [0.02, 0.4, 0.03], [-0.01, 0.03, 0.5]]
    position: [0.4, 0.1, 0]
    orientation: [{axis: [1, 2, 0], angle: 0.7}]
    velocity: [0.3, 0, 0.2]
    angular_velocity: [1, -2, 3]
  b:
    mass: 1.5
    inertia: [0.1, 0.2, 0.15]
    position: [1.2, 0.4, 0.3]
    orientation: {axis: [0, 1, 1], angle: -1.1}
    angular_velocity: [-2, 1, 0.5]
bushings:
  - {bodies: [a, b], at: [0.8, 0.2, 0.1], stiffness: [300, 500, 200, 8, 12, 5], damping: [3, 1, 2, 0.1, 0.3, 0.2]}
  - {bodies: [ground, a], at: {ground: [0, 0, 0], a: [0.05, 0.02, -0.01]}, stiffness: [900, 700, 800, 20, 10, 15]}
points:
  knobs: {body: b, grid: {list: [[1.5, 0.4, 0.3], [1.2, 0.8, 0.3]]}}
  hooks: {body: ground, grid: {list: [[2, 0.4, 1], [1.2, 1.8, 0.2]]}}
members:
  cords: {from: knobs, to: hooks, law: {type: spring, stiffness: 60}}
objectives:
  sway: {response: {displacement: {body: b, at: [1.5, 0.4, 0.3], component: norm}}, over_time: max}
  turn: {response: {rotation: {body: b, relative_to: a, component: y}}, over_time: rms}
  push: {response: {acceleration: {body: a, component: z}}, over_time: mean}
combine: {method: weighted_sum, weights: {sway: 1, turn: 1, push: 1}}
"""


def pulls(bushing, scene: Scene, turns, x, v, omega):
    """(2, 6) global wrench of a bushing about the centres of mass; its couple is the slope of its potential."""
    one, two = (-1 if name == "ground" else scene.names.index(name) for name in bushing["bodies"])
    at = bushing["at"]
    ends = [at[name] if isinstance(at, dict) else at for name in bushing["bodies"]]
    own = [scene.point(body, end) for body, end in zip((one, two), ends, strict=True)]
    frame, home = (np.eye(3), np.eye(3)) if one < 0 else (turns[one], scene.turns[one])
    place, speed, spin = (np.zeros(3),) * 3 if one < 0 else (x[one], v[one], omega[one])
    end = x[two] + turns[two] @ own[1]
    stiff, damp = np.array(bushing["stiffness"]), np.array(bushing.get("damping", [0.0] * 6))
    d = frame.T @ (end - place) - own[0]
    # its rate as an observer on the first body sees it
    rate = frame.T @ (v[two] + np.cross(omega[two], end - x[two]) - speed - np.cross(spin, end - place))
    force = -frame @ (stiff[:3] * d + damp[:3] * rate)

    def potential(turn):
        seen = frame.T @ Rotation.from_rotvec(turn).as_matrix() @ turns[two] @ (home.T @ scene.turns[two]).T
        vector = Rotation.from_matrix(seen).as_rotvec()
        return 0.5 * vector @ (stiff[3:] * vector)

    h = 1e-3
    couple = np.array(
        [sum(w * potential(k * h * e) for k, w in ((1, 8), (-1, -8), (2, -1), (-2, 1))) / (12 * h) for e in np.eye(3)]
    )
    couple = -couple - frame @ (damp[3:] * (frame.T @ (omega[two] - spin)))
    out = np.zeros((2, 6))
    for body, sign in ((one, -1.0), (two, 1.0)):
        if body >= 0:
            out[body] += sign * np.array([*force, *(np.cross(end - x[body], force) + couple)])
    return out


def test_bushings_pull_as_their_potential_and_dampers_say() -> None:
    content = yaml.safe_load(CASE)
    del content["members"], content["points"]
    motion = mdstopo.simulate(read_case(yaml.safe_dump(content, sort_keys=False)))
    assert motion.status.ok, motion.message
    scene = Scene(content)
    for t in range(0, len(motion.t), 5):
        x, turns, v, omega = states(motion.q[t], motion.v[t])
        forces = sum(pulls(each, scene, turns, x, v, omega) for each in content["bushings"])
        a, _ = scene.accelerations(x, turns, v, omega, forces)
        assert np.abs(motion.a[t] - a.ravel()).max() < 1e-8 * np.abs(a).max()


@pytest.mark.parametrize("integrator", ["runge_kutta", "gauss"])
def test_gradients_through_bushings_are_slopes(integrator: str) -> None:
    case = read_case(CASE, overrides={"solver.integrator": integrator})
    alpha = np.array([0.7, 1.3, 1.1, 0.8]) * case.initial
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direct = mdstopo.evaluate(case, alpha, method="direct")
    direction = np.array([1.0, -0.6, 0.4, 0.9]) * alpha
    differences = slopes(case, alpha, direction, 1e-3)
    for name, gradient in found.gradients.items():
        assert abs(differences[name] - gradient @ direction) < 3e-8 * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() < 1e-9 * np.abs(gradient).max(), name


SPUN = """
format: 1
dimension: 3
time: {end: 3}
bodies:
  a: {mass: 1, inertia: [0.2, 0.2, 0.3], position: [0, 0, 0], velocity: [0.1, 0, 0]}
  b:
    mass: 1
    inertia: [0.1, 0.2, 0.15]
    position: [1, 0, 0]
    orientation: {axis: [1, 1, 1], angle: 2}
    angular_velocity: [RATE, 0, 0]
bushings: [{bodies: [b, ground], at: [1, 0, 0], stiffness: [100, 100, 100, 0.1, 0.1, 0.1]}]
objectives: {turn: {response: {rotation: {body: b}}, over_time: max}}
"""


def test_a_bushing_that_turns_by_half_a_turn_ends_the_run_with_that_reason() -> None:
    motion = mdstopo.simulate(read_case(SPUN.replace("RATE", "6")))
    assert motion.status is Status.HALF_TURN
    assert "bushings[0] (between b and ground), at t = 0.5" in motion.message
    turned = Rotation.from_quat(np.roll(motion.q[:, 10:14], -1, axis=1))
    assert (turned * turned[0].inv()).magnitude().max() < np.pi
    assert mdstopo.evaluate(read_case(SPUN.replace("RATE", "6"))).status is Status.HALF_TURN
    # slower, it swings back before
    assert mdstopo.simulate(read_case(SPUN.replace("RATE", "2"))).status.ok


PLANAR = """
format: 1
gravity: [0, -9.81]
time: {end: 0.8}
solver: {integrator: runge_kutta, tolerance: 1e-11}
bodies:
  a: {mass: 2, inertia: 0.3, position: [0.4, 0.1], angle: 0.4, velocity: [0.3, 0.2]}
  b: {mass: 1.5, inertia: 0.2, position: [1.2, 0.4], angular_velocity: 2}
bushings:
  - {bodies: [a, b], at: [0.8, 0.2], stiffness: [300, 500, 8], damping: [3, 1, 0.1]}
  - {bodies: [ground, a], at: [0, 0], stiffness: [900, 900, 20], damping: [2, 2, 0.3]}
objectives: {sway: {response: {displacement: {body: b, at: [1.5, 0.4]}}, over_time: max}}
"""


@pytest.mark.parametrize("tilt", [((0.0, 0.0, 1.0), 0.0), ((1.0, 2.0, -1.0), 0.8)])
def test_a_planar_bushing_in_space_pulls_as_in_its_plane(tilt: tuple[tuple[float, float, float], float]) -> None:
    case = read_case(PLANAR)
    found = mdstopo.evaluate(read_case(lifted(case, *tilt)), gradient=False)
    assert found.objectives["sway"] == pytest.approx(
        mdstopo.evaluate(case, gradient=False).objectives["sway"], rel=1e-10
    )


def test_bushings_take_six_numbers_in_space() -> None:
    with pytest.raises(CaseError, match="in space it is six"):
        read_case(
            SPUN.replace("RATE", "1").replace("0.1, 0.1, 0.1]}]", "0.1]}]").replace("[100, 100, 100,", "[100, 100,")
        )
    stiff = PLANAR.replace("[900, 900, 20]", "[900, 800, 20]")
    with pytest.raises(CaseError, match="along axes of ground it differs"):
        lifted(read_case(stiff), (1, 0, 0), 0.3)
    lifted(read_case(stiff))
