"""Kernels whose arrays and variables are handled otherwise than Numba does: what they compute, and what they hold."""

import sys
from collections import namedtuple

import numpy as np
import pytest

from mdstopo.compiler.jit import by_type, entry, kernel
from mdstopo.compiler.kernel import numba
from mdstopo.compiler.tried import has_own_passes

Pair = namedtuple("Pair", ("left", "right"))


@kernel
def _fresh(n, value):
    made = np.empty((2, n))
    for i in range(n):
        made[0, i] = value + i
        made[1, i] = -made[0, i]
    return made


@kernel
def _halves(both):
    return Pair(both[0], both[1])


@kernel
def _longer(one, other):
    return one if one.shape[0] > other.shape[0] else other


@kernel
def _total(pair):
    total = 0.0
    for i in range(pair.left.shape[0]):
        total += pair.left[i] * (2.0 - pair.right[i])
    return total


@entry
def outliving(n, rounds, given, out):
    """Views of arrays that are let go of, of ones from the round before, and of the caller's."""
    kept = given[0]
    pair = _halves(given)
    for k in range(rounds):
        before = kept
        if k % 3 == 2:
            kept = _longer(before, given[1])
        else:
            made = _fresh(n + k, 0.5 * k)
            kept = made[k % 2]
            pair = _halves(made)
        if k == rounds - 1:
            out[0] = -1.0
            return _total(pair) + before[0]
        # memory that is let go of too early is taken by this
        filled = np.full(n + k, 1e30)
        out[k] = _total(pair) + before[-1] + kept[n - 1] + filled[0] * 1e-30
    return 0.0


@entry
def indexed(cube, flags, k, out):
    """Numbers from the front and, where they are written, from the end, in all dimensions and in the first ones."""
    i = np.uint64(1)
    out[0] = cube[1, -1, k] + cube[-1][0][-2] + cube[i, 0, 1]
    sheet = cube[k - 1]
    row = sheet[-1]
    row[0] = 7.0
    sheet[0, -1] += 2.0
    flags[-1] = out[0] > 0.0
    out[-1] = row.size + sheet.shape[0] + sheet[:, 1].sum() + (1.0 if flags[2] else 0.5)
    out[1:3] = row[1:]


@pytest.mark.parametrize("rounds", [1, 2, 3, 9])
def test_what_is_let_go_of_is_not_read_and_what_is_read_is_not_let_go_of(rounds, monkeypatch):
    given = np.arange(12.0).reshape(2, 6)
    compiled, written = np.zeros(rounds), np.zeros(rounds)
    for _ in range(50):
        returned = outliving(4, rounds, given, compiled)
    for each in (_fresh, _halves, _longer, _total):
        monkeypatch.setattr(sys.modules[__name__], each.__name__, each.py_func)
    assert returned == outliving.py_func(4, rounds, given, written)
    np.testing.assert_array_equal(compiled, written)


def test_numbers_index_as_in_python():
    results = []
    for call in (indexed, indexed.py_func):
        cube, flags, out = np.arange(24.0).reshape(2, 4, 3), np.zeros(3, np.bool_), np.zeros(4)
        call(cube, flags, 2, out)
        results.append((cube, flags, out))
    for compiled, written in zip(*results, strict=True):
        np.testing.assert_array_equal(compiled, written)


@entry
def item(x, i):
    """One number, at a computed place."""
    return x[0, i]


@entry
def last_of_row(x, i):
    """The last number of a row whose place is computed."""
    return x[i, -1]


@pytest.mark.parametrize(("read", "place"), [(item, 3), (item, -1), (last_of_row, 2), (last_of_row, -1)])
def test_a_place_outside_of_the_array_is_told_where_places_are_checked(read, place, monkeypatch):
    # a computed place does not count from the end: without the check, these read what lies beside the array
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    if not has_own_passes():
        pytest.skip("this version's own code counts from the end")
    x = np.arange(6.0).reshape(2, 3)
    assert read(x, 1) == read.py_func(x, 1)
    with pytest.raises(IndexError):
        read(x, place)


@entry
def reshaped(given, n, out):
    """Other shapes of what the caller has, of parts of it, and of an array of its own."""
    row = given.reshape(given.size)
    row[1] = -5.0
    sheet = given[1].reshape((n, 2))
    sheet[n - 1, 0] += 0.5
    own = np.arange(6.0).reshape((3, 2))
    again = own.reshape(2, 3)
    out[0] = row[-1] + sheet[0, 1] + sheet[:, 0].sum() + again[1, 0]
    out[1:3] = again.reshape(6)[4:]
    return sheet.shape[0] * row.size


def test_another_shape_is_a_view_of_the_same_numbers():
    results = []
    for call in (reshaped, reshaped.py_func):
        given, out = np.arange(24.0).reshape(2, 4, 3), np.zeros(3)
        results.append((call(given, 6, out), given, out))
    for compiled, written in zip(*results, strict=True):
        np.testing.assert_array_equal(compiled, written)


@pytest.mark.parametrize("n", [5, 7, 0, -6])
def test_a_shape_of_another_size_is_refused(n):
    numba()
    if n < 0 and not has_own_passes():
        pytest.skip("this version's own reshape takes any negative number for -1; no kernel gives it one")
    with pytest.raises(ValueError, match="size"):
        reshaped(np.arange(24.0).reshape(2, 4, 3), n, np.zeros(3))


def chosen(x):
    """Which kernel it is depends on the type."""
    raise NotImplementedError


@kernel
def _of_float(x):
    return 2.0 * x


@kernel
def _of_array(x):
    return x[0]


def _choose(x):
    from numba import types

    return {types.float64: _of_float}.get(x, _of_array)


by_type(chosen, "x", _choose)


@entry
def both_chosen(x, y):
    """Each by its type."""
    return chosen(x) + chosen(y) + _of_float(x)


def test_a_kernel_chosen_by_type_is_the_one_that_is_called_by_name():
    assert both_chosen(1.5, np.array([4.0, 9.0])) == 10.0
    assert len(_of_float.dispatcher.overloads) <= 1  # none where the entry was on the disk


def test_no_error_of_types_is_lost():
    @kernel
    def wrong(x):
        return x.nothing

    @entry
    def calls(x):
        return wrong(x)

    with pytest.raises(numba().TypingError, match="nothing"):
        calls.dispatcher.compile("(float64,)")
