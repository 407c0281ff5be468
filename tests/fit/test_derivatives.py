"""Predictions at measured times are differentiated exactly: through impacts, by laws, masses, velocities and loads."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mdstopo.fit.fit_problem import FitProblem

from .scenes import problem_of

#: two bodies at a joint, one on a spring, the other meets a stop; numbers of every kind
LINKED = """
format: 1
define: {v: 0.3}
gravity: [0, -9.81]
time: {end: 1}
bodies:
  block: {mass: 2, inertia: 0.1, position: [0, 0], velocity: ["=v", 0]}
  arm: {mass: 1, inertia: 0.2, position: [0.5, 0], velocity: ["=v", 0]}
joints:
  - {name: pin, type: revolute, bodies: [block, arm], at: [0.25, 0]}
loads:
  - {body: block, force: [1, 0], at: [0, 0.1]}
members:
  spring:
    {from: {body: ground, at: [0, 1]}, to: {body: block, at: [0, 0.1]}, design: false,
     law: {type: spring, stiffness: 400, damping: 3}}
  stop:
    {from: {body: ground, at: [0.6, -1]}, to: {body: arm, at: [0.6, 0]}, design: false,
     law: {type: gap, stiffness: 3000, damping: 5, gap: 0.005, side: compression}}
solver: {tolerance: 1.e-11}
fit:
  estimate:
    members.spring.law.stiffness: {lower: 100, upper: 1000}
    members.stop.law.gap: {lower: 0.001, upper: 0.01}
    bodies.block.mass: {lower: 1, upper: 4}
    bodies.arm.inertia: {lower: 0.1, upper: 0.4}
    define.v: {lower: 0, upper: 1}
    gravity[1]: {lower: -12, upper: -8}
    loads[0].force[0]: {lower: 0, upper: 3}
    joints[0].at[0]: {lower: 0.2, upper: 0.3}
    members.spring.to.at[1]: {lower: 0.05, upper: 0.15}
  measured:
    lift: {file: a.csv, response: {displacement: {body: block, component: y}}, offset: {lower: -1, upper: 1}}
    blow: {file: b.csv, response: {acceleration: {body: arm, component: y, at: [0.6, 0]}}, delay: {lower: -1, upper: 1}}
    pin: {file: c.csv, response: {joint_force: {joint: pin}}}
"""
#: a block that crushes what it falls on, and springs back
CRUSHED = """
format: 1
define: {v: 2}
gravity: [0, -9.81]
time: {end: 0.4}
bodies:
  block: {mass: 5, inertia: 0.1, position: [0, 0], velocity: [0, "=-v"]}
members:
  leg:
    {from: {body: ground, at: [0, -1]}, to: {body: block, at: [0, 0]}, design: false,
     law: {type: crush, stiffness: 20000, force: 300, gap: 0.01}}
solver: {tolerance: 1.e-11}
fit:
  estimate:
    members.leg.law.stiffness: {lower: 10000, upper: 30000}
    members.leg.law.force: {lower: 100, upper: 400}
    bodies.block.mass: {lower: 3, upper: 6}
    define.v: {lower: 1, upper: 3}
  measured:
    lift: {file: a.csv, response: {displacement: {body: block, component: y}}}
    speed: {file: b.csv, response: {velocity: {body: block, component: y}}}
"""
#: an arm that is let go from the side, and where its pin is
PENDULUM = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies:
  arm: {mass: 2, inertia: 0.1, position: [0.5, 0]}
joints:
  - {name: pin, type: revolute, bodies: [ground, arm], at: [0.1, 0]}
fit:
  estimate:
    joints[0].at[0]: {lower: -0.1, upper: 0.3}
  measured:
    swing: {file: a.csv, response: {angle: {body: arm}}}
    lift: {file: b.csv, response: {displacement: {body: arm, component: y}}}
"""
TIMES = np.linspace(0.0, 0.98, 15)


@pytest.fixture(scope="module")
def linked() -> FitProblem:
    return problem_of(LINKED, {"lift": TIMES, "blow": TIMES[1:] + 0.001, "pin": TIMES[1:]})


