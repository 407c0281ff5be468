"""The arrays of a scene in space say what the case says, in principal axes of its bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.general.model.general_model import MEMBER_EXCESS, MEMBER_FREE_LENGTH
from mdstopo.general.scene.compile_general import GeneralScene, compile_general
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.scene.origin import origin_of, seen_from

HULL = """
format: 1
dimension: 3
gravity: [0.5, 0, -9.81]
time: {end: 1}
bodies:
  hull:
    mass: 6
    inertia: [[2, 0.1, 0], [0.1, 3, 0.2], [0, 0.2, 4]]
    position: [0.1, 0.2, 0.3]
    orientation: {axis: [1, 2, 3], angle: 0.7}
    velocity: [0.3, 0, 0.1]
    angular_velocity: [0.5, -1, 2]
  cart: {mass: 2, inertia: [1, 1.5, 2], position: [2, 0, 0]}
points:
  rim: {body: hull, grid: {list: [[0.5, 0.2, 0.3], [0.1, 0.7, 0.4]]}}
  posts: {body: ground, grid: {list: [[1, 1, 0], [-1, 1, 1], [0, 0, 2]]}}
members:
  cords: {from: rim, to: posts, law: {type: spring, stiffness: 300}}
  short:
    {from: {body: cart, at: [2, 1, 0]}, to: {body: hull, at: [0, 1, 1]},
     law: {type: spring, stiffness: 3, free_length: 0.5}}
"""


def made(text: str) -> tuple[Case, GeneralScene]:
    case = read_case(text)
    return case, compile_general(case, case.load_cases[0])


def axes(scene: GeneralScene, body: int) -> np.ndarray:
    """R_home of a body: its principal axes at home."""
    return np.asarray(scene.model.home[body, 3:12].reshape(3, 3))


def world(scene: GeneralScene, body: int, local: Any) -> np.ndarray:
    return np.asarray(scene.model.home[body, :3] + np.asarray(local) @ axes(scene, body).T)


def test_bodies_stand_in_their_principal_axes() -> None:
    case, scene = made(HULL)
    hull = case.body("hull")
    model = scene.model
    assert scene.kinematics is SPATIAL
    assert scene.bodies == ("hull", "cart", "ground")
    assert scene.n == 12
    assert model.q0.tolist() == [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] * 3
    assert model.free.tolist() == [1] * 12 + [0] * 6
    assert model.home.shape == (3, 21)
    turned = Rotation.from_rotvec(0.7 * np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)).as_matrix()
    assert np.abs(np.asarray(hull.rotation) - turned).max() < 1e-15
    # the inertia in global axes, from moments and principal axes and from the case
    own = turned @ np.asarray(hull.inertia) @ turned.T
    assert np.abs(axes(scene, 0) @ np.diag(model.mass[3:6]) @ axes(scene, 0).T - own).max() < 1e-14
    assert model.mass[:3].tolist() == [6.0] * 3
    assert model.mass[6:12].tolist() == [2.0] * 3 + [1.0, 1.5, 2.0]
    assert np.abs(turned @ model.home[0, 12:].reshape(3, 3) - axes(scene, 0)).max() < 1e-15
    assert model.v0[:3].tolist() == [0.3, 0.0, 0.1]
    assert np.abs(axes(scene, 0) @ model.v0[3:6] - [0.5, -1.0, 2.0]).max() < 1e-15
    assert np.array_equal(axes(scene, 2), np.eye(3))
    assert scene.degrees_of_freedom == 12


def test_members_end_where_the_case_has_their_points() -> None:
    case, scene = made(HULL)
    model = scene.model
    assert model.member.shape[0] == 8
    for group, block in zip(case.members, model.block.tolist(), strict=True):
        pair, start, _, _, _, count, *_ = block
        first, second = model.pair[pair].tolist()
        part = model.member[:, start : start + count]
        ends = {first: world(scene, first, part[:3].T), second: world(scene, second, part[3:6].T)}
        numbers = {name: i for i, name in enumerate(scene.bodies)}
        assert np.abs(ends[numbers[group.body_from]] - group.p_world).max() < 2e-15
        assert np.abs(ends[numbers[group.body_to]] - group.q_world).max() < 2e-15
        length = np.linalg.norm(group.p_world - group.q_world, axis=1)
        free = part[MEMBER_FREE_LENGTH]
        assert np.abs(free - (0.5 if group.name == "short" else length)).max() < 2e-15
        assert np.abs(part[MEMBER_EXCESS] - (length**2 - free**2)).max() < 4e-15
        far = np.linalg.norm(part[3:6], axis=0).max()
        assert model.reach[pair] == pytest.approx(far, rel=1e-15)


LOADS = """
loads:
  - {body: hull, force: [1, 2, 3]}
  - {body: hull, force: [4, 5, 6], at: [0.2, 0.2, 0.3], moment: [7, 8, 9]}
  - {body: hull, force: [0.1, 0.2, 0.3], moment: [1, -1, 2], at: [0.5, 0, 0.1], frame: body}
  - {body: hull, moment: [0, 0, 5], frame: body}
  - {body: cart, acceleration: [1, 0, 0], angular_acceleration: [0, 0, {table: [[0, 0], [1, 4]]}]}
