"""Members that compete for the largest force have rows of their own."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.over_time.competing_members import _heights, compare
from mdstopo.integrators.steps import OF_SAMPLES, OK

GRID = """
format: 1
time: {{end: 2}}
gravity: [0, -3]
bodies: {{plate: {{mass: 2, inertia: 0.4, position: [0.02, 1], velocity: [0.05, -1], angular_velocity: 0.06}}}}
points:
  base: {{body: ground, grid: {{line: {{from: [-1, 0], to: [1, 0], count: {count}}}}}}}
  edge: {{body: plate, grid: {{line: {{from: [-0.97, 0.8], to: [1.03, 0.8], count: {count}}}}}}}
members:
  ties: {{from: base, to: edge, connect: pairs, law: {{type: spring, stiffness: 60, damping: 1}}}}
  side: {{from: {{body: ground, at: [2, 1]}}, to: {{body: plate, at: [0.5, 1]}}, law: {{type: spring, stiffness: 10}}}}
design: {{initial: 0.7, upper: 1, lower: 0}}
objectives: {{F: {{response: {{member_force: {{group: ties}}}}, over_time: {reduction}}}}}
solver: {{integrator: {integrator}, tolerance: 1.0e-9, step: {step}}}
"""


def text_of(reduction="max", integrator="runge_kutta"):
    return GRID.format(reduction=reduction, integrator=integrator, count=5, step=0.01)


@pytest.mark.parametrize("reduction", ["max", "final"])
def test_every_member_within_reach_of_the_largest_force_has_a_row_with_its_own_value(reduction):
    """Against each member alone: in a group of one nobody competes."""
    case = read_case(text_of(reduction))
    found = mdstopo.evaluate(case, gradient=False)
    alone = []
    for i in range(5):
        text = text_of(reduction)
        group = "  ties: {from: base, to: edge, connect: pairs, law: {type: spring, stiffness: 60, damping: 1}}\n"
        assert group in text
        parts = "".join(
            f"  tie{j}: {{from: {{body: ground, at: [{-1 + 0.5 * j}, 0]}}, to: {{body: plate, at: [{-0.97 + 0.5 * j}, "
            f"0.8]}}, law: {{type: spring, stiffness: 60, damping: 1}}}}\n"
            for j in range(5)
        )
        text = text.replace(group, parts).replace("group: ties", f"group: tie{i}")
        single = mdstopo.evaluate(read_case(text), gradient=False)
        alone += [peak.value for peak in single.peaks["F"]]
    best = max(alone)
    expected = sorted((value for value in alone if value >= 0.85 * best), reverse=True)[:6]
    assert [peak.value for peak in found.peaks["F"]] == pytest.approx(expected, rel=1e-8)
    assert len(expected) > 1


@pytest.mark.parametrize("integrator", ["runge_kutta", "generalized_alpha"])
def test_the_rows_of_competing_members_have_their_own_gradients(integrator):
    case = read_case(text_of(integrator=integrator))
    evaluator = Evaluator(case)
    alpha = np.array([0.7, 0.6, 0.5, 0.6, 0.8, 0.7])
    direct = evaluator.evaluate(alpha, sensitivity="direct")
    found = evaluator.evaluate(alpha)
    assert len(found.peaks["F"]) > 1
    direction = np.array([0.3, -0.5, 0.2, 0.9, -0.4, 0.1])
    h = 1e-4
    values = {}
    for m in (-2, -1, 1, 2):
        values[m] = [peak.value for peak in evaluator.evaluate(alpha + m * h * direction, gradient=False).peaks["F"]]
    for r, peak in enumerate(found.peaks["F"]):
        slope = (8 * (values[1][r] - values[-1][r]) - (values[2][r] - values[-2][r])) / (12 * h)
        assert slope == pytest.approx(peak.gradient @ direction, abs=2e-7 * np.abs(peak.gradient).max())
        assert np.abs(direct.peaks["F"][r].gradient - peak.gradient).max() <= 1e-9 * np.abs(peak.gradient).max()


def test_members_that_tie_by_symmetry_are_rows_the_first_one_first():
    text = """
format: 1
time: {end: 1}
bodies: {mass: {mass: 1, inertia: 1, position: [0, 1], velocity: [0, 1]}}
points:
  low: {body: ground, grid: {list: [[-1, 0], [1, 0]]}}
  top: {body: mass, grid: {list: [[0, 1]]}}
members:
  ties: {from: low, to: top, law: {type: spring, stiffness: 20, damping: 0.1}}
