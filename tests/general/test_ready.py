"""Prepared calls of entries: other numbers and other contents count at once, other arrays too."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.ready import Ready


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
