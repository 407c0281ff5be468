"""Mechanisms: closed forms, conserved quantities, redundancy, refusals."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.special import ellipk

import mdstopo
from mdstopo.case.reader import read_case
from tests.general.support import simulate_text

PENDULUM = """
format: 1
gravity: [0, -9.81]
time: {{end: {end}}}
bodies: {{bob: {{mass: 2, inertia: {inertia}, position: [{x!r}, {y!r}], angle: 1}}}}
joints: [{{name: pin, type: revolute, bodies: [ground, bob], at: [0, 0]}}]
"""


def pendulum(end, inertia=0.5):
    return PENDULUM.format(end=end, inertia=inertia, x=float(np.sin(1.0)), y=float(-np.cos(1.0)))


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_pendulum_returns_after_its_period(integrator):
    period = 4.0 * np.sqrt(2.5 / (2.0 * 9.81)) * ellipk(np.sin(0.5) ** 2)
    settings = {"tolerance": 1e-11} if integrator == "runge_kutta" else {"step": 2e-4}
    motion = simulate_text(pendulum(period), integrator=integrator, **settings)
    assert motion.q[-1, 2] == pytest.approx(1.0, abs=1e-9 if integrator == "runge_kutta" else 1e-6)


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_joints_hold_to_rounding_at_every_step(integrator):
    motion = simulate_text(pendulum(3.0), integrator=integrator)
    x, y, angle = motion.q.T
    vx, vy, rate = motion.v.T
    assert np.abs(np.hypot(x, y) - 1.0).max() <= 1e-13
    assert np.abs(vx - np.cos(angle) * rate).max() <= 1e-12
    assert np.abs(vy - np.sin(angle) * rate).max() <= 1e-12


def test_the_reaction_of_a_pin_carries_weight_and_centripetal_force():
    motion = simulate_text(pendulum(2.0), tolerance=1e-11)
    ax, ay = motion.a[:, 0], motion.a[:, 1]
    # lambda is the force on the first body, ground; the bob feels its opposite
    assert -motion.lam[:, 0] == pytest.approx(2.0 * ax, abs=1e-9)
    assert -motion.lam[:, 1] == pytest.approx(2.0 * (ay + 9.81), abs=1e-9)
    assert motion.reactions["pin"][:, :2] == pytest.approx(motion.lam, abs=1e-12)


PARALLELOGRAM = """
format: 1
gravity: [0, -9.81]
time: {{end: 1.5}}
bodies:
  coupler: {{mass: 3, inertia: 0.2, position: [0.5, -1]}}
