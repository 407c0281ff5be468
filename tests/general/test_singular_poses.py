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

GRAVITY = 9.81


def windows(count, end, tolerance):
    """The benchmark: links and bars of 1 m and 1 kg, upright, the bars at 1 m/s."""
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
    return read_case(json.dumps({**case, "solver": {"integrator": "runge_kutta", "tolerance": tolerance}}))


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
