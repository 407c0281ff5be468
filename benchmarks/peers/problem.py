"""What every program is given: bodies, undamped springs between them, hinges, constant loads, as plain arrays.

Nothing of mdstopo is imported here, so that a program is judged by its own start and memory.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]

#: the index that stands for the ground
GROUND = -1


@dataclass(frozen=True)
class Problem:
    """N springs among B bodies at rest at the start, J hinges; the energy G of the springs is looked at.

    mass (B, 3): mass twice, then inertia. start (B, 3): x, y and angle. force (B, 3): constant forces and couples, in
    global axes, weight included. groups (K, 2): the two bodies of each group of members, each pair of bodies at most
    once; first (K + 1,): where in the members each group begins. p, q (N, 2): ends in the coordinates of the two
    bodies. length, stiffness (N,): initial length, stiffness at alpha = 1. hinges (J, 2): the bodies; at (J, 2, 2):
    the hinge in the coordinates of each. end: the time. peak: whether G is the highest energy over time, or the last.
    """

    mass: Floats
    start: Floats
    force: Floats
    groups: Indices
    first: Indices
    p: Floats
    q: Floats
    length: Floats
    stiffness: Floats
    hinges: Indices
    at: Floats
    end: float
    peak: bool

    @property
    def members(self) -> int:
        """N."""
        return len(self.length)

    @property
    def bodies(self) -> int:
        """B."""
        return len(self.mass)

    def slices(self) -> list[slice]:
        """The members of each group."""
        return [slice(int(a), int(b)) for a, b in zip(self.first, self.first[1:], strict=False)]

    def energy(self, alpha: Floats, pose: Floats) -> float:
        """Energy of the springs at coordinates (B, 3)."""
        whole = 0.0
        for (one, two), part in zip(self.groups.tolist(), self.slices(), strict=True):
            between = world(pose, two, self.q[part]) - world(pose, one, self.p[part])
            stretch = np.hypot(between[:, 0], between[:, 1]) - self.length[part]
            whole += float(0.5 * np.sum(alpha[part] * self.stiffness[part] * stretch**2))
        return whole

    def save(self, path: Path) -> None:
        """Write all of it."""
        np.savez(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Any:
        """Read what `save` wrote, of this class or of one of a kind."""
        with np.load(path) as stored:
            values: dict[str, Any] = {name: stored[name] for name in stored.files}
        if "turn" in values:
            from benchmarks.peers.space_problem import SpatialProblem

            cls = SpatialProblem
        if "reach" in values:
            from benchmarks.peers.seat_problem import SeatProblem

            return SeatProblem.of(values)
        return cls(**values | {"end": float(values["end"]), "peak": bool(values["peak"])})


def world(pose: Floats, body: int, points: Floats) -> Floats:
    """Points (n, 2) in the coordinates of a body, in global ones; pose (B, 3)."""
    if body == GROUND:
        return points
    x, y, angle = pose[body]
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([x + c * points[:, 0] - s * points[:, 1], y + s * points[:, 0] + c * points[:, 1]])


def moments(p: Floats, q: Floats) -> Floats:
    """(n, 8): the squared length of a member is this row times `coefficients` of its bodies' relative pose.

    |d + R2 q - R1 p|^2 multiplied out: eight functions of the coordinates, the same for all members of a group, times
    eight numbers of the member.
    """
    (px, py), (qx, qy) = p.T, q.T
    dot, cross = px * qx + py * qy, px * qy - py * qx
    return np.column_stack([np.ones(len(p)), px, py, qx, qy, dot, cross, (p**2 + q**2).sum(axis=1)])


def coefficients(one: Sequence[Any], two: Sequence[Any], cos: Any, sin: Any) -> list[Any]:
    """What `moments` is multiplied with; one, two: x, y, angle of the bodies; cos, sin: of whatever library."""
    dx, dy = two[0] - one[0], two[1] - one[1]
    c1, s1, c2, s2 = cos(one[2]), sin(one[2]), cos(two[2]), sin(two[2])
    return [
        dx * dx + dy * dy,
        -2.0 * (dx * c1 + dy * s1),
        -2.0 * (dy * c1 - dx * s1),
        2.0 * (dx * c2 + dy * s2),
        2.0 * (dy * c2 - dx * s2),
        -2.0 * (c1 * c2 + s1 * s2),
        2.0 * (c1 * s2 - s1 * c2),
        1.0,
    ]