joints:
  - {{name: left, type: distance, bodies: [ground, coupler], at: [[0, 0], [0, -1]]}}
  - {{name: right, type: distance, bodies: [ground, coupler], at: [[1, 0], [1, -1]]}}
{extra}
loads: [{{body: coupler, force: [4, 0]}}]
"""


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_redundant_link_changes_no_motion_and_shares_the_load(integrator):
    extra = "  - {name: middle, type: distance, bodies: [ground, coupler], at: [[0.5, 0], [0.5, -1]]}"
    plain = simulate_text(PARALLELOGRAM.format(extra=""), integrator=integrator)
    shared = simulate_text(PARALLELOGRAM.format(extra=extra), integrator=integrator)
    t = np.linspace(0.0, 1.5, 16)
    assert shared.at(t).q == pytest.approx(plain.at(t).q, abs=1e-9)
    assert shared.lam.shape[1] == 3
    # least norm: the middle link carries the mean of both others
    assert shared.lam[:, 2] == pytest.approx(0.5 * (shared.lam[:, 0] + shared.lam[:, 1]), abs=1e-9)


@pytest.mark.parametrize("asked", ["left", "right", "middle"])
def test_a_response_on_a_redundant_joint_is_refused(asked):
    """Whatever place it has in the file: what each of three links carries is open."""
    extra = "  - {name: middle, type: distance, bodies: [ground, coupler], at: [[0.5, 0], [0.5, -1]]}"
    text = PARALLELOGRAM.format(extra=extra) + f"objectives: {{F: {{response: {{joint_force: {{joint: {asked}}}}}}}}}\n"
    with pytest.raises(mdstopo.CaseError, match=f"{asked} shares its load with joints that repeat each other"):
        mdstopo.evaluate(read_case(text))


def test_beside_joints_that_repeat_each_other_the_others_keep_their_forces():
    """A bob of 2 kg hangs from the coupler: its pin carries what it carries without the link that repeats others."""
    middle = "  - {name: middle, type: distance, bodies: [ground, coupler], at: [[0.5, 0], [0.5, -1]]}\n"
    pin = "  - {name: pin, type: revolute, bodies: [coupler, bob], at: [0.5, -1]}"
    bob = "bodies:\n  bob: {mass: 2, inertia: 1, position: [0.5, -2]}"
    asked = "objectives: {F: {response: {joint_force: {joint: pin}}, over_time: min}}\n"
    with_middle, without = (
        mdstopo.evaluate(read_case(PARALLELOGRAM.format(extra=extra).replace("bodies:", bob, 1) + asked))
        for extra in (middle + pin, pin)
    )
    assert with_middle.objectives["F"] == pytest.approx(without.objectives["F"], rel=1e-9)
    assert without.objectives["F"] > 0.9 * 2.0 * 9.81


DOOR = """
format: 1
dimension: 3
gravity: [0, 0, -9.81]
time: {end: 0.1}
bodies: {door: {mass: 30, inertia: [8, 5, 3], position: [0.5, 0, 0]}}
joints:
  - {name: low, type: revolute, bodies: [ground, door], at: [0, 0, -0.8], axis: [0, 0, 1]}
  - {name: high, type: revolute, bodies: [ground, door], at: [0, 0, 0.8], axis: [0, 0, 1]}
objectives: {F: {response: {joint_force: {joint: ASKED}}}}
"""


@pytest.mark.parametrize("asked", ["low", "high"])
def test_neither_hinge_of_a_door_has_a_force_of_its_own(asked):
    with pytest.raises(mdstopo.CaseError, match=f"{asked} shares its load with joints that repeat each other"):
        mdstopo.evaluate(read_case(DOOR.replace("ASKED", asked)))


def test_joints_that_contradict_each_other_are_told_when_they_tear():
    """A third link of another length fits at the start only: the mechanism cannot move."""
    extra = "  - {name: stray, type: distance, bodies: [ground, coupler], at: [[0.5, 0.3], [0.5, -1]]}"
    motion = simulate_text(PARALLELOGRAM.format(extra=extra))
    assert motion.status is mdstopo.status.Status.SINGULAR
    assert "joint" in motion.message
    assert "t = " in motion.message


def test_a_misfit_is_refused_with_joint_and_size_and_assembled_on_request():
    text = """
format: 1
gravity: [0, -9.81]
time: {end: 1}
bodies: {bob: {mass: 1, inertia: 0.1, position: [1, 0]}}
joints: [{name: pin, type: revolute, bodies: [bob, ground], at: {bob: [0, 0.01], ground: [0, 0]}}]
"""
    with pytest.raises(mdstopo.CaseError, match=r"pin.*misfit is 0\.01"):
        mdstopo.simulate(read_case(text))
    motion = simulate_text(text, assemble="true")
    assert motion.status.ok
    x, y, angle = motion.q[0]
    arm = np.array([np.cos(angle) * -1.0 - np.sin(angle) * 0.01, np.sin(angle) * -1.0 + np.cos(angle) * 0.01])
    assert np.abs(np.array([x, y]) + arm).max() <= 1e-14


CRANK = """
format: 1
gravity: [0, -9.81]
time: {end: 0.1}
bodies:
  crank: {mass: 1.3, inertia: 0.02, position: [1, 0.4]}
  rod: {mass: 0.4, inertia: 0.005, position: [1.2, -0.7]}
