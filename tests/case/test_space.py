"""Cases in space: bodies, joints, motions, loads, responses, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mdstopo.case.arrays import Table
from mdstopo.case.geometry.start_rotations import about_axis
from mdstopo.case.joints.joints_in_space import SPATIAL_JOINTS, SpatialDistanceJoint
from mdstopo.case.joints.spatial_joint import SpatialJoint
from mdstopo.case.model import Case, Load, SpatialBody
from mdstopo.case.reader import read_case
from mdstopo.case.responses.response_kinds import kind_of
from mdstopo.case.responses.response_units import unit_of
from tests.tiers import examples

from .scenes import EVERYTHING, EVERYTHING_IN_SPACE, SMALL, SPACE, changed, mistakes

UNIT = st.floats(-1, 1)
DIRECTIONS = st.tuples(UNIT, UNIT, UNIT).filter(lambda v: np.linalg.norm(v) > 0.1)
A = "a: {mass: 2, inertia: [2, 3, 4], position: [1, 2, 3]}"


def space(*changes: tuple[str, str]) -> Case:
    return read_case(changed(SPACE, *changes))


def body(keys: str) -> SpatialBody:
    """Body a with keys."""
    found = space((A, f"a: {{mass: 2, position: [1, 2, 3], {keys}}}")).body("a")
    assert isinstance(found, SpatialBody)
    return found


def joint(keys: str, turn: str = "{axis: [1, 2, 3], angle: 0.7}") -> SpatialJoint:
    """A joint from a, which is turned, to b."""
    case = space(
        ("joints: []", f"joints: [{{bodies: [a, b], {keys}}}]"),
        ("position: [1, 2, 3]}", f"position: [1, 2, 3], orientation: {turn}}}"),
    )
    (found,) = case.joints
    assert isinstance(found, SpatialJoint)
    return found


def told(*changes: tuple[str, str]) -> list[str]:
    """Key path and message of each mistake."""
    return [f"{each.path_key}: {each.message}" for each in mistakes(changed(SPACE, *changes))]


def test_every_section_of_a_case_in_space_is_read() -> None:
    case = read_case(EVERYTHING_IN_SPACE)
    assert [type(each) for each in case.joints] == list(SPATIAL_JOINTS.values())
    assert [each.rows for each in SPATIAL_JOINTS.values()] == [3, 5, 4, 5, 4, 3, 6, 1]
    assert case.load_cases[0].gravity == (0, 0, 0)
    assert case.load_case("moving").gravity == (0, 0, -9.8)
    assert case.points["many"].world.shape == (2 + 3 + 9 + 12 + 6 + 24 + 26 + 12, 3)
    (group, single) = case.members
    np.testing.assert_allclose(group.length, np.linalg.norm(group.q_world - group.p_world, axis=1), rtol=1e-15)
    assert single.p_world.tolist() == [[0, 1, 0]]


@pytest.mark.parametrize("text", [SMALL, EVERYTHING])
def test_a_case_without_dimension_is_planar_and_one_of_dimension_two_the_same(text: str) -> None:
    planar = read_case(text)
    assert planar.dimension == 2
    stated = read_case(text.replace("format: 1\n", "format: 1\ndimension: 2\n", 1))
    assert stated.bodies == planar.bodies
    assert stated.members == planar.members
    assert stated.objectives == planar.objectives


def test_the_dimension_stands_above_what_depends_on_it() -> None:
    late = changed(SPACE, ("dimension: 3\n", ""), ("time: {end: 0.2}\n", "time: {end: 0.2}\ndimension: 3\n"))
    (mistake,) = mistakes(late)
    assert mistake.message == "stands below gravity; it stands above all that depends on it"
    assert (mistake.line, mistake.column) == (4, 1)
    assert mistakes(changed(SPACE, ("dimension: 3", "dimension: 4")))[0].message == "found 4, allowed is 2 | 3"
    assert read_case(changed(SPACE, ("dimension: 3\n", "")), overrides={"dimension": 3}).dimension == 3


# Bodies.


def test_the_inertia_is_three_moments_or_a_tensor() -> None:
    assert body("inertia: [2, 3, 4]").inertia.tolist() == np.diag([2.0, 3.0, 4.0]).tolist()
    tensor = body("inertia: [[2, 0.1, 0], [0.1, 3, -0.2], [0, -0.2, 4]]").inertia
    assert tensor.tolist() == [[2, 0.1, 0], [0.1, 3, -0.2], [0, -0.2, 4]]
    assert not tensor.flags.writeable
    assert body("inertia: [1, 1, 2]").inertia[2, 2] == 2  # a flat plate
    assert body("inertia: [1, 1, 1e-12]").inertia[2, 2] == 1e-12  # a rod


@pytest.mark.parametrize(
    ("inertia", "message"),
    [
        ("5", "found 5, allowed is [Jxx, Jyy, Jzz] or the symmetric tensor of three rows"),
        ("[1, 2]", "found a list of 2, allowed is a list of 3"),
        ("[1, 1, 0]", "found 0, allowed is a number > 0"),
        (
            "[1, 2, 3.001]",
            "found the principal moments 1, 2, 3.001: no body has one that is above the sum of the others",
        ),
        ("[[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "found the principal moments -1, 1, 1, allowed are such > 0"),
        ("[[1, 2, 0], [2, 1, 0], [0, 0, 1]]", "found the principal moments -1, 1, 3, allowed are such > 0"),
        ("[[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]", "the tensor is not symmetric"),
        ("[[0, 0, 0], [0, 0, 0], [0, 0, 0]]", "all moments are zero, allowed are principal moments > 0"),
        ("[1e-200, 1e-200, 1e-200]", "found 1e-200, too extreme to compute with"),
    ],
)
def test_an_inertia_that_no_body_has_is_refused(inertia: str, message: str) -> None:
    assert any(line.endswith(f": {message}") for line in told(("inertia: [2, 3, 4]", f"inertia: {inertia}")))


@given(moments=st.tuples(*[st.floats(0.1, 10)] * 3), axis=DIRECTIONS, angle=st.floats(-4, 4))
@settings(max_examples=examples(25, 60), deadline=None, derandomize=True)
def test_a_turned_tensor_is_judged_by_its_principal_moments(
    moments: tuple[float, float, float], axis: tuple[float, float, float], angle: float
) -> None:
    turned = about_axis(axis, angle)
    tensor = turned @ np.diag(moments) @ turned.T
    text = f"inertia: {(0.5 * (tensor + tensor.T)).tolist()}"
    small, middle, large = sorted(moments)
    if large < (small + middle) * (1 - 1e-6):
        np.testing.assert_allclose(body(text).inertia, tensor, atol=1e-12)
    elif large > (small + middle) * (1 + 1e-6):
        assert "above the sum" in told(("inertia: [2, 3, 4]", text))[0]


@given(axis=DIRECTIONS, angle=st.floats(-7, 7), length=st.floats(1e-3, 1e3))
@settings(max_examples=examples(25, 60), deadline=None, derandomize=True)
def test_all_forms_of_an_orientation_are_one(axis: tuple[float, float, float], angle: float, length: float) -> None:
    along = np.array(axis) / np.linalg.norm(axis)
    expected = Rotation.from_rotvec(angle * along)
    x, y, z, w = expected.as_quat().tolist()
    forms = [
        f"{{axis: {(length * along).tolist()}, angle: {angle!r}}}",
        f"{{quaternion: {[w, x, y, z]}}}",
        f"{{quaternion: {[-w * (1 + 9e-7), *(-v * (1 + 9e-7) for v in (x, y, z))]}}}",
        f"{{matrix: {expected.as_matrix().tolist()}}}",
        f"{{matrix: {(expected.as_matrix() * (1 + 9e-7)).tolist()}}}",
        f"[{{axis: {axis}, angle: {angle / 2!r}}}, {{axis: {axis}, angle: {angle / 2!r}}}]".replace("(", "[").replace(
            ")", "]"
        ),
    ]
    for form in forms:
        found = body(f"inertia: [2, 3, 4], orientation: {form}").rotation
        np.testing.assert_allclose(found, expected.as_matrix(), atol=1e-14)
        np.testing.assert_allclose(found.T @ found, np.eye(3), atol=5e-16)
        assert not found.flags.writeable


def test_turns_of_a_list_are_about_global_axes_one_after_the_other() -> None:
    found = body(
        "inertia: [2, 3, 4], orientation: [{axis: [1, 0, 0], angle: 0.1}, {axis: [0, 1, 0], angle: 0.2}, "
        "{axis: [0, 0, 1], angle: 0.3}]"
    ).rotation
    np.testing.assert_allclose(found, Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix(), atol=1e-15)


def test_without_an_orientation_body_axes_are_global_and_exact_matrices_stay() -> None:
    assert body("inertia: [2, 3, 4]").rotation.tolist() == np.eye(3).tolist()
    matrix = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert body(f"inertia: [2, 3, 4], orientation: {{matrix: {matrix}}}").rotation.tolist() == matrix
    assert body("inertia: [2, 3, 4], velocity: [0, 0, 0]").stated == {"velocity"}


@pytest.mark.parametrize(
    ("orientation", "message"),
    [
        (
            "{quaternion: [1, 0, 0, 0.1]}",
            "a.orientation.quaternion: found a quaternion of norm 1.004987562, allowed is ",
        ),
        (
            "{quaternion: [0, 0, 0, 0]}",
            "a.orientation.quaternion: found a quaternion of norm 0, allowed is one of norm 1",
        ),
        ("{matrix: [[1, 0, 0], [0, 1, 1], [0, 0, 1]]}", "orientation.matrix: the columns are not perpendicular unit"),
        ("{matrix: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}", "orientation.matrix: the columns are left-handed"),
        ("{axis: [0, 0, 0], angle: 1}", "orientation.axis: found a zero vector, allowed is a direction"),
        ("{axis: [0, 0, 1]}", "orientation.axis: the key 'axis' goes with 'angle', which is not given"),
        ("{angle: 1}", "found none, needed is exactly one of axis, quaternion, matrix"),
        ("[]", "orientation: found an empty list, needed are at least 1 turns"),
        ("0.5", "orientation: found 0.5, allowed is {axis, angle}, {quaternion}, {matrix} or a list of {axis, angle}"),
    ],
)
def test_an_orientation_that_is_none_is_refused(orientation: str, message: str) -> None:
    lines = told(("position: [1, 2, 3]}", f"position: [1, 2, 3], orientation: {orientation}}}"))
    assert any(message in line for line in lines), lines


# What belongs to the other dimension.


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[2, 3, 4]", "[2, 3, 4], angle: 1", "bodies.a.angle: unknown key 'angle': in space it is `orientation`"),
        (
            "position: [1, 2, 3]",
            "position: [1, 2]",
            "bodies.a.position: found a list of 2, allowed is a list of 3; two are for a case in the plane",
        ),
        ("[1, 2, 3]", "[1, 2, 3], angular_velocity: 2", "bodies.a.angular_velocity: found 2, allowed is a list of 3"),
        (
            "[[0, 0, 0], [0, 1, 0]]",
            "[[0, 0], [0, 1]]",
            "points.p.grid.list[0]: found a list of 2, allowed is a row [x, y, z]",
        ),
        (
            "response: energy",
            "response: {angle: {body: a}}",
            "objectives.G.response.angle: unknown key 'angle': in space it is `rotation`",
        ),
        (
            "joints: []",
            "motions: [{body: a, angle: {velocity: 1}}]",
            "motions[0].angle: unknown key 'angle': in space it is `rotation`",
        ),
        (
            "force: [1, 0, 0]",
            "moment: 3",
            "loads[0].moment: found 3, allowed is [mx, my, mz], {formula: expressions of t} or "
            "{table: rows [t, mx, my, mz]}",
        ),
        (
            "gravity: [0, 0, -9.8]",
            "gravity: [0, -9.8]",
            "gravity: found a list of 2, allowed is a list of 3; two are for a case in the plane",
        ),
    ],
)
def test_a_planar_key_in_space_names_the_spatial_one(old: str, new: str, message: str) -> None:
    assert message in told((old, new))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "inertia: 3",
            "inertia: [3, 3, 3]",
            "bodies.a.inertia: found a list of 3, allowed is a number > 0; a list is for a case with `dimension: 3`",
        ),
        (
            "inertia: 3",
            "inertia: 3, orientation: {axis: [0, 0, 1], angle: 1}",
            "bodies.a.orientation: unknown key 'orientation': in the plane it is `angle`; it is for a case with "
            "`dimension: 3`",
        ),
        (
            "position: [0, 0]",
            "position: [0, 0, 0]",
            "bodies.a.position: found a list of 3, allowed is a list of 2; three are for a case with `dimension: 3`",
        ),
        (
            "response: energy",
            "response: {tilt: {body: a}}",
            "objectives.G.response.tilt: unknown key 'tilt': it is for a case with `dimension: 3`",
        ),
        (
            "response: energy",
            "response: {rotation: {body: a}}",
            "objectives.G.response.rotation: unknown key 'rotation': in the plane it is `angle`; it is for a "
            "case with `dimension: 3`",
        ),
        (
            "loads:",
            "joints: [{type: spherical, bodies: [a, b], at: [0, 0]}]\nloads:",
            "joints[0].type: found the text 'spherical'; it is for a case with `dimension: 3`",
        ),
        (
            "loads:",
            "motions: [{body: a, z: {velocity: 0}}]\nloads:",
            "motions[0].z: unknown key 'z': it is for a case with `dimension: 3`",
        ),
        (
            "{list: [[0, 0], [0, 1]]}",
            "{box: {from: [0, 0, 0]}}",
            "points.p.grid.box: unknown key 'box': it is for a case with `dimension: 3`",
        ),
        (
            "{list: [[0, 0], [0, 1]]}",
            "{circle: {center: [0, 0], radius: 1, count: 3, normal: [0, 0, 1]}}",
            "points.p.grid.circle.normal: unknown key 'normal': it is for a case with `dimension: 3`",
        ),
    ],
)
def test_a_spatial_key_in_the_plane_names_the_planar_one(old: str, new: str, message: str) -> None:
    assert message in [f"{each.path_key}: {each.message}" for each in mistakes(changed(SMALL, (old, new)))]


# Joints.


def in_space(of: SpatialJoint) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The axes on both bodies at the start, global, by rows; of a joint from `joint`."""
    first = about_axis((1, 2, 3), 0.7)
    return of.axes_first @ first.T, of.axes_second


