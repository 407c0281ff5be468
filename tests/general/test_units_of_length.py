"""The same scene told in other units has the same numbers: nothing is measured by a metre of its own."""

import json

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.scene.compile_scene import with_arms

#: powers of two, of which rounding does not take anything: a micrometre, and 256 m
UNITS = (2.0**-20, 2.0**8)


def document(unit):
    """Two bodies with a crushable leg, a stop, a contact and an inerter, whose lengths are in this unit (m).

    The hull has its leg at its centre of mass, and the foot all that it has.
    """
    far = unit * np.array([[0.0, 1.0], [0.1, 0.0], [1.4, 1.9], [-0.3, 2.1]])
    hull, foot, post, hook = far.tolist()
    at_foot, at_hull = {"body": "foot", "at": foot}, {"body": "hull", "at": hull}
    return {
        "format": 1,
        "gravity": [0.0, -9.81 * unit],
        "time": {"end": 0.6},
        "bodies": {
            "hull": {"mass": 3.0, "inertia": 0.8 * unit**2, "position": hull, "velocity": [0.3 * unit, -2.0 * unit]},
            "foot": {"mass": 0.4, "inertia": 0.02 * unit**2, "position": foot, "velocity": [0.2 * unit, -2.0 * unit]},
        },
        "points": {"sole": {"body": "foot", "grid": {"list": [foot]}}},
        "contacts": [{
            "points": "sole", "stiffness": 4000.0, "damping": 20.0, "friction": 0.3, "slip": 0.05 * unit,
            "on": {"body": "ground", "from": [-3.0 * unit, -0.05 * unit], "to": [3.0 * unit, -0.05 * unit]},
        }],
        "members": {
            "leg": {
                "from": at_foot, "to": at_hull,
                "law": {"type": "crush", "stiffness": 3000.0, "force": 60.0 * unit, "gap": 0.01 * unit},
            },
            "strut": {"from": at_foot, "to": at_hull, "law": {"type": "spring", "stiffness": 80.0, "damping": 6.0}},
            "stop": {
                "from": {"body": "ground", "at": post}, "to": at_hull,
                "law": {"type": "gap", "stiffness": 200.0, "gap": 0.2 * unit},
            },
            "fly": {
                "from": {"body": "ground", "at": hook},
                "to": {"body": "hull", "at": [0.2 * unit, 1.1 * unit]},
                "law": {"type": "inerter", "inertance": 0.7},
            },
        },
        "design": {"initial": 0.8},
        "objectives": {
            "leg": {"response": {"member_force": {"group": "leg"}}},
            "fly": {"response": {"member_force": {"group": "fly"}}, "over_time": "rms"},
            "moved": {"response": {"displacement": {"body": "hull"}}, "over_time": "final"},
        },
        "combine": {"weights": {"leg": 1, "fly": 1, "moved": 1}, "normalize": False},
        "solver": {"integrator": "runge_kutta"},
    }  # fmt: skip


def evaluated(unit):
    """The scene evaluated; in this unit all objectives are lengths, because masses and times are the same."""
    found = mdstopo.evaluate(read_case(json.dumps(document(unit))))
    assert found.status.ok
    values = np.array(list(found.objectives.values())) / unit
    return values, np.array(list(found.gradients.values())) / unit, found.work["steps"]


@pytest.mark.parametrize("unit", UNITS)
def test_values_gradients_and_steps_do_not_depend_on_the_unit_of_length(unit):
    """In micrometres switches were found late by 1e-14 m, and the inerter's gradient was off by 1 %."""
    values, gradients, steps = evaluated(1.0)
    scaled_values, scaled_gradients, scaled_steps = evaluated(unit)
    assert scaled_values == pytest.approx(values, rel=1e-11)
    for one, other in zip(scaled_gradients, gradients, strict=True):
        assert one == pytest.approx(other, abs=1e-9 * np.abs(other).max())
    assert scaled_steps == steps


def test_pairs_without_an_arm_get_the_longest_of_the_others():
    assert with_arms(np.array([0.0, 3e-6, 2e-6]), 8e-6).tolist() == [3e-6, 3e-6, 2e-6]
    assert with_arms(np.array([0.0, 0.0]), 8e-6).tolist() == [8e-6, 8e-6]
    assert with_arms(np.array([0.0]), 0.0).tolist() == [1.0]
