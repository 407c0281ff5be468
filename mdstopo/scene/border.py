"""States on their way out: from the coordinates that kernels have to those that users and files have.

Kernels measure from the start and from a point near the scene (`scene.origin`); users see places in the coordinates of
the case. In space kernels also have the angular velocity in principal axes; users see it in global ones.
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from mdstopo.case.model import Case
from mdstopo.scene.bodies import is_spatial
from mdstopo.scene.quaternions import principal, product, quaternions_of, rotations_of
from mdstopo.scene.springs_model import FloatArray


class Border(Protocol):
    """Converts states of kernels, q (T, n_q) and v, a (T, n), to the coordinates that users see; bodies that the
    case has not are left out.

    coordinates, freedoms: how many numbers of a body users see in q, and in v and a.
    """

    coordinates: int
    freedoms: int

    def places(self, q: FloatArray) -> FloatArray: ...
    def rates(self, q: FloatArray, v: FloatArray) -> FloatArray: ...


@dataclass(frozen=True)
class PlanarBorder:
    """In a plane: x, y, psi of each body and their derivatives. home (n,): what they are where q is zero."""

    home: FloatArray
    coordinates = freedoms = 3

    def places(self, q: FloatArray) -> FloatArray:
        """Coordinates of the case, q (T, 3 n_bodies): x, y, psi of each body."""
        return np.asarray(q[:, : len(self.home)] + self.home)

    def rates(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Velocities, or accelerations, (T, 3 n_bodies) as they are."""
        del q
        return v[:, : len(self.home)].copy()


@dataclass(frozen=True)
class SpatialBorder:
    """In space: position and unit quaternion of each body's own axes; velocity and angular velocity, all global.

    position (n_bodies, 3), turned (n_bodies, 4): where bodies are at the start, and the quaternion of their axes, whose
    first component that is not 0 is positive. principal (n_bodies, 3, 3): principal axes, in which kernels turn.
    """

    position: FloatArray
    turned: FloatArray
    principal: FloatArray
    coordinates = 7
    freedoms = 6

    def places(self, q: FloatArray) -> FloatArray:
        """Coordinates of the case, q (T, 7 n_bodies): x, y, z; w, x, y, z, continuous in sign as the turns since the
        start are."""
        count = len(self.position)
        own = q[:, : self.coordinates * count].reshape(len(q), count, self.coordinates)
        # kernels turn principal axes from where they were at the start: R(t) = R_start P E P^T
        since = own[..., 3:].copy()
        since[..., 1:] = np.einsum("bij,tbj->tbi", self.principal, own[..., 4:])
        out = np.concatenate([own[..., :3] + self.position, product(self.turned, since)], axis=-1)
        return np.asarray(out.reshape(len(q), -1))

    def rates(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Velocities, or accelerations, (T, 6 n_bodies): angular ones turned into global axes."""
        count = len(self.position)
        own = v[:, : self.freedoms * count].reshape(len(v), count, self.freedoms).copy()
        axes = rotations_of(self.places(q).reshape(len(q), count, self.coordinates)[..., 3:]) @ self.principal
        # of accelerations too: R (omega x omega) is nothing
        own[..., 3:] = np.einsum("tbij,tbj->tbi", axes, own[..., 3:])
        return np.asarray(own.reshape(len(v), -1))


def border_of(case: Case, bodies: tuple[Any, ...]) -> Border:
    """The conversion for a case; bodies: as a load case starts them, in the coordinates of the case."""
    if not is_spatial(case):
        return PlanarBorder(np.array([value for body in bodies for value in (*body.position, body.angle)]))
    return SpatialBorder(
        np.array([body.position for body in bodies], dtype=np.float64).reshape(-1, 3),
        quaternions_of(np.array([body.rotation for body in bodies]).reshape(-1, 3, 3)),
        np.array([principal(np.asarray(body.inertia))[1] for body in bodies]).reshape(-1, 3, 3),
    )
