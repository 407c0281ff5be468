"""Kernels compiled by our own `Lower`: the same numbers as Python, no array let go of too early, none kept for ever."""

import os

import numpy as np
import pytest

from mdstopo.compiler.jit import entry, kernel
from mdstopo.compiler.kernel import Kernel
from mdstopo.general.model.bundles import bundle


@kernel
def _made(value):
    return np.full(8, value)


@kernel
def _over():
    """Write over memory of arrays of `_made` that were let go of."""
    return _made(-7.0)[0] + _made(-8.0)[1] + _made(-9.0)[2]


@kernel
def _total(x):
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * (i + 1)
    return total


@kernel
def _rest(x):
    return x[1:]


@kernel
def _one_of(x, n):
    """What was given, an own array or a view of either, from several places."""
    if n == 0:
        return x
    own = x + 1.0
    if n == 1:
        return own[1:]
    for k in range(n):
        more = own + k
        _over()
        if more[0] > 4.0:
            return more
    else:
        own = x[2:] if n == 3 else own[2:]
    return own


@kernel
def _rebound(x, n):
    """Names that hold what was given and own arrays in turns."""
    now, last = x, x[0:2]
    for k in range(n):
        if k % 3 == 0:
            now = x
        elif k % 3 == 1:
            now = now[0:8] + 1.0
        last = now[2:4]
        _over()
    return now, last


@entry
def views(times, x, out):
    """Arrays and views of them come back from kernels that got what nobody else holds."""
    for k in range(times):
        a = _rest(_rest(_made(1.0 + k % 3)))
        b = _one_of(_made(1.0), k % 6)
        c = _one_of(x, k % 6)
        d, e = _rebound(_made(2.0 + k % 7), k % 7)
        _over()
        out[0] += _total(a) + _total(b) + _total(c)
        out[1] += _total(d) + _total(e)


@kernel
def _swapped(both, n):
    total = 0.0
    for k in range(n):
        a, b = both
        both = (b, a)
        total += _total(a) - _total(both[k % 2])
    return both, total


@kernel
def _together(x, n):
    """Own and given arrays in one tuple."""
    own = np.zeros(8)
    both = (x, own)
    for k in range(n):
        own[:] = k
        both = (both[1], x[0:8])
        if k % 2:
            both = (x, own + 1.0)
    return both, both[0][1:]


@entry
def tuples(times, out):
    """Tuples of arrays, in and out."""
    for k in range(times):
        both, total = _swapped((_made(1.0 + k % 3), _made(2.0)), k % 5)
        _over()
        other, part = _together(both[0], k % 4)
        both, _ = _swapped(other, 1)
        _over()
        out[0] += total + _total(both[0]) + 2.0 * _total(both[1]) + _total(part)


@kernel
def _walk(table, n):
    """Names that are set once, in loops that end in several ways."""
    total = 0.0
    i = 0
    while i < n:
        line = table[i % 4]
        j = 0
        while True:
            item = line[j % 3]
            if item > 2.0:
                part = line[1:]
                break
            j += 1
            if j > 3:
                part = table[0]
                break
        both = part + item
        last = both[-1]
        if last > 5.0:
            i += 2
            continue
        for k in range(3):
            if k == i % 4:
                break
            scaled = both * k
            total += scaled[k % 2]
        else:
            total += part[0]
        i += 1
        total += last
    return total, both, part


@entry
def walks(times, out):
    for k in range(times):
        total, both, part = _walk((np.arange(12.0) * 0.7 + k % 3).reshape((4, 3)), 7)
        _over()
        out[0] += total + _total(both) + _total(part)


@kernel
def _kept(x, n):
    """Names that are set in one turn of a loop and read in the next ones."""
    total = 0.0
    for k in range(n):
        if k % 3 == 0:
            number = 2.5 * k
            line = (x + k).reshape((2, 4))[1 - k % 2]
            part = x[1 + k % 2 :]
        _over()
        total += number + _total(line) * _total(part)
    return line, part, total


@entry
def keeps(times, out):
    for k in range(times):
        line, part, total = _kept(_made(1.5), 1 + k % 7)
        _over()
        out[0] += _total(line) + _total(part) + total


@kernel
def _perhaps(x, n):
    """An array or nothing, read and written by its name."""
    found = None
    value = None
    if n > 1:
        found = x
        value = 2.5
    if found is None or value is None:
        return 0.0
    found[1] = value
    found[-1] = n
    return found[1] + found[-1] + _total(found)


@entry
def perhaps(times, out):
    for k in range(times):
        out[0] += _perhaps(_made(1.0), k % 3)


@kernel
def _each(first, n):
    """A generator: its variables last from one call to the next."""
    step = 2.0 * first
    for k in range(n):
        now = step * k
        yield now
        step += first + now


@entry
def generated(times, out):
    for _ in range(times):
        for value in _each(1.5, 4):
            out[0] += value


