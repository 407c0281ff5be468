"""Every scalarisation against its formula, and its gradients against differences."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.optimizer.scalarisation import NotPositiveError, Scalarisation, highest_choices

N = 5
LOW, HIGH = np.array([1.0, 2.0, 0.5]), np.array([5.0, 9.0, 3.0])


def formula(one, g, raw):
    """U of single values, straight from the definition."""
    w, active = one.weights, one.active
    if one.method == "weighted_exponential":
        return sum(w[i] * np.sign(g[i]) * abs(g[i]) ** one.exponent for i in active)
    if one.method == "weighted_sum":
        return sum(w[i] * g[i] for i in active)
    if one.method == "weighted_min_max":
        return max(w[i] * g[i] for i in active)
    if one.method == "weighted_product":
        return np.prod([raw[i] ** w[i] for i in active])
    if one.method == "nbi":
        return 1.0 + max((g[i] - one.anchor[i]) / one.normal[i] for i in active)
    return g[-1]


def made(method, rng, weights=(0.2, 0.5, 0.3), normalized=True):
    bounds = (LOW, HIGH) if normalized else (None, None)
    anchor, normal = rng.uniform(0, 1, 3), rng.uniform(0.5, 2, 3)
    planes = rng.normal(size=(2, 3)) if method == "nc" else np.zeros((0, 0))
    return Scalarisation(method, np.array(weights), *bounds, 2.5, anchor, normal, planes)


def peaks_of(rng, counts):
    """Linear peaks in x (N,): values and slopes by objective."""
    return [(rng.uniform(1, 10, k), rng.normal(size=(k, N))) for k in counts]


def parts_at(peaks, x, active):
    parts = []
    for i in active:
        values = peaks[i][0] + peaks[i][1] @ x
        order = np.argsort(-values, kind="stable")
        parts.append((values[order], peaks[i][1][order]))
    return parts


METHODS = ["weighted_exponential", "weighted_sum", "weighted_min_max", "weighted_product", "nbi", "nc"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("normalized", [True, False])
@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_highest_row_is_the_formula_at_the_highest_peaks(method, normalized, seed):
    rng = np.random.default_rng(seed)
    one = made(method, rng, normalized=normalized)
    peaks = peaks_of(rng, rng.integers(1, 4, 3))
    parts = parts_at(peaks, np.zeros(N), one.active)
    rows, gradients = one.rows(parts)
    raw = np.array([part[0][0] for part in parts])
    g = (raw - LOW) / (HIGH - LOW) if normalized else raw
    assert rows[0] == pytest.approx(formula(one, g, raw), rel=1e-12)
    assert one.values(raw[None])[0] == pytest.approx(rows[0], rel=1e-12)
    assert (np.diff(rows) <= 0).all()
    assert gradients.shape == (len(rows), N)


@pytest.mark.parametrize("method", METHODS)
def test_every_row_has_its_own_gradient(method):
    rng = np.random.default_rng(3)
    one = made(method, rng)
    peaks = peaks_of(rng, (2, 2, 1))
    x, h = np.zeros(N), 1e-5
    gradients = one.rows(parts_at(peaks, x, one.active))[1]
    for d in range(N):
        step = np.eye(N)[d] * h
        plus, minus = (one.rows(parts_at(peaks, x + s * step, one.active))[0] for s in (1, -1))
        assert (plus - minus) / (2 * h) == pytest.approx(gradients[:, d], rel=1e-6, abs=1e-7)
    _, of_plane, slopes = one.limits(parts_at(peaks, x, one.active))
    if method == "nc":
        counts = [np.prod(np.where(plane > 0.0, (2, 2, 1), 1)) for plane in one.planes]
        assert np.bincount(of_plane).tolist() == counts
        for d in range(N):
            step = np.eye(N)[d] * h
            plus, minus = (one.limits(parts_at(peaks, x + s * step, one.active))[0] for s in (1, -1))
            assert (plus - minus) / (2 * h) == pytest.approx(slopes[:, d], rel=1e-6, abs=1e-7)


def test_a_sum_has_a_row_for_every_choice_of_peaks():
    rng = np.random.default_rng(1)
    one = made("weighted_exponential", rng)
    parts = parts_at(peaks_of(rng, (2, 3, 1)), np.zeros(N), one.active)
    rows, _ = one.rows(parts)
    expected = []
    for choice in itertools.product(*(range(len(part[0])) for part in parts)):
        g = [(parts[i][0][p] - LOW[i]) / (HIGH[i] - LOW[i]) for i, p in enumerate(choice)]
        expected.append(formula(one, g, None))
    assert rows == pytest.approx(sorted(expected, reverse=True))


def test_objectives_of_weight_zero_take_no_part():
    one = made("weighted_sum", np.random.default_rng(0), weights=(0.0, 1.0, 0.0))
    assert one.active == [1]
    assert made("nbi", np.random.default_rng(0), weights=(0.0, 1.0, 0.0)).active == [0, 1, 2]


def test_below_utopia_the_power_goes_on_oddly():
    one = Scalarisation("weighted_exponential", np.array([1.0]), np.array([2.0]), np.array([3.0]), 2.0)
    values = one.values(np.array([[1.5], [2.0], [2.5]]))
    assert values == pytest.approx([-0.25, 0.0, 0.25])


def test_a_product_of_something_that_is_not_positive_is_none_and_names_it():
    one = Scalarisation("weighted_product", np.array([0.5, 0.0, 0.5]))
    with pytest.raises(NotPositiveError) as caught:
        one.rows([(np.array([1.0]), np.zeros((1, N))), (np.array([-1.0]), np.zeros((1, N)))])
    assert caught.value.args == (1,)
    assert np.isnan(one.values(np.array([[1.0, 5.0, -1.0]]))[0])


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_highest_choices_are_those_of_the_largest_sums(seed):
    rng = np.random.default_rng(seed)
    shares = [np.sort(rng.normal(size=k))[::-1] for k in rng.integers(1, 6, 3)]
    every = sorted((sum(one) for one in itertools.product(*shares)), reverse=True)
    found = highest_choices(shares, 20)
    assert len(set(found)) == len(found) == min(20, len(every))
    assert [sum(one[p] for one, p in zip(shares, choice, strict=True)) for choice in found] == pytest.approx(every[:20])


@pytest.mark.parametrize("ties", [3, 5])
@pytest.mark.parametrize("method", ["weighted_exponential", "weighted_sum", "weighted_product"])
def test_all_choices_of_peaks_that_tie_are_rows_however_many_peaks_lie_lower(method, ties):
    rng = np.random.default_rng(5)
    tied, lower = [8.0] * ties, [4.0] * 20
    one = made(method, rng, weights=(0.4, 0.6, 0.0))
    parts = [(np.array(tied + lower), rng.normal(size=(ties + 20, N))) for _ in range(2)]
    rows, gradients = one.rows(parts)
    told = gradients[rows > rows[0] * (1.0 - 1e-9)]
    alone = one.rows([(values[:ties], slopes[:ties]) for values, slopes in parts])[1]
    assert len(told) == ties**2
    assert np.sort(told, axis=0) == pytest.approx(np.sort(alone, axis=0))


def test_a_plane_of_nc_has_the_choices_that_tie():
    """The peaks of both objectives that the plane rises with tie in pairs: that makes four choices."""
    rng = np.random.default_rng(6)
    plane = np.array([[1.0, 2.0, -1.0]])
    one = Scalarisation("nc", np.ones(3), anchor=np.zeros(3), planes=plane)
    parts = [(np.array([1.0, 1.0] + [0.5] * 9), rng.normal(size=(11, N))) for _ in range(3)]
    values, _, slopes = one.limits(parts)
    expected = [
        parts[0][1][p] + 2.0 * parts[1][1][q] - parts[2][1][0] for p, q in itertools.product(range(2), repeat=2)
    ]
    assert values[:4] == pytest.approx(np.full(4, 2.0))
    assert np.sort(slopes[:4], axis=0) == pytest.approx(np.sort(expected, axis=0))
    assert values[4] < 2.0


def test_every_peak_is_a_row_beside_the_highest_of_the_others_where_choices_are_many():
    """Each peak lies lower than all choices of the highest five of both objectives."""
    rng = np.random.default_rng(7)
    one = made("weighted_sum", rng, weights=(0.4, 0.6, 0.0), normalized=False)
    values = np.array([8.0] * 6 + list(np.linspace(4.0, 3.0, 20)))
    parts = [(values, rng.normal(size=(26, N))) for _ in range(2)]
    rows, _ = one.rows(parts)
    for k, weight in enumerate((0.4, 0.6)):
        for value in values[6:]:
            assert np.isclose(rows, 8.0 - weight * (8.0 - value)).any(), (k, value)
