"""Members that switch: located exactly, with the right jump, and never a hang."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from tests.general.support import load, simulate_text

FALL = """
format: 1
gravity: [0, -10]
time: {{end: 2}}
bodies: {{ball: {{mass: 2, inertia: 1, position: [0, 1]}}}}
motions: [{{body: ball, x: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  floor:
    from: {{body: ground, at: [0, -1]}}
    to: {{body: ball, at: [0, 1]}}
    law: {{type: gap, stiffness: {k}, damping: {c}, gap: 0.8, side: compression}}
"""


def test_a_fall_into_a_contact_spring_bounces_as_the_closed_form_says():
    k, m, g = 5000.0, 2.0, 10.0
    motion = simulate_text(FALL.format(k=k, c=0), tolerance=1e-11)
    fall = np.sqrt(2.0 * 0.8 / g)
    speed, omega = g * fall, np.sqrt(k / m)
    # in contact: y = -g/w^2 + g/w^2 cos wt - v/w sin wt, until y = 0 again
    contact = 2.0 * (np.pi - np.arctan2(speed * omega, g)) / omega
    assert motion.at([fall]).q[0, 1] == pytest.approx(0.2, abs=1e-10)
    again = motion.at([fall + contact])
    assert again.q[0, 1] == pytest.approx(0.2, abs=1e-9)
    assert again.v[0, 1] == pytest.approx(speed, abs=1e-8)
    assert motion.at([2.0 * fall + contact]).q[0, 1] == pytest.approx(1.0, abs=1e-8)


def test_a_collision_through_a_gap_keeps_momentum():
    text = """
format: 1
time: {end: 1}
bodies:
  a: {mass: 2, inertia: 0.1, position: [0, 0], velocity: [2, 0], angular_velocity: 0.5}
  b: {mass: 3, inertia: 0.2, position: [1, 0.02]}
members:
  hit:
    from: {body: a, at: [0.1, 0.1]}
    to: {body: b, at: [0.9, 0]}
    law: {type: gap, stiffness: 4000, damping: 8, gap: 0.6, side: compression}
"""
    motion = simulate_text(text)
    momentum = motion.v.reshape(-1, 2, 3)[:, :, :2].transpose(0, 2, 1) @ np.array([2.0, 3.0])
    assert np.abs(motion.v[-1, 3]) > 0.5
    assert np.abs(momentum - momentum[0]).max() <= 1e-13


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_a_hundred_members_that_switch_together_are_one_event_in_time(integrator):
    text = (
        FALL.format(k=50, c=0.05)
        .replace("{body: ground, at: [0, -1]}", "low")
        .replace("{body: ball, at: [0, 1]}", "high")
        .replace(
            "members:",
            "points:\n  low: {body: ground, grid: {line: {from: [-1, -1], to: [1, -1], count: 100}}}\n"
            "  high: {body: ball, grid: {line: {from: [-1, 1], to: [1, 1], count: 100}}}\nmembers:",
        )
        .replace("    law:", "    connect: pairs\n    law:")
    )
    settings = {} if integrator == "runge_kutta" else {"step": 0.005}
    many = simulate_text(text, integrator=integrator, **settings)
    one = simulate_text(FALL.format(k=5000, c=5), integrator=integrator, **settings)
    assert many.status.ok
    assert many.q[-1, 1] == pytest.approx(one.q[-1, 1], abs=1e-7)
    assert len(many.t) <= 3 * len(one.t)


def test_a_ball_that_bounces_to_rest_on_a_damped_floor_does_not_hang():
    motion = simulate_text(FALL.format(k=5000, c=20).replace("end: 2", "end: 12"), tolerance=1e-8)
    assert motion.status.ok
    assert motion.q[-1, 1] == pytest.approx(0.2 - 20.0 / 5000.0, abs=1e-6)
    assert len(motion.t) < 5000


def test_two_bodies_that_fly_through_each_other_do_not_miss_their_contact():
    """Without forces a step could take the whole time; the contact in its middle is found all the same."""
    text = """
format: 1
time: {end: 10}
bodies:
  a: {mass: 1, inertia: 0.1, position: [0, 0], velocity: [2, 0]}
  b: {mass: 1, inertia: 0.2, position: [1, 0]}
members:
  hit:
    from: {body: a, at: [0, 0]}
    to: {body: b, at: [1, 0]}
    law: {type: gap, stiffness: 4000, gap: 0.6, side: compression}
"""
    motion = simulate_text(text)
    # equal masses exchange their velocities
    assert motion.v[-1, [0, 3]] == pytest.approx([0.0, 2.0], abs=1e-7)


def test_a_contact_that_begins_late_and_moves_apart_is_closed():
    """A law that starts to act deep in contact acts at once, whichever way its ends move."""
    text = FALL.format(k=40, c=0).replace("side: compression", "side: compression, active_from: 0.3")
    motion = simulate_text(text.replace("gap: 0.8", "gap: -3"), tolerance=1e-10)
    before, after = motion.at([0.3 - 1e-9]).a[0, 1], motion.at([0.3]).a[0, 1]
    assert before == pytest.approx(-10.0)
    drop = 0.5 * 10.0 * 0.09
    assert after == pytest.approx(-10.0 + 40.0 / 2.0 * (drop + 3.0), rel=1e-9)


def test_the_gradient_holds_on_both_sides_of_an_event():
    """A peak that passes through the touch-off when the design changes: near it, on either side, to 1e-5."""
    case = load("bouncing", tolerance=1e-11)
    base = np.array(case.initial)
    rng = np.random.default_rng(4)
    for scale in (0.98, 1.0, 1.02):
        alpha = base * scale
        found = mdstopo.evaluate(case, alpha)
        direction = rng.normal(size=len(alpha)) * alpha
        h = 1e-6
        plus, minus = (mdstopo.evaluate(case, alpha + s * h * direction, gradient=False) for s in (1, -1))
        for name, gradient in found.gradients.items():
            slope = (plus.objectives[name] - minus.objectives[name]) / (2 * h)
            assert abs(slope - gradient @ direction) <= 1e-5 * np.abs(gradient * direction).max(), name


def test_a_saturated_actuator_holds_its_limit():
    text = """
format: 1
time: {end: 1}
bodies: {ball: {mass: 1, inertia: 1, position: [0, 1]}}
motions: [{body: ball, x: {velocity: 0}, angle: {velocity: 0}}]
members:
  act:
    from: {body: ground, at: [0, 0]}
    to: {body: ball, at: [0, 1]}
    law: {type: actuator, proportional: 100, target: 0.5, limit: 3}
design: {initial: 1}
objectives: {F: {response: {member_force: {group: act}}, over_time: max}}
"""
    assert mdstopo.evaluate(read_case(text)).objectives["F"] == pytest.approx(3.0, abs=1e-12)
    # full thrust until the force has fallen to the limit, at x = 0.47
    motion = simulate_text(text, tolerance=1e-11)
    reached = np.sqrt(2.0 * 0.47 / 3.0)
    assert motion.at([reached]).q[0, 1] == pytest.approx(1.47, abs=1e-9)


#: a leg at its plateau, which stops a body to rest at t = 1.22e-4 s, and a belt that another body draws taut at 1.32e-4
STOPPED = """
format: 1
time: {end: 4.0e-4}
bodies:
  a: {mass: 1, inertia: 1, position: [0, 1], velocity: [0, 0.0274]}
  b: {mass: 1, inertia: 1, position: [5, 1], velocity: [0, 0.8525]}
members:
  leg:
    from: {body: ground, at: [0, 0]}
    to: {body: a, at: [0, 1]}
    law: {type: crush, stiffness: 1.0e+4, force: 223.68, side: tension, free_length: 0.9}
  belt:
    from: {body: ground, at: [5, 0]}
    to: {body: b, at: [5, 1]}
    law: {type: gap, stiffness: 100, gap: 1.152875e-4}
loads: [{body: b, force: [0, 269.7]}]
"""


def test_two_members_that_switch_right_behind_each_other_do_so_each_at_its_time():
    """One by a rate, the other by an elongation, in one step; both were found at one time, behind the second one."""
    motion = simulate_text(STOPPED, step=4e-4)
    rest = 0.0274 / 223.68
    taut = (np.sqrt(0.8525**2 + 2.0 * 269.7 * 1.152875e-4) - 0.8525) / 269.7
    assert motion.t[1:3] == pytest.approx([rest, taut], abs=1e-12)


#: a leg without effect on what is thrown up against it and stops at t = 0.02 s, a little beyond the plateau
GRAZED = """
format: 1
time: {{end: 0.088}}
gravity: [0, {gravity}]
bodies: {{stone: {{mass: 1000, inertia: 1, position: [0, {start}], velocity: [0, {speed}]}}}}
members:
  leg:
    from: {{body: ground, at: [0, -1]}}
    to: {{body: stone, at: [0, {start}]}}
    law: {{type: crush, stiffness: 1.0e-3, force: 1.0e-5, side: tension, free_length: 1}}
"""


def test_a_plateau_that_is_reached_and_left_within_a_quarter_of_a_step_is_found():
    """Between two places that a step is searched through, the member comes from where contact would be lost first."""
    plateau, start, beyond, top = 0.01, 0.001, 5e-6, 0.02
    gravity = 2.0 * (plateau + beyond - start) / top**2
    motion = simulate_text(GRAZED.format(gravity=-gravity, start=start, speed=gravity * top), step=0.088)
    reached = top - np.sqrt(2.0 * beyond / gravity)
    assert motion.t[1:3] == pytest.approx([reached, top], abs=1e-8)


def test_the_moment_of_an_event_takes_few_trials():
    """Under an integral a trial is a step of twelve balances; the first is where the polynomial has the event."""
    evaluator = Evaluator(load("bouncing"))
    motion = evaluator.trajectory(evaluator.case.start, "default")
    happened = evaluator.driver("default").events
    assert motion.status.ok
    assert happened >= 10
    steps = motion.work["steps"] + motion.work["rejected_steps"]
    assert motion.work["sums_of_switches"] <= happened * (2.5 * 12 + 4)
    assert motion.work["sums_of_starts"] <= 2 * happened + 4
    assert motion.work["force_sums"] <= 12 * steps + happened * (2.5 * 12 + 6) + 8
