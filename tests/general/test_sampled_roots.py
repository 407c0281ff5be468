"""Zeros of functions of time that are known at samples."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.general.responses.sampled_roots import roots_between, roots_on_grid
from mdstopo.general.scene.timed_loads import PARTS, kink_times


def roots(function, rate, end):
    grid = np.linspace(0.0, end, PARTS + 1)
    found = np.sort(list(roots_on_grid(grid, function(grid), rate(grid), function)))
    return found[np.append(True, np.diff(found) > 1e-9)]


@pytest.mark.parametrize("w", [3.0, 300.0, 314.0, 777.7])
def test_all_zeros_are_found_of_what_turns_many_times_between_two_samples(w) -> None:
    """Of sin(314 t) over 60 s a third was found: it turns three times in a part."""
    found = roots(lambda t: np.sin(w * t), lambda t: w * np.cos(w * t), 60.0)
    assert found == pytest.approx(np.pi / w * np.arange(int(60.0 * w / np.pi) + 1), abs=1e-9)


def test_a_zero_at_a_sample_does_not_hide_another_one_behind_it() -> None:
    found = roots(lambda t: -(t - 0.2) * (t - 0.20005), lambda t: 0.40005 - 2.0 * t, 0.4)
    assert found == pytest.approx([0.2, 0.20005], abs=1e-12)


def test_a_line_is_not_sampled_more_closely() -> None:
    def line(t):
        asked.append(len(t))
        return t - 0.123

    asked: list[int] = []
    grid = np.linspace(0.0, 0.4, PARTS + 1)
    assert list(roots_on_grid(grid, grid - 0.123, np.ones_like(grid), line)) == pytest.approx([0.123])
    assert sum(asked) < 50


FAST = """
format: 1
time: {end: 60}
bodies: {mass: {mass: 2, inertia: 1, position: [0, 0]}}
members:
  spring:
    from: {body: ground, at: [-1, 0]}
    to: {body: mass, at: [0, 0]}
    law: {type: spring, stiffness: 2000, damping: 20}
loads: [{body: mass, force: ["FORCE", 0]}]
objectives: {G: {response: RESPONSE, over_time: mean}}
"""


def test_kinks_of_a_fast_load_over_a_long_time_are_all_found() -> None:
    text = FAST.replace("FORCE", "100*max(sin(314*t), 0)").replace("RESPONSE", "{velocity: {body: mass}}")
    case = read_case(text)
    times = np.array(kink_times(case, case.load_cases[0]))
    inside = np.unique(np.round(times[(times > 1e-6) & (times < 60.0)], 9))
    assert inside == pytest.approx(np.pi / 314.0 * np.arange(1, 5996 + 1), abs=1e-8)


def test_a_mean_of_what_a_fast_switch_lets_through_is_that_of_one_found_along_the_motion() -> None:
    along = {}
    for name, margin in (("time", "sin(314*t)"), ("motion", "sin(314*t) + 1e-300*v")):
        response = (
            f'{{expression: {{formula: "step({margin})*v", of: {{v: {{velocity: {{body: mass, component: x}}}}}}}}}}'
        )
        case = read_case(FAST.replace("FORCE", "100*sin(314*t)").replace("RESPONSE", response))
        along[name] = mdstopo.evaluate(case, gradient=False).objectives["G"]
    assert along["time"] == pytest.approx(along["motion"], rel=1e-7)


@pytest.mark.filterwarnings("error")
def test_rates_whose_squares_are_below_the_smallest_number_tell_of_no_root() -> None:
    ends, rates = (1.0, 1.0), (-1e-180, 2e-180)
    assert list(roots_between((0.0, 1.0), ends, rates, lambda c: np.ones(len(c)))) == []
