"""Peaks over time: none is missed, none is told twice, and steps that are left out hold none."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.peaks import peak_search
from mdstopo.general.responses.extremes import COLUMNS, RATE, SAMPLES, SIGN, TIME, VALUE
from tests.general.support import design_of
from tests.general.test_row_sweep import CASES, IMPLICIT
from tests.space.in_python import in_python

__all__ = ["in_python"]

ALL = Rows(window=1.0, most=8)

#: a driven slide whose velocity is 0 at 0, 1, 1.5 and 2 s, where it is at 0, 0.9, 0.45 and 1 m
MOVED = """
format: 1
time: {end: 2}
bodies:
  slide: {mass: 1, inertia: 1, position: [0, 0]}
  load: {mass: 1, inertia: 1, position: [0, 1]}
motions:
  - body: slide
    x: {velocity: {table: [[0, 0], [0.5, 1.8], [1, 0], [1.25, -1.8], [1.5, 0], [1.75, 2.2], [2, 0]]}}
    y: {velocity: 0}
    angle: {velocity: 0}
members:
  tie: {from: {body: slide, at: [0, 0]}, to: {body: load, at: [0, 1]}, law: {type: spring, stiffness: 9}}
objectives:
  reach: {response: {displacement: {body: slide, component: x}}}
constraints:
  - {response: {displacement: {body: slide, component: x}}, over_time: max, limit: 0.95}
"""
SOLVERS = pytest.mark.parametrize("solver", [{}, IMPLICIT], ids=["rk", "alpha"])


def drivers(name, solver):
    """Each load case's driver, with a finished motion, how many steps it has, and the places of what it looks at."""
    case = CASES[name](**solver)
    evaluator = Evaluator(case)
    design = np.concatenate([design_of(case), case.start[case.n_design :]])
    assert evaluator.evaluate(design, gradient=False, rows=ALL).status.ok
    for load_case in evaluator.scenes:
        driver = evaluator.driver(load_case)
        code, count, _ = driver.run(evaluator.design(design), False)
        assert code == 0
        yield driver, count


def rows_of(driver, j, count, both, fine, window=1.0):
    """The peaks of a response, with steps left out inside (`fine`) or not."""
    rows = np.zeros((8, COLUMNS))
    found = driver.entry.peaks_of_steps(
        driver.entry.TAG, driver.ints, driver.floats, driver.method.tables, driver.limits, count, driver.room,
        driver.room_ints, driver.member_state, j, both, fine, window, rows, driver.work,
    )  # fmt: skip
    return rows[:found]


@SOLVERS
@pytest.mark.parametrize("name", CASES)
def test_nothing_on_the_motion_is_higher_than_the_highest_peak(name, solver):
    """Each step is looked at once more at 40 places of the method's own motion."""
    fractions = np.linspace(0.0, 1.0, 41)
    looked = 0
    for driver, count in drivers(name, solver):
        t = driver.states()[0][: count + 1].copy()
        for j, reduction in enumerate(driver.scene.reductions):
            if not reduction.is_largest:
                continue
            looked += 1
            both = reduction.is_magnitude
            rows = rows_of(driver, j, count, both, not driver.method.kind.adaptive)
            chosen = np.unique(np.linspace(0, count - 1, min(count, 150)).astype(int))
            places = np.array([(k, c) for k in chosen for c in fractions])
            seen = driver.sample_response(j, places, True, count)[2][:, 0].copy()
            top = np.abs(seen).max() if both else seen.max()
            best = rows[0, SIGN] * rows[0, VALUE]
            assert best >= top - 1e-9 * max(abs(top), np.abs(seen).max())
            # it is on the motion, at the time that is told
            step = min(int(np.searchsorted(t, rows[0, TIME], side="right")) - 1, count - 1)
            c = (rows[0, TIME] - t[step]) / (t[step + 1] - t[step])
            value = driver.sample_response(j, np.array([[step, c]]), True, count)[2][0, 0]
            before = driver.sample_response(j, np.array([[max(step - 1, 0), 1.0]]), True, count)[2][0, 0]
            assert min(abs(value - rows[0, VALUE]), abs(before - rows[0, VALUE])) <= 1e-9 * max(abs(best), 1e-300)
    assert looked


@pytest.mark.parametrize("name", CASES)
def test_steps_that_are_left_out_hold_no_peak(name):
    compared = 0
    for driver, count in drivers(name, IMPLICIT):
        for j, reduction in enumerate(driver.scene.reductions):
            if reduction.is_largest:
                whole = rows_of(driver, j, count, reduction.is_magnitude, False, 0.3)
                sparing = rows_of(driver, j, count, reduction.is_magnitude, True, 0.3)
                assert np.array_equal(whole, sparing)
                compared += 1
    assert compared


