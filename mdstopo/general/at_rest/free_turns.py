"""Turns at an equilibrium that nothing holds and nothing pushes: bodies keep the headings that the case states.

A load on a level floor may turn about the vertical, alone or with what is fastened to it, and stays at rest. Which of
these equilibria a search comes to depends on its way, so one is chosen: of the bodies that can only turn together, the
first has not turned about the vertical since the stated configuration. In a plane that is its angle; in space the twist
of its turn, and turns about other axes have no such heading.

With the directions N (n, k) that nothing holds, C (k headings by N) and the slopes of chosen headings R (r, n), changes
at rest are those that no other choice is made for, less what turns the chosen bodies:

    dq = dq_0 - D (R D)^-1 R dq_0,   D = N V,   C = U S V^T,   M-orthogonal to all shifts that nothing holds
"""

from dataclasses import dataclass

import numpy as np

from mdstopo.mechanics.kinematics.kinematics_interface import Headings, Kinematics
from mdstopo.scene.springs_model import FloatArray

#: of a turn, the part about another axis than the vertical that is taken for rounding; and of a set of directions, the
#: part of the largest that adds none
ROUNDING, RANK = 1e-6, 1e-6


@dataclass(frozen=True)
class FreeTurns:
    """The turns that nothing holds: directions D (n, r), slopes R (r, n) of the headings of as many bodies, and by how
    much these have turned since the stated configuration, angles (r,)."""

    directions: FloatArray
    slopes: FloatArray
    angles: FloatArray

    def back(self) -> FloatArray:
        """(n,): the shift that turns the bodies back."""
        return self._taken(-self.angles)

    def kept(self, inverse: FloatArray) -> FloatArray:
        """(n, n): changes by forces, dq = inverse dF, with which the headings stay."""
        return inverse - self._taken(self.slopes @ inverse)

    def _taken(self, angles: FloatArray) -> FloatArray:
        taken: FloatArray = self.directions @ np.linalg.solve(self.slopes @ self.directions, angles)
        return taken


def free_turns(bodies: Kinematics, modes: FloatArray, headings: Headings) -> FreeTurns | int:
    """The turns among directions (n, k) that nothing holds; or the body that turns where it has no heading.

    modes: of length 1 by mass, and orthogonal. headings: of all bodies, at the equilibrium.
    """
    if not modes.size:
        return FreeTurns(modes, modes.T, np.zeros(0))
    each, size = bodies.freedoms, bodies.rotations
    turns = modes.reshape(-1, each, modes.shape[1])[:, -size:]
    square = np.sum(headings.axis**2, axis=1)
    about = np.einsum("bt,btk->bk", headings.axis, turns) / np.where(square > 0.0, square, 1.0)[:, None]
    other = np.abs(turns - headings.axis[:, :, None] * about[:, None]).max(axis=(1, 2))
    if other.max() > ROUNDING * np.abs(turns).max():
        return int(other.argmax())
    _, sizes, rows = np.linalg.svd(about)
    count = int(np.sum(sizes > RANK * sizes.max()))
    chosen = _independent(about, count)
    slopes = np.zeros((count, len(modes)))
    for row, body in zip(slopes, chosen, strict=True):
        row[each * (body + 1) - size : each * (body + 1)] = headings.slope[body]
    return FreeTurns(modes @ rows[:count].T, slopes, headings.angle[chosen])


def _independent(about: FloatArray, count: int) -> list[int]:
    """The first bodies whose rows (n_body, k) are independent, as many as there are."""
    chosen: list[int] = []
    for body in range(len(about)):
        if len(chosen) == count:
            break
        if np.linalg.matrix_rank(about[[*chosen, body]], tol=RANK * float(np.abs(about).max())) > len(chosen):
            chosen.append(body)
    return chosen