joints:
  - {name: pin, type: revolute, bodies: [crank, ground], at: {crank: [0.7, 0.2], ground: [0, 0]}}
  - {name: knee, type: revolute, bodies: [crank, rod], at: {crank: [1.2, 0.3], rod: [1.1, -0.5]}}
"""


def test_an_assembled_start_is_the_nearest_by_mass_where_bodies_turn_far():
    """Parts that lie apart: a start that fits is left long before it is the nearest one."""
    homes, pins, knees = np.array([[1, 0.4], [1.2, -0.7]]), np.array([0.7, 0.2]), np.array([[1.2, 0.3], [1.1, -0.5]])
    root_mass, root_inertia = np.sqrt([1.3, 0.4]), np.sqrt([0.02, 0.005])

    def start(angles):
        first, second = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in angles)
        crank = -first @ (pins - homes[0])
        return np.array([crank, crank + first @ (knees[0] - homes[0]) - second @ (knees[1] - homes[1])])

    def weighed(angles):
        return np.concatenate([(root_mass[:, None] * (start(angles) - homes)).ravel(), root_inertia * angles])

    best = least_squares(weighed, np.zeros(2), xtol=1e-15, ftol=1e-15, gtol=1e-15)
    motion = simulate_text(CRANK, assemble="true")
    q = motion.q[0].reshape(2, 3)
    assert np.abs(best.x).min() > 0.3
    assert q[:, 2] == pytest.approx(best.x, abs=1e-6)
    assert q[:, :2] == pytest.approx(start(q[:, 2]), abs=1e-13)


def test_a_motion_that_a_joint_does_not_allow_is_named_where_assembling_does_not_help():
    text = """
format: 1
time: {end: 1}
bodies: {slider: {mass: 1, inertia: 0.1, position: [0, 0]}}
joints: [{name: pin, type: revolute, bodies: [slider, ground], at: [0.3, 0]}]
"""
    with pytest.raises(mdstopo.CaseError, match=r"tear joint pin.*no start fits it while slider moves as prescribed"):
        mdstopo.simulate(read_case(text + "motions: [{body: slider, x: {velocity: 0.2}}]\n"))
    moving = text.replace("position: [0, 0]", "position: [0, 0], velocity: [0.2, 0]")
    with pytest.raises(mdstopo.CaseError, match=r"tear joint pin.*assemble: true"):
        mdstopo.simulate(read_case(moving))


def chain(n):
    bodies = "\n".join(f"  b{i}: {{mass: 1, inertia: 0.01, position: [{i + 0.5}, 0]}}" for i in range(n))
    joints = "\n".join(
        f"  - {{type: revolute, bodies: [{'ground' if i == 0 else f'b{i - 1}'}, b{i}], at: [{i}, 0]}}" for i in range(n)
    )
    return f"format: 1\ngravity: [0, -9.81]\ntime: {{end: 0.2}}\nbodies:\n{bodies}\njoints:\n{joints}\n"


def test_a_hanging_chain_keeps_its_energy():
    motion = simulate_text(chain(12), tolerance=1e-10)
    q, v = motion.q.reshape(-1, 12, 3), motion.v.reshape(-1, 12, 3)
    energy = 0.5 * (v[:, :, :2] ** 2).sum((1, 2)) + 0.005 * (v[:, :, 2] ** 2).sum(1) + 9.81 * q[:, :, 1].sum(1)
    kinetic = 0.5 * (v[-1, :, :2] ** 2).sum()
    assert np.abs(energy - energy[0]).max() <= 1e-9 * kinetic


def test_the_matrix_of_a_chain_is_banded_whatever_its_length():
    from mdstopo.general.scene.compile_general import compile_general

    widths = []
    for n in (20, 60):
        case = read_case(chain(n))
        widths.append(int(compile_general(case, case.load_cases[0]).model.size[1]))
    assert widths[0] == widths[1] <= 12