@SOLVERS
@pytest.mark.parametrize("name", CASES)
def test_inside_steps_rates_vanish_at_peaks_and_none_is_told_twice(name, solver):
    for driver, count in drivers(name, solver):
        for j, reduction in enumerate(driver.scene.reductions):
            if not reduction.is_largest:
                continue
            rows = rows_of(driver, j, count, reduction.is_magnitude, False)
            values = rows[:, SIGN] * rows[:, VALUE]
            assert np.all(np.diff(values) <= 0.0)
            assert len({(row[TIME], row[SIGN], row[6]) for row in rows}) == len(rows)
            span = driver.scene.load_case.end - driver.scene.load_case.start
            inside = (rows[:, 3] > 0.0) & (rows[:, 3] < 1.0)
            assert np.all(np.abs(rows[inside, RATE]) * span <= 1e-4 * np.abs(rows[:, VALUE]).max())


def places_of_peaks(values: np.ndarray, rates: np.ndarray) -> list[tuple[float, float]]:
    """Time and value of the peaks between steps of 1 s, from values and rates (m, SAMPLES) on them."""
    m = len(values)
    seen = np.stack([values, rates, np.full(values.shape, -1.0)], axis=2)
    rows = np.zeros((4 * m, COLUMNS))
    found = peak_search.peaks_between(np.arange(m + 1.0), seen, np.zeros(m, np.int64), 1.0, -1.0, rows, 0)
    return [(float(row[TIME]), float(row[VALUE])) for row in rows[:found]]


@pytest.mark.parametrize(
    ("before", "behind", "peaks"),
    [
        (1.0, -1.0, [(1.0, 0.0)]),  # rises into the end of a step, where it sticks, and falls out of it
        (1.0, 1.0, [(2.0, 0.5)]),  # goes on
        (-1.0, -1.0, [(0.0, 0.5)]),
    ],
)
def test_a_peak_between_steps_may_have_a_rate_of_exactly_zero(before, behind, peaks, in_python):
    back = np.linspace(-1.0, 0.0, SAMPLES)
    times = np.stack([back, back + 1.0])
    side = np.array([[before], [behind]])
    values = side * np.where(times < 0.0, -1.0, 1.0) * 0.5 * times**2
    assert places_of_peaks(values, side * np.abs(times)) == peaks


@pytest.mark.parametrize(
    ("ends", "peaks"),
    [
        ([(0.0, 1.0)], [(1.0, 1.0)]),  # rises, and comes to rest at the end of the motion
        ([(1.0, 0.0)], [(0.0, 1.0)]),
        ([(0.0, 1.0), (1.0, 1.0)], [(1.0, 1.0)]),  # rises, and then rests: one peak, where it has come to rest
        ([(0.0, 1.0), (1.0, 1.0), (1.0, 0.0)], [(1.0, 1.0)]),
        ([(1.0, 0.0), (0.0, 0.0), (0.0, 2.0)], [(3.0, 2.0), (0.0, 1.0)]),
    ],
)
def test_what_comes_to_rest_with_a_rate_of_exactly_zero_has_its_peak_there(ends, peaks, in_python):
    """Steps from one value to another, at rest at both: 3 c^2 - 2 c^3 of the way at the fraction c."""
    c = np.linspace(0.0, 1.0, SAMPLES)
    values = np.array([a + (b - a) * (3.0 * c**2 - 2.0 * c**3) for a, b in ends])
    rates = np.array([(b - a) * 6.0 * c * (1.0 - c) for a, b in ends])
    assert places_of_peaks(values, rates) == peaks


def test_a_move_that_ends_at_rest_is_highest_at_its_end():
    """Out by 0.9 m, half of it back, and out to 1 m: the largest travel is 1 m at the end, where the velocity is 0."""
    case = read_case(MOVED)
    evaluation = Evaluator(case).evaluate(case.start, gradient=False, rows=Rows(window=0.3, most=8))
    assert evaluation.objectives["reach"] == pytest.approx(1.0, rel=1e-9)
    assert [peak.time for peak in evaluation.peaks["reach"]] == pytest.approx([2.0, 1.0], abs=1e-9)
    (above,) = evaluation.constraints
    assert above == pytest.approx(1.0 - 0.95, rel=1e-9)


def test_a_peak_may_lie_at_a_sample_within_a_step(in_python, monkeypatch):
    def evaluate(tag, motion, j, who, pieces, w, c, sample):
        sample[:] = -((2.0 * c - 1.0) ** 2), -2.0 * (2.0 * c - 1.0), -1.0

    monkeypatch.setattr(peak_search, "evaluate_piece", evaluate)
    seen, rows = np.zeros((1, SAMPLES, 3)), np.zeros((8, COLUMNS))
    for i in range(SAMPLES):
        evaluate(0, None, 0, -1, None, 0, i / (SAMPLES - 1), seen[0, i])
    assert seen[0, SAMPLES // 2, 1] == 0.0
    steps, nobody = np.array([-1.0, 1.0]), np.zeros(1, np.int64)
    assert peak_search.peaks_inside(0, None, 0, -1, None, steps, seen, nobody, 1.0, -1.0, rows, 0) == 1
    assert rows[0, TIME] == pytest.approx(0.0, abs=1e-12)
    assert rows[0, VALUE] == pytest.approx(0.0, abs=1e-12)