"""


def test_loads_act_as_the_case_says_at_any_attitude() -> None:
    case, scene = made(HULL + LOADS)
    model = scene.model
    hull = case.body("hull")
    tau = 0.25
    for turn in (Rotation.identity(), Rotation.from_rotvec([0.3, -0.5, 1.1])):  # of the principal axes since home
        force, moment = np.zeros((2, 3)), np.zeros((2, 3))  # global, about the centres of mass
        for b in range(2):
            now = axes(scene, b) @ turn.as_matrix()
            part = model.force[0, 6 * b : 6 * b + 6]
            value = part[:, 0] + tau * part[:, 1]
            force[b] += value[:3]
            moment[b] += now @ value[3:]
        for k, b in enumerate(model.load_body.tolist()):
            now = axes(scene, b) @ turn.as_matrix()
            value = model.load_force[0, k, :, 0] + tau * model.load_force[0, k, :, 1]
            push, couple = value[:3], value[3:]
            if model.load_follows[k] == 1:
                push, couple = now @ push, now @ couple
            if model.load_follows[k] == 2:
                couple = now @ (model.mass[6 * b + 3 : 6 * b + 6] * (now.T @ couple))
            force[b] += push
            moment[b] += couple + np.cross(now @ model.load_arm[k], push)
        gravity = np.array([0.5, 0.0, -9.81])
        principal = model.home[0, 12:].reshape(3, 3)
        own = axes(scene, 0) @ turn.as_matrix() @ principal.T  # the axes of the case's body
        arm = own @ np.asarray(hull.rotation).T @ (np.array([0.2, 0.2, 0.3]) - hull.position)
        follower = own @ np.array([0.1, 0.2, 0.3])
        wanted = 6.0 * gravity + [5.0, 7.0, 9.0] + follower
        couples = np.cross(arm, [4.0, 5.0, 6.0]) + np.array([7.0, 8.0, 9.0])
        couples += np.cross(own @ np.array([0.5, 0.0, 0.1]), follower) + own @ np.array([1.0, -1.0, 7.0])
        assert np.abs(force[0] - wanted).max() < 1e-14 * 60
        assert np.abs(moment[0] - couples).max() < 1e-14 * 20
        assert np.abs(force[1] - 2.0 * gravity - [2.0, 0.0, 0.0]).max() < 1e-14 * 20
        seen = axes(scene, 1) @ turn.as_matrix()
        inertia = seen @ np.diag([1.0, 1.5, 2.0]) @ seen.T
        assert np.abs(moment[1] - inertia @ [0.0, 0.0, 4.0 * tau]).max() < 1e-14


JOINTS = """
joints:
  - {name: ball, type: spherical, bodies: [hull, cart], at: [0.5, 0.1, 0]}
  - {name: hinge, type: revolute, bodies: [cart, hull], at: [1, 0, 0.4], axis: [1, 1, 0]}
  - {name: cardan, type: universal, bodies: [hull, cart], at: [1, 1, 0], axes: [[1, 0, 0], [0, 1, 1]]}
  - {name: slide, type: prismatic, bodies: [hull, ground], at: [0, 0, 0], axis: [1, 0, 2]}
  - {name: tube, type: cylindrical, bodies: [ground, hull], at: [0, 1, 0], axis: [0, 3, 0]}
  - {name: table, type: planar, bodies: [hull, cart], at: [0, 1, 0], normal: [1, 1, 1]}
  - {name: weld, type: fixed, bodies: [hull, cart]}
  - {name: rod, type: distance, bodies: [hull, cart], at: [[0, 0, 0], [3, 4, 0]]}