@pytest.mark.parametrize(
    ("keys", "axis"),
    [
        ("type: spherical, at: [0, 0, 1]", None),
        ("type: revolute, at: [0, 0, 1], axis: [3, 0, -4]", [0.6, 0, -0.8]),
        ("type: prismatic, at: [0, 0, 1], axis: [0, 2, 0]", [0, 1, 0]),
        ("type: cylindrical, at: [0, 0, 1], axis: [0, 0, -2]", [0, 0, -1]),
        ("type: planar, at: [0, 0, 1], normal: [1e-200, 0, 0]", [1, 0, 0]),
        ("type: fixed", None),
        ("type: distance, at: [[0, 0, 0], [3, 0, 4]]", None),
    ],
)
def test_the_triads_of_a_fitting_joint_are_right_handed_and_coincide(keys: str, axis: list[float] | None) -> None:
    found = joint(keys)
    first, second = in_space(found)
    np.testing.assert_allclose(first, second, atol=2e-16)
    np.testing.assert_allclose(first @ first.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(first) == pytest.approx(1.0)
    if axis is not None:
        np.testing.assert_allclose(second[0], axis, atol=1e-16)


def test_points_and_lengths_of_joints() -> None:
    turned = about_axis((1, 2, 3), 0.7)
    found = joint("type: spherical, at: {b: [5, 5, 5], a: [0, 0, 1]}")
    np.testing.assert_allclose(found.at_first, turned.T @ np.array([-1, -2, -2]), atol=1e-15)
    assert found.at_second == (3, 5, 5)
    link = joint("type: distance, at: [[0, 0, 0], [3, 4, 12]]")
    assert isinstance(link, SpatialDistanceJoint)
    assert link.length == pytest.approx(13)
    np.testing.assert_allclose(joint("type: fixed").at_second, 0)  # at the second's centre of mass


def test_a_weld_to_ground_is_at_the_first_bodys_centre_of_mass() -> None:
    (weld,) = space(("joints: []", "joints: [{type: fixed, bodies: [a, ground]}]")).joints
    assert (weld.at_first, weld.at_second) == ((0, 0, 0), (1, 2, 3))


def test_a_universal_joint_carries_one_axis_on_each_body() -> None:
    first, second = in_space(joint("type: universal, at: [0, 0, 1], axes: [[0, 0, 3], [0, 2, 0]]"))
    np.testing.assert_allclose(first, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], atol=2e-16)
    np.testing.assert_allclose(second, [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], atol=2e-16)
    named = in_space(joint("type: universal, at: [0, 0, 1], axes: {b: [0, 2, 0], a: [0, 0, 3]}"))
    np.testing.assert_array_equal(named, (first, second))


