"""A measure, its slopes, and the rows that stand for it."""

import numpy as np
import pytest

from mdstopo.case.objects.uncertain import Measure
from mdstopo.evaluation import Peak, Rows
from mdstopo.robust.robust_measures import EACH, MEANS, ROWS, rows, slopes, statistic

ALL = [Measure("mean"), Measure("mean_deviation", factor=1.5), Measure("worst"), Measure("quantile", level=0.7)]


def words(measure):
    return measure.words


def equal(n):
    return np.full(n, 1.0 / n)


def test_definitions():
    y, p = np.array([3.0, 1.0, 2.0, 7.0]), np.array([0.4, 0.3, 0.2, 0.1])
    mean, deviation = np.average(y, weights=p), np.sqrt(np.cov(y, aweights=p, ddof=0))
    assert statistic(ALL[0], y, p) == pytest.approx(mean)
    assert statistic(ALL[1], y, p) == pytest.approx(mean + 1.5 * deviation)
    assert statistic(ALL[2], y, p) == 7.0
    # 1 and 2 have half of the probability, with 3 it is 0.9
    assert [statistic(Measure("quantile", level=level), y, p) for level in (0.3, 0.5, 0.7, 0.9, 0.95, 1.0)] == [
        1.0, 2.0, 3.0, 3.0, 7.0, 7.0,
    ]  # fmt: skip


def test_a_level_that_counts_points_is_not_missed_by_rounding():
    y = np.arange(1.0, 11.0)
    assert [statistic(Measure("quantile", level=k / 10), y, equal(10)) for k in range(1, 11)] == y.tolist()


@pytest.mark.parametrize("measure", ALL, ids=words)
def test_slopes_are_those_of_the_measure(measure):
    rng = np.random.default_rng(5)
    y, p = rng.normal(size=9), rng.dirichlet(np.ones(9))
    h = 1e-6
    found = [
        (statistic(measure, y + h * e, p) - statistic(measure, y - h * e, p)) / (2.0 * h) for e in np.eye(9)
    ]  # fmt: skip
    np.testing.assert_allclose(slopes(measure, y, p), found, atol=1e-8)


@pytest.mark.parametrize("apart", [1e-13, 1e-10, 1e-4])
def test_slopes_by_values_that_hardly_differ_add_up_to_one(apart):
    """All values one larger make the mean one larger and leave the deviation."""
    rng = np.random.default_rng(3)
    p = rng.random(12)
    p /= p.sum()
    y = 2.181683206835 * (1.0 + apart * rng.normal(size=12))
    assert slopes(ALL[1], y, p).sum() == pytest.approx(1.0, abs=1e-14)


def test_a_deviation_that_is_none_has_no_slope():
    y = np.full(5, 3.1)
    assert np.isfinite(slopes(ALL[1], y, equal(5))).all()
    assert slopes(ALL[1], y, equal(5)).sum() == pytest.approx(1.0)


def parts_of(rng, n, values=None):
    """Competing peaks of n points, highest first, linear in three variables."""
    parts = []
    for s in range(n):
        count = int(rng.integers(1, 4))
        found = np.sort(rng.uniform(0.9, 1.0, count))[::-1] + (0.0 if values is None else values[s])
        parts.append(tuple(Peak(float(rng.random()), float(v), rng.normal(size=3)) for v in found))
    return parts


def moved(parts, step):
    """The same peaks at another design, sorted anew."""
    return [
        tuple(
            sorted(
                (Peak(peak.time, peak.value + float(peak.gradient @ step), peak.gradient) for peak in part),
                key=lambda peak: -peak.value,
            )
        )
        for part in parts
    ]


def true_value(measure, parts, p):
    return statistic(measure, np.array([max(peak.value for peak in part) for part in parts]), p)


@pytest.mark.parametrize("measure", ALL, ids=words)
@pytest.mark.parametrize("seed", range(5))
def test_the_first_row_is_the_measure_and_no_row_exceeds_it(measure, seed):
    rng = np.random.default_rng(seed)
    parts, p = parts_of(rng, 7), rng.dirichlet(np.ones(7))
    found = rows(measure, parts, p, 1.0)
    assert found[0].value == pytest.approx(true_value(measure, parts, p), abs=1e-14)
    values = [row.value for row in found]
    assert values == sorted(values, reverse=True)
    assert len(values) <= (ROWS if measure.name in ("worst", "quantile") else MEANS)


