"""Every reduction over time, with its gradient, beside its definition on a swing that is known in closed form.

A mass m is held by a spring alpha k along x, weighs m p there and begins with the speed u:
x = p / w^2 (1 - cos w t) + u / w sin w t, w^2 = alpha k / m. Its largest value, its smallest and its end differ.
"""

import json

import numpy as np
import pytest
import yaml
from scipy.integrate import simpson

import mdstopo
from mdstopo.case.methods.over_time import REDUCTIONS
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator

MASS, STIFFNESS, PULL, SPEED, END, ALPHA = 2.0, 60.0, 1.5, 0.8, 1.3, 0.7
TIMES = np.linspace(0.0, END, 100001)

#: the definition of each, of values x at times t
DEFINED = {
    "max": lambda t, x: x.max(),
    "min": lambda t, x: x.min(),
    "max_abs": lambda t, x: np.abs(x).max(),
    "mean": lambda t, x: simpson(x, x=t) / t[-1],
    "rms": lambda t, x: np.sqrt(simpson(x**2, x=t) / t[-1]),
    "integral": lambda t, x: simpson(x, x=t),
    "final": lambda t, x: x[-1],
}


def swing(alpha):
    """x at TIMES."""
    w = np.sqrt(alpha * STIFFNESS / MASS)
    return PULL / w**2 * (1.0 - np.cos(w * TIMES)) + SPEED / w * np.sin(w * TIMES)


@pytest.fixture(scope="module")
def engine():
    """Of the swing with all reductions."""
    displacement = {"displacement": {"body": "mass", "component": "x"}}
    scene = {
        "format": 1,
        "gravity": [PULL, 0.0],
        "time": {"end": END},
        "bodies": {"mass": {"mass": MASS, "inertia": 1.0, "position": [0, 0], "velocity": [SPEED, 0.0]}},
        "members": {
            "spring": {
                "from": {"body": "mass", "at": [0, 0]},
                "to": {"body": "ground", "at": [-3, 0]},
                "law": {"type": "spring", "stiffness": STIFFNESS},
            }
        },
        "design": {"initial": ALPHA},
        "objectives": {name: {"response": displacement, "over_time": name} for name in REDUCTIONS},
        "combine": {"weights": dict.fromkeys(REDUCTIONS, 1)},
        "solver": {"tolerance": 1e-10},
    }
    return Evaluator(read_case(yaml.safe_dump(scene)))


@pytest.fixture(scope="module")
def evaluation(engine):
    """All reductions of one motion."""
    found = engine.evaluate(np.array([ALPHA]))
    assert found.status.ok, found.message
    return found


def test_every_reduction_is_defined_here():
    assert DEFINED.keys() == REDUCTIONS.keys()


@pytest.mark.parametrize("name", DEFINED)
def test_a_reduction_has_its_value_and_its_derivative(evaluation, name):
    values = {shift: float(DEFINED[name](TIMES, swing(ALPHA + shift * 1e-2))) for shift in (-2, -1, 0, 1, 2)}
    slope = (8.0 * (values[1] - values[-1]) - (values[2] - values[-2])) / 0.12
    assert evaluation.objectives[name] == pytest.approx(values[0], rel=1e-8)
    assert evaluation.gradients[name][0] == pytest.approx(slope, rel=1e-5)


def test_values_alone_leave_the_gradients_as_they_are(engine, evaluation):
    """Gradients of integrals were multiplied at each such call, until they overflowed."""
    kept = engine.driver("default").gradients
    before = kept.copy()
    assert engine.evaluate(np.array([ALPHA]), gradient=False).objectives == evaluation.objectives
    assert np.array_equal(kept, before)
    assert np.any(before != 0.0)


def test_the_lowest_velocity_at_the_moment_of_a_landing_keeps_its_sign():
    # 2 kg fall 0.4 m from rest on a floor with a damper, under a spring of 1 N/m: v^2 = 2 g h - alpha h^2 k / m
    document = {
        "format": 1,
        "gravity": [0, -9.81],
        "time": {"end": 0.6},
        "bodies": {"b": {"mass": 2, "inertia": 0.1, "position": [0, 0.5]}},
        "points": {"feet": {"body": "b", "grid": {"list": [[0, 0.4]]}}},
        "members": {
            "s": {
                "from": {"body": "b", "at": [0, 0.5]},
                "to": {"body": "ground", "at": [0, 2]},
                "law": {"type": "spring", "stiffness": 1},
            }
        },
        "contacts": [
            {
                "points": "feet",
                "on": {"body": "ground", "from": [-1, 0], "to": [1, 0]},
                "stiffness": 1e3,
                "damping": 200,
            }
        ],
        "objectives": {"v": {"response": {"velocity": {"body": "b", "component": "y"}}, "over_time": "min"}},
    }
    found = mdstopo.evaluate(read_case(json.dumps(document)))
    speed = (2.0 * 9.81 * 0.4 - 0.1 * 0.4**2 / 2.0) ** 0.5
    assert found.objectives["v"] == pytest.approx(-speed, rel=1e-7)
    assert found.gradients["v"] == pytest.approx([0.4**2 / 2.0 / (2.0 * speed)], rel=1e-5)
