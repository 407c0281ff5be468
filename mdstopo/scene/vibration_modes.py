"""Small undamped motion about the start: squares of angular frequencies, and how bodies move."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mdstopo.scene.springs_model import FloatArray

#: squares of frequencies below this share of the largest, or of a body's by itself, are rounding: such a mode has no
#: stiffness
ROUNDING = 1e-12


@dataclass(frozen=True)
class Modes:
    """Modes of small undamped vibration about the start.

    matrix (K, K): stiffness of the directions that joints leave, by the mass; basis (n, K): these directions, as
    velocities of the bodies' freedoms of kinetic energy 1/2. scale: the largest entry of the stiffness by the mass
    without joints, rad^2/s^2: where joints leave what is balanced, all squares may be rounding of it.
    """

    matrix: FloatArray
    basis: FloatArray
    scale: float

    @cached_property
    def squares(self) -> FloatArray:
        """(K,) squares of angular frequencies, rad^2/s^2, rising; negative where a mode grows."""
        return np.sort(np.linalg.eigvals(self.matrix).real)

    @property
    def least(self) -> float:
        """The square below which there is no stiffness, rad^2/s^2."""
        return ROUNDING * max(float(np.abs(self.squares).max(initial=0.0)), self.scale)

    @property
    def frequencies(self) -> FloatArray:
        """Angular frequencies, rad/s, rising, of the modes that have a stiffness."""
        found: FloatArray = np.sqrt(self.squares[self.squares > self.least])
        return found

    @cached_property
    def shapes(self) -> FloatArray:
        """(n, K) the velocities of the bodies' freedoms in each mode."""
        values, vectors = np.linalg.eig(self.matrix)
        shapes: FloatArray = self.basis @ vectors.real[:, np.argsort(values.real, kind="stable")]
        return shapes


def modes_of(stiffness: FloatArray, inverse_root: FloatArray, rows: FloatArray, held: float) -> Modes:
    """The modes of a stiffness (n, n) with L^-1 (n, n), where the mass matrix is L L^T.

    rows (r, n): velocities that joints hold at zero. held: what a row leaves of a direction, relative, below which the
    direction is held.
    """
    basis = np.eye(len(inverse_root))
    if len(rows):
        _, sizes, directions = np.linalg.svd(rows @ inverse_root.T)
        basis = directions[int(np.sum(sizes > held * sizes.max(initial=0.0))) :].T
    scale = float(np.abs(inverse_root @ stiffness @ inverse_root.T).max(initial=0.0))
    return Modes(basis.T @ inverse_root @ stiffness @ inverse_root.T @ basis, inverse_root.T @ basis, scale)
