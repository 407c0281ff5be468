"""What every program is given of a scene in space: bodies, undamped springs, spherical joints, constant loads.

As `problem` in a plane; nothing of mdstopo is imported here either.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.peers.problem import GROUND, Floats, Problem


@dataclass(frozen=True)
class SpatialProblem(Problem):
    """As a `Problem`, whose fields are here, for B bodies at rest at the start:

    mass (B,). inertia (B, 3, 3): tensors in body axes. start (B, 3): centres of mass; turn (B, 4): unit quaternions
    w, x, y, z. force (B, 6): constant forces and moments about the centre of mass, in global axes, weight included.
    p, q (N, 3), at (J, 2, 3): in the axes of the bodies. hinges (J, 2): the bodies of spherical joints.
    """

    inertia: Floats
    turn: Floats

    def energy(self, alpha: Floats, pose: Floats) -> float:
        """Energy of the springs at places and unit quaternions (B, 7)."""
        whole = 0.0
        for (one, two), part in zip(self.groups.tolist(), self.slices(), strict=True):
            between = spatial_world(pose, two, self.q[part]) - spatial_world(pose, one, self.p[part])
            stretch = np.linalg.norm(between, axis=1) - self.length[part]
            whole += float(0.5 * np.sum(alpha[part] * self.stiffness[part] * stretch**2))
        return whole

    @property
    def pose(self) -> Floats:
        """(B, 7): places and quaternions at the start."""
        return np.hstack([self.start, self.turn])

    def grid(self, part: slice) -> tuple[Floats, Floats] | None:
        """Points of both sides where members join every one with every other, the second side fast; else None."""
        p, q = self.p[part], self.q[part]
        differs = np.flatnonzero((p != p[0]).any(axis=1))
        many = int(differs[0]) if len(differs) else len(p)
        rows, columns = p[::many], q[:many]
        whole = len(rows) * many == len(p)
        if (
            whole
            and np.array_equal(p, np.repeat(rows, many, axis=0))
            and np.array_equal(q, np.tile(columns, (len(rows), 1)))
        ):
            return rows, columns
        return None


def rotation(quaternion: Floats) -> Floats:
    """(3, 3): body axes as columns, of a unit quaternion."""
    w, x, y, z = quaternion.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def spatial_world(pose: Floats, body: int, points: Floats) -> Floats:
    """Points (n, 3) in the axes of a body, in global ones; pose (B, 7)."""
    if body == GROUND:
        return points
    moved: Floats = pose[body, :3] + points @ rotation(pose[body, 3:]).T
    return moved
