"""What moves and what acts: points, members, loads, motions, contacts, bushings, load cases."""

from __future__ import annotations

from collections.abc import Container
from typing import Any, TypeAlias

from mdstopo.case.arrays import (
    Components,
    FloatArray,
    IndexArray,
    Pair,
    Signal,
    Triple,
    VectorSignal,
    read_only,
    read_only_index,
)
from mdstopo.case.geometry.rigid_bodies import AnyBody
from mdstopo.case.laws import Law
from mdstopo.case.value import Value, frozen


@frozen
class PointGrid(Value):
    """Named points on one body: local (n, 2) in body coordinates, world (n, 2) global at the start; (n, 3) in space."""

    name: str
    body: str
    local: FloatArray
    world: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "local", read_only(self.local))
        object.__setattr__(self, "world", read_only(self.world))


@frozen
class MovablePoints(Value):
    """The points of a grid whose coordinates are design variables.

    grid, body: their names. base (n, d), or (1, d) where it is the same for all, axes (k, d): in body coordinates a
    point is its base + its k values . axes; the axes are unit vectors, perpendicular to each other. variables: the name
    of each axis' variable, which has a value for every point, in their order.
    """

    grid: str
    body: str
    base: FloatArray
    axes: FloatArray
    variables: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("base", "axes"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


@frozen
class Candidates(Value):
    """Members that are priced instead of built: every P with every Q, of an initial length between two limits.

    count: how many there are before these; shortest, longest: the limits (m), with their rounding; longest may be
    infinite. cost: V_i of each; None: its initial length.
    """

    count: int
    shortest: float
    longest: float
    cost: float | None

    @property
    def filtered(self) -> bool:
        """Whether some of them may be left out by their length."""
        return self.shortest > 0.0 or self.longest < float("inf")


@frozen
class MemberGroup(Value):
    """A group of M candidate members between two bodies, after filters; first ends vary slowest
    (`MemberGroup.is_product`).

    from_local (nP, 2), to_local (nQ, 2): the end points in body coordinates, each stored once, (n, 3) in space;
    from_world, to_world: the same in the global frame at the start.
    from_index, to_index (M,): which of them each member joins. length (M,): initial lengths in m, > 0.
    laws: forces that add. cost (M,): V_i. design: whether members are design variables; where not, alpha = 1.
    initial, lower, upper, power: the design's numbers for this group (power is mu of Eq. 12).
    powers: where an optimisation goes from one power to the next: all of them, the last one being `power`.
    candidates: of a priced group all that could be members, of which the M are those that have been built; else None.
    from_points, to_points: the names of the point grids that P and Q are; empty for a point in place.
    cost_by_length: whether V_i is the initial length. sizes: what alpha can be in the end, rising; any, where there are
    none; prices: what stands in volume rows for each of them in the place of alpha.
    """

    name: str
    body_from: str
    body_to: str
    from_local: FloatArray
    to_local: FloatArray
    from_world: FloatArray
    to_world: FloatArray
    from_index: IndexArray
    to_index: IndexArray
    length: FloatArray
    laws: tuple[Law, ...]
    cost: FloatArray
    design: bool = True
    initial: float = 0.1
    lower: float = 0.001
    upper: float = 1.0
    power: float = 1.0
    powers: tuple[float, ...] = ()
    candidates: Candidates | None = None
    from_points: str = ""
    to_points: str = ""
    cost_by_length: bool = False
    sizes: tuple[float, ...] = ()
    prices: tuple[float, ...] = ()

    def cost_varies(self, movable: Container[str]) -> bool:
        """Whether the costs V_i are lengths that change where the points of these grids move."""
        return self.cost_by_length and (self.from_points in movable or self.to_points in movable)

    def __post_init__(self) -> None:
        for name in ("from_local", "to_local", "from_world", "to_world", "length", "cost"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        for name in ("from_index", "to_index"):
            object.__setattr__(self, name, read_only_index(getattr(self, name)))

    def __len__(self) -> int:
        return int(self.length.shape[0])

    @property
    def is_product(self) -> bool:
        """Whether every P is joined with every Q: member i is (i // nQ, i % nQ)."""
        n_p, n_q = self.from_local.shape[0], self.to_local.shape[0]
        if len(self) != n_p * n_q:
            return False
        # As many as the product has, and no pair twice, leaves pairs only where one side has a single point.
        return min(n_p, n_q) <= 1 or int(self.from_index[1]) == 0

    @property
    def p_local(self) -> FloatArray:
        """(M, 2 or 3) first ends in body coordinates of ``body_from``; made anew at each access."""
        return self.from_local[self.from_index]

    @property
    def q_local(self) -> FloatArray:
        """(M, 2 or 3) second ends in body coordinates of ``body_to``; made anew at each access."""
        return self.to_local[self.to_index]

    @property
    def p_world(self) -> FloatArray:
        """(M, 2 or 3) first ends in the global frame at the start; made anew at each access."""
        return self.from_world[self.from_index]

    @property
    def q_world(self) -> FloatArray:
        """(M, 2 or 3) second ends in the global frame at the start; made anew at each access."""
        return self.to_world[self.to_index]


@frozen
class Load(Value):
    """A force in N at a point that rides on the body, and a couple in N m.

    at_local: the point in body coordinates. frame: ``global``, or ``body`` for a force that turns with it; in space it
    is that of the moment, too.
    A load stated as accelerations has become force = m a and moment = J times the angular acceleration. In space J of
    global axes turns with the body: an angular acceleration in rad/s^2 of global components stays one, the moment is J
    at that time times it, and `moment` is zero; None elsewhere.
    """

    body: str
    force: VectorSignal = (0.0, 0.0)
    at_local: Components = (0.0, 0.0)
    moment: Any = 0.0  # Signal, in space VectorSignal
    frame: str = "global"
    angular_acceleration: VectorSignal | None = None


@frozen
class Prescribed(Value):
    """One coordinate that is prescribed over time. kind: acceleration | velocity | position (its signal is always a
    Table)."""

    kind: str
    signal: Signal


@frozen
class PrescribedRotation(Value):
    """A body's whole rotation over time in space, in one of three ways.

    angles: roll, pitch and yaw, about the global x, y and z, or with `axis` the one angle about that global unit
    vector; each is 0 at the start. angular_velocity: where there are none, its global components in rad/s.
    """

    angles: tuple[Prescribed, ...] = ()
    axis: Triple | None = None
    angular_velocity: VectorSignal = ()

    @property
    def signals(self) -> VectorSignal:
        """The signals of all quantities that say how the rotation goes over time."""
        return (*(angle.signal for angle in self.angles), *self.angular_velocity)


@frozen
class Motion(Value):
    """Prescribed motion of a body; None leaves that free. angle: in the plane; z and rotation: in space."""

    body: str
    x: Prescribed | None = None
    y: Prescribed | None = None
    angle: Prescribed | None = None
    z: Prescribed | None = None
    rotation: PrescribedRotation | None = None


@frozen(kw_only=True)
class Contact(Value):
    """Points of one body against an edge of another; the left of the way from its first end to its second is free.

    index: its place in the file, from 0; name: as stated, else the index as text. points (n, 2), edge_from, edge_to:
    in coordinates of `body` and of `edge_body`. Each point by itself: stiffness in N/m, damping in N s/m, friction:
    mu; slip: the sliding speed in m/s at which friction is mu tanh(1).
    """

    name: str
    index: int
    body: str
    points: FloatArray
    edge_body: str
    edge_from: Pair
    edge_to: Pair
    stiffness: float
    damping: float
    friction: float
    slip: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))


