"""Contacts in space against Newton's and Euler's equations, differences, closed forms, and the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.finalize.lift_case import lifted
from tests.general.support import check_direct, design_of, slopes
from tests.general.test_contact import HIT

from .newton_euler import Scene, states
from .support import CASES, load

CONTENT = yaml.safe_load((CASES / "contacts.yaml").read_text())


def surface(scene: Scene, on: dict[str, Any], x: Any, turns: Any, z: Any) -> tuple[float, Any, bool]:
    """Height of a global point z over the surface of a body, the normal, and whether the point is within its ends."""
    body = -1 if on["body"] == "ground" else scene.names.index(on["body"])
    shape = next(key for key in ("plane", "rectangle", "sphere", "cylinder") if key in on)
    keys = on[shape]

    def here(at: Any) -> Any:
        local = scene.point(body, np.array(at, dtype=float))
        return local if body < 0 else x[body] + turns[body] @ local

    def way(axis: Any) -> Any:
        local = scene.direction(body, axis)
        return local if body < 0 else turns[body] @ local

    if shape == "plane":
        normal = way(keys["normal"])
        return normal @ (z - here(keys["at"])), normal, True
    if shape == "rectangle":
        one, two = (way(axis) for axis in keys["axes"])
        off = z - here(keys["center"])
        within = abs(one @ off) <= 0.5 * keys["size"][0] and abs(two @ off) <= 0.5 * keys["size"][1]
        return np.cross(one, two) @ off, np.cross(one, two), within
    within = True
    if shape == "sphere":
        off = z - here(keys["center"])
    else:
        ends = here(keys["from"]), here(keys["to"])
        axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        off = z - ends[0]
        within = 0.0 <= axis @ off <= np.linalg.norm(ends[1] - ends[0])
        off = off - (axis @ off) * axis
    side = -1.0 if keys.get("hollow") else 1.0
    return side * (np.linalg.norm(off) - keys["radius"]), side * off / np.linalg.norm(off), within


def wrenches(scene: Scene, x: Any, turns: Any, v: Any, omega: Any, alpha: float) -> tuple[Any, list[int]]:
    """(n_bodies, 6): what members and contacts do about the centres of mass, global; points in each contact."""
    out = np.zeros((len(x), 6))

    def at(body: int, place: Any) -> tuple[Any, Any]:
        if body < 0:
            return place, np.zeros(3)
        return place, v[body] + np.cross(omega[body], place - x[body])

    def place_of(body: int, start: Any) -> Any:
        local = scene.point(body, np.array(start, dtype=float))
        return local if body < 0 else x[body] + turns[body] @ local

    def push(body: int, force: Any, spot: Any) -> None:
        if body >= 0:
            out[body] += [*force, *np.cross(spot - x[body], force)]

    def number(name: str) -> int:
        return -1 if name == "ground" else scene.names.index(name)

    def grid(name: str) -> tuple[int, list[Any]]:
        entry = CONTENT["points"][name]
        body, kind = number(entry["body"]), entry["grid"]
        if "plane" in kind:
            corner, (one, two) = np.array(kind["plane"]["corner"]), np.array(kind["plane"]["edges"], dtype=float)
            return body, [corner, corner + one, corner + two, corner + one + two]
        if entry.get("frame") == "body":
            turned = orientation_of(entry["body"])
            return body, [scene.places[body] + turned @ np.array(each) for each in kind["list"]]
        return body, [np.array(each) for each in kind["list"]]

    for group in CONTENT["members"].values():
        ends = [
            grid(group[end]) if isinstance(group[end], str) else (number(group[end]["body"]), [group[end]["at"]])
            for end in ("from", "to")
        ]
        pairs = [(p, q) for p in ends[0][1] for q in ends[1][1]]
        if group.get("connect") == "pairs":
            pairs = list(zip(ends[0][1], ends[1][1], strict=True))
        for p0, q0 in pairs:
            (p, p_rate), (q, q_rate) = (
                at(ends[0][0], place_of(ends[0][0], p0)),
                at(ends[1][0], place_of(ends[1][0], q0)),
            )
            length = np.linalg.norm(q - p)
            along, law = (q - p) / length, group["law"]
            free = law.get("free_length", np.linalg.norm(np.array(q0) - np.array(p0)))
            force = law["stiffness"] * (length - free) + law.get("damping", 0.0) * along @ (q_rate - p_rate)
            push(ends[0][0], alpha * force * along, p)
            push(ends[1][0], -alpha * force * along, q)
    touching = []
    for contact in CONTENT["contacts"]:
        body, starts = grid(contact["points"])
        on = contact[True]  # what PyYAML makes of the key `on`
        other = number(on["body"])
        touching.append(0)
        for start in starts:
            z = place_of(body, start)
            height, normal, within = surface(scene, on, x, turns, z)
            u = at(body, z)[1] - at(other, z)[1]
            size = -contact["stiffness"] * height - contact.get("damping", 0.0) * normal @ u
            if height >= 0.0 or not within or size <= 0.0:
                continue
            touching[-1] += 1
            sliding = u - (normal @ u) * normal
            speed = np.linalg.norm(sliding)
            drag = contact["friction"] * size * np.tanh(speed / contact["slip"]) / speed * sliding
            push(body, size * normal - drag, z)
            push(other, drag - size * normal, z)
    return out, touching


def orientation_of(name: str) -> Any:
    given = CONTENT["bodies"][name].get("orientation")
    return np.eye(3) if given is None else Rotation.from_rotvec(given["angle"] * np.array(given["axis"])).as_matrix()


def test_bodies_in_contact_move_as_newton_and_euler_say() -> None:
    case = load("contacts")
    scene = Scene(CONTENT)
    motion = mdstopo.simulate(case)
    assert motion.status.ok, motion.message
    most = np.zeros(len(CONTENT["contacts"]), dtype=int)
    for k in range(len(motion.t)):
        x, turns, v, omega = states(motion.q[k], motion.v[k])
        forces, touching = wrenches(scene, x, turns, v, omega, float(case.initial[0]))
        most = np.maximum(most, touching)
        a, _ = scene.accelerations(x, turns, v, omega, forces)
        assert np.abs(motion.a[k] - a.ravel()).max() < 1e-9 * np.abs(a).max(), motion.t[k]
    assert (most > 0).all(), most


def test_gradients_through_contacts_and_their_events_are_slopes() -> None:
    case = load("contacts")
    alpha = design_of(case)
    found = mdstopo.evaluate(case, alpha)
    assert found.status.ok, found.message
    direction = np.random.default_rng(1).normal(size=case.n_design) * alpha
    for name, slope in slopes(case, alpha, direction, 1e-3).items():
        gradient = found.gradients[name]
        assert abs(slope - gradient @ direction) <= 5e-8 * np.abs(gradient * direction).max(), name
    check_direct(case)


def test_implicit_steps_through_contacts_are_of_second_order_and_their_methods_agree() -> None:
    exact = load("contacts", tolerance=1e-11)
    alpha = design_of(exact)
    right = mdstopo.evaluate(exact, alpha)
    errors = []
    for step in (1e-3, 2.5e-4):
        case = load("contacts", integrator="generalized_alpha", step=step)
        found = mdstopo.evaluate(case, alpha)
        errors.append([abs(found.objectives[name] - value) for name, value in right.objectives.items()])
        errors[-1] += [np.abs(found.gradients[name] - each).max() for name, each in right.gradients.items()]
    assert np.median(np.divide(*errors)) == pytest.approx(16.0, rel=0.2)
    assert np.min(np.divide(*errors)) > 8.0
    for method in ("direct", "iterative"):
        other = mdstopo.evaluate(case, alpha, method=method)
        for name, gradient in found.gradients.items():
            assert np.abs(other.gradients[name] - gradient).max() <= 1e-9 * np.abs(gradient).max(), name


#: a block that does not turn, on a slope about an axis that is askew, thrown across it; it begins at its depth at rest
SLOPE = """
format: 1
dimension: 3
gravity: {gravity}
time: {{end: 0.8}}
bodies:
  block: {{mass: 10, inertia: [1, 1, 1], position: {position}, velocity: {velocity}}}
