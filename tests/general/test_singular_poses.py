"""Linkages that pass through poses at which their joints repeat each other (IFToMM's benchmark A02, the N-four-bar).

N + 1 equal links on ground carry N bars: every window is a parallelogram. Lying flat it may go on as one or crossed. As
parallelograms all links turn alike, by phi from upright: (J + N m l^2) phi'' = (N + (N + 1)/2) m g l sin(phi), where
J = (N + 1) m l^2/3.
"""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mdstopo
from mdstopo.case.reader import read_case
from tests.general.support import slopes

GRAVITY = 9.81


def windows(count, end, tolerance, more=None):
    """The benchmark: links and bars of 1 m and 1 kg, upright, the bars at 1 m/s. more: entries of the case."""
    bodies, joints = {}, []
    for i in range(count + 1):
        link = {"mass": 1.0, "inertia": 1 / 12, "position": [i, 0.5], "velocity": [0.5, 0.0], "angular_velocity": -1.0}
        bodies[f"link{i}"] = link
        joints.append({"type": "revolute", "bodies": ["ground", f"link{i}"], "at": [i, 0]})
    for i in range(count):
        bodies[f"bar{i}"] = {"mass": 1.0, "inertia": 1 / 12, "position": [i + 0.5, 1.0], "velocity": [1.0, 0.0]}
        joints.append({"type": "revolute", "bodies": [f"link{i}", f"bar{i}"], "at": [i, 1]})
        joints.append({"type": "revolute", "bodies": [f"bar{i}", f"link{i + 1}"], "at": [i + 1, 1]})
    case = {"format": 1, "gravity": [0, -GRAVITY], "time": {"end": end}, "bodies": bodies, "joints": joints}
    return read_case(
        json.dumps({**case, **(more or {}), "solver": {"integrator": "runge_kutta", "tolerance": tolerance}})
    )


def turned(count, times):
    """phi at times (T,)."""
    inertia = (count + 1) / 3.0 + count
    weight = (count + 0.5 * (count + 1)) * GRAVITY
    return solve_ivp(
        lambda t, y: [y[1], weight * np.sin(y[0]) / inertia],
        (0.0, times[-1] + 1e-9), [0.0, 1.0], t_eval=times, method="DOP853", rtol=1e-13, atol=1e-14,
    ).y[0]  # fmt: skip


@pytest.mark.parametrize(
    ("count", "tolerance"),
    [(1, 1e-10), (1, 1e-12), (2, 1e-4), (2, 1e-8), (2, 1e-10), (2, 1e-12), (10, 1e-9), (40, 1e-6), (40, 1e-8)],
)
def test_the_n_four_bar_goes_on_through_its_singular_poses(count, tolerance):
    """Ten seconds with seven or eight such poses, each to a bar's place and the energy; the benchmark asks for 1e-3."""
    motion = mdstopo.simulate(windows(count, 10.0, tolerance))
    assert motion.status.ok, motion.message
    phi = turned(count, motion.t)
    assert np.sum(np.diff(np.sign(np.cos(phi))) != 0.0) >= 7
    bar = 3 * (count + 1)
    bound = max(10.0 * tolerance, 1e-8)  # beside a pose rounding is divided by the distance to it
    np.testing.assert_allclose(motion.q[:, bar], 0.5 + np.sin(phi), rtol=0.0, atol=bound)
    np.testing.assert_allclose(motion.q[:, bar + 1], np.cos(phi), rtol=0.0, atol=bound)
    v = motion.v.reshape(len(motion.t), -1, 3)
    energy = GRAVITY * motion.q[:, 1::3].sum(axis=1) + 0.5 * ((v**2) @ [1.0, 1.0, 1 / 12]).sum(axis=1)
    assert np.abs(energy - energy[0]).max() <= 30.0 * bound * (2 * count + 1)


def test_a_linkage_that_locks_is_still_refused_with_its_joint():
    """A crank turns until rod and rocker are stretched out, where cos(crank) = 1/4: no motion leads across."""
    text = """
format: 1
time: {end: 3}
bodies:
  crank: {mass: 1, inertia: 0.1, position: [0.5, 0], angular_velocity: 1}
  rod: {mass: 1, inertia: 0.1, position: [1.25, 0.433]}
  rocker: {mass: 1, inertia: 0.1, position: [1.75, 0.433]}
joints:
  - {name: A, type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {name: B, type: revolute, bodies: [crank, rod], at: [1, 0]}
  - {name: C, type: revolute, bodies: [rod, rocker], at: [1.5, 0.866]}
  - {name: D, type: revolute, bodies: [rocker, ground], at: [2, 0]}
motions:
  - {body: crank, angle: {velocity: 1}}
solver: {assemble: true}
"""
    motion = mdstopo.simulate(read_case(text))
    assert not motion.status.ok
    assert "joint" in motion.message
    assert motion.t[-1] == pytest.approx(np.arccos(0.25), abs=2e-3)


