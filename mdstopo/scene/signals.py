"""Piecewise linear signals of time, cut into segments at whose ends the integrators land."""

from collections.abc import Iterable, Iterator

import numpy as np

from mdstopo.case.model import Load, LoadCase, Signal, Table
from mdstopo.scene.model import FloatArray


def breakpoints(load_case: LoadCase, more: Iterable[float] = ()) -> FloatArray:
    """Start, every row of a load's table and of `more` that lies inside the simulated time, end: ascending.

    Rows that differ by rounding (another program's 0.30000000000000004) are one.
    """
    inside: set[float] = set(more)
    for load in load_case.loads:
        for signal in signals_of(load):
            if isinstance(signal, Table):
                inside.update(signal.times.tolist())
    near = _nearness(load_case.start, load_case.end)
    times = [load_case.start]
    for t in sorted(inside):
        if t - times[-1] > near and load_case.end - t > near:
            times.append(t)
    return np.array([*times, load_case.end])


def signals_of(load: Load) -> Iterator[Signal]:
    """All signals of a load: one a component, in a plane as in space."""
    yield from load.force
    for several in (load.moment, load.angular_acceleration):
        if isinstance(several, tuple):
            yield from several
        elif several is not None:
            yield several


def _nearness(start: float, end: float) -> float:
    """Times nearer to each other than this are the same, s."""
    return 1e-12 * (end - start) + 4e-15 * max(abs(start), abs(end))


def segment_values(signal: Signal, times: FloatArray) -> FloatArray:
    """(n_segments, 2): the signal's value just after each segment's start, and its slope within the segment."""
    out = np.zeros((len(times) - 1, 2))
    if not isinstance(signal, Table):
        out[:, 0] = signal
        return out
    t, y = signal.times, signal.values.reshape(-1)
    near = _nearness(times[0], times[-1])
    for k in range(len(times) - 1):
        # the row at or before the start; of two rows at one time the later one (right-continuous)
        i = int(np.searchsorted(t, times[k] + near, side="right")) - 1
        if i < 0:
            out[k] = y[0], 0.0
        elif i >= len(t) - 1:
            out[k] = y[-1], 0.0
        else:
            slope = (y[i + 1] - y[i]) / (t[i + 1] - t[i])
            out[k] = y[i] + slope * (times[k] - t[i]), slope
    return out
