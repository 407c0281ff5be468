"""Prescribed rotations in space as arrays: cubics of three angles, or a table of turns with linear rates between them.

Angles are done one after the other about the axes x, y and z of a frame, roll first; they are those of the case, or of
a frame with x along the one axis that a body turns about. An angular velocity that is linear in time is followed by a
series of sixth order from rows of turns (`spatial_drives`), which stand so close that the series has converged.
"""

from typing import NamedTuple

import numpy as np

from mdstopo.case.geometry.start_rotations import frame_along
from mdstopo.case.model import PrescribedRotation
from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.scene.drives import cubics_of
from mdstopo.mechanics.kinematics.spatial_drives import ROW
from mdstopo.mechanics.kinematics.spatial_poses import COORDINATES, FREEDOMS, HOME_AXES, HOME_TURN
from mdstopo.scene.quaternions import product, rotations_of
from mdstopo.scene.signal_segments import segment_values
from mdstopo.scene.springs_model import FloatArray

#: by how much a turn of one step of the series may differ from that of two halves
CONVERGED = 1e-13
#: the same by its angle: rounding of that
ROUNDING = 2e-15


class Turning(NamedTuple):
    """The arrays of one prescribed rotation in space.

    cubics (n_seg, 3, 4): of the angles, or of the time integrals of the angular velocity's components in each segment.
    frame (9,): by rows what turns vectors of the body at home, in principal axes, into the drive's axes. rows (K, ROW):
    time and unit quaternion; none of angles.
    """

    cubics: FloatArray
    frame: FloatArray
    rows: FloatArray


def turning_of(rotation: PrescribedRotation, times: FloatArray, home: FloatArray, v0: FloatArray) -> Turning:
    """The arrays of a prescribed rotation.

    rotation: what is prescribed.
    times (n_seg + 1,): ends of the segments (s).
    home (HOME,): the body at home. v0 (3,): its turning rate at the start, in principal axes.
    """
    at_home = home[HOME_TURN:HOME_AXES].reshape(3, 3)
    cubics = np.zeros((len(times) - 1, 3, 4))
    if rotation.angular_velocity:
        for k, signal in enumerate(rotation.angular_velocity):
            values = segment_values(signal, times)
            cubics[:, k, 1], cubics[:, k, 2] = values[:, 0], 0.5 * values[:, 1]
        return Turning(cubics, at_home.ravel(), _rows(cubics, times))
    frame = at_home if rotation.axis is None else frame_along(np.array(rotation.axis)) @ at_home
    rates = frame @ v0
    for k, angle in enumerate(rotation.angles):
        cubics[:, k] = cubics_of(angle, times, 0.0, float(rates[k]))
    return Turning(cubics, frame.ravel(), np.zeros((0, ROW)))


def _rows(cubics: FloatArray, times: FloatArray) -> FloatArray:
    """(K, ROW): time and turn since the start, at the start of each segment and wherever a series has to begin anew."""
    rows = []
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    for k in range(len(times) - 1):
        rate, slope = cubics[k, :, 1], 2.0 * cubics[k, :, 2]
        for start, end in _steps(rate, slope, float(times[k + 1] - times[k])):
            rows.append([times[k] + start, *turn])
            turn = product(_over(rate, slope, start, end), turn)
            turn /= np.linalg.norm(turn)
    return np.array(rows, dtype=np.float64).reshape(-1, ROW)


def _over(rate: FloatArray, slope: FloatArray, start: float, end: float) -> FloatArray:
    """The quaternion (4,) of the turn between two times of a segment, by one step of the series (`spatial_drives`)."""
    h = end - start
    a, b = h * (rate + 0.5 * (start + end) * slope), h * h * slope
    c = np.cross(a, b)
    back = np.cross(a, c)
    t = a - c / 12.0 + np.cross(a, back) / 720.0 + np.cross(c, b) / 240.0 - np.cross(c, back) / 14400.0
    angle = float(np.linalg.norm(t))
    return np.array([np.cos(0.5 * angle), *(0.5 * np.sinc(angle / (2.0 * np.pi)) * t)])


def _steps(rate: FloatArray, slope: FloatArray, length: float) -> list[tuple[float, float]]:
    """Pieces of a segment over which the series has converged: halves of halves."""
    open_pieces, done = [(0.0, length)], []
    while open_pieces:
        start, end = open_pieces.pop()
        middle = 0.5 * (start + end)
        whole = _over(rate, slope, start, end)
        halves = product(_over(rate, slope, middle, end), _over(rate, slope, start, middle))
        angle = (end - start) * float(np.abs(rate).max() + length * np.abs(slope).max())
        if np.abs(whole - halves).max() <= CONVERGED + ROUNDING * angle or not start < middle < end:
            done.append((start, end))
        else:
            open_pieces += [(middle, end), (start, middle)]
    return done


def global_moments(model: GeneralModel, q: FloatArray, lam: FloatArray) -> FloatArray:
    """Multipliers (T, n_driven) of what is driven at states q (T, n_q): those of rotations, in global axes.

    model: the compiled scene. lam (T, n_driven): as the balance gives them, of rotations in principal axes.
    """
    if not len(model.drive_frame):
        return lam
    out = lam.copy()
    for i, d in enumerate(model.driven.tolist()):
        body, axis = divmod(d, FREEDOMS)
        if axis == 3:
            first = COORDINATES * body + 3
            turned = model.home[body, HOME_TURN:HOME_AXES].reshape(3, 3) @ rotations_of(q[:, first : first + 4])
            out[:, i : i + 3] = np.einsum("tij,tj->ti", turned, lam[:, i : i + 3])
    return out