"""


def test_joints_have_their_points_and_axes() -> None:
    case, scene = made(HULL + JOINTS)
    model = scene.model
    assert model.joint[:, 4].tolist() == [3, 5, 4, 5, 4, 3, 6, 1]
    assert model.joint[:, 0].tolist() == list(range(8))
    assert model.joint_par.shape == (8, 30)
    phi, jac = np.zeros((8, 6)), np.zeros((8, 6, 12))
    SPATIAL.of_python("slopes_of")(model.joint, model.joint_par, model.home, model.q0, phi, jac)
    assert np.abs(phi).max() < 1e-15
    for joint, row, par in zip(case.joints, model.joint.tolist(), model.joint_par, strict=True):
        _, a, b, _, _ = row
        places = world(scene, a, par[0:3]), world(scene, b, par[3:6])
        first, second = axes(scene, a) @ par[6:15].reshape(3, 3).T, axes(scene, b) @ par[15:24].reshape(3, 3).T
        assert np.abs(par[24:27] - (places[1] - places[0])).max() < 1e-15 * 4, joint.name
        if joint.type == "distance":
            assert par[27] == 5.0
            assert np.abs(places[0]).max() < 1e-15
            continue
        assert np.abs(places[1] - places[0]).max() < 1e-15 * 4
        assert not par[24:27].any()
        for triad in (first, second):
            assert np.abs(triad.T @ triad - np.eye(3)).max() < 1e-14
            assert np.linalg.det(triad) == pytest.approx(1.0)
        if joint.type != "universal":
            assert np.abs(first - second).max() < 1e-14
        if joint.type == "revolute":
            assert np.abs(first[:, 0] - np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)).max() < 1e-14
        if joint.type == "universal":
            assert np.abs(first[:, 0] - [1.0, 0.0, 0.0]).max() < 1e-14
            assert np.abs(second[:, 0] - np.array([0.0, 1.0, 1.0]) / np.sqrt(2.0)).max() < 1e-14


def test_slopes_that_are_said_to_be_steady_are() -> None:
    case, scene = made(HULL + JOINTS)
    model = scene.model
    from mdstopo.general.scene.spatial_scene import SPACE

    found = []
    for seed in (1, 2):
        q = SPATIAL.retract(model.q0, 0.3 * np.random.default_rng(seed).normal(size=18) * np.repeat([1, 1, 0], 6))
        phi, jac = np.zeros((8, 6)), np.zeros((8, 6, 12))
        SPATIAL.of_python("slopes_of")(model.joint, model.joint_par, model.home, q, phi, jac)
        found.append(jac)
    for j, joint in enumerate(case.joints):
        for r, steady in enumerate(SPACE.joint_kernels(type(joint)).steady):
            for axis in steady:
                for side in (0, 6):
                    assert found[0][j, r, side + axis] == found[1][j, r, side + axis], (joint.name, r)


FOUR_BAR = """
format: 1
dimension: 3
time: {end: 1}
bodies:
  crank: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [0, 0.5, 0]}
  coupler: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [0.5, 1, 0]}
  rocker: {mass: 1, inertia: [0.1, 0.1, 0.1], position: [1, 0.5, 0]}
joints:
  - {type: revolute, bodies: [ground, crank], at: [0, 0, 0], axis: [0, 0, 1]}
  - {type: revolute, bodies: [crank, coupler], at: [0, 1, 0], axis: [0, 0, 1]}
  - {type: revolute, bodies: [coupler, rocker], at: [1, 1, 0], axis: [0, 0, 1]}
  - {name: last, type: revolute, bodies: [rocker, ground], at: [1, 0, 0], axis: [0, 0, 1]}
"""


def test_a_plane_loop_in_space_has_three_rows_that_others_imply() -> None:
    _, scene = made(FOUR_BAR)
    assert scene.degrees_of_freedom == 1
    assert int((scene.model.row < 0).sum()) == 4 * 6 - 17  # of five rows each of the four three are left out
    assert scene.redundant == ("last",)


def test_motions_drive_centres_of_mass() -> None:
    motions = """
