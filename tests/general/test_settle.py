"""A start at rest: the equilibrium itself, its place in the gradients, and cases that have none."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.simulate import command as simulate_command
from mdstopo.engine import Evaluator
from mdstopo.status import Status
from tests.general.support import design_of, load, slopes

HANGS = """
format: 1
gravity: [0, -10]
time: {end: 0.3}
bodies: {lamp: {mass: 2, inertia: 0.1, position: [0, -1]}}
joints: [{name: guide, type: prismatic, bodies: [ground, lamp], at: [0, -1], axis: [0, 1]}]
members:
  cord:
    from: {body: ground, at: [0, 0]}
    to: {body: lamp, at: [0, -0.9]}
    law: {type: spring, stiffness: 500, damping: 3}
design: {initial: 0.8}
objectives:
  E: {response: energy, over_time: max}
  y: {response: {displacement: {body: lamp, component: y}}, over_time: final}
combine: {weights: {E: 1, y: 1}}
solver: {settle: true, tolerance: 1.0e-10}
"""


DRIVEN = """
format: 1
gravity: [0, -9.8]
time: {end: 0.02}
bodies:
  crank: {mass: 0.5, inertia: 0.001, position: [0, 0.05]}
  coupler: {mass: 1.2, inertia: 0.012, position: [0.15, 0.175]}
  rocker: {mass: 1, inertia: 0.006, position: [0.325, 0.125]}
joints:
  - {name: drive, type: revolute, bodies: [ground, crank], at: [0, 0]}
  - {name: crank_pin, type: revolute, bodies: [crank, coupler], at: [0, 0.1]}
  - {name: rocker_pin, type: revolute, bodies: [coupler, rocker], at: [0.3, 0.25]}
  - {name: pivot, type: revolute, bodies: [ground, rocker], at: [0.35, 0]}
motions: [{body: crank, angle: {velocity: 12}}]
members:
  spring:
    from: {body: rocker, at: [0.3, 0.25]}
    to: {body: ground, at: [0.6, -0.1]}
    law: {type: spring, stiffness: K}
solver: {assemble: true, settle: true}
"""


def test_a_hanging_mass_begins_where_its_cord_carries_it_and_stays_there():
    case = read_case(HANGS)
    sag = 2.0 * 10.0 / (0.8 * 500.0)
    motion = mdstopo.simulate(case)
    assert motion.status.ok
    assert motion.q[0, 1] == pytest.approx(-1.0 - sag, rel=1e-12)
    assert np.abs(motion.q - motion.q[0]).max() <= 1e-12
    assert np.abs(motion.a).max() <= 1e-9
    found = mdstopo.evaluate(case)
    # k (m g / k)^2 / 2 with k = 500 alpha; displacements count from the stated place
    assert found.objectives["E"] == pytest.approx(0.5 * 20.0**2 / 400.0, rel=1e-10)
    assert found.gradients["E"][0] == pytest.approx(-0.5 * 20.0**2 / 500.0 / 0.8**2, rel=1e-8)
    assert found.objectives["y"] == pytest.approx(-sag, rel=1e-10)
    assert found.gradients["y"][0] == pytest.approx(sag / 0.8, rel=1e-8)


@pytest.mark.parametrize("stiffness", range(20, 401, 20))
def test_a_linkage_whose_every_motion_is_driven_has_nothing_to_settle(stiffness: int) -> None:
    """What is left of forces and steps is rounding, which may point back from the start."""
    motion = mdstopo.simulate(read_case(DRIVEN.replace("K}", f"{stiffness}}}")))
    assert motion.status.ok
    stated = [0.0, 0.05, 0.0, 0.15, 0.175, 0.0, 0.325, 0.125, 0.0]
    assert np.abs(motion.q[0] - stated).max() <= 1e-12


def test_a_lever_settles_at_the_root_of_its_moment():
    """A bar on a pin with an off-centre weight, held by a long spring: one equation in the angle, solved apart."""
    text = """
