"""Members whose ends meet in a general scene are reported, not computed past in silence."""

import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.status import Status
from tests.engine.scenes import read
from tests.engine.test_zero_length import passed, passing

FALL = """
format: 1
time: {{end: 1}}
bodies: {{ball: {{mass: 1, inertia: 1, position: [0, 1], velocity: [0, -2]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  tie: {{from: {{body: ground, at: [0, 0]}}, to: {{body: ball, at: [0, 1]}}, law: {law}}}
objectives: {{G: {{response: energy, over_time: final}}}}
"""


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_member_that_passes_zero_length_under_force_is_named(integrator):
    case = read_case(
        FALL.format(law="{type: cubic, stiffness: 1, cubic: 0.1}"), overrides={"solver.integrator": integrator}
    )
    found = mdstopo.evaluate(case)
    assert found.status is Status.ZERO_LENGTH
    assert "member 0 of group tie" in found.message


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
@pytest.mark.parametrize("offset", [1e-4, 1e-6, 1e-8])
def test_a_pass_far_nearer_than_a_step_is_long_keeps_the_tolerance(tolerance, offset):
    """A cubic spring without its cubic part: the body of `tests.engine.test_zero_length`."""
    scene = passing(offset, law={"type": "cubic", "cubic": 0.0})
    scene["objectives"]["G"]["response"] = {"displacement": {"body": "ball"}}
    motion = mdstopo.simulate(read(scene, integrator="runge_kutta", tolerance=tolerance))
    assert motion.status.ok
    assert motion.q[-1, :2] == pytest.approx(passed(offset), abs=10.0 * tolerance * abs(motion.q[:, 0] - 1.0).max())


def test_a_slack_rope_may_pass_zero_length():
    found = mdstopo.evaluate(read_case(FALL.format(law="{type: gap, stiffness: 5, gap: 3}")))
    assert found.status.ok


def test_a_jump_of_a_driven_velocity_is_an_impact_for_a_joint():
    text = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 1, inertia: 1, position: [0, 0]}
  b: {mass: 1, inertia: 1, position: [1, 0]}
joints: [{type: revolute, bodies: [a, b], at: [0.5, 0]}]
motions: [{body: a, x: {velocity: {table: [[0, 0], [0.5, 0], [0.5, 1], [1, 1]]}}}]
"""
    with pytest.raises(mdstopo.CaseError, match=r"velocity of a jumps at t = 0\.5 s"):
        mdstopo.simulate(read_case(text))
