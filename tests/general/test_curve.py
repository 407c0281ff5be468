"""Curves in motion: steps end at their knots, so values and gradients keep the tolerance."""

import json

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.case.reader import read_case
from tests.general.support import slopes

#: two members whose forces have second derivatives that jump at every knot that they pass
CURVES = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0.3]}}
members:
  g:
    from: {body: ground, at: [-2, 0]}
    to: {body: a, at: [0, 0]}
    law: {type: curve, curve: [[-2, -40], [-0.5, -9], [-0.1, -1], [0, 0], [0.05, 1], [0.2, 6], [2, 30]]}
  h:
    from: {body: ground, at: [0, -2]}
    to: {body: a, at: [0, 0.1]}
    law: {type: curve, curve: [[-2, -20], [-0.3, -9], [0.1, 2], [2, 30]]}
design: {initial: 0.8}
objectives:
  X: {response: {displacement: {body: a, component: x}}, over_time: final}
  E: {response: energy, over_time: max}
  M: {response: {displacement: {body: a, component: x}}, over_time: mean}
combine: {weights: {X: 1, E: 1, M: 1}}
solver: {integrator: runge_kutta}
"""


@pytest.mark.parametrize("alpha", [[0.8, 0.7], [0.5, 0.9]])
def test_gradients_of_curves_keep_the_tolerance(alpha):
    """At the default tolerance they were off by 39 millionths where steps passed over the knots."""
    alpha, direction = np.array(alpha), np.array([0.6, -0.3])
    tight = read_case(CURVES, overrides={"solver.tolerance": 1e-12})
    found, better = evaluate(read_case(CURVES), alpha), evaluate(tight, alpha, gradient=False)
    for name, slope in slopes(tight, alpha, direction, 1e-4).items():
        assert found.objectives[name] == pytest.approx(better.objectives[name], rel=1e-8)
        gradient = found.gradients[name]
        assert abs(gradient @ direction - slope) < 1e-7 * np.abs(gradient).max(), name


def test_a_body_that_rests_on_a_knot_stays_there():
    """No force, no motion, and no events by rounding."""
    text = CURVES.replace("velocity: [1, 0.3]", "velocity: [0, 0]").replace("[0.1, 2]", "[0, 0]")
    found = evaluate(read_case(text))
    assert found.status.ok
    assert found.objectives["X"] == 0.0
    assert found.work["steps"] < 10


@pytest.mark.parametrize(
    ("mass", "speed", "rows"),
    [
        (5.6, 10.8, [[-1, -127], [0, 0], [0.1, 12.7], [0.1015, 2857], [1, 2885]]),
        (0.33, 1.473, [[-1, -1.246], [0, 0], [0.1, 0.1246], [0.10255, 2.98], [1, 3.009]]),
        (0.15, 291.0, [[-1, -3.7], [0, 0], [0.1, 0.37], [0.1000056, 20417], [1, 20621]]),
    ],
)
def test_a_steep_piece_behind_a_knot_is_passed(mass, speed, rows):
    """A step that is far too long there takes its force from a steep cubic, far beyond the end of the cubic, and ends
    at 1e189 m: relative to a motion as large as that no error counted, and the step was kept."""
    data = {
        "format": 1,
        "time": {"end": 1.2 / speed},
        "bodies": {"a": {"mass": mass, "inertia": 1, "position": [1, 0], "velocity": [speed, 0]}},
        "members": {
            "s": {
                "from": {"body": "ground", "at": [-5, 0]},
                "to": {"body": "a", "at": [1, 0]},
                "law": {"type": "curve", "curve": rows},
            }
        },
        "design": {"initial": 1},
        "objectives": {"E": {"response": "energy", "over_time": "max"}},
    }
    for tolerance in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        found = evaluate(read_case(json.dumps({**data, "solver": {"tolerance": tolerance}})))
        assert found.status.ok, found.message
        assert found.objectives["E"] == pytest.approx(0.5 * mass * speed**2, rel=max(10 * tolerance, 1e-8))


#: a measured force of 60 rows
MEASURED = [[x, 60.0 * np.tanh(10.0 * x) + 50.0 * x] for x in np.linspace(-0.6, 0.9, 60).tolist()]


def hung(count, more=None, curve=None, **solver):
    """A plate that swings on `count` belts to two rows of points, whose curves have four knots each; more: responses
    over time beside those of its motion; curve: another one."""
    rows = [[-1.0 + 0.37 * k, 1.0 + 0.13 * (k % 3)] for k in range(count // 2)]
    scene = {
        "format": 1,
        "gravity": [0, -9.81],
        "time": {"end": 0.4},
        "bodies": {
            "plate": {"mass": 12, "inertia": 1, "position": [0, 0], "velocity": [1, 0.4], "angular_velocity": 2}
        },
        "points": {
            "corners": {"body": "plate", "grid": {"list": [[-0.2, 0.1], [0.3, 0.1]]}},
            "hooks": {"body": "ground", "grid": {"list": rows}},
        },
        "members": {
            "belts": {
                "from": "corners", "to": "hooks",
                "law": {"type": "curve", "curve": curve or [[-0.15, -90], [-0.02, -20], [0.03, 40], [0.12, 260]]},
            },
        },
        "design": {"initial": 0.4, "lower": 0},
        "objectives": {
            "X": {"response": {"displacement": {"body": "plate", "component": "x"}}, "over_time": "final"},
            "A": {"response": {"acceleration": {"body": "plate", "at": [0.3, 0.1]}}, "over_time": "max"},
        },
        "solver": {"integrator": "runge_kutta", **solver},
    }  # fmt: skip
    scene["objectives"] |= more or {}
    scene["combine"] = {"weights": dict.fromkeys(scene["objectives"], 1)}
    return read_case(json.dumps(scene))


@pytest.mark.parametrize(("count", "tolerance"), [(24, 1e-6), (60, 1e-8)])
def test_gradients_of_many_curves_keep_the_tolerance(count, tolerance):
    """Steps end at the knots of all of them."""
    alpha = np.random.default_rng(3).uniform(0.1, 0.6, count)
    direction = np.random.default_rng(4).normal(size=count)
    found = evaluate(hung(count, tolerance=tolerance), alpha)
    for name, slope in slopes(hung(count, tolerance=1e-13), alpha, direction, 1e-4).items():
        gradient = found.gradients[name]
        assert abs(gradient @ direction - slope) < 30.0 * tolerance * np.abs(gradient).max(), name


def test_the_gradient_by_an_alpha_of_zero_keeps_the_tolerance():
    """Steps end at knots of members that carry nothing, too: the motion does not feel these, the derivative does."""
    case, tight = hung(8), hung(8, tolerance=1e-13)
    alpha = np.array([0.4, 0.4, 0.0, 0.4, 0.0, 0.4, 0.4, 0.4])
    found = evaluate(case, alpha)
    for i in (2, 4):
        direction = np.eye(8)[i]
        for name, value in evaluate(tight, alpha, gradient=False).objectives.items():
            h = 2e-5
            one, two = (evaluate(tight, alpha + k * h * direction, gradient=False).objectives[name] for k in (1, 2))
            slope = (4.0 * one - two - 3.0 * value) / (2.0 * h)
            gradient = found.gradients[name]
            assert abs(gradient[i] - slope) < 1e-6 * np.abs(gradient).max(), name


@pytest.mark.parametrize("method", ["adjoint", "direct"])
def test_gradients_by_alphas_of_zero_of_many_curves_keep_the_tolerance(method):
    """Steps pass over their knots. Sums of stages across these were off by 1.6e-5 and, of energies, by 2e-6 and 7e-7.

    At the smaller tolerance steps end at all knots.
    """
    stored = {name: {"response": "energy", "over_time": name} for name in ("mean", "rms")}
    stored["pull"] = {"response": {"member_force": {"group": "belts"}}, "over_time": "mean"}
    stored["push"] = {"response": {"acceleration": {"body": "plate", "at": [0.3, 0.1]}}, "over_time": "mean"}
    alpha = np.zeros(60)
    alpha[[0, 1, 30, 31]] = 0.5
    found = evaluate(hung(60, stored, tolerance=1e-6), alpha, method=method)
    right = evaluate(hung(60, stored, tolerance=1e-12), alpha)
    assert found.work["sums_of_switches"] < right.work["sums_of_switches"]
    for name, gradient in right.gradients.items():
        off = np.abs(found.gradients[name] - gradient)[alpha == 0.0].max()
        assert off < 3e-7 * np.abs(gradient).max(), name


def test_curves_of_many_rows_without_load_have_the_derivatives_that_differences_show():
    """In a free fall, whose steps end at each knot long before they would end without: stages behind their ends took
    forces from cubics far beyond their pieces, and derivatives were off by five thousandths."""
    case, alpha, d = hung(60, curve=MEASURED, tolerance=1e-12), np.zeros(60), 1e-5
    found = evaluate(case, alpha)
    assert found.work["sums_of_switches"] > 0
    x = []
    for k in range(3):
        alpha[5] = k * d
        x.append(evaluate(case, alpha, gradient=False).objectives["X"])
    slope = (4.0 * x[1] - 3.0 * x[0] - x[2]) / (2.0 * d)
    gradient = found.gradients["X"]
    assert abs(gradient[5] - slope) < 1e-6 * np.abs(gradient).max()


@pytest.mark.parametrize(("step", "bound"), [(0.1, 1e-6), (0.02, 1e-11)])
def test_members_without_load_are_followed_through_as_many_knots_as_a_step_has(step, bound):
    """Up to thirty in the longer one. At the smaller tolerance steps end at all knots."""
    alpha = np.zeros(60)
    found = evaluate(hung(60, curve=MEASURED, tolerance=1e-6, step=step), alpha)
    right = evaluate(hung(60, curve=MEASURED, tolerance=1e-12), alpha)
    assert found.work["steps"] == round(0.4 / step)
    for name, gradient in right.gradients.items():
        assert np.abs(found.gradients[name] - gradient).max() < bound * np.abs(gradient).max(), name


def test_of_many_members_steps_end_at_knots_of_those_that_carry_load():
    alpha = np.zeros(60)
    alpha[[0, 1, 30, 31]] = 0.5
    found = evaluate(hung(60, tolerance=1e-6), alpha, gradient=False)
    alone = evaluate(hung(4, tolerance=1e-6), np.full(4, 0.5), gradient=False)
    assert found.work["steps"] == alone.work["steps"]
    assert found.objectives == pytest.approx(alone.objectives, rel=1e-13)


def test_steps_pass_over_knots_of_very_many_members():
    case, alpha = hung(60, tolerance=1e-6), np.zeros(60)
    alpha[:40] = 0.4
    assert evaluate(case, alpha, gradient=False).work["sums_of_switches"] > 0
    alpha[40] = 0.4
    assert evaluate(case, alpha, gradient=False).work["sums_of_switches"] == 0
