"""Scenes that stand far from the origin are computed as the same scenes about it."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.scene.origin import origin_of, seen_from

#: a joint, a bushing, a contact, positions that are prescribed, three laws, responses seen from ground and from a body
MIXED = """
format: 1
gravity: [0, -9.81]
time: {{end: 0.8}}
bodies:
  cart: {{mass: 4, inertia: 1, position: [{x0}, {y0}]}}
  torso: {{mass: 6, inertia: 0.5, position: [{x0}, {y06}]}}
  ball: {{mass: 1, inertia: 0.1, position: [{x2}, {y03}], angular_velocity: 3}}
joints:
  - {{type: revolute, bodies: [torso, cart], at: [{x0}, {y02}]}}
bushings:
  - {{bodies: [ball, ground], at: [{x2}, {y06}], stiffness: [30, 40, 5], damping: [1, 1, 0.1]}}
motions:
  - {{body: cart, x: {{position: {{table: [[0, {x0}], [0.3, {x01}], [0.5, {x02}], [0.8, {x0}]]}}}}, y: {{velocity: 0}},
     angle: {{velocity: 0}}}}
contacts:
  - {{points: foot, on: {{body: ground, from: [{x1}, {y0}], to: [{x3}, {y0}]}},
     stiffness: 4000, damping: 10, friction: 0.2, slip: 0.1}}
members:
  out: {{from: {{body: torso, at: [{x01}, {y09}]}}, to: {{body: ground, at: [{x1}, {y1}]}},
        law: {{type: gap, stiffness: 400, damping: 5, gap: 0.01, clip: true}}}}
  back: {{from: {{body: ground, at: [{x1}, {y06}]}}, to: {{body: ball, at: [{x2}, {y04}]}},
         law: {{type: spring, stiffness: 90, free_length: 0.8}}}}
  across: {{from: {{body: torso, at: [{x0}, {y1}]}}, to: {{body: ball, at: [{x2}, {y05}]}},
           law: {{type: cubic, stiffness: 50, cubic: 30}}}}
points: {{foot: {{body: ball, grid: {{list: [[{x2}, {y01}]]}}}}}}
design: {{initial: 0.6}}
objectives:
  energy: {{response: energy, over_time: max}}
  force: {{response: {{member_force: {{group: out}}}}, over_time: max}}
  way: {{response: {{displacement: {{body: ball, at: [{x2}, {y01}]}}}}, over_time: final}}
  seen: {{response: {{acceleration: {{body: ball, relative_to: cart}}}}, over_time: rms}}
combine: {{method: weighted_sum, weights: {{energy: 1, force: 1, way: 1, seen: 1}}}}
solver: {{tolerance: 1e-9, assemble: true}}
"""

SPRINGS = """
format: 1
time: {{end: 1}}
bodies:
  ball: {{mass: 1, inertia: 0.3, position: [{x1}, {y0}], velocity: [1, 0.5], angular_velocity: 2}}
  free: {{mass: 2, inertia: 0.2, position: [{x2}, {y0}]}}
members:
  first: {{from: {{body: ball, at: [{x1}, {y02}]}}, to: {{body: ground, at: [{x0}, {y0}]}},
          law: {{type: spring, stiffness: 40}}}}
  second: {{from: {{body: ball, at: [{x1}, {y01}]}}, to: {{body: free, at: [{x2}, {y02}]}},
           law: {{type: spring, stiffness: 20, damping: 1}}}}
  grid: {{from: edge, to: rail, law: {{type: spring, stiffness: 0.01}}}}
points:
  edge: {{body: free, grid: {{line: {{from: [{x2}, {y0}], to: [{x3}, {y0}], count: 33}}}}}}
  rail: {{body: ground, grid: {{line: {{from: [{x2}, {y1}], to: [{x3}, {y1}], count: 33}}}}}}