format: 1
gravity: [0, -9.8]
time: {end: 0.1}
bodies: {bar: {mass: 3, inertia: 0.5, position: [0.6, 0]}}
joints: [{type: revolute, bodies: [ground, bar], at: [0, 0]}]
members: {stay: {from: {body: ground, at: [0, 1]}, to: {body: bar, at: [1, 0]}, law: {type: spring, stiffness: 70}}}
solver: {settle: true}
"""
    motion = mdstopo.simulate(read_case(text))

    def moment(angle):
        tip = np.array([np.cos(angle), np.sin(angle)])
        span = np.array([0.0, 1.0]) - tip
        length = np.hypot(*span)
        pull = 70.0 * (length - np.sqrt(2.0)) * span / length
        return tip[0] * pull[1] - tip[1] * pull[0] - 3.0 * 9.8 * 0.6 * np.cos(angle)

    assert motion.q[0, 2] == pytest.approx(brentq(moment, -1.4, 0.0, xtol=1e-14), abs=1e-10)
    assert np.abs(motion.a).max() <= 1e-8


@pytest.mark.parametrize(
    ("solver", "bound"),
    [({"tolerance": 1e-12}, 1e-6), ({"integrator": "generalized_alpha", "step": 0.002, "tolerance": 1e-10}, 1e-2)],
    ids=["runge_kutta", "generalized_alpha"],
)
def test_gradients_go_through_the_equilibrium(solver, bound):
    case = load("cradle", **solver)
    alpha = design_of(case)
    found, direct = mdstopo.evaluate(case, alpha), mdstopo.evaluate(case, alpha, method="direct")
    assert found.status.ok, found.message
    direction = np.random.default_rng(1).normal(size=case.n_design) * alpha
    for name, slope in slopes(case, alpha, direction, 1e-4).items():
        gradient = found.gradients[name]
        assert abs(slope - gradient @ direction) <= bound * np.abs(gradient * direction).max(), name
        assert np.abs(direct.gradients[name] - gradient).max() <= 1e-9 * np.abs(gradient).max(), name


def test_without_the_term_at_the_start_gradients_would_be_wrong():
    """What the scene is for: its start does depend on the design."""
    case = load("cradle")
    alpha = design_of(case)
    evaluator = Evaluator(case)
    first, second = (evaluator.settled(factor * alpha, "default") for factor in (1.0, 1.01))
    assert first is not None
    assert second is not None
    assert np.abs(first.q - second.q).max() > 1e-5
    assert 1e-3 < first.moved < 0.5
    assert first.moved_body in ("cradle", "load", "arm")


def test_a_design_settles_in_the_same_place_whatever_was_evaluated_before():
    case = load("cradle")
    alpha = design_of(case)
    evaluator = Evaluator(case)
    before = evaluator.evaluate(alpha)
    evaluator.evaluate(0.7 * alpha)
    after = evaluator.evaluate(alpha)
    for name, value in before.objectives.items():
        assert after.objectives[name] == value
        assert np.array_equal(after.gradients[name], before.gradients[name])


def test_a_body_in_free_fall_is_refused_by_name():
    text = HANGS.replace("bodies: {", "bodies: {stone: {mass: 1, inertia: 1, position: [3, 0]}, ")
    with pytest.raises(CaseError, match=r"solver\.settle: body stone finds no static equilibrium"):
        mdstopo.simulate(read_case(text))


def test_a_design_that_cannot_hold_its_load_ends_the_evaluation_with_the_body_named():
    found = mdstopo.evaluate(read_case(HANGS), np.array([1e-4]))
    assert found.status is Status.NO_EQUILIBRIUM
    assert "body lamp" in found.message


@pytest.mark.parametrize("position", [[0, 0], [0.2, 0.1]], ids=["about its centre", "about a pin"])
def test_a_body_that_nothing_turns_keeps_its_angle(position):
    text = f"""
format: 1
time: {{end: 0.1}}
bodies:
  wheel: {{mass: 1, inertia: 1, position: {position}}}
  lamp: {{mass: 1, inertia: 1, position: [3, 0]}}
joints: [{{type: revolute, bodies: [ground, wheel], at: [0, 0]}}]
members:
  cord: {{from: {{body: wheel, at: [1, 0]}}, to: {{body: lamp, at: [2.9, 0.2]}}, law: {{type: spring, stiffness: 50}}}}
  tie: {{from: {{body: wheel, at: [1, 1]}}, to: {{body: lamp, at: [3, 0.2]}}, law: {{type: spring, stiffness: 70,
    free_length: 2}}}}
  bar: {{from: {{body: wheel, at: [0, -1]}}, to: {{body: lamp, at: [3, -1]}}, law: {{type: spring, stiffness: 60}}}}
solver: {{settle: true}}
"""
    motion = mdstopo.simulate(read_case(text))
    assert abs(motion.q[0, 2]) < 1e-13
    assert np.abs(motion.q - motion.q[0]).max() < 1e-9
    assert np.abs(motion.q[0, 3:]).max() > 1e-3


@pytest.mark.parametrize("axis", [[1, 0], [3, 1]], ids=["level", "oblique"])
def test_a_cart_on_its_rail_keeps_its_place_while_what_hangs_on_it_settles(axis):
    text = f"""
