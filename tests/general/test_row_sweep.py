"""Many rows pulled back in one sweep are each what they are alone; and as many members compete as are asked for."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.driver import row_gradients
from mdstopo.general.over_time import competing_members
from tests.general.support import design_of, load
from tests.general.test_across import SCENE, STRUCK, VARIABLES
from tests.general.test_competing_members import GRID
from tests.reading import case_of

ALL = Rows(window=1.0, most=8, cones=True)
IMPLICIT = {"integrator": "generalized_alpha", "step": 0.004}


def every_row(evaluator, design, **asked):
    found = evaluator.evaluate(design, rows=ALL, **asked)
    assert found.status.ok, found.message
    return dict([*found.peaks.items(), *found.constraint_peaks.items()])


def differ(one, two):
    """By how much gradients differ at most, relative to the largest part of each."""
    assert one.keys() == two.keys()
    worst = 0.0
    for name, peaks in one.items():
        for a, b in zip(peaks, two[name], strict=True):
            assert a.value == b.value, name
            for x, y in ((a.gradient, b.gradient), (a.across, b.across)):
                assert (x is None) == (y is None), name
                if x is not None and np.abs(x).max() > 0.0:
                    worst = max(worst, np.abs(x - y).max() / np.abs(x).max())
    return worst


CASES = {
    "scene": (lambda **solver: case_of(SCENE, **solver)),
    "struck": (lambda **solver: case_of(STRUCK.replace("design: {initial: 0.6}", VARIABLES), **solver)),
    "everything": (lambda **solver: load("everything", **solver)),
    "bouncing": (lambda **solver: load("bouncing", **solver)),
    "crash": (lambda **solver: load("crash", **solver)),
    "cradle": (lambda **solver: load("cradle", **solver)),
}


@pytest.mark.parametrize("solver", [{}, IMPLICIT], ids=["rk", "alpha"])
@pytest.mark.parametrize("name", CASES)
def test_rows_that_are_pulled_back_together_are_what_they_are_alone(name, solver, monkeypatch):
    """Joints, motions, switching and crushed members, inerters, a start at rest, variables of laws."""
    case = CASES[name](**solver)
    evaluator = Evaluator(case)
    design = np.concatenate([design_of(case), case.start[case.n_design :]])
    together = every_row(evaluator, design)
    assert sum(len(peaks) for peaks in together.values()) > 5
    monkeypatch.setattr(row_gradients, "BLOCK", 1)
    alone = every_row(evaluator, design)
    assert differ(together, alone) <= 1e-12
    assert differ(together, every_row(evaluator, design, sensitivity="direct")) <= 1e-8


CRUSHED = """
format: 1
gravity: [0, -5]
time: {end: 0.5}
bodies: {craft: {mass: 100, inertia: 25, position: [0, 1], angle: 0.1, velocity: [0.6, -4], angular_velocity: -0.4}}
points:
  feet: {body: craft, grid: {line: {from: [-0.8, 0.5], to: [0.8, 0.6], count: 8}}}
  pads: {body: ground, grid: {line: {from: [-1, -0.2], to: [1, -0.2], count: 8}}}
members:
  legs: {from: pads, to: feet, connect: pairs, law: {type: crush, stiffness: 20000, force: 900, gap: 0.05}}
  ties: {from: pads, to: feet, connect: pairs, law: {type: spring, stiffness: 900, damping: 30}}
  late: {from: {body: ground, at: [2, 1]}, to: {body: craft, at: [0.9, 1]}, law: {type: spring, stiffness: 500}}
design:
  initial: 0.5
  lower: 0.01
  variables:
    k: {group: ties, parameter: stiffness, lower: 100, upper: 2000}
    begin: {group: late, parameter: active_from, initial: 0.1, lower: 0.01, upper: 0.2}
objectives:
  F: {response: {member_force: {group: ties}}, over_time: max}
  L: {response: {member_force: {group: legs}}, over_time: max}
  A: {response: {acceleration: {body: craft, at: [0.2, 1.2]}}, over_time: max}