@given(first=DIRECTIONS, second=DIRECTIONS)
@settings(max_examples=examples(20, 40), deadline=None, derandomize=True)
def test_axes_that_misfit_are_kept_and_differ_by_the_shortest_turn(
    first: tuple[float, float, float], second: tuple[float, float, float]
) -> None:
    one, other = (np.array(v) / np.linalg.norm(v) for v in (first, second))
    if abs(one @ other) < 1e-3:
        return  # which way is shorter turns on rounding
    axes = f"{{a: {list(first)}, b: {list(second)}}}"
    found = in_space(joint(f"type: prismatic, at: [0, 0, 1], axis: {axes}"))
    np.testing.assert_allclose(found[0][0], one, atol=1e-14)
    np.testing.assert_allclose(found[1][0], np.sign(one @ other) * other, atol=1e-14)
    turn = Rotation.from_matrix(found[1].T @ found[0]).as_rotvec()
    assert abs(turn @ one) < 1e-7
    assert np.linalg.norm(turn) == pytest.approx(math.acos(min(1.0, abs(one @ other))), abs=1e-7)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("type: revolute, at: [0, 0, 0]", "the key 'axis' is missing"),
        (
            "type: revolute, at: [0, 0, 0], axis: [0, 0, 0]",
            "joints[0].axis: found a zero vector, allowed is a direction",
        ),
        ("type: planar, at: [0, 0, 0], axis: [0, 0, 1]", "joints[0].axis: unknown key 'axis'"),
        (
            "type: universal, at: [0, 0, 0], axes: [[1, 0, 0], [-2, 0, 0]]",
            "joints[0].axes: the two axes are parallel, allowed are perpendicular ones",
        ),
        ("type: revolute, at: [0, 0, 0], axis: {a: [0, 0, 1]}", "joints[0].axis: the direction on b is missing"),
        (
            "type: revolute, at: [0, 0, 0], axis: {a: [0, 0, 1], ground: [0, 0, 1]}",
            "joints[0].axis.ground: 'ground' is none of the joint's bodies a, b",
        ),
        ("type: spherical, at: {a: [0, 0, 1]}", "joints[0].at: the point on b is missing"),
        ("type: distance, at: [[0, 0, 0], [0, 0, 0]]", "joints[0].at: the two points coincide; a link needs a length"),
        (
            "type: screw, at: [0, 0, 0]",
            "joints[0].type: found the text 'screw', allowed is spherical | revolute | universal",
        ),
    ],
)
def test_joints_that_cannot_be_are_refused(keys: str, message: str) -> None:
    lines = told(("joints: []", f"joints: [{{bodies: [a, b], {keys}}}]"))
    assert any(message in line for line in lines), lines


