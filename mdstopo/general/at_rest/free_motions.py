"""Motions at an equilibrium that nothing holds and nothing pushes: bodies keep the places and headings of the case.

A load on a level floor may slide, and turn about the vertical, alone or with what is fastened to it, and stays at rest.
Which of these equilibria a search comes to depends on its way, so one is chosen. By shifts that are free nothing has
moved since the stated configuration, on average by mass. And of the bodies that can only turn together, the first has
not turned about the vertical: in a plane that is its angle, in space the twist of its turn. Turns about other axes have
no such heading.

With the directions N (n, k) that nothing holds, of length 1 by mass, and C (k headings by N), what is chosen has the
values and slopes by q of

    shifts     D^T M (q - q_stated),   D^T M    D = N V_0,  C V_0 = 0
    headings   psi,                    psi_q    D = N V,    C = U S V^T

so changes at rest by forces, which are M-orthogonal to all of N else, are dq = dq_0 - D (R D)^-1 R dq_0 with R the
slopes.
"""

from dataclasses import dataclass

import numpy as np

from mdstopo.mechanics.kinematics.kinematics_interface import Headings, Kinematics
from mdstopo.scene.springs_model import FloatArray

#: what is rounding in directions of length 1 by mass
ROUNDING = 1e-6


@dataclass(frozen=True)
class FreeMotions:
    """The motions that nothing holds: directions D (n, k), the slopes R (k, n) of what is kept, and by how much that
    has changed since the stated configuration, changes (k,)."""

    directions: FloatArray
    slopes: FloatArray
    changes: FloatArray

    def back(self) -> FloatArray:
        """(n,): the shift back to what is kept."""
        return self._taken(-self.changes)

    def kept(self, inverse: FloatArray) -> FloatArray:
        """(n, n): changes by forces, dq = inverse dF, with which all stays that is kept."""
        return inverse - self._taken(self.slopes @ inverse)

    def _taken(self, changes: FloatArray) -> FloatArray:
        taken: FloatArray = self.directions @ np.linalg.solve(self.slopes @ self.directions, changes)
        return taken


def free_motions(
    bodies: Kinematics, modes: FloatArray, root: FloatArray, change: FloatArray, headings: Headings
) -> FreeMotions | int:
    """The motions in directions that nothing holds; or the body that turns where it has no heading.

    modes (n, k): the directions in coordinates that are scaled by the roots of masses, root (n,), where they are
    orthonormal. change (n,): from the stated configuration to the equilibrium. headings: of all bodies there.
    """
    if not modes.size:
        return FreeMotions(modes, modes.T, np.zeros(0))
    each, size = bodies.freedoms, bodies.rotations
    turns = modes.reshape(-1, each, modes.shape[1])[:, -size:]
    # each body's turn about the vertical, by mass as the modes are
    axis = headings.axis * root.reshape(-1, each)[:, -size:]
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
    parts = modes @ np.linalg.svd(about)[2].T
    by_mass = parts[:, count:].T * root
    return FreeMotions(
        parts / root[:, None],
        np.concatenate([slopes, by_mass]),
        np.concatenate([headings.angle[chosen], by_mass @ change]),
    )


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