design: {{initial: 0.5}}
objectives: {{G: {{response: energy, over_time: max}}}}
solver: {{tolerance: 1e-9}}
"""


def placed(text, x, y):
    """A case whose coordinates xN, yN are x + N, y + N; 01 stands for 0.1."""
    numbers = {"0": 0.0, "01": 0.125, "02": 0.25, "03": 0.375, "04": 0.5, "05": 0.625, "06": 0.75, "09": 0.875}
    numbers |= {"1": 1.0, "2": 2.0, "3": 3.0}
    places = {f"{axis}{key}": start + add for key, add in numbers.items() for axis, start in (("x", x), ("y", y))}
    return read_case(text.format(**{name: repr(value) for name, value in places.items()}))


@pytest.mark.parametrize("text", [MIXED, SPRINGS])
@pytest.mark.parametrize("place", [(2.0**20, -(2.0**22)), (1e6, -3e6)])
def test_a_scene_far_away_has_the_values_and_gradients_of_the_one_at_the_origin(text, place):
    near, far = (mdstopo.evaluate(placed(text, *at)) for at in ((0.0, 0.0), place))
    assert near.status.ok, near.message
    assert far.status.ok, far.message
    for name, value in near.objectives.items():
        assert far.objectives[name] == pytest.approx(value, rel=1e-11), name
        largest = np.abs(near.gradients[name]).max()
        np.testing.assert_allclose(far.gradients[name], near.gradients[name], rtol=0.0, atol=1e-9 * largest)


@pytest.mark.parametrize("text", [MIXED, SPRINGS])
def test_a_trajectory_is_told_in_the_coordinates_of_the_file(text):
    x, y = 2.0**20, -(2.0**22)
    near, far = (mdstopo.simulate(placed(text, *at)) for at in ((0.0, 0.0), (x, y)))
    shift = np.tile([x, y, 0.0], near.q.shape[1] // 3)
    np.testing.assert_allclose(far.q - shift, near.q, rtol=0.0, atol=2e-9)
    np.testing.assert_allclose(far.at(near.t).q - shift, near.q, rtol=0.0, atol=2e-9)
    np.testing.assert_allclose(far.at(near.t).v, near.v, rtol=0.0, atol=1e-8)
    assert list(far.reactions) == list(near.reactions)
    for name, reaction in near.reactions.items():
        np.testing.assert_allclose(far.reactions[name], reaction, rtol=0.0, atol=1e-8 * np.abs(reaction).max())


def test_only_what_is_far_away_is_moved_and_by_what_leaves_its_numbers_exact():
    near = placed(SPRINGS, 0.0, 0.0)
    assert origin_of(near) == (0.0, 0.0)
    assert seen_from(near, (0.0, 0.0)) is near
    far = placed(SPRINGS, 2.0**30, 0.0)
    moved = seen_from(far, origin_of(far))
    for one, other in zip(near.members, moved.members, strict=True):
        assert np.array_equal(one.from_local, other.from_local), one.name
        assert np.array_equal(one.to_local, other.to_local), one.name
        assert np.array_equal(one.length, other.length), one.name


def test_a_member_of_a_large_scene_may_be_written_to_ground_or_from_it():
    """A short member whose end on ground is 1e5 m from the scene's middle: the order of its ends does not matter."""
    text = """
format: 1
time: {{end: 1}}
bodies:
  here: {{mass: 1, inertia: 0.3, position: [-1e5, 0], angular_velocity: 2}}
  there: {{mass: 1, inertia: 0.3, position: [1e5, 0]}}
members:
  short: {{{one}: {{body: here, at: [-1e5, 0.25]}}, {other}: {{body: ground, at: [-99999.5, 0.5]}},
          law: {{type: {law}, stiffness: 40}}}}
design: {{initial: 0.5}}
objectives: {{G: {{response: energy, over_time: max}}}}
solver: {{tolerance: 1e-9}}
"""
    for law in ("spring", "spring, damping: 1", "gap, gap: 0.05"):
        ends = (("from", "to"), ("to", "from"))
        one, other = (mdstopo.evaluate(read_case(text.format(one=a, other=b, law=law))) for a, b in ends)
        assert one.status.ok, one.message
        assert one.objectives == other.objectives
        assert np.array_equal(one.gradients["G"], other.gradients["G"])