@frozen
class Surface(Value):
    """A surface of a body in space, in coordinates of that body.

    shape: plane | rectangle | sphere | cylinder. place: a point of a plane, the centre of a rectangle or a sphere, one
    end of a cylinder's axis. axes (3, 3): unit vectors by rows; the last is the normal, to the free side, of planes and
    rectangles and the axis of cylinders, the first two are along the sides of rectangles. sizes (m): half of both sides
    of rectangles, radius of spheres, radius and length of cylinders, else 0. hollow: points are free inside.
    """

    shape: str
    place: Triple
    axes: FloatArray
    sizes: Pair
    hollow: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", read_only(self.axes))


@frozen(kw_only=True)
class SurfaceContact(Value):
    """Points of one body against a surface of another, in space: as `Contact`, with points (n, 3).

    edge_body: the body that has the surface.
    """

    name: str
    index: int
    body: str
    points: FloatArray
    edge_body: str
    surface: Surface
    stiffness: float
    damping: float
    friction: float
    slip: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", read_only(self.points))


#: a `Contact`, in space a `SurfaceContact`
AnyContact: TypeAlias = Any


@frozen
class Bushing(Value):
    """An elastic joint: forces along the first body's axes and a couple.

    stiffness (N/m, then N m/rad), damping (N s/m, then N m s/rad): of two axes and the angle, in space of three axes
    and the three components of the rotation vector; points in body coordinates.
    """

    index: int
    bodies: tuple[str, str]
    at_first: Components
    at_second: Components
    stiffness: tuple[float, ...]
    damping: tuple[float, ...] = (0.0, 0.0, 0.0)


@frozen
class LoadCase(Value):
    """One load case: loads, motions, start velocities and times, the common ones merged with its own.

    gravity in m/s^2; start, end in s. bodies: `Case.bodies` as this loading starts them: a start value that a
    body does not state and a motion prescribes is taken from the motion (else equal to `Case.bodies`).
    """

    name: str
    gravity: Components
    start: float
    end: float
    loads: tuple[Load, ...]
    motions: tuple[Motion, ...]
    bodies: tuple[AnyBody, ...]