# Motions, loads, responses.


def test_motions_give_the_start_velocities_that_bodies_do_not_state() -> None:
    case = space(("joints: []", "motions: [{body: a, x: {velocity: 2}, z: {velocity: -1}}]"))
    (found,) = case.load_cases
    assert found.bodies[0].velocity == (2, 0, -1)
    assert found.motions[0].z is not None
    assert found.motions[0].y is None
    assert "motions[0].z.velocity: found 3 at the start, but bodies.a.velocity states 0; they must agree" in told(
        ("joints: []", "motions: [{body: a, z: {velocity: 3}}]"),
        ("position: [1, 2, 3]}", "position: [1, 2, 3], velocity: [0, 0, 0]}"),
    )


TURNS = [
    ("{roll: {velocity: 1}, pitch: {velocity: 2}, yaw: {acceleration: 3}}", (1, 2, 0)),
    ("{axis: [0, 3, 4], velocity: 5}", (0, 3, 4)),
    ("{axis: [0, 3, 4], position: {table: [[0, 0], [1, 5], [2, 10], [3, 15]]}}", (0, 3, 4)),
    ("{axis: [0, 3, 4], acceleration: 5}", (0, 0, 0)),
    ("{angular_velocity: {table: [[0, 1, 2, 3], [1, 0, 0, 0]]}}", (1, 2, 3)),
    ("{angular_velocity: [1, {table: [[0, 2], [1, 0]]}, 3]}", (1, 2, 3)),
]


