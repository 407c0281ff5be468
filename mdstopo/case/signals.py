"""Quantities over time in one."""

from __future__ import annotations

import numpy as np

from mdstopo.case.arrays import FloatArray, Signal, Table, VectorSignal


def combined(matrix: FloatArray, signals: VectorSignal) -> VectorSignal:
    """The products of a matrix (m, n) with n signals: constants where all are, else tables of common times."""
    tables = [signal for signal in signals if isinstance(signal, Table)]
    if not tables:
        return tuple((matrix @ np.array(signals)).tolist())
    times = common_times(tables)
    values = np.stack([_sampled(signal, times) for signal in signals], axis=1) @ matrix.T
    return tuple(Table(times, values[:, i : i + 1]) for i in range(len(matrix)))


def common_times(tables: list[Table]) -> FloatArray:
    """The rows' times of all tables, a time twice where any of them jumps."""
    times = np.unique(np.concatenate([table.times for table in tables]))
    jumps = np.unique(np.concatenate([table.times[1:][np.diff(table.times) == 0.0] for table in tables]))
    return np.sort(np.concatenate([times, jumps]))


def _sampled(signal: Signal, times: FloatArray) -> FloatArray:
    """A signal at rising times; of a time that is there twice the limit from the left, then that from the right."""
    if not isinstance(signal, Table):
        return np.full(len(times), signal)
    t, x = signal.times, signal.values[:, 0]
    values = np.interp(times, t, x)
    before_twin = np.append(np.diff(times) == 0.0, False)
    first = np.minimum(np.searchsorted(t, times, side="left"), len(t) - 1)
    last = np.maximum(np.searchsorted(t, times, side="right") - 1, 0)
    row = np.where(before_twin, first, last)
    return np.where(t[row] == times, x[row], values)