class Both:
    """Two arrays in a structure."""

    def __init__(self, first, second):
        self.first, self.second = first, second


bundle(Both, ("first", "second"))


@kernel
def _fields(both, n):
    """Fields of a structure that was given, views of them, and own arrays under one name."""
    total = 0.0
    now = both.first
    for k in range(n):
        if k % 3 == 0:
            now = both.second
        elif k % 3 == 1:
            now = both.first[0:8]
        else:
            now = both.second + k
        line = both.first
        line[k % 8] += 1.0
        _over()
        total += _total(now) + _total(line[1:])
    return now, both.second[2:], total


@entry
def structures(times, out):
    """Structures that nobody else holds, let go of before what came out of them."""
    for k in range(times):
        both = Both(_made(1.0 + k % 3), _made(2.0))
        now, part, total = _fields(both, k % 5)
        one, _, _ = _fields(Both(now, _made(0.5)), k % 2)
        _over()
        out[0] += _total(now) + _total(part) + _total(one) + total


@entry
def indexed(x, y, z, places, marks, out):
    """Numbers of every kind as an index, and those that are written from both ends."""
    small, byte, short, word = np.int32(1), np.uint8(2), np.int16(0), np.uint64(1)
    out[0] = x[small] + x[byte] + x[short] + x[word] + y[small, byte] + y[byte, small] + z[small, short, byte]
    out[1] = z[-1][-1][-1] + z[-2, -1][-4] + y[-1][1] + z[word, -2, -3]
    x[small] = 11
    x[byte] = True
    y[-1, short] = np.float32(2.5)
    z[word, -1, byte] = 7
    for k in range(places.shape[0]):
        out[2] += x[places[k]] * y[places[k] % 4, -1] + z[-1, places[k] % 3, -places[k] % 4]
    for k in range(marks.shape[0]):
        marks[marks.shape[0] - k - 1] = not marks[k]
        places[places.shape[0] - 1 - k % 3] = places[k % 3] + marks[k]
        out[3] += y[int(marks[k]), marks[k] * 1]
    turned, thin = y.T, y[::2, 1:]
    turned[0, 1] = 5.5
    thin[-1][0] = 8.25
    out[4] = turned[-1, 2] + turned[0][1] + thin[-1, -1] + thin[0][1] + y[2, 1]
    line = z[1]
    line[0, -1] = 5.0
    out[5] = z[1, 0, 3] + line.size + line.strides[0] + line.nbytes
    empty = np.zeros((2, 0, 5))[1]
    point = np.array(3.5)
    point[()] += 1.0
    out[6] = empty.size + empty.shape[1] + point[()]
    x[1] += x[-2]
    y[0, 1:] *= 2.0
    y[-2] = x[:3]
    out[7] = y.sum() + z.sum() + x.sum()


def _arrays():
    return (
        np.arange(5.0) + 1.0,
        np.arange(12.0).reshape((4, 3)) * 1.5,
        np.arange(24.0).reshape((2, 3, 4)) * 0.25,
        np.array([0, 4, 2, 3, 4, 1]),
        np.array([True, False, True]),
        np.zeros(8),
    )


@pytest.fixture
def in_python(monkeypatch):
    """Runs an entry as Python, with all that it calls."""

    def run(function, *arguments):
        with monkeypatch.context() as changed:
            changed.setattr(Kernel, "__call__", lambda self, *given: self.py_func(*given))
            function.py_func(*arguments)

    return run


def _resident():
    """Memory of this process in bytes."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


_LOOPS = {
    "views": (views, (np.arange(8.0) + 1.0,)),
    "tuples": (tuples, ()),
    "walks": (walks, ()),
    "keeps": (keeps, ()),
    "perhaps": (perhaps, ()),
    "generated": (generated, ()),
    "structures": (structures, ()),
}


@pytest.mark.parametrize("name", _LOOPS)
def test_loops_over_own_and_given_arrays_give_what_python_gives(name, in_python):
    function, given = _LOOPS[name]
    ours, theirs = np.zeros(2), np.zeros(2)
    function(50, *given, ours)
    in_python(function, 50, *given, theirs)
    assert theirs[0] != 0.0
    np.testing.assert_allclose(ours, theirs, rtol=1e-13)


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="the system does not tell")
@pytest.mark.parametrize("name", ["views", "tuples", "walks", "keeps", "perhaps", "structures"])
def test_no_array_is_kept_for_ever(name):
    function, given = _LOOPS[name]
    function(1000, *given, np.zeros(2))
    before = _resident()
    function(50_000, *given, np.zeros(2))
    assert _resident() - before < 2_000_000  # an array a loop would be 5 MB


def test_every_kind_of_index_finds_what_python_finds(in_python):
    ours, theirs = _arrays(), _arrays()
    indexed(*ours)
    in_python(indexed, *theirs)
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-13)
