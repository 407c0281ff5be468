"""What a peak tells of the vector whose norm it is: the derivative across its direction; and the shape of its value."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.responses.extremes import FRACTION, RATE, TIME
from tests.reading import case_of

CONES = Rows(cones=True)

#: a driven, turning cart; a pendulum of two bars welded and hinged to it; a free ball; motion relative to the cart
SCENE = """
format: 1
gravity: [0.5, -9.81]
time: {end: 1.1}
bodies:
  cart: {mass: 4, inertia: 1, position: [0, 0]}
  bar: {mass: 2, inertia: 0.2, position: [0.6, -0.3], angle: 0.2}
  tip: {mass: 1, inertia: 0.1, position: [1.3, -0.5]}
  ball: {mass: 1, inertia: 0.05, position: [1.6, 0.6], velocity: [0.3, 0.2], angular_velocity: 0.5}
joints:
  - {name: hip, type: revolute, bodies: [cart, bar], at: [0.2, 0]}
  - {name: weld, type: fixed, bodies: [bar, tip], at: [1, -0.4]}
  - {name: rail, type: prismatic, bodies: [ground, cart], at: [0, 0], axis: [1, 0]}
motions: [{body: cart, x: {acceleration: {table: [[0, 0], [0.3, 6], [0.7, -4], [1.1, 1]]}}}]
points:
  low: {body: cart, grid: {list: [[-0.2, 0.4], [0.3, 0.5]]}}
  top: {body: tip, grid: {list: [[1.4, -0.4], [1.5, -0.6]]}}
members:
  ties: {from: low, to: top, law: {type: spring, stiffness: 60, damping: 1}}
  hold:
    {from: {body: tip, at: [1.4, -0.5]}, to: {body: ball, at: [1.5, 0.5]}, law: {type: cubic, stiffness: 20, cubic: 30}}
  base:
    from: {body: ground, at: [2, 2]}
    to: {body: ball, at: [1.7, 0.6]}
    law: {type: spring, stiffness: 30, damping: 0.5}
design: {initial: 0.6}
objectives:
  D: {response: {displacement: {body: ball, at: [1.7, 0.7], relative_to: bar}}, over_time: max}
  V: {response: {velocity: {body: tip, at: [1.5, -0.6], relative_to: ball}}, over_time: max}
  A: {response: {acceleration: {body: ball, at: [1.5, 0.6], relative_to: tip}}, over_time: max}
  least: {response: {acceleration: {body: ball, relative_to: tip}}, over_time: min}
  F: {response: {joint_force: {joint: hip}}, over_time: max}
  W: {response: {joint_force: {joint: weld}}, over_time: final}
combine: {weights: {D: 1, V: 1, A: 1, least: 1, F: 1, W: 1}}
solver: {tolerance: 1.0e-10}
"""

#: a bar that swings into damped ropes, whose force begins with a jump
STRUCK = """
format: 1
gravity: [0, -9.81]
time: {end: 0.3}
bodies:
  bar: {mass: 2, inertia: 0.2, position: [0.5, 0], angle: 0.1, angular_velocity: -1.2}
  tip: {mass: 1, inertia: 0.1, position: [1.3, 0.2], angular_velocity: 1.5, velocity: [0.04, -1.2]}
joints:
  - {name: hip, type: revolute, bodies: [ground, bar], at: [0, 0]}
  - {name: elbow, type: revolute, bodies: [bar, tip], at: [1, 0.05]}
members:
  rope:
    from: {body: ground, at: [0.6, 1.6]}
    to: {body: tip, at: [1.5, 0.1]}
    law: {type: gap, stiffness: 20, damping: 60, gap: 0.15}
  aid:
    from: {body: ground, at: [-0.4, 1]}
    to: {body: tip, at: [1.2, 0.3]}
    law: {type: spring, stiffness: 15, damping: 0.3}
  prop: {from: {body: ground, at: [1, -2]}, to: {body: bar, at: [0.7, 0]}, law: {type: spring, stiffness: 25}}
design: {initial: 0.6}
objectives:
  A: {response: {acceleration: {body: tip, at: [1.5, 0.1], relative_to: bar}}, over_time: max}
  F: {response: {joint_force: {joint: elbow}}, over_time: max}
combine: {weights: {A: 1, F: 1}}
solver: {tolerance: 1.0e-10, assemble: true}
"""

VARIABLES = """
design:
  initial: 0.6
  variables:
    k: {group: aid, parameter: stiffness, lower: 5, upper: 40}
    begin: {group: prop, parameter: active_from, initial: 0.1, lower: 0.01, upper: 0.2}
