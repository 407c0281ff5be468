"""Prescribed motions as cubics of time: the driven coordinates of a load case, segment by segment.

Linear accelerations, linear velocities and cubic splines of positions are all cubics between their rows; what is
prescribed as acceleration or velocity is integrated from the body's own start. Formulas are called by kernels, which
need of the cubics where a segment begins alone.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.geometry.spline import slopes
from mdstopo.case.model import LoadCase, Motion, Prescribed, Table
from mdstopo.general.scene.dimension import Dimension
from mdstopo.general.scene.driven_integrals import integrated_ends, row_of_motion
from mdstopo.general.scene.timed_loads import at_ends, modes
from mdstopo.mechanics.kinematics.spatial_drives import FRAME, ROW
from mdstopo.mechanics.kinematics.timed import WIDTH
from mdstopo.scene.signal_segments import segment_values
from mdstopo.scene.springs_model import FloatArray, IndexArray


class Drives(NamedTuple):
    """The prescribed coordinates of a scene, as arrays (`GeneralModel.driven`, `drive`, `drive_frame`, `drive_turn`,
    `driven_par`, `driven_mode`)."""

    driven: IndexArray
    cubics: FloatArray
    frames: FloatArray
    turns: FloatArray
    formulas: FloatArray
    modes: IndexArray


def drives_all(motion: Motion, dimension: Dimension) -> bool:
    """Whether a motion leaves nothing of its body free."""
    whole = len(dimension.axes) == dimension.kinematics.freedoms or motion.rotation is not None
    return whole and all(getattr(motion, word) is not None for word in dimension.axes)


def motion_times(load_case: LoadCase, dimension: Dimension) -> list[float]:
    """Rows of the tables of all prescribed motions, s."""
    times: list[float] = []
    for motion in load_case.motions:
        parts = [getattr(motion, word) for word in dimension.axes]
        signals = [part.signal for part in parts if part is not None]
        if motion.rotation is not None:
            signals += motion.rotation.signals
        for signal in signals:
            if isinstance(signal, Table):
                times += signal.times.tolist()
    return times


def drives(
    load_case: LoadCase,
    times: FloatArray,
    dimension: Dimension,
    home: FloatArray,
    v0: FloatArray,
    attitudes: FloatArray | None = None,
) -> Drives:
    """The arrays of all prescribed coordinates, by motion, then by freedom.

    load_case, dimension: the scene, and what belongs to its dimension.
    times (n_seg + 1,): ends of the segments (s).
    home (n,): freedoms as they are stated where nothing has moved yet; what is driven is the change since. v0 (n,):
    velocities there.
    attitudes (n_body, n_home): bodies at home, which prescribed rotations need.
    """
    names = [body.name for body in load_case.bodies]
    each = dimension.kinematics.freedoms
    driven: list[int] = []
    cubics: list[FloatArray] = []
    formulas: dict[int, tuple[TimeFormula, str]] = {}
    frames = np.zeros((0, FRAME))
    turns = np.zeros((0, ROW))
    for motion in load_case.motions:
        body = names.index(motion.body)
        for d, word in enumerate(dimension.axes, each * body):
            part: Prescribed | None = getattr(motion, word)
            if part is not None:
                if isinstance(part.signal, TimeFormula):
                    formulas[len(driven)] = _from_home(part, float(home[d])), part.kind
                driven.append(d)
                cubics.append(cubics_of(part, times, float(home[d]), float(v0[d])))
        if motion.rotation is not None:
            from mdstopo.general.scene.turning_drives import turning_of  # few bodies have one

            assert attitudes is not None
            first = each * (body + 1) - 3
            found = turning_of(motion.rotation, times, attitudes[body], v0[first : first + 3])
            for k, angle in enumerate(motion.rotation.angles):
                if isinstance(angle.signal, TimeFormula):
                    formulas[len(driven) + k] = angle.signal, angle.kind
            driven += [first, first + 1, first + 2]
            cubics += list(found.cubics.transpose(1, 0, 2))
            ends = float(len(turns)), float(len(turns) + len(found.rows))
            frames = np.vstack([frames, [*found.frame, *ends]])
            turns = np.vstack([turns, found.rows])
    whole = np.array(cubics).reshape(len(cubics), len(times) - 1, 4).transpose(1, 0, 2)
    rows, sides = np.zeros((len(driven), WIDTH)), np.zeros((len(times) - 1, len(driven)), dtype=np.int64)
    for i, (formula, kind) in formulas.items():
        rows[i], sides[:, i] = row_of_motion(formula, kind), modes(formula, times)
    return Drives(np.array(driven, dtype=np.int64), np.ascontiguousarray(whole), frames, turns, rows, sides)


def cubics_of(part: Prescribed, times: FloatArray, home: float, rate: float) -> FloatArray:
    """(n_seg, 4): powers of the time since the segment's start, of a prescribed quantity less what it is at home.

    rate: at the start, from which an acceleration is integrated.
    """
    if isinstance(part.signal, TimeFormula):
        if part.kind == "position":
            ends = at_ends(_from_home(part, home), times)
        else:
            ends = integrated_ends(row_of_motion(part.signal, part.kind), modes(part.signal, times), times, 0.0, rate)
        return _cubics_between(ends, np.diff(times))
    if part.kind == "position":
        return _spline_cubics(part.signal, times, home)
    out = np.zeros((len(times) - 1, 4))
    values = segment_values(part.signal, times)
    position, velocity = 0.0, rate
    for k in range(len(times) - 1):
        value, slope = values[k]
        if part.kind == "acceleration":
            cubic = position, velocity, 0.5 * value, slope / 6.0
        else:
            cubic = position, value, 0.5 * slope, 0.0
        out[k] = cubic
        h = times[k + 1] - times[k]
        position = cubic[0] + h * (cubic[1] + h * (cubic[2] + h * cubic[3]))
        velocity = cubic[1] + h * (2.0 * cubic[2] + 3.0 * h * cubic[3])
    return out


def _from_home(part: Prescribed, home: float) -> TimeFormula:
    """The formula of what is prescribed; of a position, less that at home."""
    assert isinstance(part.signal, TimeFormula)
    return part.signal.shifted(-home) if part.kind == "position" else part.signal


def _cubics_between(ends: FloatArray, h: FloatArray) -> FloatArray:
    """(n_seg, 4): cubics with values and rates (n_seg, 2, 2) at both ends of segments of lengths h (n_seg,)."""
    x, v = ends[:, :, 0], ends[:, :, 1]
    slope = (x[:, 1] - x[:, 0]) / h
    c2 = (3.0 * slope - 2.0 * v[:, 0] - v[:, 1]) / h
    return np.stack([x[:, 0], v[:, 0], c2, (v[:, 0] + v[:, 1] - 2.0 * slope) / h**2], axis=1)


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
