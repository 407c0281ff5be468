"""Where a touch only just happens, or only just does not, the derivative is one-sided, and the status says so."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.status import Status

# a ball on a spring swings to y = -amplitude and back; the floor member closes at y = -reach
SWING = """
format: 1
time: {{end: 2}}
bodies: {{ball: {{mass: 1, inertia: 1, position: [0, 1], velocity: [0, -1]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  spring:
    from: {{body: ground, at: [0, 3]}}
    to: {{body: ball, at: [0, 1]}}
    law: {{type: spring, stiffness: 25}}
  floor:
    from: {{body: ground, at: [0, 0]}}
    to: {{body: ball, at: [0, 1]}}
    law: {{type: gap, stiffness: 400, damping: {c}, gap: {gap}, side: compression, clip: {clip}}}
    design: false
design: {{initial: 1}}
objectives: {{V: {{response: {{velocity: {{body: ball}}}}, over_time: final}}}}
solver: {{tolerance: 1.0e-10, integrator: {integrator}}}
"""
AMPLITUDE = 1.0 / 5.0  # v / omega


def evaluate(gap, c=5, clip="true", integrator="runge_kutta", alpha=1.0):
    case = read_case(SWING.format(gap=gap, c=c, clip=clip, integrator=integrator))
    return mdstopo.evaluate(case, np.array([alpha]))


@pytest.mark.parametrize("beyond", [1e-12, -1e-12])
def test_a_touch_within_the_tolerance_of_the_motion_is_told_on_either_side(beyond):
    found = evaluate(AMPLITUDE - beyond)
    assert found.status is Status.GRAZING
    assert found.message.startswith("member 0 of group floor")
    assert np.isfinite(found.objectives["V"])
    assert np.isfinite(found.gradients["V"]).all()


@pytest.mark.parametrize("gap", [0.9 * AMPLITUDE, 1.1 * AMPLITUDE])
def test_a_touch_proper_and_a_clear_miss_are_differentiable(gap):
    assert evaluate(gap).status.ok


def test_the_derivative_does_jump_there():
    """What the status claims: the slopes on either side, some way off, differ; without damping they do not."""
    near = 1e-7

    def gap_between(c):
        sides = [evaluate(AMPLITUDE + side * near, c) for side in (-1.0, 1.0)]
        assert all(each.status.ok for each in sides)
        return abs(sides[0].gradients["V"][0] - sides[1].gradients["V"][0]) / abs(sides[1].gradients["V"][0])

    assert gap_between(5) > 0.05
    assert gap_between(0) < 0.02


def test_undamped_and_unclipped_touches_leave_a_smooth_motion():
    assert evaluate(AMPLITUDE - 1e-12, c=0).status.ok
    assert evaluate(AMPLITUDE - 1e-12, clip="false").status.ok


def test_no_gradient_is_asked_for_no_warning_is_given():
    case = read_case(SWING.format(gap=AMPLITUDE - 1e-12, c=5, clip="true", integrator="runge_kutta"))
    assert mdstopo.evaluate(case, np.ones(1), gradient=False).status.ok


def test_a_force_that_peaks_at_a_grazing_touch_has_no_derivative():
    text = SWING.format(gap=AMPLITUDE - 3e-11, c=1e6, clip="false", integrator="runge_kutta").replace(
        "response: {velocity: {body: ball}}, over_time: final", "response: {member_force: {group: floor}}"
    )
    assert mdstopo.evaluate(read_case(text), np.ones(1)).status is Status.GRAZING


def test_a_ball_between_two_walls_a_nanometre_apart_is_reported_as_chattering():
    text = """
format: 1
time: {end: 1}
bodies: {ball: {mass: 1, inertia: 1, position: [0, 0], velocity: [1, 0]}}
motions: [{body: ball, y: {velocity: 0}, angle: {velocity: 0}}]
points:
  sides: {body: ground, grid: {list: [[-1, 0], [1, 0]]}}
  middle: {body: ball, grid: {list: [[0, 0]]}}
members:
  walls: {from: sides, to: middle, law: {type: gap, stiffness: 1.0e+20, gap: 5.0e-10, side: compression}}
solver: {integrator: runge_kutta, tolerance: 1.0e-6}
"""
    motion = mdstopo.simulate(read_case(text))
    assert motion.status is Status.CHATTERING
    assert "group walls" in motion.message
