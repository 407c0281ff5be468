"""The two families of kernels check each other on scenes that both compute."""

from dataclasses import replace

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.driver.general_driver import GENERAL, GeneralDriver
from mdstopo.general.scene.compile_general import compile_general
from mdstopo.integrators.integrator_choice import method_of
from mdstopo.integrators.scene_driver import DriverOptions
from mdstopo.mechanics.laws.spring import NEAR_AT
from mdstopo.sensitivity.springs_driver import SPRINGS

CASE = """
format: 1
gravity: [0, -9.8]
time: {end: 0.3}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0], velocity: [0.1, 0], angular_velocity: 0.2}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1], angle: 0.1}
points:
  a: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 5}}}
  b: {body: vehicle, grid: {line: {from: [-1, -0.8], to: [1, -0.8], count: 4}}}
members:
  belts: {from: a, to: b, law: {type: spring, stiffness: 900, damping: 30, preload: 5}}
  ties: {from: {body: ground, at: [0, 1]}, to: a, law: {type: spring, stiffness: 300}, design: false}
loads:
  - {body: vehicle, acceleration: {table: [[0, 9.8, 0], [0.1, 4, 2], [0.3, 0, 0]]}, angular_acceleration: 20}
  - {body: torso, force: [30, 10], at: [0.1, 0.2], frame: body}
design: {initial: 0.4, power: 1.5}
objectives: {G: {response: energy, over_time: max}}
"""
JOINT = """
joints: [{name: pin, type: revolute, bodies: [torso, vehicle], at: [0, -0.5]}]
"""


@pytest.mark.parametrize("over_time", ["max", "min", "mean", "integral", "final"])
def test_values_and_gradients_agree(over_time):
    case = read_case(CASE, overrides={"objectives.G.over_time": over_time, "solver.tolerance": "1e-11"})
    expected = mdstopo.evaluate(case)
    options = DriverOptions(method_of("runge_kutta", case.solver), 1e-11, 0.0, case.objectives, case.initial)
    driver = GeneralDriver(case, compile_general(case, case.load_cases[0]), options)
    found = driver.evaluate(case.initial, True)
    assert found.status.ok
    gradient = expected.gradients["G"]
    assert found.rows[0, 0, 1] == pytest.approx(expected.objectives["G"], rel=1e-9)
    assert np.abs(found.gradients[0, 0] - gradient).max() <= 1e-8 * max(float(np.abs(gradient).max()), 1e-12)


@pytest.mark.parametrize("step", [0.008, 0.03])
def test_short_steps_give_the_same_rows_and_sum_no_member_at_their_ends_anew(step):
    """Four peaks and their gradients, of more steps than are gathered at once and of fewer."""
    settings = {"solver.integrator": "generalized_alpha", "solver.step": str(step), "time.end": "1.5"}
    case = read_case(CASE.replace("damping: 30, ", ""), overrides=settings)
    rows = Rows(window=1.0, most=4)
    expected = Evaluator(case).evaluate(case.initial, rows=rows).peaks["G"]
    general = Evaluator(case, beyond="a comparison")
    assert len(expected) == 4
    for one, other in zip(general.evaluate(case.initial, rows=rows).peaks["G"], expected, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert np.abs(one.gradient - other.gradient).max() <= 1e-8 * np.abs(other.gradient).max()
    work = general.evaluate(case.initial).work
    assert work["sums_of_samples"] < 0.5 * work["steps"]  # both ends, and inside steps with the highest peak


def test_how_far_bodies_may_move_for_displacements_to_tell_is_that_of_springs_alone():
    case = read_case(CASE)
    (scene,) = SPRINGS.scenes(case).values()
    (general,) = GENERAL.scenes(case).values()
    assert np.array_equal(general.model.law[:, NEAR_AT:], scene.model.near)
    assert np.all(general.model.law[:, NEAR_AT:] > 0.0)
    (jointed,) = GENERAL.scenes(read_case(CASE + JOINT)).values()
    assert not jointed.model.law[:, NEAR_AT:].any()


def test_a_scene_of_springs_keeps_its_own_kernels():
    assert Evaluator(read_case(CASE)).beyond == ""
    case = read_case(CASE)
    looking = replace(case, objectives=(replace(case.objectives[0], over_time="rms"),))
    assert Evaluator(looking).beyond == "over_time: rms"
