"""Motions in space against Newton's and Euler's equations in global axes, and what is told of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid
from scipy.spatial.transform import Rotation

import mdstopo
from mdstopo.case.reader import read_case

from .support import attitudes, load


def springs(case, alpha, place, turned):
    """Force and moment about the centre of mass of the springs of a body to ground, global; and their energy."""
    (group,) = case.members
    p, q = group.from_local[group.from_index] @ turned.T, group.to_local[group.to_index]
    d = q - p - place
    length = np.linalg.norm(d, axis=1)
    tension = alpha * group.laws[0].stiffness * (length - group.length)
    forces = (tension / length)[:, None] * d
    energy = 0.5 * np.sum(alpha * group.laws[0].stiffness * (length - group.length) ** 2)
    return forces.sum(axis=0), np.cross(p, forces).sum(axis=0), energy


def test_a_body_on_springs_moves_as_newton_and_euler_say() -> None:
    case = load("springs")
    (body,) = case.bodies
    alpha = np.random.default_rng(0).uniform(0.2, 0.9, case.n_design)
    gravity = np.array(case.load_cases[0].gravity)

    def rates(_, y):
        turned = y[3:12].reshape(3, 3)
        inertia = turned @ body.inertia @ turned.T
        omega = y[15:18]
        force, moment, _ = springs(case, alpha, y[:3], turned)
        spin = np.linalg.solve(inertia, moment - np.cross(omega, inertia @ omega))
        return np.concatenate([y[12:15], np.cross(omega, turned.T).T.ravel(), force / body.mass + gravity, spin])

    start = np.concatenate([body.position, body.rotation.ravel(), body.velocity, body.angular_velocity])
    times = np.linspace(0.0, 0.5, 11)
    wanted = solve_ivp(rates, (0.0, 0.5), start, "DOP853", times, rtol=1e-12, atol=1e-12).y.T
    motion = mdstopo.simulate(case, alpha)
    assert motion.status.ok
    assert motion.q.shape == (len(motion.t), 7)
    assert motion.v.shape == motion.a.shape == (len(motion.t), 6)
    seen = motion.at(times)
    assert np.abs(seen.q[:, :3] - wanted[:, :3]).max() < 1e-9
    assert np.abs(attitudes(seen.q, 0).as_matrix().reshape(-1, 9) - wanted[:, 3:12]).max() < 1e-8
    assert np.abs(seen.v - wanted[:, 12:]).max() < 1e-7
    accelerations = np.array([rates(0.0, y)[12:] for y in wanted])
    assert np.abs(seen.a - accelerations).max() < 1e-6
    # energy, where nothing damps
    total = []
    for q, v in zip(motion.q, motion.v, strict=True):
        turned = attitudes(q[None], 0).as_matrix()[0]
        omega = turned.T @ v[3:]
        kinetic = 0.5 * body.mass * v[:3] @ v[:3] + 0.5 * omega @ body.inertia @ omega
        total.append(kinetic - body.mass * gravity @ q[:3] + springs(case, alpha, q[:3], turned)[2])
    assert np.ptp(total) < 1e-8 * np.abs(total).max()


def test_responses_are_those_of_the_motion() -> None:
    case = load("linkage")
    found = mdstopo.evaluate(case, gradient=False)
    motion = mdstopo.simulate(case)
    end = motion.at([0.0, motion.t[-1]])
    hull, arm = attitudes(end.q, 0), attitudes(end.q, 1)
    axis = arm[0].inv().apply([1.0, 0.0, 0.0])
    assert found.objectives["tilt"] == pytest.approx(np.arccos(arm[1].apply(axis) @ arm[0].apply(axis)), abs=1e-8)
    t = np.linspace(0.0, motion.t[-1], 2001)
    states = motion.at(t)
    hull, arm = attitudes(states.q, 0), attitudes(states.q, 1)
    relative = hull.inv() * arm
    angle = (relative * relative[0].inv()).magnitude()
    assert found.objectives["turn"] == pytest.approx(trapezoid(angle, t) / t[-1], rel=1e-5)
    rate = np.linalg.norm(states.v[:, 3:6], axis=1).max()
    assert found.objectives["rate"] == pytest.approx(rate, rel=1e-8)
    # differences by time of what an observer on the hull sees of a point of the arm, and of how fast that turns
    point = arm[0].inv().apply(np.array([1.0, 1.0, 0.0]) - np.array(case.bodies[1].position))
    seen = hull.inv().apply(states.q[:, 7:10] + arm.apply(point) - states.q[:, :3])
    h = t[1] - t[0]
    push = (seen[2:] - 2.0 * seen[1:-1] + seen[:-2])[:, 2] / h**2
    assert found.objectives["sway"] == pytest.approx(np.sqrt(np.mean(push**2)), rel=2e-3)
    spin = hull.inv().apply(states.v[:, 9:12] - states.v[:, 3:6])[:, 1]
    assert found.objectives["spin"] == pytest.approx(np.sqrt(np.mean((np.gradient(spin, h)) ** 2)), rel=2e-3)


PENDULUM = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.7}
solver: {tolerance: 1e-10}
bodies:
  bob:
    mass: 3
    inertia: [[0.2, 0.05, 0], [0.05, 0.3, 0.02], [0, 0.02, 0.25]]
    position: [0.6, 0, -0.3]
    orientation: [{axis: [0, 1, 0], angle: 0.4}, {axis: [0, 0, 1], angle: 1.1}]
    velocity: [0, 1.2, 0]
    angular_velocity: [0, 0, 2]
joints:
  - {name: pin, type: TYPE, bodies: [BODIES], at: [0, 0, 0]AXIS}
objectives:
  force: {response: {joint_force: {joint: pin}}, over_time: final}
  moment: {response: {joint_moment: {joint: pin}}, over_time: final}
combine: {method: weighted_sum, weights: {force: 1, moment: 1}}
"""