"""


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


def vector_of(case, trajectory, response, t):
    """The vector whose norm a response is, at time t, from the motion alone."""
    if response.kind == "joint_force":
        out, lam = trajectory.steps.balanced(np.array([t]))
        return trajectory.steps.reactions(out[0], lam)[response.joint][0, :2]
    names = [body.name for body in case.bodies]

    def of(body, x):
        return x[0, 3 * names.index(body) : 3 * names.index(body) + 3] if body in names else np.zeros(3)

    s = trajectory.at(t)
    (q, v, a), (p, pv, pa) = ([of(each, x) for x in (s.q, s.v, s.a)] for each in (response.body, response.relative_to))
    arm = np.array(response.at_local)
    c = turn(q[2]) @ arm
    u = q[:2] + c - p[:2]
    if response.kind == "displacement":
        q, p0 = (of(each, trajectory.q[:1]) for each in (response.body, response.relative_to))
        return turn(-p[2]) @ u - turn(-p0[2]) @ (q[:2] + turn(q[2]) @ arm - p0[:2])
    du = v[:2] + v[2] * QUARTER @ c - pv[:2]
    if response.kind == "velocity":
        return turn(-p[2]) @ (du - pv[2] * QUARTER @ u)
    ddu = a[:2] + a[2] * QUARTER @ c - v[2] ** 2 * c - pa[:2]
    return turn(-p[2]) @ (ddu - 2.0 * pv[2] * QUARTER @ du - pa[2] * QUARTER @ u - pv[2] ** 2 * u)


def differences(function, h):
    """d function(x)/dx at 0, by sixth-order central differences."""
    return sum(w * (function(m * h) - function(-m * h)) for m, w in ((1, 0.75), (2, -0.15), (3, 1 / 60))) / h


def check(case, design, h, moving=()):
    """Both gradients of every objective's highest peak against its vector, at the peak's time.

    moving: objectives whose peak stands where something happens, at a time that depends on the design: followed there.
    Returns the rows (n_obj, R, COLUMNS) of the design.
    """
    evaluator = Evaluator(case)
    found = evaluator.evaluate(design, rows=CONES)
    assert found.status.ok, found.message
    rows = evaluator.driver("default").rows.copy()
    for objective in case.objectives:
        name = objective.name
        peak = found.peaks[name][0]
        assert peak.shape == "norm"

        def vector(change, objective=objective, peak=peak):
            moved, t = design + change, peak.time
            if objective.name in moving:
                t = evaluator.evaluate(moved, gradient=False).peaks[objective.name][0].time
            return vector_of(case, evaluator.trajectory(moved, "default"), objective.response, t)

        here = vector(0.0)
        along = here / np.linalg.norm(here)
        assert np.linalg.norm(here) == pytest.approx(peak.value, rel=1e-9), name
        assert np.abs(peak.across * design).max() > 0.01 * np.abs(peak.gradient * design).max(), name
        rng = np.random.default_rng(5)
        for _ in range(2):
            line = design * rng.normal(size=len(design))
            slope = differences(lambda x, line=line, vector=vector: vector(x * line), h)
            size = np.abs(peak.gradient * line).sum() + np.abs(peak.across * line).sum()
            assert peak.gradient @ line == pytest.approx(along @ slope, abs=1e-6 * size), name
            assert peak.across @ line == pytest.approx(QUARTER @ along @ slope, abs=1e-6 * size), name
    return rows


@pytest.mark.parametrize("solver", [{}, {"integrator": "generalized_alpha", "step": 0.004}], ids=["rk", "alpha"])
def test_both_gradients_of_a_norm_are_those_of_its_vector_at_the_peaks_time(solver):
    case = case_of(SCENE, **solver)
    check(case, np.random.default_rng(0).uniform(0.4, 0.8, case.n_design), 1e-4)


def test_at_an_event_the_vector_is_followed_as_the_time_of_the_event_moves():
    """The peaks stand where the rope begins to pull: the perpendicular component moves with that time, too."""
    rows = check(case_of(STRUCK), np.array([0.6, 0.5, 0.7]), 1e-3, moving=("A", "F"))
    assert rows[:, 0, FRACTION].tolist() == [0.0, 0.0]  # behind the event
    assert np.all(rows[:, 0, RATE] != 0.0)


def test_the_vector_is_followed_as_parameters_of_laws_vary_and_the_time_at_which_one_begins():
    """The prop begins with a jump, and there one peak is: that time is a variable."""
    prop = "law: {type: spring, stiffness: 25}"
    assert prop in STRUCK
    text = STRUCK.replace(prop, "law: {type: spring, stiffness: 25, preload: 900, active_from: 0.1}")
    text = text.replace("design: {initial: 0.6}", VARIABLES).replace("end: 0.3", "end: 0.06")
    design = np.array([0.6, 0.5, 0.7, 12.0, 0.05])
    rows = check(case_of(text), design, 1e-4, moving=("A",))
    assert rows[:, 0, TIME] == pytest.approx([0.05, 0.06])
    assert rows[0, 0, RATE] != 0.0


@pytest.mark.parametrize("method", ["direct", "iterative"])
@pytest.mark.parametrize("text", [SCENE, STRUCK], ids=["scene", "struck"])
def test_direct_and_adjoint_agree_across(text, method):
    case = case_of(text, **({"integrator": "generalized_alpha", "step": 0.004} if method == "iterative" else {}))
    evaluator = Evaluator(case)
    adjoint = evaluator.evaluate(case.start, rows=CONES)
    other = evaluator.evaluate(case.start, sensitivity=method, rows=CONES)
    for name, peaks in adjoint.peaks.items():
        for one, two in zip(peaks, other.peaks[name], strict=True):
            assert np.abs(one.across - two.across).max() <= 1e-9 * np.abs(one.across).max(), name


def test_nothing_across_is_computed_unless_it_is_asked_for():
    evaluator = Evaluator(case_of(SCENE))
    asked = evaluator.evaluate(evaluator.case.start, rows=CONES)
    found = evaluator.evaluate(evaluator.case.start)
    assert all(peak.across is None for peaks in found.peaks.values() for peak in peaks)
    assert found.work["reverse_steps"] < 0.6 * asked.work["reverse_steps"]
    for name, peaks in found.peaks.items():
        for peak, same in zip(peaks, asked.peaks[name], strict=True):
            assert peak.value == same.value
            assert np.array_equal(peak.gradient, same.gradient)
    values = evaluator.evaluate(evaluator.case.start, gradient=False, rows=CONES)
    assert all(peak.across is None for peaks in values.peaks.values() for peak in peaks)


SHAPES = """
  D: {response: {displacement: {body: ball}}, over_time: max}
  X: {response: {displacement: {body: ball, component: x}}, over_time: max}
  Y: {response: {velocity: {body: ball, component: y}}, over_time: max_abs}
  T: {response: {angle: {body: bar}}, over_time: max_abs}
  U: {response: {angle: {body: bar}}, over_time: final}
  R: {response: {acceleration: {body: ball}}, over_time: rms}
  M: {response: {member_force: {group: ties}}, over_time: max}
  hip: {response: {joint_force: {joint: hip}}, over_time: max}
  weld: {response: {joint_force: {joint: weld}}, over_time: mean}
  rail: {response: {joint_force: {joint: rail}}, over_time: max}
  turn: {response: {joint_moment: {joint: weld}}, over_time: max}
  E: {response: energy, over_time: max}
