"""The seated occupant of cases/restraint.yaml as plain arrays, for programs that take joint coordinates.

The cabin moves along x as it is told and never turns, so everything is seen from it. One body, the root, has a place
and an angle; the others hang on joints, directly or through one another, and have an angle each.

Nothing of mdstopo is imported here, so that a program is judged by its own start and memory.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.problem import Floats, Indices

#: laws of members
GAP, ACTUATOR = range(2)


@dataclass(frozen=True)
class SeatProblem:
    """B bodies at rest, not turned, seen from the cabin; N members between cabin and bodies, M of them designed.

    mass, inertia (B,). root: the body with a place; place (2,): its centre of mass at the start. reach (B, B, 2): the
    centre of mass of body i lies at that of the root plus the vectors reach[i, k], each turned with body k.
    hinges (J, 2): pairs of bodies with a rotational spring (N m/rad) and damper (N m s/rad) between them.
    body (N,), at (N, 2): the body and the end on it, in its coordinates; anchor (N, 2): the end on the cabin.
    law (N,): GAP first, then ACTUATOR. stiffness, damping (N,): of gaps those of a stop, of actuators the gains;
    offset (N,): gap or target (m); side (N,): 1 where stretching closes a gap, -1 where shortening does; limit (N,):
    the largest force of an actuator (N). active (2,): from when until when actuators act (s).
    design (N,): number of the design variable, or -1.
    pulse (T, 2): times and accelerations (m/s^2) of the cabin along x, straight lines between. gravity: along -y.
    chest: the body whose acceleration is looked at; head (2,): the point of it whose displacement is. end: the time.
    """

    mass: Floats
    inertia: Floats
    root: int
    place: Floats
    reach: Floats
    hinges: Indices
    spring: Floats
    damper: Floats
    body: Indices
    at: Floats
    anchor: Floats
    law: Indices
    stiffness: Floats
    damping: Floats
    offset: Floats
    side: Floats
    limit: Floats
    active: Floats
    design: Indices
    pulse: Floats
    gravity: float
    chest: int
    head: Floats
    end: float

    @property
    def members(self) -> int:
        """M."""
        return int(self.design.max()) + 1

    def save(self, path: Path) -> None:
        """Write all of it."""
        np.savez(path, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def of(cls, values: dict[str, Any]) -> "SeatProblem":
        """From what `save` wrote."""
        return cls(**{name: value.item() if value.ndim == 0 else value for name, value in values.items()})
