"""One prescribed quantity over time: what the file says of it, and what that is at the start."""

from __future__ import annotations

import math

import numpy as np

from mdstopo.case.arrays import Signal, Table, TimeFormula
from mdstopo.case.geometry.spline import value_and_slope
from mdstopo.case.model import Prescribed
from mdstopo.case.scene.load_case_times import TimeSpan
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.text.words import number_text

AGREE = 1e-8
"""How far, relative to the values at hand, a stated start may lie from a prescribed one."""
KINDS = ("acceleration", "velocity", "position")


def value_at(signal: Signal, time: float) -> float:
    """A scalar signal at `time`: linear between rows, constant outside, right-continuous."""
    if isinstance(signal, TimeFormula):
        return signal.at(time)
    if not isinstance(signal, Table):
        return signal
    t, x = signal.times, signal.values[:, 0]
    i = int(np.searchsorted(t, time, side="right")) - 1
    if i < 0:
        return float(x[0])
    if i == len(t) - 1:
        return float(x[-1])
    return float(x[i] + (x[i + 1] - x[i]) * ((time - t[i]) / (t[i + 1] - t[i])))


def size_of(signal: Signal) -> float:
    """The largest magnitude over time; of a formula, which is judged where its times are known, its factor."""
    if isinstance(signal, TimeFormula):
        return abs(signal.scale)
    return float(np.abs(signal.values).max()) if isinstance(signal, Table) else abs(signal)


def prescribed(fields: Fields | None) -> Prescribed | None:
    """What the keys of a motion prescribe: its acceleration, velocity or position; None where no key is stated."""
    if fields is None:
        return None
    kind = next(kind for kind in KINDS if kind in fields.stated)
    return Prescribed(kind, fields[kind][0])


def rate_at_start(signal: Signal, span: TimeSpan, path: str, reading: Reading) -> tuple[float, float] | None:
    """A prescribed velocity at the start, and its largest size; None where a formula has no value, which is noted at
    `path`."""
    rate = value_at(signal, span.start)
    if not math.isfinite(rate):
        reading.mistake(path, f"the expression has no value at the start, {number_text(span.start)} s")
        return None
    return rate, size_of(signal)


def position_at_start(signal: Signal, span: TimeSpan, path: str, reading: Reading) -> tuple[float, float, float] | None:
    """A prescribed position and its rate at the start, and by how much positions change per second.

    None where a table does not cover the simulated time, or is too steep, or a formula has no value, which is noted at
    `path`.
    """
    if isinstance(signal, TimeFormula):
        value, rate = signal.at(span.start), signal.rate_at(span.start)
        if not (math.isfinite(value) and math.isfinite(rate)):
            when = number_text(span.start)
            reading.mistake(path, f"the expression has no value, or no rate, at the start, {when} s")
            return None
        return value, rate, abs(rate)
    assert isinstance(signal, Table)
    t, x = signal.times, signal.values[:, 0]
    if not (t[0] <= span.start and span.end <= t[-1]):
        runs = f"{number_text(float(t[0]))} to {number_text(float(t[-1]))} s"
        needed = f"start {number_text(span.start)} to end {number_text(span.end)} s"
        reading.mistake(path, f"the table runs from {runs}; it must cover {needed}")
        return None
    value, rate = value_and_slope(t, x, span.start)
    if not (math.isfinite(value) and math.isfinite(rate)):
        reading.mistake(path, "the spline through the table is too steep for a number")
        return None
    return value, rate, float(np.ptp(x) / (span.end - span.start))


def agree(value: float, stated: float, scale: float, what: str, path: str, reading: Reading) -> None:
    """Note a mistake where a body does not start as its prescribed motion does.

    value: of the motion at the start.
    stated: by the body.
    scale: what the difference may be relative to, beside these two.
    what: the body's key, in words.
    path: where the motion stands in the file.
    reading: takes the mistake.
    """
    if not abs(value - stated) <= AGREE * max(abs(value), abs(stated), scale):
        now, then = number_text(value), number_text(stated)
        reading.mistake(path, f"found {now} at the start, but {what} states {then}; they must agree")