format: 1
time: {{end: 0.1}}
bodies:
  cart: {{mass: 3, inertia: 1, position: [0, 0]}}
  lamp: {{mass: 2, inertia: 0.4, position: [3, 0.4]}}
joints: [{{type: prismatic, bodies: [ground, cart], at: [0, 0], axis: {axis}}}]
members:
  cord: {{from: {{body: cart, at: [1, 0]}}, to: {{body: lamp, at: [2.9, 0.2]}}, law: {{type: spring, stiffness: 50}}}}
  tie: {{from: {{body: cart, at: [1, 1]}}, to: {{body: lamp, at: [3, 0.2]}}, law: {{type: spring, stiffness: 70,
    free_length: 2}}}}
  bar: {{from: {{body: cart, at: [0, -1]}}, to: {{body: lamp, at: [3, -1]}}, law: {{type: spring, stiffness: 60}}}}
solver: {{settle: true}}
"""
    motion = mdstopo.simulate(read_case(text))
    assert np.abs(motion.q - motion.q[0]).max() < 1e-9
    assert abs(motion.q[0, 5]) > 1e-3  # the lamp has turned
    along = np.array(axis) / np.hypot(*axis)
    moved = 3 * motion.q[0, :2] + 2 * (motion.q[0, 3:5] - [3, 0.4])
    assert abs(moved @ along) < 1e-9  # nothing pushes along the rail


def test_velocities_that_do_not_fit_where_the_scene_settles_are_refused():
    text = """
format: 1
gravity: [0, -10]
time: {end: 0.1}
bodies: {bar: {mass: 3, inertia: 0.5, position: [0.6, 0], velocity: [0, 0.6], angular_velocity: 1}}
joints: [{name: pin, type: revolute, bodies: [ground, bar], at: [0, 0]}]
members: {stay: {from: {body: ground, at: [0, 1]}, to: {body: bar, at: [1, 0]}, law: {type: spring, stiffness: 70}}}
solver: {settle: true}
"""
    with pytest.raises(CaseError, match="where the scene settles, the start velocities tear joint pin"):
        mdstopo.simulate(read_case(text))


@pytest.mark.parametrize("degrees", [60.0, 90.0, 120.0, 175.0])
def test_a_pendulum_settles_from_wherever_it_is_drawn(degrees):
    x, y = np.sin(np.radians(degrees)), -np.cos(np.radians(degrees))
    case = read_case(f"""
format: 1
gravity: [0, -9.81]
time: {{end: 0.1}}
bodies: {{arm: {{mass: 3, inertia: 0.1, position: [{x}, {y}]}}}}
joints: [{{type: revolute, bodies: [arm, ground], at: [0, 0]}}]
solver: {{settle: true}}
""")
    motion = mdstopo.simulate(case)
    assert motion.status.ok, motion.message
    assert motion.q[0] == pytest.approx([0.0, -1.0, -np.radians(degrees)], abs=1e-9)


def test_the_command_says_how_far_the_start_has_moved(tmp_path):
    file = tmp_path / "lamp.yaml"
    file.write_text(HANGS)
    result = CliRunner().invoke(simulate_command, [str(file), "--json", "--out", str(tmp_path / "lamp.h5")])
    document = json.loads(result.stdout)
    assert document["load_cases"]["default"]["settled"]["moved"] == pytest.approx(0.05, rel=1e-9)


def test_frequencies_are_those_about_the_equilibrium():
    case = read_case(HANGS)
    assert Evaluator(case).natural_frequencies(np.array([0.8]), "default") == pytest.approx([np.sqrt(400.0 / 2.0)])


def test_what_a_strap_has_pulled_until_it_is_slack_stays_there():
    text = """
format: 1
time: {end: 0.1}
bodies: {cart: {mass: 3, inertia: 1, position: [0, 0]}}
joints: [{type: prismatic, bodies: [ground, cart], at: [0, 0], axis: [1, 0]}]
members:
  strap: {from: {body: ground, at: [-2, 0]}, to: {body: cart, at: [0, 0]}, law: {type: gap, stiffness: 5000, gap: GAP,
    free_length: 1.9}}
solver: {settle: true}
"""
    for gap in (0.0, 0.01, 0.03, 0.07):
        motion = mdstopo.simulate(read_case(text.replace("GAP", str(gap))))
        assert abs(motion.q[0, 0] + 0.1 - gap) < 1e-12
