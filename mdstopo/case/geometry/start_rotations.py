"""Rotations and directions at the start: matrices whose columns are the turned axes, unit vectors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mdstopo.case.arrays import FloatArray


def unit(vector: Sequence[float]) -> FloatArray:
    """The unit vector (3,) along a vector that is not zero; nothing overflows on the way."""
    v = np.array(vector, dtype=np.float64)
    # A power of two scales exactly: what has length 1 already keeps its bits.
    v = np.ldexp(v, -math.frexp(float(np.abs(v).max()))[1])
    length = math.sqrt(float(v @ v))
    scaled: FloatArray = v / length
    return scaled


def about_axis(axis: Sequence[float], angle: float) -> FloatArray:
    """The rotation (3, 3) about an axis through an angle in rad, right-handed (Rodrigues)."""
    x, y, z = unit(axis).tolist()
    c, s = math.cos(angle), math.sin(angle)
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    along = np.outer((x, y, z), (x, y, z))
    return orthonormal(c * np.eye(3) + s * across + (1.0 - c) * along)


def of_quaternion(quaternion: Sequence[float]) -> FloatArray:
    """The rotation (3, 3) of a quaternion w, x, y, z near norm 1, which is normalised."""
    q = np.array(quaternion, dtype=np.float64)
    w, x, y, z = (q / math.sqrt(float(q @ q))).tolist()
    return orthonormal(
        np.array(
            [
                [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
            ]
        )
    )


def orthonormal(matrix: FloatArray) -> FloatArray:
    """The rotation nearest to a matrix that is almost one.

    Newton's iteration for the polar factor without an inverse (Higham, Functions of Matrices, 2008, sec. 8.3): an error
    e becomes 3 e^2/4, so that three steps bring 1e-2 to rounding. Exact matrices stay as they are.
    """
    turned = np.array(matrix, dtype=np.float64)
    for _ in range(3):
        turned = turned + 0.5 * turned @ (np.eye(3) - turned.T @ turned)
    return turned


def turning(start: FloatArray, end: FloatArray) -> FloatArray:
    """The rotation (3, 3) on the shortest way from one unit vector to another that is not its opposite."""
    if np.array_equal(start, end):
        return np.eye(3)
    x, y, z = np.cross(start, end).tolist()
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return orthonormal(np.eye(3) + across + across @ across / (1.0 + float(start @ end)))


def frame_along(axis: FloatArray) -> FloatArray:
    """Right-handed unit vectors (3, 3) by rows, the first along a unit vector."""
    away = np.zeros(3)
    away[int(np.argmin(np.abs(axis)))] = 1.0
    return frame_with(axis, away)


def frame_with(axis: FloatArray, towards: FloatArray) -> FloatArray:
    """Right-handed unit vectors (3, 3) by rows, the first along a unit vector, the second in its plane with another
    vector that is not along it."""
    second = towards - float(towards @ axis) * axis
    second = unit(second.tolist())
    second = unit((second - float(second @ axis) * axis).tolist())  # once more: what cancelled is gone
    return np.array([axis, second, np.cross(axis, second)])


def parallel(one: FloatArray, other: FloatArray, tolerance: float = 1e-9) -> bool:
    """Whether two unit vectors are on one line."""
    return float(np.linalg.norm(np.cross(one, other))) <= tolerance