@pytest.mark.parametrize(("rotation", "start"), TURNS)
def test_prescribed_rotations_give_the_angular_velocity_at_the_start(rotation: str, start: Any) -> None:
    case = space(("joints: []", f"motions: [{{body: a, rotation: {rotation}}}]"))
    (found,) = case.load_cases
    np.testing.assert_allclose(found.bodies[0].angular_velocity, start, atol=1e-14)


@pytest.mark.parametrize(
    ("rotation", "stated"),
    [
        ("{roll: {velocity: 1}, pitch: {acceleration: 2}, yaw: {acceleration: 3}}", (1, 5, 7)),
        ("{axis: [0, 0, 2], acceleration: 1}", (0, 0, 9)),
        ("{axis: [1, 2, 2], position: {table: [[0, 0], [1, 3], [2, 6], [3, 9]]}}", (1, 2, 2)),
    ],
)
def test_a_rotation_that_agrees_starts_as_the_body_states(rotation: str, stated: Any) -> None:
    case = space(
        ("joints: []", f"motions: [{{body: a, rotation: {rotation}}}]"),
        ("position: [1, 2, 3]}", f"position: [1, 2, 3], angular_velocity: {list(stated)}}}"),
    )
    assert case.load_cases[0].bodies[0].angular_velocity == stated


