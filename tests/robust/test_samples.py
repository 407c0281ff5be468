"""Samples have the moments of their distributions, fill space evenly, and depend on nothing but the seed."""

import numpy as np
import pytest
from scipy import stats

from mdstopo.case.methods.number_distributions import DISTRIBUTIONS as RECORDS
from mdstopo.case.methods.number_distributions import Discrete, Lognormal, Normal, Uniform
from mdstopo.case.objects.uncertain import Measure
from mdstopo.robust.intervals import student
from mdstopo.robust.robust_measures import estimate
from mdstopo.robust.sample import check_sample, design_sample, generators, lattice
from tests.robust.scenes import SCENARIOS, read, uncertain

#: each distribution, and scipy's of the same
DISTRIBUTIONS = [
    (Normal(60.0, 6.0), stats.norm(60.0, 6.0)),
    (Normal(60.0, 6.0, low=55.0), stats.truncnorm(-5.0 / 6.0, np.inf, 60.0, 6.0)),
    (Normal(60.0, 6.0, 50.0, 63.0), stats.truncnorm(-10.0 / 6.0, 0.5, 60.0, 6.0)),
    (Uniform(-1.0, 4.0), stats.uniform(-1.0, 5.0)),
    (Lognormal(225.0, 90.0), None),
    (Discrete((1.0, 5.0, 2.0), (0.5, 0.125, 0.375)), None),
]


def test_every_distribution_is_compared():
    assert {type(own) for own, _ in DISTRIBUTIONS} == set(RECORDS.values())


@pytest.mark.parametrize(("own", "other"), DISTRIBUTIONS, ids=lambda each: getattr(each, "type", ""))
def test_quantiles_are_those_of_the_distribution(own, other):
    u = (np.arange(20000) + 0.5) / 20000
    values = np.array([own.quantile(x) for x in u.tolist()])
    if other is not None:
        np.testing.assert_allclose(values, other.ppf(u), rtol=1e-9)
    mean, deviation = {
        "lognormal": lambda: (225.0, 90.0),
        "discrete": lambda: (1.875, np.sqrt(0.5 + 25 * 0.125 + 4 * 0.375 - 1.875**2)),
    }.get(own.type, lambda: (other.mean(), other.std()))()
    assert values.mean() == pytest.approx(mean, rel=1e-3)
    assert values.std() == pytest.approx(deviation, rel=3e-3)


@pytest.mark.parametrize("n", [8, 32, 100])
def test_a_lattice_has_the_mean_of_smooth_functions_far_better_than_a_random_sample(n):
    def mean(x):
        return float(np.prod(1.0 + 0.5 * (np.exp(x) - (np.e - 1.0)), axis=1).mean())

    own = [abs(mean(lattice(n, 3, seed)) - 1.0) for seed in range(20)]
    random = [abs(mean(np.random.default_rng(seed).random((n, 3))) - 1.0) for seed in range(20)]
    assert np.mean(own) < 0.35 * np.mean(random)
    assert np.mean([abs(mean(lattice(8 * n, 3, seed)) - 1.0) for seed in range(20)]) < 0.25 * np.mean(own)


def test_generating_vectors_are_units_and_differ():
    for n in (2, 3, 16, 97, 600):
        z = generators(n, 4)
        assert (np.gcd(z, n) == 1).all()
    assert len(set(generators(97, 6).tolist())) == 6
    assert generators(32, 3).tolist() == generators(32, 5)[:3].tolist()


def test_points_are_inside_and_depend_on_the_seed_alone():
    one, same, other = lattice(16, 2, 5), lattice(16, 2, 5), lattice(16, 2, 6)
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert ((one > 0.0) & (one < 1.0)).all()


def test_scenarios_meet_every_point_with_their_probability():
    case = read(uncertain(scenarios=SCENARIOS, validation=400))
    sample = design_sample(case.uncertainty)
    assert sample.values.shape == (16, 3)
    assert np.array_equal(sample.values[:8], sample.values[8:])
    assert sample.probability[:8].sum() == pytest.approx(0.75)
    assert sample.probability.sum() == pytest.approx(1.0)
    assert sample.scenario.tolist() == [0] * 8 + [1] * 8
    fresh = check_sample(case.uncertainty)
    assert 250 < np.count_nonzero(fresh.scenario == 0) < 350
    assert not np.isin(fresh.values[:, 0], sample.values[:, 0]).any()


def test_scenarios_alone_are_the_whole_sample():
    case = read(uncertain(parameters=None, scenarios=SCENARIOS, sample=None, validation=None))
    assert len(design_sample(case.uncertainty)) == 2
    assert check_sample(case.uncertainty) is None


def test_rounded_probabilities_are_scaled():
    scenarios = {name: {"probability": 0.333} for name in ("a", "b", "c")}
    case = read(uncertain(scenarios=scenarios))
    assert sum(each.probability for each in case.uncertainty.scenarios) == pytest.approx(1.0, abs=1e-15)


MEASURES = [
    (Measure("mean"), lambda rng, n: rng.gamma(3.0, 2.0, n), 6.0),
    (Measure("mean_deviation", factor=2.0), lambda rng, n: rng.gamma(3.0, 2.0, n), 6.0 + 2.0 * np.sqrt(12.0)),
    (Measure("quantile", level=0.9), lambda rng, n: rng.gamma(3.0, 2.0, n), stats.gamma(3.0, scale=2.0).ppf(0.9)),
    (Measure("quantile", level=0.97), lambda rng, n: rng.normal(0.0, 1.0, n), stats.norm.ppf(0.97)),
]


@pytest.mark.parametrize(("measure", "draw", "truth"), MEASURES, ids=lambda each: getattr(each, "words", ""))
def test_intervals_hold_the_truth_as_often_as_they_say(measure, draw, truth):
    rng = np.random.default_rng(3)
    held = np.mean([estimate(measure, draw(rng, 200)).holds(truth) for _ in range(600)])
    # 0.95, less what a skewed sample of 200 costs the delta method, within three deviations of 600 trials
    assert 0.91 < held < 0.985


def test_an_interval_of_a_quantile_that_the_sample_is_too_small_for_is_open():
    assert estimate(Measure("quantile", level=0.99), np.arange(30.0)).high == np.inf


def test_students_distribution():
    """From one degree of freedom on: of a fresh sample, points that cannot be computed are left out."""
    p = 0.975
    assert student(1) == pytest.approx(np.tan(np.pi * (p - 0.5)), rel=1e-9)
    assert student(2) == pytest.approx((2.0 * p - 1.0) * np.sqrt(2.0 / (4.0 * p * (1.0 - p))), rel=1e-9)
    # of printed tables
    for degrees, value in {5: 2.571, 10: 2.228, 30: 2.042, 60: 2.000, 120: 1.980}.items():
        assert student(degrees) == pytest.approx(value, abs=5e-4)


def test_what_does_not_vary_is_held_by_its_interval_whatever_its_sums_round_to():
    for value in np.random.default_rng(0).uniform(1.0, 1e6, 200):
        of_the_sample = float(np.full(64, value) @ np.full(64, 1.0 / 64.0))
        assert estimate(Measure("mean"), np.full(100, value)).holds(of_the_sample)
    assert not estimate(Measure("mean"), np.full(100, 1.0)).holds(1.0 + 1e-9)
