"""Zeros of a smooth function of time whose values and rates are known at samples, each found on the function itself."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from mdstopo.scene.springs_model import FloatArray

#: looks at a dip of a function that may pass zero
TRIALS = 4
#: where between two samples a function is compared with the cubic of their values and rates; by what share of the
#: largest value there it may differ; how often what differs more is halved
PLACES, CUBIC_OFF, HALVINGS = (0.29, 0.5, 0.73), 0.02, 8
#: shares of an interval: over which a rate is a difference, and from which on behind a root at its start others are
#: looked for
RATE_SHIFT, BEHIND_ROOT = 1e-4, 1e-6


def may_vanish(values: FloatArray, rates: FloatArray) -> NDArray[np.bool_]:
    """(..., K - 1): between which samples a smooth function changes its sign, or comes nearer to zero and leaves again.

    values, rates (..., K): of the function at the samples.
    """
    left, right = values[..., :-1], values[..., 1:]
    turns = (left >= 0.0) != (right >= 0.0)
    dips = (left * rates[..., :-1] < 0.0) & (right * rates[..., 1:] > 0.0)
    return np.asarray(turns | dips)


def roots_between(
    span: tuple[float, float],
    values: tuple[float, float],
    rates: tuple[float, float],
    exact: Callable[[FloatArray], FloatArray],
) -> Iterator[float]:
    """Fractions of a step, between two samples, at which a smooth function of time vanishes.

    span: the fractions of the samples. values: what it is at them. rates: its rates, per interval between them.
    exact: values (K,) at fractions (K,), on the motion itself.
    """
    (low, high), (d0, d1), (s0, s1) = span, values, rates

    def difference(c: float) -> float:
        return float(exact(np.array([c]))[0])

    if (d0 >= 0.0) != (d1 >= 0.0):
        yield from _bracketed(difference, low, high)
        return
    if not (d0 * s0 < 0.0 < d1 * s1):
        return
    # it comes nearer to zero and goes away again: the cubic says where, and whether it may pass zero there
    square, cube = 3.0 * (d1 - d0) - 2.0 * s0 - s1, s0 + s1 - 2.0 * (d1 - d0)
    bend = square + np.copysign(np.sqrt(max(square * square - 3.0 * cube * s0, 0.0)), d0)
    if bend == 0.0:  # numbers whose squares are below the smallest there is
        return
    c = -s0 / bend
    dip = d0 + c * (s0 + c * (square + c * cube))
    if not 0.0 < c < 1.0 or dip * d0 > (0.02 * min(abs(d0), abs(d1)) + 1e-4 * max(abs(s0), abs(s1))) * abs(d0):
        return
    c = low + c * (high - low)
    width = 0.02 * (high - low)
    for _ in range(TRIALS):
        near = np.clip(np.array([c - width, c, c + width]), low, high)
        seen = exact(near)
        beyond = np.flatnonzero(seen * d0 < 0.0)
        if len(beyond):
            middle = float(near[beyond[0]])
            yield from _bracketed(difference, low, middle)
            yield from _bracketed(difference, middle, high)
            return
        bend = seen[0] - 2.0 * seen[1] + seen[2]
        if bend == 0.0:
            return
        c = float(np.clip(c + 0.5 * width * (seen[0] - seen[2]) / bend, low, high))
        width *= 0.1


def roots_on_grid(
    times: FloatArray, values: FloatArray, rates: FloatArray, exact: Callable[[FloatArray], FloatArray]
) -> Iterator[float]:
    """Times at which a smooth function of time vanishes.

    Between two samples it may turn more often than the cubic through both ends does; there it is sampled more closely.

    times (K,): of samples (s), rising. values, rates (K,): of the function there, rates per s.
    exact: values (N,) at any times (N,).
    """
    times, values, rates = _resolved(times, values, rates, exact)
    for k in np.flatnonzero(values == 0.0).tolist():
        yield float(times[k])
        if k + 1 < len(times):  # its sign behind is that of its rate: another root in the interval would be hidden
            times[k] += BEHIND_ROOT * (times[k + 1] - times[k])
            values[k] = exact(times[k : k + 1])[0]
    widths = np.diff(times)
    for k in np.flatnonzero(may_vanish(values, rates)).tolist():
        span = float(times[k]), float(times[k + 1])
        ends = float(values[k]), float(values[k + 1])
        slopes = float(rates[k] * widths[k]), float(rates[k + 1] * widths[k])
        yield from roots_between(span, ends, slopes, exact)


def _resolved(
    times: FloatArray, values: FloatArray, rates: FloatArray, exact: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The samples of `roots_on_grid` and further ones, between which the function is the cubic of both ends."""
    line = values[0] + rates[0] * (times - times[0])
    if np.all(np.abs(values - line) <= 1e-12 * np.abs(values).max()):
        return times.copy(), values.copy(), rates
    open_ = np.arange(len(times) - 1)
    for _ in range(HALVINGS):
        start, width = times[open_], times[open_ + 1] - times[open_]
        f0, f1, r0, r1 = values[open_], values[open_ + 1], rates[open_] * width, rates[open_ + 1] * width
        largest, off = np.maximum(np.abs(f0), np.abs(f1)), np.zeros(len(open_))
        for c in PLACES:
            cubic = f0 + c * (r0 + c * (3.0 * (f1 - f0) - 2.0 * r0 - r1 + c * (r0 + r1 - 2.0 * (f1 - f0))))
            seen = exact(start + c * width)
            largest, off = np.maximum(largest, np.abs(seen)), np.maximum(off, np.abs(seen - cubic))
        split = open_[off > CUBIC_OFF * largest]
        if not len(split):
            break
        width = times[split + 1] - times[split]
        middle = times[split] + 0.5 * width
        ahead, back = exact(middle + RATE_SHIFT * width), exact(middle - RATE_SHIFT * width)
        times, values = np.insert(times, split + 1, middle), np.insert(values, split + 1, exact(middle))
        rates = np.insert(rates, split + 1, (ahead - back) / (2.0 * RATE_SHIFT * width))
        first = split + np.arange(len(split))
        open_ = np.sort(np.concatenate([first, first + 1]))
    return times.copy(), values.copy(), rates


def _bracketed(difference: Callable[[float], float], low: float, high: float) -> Iterator[float]:
    """The root between two fractions at which a difference has two signs, if it has in truth."""
    from scipy.optimize import brentq

    first, last = difference(low), difference(high)
    if first * last < 0.0:
        yield float(brentq(difference, low, high, xtol=1e-15, rtol=1e-14))
    elif first == 0.0 or last == 0.0:
        yield low if first == 0.0 else high
