"""Minima of what has kinks: their values and gradients against closed forms and differences of finer evaluations."""

import numpy as np
import pytest

from mdstopo import evaluate
from mdstopo.case.reader import read_case
from tests.general.support import slopes

#: a driven body between springs: in t seconds the force of `left` falls as 3 - t, that of `right` rises as 3 + t
DRIVEN = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
motions: [{body: a, x: {velocity: 1}, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  anchors: {body: ground, grid: {list: [[10, 0], [-10, 0]]}}
  pads: {body: a, grid: {list: [[0, 0], [0, 0]]}}
members:
  g: {from: anchors, to: pads, connect: pairs, law: {type: spring, stiffness: 1, preload: 3}}
design: {initial: 1}
objectives:
  LOWEST: {response: {member_force: {group: g}}, over_time: min}
  MEAN: {response: {member_force: {group: g}}, over_time: mean}
combine: {weights: {LOWEST: 1, MEAN: 1}}
solver: {integrator: INTEGRATOR}
"""

#: three springs on a free body, whose largest force is lowest where it passes from one to another
FREE = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0.3]}}
points:
  p: {body: ground, grid: {list: [[-3, 0], [0, 2], [2, -2]]}}
  q: {body: a, grid: {list: [[0, 0], [0.1, 0.3], [0.2, 0]]}}
members: {g: {from: p, to: q, connect: pairs, law: {type: spring, stiffness: 9, preload: 2}}}
design: {initial: 0.6}
objectives:
  LOWEST: {response: {member_force: {group: g}}, over_time: min}
"""

#: a body whose speed, acceleration and force pass zero, the first two a little aside
SWING = """
format: 1
time: {end: 2}
bodies: {a: {mass: 1, inertia: 1, position: [1, 0], velocity: [1, ASIDE]}}
members:
  s: {from: {body: ground, at: [-5, 0]}, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 9, preload: 1}}
  u: {from: {body: ground, at: [1, 7]}, to: {body: a, at: [1, 0]}, law: {type: spring, stiffness: 6}}
design: {initial: 1}
objectives:
  V: {response: {velocity: {body: a}}, over_time: min}
  A: {response: {acceleration: {body: a}}, over_time: min}
  F: {response: {member_force: {group: s}}, over_time: min}
combine: {weights: {V: 1, A: 1, F: 1}}
"""


def tight(text):
    return read_case(text, overrides={"solver.tolerance": 1e-12})


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
@pytest.mark.parametrize("method", ["adjoint", "direct"])
@pytest.mark.parametrize("looked", ["both", "lowest alone"])
def test_the_lowest_largest_force_of_two_members_varies_with_both(integrator, method, looked):
    """a (3 - t) = b (3 + t) gives 6 a b / (a + b); with the mean, steps end at the crossing."""
    text = DRIVEN.replace("INTEGRATOR", integrator)
    if looked == "lowest alone":
        text = "\n".join(line for line in text.splitlines() if "MEAN" not in line)
    a, b = 1.0, 0.5
    found = evaluate(read_case(text), np.array([a, b]), method=method)
    assert found.objectives["LOWEST"] == pytest.approx(6 * a * b / (a + b), rel=1e-9)
    wanted = [6 * b * b / (a + b) ** 2, 6 * a * a / (a + b) ** 2]
    assert found.gradients["LOWEST"] == pytest.approx(wanted, rel=1e-8)


@pytest.mark.parametrize("alpha", [[0.6, 0.5, 0.7], [0.66, 0.97, 0.4], [0.96, 0.52, 0.6]])
def test_where_forces_of_a_free_body_cross_the_gradient_of_their_minimum_is_that_of_the_values(alpha):
    alpha = np.array(alpha)
    found = evaluate(read_case(FREE), alpha)
    direction = np.array([0.3, -0.5, 0.4])
    slope = slopes(tight(FREE), alpha, direction, 1e-4)["LOWEST"]
    assert found.gradients["LOWEST"] @ direction == pytest.approx(slope, rel=1e-7)


@pytest.mark.parametrize("aside", [0.0, 1e-4, 1e-2])
def test_what_turns_round_near_zero_has_the_gradient_of_its_values(aside):
    text = SWING.replace("ASIDE", repr(aside))
    alpha, direction = np.array([0.9, 0.8]), np.array([0.4, -0.7])
    found = evaluate(read_case(text), alpha)
    for name, slope in slopes(tight(text), alpha, direction, 1e-5).items():
        assert found.gradients[name] @ direction == pytest.approx(slope, rel=1e-7, abs=1e-7), name


@pytest.mark.parametrize("method", ["adjoint", "direct"])
def test_a_force_that_passes_zero_keeps_its_minimum(method):
    found = evaluate(read_case(SWING.replace("ASIDE", "0.1")), method=method)
    assert found.objectives["F"] == 0.0
    assert not found.gradients["F"].any()


def test_a_speed_that_passes_zero_keeps_its_minimum_also_where_steps_end_there():
    """Along one line: the speed is |cos w t|; the mean of it makes steps end at its zeros."""
    text = """
format: 1
time: {end: 3}
bodies: {a: {mass: 1, inertia: 1, position: [2, 0], velocity: [1, 0]}}
members:
  s: {from: {body: ground, at: [0, 0]}, to: {body: a, at: [2, 0]}, law: {type: spring, stiffness: 9}}
design: {initial: 1}
objectives:
  LOW: {response: {velocity: {body: a}}, over_time: min}
  A: {response: {acceleration: {body: a}}, over_time: min}
  MEAN: {response: {velocity: {body: a}}, over_time: mean}
combine: {weights: {LOW: 1, A: 1, MEAN: 1}}
"""
    for chosen in (text, text.replace("over_time: mean", "over_time: max")):
        found = evaluate(read_case(chosen))
        for name in ("LOW", "A"):
            assert found.objectives[name] == pytest.approx(0.0, abs=1e-12)
            assert not found.gradients[name].any()


#: one of two actuators is at its limit all the time; the force of the other falls below that and rises again
PLATEAU = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
motions: [{body: a, x: {velocity: 1}, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  anchors: {body: ground, grid: {list: [[-3, 0], [3, 0]]}}
  pads: {body: a, grid: {list: [[0, 0], [0, 0]]}}
members:
  g:
    from: anchors
    to: pads
    connect: pairs
    law: {type: actuator, proportional: 10, derivative: 0, target: 0.5, limit: 2}
design: {initial: 1}
objectives:
  LOWEST: {response: {member_force: {group: g}}, over_time: min}
"""


def test_a_minimum_on_a_plateau_is_that_of_the_member_that_holds_it():
    """|t - 0.5| falls below a fifth, where the second member's force is 2 alpha_2 all the time."""
    found = evaluate(read_case(PLATEAU), np.array([1.0, 0.6]))
    assert found.objectives["LOWEST"] == pytest.approx(1.2, rel=1e-12)
    assert found.gradients["LOWEST"] == pytest.approx([0.0, 2.0], abs=1e-12)