@pytest.mark.parametrize(
    ("rotation", "message"),
    [
        (
            "{yaw: {velocity: 0}}",
            "motions[0].rotation.yaw: the key 'yaw' goes with 'roll', which is not given",
        ),
        (
            "{roll: {velocity: 0}, pitch: {velocity: 0}}",
            "motions[0].rotation.roll: the key 'roll' goes with 'yaw', which is not given",
        ),
        (
            "{roll: {velocity: 0}, axis: [1, 0, 0], velocity: 1}",
            "motions[0].rotation: found roll and axis, needed is exactly one of roll, axis, angular_velocity",
        ),
        (
            "{axis: [1, 0, 0]}",
            "motions[0].rotation: found none, needed beside axis is exactly one of acceleration, velocity, position",
        ),
        (
            "{axis: [1, 0, 0], velocity: 1, acceleration: 2}",
            "motions[0].rotation: found acceleration and velocity, needed beside axis is exactly one of acceleration, "
            "velocity, position",
        ),
        ("{velocity: 1}", "motions[0].rotation.velocity: the key 'velocity' goes with 'axis', which is not given"),
        (
            "{angular_velocity: [1, 2]}",
            "motions[0].rotation.angular_velocity: found a list of 2, allowed is [wx, wy, wz] or "
            "{table: rows [t, wx, wy, wz]}",
        ),
        (
            "{angular_velocity: [1, 2, 4]}",
            "motions[0].rotation.angular_velocity: found 4 at the start, but bodies.a.angular_velocity's z states 3; "
            "they must agree",
        ),
        (
            "{axis: [0, 0, 1], acceleration: 4}",
            "motions[0].rotation.acceleration: found 0 at the start, but bodies.a.angular_velocity's x states 1; they "
            "must agree",
        ),
        (
            "{roll: {velocity: 1}, pitch: {velocity: 3}, yaw: {acceleration: 0}}",
            "motions[0].rotation.pitch.velocity: found 3 at the start, but bodies.a.angular_velocity's y states 2; "
            "they must agree",
        ),
        (
            "{axis: [1, 2, 3], position: {table: [[0, 1], [1, 2], [2, 3], [3, 4]]}}",
            "motions[0].rotation.position: found 1 at the start, needed is 0: it counts from there",
        ),
        (
            "{axis: [1, 2, 3], position: {table: [[0, 0], [0.03, 2], [0.06, 3], [0.1, 4]]}}",
            "motions[0].rotation.position: the table runs from 0 to 0.1 s; it must cover start 0 to end 0.2 s",
        ),
    ],
)
def test_prescribed_rotations_that_cannot_be_are_refused(rotation: str, message: str) -> None:
    lines = told(
        ("joints: []", f"motions: [{{body: a, rotation: {rotation}}}]"),
        ("position: [1, 2, 3]}", "position: [1, 2, 3], angular_velocity: [1, 2, 3]}"),
    )
    assert message in lines, lines


