"""Rotations in space with NumPy: unit quaternions (w, x, y, z), matrices, and the principal axes of an inertia."""

import numpy as np

from mdstopo.scene.springs_model import FloatArray

#: components of a unit quaternion up to this size are rounding's: they do not choose its sign
ROUNDED_COMPONENT = 1e-14


def principal(inertia: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Principal moments J (3,) and axes P (3, 3) of an inertia (3, 3) = P diag(J) P^T, det P = 1.

    Where the inertia is diagonal already, the axes are the unit vectors, and the moments stand in their order.
    """
    if not np.any(inertia - np.diag(np.diag(inertia))):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes = -axes
    return moments, axes


def quaternions_of(rotations: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), of which the first component that is not 0 is
    positive."""
    flat = np.asarray(rotations, dtype=np.float64).reshape(-1, 3, 3)
    out = np.empty((len(flat), 4))
    for k, r in enumerate(flat):
        # four times the squares of w, x, y, z; the others follow from the largest without cancellation
        squares = np.array(
            [
                1.0 + r[0, 0] + r[1, 1] + r[2, 2],
                1.0 + r[0, 0] - r[1, 1] - r[2, 2],
                1.0 - r[0, 0] + r[1, 1] - r[2, 2],
                1.0 - r[0, 0] - r[1, 1] + r[2, 2],
            ]
        )
        products = np.array(
            [
                [0.0, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
                [r[2, 1] - r[1, 2], 0.0, r[1, 0] + r[0, 1], r[0, 2] + r[2, 0]],
                [r[0, 2] - r[2, 0], r[1, 0] + r[0, 1], 0.0, r[2, 1] + r[1, 2]],
                [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2], 0.0],
            ]
        )
        best = int(squares.argmax())
        q = products[best].copy()
        q[best] = squares[best]
        q /= np.linalg.norm(q)
        first = q[np.abs(q) > ROUNDED_COMPONENT][0]
        out[k] = q if first > 0.0 else -q
    return out.reshape(*np.shape(rotations)[:-2], 4)


def rotations_of(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(np.asarray(quaternions, dtype=np.float64), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def product(one: FloatArray, other: FloatArray) -> FloatArray:
    """Products (..., 4) of quaternions: the turn `other`, then `one`."""
    a, b = np.asarray(one), np.asarray(other)
    w = a[..., 0] * b[..., 0] - np.sum(a[..., 1:] * b[..., 1:], axis=-1)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + np.cross(a[..., 1:], b[..., 1:])
    return np.concatenate([w[..., None], vector], axis=-1)
