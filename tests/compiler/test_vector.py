"""Vectors in kernels do what the same functions do on NumPy arrays, on any processor."""

import os
import subprocess
import sys

import numpy as np
import pytest

from mdstopo.compiler.kernel import numba as with_vectors
from mdstopo.compiler.vector import (
    NARROW,
    WIDE,
    fetch,
    inverse_root,
    lanes,
    larger,
    largest,
    load,
    magnitude,
    negative,
    store,
    total,
    unmarked,
    where_larger,
    zero,
)
from mdstopo.integrators.rows import largest_difference, row_width
from tests.compiled import compiled

FLOOR = 1e-30


@pytest.fixture(scope="module", autouse=True)
def _vectors():
    """Numba knows vectors: what these tests compile has them."""
    with_vectors()


@compiled
def _width():
    return lanes()


@compiled
def _roots(x, out):
    for i in range(0, len(x), lanes()):
        store(out, i, inverse_root(load(x, i), FLOOR))


@compiled
def _chosen(x, value, out):
    for i in range(0, len(x), lanes()):
        store(out, i, where_larger(load(x, i), FLOOR, load(value, i)))


@compiled
def _above(x, least, value, out):
    for i in range(0, len(x), lanes()):
        store(out, i, where_larger(load(x, i), load(least, i), load(value, i)))


@compiled
def _mixed(x, y, out):
    sums = zero()
    most = zero()
    for i in range(0, len(x), lanes()):
        a = load(x, i)
        b = load(y, i)
        c = 2.0 * a - b * 3.0 + 1.0
        c += a * b
        c -= 0.5
        c *= a
        store(out, i, c)
        sums += c
        most = larger(magnitude(c), most)
    return total(sums), largest(most)


@compiled
def _signs(x):
    return negative(load(x, 0))


@compiled
def _spared(x, bits, out):
    fetch(x, 0)
    fetch(out, len(out))  # behind the end, where there may be nothing
    store(out, 0, unmarked(load(x, 0), bits))


@compiled
def _difference(x, y, weight, s):
    return largest_difference(x, y, weight, s)


def test_a_vector_is_as_wide_as_the_processor_has_it():
    assert _width() in (NARROW, WIDE)


def test_inverse_roots_are_right_to_rounding_over_the_whole_range():
    rng = np.random.default_rng(3)
    x = np.concatenate([10.0 ** rng.uniform(-30, 300, 4096), rng.uniform(0.25, 4.0, 4096)])
    x[:8] = [1.0, 4.0, 0.25, np.nextafter(FLOOR, 1.0), 1e300, 2.0, np.nextafter(1.0, 0.0), np.nextafter(1.0, 2.0)]
    out = np.empty_like(x)
    _roots(x, out)
    exact = 1.0 / np.sqrt(x.astype(np.longdouble))
    assert np.abs((out - exact) / exact).max() < 2.5e-16


def test_inverse_roots_are_zero_up_to_the_floor_and_of_what_is_no_number():
    x = np.array([0.0, FLOOR, -1.0, np.nan, 1e-300, -0.0, -np.inf, FLOOR / 2])
    out = np.ones_like(x)
    _roots(x, out)
    np.testing.assert_array_equal(out, 0.0)


def test_values_are_those_of_arrays_where_there_is_more_than_the_floor():
    x = np.concatenate([10.0 ** np.random.default_rng(8).uniform(-60, 60, 58), [0.0, FLOOR, -1.0, np.nan, np.inf, 2.0]])
    value = np.arange(1.0, 65.0)
    out = np.empty(64)
    _chosen(x, value, out)
    np.testing.assert_array_equal(out, np.where(x > FLOOR, value, 0.0))
    np.testing.assert_array_equal(out, where_larger(x, FLOOR, value))
    least = np.where(np.arange(64) % 3 == 0, np.nan, x[::-1])
    _above(x, least, value, out)
    np.testing.assert_array_equal(out, np.where(x > least, value, 0.0))
    np.testing.assert_array_equal(out, where_larger(x, least, value))


def test_operators_are_those_of_arrays():
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(2, 64))
    out = np.empty(64)
    sums, most = _mixed(x, y, out)
    expected = (2.0 * x - 3.0 * y + 1.0 + x * y - 0.5) * x
    np.testing.assert_allclose(out, expected, rtol=1e-14, atol=1e-14)
    assert sums == pytest.approx(out.sum(), rel=1e-13)
    assert most == np.abs(out).max()


def test_bits_tell_which_lanes_are_below_zero():
    width = _width()
    for bits in range(1 << width):
        x = np.where(bits >> np.arange(width) & 1, -1e-300, 0.0)
        assert _signs(x) == bits == negative(x)
    assert _signs(np.full(width, np.nan)) == _signs(np.full(width, -0.0)) == 0
    assert _signs(np.full(width, -np.inf)) == (1 << width) - 1


def test_marked_lanes_become_zero_whatever_they_hold():
    width = _width()
    x = np.where(np.arange(width) % 3 == 1, np.nan, np.arange(width) + 1.0)
    for bits in range(1 << width):
        out = np.empty(width)
        _spared(x, bits, out)
        assert np.array_equal(out, unmarked(x, bits), equal_nan=True)
        assert np.array_equal(out == 0.0, (bits >> np.arange(width)) & 1 == 1)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_number_lost_anywhere_is_seen(bad):
    n = 6
    width = row_width.py_func(n)
    x, y = np.zeros((3, width)), np.ones((3, width))
    weight = np.zeros(width)
    weight[:n] = 2.0
    assert _difference(x, y, weight, 3) == 2.0
    for place in ((0, 0), (2, 5)):
        lost = x.copy()
        lost[place] = bad
        assert np.isnan(_difference(lost, y, weight, 3))
    lost = x.copy()
    lost[2, 5] = bad
    assert _difference(lost, y, weight, 2) == 2.0


@pytest.mark.parametrize(
    "narrow",
    [{"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}, {"NUMBA_ENABLE_AVX": "0"}],
    ids=["generic", "without AVX"],
)
def test_processors_without_the_widest_vectors_get_the_same_numbers(narrow):
    program = (
        "import numpy as np\n"
        "from tests.compiler import test_vector as own\n"
        "assert own._width() == own.NARROW\n"
        "own.test_inverse_roots_are_right_to_rounding_over_the_whole_range()\n"
        "own.test_inverse_roots_are_zero_up_to_the_floor_and_of_what_is_no_number()\n"
        "own.test_values_are_those_of_arrays_where_there_is_more_than_the_floor()\n"
        "own.test_operators_are_those_of_arrays()\n"
        "own.test_marked_lanes_become_zero_whatever_they_hold()\n"
        "own.test_a_number_lost_anywhere_is_seen(np.nan)\n"
    )
    stated = {"NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX"}
    environment = {name: value for name, value in os.environ.items() if name not in stated} | narrow
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
