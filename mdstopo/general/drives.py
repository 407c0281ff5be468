"""Prescribed motions as cubics of time: the driven coordinates of a load case, segment by segment.

Linear accelerations, linear velocities and cubic splines of positions are all cubics between their rows; what is
prescribed as acceleration or velocity is integrated from the body's own start.
"""

from collections.abc import Iterator

import numpy as np

from mdstopo.case.model import LoadCase, Motion, Prescribed, Table
from mdstopo.case.spline import slopes
from mdstopo.general.dimension import Dimension
from mdstopo.scene.model import FloatArray, IndexArray
from mdstopo.scene.signals import segment_values


def prescribed(load_case: LoadCase, dimension: Dimension) -> Iterator[tuple[int, str, Prescribed]]:
    """(freedom, axis, what is prescribed) of everything that is driven, by body as declared, then by freedom."""
    names = [body.name for body in load_case.bodies]
    for motion in load_case.motions:
        first = dimension.kinematics.freedoms * names.index(motion.body)
        for axis, word in enumerate(dimension.axes):
            part = getattr(motion, word)
            if part is not None:
                yield first + axis, word, part


def drives_all(motion: Motion, dimension: Dimension) -> bool:
    """Whether a motion leaves nothing of its body free."""
    whole = len(dimension.axes) == dimension.kinematics.freedoms
    return whole and all(getattr(motion, word) is not None for word in dimension.axes)


def motion_times(load_case: LoadCase, dimension: Dimension) -> list[float]:
    """Rows of the tables of all prescribed motions, s."""
    times: list[float] = []
    for _, _, part in prescribed(load_case, dimension):
        if isinstance(part.signal, Table):
            times += part.signal.times.tolist()
    return times


def drives(
    load_case: LoadCase, times: FloatArray, dimension: Dimension, home: FloatArray, v0: FloatArray
) -> tuple[IndexArray, FloatArray]:
    """Driven freedoms (n_driven,) and their cubics (n_seg, n_driven, 4) in the segments of times (n_seg + 1,).

    What is driven is the change since home (n,), where freedoms are as they are stated; v0 (n,): velocities there.
    """
    parts = list(prescribed(load_case, dimension))
    cubics = np.zeros((len(times) - 1, len(parts), 4))
    for i, (d, _, part) in enumerate(parts):
        if part.kind == "position":
            cubics[:, i] = _spline_cubics(part.signal, times, float(home[d]))
            continue
        values = segment_values(part.signal, times)
        position, velocity = 0.0, float(v0[d])
        for k in range(len(times) - 1):
            value, slope = values[k]
            if part.kind == "acceleration":
                cubic = position, velocity, 0.5 * value, slope / 6.0
            else:
                cubic = position, value, 0.5 * slope, 0.0
            cubics[k, i] = cubic
            h = times[k + 1] - times[k]
            position = cubic[0] + h * (cubic[1] + h * (cubic[2] + h * cubic[3]))
            velocity = cubic[1] + h * (2.0 * cubic[2] + 3.0 * h * cubic[3])
    return np.array([d for d, _, _ in parts], dtype=np.int64), cubics


def _spline_cubics(signal: object, times: FloatArray, home: float) -> FloatArray:
    """The not-a-knot spline of a table of positions, less that at home, in every segment; their ends hold all knots."""
    assert isinstance(signal, Table)
    t, x = signal.times, signal.values[:, 0] - home
    m = slopes(t, x)
    out = np.empty((len(times) - 1, 4))
    for k in range(len(times) - 1):
        middle = 0.5 * (times[k] + times[k + 1])
        i = int(np.clip(np.searchsorted(t, middle, side="right") - 1, 0, len(t) - 2))
        h, s = t[i + 1] - t[i], times[k] - t[i]
        d = (x[i + 1] - x[i]) / h
        c2 = (3.0 * d - 2.0 * m[i] - m[i + 1]) / h
        c3 = (m[i] + m[i + 1] - 2.0 * d) / (h * h)
        out[k] = (
            x[i] + s * (m[i] + s * (c2 + s * c3)),
            m[i] + s * (2.0 * c2 + 3.0 * s * c3),
            c2 + 3.0 * s * c3,
            c3,
        )
    return out