@pytest.mark.parametrize("measure", ALL, ids=words)
def test_the_first_row_has_the_gradient_of_the_measure(measure):
    rng = np.random.default_rng(11)
    parts, p = parts_of(rng, 7), rng.dirichlet(np.ones(7))
    gradient = rows(measure, parts, p, 1.0)[0].gradient
    h = 1e-7
    found = [
        (true_value(measure, moved(parts, h * e), p) - true_value(measure, moved(parts, -h * e), p)) / (2.0 * h)
        for e in np.eye(3)
    ]
    np.testing.assert_allclose(gradient, found, atol=1e-7)


def test_rows_of_the_worst_case_hold_it_wherever_the_design_goes():
    rng = np.random.default_rng(2)
    parts = parts_of(rng, 4)
    found = rows(Measure("worst"), parts, equal(4), 1.0)
    assert len(found) == sum(len(part) for part in parts)
    for _ in range(50):
        step = rng.normal(size=3)
        held = max(row.value + row.gradient @ step for row in found)
        assert held == pytest.approx(true_value(Measure("worst"), moved(parts, step), equal(4)))


@pytest.mark.parametrize("name", ["worst", "quantile"])
def test_rows_are_as_many_and_as_far_from_the_highest_as_was_asked_for(name):
    values = 1.0 - 0.01 * np.arange(90)
    parts = [tuple(Peak(0.1, float(v), np.ones(2)) for v in values - shift) for shift in (0.0, 0.001)]
    measure = Measure(name, level=1.0)
    assert len(rows(measure, parts, equal(2), 1.0)) == ROWS
    assert len(rows(measure, parts, equal(2), 1.0, Rows(0.6, 6))) == EACH * 6
    wide = rows(measure, parts, equal(2), 1.0, Rows(0.6, 60))
    np.testing.assert_allclose(wide[-1].value, 0.4, atol=0.0011)
    assert len(wide) == 121


def test_what_is_asked_for_changes_no_row_of_a_mean():
    rng = np.random.default_rng(3)
    parts, far = parts_of(rng, 5), Peak(0.0, 0.6, np.ones(3))
    found = rows(Measure("mean"), [(*part, far) for part in parts], equal(5), 1.0, Rows(0.6, 60))
    usual = rows(Measure("mean"), parts, equal(5), 1.0)
    assert [row.value for row in found] == [row.value for row in usual]


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_a_quantile_are_never_below_it(seed):
    rng = np.random.default_rng(seed)
    parts, measure = parts_of(rng, 6), Measure("quantile", level=0.6)
    found = rows(measure, parts, equal(6), 1.0)
    for _ in range(50):
        step = rng.normal(size=3) * 0.1
        held = max(row.value + row.gradient @ step for row in found)
        assert held >= true_value(measure, moved(parts, step), equal(6)) - 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_a_mean_are_never_above_it(seed):
    rng = np.random.default_rng(seed)
    parts, measure = parts_of(rng, 5), Measure("mean")
    found = rows(measure, parts, equal(5), 1.0)
    assert len(found) > 3
    for _ in range(50):
        step = rng.normal(size=3)
        held = max(row.value + row.gradient @ step for row in found)
        assert held <= true_value(measure, moved(parts, step), equal(5)) + 1e-12


def test_rows_of_a_mean_trade_one_family_of_peaks_against_another():
    # two peaks at each point, the earlier one now the higher at some of them
    early, late = np.array([1.0, 0.99, 0.98]), np.array([0.99, 1.0, 0.97])
    up, down = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0])
    parts = []
    for a, b in zip(early, late, strict=True):
        pair = (Peak(0.1, float(a), up), Peak(0.2, float(b), down))
        parts.append(tuple(sorted(pair, key=lambda peak: -peak.value)))
    found = rows(Measure("mean"), parts, equal(3), 1.0)
    gradients = [row.gradient[0] for row in found]
    assert max(gradients) == pytest.approx(1.0)
    assert min(gradients) == pytest.approx(-1.0)
    assert max(found, key=lambda row: row.gradient[0]).value == pytest.approx(early.mean())


@pytest.mark.parametrize("measure", ALL, ids=words)
def test_what_is_to_be_large_is_measured_from_the_other_side(measure):
    rng = np.random.default_rng(4)
    parts, p = parts_of(rng, 6, rng.normal(size=6)), rng.dirichlet(np.ones(6))
    single = [part[:1] for part in parts]
    mirrored = [(Peak(part[0].time, -part[0].value, -part[0].gradient),) for part in single]
    here, there = rows(measure, single, p, -1.0)[0], rows(measure, mirrored, p, 1.0)[0]
    assert here.value == -there.value
    assert np.array_equal(here.gradient, -there.gradient)


def test_points_without_gradients_have_rows_without_gradients():
    parts = [(Peak(0.1, 1.0, None),), (Peak(0.1, 0.95, None),)]
    for measure in ALL:
        assert all(row.gradient is None for row in rows(measure, parts, equal(2), 1.0))
