"""Steps of 1e-16 s, which members leave between them that switch within rounding of each other."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mdstopo
from mdstopo.case.reader import read_case

MASS, FORCE, DAMPING, STIFFNESS, SPEED, STOPS = 2.0, 4500.0, 4.0, 2000.0, 500.0, 6
#: how far the mass comes before it meets the stops, m
FREE_WAY = 100.0


def stopped(apart, integrator, space, **solver):
    """A mass that is pushed against a damper into stops, each `apart` behind the one before (m)."""
    third = [0.0] if space else []
    mass = {
        "mass": MASS,
        "inertia": [1.0, 1.0, 1.0] if space else 1.0,
        "position": [0.0, 0.0, *third],
        "velocity": [SPEED, 0.0, *third],
    }
    to = {"body": "mass", "at": [0.0, 0.0, *third]}
    members = {
        "brake": {
            "from": {"body": "ground", "at": [-3.0, 0.0, *third]},
            "to": to,
            "law": {"type": "spring", "stiffness": 0.0, "damping": DAMPING},
            "design": False,
        }
    }
    for i in range(STOPS):
        members[f"stop_{i}"] = {
            "from": {"body": "ground", "at": [-3.0 - i, 0.0, *third]},
            "to": to,
            "law": {"type": "gap", "stiffness": STIFFNESS, "gap": FREE_WAY + i * apart},
        }
    document = {
        "format": 1,
        "dimension": 3 if space else 2,
        "time": {"end": 0.3},
        "bodies": {"mass": mass},
        "members": members,
        "loads": [{"body": "mass", "force": [FORCE, 0.0, *third]}],
        "design": {"initial": 1.0},
        "objectives": {
            "speed": {"response": {"velocity": {"body": "mass"}}},
            "brake": {"response": {"member_force": {"group": "brake"}}},
        },
        "combine": {"weights": {"speed": 1, "brake": 1}, "normalize": False},
        "solver": {"integrator": integrator, **solver},
    }
    return read_case(json.dumps(document))


def highest_speed():
    """Of the same mass by another program's integrator, with all stops at one place."""

    def rates(_, y):
        deep = max(y[0] - FREE_WAY, 0.0)
        return [y[1], (FORCE - DAMPING * y[1] - STOPS * STIFFNESS * deep) / MASS]

    def reaches(_, y):
        return y[0] - FREE_WAY

    def turns(_, y):
        return rates(0.0, y)[1]

    reaches.terminal = turns.terminal = True
    free = solve_ivp(rates, (0.0, 0.3), [0.0, SPEED], method="DOP853", rtol=1e-12, atol=1e-9, events=reaches)
    held = solve_ivp(
        rates, (free.t[-1], 0.3), free.y[:, -1], method="DOP853", rtol=1e-12, atol=1e-9, max_step=1e-3, events=turns
    )
    return float(held.y[1, -1])


@pytest.mark.parametrize(
    ("integrator", "space", "settings", "bound"),
    [
        ("runge_kutta", False, {}, 1e-9),
        ("esdirk", False, {}, 1e-8),
        ("generalized_alpha", False, {"step": 1e-4}, 1e-4),
        ("runge_kutta", True, {}, 1e-9),
        ("generalized_alpha", True, {"step": 1e-4}, 1e-4),
    ],
)
def test_peaks_are_right_beside_members_that_switch_within_rounding_of_each_other(integrator, space, settings, bound):
    """A velocity inside a step of 1e-16 s was the rounding of 100 m by that time: 846 m/s were told, and 1,716 m/s."""
    expected = highest_speed()
    for apart in (0.0, 1e-13, 4e-13):
        case = stopped(apart, integrator, space, **settings)
        found = mdstopo.evaluate(case)
        assert found.status.ok
        assert found.objectives["speed"] == pytest.approx(expected, rel=bound)
        assert found.objectives["brake"] == pytest.approx(DAMPING * expected, rel=bound)
    lengths = np.diff(mdstopo.simulate(case).t)
    assert 0.0 < lengths.min() < 1e-14  # the last scene has such steps
