"""The hunt's second model for scenes in space: global axes, quaternions, Newton's and Euler's equations, multipliers.

As in a plane (`hunt_model`) it knows the case document alone and shares nothing with the package. Every joint is made
of four kinds of rows, of points and directions that ride on bodies; of each of these come place, velocity, Jacobian and
what the second derivative has beside J a, so that rows and what they have to be follow by the rule of products.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import PPoly
from scipy.spatial.transform import Rotation

from benchmarks.hunt_laws import Contact
from benchmarks.hunt_model import Model, Piece, Vector, stretch

#: what a thing that rides is: its vector, the velocity of that, J (3, n), and (J a)'s companion
Seen = tuple[Vector, Vector, Vector, Vector]
AXES = {"x": 0, "y": 1, "z": 2}
#: balances that are kept
KNOWN = 5000
ANGLES = ("roll", "pitch", "yaw")
#: below this angle the series of the rotation vector's slope is exact to rounding
SMALL = 1e-4
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def skew(a: Vector) -> Vector:
    """The matrix of a x."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(a: Any, b: Any) -> Vector:
    """a x b, of vectors (..., 3); NumPy's own takes ten times as long."""
    a, b = np.asarray(a), np.asarray(b)
    return np.asarray(a[..., NEXT] * b[..., LAST] - a[..., LAST] * b[..., NEXT])


def matrix(quaternion: Vector) -> Vector:
    """The rotation of a quaternion (w, x, y, z) of any length."""
    w, x, y, z = quaternion / np.sqrt(quaternion @ quaternion)
    across = skew(np.array([x, y, z]))
    return np.asarray(np.eye(3) + 2.0 * w * across + 2.0 * across @ across)


def perpendicular(axis: Vector) -> tuple[Vector, Vector]:
    """Two directions that are perpendicular to an axis and to each other."""
    one = cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    one /= np.linalg.norm(one)
    return one, cross(axis, one)


def angle_rates(theta: Vector) -> Vector:
    """J^-1 in theta' = J^-1 w of a rotation vector, with w in the axes that the rotation leads to."""
    angle, across = float(np.linalg.norm(theta)), skew(theta)
    square = 1.0 / 12.0 if angle < SMALL else 1.0 / angle**2 - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    return np.eye(3) - 0.5 * across + square * across @ across


def given(values: Any, t: float) -> Vector:
    """A vector that is constant, or linear between the rows of a table."""
    if not isinstance(values, dict):
        return np.array(values, dtype=float)
    rows = np.array(values["table"])
    return np.array([np.interp(t, rows[:, 0], rows[:, i]) for i in range(1, rows.shape[1])])


class Riding:
    """A point (`moves`) or a direction of a body (b, -1 the ground), given by its vector in the body's axes."""

    def __init__(self, model: "SpatialModel", b: int, local: Vector, moves: bool) -> None:
        self.model, self.b, self.local, self.moves = model, b, local, moves
        self.fixed = local if b < 0 or not moves else model.q0[7 * b : 7 * b + 3] + model.turns0[b] @ local

    def seen(self, q: Vector, v: Vector) -> Seen:
        """x (3,), x' (3,), J (3, n), J' v (3,)."""
        jacobian = np.zeros((3, self.model.n))
        if self.b < 0:
            return self.local, np.zeros(3), jacobian, np.zeros(3)
        i = 6 * self.b
        arm = self.model.turns(q)[self.b] @ self.local
        jacobian[:, i + 3 : i + 6] = -skew(arm)
        spin = skew(v[i + 3 : i + 6])
        extra = spin @ (spin @ arm)
        if not self.moves:
            return arm, spin @ arm, jacobian, extra
        jacobian[:, i : i + 3] = np.eye(3)
        return q[7 * self.b : 7 * self.b + 3] + arm, v[i : i + 3] + spin @ arm, jacobian, extra


def between(a: Seen, b: Seen) -> Seen:
    """b - a."""
    return b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3]


def product(a: Seen, b: Seen) -> tuple[Vector, float]:
    """J (n,) and companion of the second derivative of the scalar product of two things that ride."""
    return a[0] @ b[2] + b[0] @ a[2], float(a[0] @ b[3] + 2.0 * a[1] @ b[1] + b[0] @ a[3])