def check(problem: FitProblem, x: np.ndarray) -> None:
    """Whether derivatives at x are those of differences."""
    slopes = problem.slopes(x).copy()
    for i, name in enumerate(problem.names):
        h = 1e-5 * max(abs(x[i]), 0.1)
        sides = []
        for way in (1.0, -1.0):
            moved = x.copy()
            moved[i] += way * h
            trouble, misfit = problem.misfit(moved)
            assert not trouble
            sides.append(misfit)
        differences = (sides[0] - sides[1]) / (2.0 * h)
        for part in problem.parts:
            # what differences may be off by for the tolerance of the motions
            noise = 2e-11 * np.abs(sides[0][part]).max() / h
            allowed = 2e-6 * np.abs(differences[part]).max() + noise
            assert np.abs(slopes[part, i] - differences[part]).max() < allowed, name


def test_derivatives_are_those_of_differences(linked: FitProblem) -> None:
    x = linked.initial.copy()
    x[linked.names.index("delay of blow")] = 0.001
    x[linked.names.index("offset of lift")] = 0.01
    x[linked.names.index("define.v")] = 0.31
    assert linked.derivatives.count("differences") == 2
    check(linked, x)


def test_numbers_of_loads_that_are_formulas_are_fitted_by_differences() -> None:
    load = '- {body: arm, moment: {formula: "a*sin(w*t)", parameters: {a: 0.5, w: 20}}}'
    keys = "loads[1].moment.parameters.w: {lower: 10, upper: 30}"
    text = LINKED.replace("members:\n", f"  {load}\nmembers:\n", 1)
    text = text.replace("  measured:", f"    {keys}\n  measured:", 1)
    problem = problem_of(text, {"lift": TIMES, "blow": TIMES[1:] + 0.001, "pin": TIMES[1:]})
    by_name = dict(zip(problem.names, problem.derivatives, strict=True))
    assert by_name["loads[1].moment.parameters.w"] == "differences"
    assert by_name["loads[0].force[0]"] == "exact"
    check(problem, problem.initial)


def test_so_are_those_of_members_that_keep_a_permanent_set() -> None:
    t = np.linspace(0.02, 0.39, 12)
    crushed = problem_of(CRUSHED, {"lift": t, "speed": t})
    assert set(crushed.derivatives) == {"exact"}
    check(crushed, crushed.initial)


def test_the_place_of_a_joint_is_differentiated_as_the_equation_of_a_pendulum_has_it() -> None:
    t = np.linspace(0.05, 1.0, 20)
    problem = problem_of(PENDULUM, {"swing": t, "lift": t})
    assert problem.derivatives == ("differences",)
    slopes = problem.slopes(np.array([0.1]))[:, 0]

    def rates(_t: float, y: np.ndarray, d: float) -> list[float]:
        """Angle, its rate, and their derivatives by the distance d of the pin from the centre of mass."""
        angle, rate, by_d, rate_by_d = y
        about = 0.1 + 2.0 * d**2
        pull, pull_by_d = 2.0 * 9.81 * d / about, 2.0 * 9.81 * (about - 4.0 * d**2) / about**2
        return [rate, -pull * np.cos(angle), rate_by_d, -pull_by_d * np.cos(angle) + pull * np.sin(angle) * by_d]

    found = solve_ivp(rates, (0.0, 1.0), np.zeros(4), args=(0.4,), rtol=1e-13, atol=1e-14, method="DOP853", t_eval=t)
    angle, by_d = found.y[0], found.y[2]
    expected = -np.concatenate([by_d, np.sin(angle) + 0.4 * np.cos(angle) * by_d])
    assert np.abs(slopes - expected).max() < 1e-8 * np.abs(expected).max()


def test_values_are_those_of_the_motion(linked: FitProblem) -> None:
    trouble, misfit = linked.misfit(linked.initial)
    assert not trouble
    evaluator = linked.predictions._kept[1]  # type: ignore[index]
    motion = evaluator.trajectory(evaluator.case.start, "default")
    q = motion.at(TIMES).q
    np.testing.assert_allclose(misfit[:15], q[:, 1] - q[0, 1], atol=1e-8)


def test_a_motion_is_computed_once_for_values_and_derivatives(linked: FitProblem) -> None:
    before = linked.simulations
    linked.misfit(linked.initial)
    assert linked.simulations == before + 1
    linked.slopes(linked.initial)
    # the two numbers that need differences take two more each
    assert linked.simulations == before + 5
