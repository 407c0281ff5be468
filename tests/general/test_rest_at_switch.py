"""What rests where a strap or a foot only just touches, to rounding, stays at rest: it does not switch without end."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case

# on its spring alone the mass sags by 10 N / 1000 N/m = 0.01 m, where the strap, or the foot, begins to act
HANGING = """
format: 1
gravity: [0, -10]
time: {{end: 1}}
bodies: {{mass: {{mass: 1, inertia: 0.1, position: [0, 0]}}}}
joints: [{{type: prismatic, bodies: [ground, mass], at: [0, 0], axis: [0, 1]}}]
{touching}
design: {{initial: 0.5}}
objectives: {{sag: {{response: {{displacement: {{body: mass}}}}, over_time: final}}}}
solver: {{settle: true}}
"""
SPRING = """
members:
  spring:
    from: {{body: ground, at: [0, 1]}}
    to: {{body: mass, at: [0, 0]}}
    law: {{type: spring, stiffness: 1000}}
    design: false
  strap:
    from: {{body: ground, at: [0, 2]}}
    to: {{body: mass, at: [0, 0]}}
    law: {{{law}}}
"""
GAP = "type: gap, stiffness: 1000, damping: {c}, gap: {place!r}, clip: {clip}"
FLOOR = """
points: {{foot: {{body: mass, grid: {{list: [[0.2, 0]]}}}}}}
contacts:
  - {{points: foot, on: {{body: ground, from: [-1, {below!r}], to: [1, {below!r}]}}, stiffness: 500, damping: 10}}
"""
#: how far beyond the place of rest the touch begins (m): around what rounding leaves of the place, 1e-15 to 1e-12
BESIDE = [sign * size for size in np.geomspace(1e-15, 1e-12, 7).tolist() for sign in (-1.0, 1.0)]


def on_strap(place, c, clip):
    law = GAP.format(c=c, clip=clip, place=place)
    return HANGING.format(touching=SPRING.format(law=law))


def on_foot(place):
    weak = SPRING.format(law="type: spring, stiffness: 1.0e-9")
    return HANGING.format(touching=weak + FLOOR.format(below=-place))


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(lambda place: on_strap(place, 20, "true"), id="strap"),
        pytest.param(lambda place: on_strap(place, 20, "false"), id="strap that damping may push"),
        pytest.param(lambda place: on_strap(place, 0, "true"), id="strap without damping"),
        pytest.param(on_foot, id="foot"),
    ],
)
def test_a_mass_that_rests_where_something_only_just_touches_stays_there(scene):
    for beside in BESIDE:
        found = mdstopo.evaluate(read_case(scene(0.01 + beside)))
        assert found.status.usable, (beside, found.message)
        assert found.work["steps"] < 100, beside
        assert found.objectives["sag"] == pytest.approx(0.01, abs=1e-11), beside