motions: [{{body: block, rotation: {{angular_velocity: [0, 0, 0]}}}}]
points: {{feet: {{body: block, grid: {{list: [{position}]}}}}}}
contacts:
  - {{points: feet, on: {{body: ground, plane: {{at: [0, 0, 0], normal: {normal}}}}}, stiffness: 2.0e+5, damping: 50,
     friction: 0.3, slip: 0.05}}
solver: {{tolerance: 1.0e-11}}
"""


def test_a_block_thrown_across_a_slope_slides_as_its_two_equations_say() -> None:
    """N stays m g cos: m s'' = m g_s - mu N tanh(|s'| / slip) s' / |s'| with two components of s."""
    normal = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
    gravity = np.array([0.5, 0.4, -9.8])
    pressure = -10.0 * gravity @ normal
    along = gravity - (gravity @ normal) * normal
    throw = np.cross(normal, along) / np.linalg.norm(along) * 1.5
    text = SLOPE.format(
        gravity=gravity.tolist(), position=(-pressure / 2e5 * normal).tolist(), velocity=throw.tolist(),
        normal=(3.0 * normal).tolist(),
    )  # fmt: skip
    motion = mdstopo.simulate(read_case(text))
    assert motion.status.ok, motion.message

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        speed = np.linalg.norm(y[3:])
        return np.concatenate([y[3:], along - 0.03 * pressure * np.tanh(speed / 0.05) / speed * y[3:]])

    y = np.concatenate([np.zeros(3), throw])
    exact = solve_ivp(rate, (0.0, 0.8), y, method="DOP853", rtol=1e-12, atol=1e-14, t_eval=motion.t).y
    assert np.abs(motion.q[:, :3] - motion.q[0, :3] - exact[:3].T).max() < 1e-9
    assert np.abs(motion.v[:, :3] - exact[3:].T).max() < 1e-9


#: one point, once in a bowl and once in a pipe along y
ROUND = """
format: 1
dimension: 3
gravity: [0, 0, -9.8]
time: {{end: 3}}
bodies:
  bead: {{mass: 2, inertia: [0.01, 0.02, 0.03], position: {position}, velocity: {velocity}}}
points: {{bead: {{body: bead, grid: {{list: [{position}]}}}}}}
contacts: [{{points: bead, on: {{body: ground, {shape}}}, stiffness: {stiffness}}}]
solver: {{tolerance: 1.0e-11}}
"""


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_a_bead_inside_a_round_surface_keeps_energy_and_what_the_surface_cannot_change(shape: str) -> None:
    """In a bowl the angular momentum about the vertical, in a pipe the momentum along it, also where it leaves both."""
    surface = {
        "sphere": "sphere: {center: [0, 0, 0], radius: 0.6, hollow: true}",
        "cylinder": "cylinder: {from: [0, -50, 0], to: [0, 50, 0], radius: 0.6, hollow: true}",
    }[shape]
    stiffness = 5.0e4
    text = ROUND.format(position=[0.3, 0, 0.2], velocity=[0, 2.5, 0], shape=surface, stiffness=stiffness)
    motion = mdstopo.simulate(read_case(text))
    assert motion.status.ok, motion.message
    place, speed = motion.q[:, :3], motion.v[:, :3]
    apart = np.linalg.norm(place if shape == "sphere" else place[:, ::2], axis=1)
    depth = np.maximum(apart - 0.6, 0.0)
    assert (depth > 0.0).any()
    assert (depth == 0.0).any()
    energy = (speed**2).sum(axis=1) + 2.0 * 9.8 * place[:, 2] + 0.5 * stiffness * depth**2
    kept = place[:, 0] * speed[:, 1] - place[:, 1] * speed[:, 0] if shape == "sphere" else speed[:, 1]
    assert np.abs(energy - energy[0]).max() < 1e-9 * np.abs(energy).max() + 1e-8
    assert np.abs(kept - kept[0]).max() < 1e-9


#: planar scenes, with what is asked of them
COLLISION = (
    HIT.format(damping=60, friction=0.4)
    + """
members:
  tie: {from: {body: a, at: [0, 0.3]}, to: {body: b, at: [1.05, 0.4]}, law: {type: spring, stiffness: 400, damping: 3}}
  stay: {from: {body: ground, at: [0, -2]}, to: {body: b, at: [1.2, 0.1]}, law: {type: spring, stiffness: 900}}
objectives:
  way: {response: {displacement: {body: a, component: norm}}, over_time: final}
  push: {response: {acceleration: {body: b, component: norm}}, over_time: rms}
  turn: {response: {angular_velocity: {body: a, relative_to: b}}, over_time: final}
  pull: {response: {member_force: {group: tie}}, over_time: max}
combine: {weights: {way: 1, push: 1, turn: 1, pull: 1}}
"""
)


@pytest.mark.parametrize("tilt", [(), ((1.0, 0.4, -0.2), 0.7)])
def test_a_planar_collision_is_the_same_in_any_tilted_plane(tilt: tuple[Any, ...]) -> None:
    planar = read_case(COLLISION)
    if tilt:  # a turn rate of another body is told by its norm there
        planar = read_case(COLLISION.replace("relative_to: b}}, over_time: final", "relative_to: b}}, over_time: rms"))
    spatial = read_case(lifted(planar, *tilt))
    one, two = mdstopo.evaluate(planar), mdstopo.evaluate(spatial)
    assert one.status.ok
    assert two.status.ok, two.message
    for name, value in one.objectives.items():
        assert two.objectives[name] == pytest.approx(value, rel=1e-10), name
        size = np.abs(one.gradients[name]).max()
        assert np.abs(two.gradients[name] - one.gradients[name]).max() <= 1e-9 * size, name


@pytest.mark.parametrize(
    ("on", "path", "words"),
    [
        ("{body: ground}", "contacts[0].on", "plane"),
        ("{body: ground, from: [0, 0, 0], to: [1, 0, 0]}", "contacts[0].on", "an edge is for a case in the plane"),
        (
            "{body: ground, plane: {at: [0, 0, 0], normal: [0, 0, 1]}, sphere: {center: [0, 0, 0], radius: 1}}",
            "contacts[0].on", "plane",
        ),
        ("{body: ground, plane: {at: [0, 0, 0], normal: [0, 0, 0]}}", "contacts[0].on.plane.normal", "zero"),
        ("{body: bead, plane: {at: [0, 0, 0], normal: [0, 0, 1]}}", "contacts[0].on", "needs two bodies"),
        (
            "{body: ground, rectangle: {center: [0, 0, 0], axes: [[1, 0, 0], [1, 1, 0]], size: [1, 1]}}",
            "contacts[0].on.rectangle.axes", "not perpendicular",
        ),
        ("{body: ground, cylinder: {from: [0, 0, 1], to: [0, 0, 1], radius: 1}}", "contacts[0].on.cylinder.to", "axis"),
        ("{body: ground, sphere: {center: [0, 0, 0], radius: -1}}", "contacts[0].on.sphere.radius", "-1"),
    ],
)  # fmt: skip
def test_surfaces_that_are_none_are_refused_by_key(on: str, path: str, words: str) -> None:
    text = ROUND.format(position=[0, 0, 0], velocity=[0, 0, 0], shape="SHAPE", stiffness=1)
    with pytest.raises(CaseError) as caught:
        read_case(text.replace("{body: ground, SHAPE}", on))
    assert path in str(caught.value)
    assert words in str(caught.value)
