"""Prepared calls of entries: other numbers and other contents count at once, other arrays too."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.compiler.jit import entry
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.driver.general_driver import COUNT_AT, TANGENT_AT, WINDOW_AT
from mdstopo.general.driver.ready import Ready
from mdstopo.general.responses.extremes import TIME, VALUE
from mdstopo.status import Status
from tests.general.test_esdirk import PENDULUM


@entry
def scaled(x, factor, upwards, out):
    """out = factor x, or as much less; returns the number of entries."""
    for i in range(x.shape[0]):
        out[i] = factor * x[i] if upwards else -factor * x[i]
    return x.shape[0]


def test_a_call_sees_the_arguments_that_it_is_given():
    ready, x, out = Ready(), np.array([1.0, 2.0]), np.zeros(2)
    assert ready("it", scaled, x, 2.0, True, out) == 2
    assert out.tolist() == [2.0, 4.0]
    x[0] = 5.0
    for _ in range(2):
        out[:] = 0.0
        ready("it", scaled, x, 3.0, False, out)
        assert out.tolist() == [-15.0, -6.0]
    other, longer = np.zeros(3), np.array([1.0, 1.0, 7.0])
    assert ready("it", scaled, longer, 1.0, True, other) == 3
    assert other.tolist() == [1.0, 1.0, 7.0]
    assert out.tolist() == [-15.0, -6.0]
    ready("it", scaled, x, 1.0, True, out)
    assert out.tolist() == [5.0, 2.0]


def test_a_call_of_which_few_arguments_change_sees_those():
    ready, x, out = Ready(), np.array([1.0, 2.0]), np.zeros(2)

    def asked(x, factor, out):
        return ready.often("it", scaled, (x, out), ((1, factor),), lambda: (x, factor, True, out))

    for factor in (2.0, 2.0, 3.0, 2.0):
        assert asked(x, factor, out) == 2
        assert out.tolist() == [factor, 2.0 * factor]
    x[0] = 5.0
    asked(x, 2.0, out)
    assert out.tolist() == [10.0, 4.0]
    other = np.zeros(2)
    asked(x, 3.0, other)
    assert (out.tolist(), other.tolist()) == ([10.0, 4.0], [15.0, 6.0])


@pytest.fixture(scope="module")
def evaluator():
    """Of one response, of which peaks are meant."""
    text = "".join(line for line in PENDULUM.splitlines(True) if not line.startswith("  H:"))
    case = read_case(text.replace("DAMPING", "0").replace("G: 1, H: 1", "G: 1"))
    return Evaluator(case, in_background=False)


def test_numbers_stand_where_calls_that_are_made_at_every_evaluation_put_them(evaluator):
    driver = evaluator.driver(next(iter(evaluator.scenes)))
    for tangent in (False, True):
        assert driver._simulate_arguments(tangent)[TANGENT_AT] is tangent
    one, other = driver._plain_arguments(1234, 0.125), driver._plain_arguments(1235, 0.25)
    assert (one[COUNT_AT], one[WINDOW_AT]) == (1234, 0.125)
    assert [k for k, (a, b) in enumerate(zip(one, other, strict=True)) if a is not b] == [COUNT_AT, WINDOW_AT]


def test_arrays_stay_where_those_that_are_looked_at_stay(evaluator):
    """Else a call that is made at every evaluation would go on with the arrays of before."""
    driver = evaluator.driver(next(iter(evaluator.scenes)))

    def run(design, **asked):
        assert evaluator.evaluate(design, **asked).status.ok
        assert driver._plain_rows
        looked_at = driver.ready, driver.floats, driver.rows
        return *looked_at, *driver._simulate_arguments(True), *driver._plain_arguments(1, 0.125)

    run(np.full(2, 0.5), rows=Rows(window=0.5, most=3))
    before = run(np.full(2, 0.5), rows=Rows(window=0.5, most=4))
    after = run(np.full(2, 0.75), rows=Rows(window=0.25, most=4, cones=True))
    assert all(a is b for a, b in zip(before, after, strict=True) if isinstance(a, np.ndarray | Ready))


def test_a_response_that_is_no_number_is_told(evaluator, monkeypatch):
    driver = evaluator.driver(next(iter(evaluator.scenes)))

    def lost(*_):
        driver.row_counts[0] = 1
        driver.rows[0, 0, [TIME, VALUE]] = 0.25, np.nan

    monkeypatch.setattr(driver, "_reduce_response", lost)
    outcome = evaluator.evaluate(np.full(2, 0.5), gradient=False)
    assert outcome.status is Status.NON_FINITE
    assert "response displacement has no value at t = 0.25 s" in outcome.message