design: {initial: 1}
objectives: {F: {response: {member_force: {group: ties}}}}
"""
    found = mdstopo.evaluate(read_case(text))
    first, second = found.peaks["F"][:2]
    assert first.value == pytest.approx(second.value, rel=1e-12)
    assert first.gradient == pytest.approx(second.gradient[::-1], rel=1e-6)
    assert abs(first.gradient[0] - first.gradient[1]) > 1e-3 * abs(first.gradient).max()


def test_an_optimisation_brings_the_largest_forces_of_several_members_down_together():
    """Following only the largest member would stall where two tie."""
    text = text_of()
    text += "constraints: [{volume: all, equals: 3}]\noptimizer: {max_iterations: 40}\n"
    result = mdstopo.optimize(read_case(text))
    peaks = mdstopo.evaluate(result.case, result.alpha).peaks["F"]
    start = mdstopo.evaluate(result.case, np.full(6, 0.5), gradient=False).objectives["F"]
    assert result.objectives["F"] < 0.9 * start
    assert sum(peak.value >= 0.999 * peaks[0].value for peak in peaks) >= 2


@pytest.mark.parametrize(("integrator", "few"), [("runge_kutta", True), ("generalized_alpha", False)])
def test_forces_at_ends_of_steps_are_those_of_a_balance_there(integrator, few):
    """Explicit steps have these balances already: theirs are looked up but where a law, load or mode changes."""
    text = text_of(integrator=integrator).replace(
        "spring, stiffness: 10}", "gap, stiffness: 30, damping: 2, gap: 0.01}"
    )
    text = text.replace("end: 2}", "end: 2}\nloads: [{body: plate, force: [{table: [[0, 0], [0.5, 2], [1, 0]]}, 0]}]")
    case = read_case(text)
    driver = Evaluator(case).driver(case.load_cases[0].name)
    code, count, _ = driver.run(np.array(case.initial), False)
    assert code == OK
    assert driver.events > 0
    places = np.column_stack([np.repeat(np.arange(float(count)), 2), np.tile([0.0, 1.0], count)])
    before = int(driver.work[OF_SAMPLES])
    top, seen = compare(driver, 0, places, np.arange(5), count)
    made = int(driver.work[OF_SAMPLES]) - before
    assert made <= 2 * (driver.events + len(driver.scene.model.times)) if few else made >= len(places)
    for i in range(5):
        value, rate = driver.sample_response(0, places, True, count, who=i)[2][:, :2].T
        sign = np.where(seen[i, :, 0] >= 0.0, 1.0, -1.0)
        np.testing.assert_allclose(sign * seen[i, :, 0], value, rtol=1e-12, atol=1e-12 * value.max())
        np.testing.assert_allclose(sign * seen[i, :, 1], rate, rtol=1e-6, atol=1e-6 * np.abs(rate).max())
        assert top[i] == pytest.approx(value.max(), rel=1e-12)


SWING = """
format: 1
time: {{end: 2}}
bodies: {{ball: {{mass: 1, inertia: 1, position: [0, 0], velocity: [{across}, {along}]}}}}
points:
  far: {{body: ground, grid: {{list: [[-100, 0], [0, -100]]}}}}
  middle: {{body: ball, grid: {{list: [[0, 0], [0, 0]]}}}}
members:
  ties: {{from: far, to: middle, connect: pairs, law: {{type: spring, stiffness: 40}}}}
loads: [{{body: ball, force: [{push}, 0]}}]
design: {{initial: 1}}
objectives: {{F: {{response: {{member_force: {{group: ties}}}}, over_time: max_abs}}}}
solver: {{integrator: gauss, step: 0.5}}
"""


@pytest.mark.parametrize("push", [-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0])
def test_a_member_whose_peaks_lie_between_coarse_samples_competes(push):
    """Half a period in a step, at whose quarters forces are sampled: a narrow window has the highest of a wide one."""
    reach = np.hypot(push / 40**0.5, 1.0) + abs(push) / 40**0.5
    case = read_case(SWING.format(across=1.0, along=0.995 * reach, push=push))
    evaluator = Evaluator(case)
    wide, narrow = (
        [(peak.time, peak.value) for peak in evaluator.evaluate(case.start, rows=Rows(window, 100)).peaks["F"]]
        for window in (0.7, 0.02)
    )
    assert len(narrow) > 1
    assert narrow == [each for each in wide if each[1] >= 0.98 * wide[0][1]]


@given(st.floats(0.1, 1.4), st.floats(0.0, 1.0), st.booleans())
def test_tangents_at_samples_meet_above_a_peak_between_them(apart, share, negative):
    """Of a cosine, whose samples lie at both sides of its peak."""
    t = np.array([-share * apart, (1.0 - share) * apart])
    sign = -1.0 if negative else 1.0
    seen = sign * np.stack([np.cos(t), -np.sin(t)], axis=-1)[None, None]
    top = np.abs(seen[..., 0]).max(axis=(1, 2))
    height = _heights(top, seen, t, np.array([0.0, 1.0]), 1.0)
    assert height[0] >= 1.0 - 1e-12 or share in (0.0, 1.0)
    assert top[0] <= height[0] <= 1.0 + 0.5 * apart**2
    assert _heights(top, seen, t, np.array([0.0, 1.0]), top[0])[0] == top[0]
