"""Starts in space that are found: at rest under the loads (`settle`), and on the joints (`assemble`)."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from tests.general.support import check_exact_methods

from .newton_euler import Scene, states
from .test_bushings import pulls

#: an engine on a bushing and stays, with an arm on a ball that ropes hold
ENGINE = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.3}
bodies:
  engine: {mass: 20, inertia: [1, 1.4, 1.2], position: [0, 0, 0.5], orientation: {axis: [0.1, 0.2, 0.3], angle: 0.4}}
  arm: {mass: 3, inertia: [0.1, 0.14, 0.12], position: [0.6, 0.1, 0.5]}
bushings:
  - {bodies: [ground, engine], at: [0.3, 0, 0.3], stiffness: [20000, 20000, 30000, 500, 500, 500]}
joints:
  - {name: ball, type: spherical, bodies: [engine, arm], at: [0.3, 0.05, 0.5]}
points:
  lugs: {body: engine, grid: {list: [[0.2, 0.2, 0.6], [-0.2, 0.2, 0.6], [0, -0.2, 0.7]]}}
  posts: {body: ground, grid: {list: [[0.6, 0.5, 0.8], [-0.6, 0.5, 0.8], [0, -0.6, 0.9]]}}
  tip: {body: arm, grid: {list: [[0.9, 0.1, 0.55], [0.8, 0.3, 0.5], [0.7, 0.1, 0.4]]}}
  tops: {body: ground, grid: {list: [[0.9, 0.3, 1.5], [0.6, 0.9, 0.8], [1.6, -0.5, 0.8]]}}
members:
  stays: {from: lugs, to: posts, law: {type: spring, stiffness: 5000}}
  ropes: {from: tip, to: tops, connect: pairs, law: {type: spring, stiffness: 700, preload: 20}}
loads:
  - {body: engine, moment: [30, 5, 20], force: [0, 300, 0]}
objectives:
  sway: {response: {displacement: {body: arm, at: [0.9, 0.1, 0.55]}}, over_time: final}
  tilt: {response: {rotation: {body: arm}}, over_time: final}
combine: {weights: {sway: 1, tilt: 1}}
solver: {settle: true, tolerance: 1.0e-10}
"""


def test_a_scene_that_has_settled_stays_where_it_is_and_gradients_know_where() -> None:
    case = read_case(ENGINE)
    alpha = np.random.default_rng(1).uniform(0.3, 1.0, case.n_design)
    motion = mdstopo.simulate(case, alpha)
    turned = motion.q[:, 3:7] @ motion.q[0, 3:7]
    assert np.abs(motion.q - motion.q[0]).max() < 1e-9
    assert 1e-3 < 2.0 * np.arccos(motion.q[0, 3]) < 1.0  # of the engine, since home
    assert np.abs(turned - 1.0).max() < 1e-12
    check_exact_methods(case, alpha)


def test_forces_and_couples_of_another_program_balance_where_a_body_has_settled() -> None:
    content = yaml.safe_load(ENGINE)
    del content["joints"], content["bodies"]["arm"], content["points"]["tip"], content["points"]["tops"]
    del content["members"]["ropes"], content["objectives"], content["combine"], content["members"], content["points"]
    content["bodies"]["engine"].pop("velocity", None)
    motion = mdstopo.simulate(read_case(yaml.safe_dump(content, sort_keys=False)))
    x, turns, v, omega = states(motion.q[0], motion.v[0])
    wrench = pulls(content["bushings"][0], Scene(content), turns, x, v, omega)[0]
    outer = np.array([0.0, 300.0, -9.81 * 20, 30.0, 5.0, 20.0])
    assert np.abs(wrench + outer).max() < 1e-7 * np.abs(outer).max()


#: a crank whose pin does not meet the rod, a rod, and a slider beside its rail
MISFIT = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.3}
bodies:
  crank: {mass: 1, inertia: [0.01, 0.02, 0.02], position: [0, 0.1, 0.1]}
  rod: {mass: 1, inertia: [0.01, 0.05, 0.05], position: [0.4, 0.1, 0.22]}
  slider: {mass: 1, inertia: [0.01, 0.05, 0.05], position: [0.85, 0.02, 0.01]}
joints:
  - {name: pin, type: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [1, 0, 0.02]}
  - {name: ball, type: spherical, bodies: [crank, rod], at: {crank: [0, 0.2, 0.21], rod: [0.01, 0.2, 0.2]}}
  - {name: cross, type: universal, bodies: [rod, slider], at: [0.8, 0, 0], axes: [[0, 1, 0], [0, 0, 1]]}
  - {name: rail, type: prismatic, bodies: [ground, slider], at: [0.85, 0, 0], axis: [1, 0, 0]}
solver: {ASSEMBLE}
"""


def test_a_misfit_is_refused_and_put_onto_the_joints_on_request() -> None:
    with pytest.raises(CaseError, match=r"joint ball .* does not fit .*0\.01.*assemble: true"):
        mdstopo.simulate(read_case(MISFIT.replace("ASSEMBLE", "assemble: false")))
    motion = mdstopo.simulate(read_case(MISFIT.replace("ASSEMBLE", "assemble: true")))
    assert motion.status.ok, motion.message
    x, turns, _, _ = states(motion.q[0], motion.v[0])
    homes = (0, [0.0, 0.1, 0.1], [0.0, 0.2, 0.21]), (1, [0.4, 0.1, 0.22], [0.01, 0.2, 0.2])
    ends = [x[b] + turns[b] @ (np.array(at) - centre) for b, centre, at in homes]
    assert np.abs(ends[0] - ends[1]).max() < 1e-13
    stated = np.array([[0, 0.1, 0.1], [0.4, 0.1, 0.22], [0.85, 0.02, 0.01]])
    assert 1e-3 < np.abs(x - stated).max() < 0.03  # no farther than the joints need


def test_a_body_far_from_its_ball_turns_about_it_until_it_is_nearest() -> None:
    """All moments alike, so it turns in the plane of the way to the ball and of its arm: m D r sin(b - a) = I a."""
    mass, moment, arm, way = 1.3, 0.02, np.array([0.2, 0.1, 0.2]), np.array([-1.0, 0.4, 0.3])
    turned = {"axis": [1, 2, 3], "angle": 1}
    body = {"mass": mass, "inertia": [moment] * 3, "position": [0, 0, 0], "orientation": turned}
    ball = {"type": "spherical", "bodies": ["body", "ground"], "at": {"body": arm.tolist(), "ground": way.tolist()}}
    content = {"format": 1, "dimension": 3, "gravity": [0, 0, -9.81], "time": {"end": 0.1}, "bodies": {"body": body}}
    content |= {"joints": [ball], "solver": {"assemble": True}}
    motion = mdstopo.simulate(read_case(yaml.safe_dump(content, sort_keys=False)))
    far, length = np.linalg.norm(way), np.linalg.norm(arm)
    between = np.arccos(way @ arm / (far * length))
    angle = brentq(lambda a: mass * far * length * np.sin(between - a) - moment * a, 0.0, between, xtol=1e-14)
    turn = Rotation.from_rotvec(angle * np.cross(arm, way) / np.linalg.norm(np.cross(arm, way)))
    assert motion.q[0, :3] == pytest.approx(way - turn.apply(arm), abs=1e-6)
