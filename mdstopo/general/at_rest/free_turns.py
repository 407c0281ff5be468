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

#: what is rounding in directions of length 1 by mass
ROUNDING = 1e-6


@dataclass(frozen=True)
class FreeTurns:
    """The turns that nothing holds: directions D (n, r), slopes R (r, n) of the headings of as many bodies, by how much
    these have turned since the stated configuration, angles (r,), and which they are."""

    directions: FloatArray
    slopes: FloatArray
    angles: FloatArray
    bodies: list[int]

    def back(self) -> FloatArray:
        """(n,): the shift that turns the bodies back."""
        return self._taken(-self.angles)

    def kept(self, inverse: FloatArray) -> FloatArray:
        """(n, n): changes by forces, dq = inverse dF, with which the headings stay."""
        return inverse - self._taken(self.slopes @ inverse)

    def _taken(self, angles: FloatArray) -> FloatArray:
        taken: FloatArray = self.directions @ np.linalg.solve(self.slopes @ self.directions, angles)
        return taken


def free_turns(bodies: Kinematics, modes: FloatArray, root: FloatArray, headings: Headings) -> FreeTurns | int:
    """The turns among directions that nothing holds; or the body that turns where it has no heading.

    modes (n, k): the directions in coordinates that are scaled by the roots of masses, root (n,), where they are
    orthonormal. headings: of all bodies, at the equilibrium.
    """
    if not modes.size:
        return FreeTurns(modes, modes.T, np.zeros(0), [])
    each, size = bodies.freedoms, bodies.rotations
    weight = root.reshape(-1, each)[:, -size:]
    turns = modes.reshape(-1, each, modes.shape[1])[:, -size:]
    # each body's turn about the vertical, by mass as the modes are
    axis = headings.axis * weight
    length = np.linalg.norm(axis, axis=1)
    axis = axis / np.where(length > 0.0, length, 1.0)[:, None]
    about = np.einsum("bt,btk->bk", axis, turns)
    other = np.abs(turns - axis[:, :, None] * about[:, None]).max(axis=(1, 2))
    if other.max() > ROUNDING:
        return int(other.argmax())
    chosen = _independent(about)
    count = len(chosen)
    slopes = np.zeros((count, len(modes)))
    for row, body in zip(slopes, chosen, strict=True):
        row[each * (body + 1) - size : each * (body + 1)] = headings.slope[body]
    directions = modes @ np.linalg.svd(about)[2][:count].T if count else modes[:, :0]
    return FreeTurns(directions / root[:, None], slopes, headings.angle[chosen], chosen)


def _independent(about: FloatArray) -> list[int]:
    """The first bodies whose rows (n_body, k) are independent: what earlier rows leave of one is more than rounding."""
    chosen: list[int] = []
    basis: list[FloatArray] = []
    for body, row in enumerate(about):
        left = row.copy()
        for unit in basis + basis:  # twice, for orthogonality to rounding
            left -= (unit @ left) * unit
        size = float(np.linalg.norm(left))
        if size > ROUNDING:
            chosen.append(body)
            basis.append(left / size)
    return chosen