motions:
  - {body: cart, x: {velocity: 2}, z: {position: {table: [[0, 0], [0.5, 0.2], [1, 0.1], [1.5, 0]]}}}
"""
    _, scene = made(HULL + motions)
    model = scene.model
    assert model.driven.tolist() == [6, 8]
    assert np.flatnonzero(model.free == 0).tolist() == [6, 8, *range(12, 18)]
    assert model.drive[0, 0].tolist() == [0.0, 2.0, 0.0, 0.0]
    assert np.abs(model.drive[:, 1, 0] - [0.0, 0.2]).max() < 1e-16
    assert scene.skipped == made(HULL)[1].skipped  # the cart still turns


def test_responses_have_their_points_and_axes() -> None:
    looks = """
objectives:
  tip: {response: {displacement: {body: hull, at: [1, 1, 1], component: z, relative_to: cart}}}
  lean: {response: {tilt: {body: hull, axis: [0, 0, 2]}}}
  turn: {response: {rotation: {body: hull, relative_to: cart, component: y}}}
  spin: {response: {angular_acceleration: {body: hull}}}
combine: {method: weighted_sum, weights: {tip: 1, lean: 1, turn: 1, spin: 1}}
"""
    _, scene = made(HULL + looks)
    response, par = scene.model.response, scene.model.response_par
    assert par.shape == (4, 8)
    assert np.abs(world(scene, 0, par[0, :3]) - 1.0).max() < 1e-15 * 2
    assert not par[0, 3:].any()
    assert np.abs(axes(scene, 0) @ par[1, 3:6] - [0.0, 0.0, 1.0]).max() < 1e-15
    assert response[:, 1].tolist() == [0, 0, 0, 0]
    assert response[:, 2].tolist() == [1, 2, 1, 2]
    assert response[:, 3].tolist() == [4, 2, 1, 2]
    assert response[:, 4].tolist() == [0, 0, 0, 2]


def test_a_scene_far_away_is_computed_from_a_point_of_its_own() -> None:
    far = HULL.replace("position: [2, 0, 0]", "position: [2000002, 0, -4000000]")
    for before, after in (
        ("position: [0.1, 0.2, 0.3]", "position: [2000000.1, 0.2, -3999999.7]"),
        ("[[0.5, 0.2, 0.3], [0.1, 0.7, 0.4]]", "[[2000000.5, 0.2, -3999999.7], [2000000.1, 0.7, -3999999.6]]"),
        ("[[1, 1, 0], [-1, 1, 1], [0, 0, 2]]", "[[2000001, 1, -4e6], [1999999, 1, -3999999], [2000000, 0, -3999998]]"),
        ("at: [2, 1, 0]", "at: [2000002, 1, -4e6]"),
        ("at: [0, 1, 1]", "at: [2000000, 1, -3999999]"),
    ):
        assert before in far
        far = far.replace(before, after)
    case = read_case(far)
    origin = origin_of(case)
    assert len(origin) == 3
    assert abs(origin[0] - 2e6) < 16.0
    assert abs(origin[2] + 4e6) < 16.0
    near = seen_from(case, origin)
    seen, wanted = compile_general(near, near.load_cases[0]).model, made(HULL)[1].model
    moved = np.array([2e6, 0.0, -4e6]) - origin
    assert np.abs(seen.home[:2, :3] - moved - wanted.home[:2, :3]).max() < 1e-9
    assert np.abs(seen.member[6:] - wanted.member[6:]).max() < 1e-8
    on_ground = seen.member[:3, :6] - moved[:, None]  # ground comes first
    assert np.abs(on_ground - wanted.member[:3, :6]).max() < 1e-9
    assert origin_of(read_case(HULL)) == (0.0, 0.0, 0.0)


def test_the_general_family_computes_every_case_in_space() -> None:
    case = read_case(HULL)
    engine = Evaluator(case, in_background=False)
    assert engine.beyond == "bodies in space"
    assert engine.integrator == "gauss"
    assert isinstance(next(iter(engine.scenes.values())), GeneralScene)