def load(keys: str, more: str = "") -> Load:
    case = space(
        ("- {body: b, force: [1, 0, 0]}", f"- {{body: a, {keys}}}"),
        ("position: [1, 2, 3]}", f"position: [1, 2, 3]{more}}}"),
    )
    return case.load_cases[0].loads[0]


def test_loads_have_three_components() -> None:
    found = load("force: [1, {table: [[0, 2], [1, 3]]}, 4], at: [2, 2, 3], moment: [5, 6, 7]")
    assert found.force[0] == 1
    assert isinstance(found.force[1], Table)
    assert found.at_local == (1, 0, 0)
    assert found.moment == (5, 6, 7)
    table = load("moment: {table: [[0, 1, 2, 3], [1, 4, 5, 6]]}").moment
    assert [each.values.ravel().tolist() for each in table] == [[1, 4], [2, 5], [3, 6]]
    assert load("acceleration: [1, 2, 3]").force == (2, 4, 6)
    assert load("force: [1, 0, 0]").moment == (0, 0, 0)


def test_an_angular_acceleration_of_global_axes_stays_one() -> None:
    found = load("angular_acceleration: [1, 2, 3], at: [1, 2, 3]", ", orientation: {axis: [0, 0, 1], angle: 0.5}")
    assert found.angular_acceleration == (1, 2, 3)
    assert found.moment == (0, 0, 0)
    assert load("force: [1, 0, 0]").angular_acceleration is None