combine: {weights: {F: 1, L: 1, A: 1}}
solver: {tolerance: 1.0e-9}
"""


def test_rows_are_what_they_are_alone_where_they_are_sums_of_unit_cotangents(monkeypatch):
    """More rows than twice the free coordinates, in a scene of crushed members, of variables of laws, of which one is
    a time."""
    case = read_case(CRUSHED)
    evaluator = Evaluator(case)
    asked = Rows(window=1.0, most=40, cones=True)
    together = evaluator.evaluate(case.start, rows=asked)
    assert together.status.ok, together.message
    assert sum(len(peaks) for peaks in together.peaks.values()) > 12
    calls = together.work["reverse_steps"]
    monkeypatch.setattr(row_gradients, "BLOCK", 1)
    alone = evaluator.evaluate(case.start, rows=asked)
    assert alone.work["reverse_steps"] > calls
    assert differ(dict(together.peaks), dict(alone.peaks)) <= 1e-12


def grid(members, reduction="max"):
    text = GRID.format(reduction=reduction, integrator="runge_kutta", count=members, step=0.02)
    return read_case(text.replace("stiffness: 60, damping: 1", f"stiffness: {300 / members}, damping: {5 / members}"))


@pytest.mark.parametrize("reduction", ["max", "final"])
def test_as_many_members_compete_as_come_within_the_window(reduction):
    """Against the force of each member along the motion, in a second formulation."""
    case = grid(40, reduction)
    evaluator = Evaluator(case)
    found = evaluator.evaluate(case.start, rows=Rows(window=0.6, most=100))
    trajectory = mdstopo.simulate(case)
    group = case.members[0]
    times = np.linspace(0.0, 2.0, 4001) if reduction == "max" else np.array([2.0])
    s = trajectory.at(times)
    turned = s.q[:, 2]
    arm = group.q_world - np.array(case.bodies[0].position)
    end = s.q[:, None, :2] + np.stack(
        [
            np.cos(turned)[:, None] * arm[:, 0] - np.sin(turned)[:, None] * arm[:, 1],
            np.sin(turned)[:, None] * arm[:, 0] + np.cos(turned)[:, None] * arm[:, 1],
        ],
        axis=2,
    )
    way = end - group.p_world
    length = np.linalg.norm(way, axis=2)
    lever = end - s.q[:, None, :2]
    speed = s.v[:, None, :2] + s.v[:, 2, None, None] * np.stack([-lever[..., 1], lever[..., 0]], axis=2)
    rest = np.linalg.norm(group.q_world - group.p_world, axis=1)
    force = 0.7 * np.abs(300 / 40 * (length - rest) + 5 / 40 * (way * speed).sum(axis=2) / length)
    top = force.max(axis=0)
    near = np.sort(top[top >= 0.4 * top.max()])[::-1]
    rows = evaluator.driver("default").rows[0, : len(found.peaks["F"])]
    assert len(set(rows[:, 6])) == len(near) > 12
    highest = [rows[rows[:, 6] == who, 1].max() for who in dict.fromkeys(rows[:, 6])]
    assert highest == pytest.approx(near, rel=1e-5)


def test_one_pass_over_the_motion_or_two_find_the_same_rows(monkeypatch):
    """Two, where all members at all places would take much memory."""
    evaluator = Evaluator(grid(15))
    asked = Rows(window=0.6, most=50)
    one = evaluator.evaluate(evaluator.case.start, rows=asked)
    monkeypatch.setattr(competing_members, "AT_ONCE", 0)
    two = evaluator.evaluate(evaluator.case.start, rows=asked)
    assert len(one.peaks["F"]) > 12
    assert [peak[:2] for peak in one.peaks["F"]] == [peak[:2] for peak in two.peaks["F"]]


def test_a_hundred_rows_take_no_more_of_a_step_than_a_body_has_coordinates_and_velocities():
    """Counted, not timed: unit cotangents go through whole steps, and the force sums of a sweep are those of the rows'
    own points alone."""
    evaluator = Evaluator(grid(60))
    few, many = (evaluator.evaluate(evaluator.case.start, rows=Rows(0.6, most)).work for most in (1, 60))
    values = [evaluator.evaluate(evaluator.case.start, False, rows=Rows(0.6, most)).work for most in (1, 60)]
    assert few["steps"] == many["steps"]
    assert 60 < many["reverse_steps"] <= 60 + 6 * (many["steps"] + 1)
    of_rows = many["force_sums"] - values[1]["force_sums"]
    assert of_rows <= 60 * (few["force_sums"] - values[0]["force_sums"])


@pytest.mark.parametrize("asked", [Rows(), Rows(1.0, 12), Rows(1.0, 30), Rows(0.3, 100)])
def test_leaving_out_peaks_that_are_too_low_to_be_told_changes_none_that_is(asked, monkeypatch):
    evaluator = Evaluator(grid(30))
    design = evaluator.case.start * np.random.default_rng(2).uniform(0.3, 1.3, len(evaluator.case.start))
    found = evaluator.evaluate(design, False, rows=asked).peaks["F"]
    monkeypatch.setattr(competing_members, "_limit", lambda *_: -1e300)
    every = evaluator.evaluate(design, False, rows=asked).peaks["F"]
    assert [peak[:2] for peak in found] == [peak[:2] for peak in every]
