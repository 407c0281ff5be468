"""Piecewise linear signals of time, cut into segments at whose ends the integrators land."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.model import Load, LoadCase, Signal, Table
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: times closer than this, relative to the whole, are no further ends of segments
TIMES_APART = 1e-10


class Loaded(Protocol):
    """A model, as a named tuple, with ends of segments (s) and the loads within them, as `segment_values` has them."""

    @property
    def times(self) -> FloatArray: ...
    @property
    def force(self) -> FloatArray: ...
    @property
    def load_force(self) -> FloatArray: ...
    def _replace(self, *_parts: Any, **_values: Any) -> Self: ...


LoadedModel = TypeVar("LoadedModel", bound=Loaded)


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


def motion_signals(load_case: LoadCase) -> Iterator[Signal]:
    """All signals of prescribed motions."""
    for motion in load_case.motions:
        for part in (motion.x, motion.y, motion.z, motion.angle):
            if part is not None:
                yield part.signal
        if motion.rotation is not None:
            yield from motion.rotation.signals


def formulas_of(load_case: LoadCase) -> list[TimeFormula]:
    """The loads and the motions that are formulas of time."""
    signals = [signal for load in load_case.loads for signal in signals_of(load)]
    return [signal for signal in (*signals, *motion_signals(load_case)) if isinstance(signal, TimeFormula)]


def _nearness(start: float, end: float) -> float:
    """Times nearer to each other than this are the same, s."""
    return 1e-12 * (end - start) + 4e-15 * max(abs(start), abs(end))


def cut_segments(model: LoadedModel, times: Sequence[float]) -> LoadedModel:
    """The model with further times at which segments end; its loads are the same functions of time as before."""
    old = model.times
    apart = TIMES_APART * float(old[-1] - old[0])
    asked = np.sort(np.asarray(times, dtype=np.float64))
    behind = np.clip(np.searchsorted(old, asked), 1, len(old) - 1)
    far = np.minimum(np.abs(asked - old[behind - 1]), np.abs(old[behind] - asked)) > apart
    new: list[float] = []
    for time in asked[far].tolist():
        if not new or time - new[-1] > apart:
            new.append(time)
    whole = np.sort(np.concatenate([old, new]))
    parent, tau = parents_of(old, whole)
    cut = partial(cut_linear, parent=parent, tau=tau)
    return model._replace(times=whole, force=cut(model.force), load_force=cut(model.load_force))


def parents_of(times: FloatArray, whole: FloatArray) -> tuple[IndexArray, FloatArray]:
    """Of each segment between the times `whole` (m + 1,) the one between `times` that it lies in, (m,), and how long
    after that one's start it begins, (m,) in s."""
    parent = np.clip(np.searchsorted(times, whole[:-1], side="right") - 1, 0, len(times) - 2)
    return parent, whole[:-1] - times[parent]


def cut_linear(array: FloatArray, parent: IndexArray, tau: FloatArray) -> FloatArray:
    """Values at starts of segments and slopes (n_seg, ..., 2), for the parts of these that `parents_of` tells."""
    part = array[parent].copy()
    part[..., 0] += tau.reshape(-1, *[1] * (part.ndim - 2)) * part[..., 1]
    return part


def segment_values(signal: Signal, times: FloatArray) -> FloatArray:
    """(n_segments, 2): the signal's value just after each segment's start, and its slope within the segment.

    Of a formula zeros, for kernels call it.
    """
    out = np.zeros((len(times) - 1, 2))
    if isinstance(signal, TimeFormula):
        return out
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
