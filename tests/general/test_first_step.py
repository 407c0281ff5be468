"""The first adaptive step of a general scene, which single balances measure."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.general.dynamics.accelerations import make_workspace, solve_accelerations
from mdstopo.general.integrators.runge_kutta import FIRST_ERRORS
from mdstopo.general.model.general_model import pack_general, unpack_general
from mdstopo.general.scene.compile_general import compile_general
from mdstopo.general.steps.first_step import MOST_BALANCES, first_step
from mdstopo.integrators.steps import FORCES, TURN, WORK
from mdstopo.mechanics.kinematics.planar_poses import POSE, relative_pose
from tests.compiled import compiled

#: a mass on a spring, kicked or pushed
SWING = """
format: 1
time: {{end: 5}}
bodies: {{a: {{mass: 2, inertia: 1, position: [1, 0], velocity: [{speed}, 0]}}}}
motions: [{{body: a, y: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  s: {{from: {{body: ground, at: [-1, 0]}}, to: {{body: a, at: [1, 0]}}, law: {law}}}
loads: [{{body: a, force: [{force}, 0]}}]
objectives: {{E: {{response: energy, over_time: final}}}}
"""
DAMPED = "{type: spring, stiffness: 800, damping: 0.5}"
CUBIC = "{type: cubic, stiffness: 800, cubic: 10}"


def found(tolerance, **values):
    """The evaluation of a swing, and the same to 1e-13."""
    text = SWING.format(**{"speed": 0, "force": 0} | values)
    return [
        mdstopo.evaluate(
            read_case(text, overrides={"solver.tolerance": each, "solver.integrator": "runge_kutta"}), gradient=False
        )
        for each in (tolerance, 1e-13)
    ]


@compiled
def _first(ints, floats, member_state, tolerance, order, noise, work):
    model = unpack_general(ints, floats)
    workspace = make_workspace(model)
    n, n_pair = model.mass.shape[0], model.pair.shape[0]
    q0, v0, a0, lam = model.q0.copy(), model.v0.copy(), np.zeros(n), np.zeros(model.size[0])
    solve_accelerations(model, member_state, np.int64(0), model.times[0], q0, v0, np.bool_(True), workspace, a0, lam)
    rel = np.empty((n_pair, POSE))
    relative_pose(model.pair, model.home, q0, v0, rel)
    scratch = np.empty((3, n))
    first_error = FIRST_ERRORS[1 if model.size[2] != 0 else 0]
    return first_step(
        model, member_state, model.times[1], q0, v0, a0, rel, np.zeros(n_pair), np.full(n_pair, noise), tolerance,
        order, first_error, workspace, lam, scratch[0], scratch[1], scratch[2], work,
    )  # fmt: skip


def first(text, tolerance, order, noise=1e-15):
    """Length of the first step, and how many balances it took; noise: of positions, m."""
    case = read_case(text)
    model = compile_general(case, case.load_cases[0]).model
    member_state = np.zeros((3, model.member.shape[1] + 1))
    member_state[0, :1] = 1.0  # one member, then padding
    work = np.zeros(WORK, np.int64)
    return _first(*pack_general(model), member_state, tolerance, order, noise, work), work[FORCES]


@pytest.mark.parametrize("tolerance", [2e-5, 2e-11])
@pytest.mark.parametrize("start", [{"speed": 0.3, "force": 0}, {"speed": 0, "force": 20}])
@pytest.mark.parametrize(("law", "order", "method"), [(DAMPED, 8, 1), (CUBIC, 12, 0)])
def test_it_follows_from_the_period_of_a_swing(tolerance, start, law, order, method):
    """With a0 of a push, theta is (omega h)^2/2; with v0 of a kick it is the same."""
    step, balances = first(SWING.format(law=law, **start), tolerance, order)
    omega = np.sqrt(800 / 2)
    expected = np.sqrt(2) / omega * (tolerance / FIRST_ERRORS[method]) ** (1 / order)
    assert step == pytest.approx(expected, rel=0.2)
    assert balances <= MOST_BALANCES


def test_bodies_turn_by_no_more_than_a_step_may():
    text = """
format: 1
time: {end: 100}
bodies: {a: {mass: 2, inertia: 1, position: [1, 0], angular_velocity: 3}}
"""
    step, _ = first(text, 1e-8, 8)
    assert step == pytest.approx(TURN / 3, rel=1e-12)


def test_what_looks_the_same_at_every_scale_begins_with_the_whole_time():
    text = SWING.format(law=DAMPED, speed=0, force="{table: [[0, 0], [5, 50]]}")
    step, balances = first(text, 1e-8, 8, noise=1e-30)
    assert step == 5.0
    assert balances == MOST_BALANCES


@pytest.mark.parametrize("law", [DAMPED, CUBIC])
@pytest.mark.parametrize("start", [{"speed": 0.3}, {"force": 20}])
def test_the_motion_is_right(law, start):
    motion, exact = found(1e-6, law=law, **start)
    assert motion.status.ok
    assert motion.objectives["E"] == pytest.approx(exact.objectives["E"], rel=1e-5)


@pytest.mark.parametrize("force", ["{table: [[0, 0], [5, 50]]}", "{table: [[0, 0], [2, 0], [5, 50]]}"])
def test_a_motion_that_begins_with_nothing_is_right(force):
    """No acceleration at the start says how long a step may be, or none at all before the load comes."""
    motion, exact = found(1e-6, law=DAMPED, force=force)
    assert motion.status.ok
    assert motion.work["steps"] <= 50
    assert motion.objectives["E"] == pytest.approx(exact.objectives["E"], rel=1e-5)


def test_a_joint_that_the_first_tries_tear_apart_does_not_end_the_run():
    """Far along the parabola a distance joint has no length; the step that is found keeps it."""
    text = """
format: 1
gravity: [0, -9.81]
time: {end: 100}
bodies: {bob: {mass: 1, inertia: 0.1, position: [0.3, 0]}}
joints: [{type: distance, bodies: [ground, bob], at: [[0, 0], [0.3, 0]]}]
motions: [{body: bob, angle: {velocity: 0}}]
objectives: {height: {response: {displacement: {body: bob, component: y}}, over_time: final}}
solver: {tolerance: 1.0e-9}
"""
    motion = mdstopo.simulate(read_case(text))
    assert motion.status.ok
    energy = 0.5 * (motion.v[:, :2] ** 2).sum(axis=1) + 9.81 * motion.q[:, 1]
    assert np.abs(energy - energy[0]).max() <= 1e-7 * 0.3 * 9.81