def test_an_angular_acceleration_of_body_axes_is_a_moment() -> None:
    assert load("angular_acceleration: [1, 2, 3], frame: body").moment == (2, 6, 12)
    case = space(
        ("inertia: [2, 3, 4]", "inertia: [[2, 0.5, 0], [0.5, 3, 0], [0, 0, 4]]"),
        (
            "{body: b, force: [1, 0, 0]}",
            "{body: a, frame: body, angular_acceleration: "
            "[{table: [[0, 0], [1, 1]]}, {table: [[0, 2], [0.5, 2], [0.5, 4], [2, 4]]}, 1]}",
        ),
    )
    x, y, z = case.load_cases[0].loads[0].moment
    assert x.times.tolist() == [0, 0.5, 0.5, 1, 2]
    assert x.values.ravel().tolist() == [1, 2, 3, 4, 4]
    assert y.values.ravel().tolist() == [6, 6.25, 12.25, 12.5, 12.5]
    assert z.values.ravel().tolist() == [4] * 5


@pytest.mark.parametrize(
    ("response", "component", "unit"),
    [
        ("{displacement: {body: a, at: [1, 2, 4], component: z}}", "z", "m"),
        ("{velocity: {body: a, relative_to: b}}", "norm", "m/s"),
        ("{acceleration: {body: a, component: x}}", "x", "m/s^2"),
        ("{rotation: {body: a, component: y}}", "y", "rad"),
        ("{angular_velocity: {body: a}}", "norm", "rad/s"),
        ("{angular_acceleration: {body: a, component: z}}", "z", "rad/s^2"),
        ("energy", None, "J"),
        ("{member_force: {group: belts}}", None, "N"),
    ],
)
def test_responses(response: str, component: str | None, unit: str) -> None:
    (objective,) = space(("response: energy", f"response: {response}")).objectives
    assert objective.response.component == component
    assert objective.response.dimension == 3
    assert unit_of(objective.response) == unit
    assert kind_of(objective.response).word == objective.response.kind


def test_the_axis_of_a_tilt_is_in_body_coordinates() -> None:
    turn = ", orientation: {axis: [1, 0, 0], angle: 1.5707963267948966}"
    for keys, expected in (
        ("axis: [0, 0, 2]", (0, 1, 0)),
        ("axis: [0, 0, 2], frame: body", (0, 0, 1)),
        ("frame: body", (0, 0, 1)),
    ):
        case = space(
            ("response: energy", f"response: {{tilt: {{body: a, {keys}}}}}"),
            ("position: [1, 2, 3]}", f"position: [1, 2, 3]{turn}}}"),
        )
        np.testing.assert_allclose(case.objectives[0].response.numbers, expected, atol=1e-15)
        assert unit_of(case.objectives[0].response) == "rad"
    assert "the body itself" in told(("response: energy", "response: {tilt: {body: a, relative_to: a}}"))[0]
    assert "the body itself" in told(("response: energy", "response: {rotation: {body: a, relative_to: a}}"))[0]


def test_points_of_a_turned_body_go_there_and_back() -> None:
    turn = "position: [1, 2, 3], orientation: {axis: [1, 2, 3], angle: 0.7}}"
    case = space(("position: [1, 2, 3]}", turn), ("{body: a, grid", "{body: a, frame: body, grid"))
    turned = about_axis((1, 2, 3), 0.7)
    points = case.points["p"]
    np.testing.assert_allclose(points.world, points.local @ turned.T + np.array([1, 2, 3]), atol=1e-15)
    back = space(("position: [1, 2, 3]}", turn), ("[[0, 0, 0], [0, 1, 0]]", str(points.world.tolist())))
    np.testing.assert_allclose(back.points["p"].local, points.local, atol=1e-15)


def test_members_without_length_are_refused_with_their_place() -> None:
    lines = told(("[2, 2, 5]]", "[0, 1, 0]]"))
    assert lines == [
        "members.belts: 1 of the members would have zero length, the first from P 1 to Q 2 at [0, 1, 0]; "
        "move the points "
        "or set min_length"
    ]


def test_uncertain_values_are_read_in_space(tmp_path: Path) -> None:
    uncertain = "uncertainty: {parameters: {bodies.a.mass: {normal: {deviation: 0.1}}}}\nobjectives:"
    case = space(("objectives:", uncertain))
    assert case.uncertainty is not None
    assert case.uncertainty.numbers[0].nominal == 2