@pytest.mark.parametrize("kind", ["spherical", "revolute"])
@pytest.mark.parametrize("bob_first", [True, False])
def test_reactions_are_what_newton_and_euler_leave(kind: str, bob_first: bool) -> None:
    axis = ", axis: [0, 0, 1]" if kind == "revolute" else ""
    text = PENDULUM.replace("TYPE", kind).replace("AXIS", axis)
    case = read_case(text.replace("BODIES", "bob, ground" if bob_first else "ground, bob"))
    motion = mdstopo.simulate(case)
    assert motion.status.ok
    reaction = motion.reactions["pin"]
    assert reaction.shape == (len(motion.t), 6)
    (body,) = case.bodies
    turned = attitudes(motion.q, 0).as_matrix()
    inertia = turned @ body.inertia @ turned.transpose(0, 2, 1)
    omega, spin = motion.v[:, 3:], motion.a[:, 3:]
    force = body.mass * (motion.a[:, :3] - [0.0, 0.0, -9.81])  # on the bob
    moment = np.einsum("tij,tj->ti", inertia, spin)
    moment += np.cross(omega, np.einsum("tij,tj->ti", inertia, omega))
    moment -= np.cross(-motion.q[:, :3], force)  # about the pin, which stays at the origin
    sign = 1.0 if bob_first else -1.0
    assert np.abs(sign * reaction[:, :3] - force).max() < 1e-9 * np.abs(force).max()
    assert np.abs(sign * reaction[:, 3:] - moment).max() < 1e-9 * np.abs(force).max()
    assert np.abs(reaction[:, 3:] if kind == "spherical" else reaction[:, 5]).max() < 1e-9
    found = mdstopo.evaluate(case, gradient=False).objectives
    assert found["force"] == pytest.approx(np.linalg.norm(reaction[-1, :3]), rel=1e-9)
    assert found["moment"] == pytest.approx(np.linalg.norm(reaction[-1, 3:]), abs=1e-9)
    if kind == "revolute":
        assert found["moment"] > 0.1


def test_quaternions_are_units_and_go_on() -> None:
    text = PENDULUM.replace("TYPE", "spherical").replace("AXIS", "").replace("BODIES", "bob, ground")
    motion = mdstopo.simulate(read_case(text.replace("end: 0.7", "end: 8")))
    turned = motion.q[:, 3:]
    assert np.abs(np.linalg.norm(turned, axis=1) - 1.0).max() < 1e-14
    assert turned[0][np.abs(turned[0]) > 1e-14][0] > 0.0
    assert (turned[1:] * turned[:-1]).sum(axis=1).min() > 0.5
    start = Rotation.from_euler("yz", [0.4, 1.1])  # about global axes, one after the other
    assert (attitudes(motion.q[:1], 0)[0] * start.inv()).magnitude() < 1e-15 * 4
