"""Loads that stand on a floor: nothing holds their heading at rest, and they keep the one that the case states."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from tests.general.support import check_exact_methods

#: a crate that stands askew on four feet, with a lamp that springs hold above it
CRATE = """
format: 1
dimension: 3
time: {end: 0.02}
gravity: [0, 0, -9.81]
bodies:
  crate: {mass: 100, inertia: [12, 10, 14], position: [0.1, 0.05, 0.5], orientation: {axis: [0, 0, 1], angle: 0.3}}
  lamp: {mass: 5, inertia: [0.2, 0.1, 0.3], position: [0.3, 0.05, 1.2]}
points:
  feet: {body: crate, frame: global, grid: {list: [[0.6, 0.5, 0], [0.5, -0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0]]}}
  roof: {body: crate, frame: global, grid: {list: [[0.6, 0.5, 1], [0.5, -0.5, 1], [-0.5, 0.5, 1]]}}
  lugs: {body: lamp, frame: global, grid: {list: [[0.4, 0.1, 1.2], [0.3, -0.2, 1.3], [0.2, 0.1, 1.3]]}}
contacts:
  - {points: feet, on: {body: ground, plane: {at: [0, 0, 0], normal: [0, 0, 1]}}, stiffness: 20000}
members:
  ties: {from: roof, to: lugs, law: {type: spring, stiffness: 3000}}
objectives:
  x: {response: {displacement: {body: lamp, component: x}}, over_time: final}
  y: {response: {displacement: {body: lamp, component: y}}, over_time: final}
  z: {response: {rotation: {body: lamp, component: z}}, over_time: final}
  tilt: {response: {tilt: {body: crate}}, over_time: final}
combine: {weights: {x: 1, y: 1, z: 1, tilt: 1}}
solver: {settle: true, tolerance: 1.0e-10}
"""


def twist(turn: Rotation) -> float:
    """The angle about the vertical of a turn that is one about the vertical and one about a level axis."""
    _, _, z, w = turn.as_quat()
    return float(2.0 * np.arctan2(z, w))


def test_a_load_settles_with_its_heading_and_gradients_know_where() -> None:
    case = read_case(CRATE)
    alpha = np.random.default_rng(0).uniform(0.3, 1.0, case.n_design)
    q = mdstopo.simulate(case, alpha).q[0]
    crate, lamp = (Rotation.from_quat(q[at : at + 4], scalar_first=True) for at in (3, 10))
    assert 1e-3 < (crate * Rotation.from_rotvec([0, 0, 0.3]).inv()).magnitude() < 0.1
    assert abs(twist(crate) - 0.3) < 1e-12
    assert abs(twist(lamp)) > 1e-3  # which turns with the crate alone
    weighed = q[:2] * 100 + q[7:9] * 5  # no force along the floor
    assert np.abs(weighed - 100 * np.array([0.1, 0.05]) - 5 * np.array([0.3, 0.05])).max() < 1e-9
    check_exact_methods(case, alpha)


def test_an_angular_velocity_turns_with_the_body_that_settles() -> None:
    spin = np.array([0.4, -0.2, 3.0])  # rad/s, as the lamp is drawn, whose axes are the global ones
    case = read_case(CRATE, overrides={"bodies.lamp.angular_velocity": spin.tolist()})
    motion = mdstopo.simulate(case, np.random.default_rng(0).uniform(0.3, 1.0, case.n_design))
    before, after = (Rotation.from_quat(motion.at([t]).q[0, 10:14], scalar_first=True) for t in (0.0, 1e-6))
    assert before.magnitude() > 1e-3
    turned = (after * before.inv()).as_rotvec() / 1e-6
    assert np.abs(turned - before.apply(spin)).max() < 1e-3 * before.magnitude()
    assert np.abs(turned - spin).max() > 0.3 * before.magnitude()


def test_a_load_on_a_rail_has_no_free_turn() -> None:
    rail = "joints: [{type: prismatic, bodies: [ground, crate], at: [0.1, 0.05, 0.5], axis: [1, 0, 0]}]\nmembers:"
    case = read_case(CRATE.replace("members:", rail))
    q = mdstopo.simulate(case).q[0]
    assert np.abs(q[3:7] - [np.cos(0.15), 0, 0, np.sin(0.15)]).max() < 1e-12
    assert abs(100 * (q[0] - 0.1) + 5 * (q[7] - 0.3)) < 1e-9


def test_two_loads_keep_a_heading_each() -> None:
    """The second, much heavier one hangs on a ball, from which it is drawn askew."""
    bell = "  bell: {mass: 1.0e+6, inertia: [2.0e+5, 3.0e+5, 1.0e+5], position: [8.3, 0.2, 0.1]}\npoints:"
    ball = "joints: [{type: spherical, bodies: [ground, bell], at: [8, 0, 1]}]\nmembers:"
    case = read_case(CRATE.replace("points:", bell, 1).replace("members:", ball, 1))
    q = mdstopo.simulate(case).q[0]
    turns = [Rotation.from_quat(q[at : at + 4], scalar_first=True) for at in (3, 17)]
    assert abs(twist(turns[0]) - 0.3) < 1e-12
    assert abs(twist(turns[1])) < 1e-12
    assert turns[1].magnitude() > 0.2


def test_a_wheel_that_turns_about_a_level_axis_has_no_heading_and_is_refused() -> None:
    text = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.1}
bodies: {wheel: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 1]}}
joints: [{type: revolute, bodies: [ground, wheel], at: [0, 0, 1], axis: AXIS}]
solver: {settle: true}
"""
    with pytest.raises(CaseError, match="body wheel is free to turn"):
        mdstopo.simulate(read_case(text.replace("AXIS", "[0, 1, 0]")))
    assert mdstopo.simulate(read_case(text.replace("AXIS", "[0, 0, 1]"))).status.ok


