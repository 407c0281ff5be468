"""Alphas that are small numbers, as areas in square metres are, beside others that are not: the same problem in shares.

Where the area is a power of two, both runs are the same to the bit.
"""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.objects.design_space import DesignSpace, units_of
from mdstopo.case.reader import read_case
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus
from tests.variables.support import FRAME_AND_LOAD

SCENE = (
    FRAME_AND_LOAD
    + """\
members:
  bars: {from: left, to: belt, law: {type: spring, stiffness: BARS}}
  ropes: {from: right, to: belt, law: {type: spring, stiffness: 2000, damping: 20}}
objectives:
  G: {response: {displacement: {body: load, relative_to: frame}}, over_time: max}
constraints:
  - {volume: bars, limit: LIMIT}
  - {response: {acceleration: {body: load}}, over_time: max, limit: 220}
design:
  initial: {bars: INITIAL, ropes: 0.2}
  lower: {bars: LOWER, ropes: 0.01}
  upper: {bars: UPPER, ropes: 1}
  MORE
optimizer: {max_iterations: 60}
"""
)


def case_in(area: float, more: str = "") -> mdstopo.Case:
    """The case with bars whose size is at most so large."""
    numbers = {"BARS": 2000 / area, "LIMIT": 3 * area, "INITIAL": 0.2 * area, "LOWER": 0.01 * area, "UPPER": area}
    text = SCENE.replace("MORE", more)
    for name, value in numbers.items():
        text = text.replace(name, repr(value))
    return read_case(text)


@pytest.mark.parametrize(
    "more",
    [
        "",
        "variables: {c: {group: ropes, parameter: damping, lower: 1, upper: 60}}",
        "shared: [bars]",
    ],
)
def test_a_run_ends_alike_whatever_unit_areas_have(more):
    """`converged` was told of the first or second design: beside slopes by areas all others are nothing."""
    expected = run_session(case_in(1.0, more))
    assert expected.evaluations > 4
    assert expected.status is RunStatus.CONVERGED
    for area in (2.0**-20, 3e-6):
        found = run_session(case_in(area, more))
        assert found.status is RunStatus.CONVERGED
        assert found.objectives["G"] == pytest.approx(expected.objectives["G"], rel=1e-6)
        bars = found.alpha[:6] / area
        assert bars == pytest.approx(expected.alpha[:6], abs=1e-3)


def test_of_a_power_of_two_the_run_is_the_same_to_the_bit():
    expected, found = run_session(case_in(1.0)), run_session(case_in(2.0**-20))
    assert found.evaluations == expected.evaluations
    assert (found.alpha * np.r_[np.full(6, 2.0**20), np.ones(6)]).tobytes() == expected.alpha.tobytes()


def test_designs_and_slopes_go_there_and_back():
    slots = np.array([0, 0, 1, 2, 3])
    units = units_of([(0.0, 3e-6), (0.01, 1.0)], [3, 2], slots)
    assert units is not None
    assert units.tolist() == [2.0**-18] * 3 + [1.0] * 2
    space = DesignSpace(5, slots, (), units)
    x = np.array([0.5, 0.25, 0.125, 1.0])
    design = space.expand(x)
    assert design.tolist() == [0.5 * 2.0**-18] * 2 + [0.25 * 2.0**-18, 0.125, 1.0]
    assert space.reduce(design).tolist() == x.tolist()
    slope = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
    assert space.vjp(slope).tolist() == [3.0 * 2.0**-18, 4.0 * 2.0**-18, 8.0, 16.0]
    lower, upper = space.bounds(np.zeros(5), np.array([3e-6] * 3 + [1.0] * 2))
    assert lower.tolist() == [0.0] * 4
    assert upper.tolist() == [3e-6 * 2.0**18, 3e-6 * 2.0**18, 1.0, 1.0]


@pytest.mark.parametrize(
    ("bounds", "unit"), [((0, 1.0), 1.0), ((0, 0.3), 1.0), ((0, 0.25), 0.25), ((0, 0.2), 0.25), ((0, 1e-6), 2.0**-19)]
)
def test_units_are_powers_of_two_and_1_where_bounds_are_no_small_numbers(bounds, unit):
    units = units_of([bounds], [2], None)
    assert (units is None) == (unit == 1.0)
    assert units is None or units.tolist() == [unit, unit]


def test_sizes_of_a_catalogue_and_alphas_of_candidates_that_are_priced_stay_as_they_are():
    assert not case_in(1e-6).space.identity
    assert case_in(1e-6, "catalogue: {bars: [0, 5.0e-7, 1.0e-6]}").space.identity
