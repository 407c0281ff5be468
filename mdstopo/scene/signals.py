"""Piecewise linear signals of time, cut into segments at whose ends the integrators land."""

import numpy as np

from mdstopo.case.model import LoadCase, Signal, Table
from mdstopo.scene.model import FloatArray


def breakpoints(load_case: LoadCase) -> FloatArray:
    """Start, every row of a load's table that lies inside the simulated time, end: ascending, without repeats."""
    inside: set[float] = set()
    for load in load_case.loads:
        for signal in (*load.force, load.moment):
            if isinstance(signal, Table):
                inside.update(t for t in signal.times.tolist() if load_case.start < t < load_case.end)
    return np.array([load_case.start, *sorted(inside), load_case.end])


def segment_values(signal: Signal, times: FloatArray) -> FloatArray:
    """(n_segments, 2): the signal's value just after each segment's start, and its slope within the segment."""
    out = np.zeros((len(times) - 1, 2))
    if not isinstance(signal, Table):
        out[:, 0] = signal
        return out
    t, y = signal.times, signal.values.reshape(-1)
    for k in range(len(times) - 1):
        # the row at or before the start; of two rows at one time the later one (right-continuous)
        i = int(np.searchsorted(t, times[k], side="right")) - 1
        if i < 0:
            out[k] = y[0], 0.0
        elif i >= len(t) - 1:
            out[k] = y[-1], 0.0
        else:
            slope = (y[i + 1] - y[i]) / (t[i + 1] - t[i])
            out[k] = y[i] + slope * (times[k] - t[i]), slope
    return out