class Joint(NamedTuple):
    """Points of both bodies, the direction on the first of each `plane` row, pairs of directions of `square` ones."""

    name: str
    kind: str
    a: Riding
    b: Riding
    planes: list[Riding]
    squares: list[tuple[Riding, Riding]]


class SpatialModel(Model):
    """A scene in space with a design alpha (N,) and values of its variables: `solve`, then `objective`.

    Coordinates are place and quaternion of each body, velocities those of its centre of mass and its turning, global.
    """

    def _bodies(self, bodies: dict[str, Any]) -> None:
        self.n, self.n_q = 6 * len(bodies), 7 * len(bodies)
        self.masses = [float(b["mass"]) for b in bodies.values()]
        tensors = [np.array(b["inertia"], dtype=float) for b in bodies.values()]
        self.inertias = [np.diag(each) if each.ndim == 1 else each for each in tensors]
        turns = [b.get("orientation", {"quaternion": [1.0, 0.0, 0.0, 0.0]})["quaternion"] for b in bodies.values()]
        self.turns0 = [matrix(np.array(turn)) for turn in turns]
        self.q0 = np.array([c for b, turn in zip(bodies.values(), turns, strict=True) for c in (*b["position"], *turn)])
        self.v0 = np.array([c for b in bodies.values() for c in (*b["velocity"], *b["angular_velocity"])])
        self.span = 0.0, self.end
        self._known: dict[Any, tuple[Vector, Vector]] = {}
        self._ends: list[tuple[Vector, Vector]] | None = None
        self._last: tuple[Vector, list[Vector]] | None = None

    def turns(self, q: Vector) -> list[Vector]:
        """The rotation of every body."""
        if self._last is None or self._last[0] is not q:
            self._last = q, [matrix(q[i + 3 : i + 7]) for i in range(0, self.n_q, 7)]
        return self._last[1]

    def number(self, body: str) -> int:
        """-1 for the ground."""
        return -1 if body == "ground" else self.names.index(body)

    def point(self, body: str, at: Any) -> Any:
        """A point given in global axes at the start."""
        b, at = self.number(body), np.array(at, dtype=float)
        return Riding(self, b, at if b < 0 else self.turns0[b].T @ (at - self.q0[7 * b : 7 * b + 3]), True)

    def direction(self, body: str, axis: Any) -> Riding:
        """A direction given in global axes at the start, of length 1."""
        b, axis = self.number(body), np.array(axis, dtype=float) / np.linalg.norm(axis)
        return Riding(self, b, axis if b < 0 else self.turns0[b].T @ axis, False)

    # What is held

    def _held(self) -> None:
        self.joints: list[Any] = [self._of_joint(joint) for joint in self.document.get("joints", [])]
        self.motions = list(self.document.get("motions", []))

    def _of_joint(self, keys: dict[str, Any]) -> Joint:
        one, two = keys["bodies"]
        kind = keys["type"]
        ends = keys["at"] if kind == "distance" else [keys["at"], keys["at"]]
        joint = Joint(keys["name"], kind, self.point(one, ends[0]), self.point(two, ends[1]), [], [])

        def square(n: Any, m: Any) -> None:
            joint.squares.append((self.direction(one, n), self.direction(two, m)))

        if kind == "universal":
            square(*keys["axes"])
        if kind == "fixed":
            for k in range(3):
                square(np.eye(3)[k], np.eye(3)[(k + 1) % 3])
        if kind in ("revolute", "prismatic", "cylindrical", "planar"):
            axis = np.array(keys["normal" if kind == "planar" else "axis"], dtype=float)
            first, second = perpendicular(axis / np.linalg.norm(axis))
            square(first, axis)
            square(second, axis)
            if kind == "prismatic":
                square(first, second)
            if kind in ("prismatic", "cylindrical"):
                joint.planes.extend((self.direction(one, first), self.direction(one, second)))
            if kind == "planar":
                joint.planes.append(self.direction(one, axis))
        return joint

    def _rows_of(self, joint: Joint, q: Vector, v: Vector) -> Iterator[tuple[Vector, float]]:
        if joint.kind == "distance":
            _, _, jacobian, bias = stretch(joint.a, joint.b, q, v)  # type: ignore[arg-type]
            yield jacobian, -bias
            return
        apart = between(joint.a.seen(q, v), joint.b.seen(q, v))
        if not joint.planes:
            yield from ((apart[2][k], -float(apart[3][k])) for k in range(3))
        for normal in joint.planes:
            row, bias = product(normal.seen(q, v), apart)
            yield row, -bias
        for n, m in joint.squares:
            row, bias = product(n.seen(q, v), m.seen(q, v))
            yield row, -bias

    def rows(self, q: Vector, v: Vector, t: float) -> tuple[Vector, Vector]:
        found = [each for joint in self.joints for each in self._rows_of(joint, q, v)]
        for motion in self.motions:
            i = 6 * self.number(motion["body"])
            ahead = [float(given(motion[key]["acceleration"], t)[0]) for key in AXES]
            for k, value in enumerate((*ahead, *self._driven_turn(motion["rotation"], i, t))):
                row = np.zeros(self.n)
                row[i + k] = 1.0
                found.append((row, value))
        return np.array([row for row, _ in found]).reshape(-1, self.n), np.array([right for _, right in found])

    def _driven_turn(self, keys: dict[str, Any], i: int, t: float) -> Vector:
        """The angular acceleration of a prescribed rotation."""
        if "axis" in keys:
            axis = np.array(keys["axis"], dtype=float)
            return np.asarray(float(given(keys["acceleration"], t)[0]) * axis / np.linalg.norm(axis))
        if "angular_velocity" in keys:
            low, high = self.span
            middle, d = 0.5 * (low + high), 0.25 * (high - low)
            table = keys["angular_velocity"]
            return np.asarray((given(table, middle + d) - given(table, middle - d)) / (2.0 * d))
        # R = Rz(yaw) Ry(pitch) Rx(roll): omega = yaw' z + Rz (pitch' y + Ry roll' x)
        angles, rates, second = (
            np.array([_angle(_rows(keys[name]), float(self.v0[i + 3 + k]))[order](t) for k, name in enumerate(ANGLES)])
            for order in range(3)
        )
        x, y, z = np.eye(3)
        about_z = Rotation.from_rotvec(angles[2] * z).as_matrix()
        about_y = Rotation.from_rotvec(angles[1] * y).as_matrix()
        pitching, rolling = about_z @ y, about_z @ about_y @ x
        yaw = rates[2] * z
        carried = yaw + rates[1] * pitching
        return np.asarray(
            second[2] * z
            + second[1] * pitching
            + rates[1] * cross(yaw, pitching)
            + second[0] * rolling
            + rates[0] * cross(carried, rolling)
        )

    # What acts

    def _stretched(self, q: Vector, v: Vector) -> Iterator[tuple[Any, Any]]:
        """Every member with its length, the rate of that, its Jacobian and its companion, as `stretch` has them."""
        every: list[Any] = [one for own in self.members.values() for one in own]
        if not every:
            return
        if self._ends is None:
            self._ends = [(np.array([each.b for each in side]), np.array([each.local for each in side]))
                          for side in ([one.a for one in every], [one.b for one in every])]  # fmt: skip
        turns = np.array([*self.turns(q), np.eye(3)])  # the ground is number -1
        places = np.concatenate([q.reshape(-1, 7)[:, :3], np.zeros((1, 3))])
        rates = np.concatenate([v.reshape(-1, 6), np.zeros((1, 6))])
        seen = []
        for b, local in self._ends:
            arm = np.einsum("mij,mj->mi", turns[b], local)
            spin = rates[b, 3:]
            turning = cross(spin, arm)
            seen.append((places[b] + arm, rates[b, :3] + turning, arm, cross(spin, turning)))
        (xa, va, arm_a, ba), (xb, vb, arm_b, bb) = seen
        d, rate = xb - xa, vb - va
        length = np.sqrt((d * d).sum(axis=1))
        e = d / length[:, None]
        along = (e * rate).sum(axis=1)
        bias = ((rate * rate).sum(axis=1) - along**2) / length + (e * (bb - ba)).sum(axis=1)
        rows = np.zeros((len(every), len(rates), 6))
        for (b, _), arm, sign in zip(self._ends, (arm_a, arm_b), (-1.0, 1.0), strict=True):
            own = np.arange(len(every))
            rows[own, b, :3] += sign * e
            rows[own, b, 3:] += sign * cross(arm, e)
        flat = rows[:, :-1].reshape(len(every), self.n)
        yield from zip(every, zip(length.tolist(), along.tolist(), flat, bias.tolist(), strict=True), strict=True)

    def _moved(self, q: Vector, v: Vector) -> Vector:
        rate = np.empty(self.n_q)
        for b in range(len(self.names)):
            i, k = 6 * b, 7 * b
            w, vector, omega = q[k + 3], q[k + 4 : k + 7], v[i + 3 : i + 6]
            rate[k : k + 3] = v[i : i + 3]
            rate[k + 3] = -0.5 * omega @ vector
            rate[k + 4 : k + 7] = 0.5 * (w * omega + skew(omega) @ vector)
        return rate

    def _applied(self, t: float, q: Vector, v: Vector) -> tuple[Vector, Vector]:
        mass, force = np.zeros((self.n, self.n)), np.zeros(self.n)
        gravity = np.array(self.document["gravity"])
        globally = []
        for b, (m, inertia, turn) in enumerate(zip(self.masses, self.inertias, self.turns(q), strict=True)):
            i = 6 * b
            globally.append(turn @ inertia @ turn.T)
            mass[i : i + 3, i : i + 3] = m * np.eye(3)
            mass[i + 3 : i + 6, i + 3 : i + 6] = globally[b]
            force[i : i + 3] = m * gravity
            omega = v[i + 3 : i + 6]
            force[i + 3 : i + 6] = -skew(omega) @ (globally[b] @ omega)
        for load in self.document.get("loads", []):
            b = self.number(load["body"])
            force[6 * b : 6 * b + 6] += self._load(load, b, globally[b], t, q)
        for bushing in self.document.get("bushings", []):
            self._add_bushing(bushing, q, v, force)
        return mass, force

    def _load(self, load: dict[str, Any], b: int, inertia: Vector, t: float, q: Vector) -> Vector:
        """Force and moment about the centre of mass, global."""
        turn = self.turns(q)[b]
        if "acceleration" in load or "angular_acceleration" in load:
            still = [0.0, 0.0, 0.0]
            push = self.masses[b] * given(load.get("acceleration", still), t)
            return np.concatenate([push, inertia @ given(load.get("angular_acceleration", still), t)])
        force, moment = (given(load.get(key, [0.0, 0.0, 0.0]), t) for key in ("force", "moment"))
        if load.get("frame") == "body":
            moment = turn @ (moment + cross(load.get("at", [0.0, 0.0, 0.0]), force))
            return np.concatenate([turn @ force, moment])
        if "at" in load:
            moment = moment + cross(turn @ self.point(load["body"], load["at"]).local, force)
        return np.concatenate([force, moment])

    def _add_bushing(self, keys: dict[str, Any], q: Vector, v: Vector, force: Vector) -> None:
        one, two = keys["bodies"]
        a, b = self.number(one), self.number(two)
        here, there = self.point(one, keys["at"]).seen(q, v), self.point(two, keys["at"]).seen(q, v)
        turn, since, spin, _ = self._observer(a, q, v)
        turn_b, since_b, spin_b, _ = self._observer(b, q, v)
        theta = Rotation.from_matrix(turn.T @ turn_b @ (since.T @ since_b).T).as_rotvec()
        k, c = np.array(keys["stiffness"]), np.array(keys["damping"])
        d = there[0] - here[0]
        rate = there[1] - here[1] - cross(spin, d)
        push = -turn @ (k[:3] * (turn.T @ d) + c[:3] * (turn.T @ rate))
        couple = -turn @ (angle_rates(theta).T @ (k[3:] * theta) + c[3:] * (turn.T @ (spin_b - spin)))
        for body, sign in ((a, -1.0), (b, 1.0)):
            if body >= 0:
                i, arm = 6 * body, there[0] - q[7 * body : 7 * body + 3]
                force[i : i + 3] += sign * push
                force[i + 3 : i + 6] += sign * (couple + cross(arm, push))

    def _observer(self, b: int, q: Vector, v: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Rotation now and at the start, turning and place of a body or the ground."""
        if b < 0:
            return np.eye(3), np.eye(3), np.zeros(3), np.zeros(3)
        return self.turns(q)[b], self.turns0[b], v[6 * b + 3 : 6 * b + 6], q[7 * b : 7 * b + 3]

    def _given(self) -> list[Vector]:
        signals = [value for load in self.document.get("loads", []) for value in load.values()]
        for motion in self.motions:
            turn = motion["rotation"]
            signals += [motion[key]["acceleration"] for key in AXES]
            signals += [turn.get("acceleration"), turn.get("angular_velocity")]
            signals += [turn[key]["acceleration"] for key in ANGLES if key in turn]
        return [np.array(each["table"])[:, 0] for each in signals if isinstance(each, dict) and "table" in each]

    # Contacts

    def _contacts(self) -> Iterator[tuple[Any, ...]]:
        for keys in self.document.get("contacts", []):
            points, on = self.document["points"][keys["points"]], keys["on"]
            for at in points["grid"]["list"]:
                yield Contact(keys, np.inf), self.point(points["body"], at), on, self.number(on["body"])

    def _touch(self, where: list[Any], q: Vector, v: Vector) -> tuple[Any, ...]:
        """Room within ends, depth, its rate, sliding; directions of sliding and normal (2, 3), J of point and body."""
        at, on, body = where
        x, speed, jacobian, _ = at.seen(q, v)
        height, normal, room = self._surface(on, q, v, x)
        there, moving = np.zeros((3, self.n)), np.zeros(3)
        if body >= 0:
            i, arm = 6 * body, x - q[7 * body : 7 * body + 3]
            there[:, i : i + 3], there[:, i + 3 : i + 6] = np.eye(3), -skew(arm)
            moving = there @ v
        rate = speed - moving
        rise = float(normal @ rate)
        along = rate - rise * normal
        slide = float(np.linalg.norm(along))
        way = along / slide if slide > 0.0 else np.zeros(3)
        return room, -height, -rise, slide, np.array([way, normal]), jacobian, there

    def _surface(self, on: dict[str, Any], q: Vector, v: Vector, x: Vector) -> tuple[float, Vector, float]:
        """Height of a place over a surface, its normal, and how far the place is within the ends."""
        body = on["body"]

        def here(at: Any) -> Vector:
            return np.asarray(self.point(body, at).seen(q, v)[0])

        def way(axis: Any) -> Vector:
            return self.direction(body, axis).seen(q, v)[0]

        if "plane" in on:
            normal = way(on["plane"]["normal"])
            return float(normal @ (x - here(on["plane"]["at"]))), normal, np.inf
        if "rectangle" in on:
            keys = on["rectangle"]
            one, two = (way(axis) for axis in keys["axes"])
            off, normal = x - here(keys["center"]), cross(one, two)
            rooms = (0.5 * size - abs(float(e @ off)) for e, size in zip((one, two), keys["size"], strict=True))
            return float(normal @ off), normal, min(rooms)
        keys = on["sphere"] if "sphere" in on else on["cylinder"]
        room = np.inf
        if "sphere" in on:
            off = x - here(keys["center"])
        else:
            low, high = here(keys["from"]), here(keys["to"])
            length = float(np.linalg.norm(high - low))
            axis = (high - low) / length
            along = float(axis @ (x - low))
            room, off = min(along, length - along), x - low - along * axis
        side, distance = -1.0 if keys.get("hollow") else 1.0, float(np.linalg.norm(off))
        return side * (distance - keys["radius"]), side * off / distance, room

    # What is looked at

    def _panels(self, piece: Piece) -> tuple[float, int]:
        return 3e-12, max(1, int(np.ceil(12.0 * (piece.high - piece.low) / self.end)))

    def _balanced(self, t: float, y: Vector) -> tuple[Vector, Vector]:
        """`balance` at a time of the piece that is looked at: several responses want it at the same times."""
        key = t, self.span
        if key not in self._known:
            if len(self._known) > KNOWN:
                self._known.clear()
            self._known[key] = self.balance(t, y)
        return self._known[key]

    def _signed(self, response: Any) -> bool:
        if not isinstance(response, dict):
            return False
        ((kind, keys),) = response.items()
        return bool(kind == "tilt" or keys.get("component", "norm") != "norm")

    def _motion(self, kind: str, keys: dict[str, Any], t: float, y: Vector) -> Vector:
        q, v = y[: self.n_q], y[self.n_q :]
        if kind in ("joint_force", "joint_moment"):
            force, moment = self._reaction(keys["joint"], t, y)
            return force if kind == "joint_force" else moment
        r = self.number(keys.get("relative_to", "ground"))
        turn, start, spin, _ = self._observer(r, q, v)
        own, own_start, own_spin, _ = self._observer(self.number(keys["body"]), q, v)
        if kind == "tilt":
            axis = self.direction(keys["body"], keys["axis"]).local
            now, then = turn.T @ own @ axis, start.T @ own_start @ axis
            return np.array([np.arctan2(np.linalg.norm(cross(now, then)), now @ then)])
        if kind == "rotation":
            seen = Rotation.from_matrix(turn.T @ own @ (start.T @ own_start).T).as_rotvec()
        elif kind == "angular_velocity":
            seen = turn.T @ (own_spin - spin)
        elif kind == "angular_acceleration":
            own_rate, rate = (self._accelerations(self.number(keys["body"]), t, y), self._accelerations(r, t, y))
            seen = turn.T @ (own_rate[1] - rate[1] - cross(spin, own_spin))
        else:
            seen = self._seen_from(kind, keys, r, t, y)
        component = keys.get("component", "norm")
        return np.asarray(seen) if component == "norm" else np.array([seen[AXES[component]]])

    def _seen_from(self, kind: str, keys: dict[str, Any], r: int, t: float, y: Vector) -> Vector:
        """What an observer that rides on body r sees of a point, in the observer's axes."""
        q, v = y[: self.n_q], y[self.n_q :]
        point = self.point(keys["body"], keys["at"])
        x, u, jacobian, extra = point.seen(q, v)
        turn, start, spin, place = self._observer(r, q, v)
        if kind == "displacement":
            origin = np.zeros(3) if r < 0 else self.q0[7 * r : 7 * r + 3]
            return np.asarray(turn.T @ (x - place) - start.T @ (point.fixed - origin))
        moving = np.zeros(3) if r < 0 else v[6 * r : 6 * r + 3]
        rate = u - moving - cross(spin, x - place)
        if kind == "velocity":
            return np.asarray(turn.T @ rate)
        ahead, turning = self._accelerations(r, t, y)
        push = jacobian @ self._balanced(t, y)[0] + extra - ahead - cross(turning, x - place)
        return np.asarray(turn.T @ (push - 2.0 * cross(spin, rate) - cross(spin, cross(spin, x - place))))

    def _accelerations(self, b: int, t: float, y: Vector) -> tuple[Vector, Vector]:
        """Of a body's centre of mass, and its angular one."""
        if b < 0:
            return np.zeros(3), np.zeros(3)
        found = self._balanced(t, y)[0]
        return found[6 * b : 6 * b + 3], found[6 * b + 3 : 6 * b + 6]

    def _reaction(self, name: str, t: float, y: Vector) -> tuple[Vector, Vector]:
        """Force and moment on a joint's first body, at its own point of the joint."""
        q, v = y[: self.n_q], y[self.n_q :]
        lam, first = self._balanced(t, y)[1], 0
        for joint in self.joints:
            rows = np.array([row for row, _ in self._rows_of(joint, q, v)])
            if joint.name == name:
                pulls = -lam[first : first + len(rows)] @ rows
                body, sign = (joint.a.b, 1.0) if joint.a.b >= 0 else (joint.b.b, -1.0)
                force, moment = pulls[6 * body : 6 * body + 3], pulls[6 * body + 3 : 6 * body + 6]
                arm = joint.a.seen(q, v)[0] - q[7 * body : 7 * body + 3]
                return sign * force, sign * (moment - cross(arm, force))
            first += len(rows)
        raise KeyError(name)


def _rows(angle: dict[str, Any]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(row) for row in angle["acceleration"]["table"])


@lru_cache(maxsize=64)
def _angle(table: tuple[tuple[float, ...], ...], rate: float) -> tuple[PPoly, PPoly, PPoly]:
    """Angle, its rate and its second derivative where the last is linear between the rows of a table."""
    rows = np.array(table)
    slopes = np.diff(rows[:, 1]) / np.diff(rows[:, 0])
    second = PPoly(np.array([slopes, rows[:-1, 1]]), rows[:, 0])
    first = second.antiderivative()
    first.c[-1] += rate
    return first.antiderivative(), first, second