def tied(end, tolerance):
    """One window, with two springs from ground to its bar and its first link, whose scales are designed."""
    at = {"a": [0.5, 1.0], "b": [0.0, 0.5]}
    members = {
        "over": {"from": {"body": "ground", "at": [2.5, 2.0]}, "to": {"body": "bar0", "at": at["a"]}},
        "aside": {"from": {"body": "ground", "at": [-1.0, 0.2]}, "to": {"body": "link0", "at": at["b"]}},
    }
    laws = {"over": {"type": "spring", "stiffness": 2.0}, "aside": {"type": "spring", "stiffness": 3.0, "damping": 0.1}}
    names = {"x": {"displacement": {"body": "bar0", "component": "x"}}, "turn": {"velocity": {"body": "link1"}}}
    more = {
        "members": {name: {**each, "law": laws[name]} for name, each in members.items()},
        "design": {"initial": 0.7},
        "objectives": {name: {"response": each, "over_time": "final"} for name, each in names.items()},
        "combine": {"method": "weighted_sum", "weights": dict.fromkeys(names, 1.0)},
    }
    return windows(1, end, tolerance, more)


def swung(alpha, end):
    """x of the bar's middle at the end, as a displacement: Lagrange's equation of the one angle phi from upright."""
    inertia, weight = 2.0 / 3.0 + 1.0, 2.0 * GRAVITY
    pulls = (2.0 * alpha[0], 0.0, 2.5, 2.0, 0.5, 1.0), (3.0 * alpha[1], 0.1 * alpha[1], -1.0, 0.2, 0.0, 0.5)

    def rates(_, y):
        moment = weight * np.sin(y[0])
        for k, c, x, z, own, arm in pulls:  # the point is at (own + arm sin, arm cos)
            r = np.array([own + arm * np.sin(y[0]) - x, arm * np.cos(y[0]) - z])
            slope = r @ [arm * np.cos(y[0]), -arm * np.sin(y[0])] / np.hypot(*r)
            moment -= (k * (np.hypot(*r) - np.hypot(own - x, arm - z)) + c * slope * y[1]) * slope
        return [y[1], moment / inertia]

    phi = solve_ivp(rates, (0.0, end), [0.0, 1.0], method="DOP853", rtol=1e-13, atol=1e-14).y[0]
    assert np.sum(np.diff(np.sign(np.cos(phi))) != 0.0) >= 1
    return np.sin(phi[-1])


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_gradients_go_through_singular_poses(tolerance):
    """Lying flat on its way, once and more often; against differences of the equation of the one angle."""
    bound = 10.0 * tolerance + 1e-8  # beside a pose rounding is divided by the distance to it
    for end in (1.6, 4.0):
        alpha, h = np.array([0.7, 0.9]), 1e-4
        found = mdstopo.evaluate(tied(end, tolerance), alpha)
        assert found.status.ok, found.message
        assert found.objectives["x"] == pytest.approx(swung(alpha, end), abs=bound)
        expected = np.zeros(2)
        for i, step in enumerate(h * np.eye(2)):
            one, two = ((swung(alpha + m * step, end) - swung(alpha - m * step, end)) / (2 * m * h) for m in (1, 2))
            expected[i] = (4.0 * one - two) / 3.0
        np.testing.assert_allclose(found.gradients["x"], expected, rtol=0, atol=bound * abs(expected).max())


def test_across_singular_poses_the_adjoint_is_the_derivative_of_what_is_computed():
    case, alpha, h = tied(2.5, 1e-11), np.array([0.7, 0.9]), 1e-4
    found = mdstopo.evaluate(case, alpha)
    direct = mdstopo.evaluate(case, alpha, method="direct")
    for i, step in enumerate(np.eye(2)):
        for name, slope in slopes(case, alpha, step, h).items():
            gradient = found.gradients[name]
            assert abs(slope - gradient[i]) <= 1e-6 * np.abs(gradient).max()
            assert abs(direct.gradients[name][i] - gradient[i]) <= 1e-9 * np.abs(gradient).max()
