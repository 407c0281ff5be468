"""Steps that end at a switch end on the polynomial of order 7 of the step that was too long."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.general.events import locate
from mdstopo.general.steps import step_inside
from mdstopo.integrators.runge_kutta_tables import GENERAL, VECTORS, A, B, C, runge_kutta_tables
from tests.engine.test_runge_kutta import residual
from tests.space.in_python import in_python  # noqa: F401  (a fixture)

TABLE = runge_kutta_tables()[GENERAL]


def table_inside(c: float) -> np.ndarray:
    out = np.zeros(TABLE.shape)
    step_inside.table_inside(TABLE, c, out)
    return out


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("c", [0.07, 0.5, 0.93])
def test_a_step_that_ends_inside_another_meets_the_conditions_of_order_seven(c):
    table = table_inside(c)[:, :16, :16]
    units, count = residual(7, 1, table[A], table[VECTORS, C], table[VECTORS, B], 1)
    assert count == 1 + 1 + 2 + 4 + 9 + 20 + 48
    assert units < 500 / c  # the polynomial's terms are as much larger than what they add up to
    assert residual(8, 1, table[A], table[VECTORS, C], table[VECTORS, B], 1)[0] > 1e6


@pytest.mark.usefixtures("in_python")
def test_at_the_end_it_is_the_whole_step():
    assert np.array_equal(table_inside(1.0)[VECTORS, B, :12], TABLE[VECTORS, B, :12])
    assert not table_inside(1.0)[VECTORS, B, 12:].any()


def located(margin, rounding, resolution):
    """Where between 0 and 1 the trials of `landing.root_inside` find a margin used up, and how many it took."""
    low, high, side = 0.0, 1.0, 0
    at_low, at_high = margin(low), margin(high)
    last, before = (low, at_low), (high, at_high)
    for tries in range(locate.TRIALS):
        slope = (last[1] - before[1]) / (last[0] - before[0])
        foreseen = last[0] - (last[1] + locate.BEHIND_SWITCH * rounding) / slope if slope < 0.0 and tries > 0 else -1.0
        middle = locate.next_trial(low, high, at_low, at_high, foreseen, rounding, resolution, tries)
        if middle < 0.0:
            return high, tries
        before, last = last, (middle, margin(middle))
        low, high, at_low, at_high, side = locate.narrowed(low, high, at_low, at_high, *last, rounding, side)
    return high, locate.TRIALS


@pytest.mark.usefixtures("in_python")
@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("steep", [1.0, 1e2, 1e4, 1e6])
@pytest.mark.parametrize("first", [0.003, 0.3, 0.96])
def test_the_first_of_two_margins_of_other_units_is_met_to_rounding(apart, steep, first):
    """A rate in m/s that is used up right before an elongation in m: secants of the least of both go to neither."""
    rounding, resolution = 8e-15, 1e-13

    def margin(c):
        later = first + apart
        return min(steep * (first - c), (later - c) * (1.0 + 0.3 * c))

    found, tries = located(margin, rounding, resolution)
    assert margin(found) < -rounding
    assert 0.0 < found - first <= locate.NEAR_SWITCH * rounding / steep + resolution
    assert tries < locate.TRIALS


#: a trolley on a rail that is thrown against a buffer with friction of its own, and pulled back by a slack rope
TROLLEY = """
format: 1
gravity: [0, -9.81]
time: {{end: 1.2}}
bodies:
  trolley: {{mass: 3, inertia: 0.5, position: [0, 0], velocity: [2, 0]}}
  load: {{mass: 1, inertia: 0.05, position: [0, -0.5], velocity: [2.4, 0], angular_velocity: 0.8}}
joints:
  - {{name: pin, type: revolute, bodies: [trolley, load], at: [0, 0]}}
motions: [{{body: trolley, y: {{velocity: 0}}, angle: {{velocity: 0}}}}]
members:
  buffer:
    from: {{body: trolley, at: [0, 0]}}
    to: {{body: ground, at: [2, 0]}}
    law: {{type: gap, side: compression, stiffness: 900, damping: 12, gap: 0.3, clip: true}}
  rope:
    from: {{body: load, at: [0, -0.5]}}
    to: {{body: ground, at: [-1, -0.5]}}
    law: {{type: gap, stiffness: 60, damping: 0.5, gap: 0.2}}
design: {{initial: 0.6, lower: 0.1}}
objectives:
  far: {{response: {{displacement: {{body: load}}}}, over_time: {over_time}}}
solver: {{tolerance: {tolerance}}}
"""


@pytest.mark.parametrize("over_time", ["final", "mean"])
def test_gradients_through_joints_and_switches_are_those_of_differences(over_time):
    """Both ways of ending at a switch: on the polynomial, and, under an integral, by a shorter step."""
    case = read_case(TROLLEY.format(over_time=over_time, tolerance=1e-12))
    found = mdstopo.evaluate(case)
    # four balances for each step that a switch ends, and those for one that was looked at in vain
    assert found.work["sums_of_switches"] > 0
    if over_time == "final":
        assert found.work["sums_of_switches"] <= 2 * found.work["sums_of_starts"] + 8
    for i in range(2):
        h, slope = 2e-4, 0.0
        for k, weight in ((1, 8.0 / 12.0), (2, -1.0 / 12.0)):
            sides = []
            for sign in (1.0, -1.0):
                alpha = np.array(case.initial)
                alpha[i] += sign * k * h
                sides.append(mdstopo.evaluate(case, alpha, gradient=False).objectives["far"])
            slope += weight * (sides[0] - sides[1]) / h
        assert found.gradients["far"][i] == pytest.approx(slope, rel=1e-7)
    direct = mdstopo.evaluate(case, method="direct")
    assert direct.gradients["far"] == pytest.approx(found.gradients["far"], rel=1e-11)


def test_a_loose_tolerance_is_kept_through_switches():
    exact = mdstopo.evaluate(read_case(TROLLEY.format(over_time="final", tolerance=1e-12)))
    for tolerance in (1e-4, 1e-6, 1e-8):
        loose = mdstopo.evaluate(read_case(TROLLEY.format(over_time="final", tolerance=tolerance)))
        assert loose.objectives["far"] == pytest.approx(exact.objectives["far"], rel=10.0 * tolerance)
        largest = np.abs(exact.gradients["far"]).max()
        assert np.abs(loose.gradients["far"] - exact.gradients["far"]).max() <= 10.0 * tolerance * largest