combine: {weights: {D: 1, X: 1, Y: 1, T: 1, U: 1, R: 1, M: 1, hip: 1, weld: 1, rail: 1, turn: 1, E: 1}}
solver: {tolerance: 1.0e-6}
"""


def test_a_peak_says_whether_its_value_is_plain_absolute_or_a_norm():
    text = SCENE[: SCENE.index("  D:")] + SHAPES.lstrip("\n")
    found = Evaluator(case_of(text)).evaluate(np.full(6, 0.6), rows=CONES)
    assert {name: peaks[0].shape for name, peaks in found.peaks.items()} == {
        "D": "norm", "X": "plain", "Y": "absolute", "T": "absolute", "U": "plain", "R": "plain", "M": "absolute",
        "hip": "norm", "weld": "plain", "rail": "absolute", "turn": "absolute", "E": "plain",
    }  # fmt: skip
    assert {name for name, peaks in found.peaks.items() if peaks[0].across is not None} == {"D", "hip"}


SPRINGS = """
format: 1
time: {end: 3}
bodies: {mass: {mass: 1, inertia: 1, position: [0, 1], velocity: [0.4, 1], angular_velocity: 2}}
points:
  low: {body: ground, grid: {list: [[-1, 0], [1, 0], [0.3, 2]]}}
  top: {body: mass, grid: {list: [[0, 1.2]]}}
members: {ties: {from: low, to: top, law: {type: spring, stiffness: 90}}}
design: {initial: 1}
objectives: {E: {response: energy, over_time: max}}
"""


@pytest.mark.parametrize("text", [SPRINGS, SPRINGS.replace("energy", "{velocity: {body: mass}}")], ids=["fast", "norm"])
def test_how_many_peaks_are_told_and_from_how_far_below_the_highest_is_said_with_each_call(text):
    evaluator = Evaluator(read_case(text))
    usual = evaluator.evaluate(evaluator.case.start)
    wide = evaluator.evaluate(evaluator.case.start, rows=Rows(window=1.0, most=40)).peaks
    assert len(usual.peaks) == len(wide) == 1
    (name, every), *_ = wide.items()
    assert len(every) > len(usual.peaks[name])
    for window, most in ((0.3, 40), (0.0, 40), (1.0, 2), (1.0, 40)):
        some = evaluator.evaluate(evaluator.case.start, rows=Rows(window, most)).peaks[name]
        expected = [peak for peak in every if peak.value >= (1.0 - window) * every[0].value][:most]
        assert [peak.value for peak in some] == [peak.value for peak in expected]
        for one, two in zip(some, expected, strict=True):
            # many rows go back through a step as sums of unit cotangents, few alone (`general.sensitivity.row_sweep`)
            assert one.gradient == pytest.approx(two.gradient, rel=1e-12)
    again = evaluator.evaluate(evaluator.case.start)
    assert [peak.value for peak in again.peaks[name]] == [peak.value for peak in usual.peaks[name]]