def test_headings_and_their_slopes_are_those_of_the_turn_between_two_attitudes() -> None:
    rng = np.random.default_rng(3)
    up = np.array([0.3, -0.2, 0.9])
    home = np.zeros((2, 21))
    home[:, 3:12] = [Rotation.random(random_state=k).as_matrix().ravel() for k in (1, 2)]
    turns = Rotation.from_rotvec(rng.uniform(-1.0, 1.0, (2, 2, 3)).reshape(-1, 3)).as_quat(scalar_first=True)
    q, stated = (np.hstack([rng.normal(size=(2, 3)), each]).ravel() for each in (turns[:2], turns[2:]))
    found = SPATIAL.headings(home, up, q, stated)

    def angles(shift: np.ndarray) -> np.ndarray:
        return SPATIAL.headings(home, up, SPATIAL.retract(q, shift), stated).angle

    for body in range(2):
        about = np.zeros(12)
        about[6 * body + 3 : 6 * body + 6] = found.axis[body]
        turned = angles(0.7 * about) - found.angle  # turning about the vertical adds up
        assert np.abs(turned - 0.7 * np.eye(2)[body]).max() < 1e-13
        for k in range(3):
            step = np.zeros(12)
            step[6 * body + 3 + k] = 1e-4
            slope = (8.0 * (angles(step) - angles(-step)) - (angles(2 * step) - angles(-2 * step))) / 12e-4
            assert abs(slope[body] - found.slope[body, k]) < 1e-11


#: a crate between straps that are just not taut, and a spring that pulls it down askew
LASHED = """
format: 1
dimension: 3
time: {end: 0.02}
gravity: [0, 0, -9.81]
bodies:
  crate: {mass: 100, inertia: [12, 10, 14], position: [0.1, 0.05, 0.5]}
points:
  feet: {body: crate, frame: global, grid: {list: [[0.6, 0.5, 0], [0.5, -0.5, 0], [-0.5, 0.5, 0], [-0.5, -0.5, 0]]}}
  roof: {body: crate, frame: global, grid: {list: [[0.6, 0.5, 1], [0.5, -0.5, 1], [-0.5, 0.5, 1]]}}
  rings: {body: ground, grid: {list: [[1.2, 0.7, 0], [0.8, -1.1, 0], [-1.3, 0.4, 0.2]]}}
contacts:
  - {points: feet, on: {body: ground, plane: {at: [0, 0, 0], normal: [0, 0, 1]}}, stiffness: 20000}
members:
  straps: {from: roof, to: rings, connect: pairs, law: {type: gap, stiffness: 2.0e+5, gap: 0}}
objectives:
  x: {response: {displacement: {body: crate, component: x}}, over_time: final}
solver: {settle: true, tolerance: 1.0e-10}
"""


def test_straps_that_pull_on_the_way_alone_do_not_move_a_load_or_turn_it() -> None:
    """They are as long as they are without force at the start, and slack once the crate has sunk."""
    case = read_case(LASHED)
    q = mdstopo.simulate(case, np.array([1.0, 0.4, 0.7])).q[0]
    assert q[2] < 0.5 - 1e-3
    assert np.abs(q[:2] - [0.1, 0.05]).max() < 1e-12
    assert abs(twist(Rotation.from_quat(q[3:7], scalar_first=True))) < 1e-12
