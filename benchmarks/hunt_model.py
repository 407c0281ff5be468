"""A second model of planar scenes, from the case document alone: plain NumPy and SciPy's DOP853.

Written from the format's description and nothing of the package: positions in global axes, one joint or member after
the other, accelerations and multipliers from one dense system of equations, motion at tolerances of 1e-13. Joints are
imposed on accelerations; what they drift by in so short a motion is of the order of that tolerance. What switches
(`hunt_laws`) stays in its mode until its margin is used up; there a new piece of the motion begins. Bodies begin
unturned. It knows what `hunt_scenes` draws; anything else is a KeyError.
"""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from benchmarks.hunt_laws import ACTS, Contact, Law
from benchmarks.hunt_reductions import AGREE, PANELS, Look, highest, integral, kinks, length

Vector = np.ndarray[Any, np.dtype[np.float64]]
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
#: tolerances of the motion, longest steps in the whole of it, places of a step at which margins are looked at
RTOL, ATOL, STEPS, CHECKS = 1e-13, 1e-15, 60, 9
#: a margin that is no more than this below zero is used up only if it goes on falling
NOUGHT = 1e-12
#: places of a motion at which extremes and kinks are looked for before they are refined
LOOKS = 400
#: switches in one motion after which it is given up
MOST = 2000


class Point:
    """A point of a body (index b, -1 the ground): place, velocity, Jacobian and the acceleration that q'' lacks."""

    def __init__(self, b: int, at: Vector, origin: Vector, n: int) -> None:
        self.b, self.arm, self.n = b, at - origin, n
        self.fixed = at

    def seen(self, q: Vector, v: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """x (2,), x' (2,), J (2, n), J' v (2,)."""
        jacobian = np.zeros((2, self.n))
        if self.b < 0:
            return self.fixed, np.zeros(2), jacobian, np.zeros(2)
        i = 3 * self.b
        c, s = np.cos(q[i + 2]), np.sin(q[i + 2])
        arm = np.array([c * self.arm[0] - s * self.arm[1], s * self.arm[0] + c * self.arm[1]])
        jacobian[0, i] = jacobian[1, i + 1] = 1.0
        jacobian[:, i + 2] = QUARTER @ arm
        return q[i : i + 2] + arm, jacobian @ v, jacobian, -(v[i + 2] ** 2) * arm


def stretch(p: Point, q: Point, x: Vector, v: Vector) -> tuple[float, float, Vector, float]:
    """Distance of two points, its rate, its Jacobian (n,) and what its second derivative has beside J q''."""
    (a, va, ja, ba), (b, vb, jb, bb) = p.seen(x, v), q.seen(x, v)
    d, rate = b - a, vb - va
    length = float(np.linalg.norm(d))
    e = d / length
    along = float(e @ rate)
    return length, along, e @ (jb - ja), float((rate @ rate - along**2) / length + e @ (bb - ba))


class Piece(NamedTuple):
    """A piece of the motion in which nothing switches: its times, steps of it, modes and growths of all that switch."""

    low: float
    high: float
    steps: list[Any]
    modes: list[tuple[int, float]]

    def __call__(self, t: float) -> Vector:
        """The state."""
        for step in self.steps:
            if t <= step.t:
                return np.asarray(step(t))
        return np.asarray(self.steps[-1](t))


class Member(NamedTuple):
    """scale: alpha to its power; free: the length at which it is not stretched; its laws and ends."""

    scale: float
    free: float
    laws: list[Law]
    a: Point
    b: Point


class Model:
    """A scene with a design alpha (N,) and values of its variables: `solve`, then `objective`."""

    def __init__(self, document: dict[str, Any], alpha: Vector, values: dict[str, Vector] | None = None) -> None:
        self.document = document
        self.names = list(document["bodies"])
        self.end = float(document["time"]["end"])
        self._bodies(document["bodies"])
        self.members = self._members(alpha, values or {})
        self.contacts = list(self._contacts())
        self._held()
        self.switching: list[Any] = [law for own in self.members.values() for one in own for law in one.laws]
        self.switches = any(law.switches for law in self.switching)
        self.switching += [contact for contact, *_ in self.contacts]

    def _bodies(self, bodies: dict[str, Any]) -> None:
        """n velocities, n_q coordinates, the state at the start, masses and weights."""
        self.n = self.n_q = 3 * len(bodies)
        self.mass = np.array([m for b in bodies.values() for m in (b["mass"], b["mass"], b["inertia"])])
        self.q0 = np.array([c for b in bodies.values() for c in (*b["position"], 0.0)])
        self.v0 = np.array([c for b in bodies.values() for c in (*b["velocity"], b["angular_velocity"])])
        self.weight = self.mass * np.tile([*self.document["gravity"], 0.0], len(bodies))

    def _held(self) -> None:
        """Joints, and accelerations that are given."""
        rows = self.document.get("joints", [])
        self.joints = [(joint["name"], joint["type"], *self._joint(joint)) for joint in rows]
        self.driven = {
            3 * self.names.index(motion["body"]) + i: np.array(motion[key]["acceleration"]["table"]).T
            for motion in self.document.get("motions", [])
            for i, key in enumerate(("x", "y", "angle"))
        }

    def _members(self, alpha: Vector, values: dict[str, Vector]) -> dict[str, list[Member]]:
        document, found, first = self.document, dict[str, list[Member]](), 0
        variables = document["design"].get("variables", {})
        for name, group in document["members"].items():
            laws = group["law"] if isinstance(group["law"], list) else [group["law"]]
            p, q = (document["points"][group[key]] for key in ("from", "to"))
            found[name] = own = []
            for i, (a, b) in enumerate(zip(p["grid"]["list"], q["grid"]["list"], strict=True)):
                scale = float(alpha[first + i]) ** document["design"]["power"]
                given = {
                    row["parameter"]: float(values[key][i if row.get("each") == "member" else 0])
                    for key, row in variables.items()
                    if row["group"] == name
                }
                each = [Law(keys | given) for keys in laws]
                ends = self.point(p["body"], a), self.point(q["body"], b)
                own.append(Member(scale, float(np.linalg.norm(np.subtract(b, a))), each, *ends))
            first += len(own)
        return found

    def _contacts(self) -> Iterator[tuple[Contact, Point, int, Vector, Vector]]:
        """Each with its point, the edge's body, and in that body's axes the edge's beginning and direction."""
        for keys in self.document.get("contacts", []):
            points, edge = self.document["points"][keys["points"]], keys["on"]
            begin = self.point(edge["body"], edge["from"])
            along = np.subtract(edge["to"], edge["from"])
            length = float(np.hypot(*along))
            for at in points["grid"]["list"]:
                yield Contact(keys, length), self.point(points["body"], at), begin.b, begin.arm, along / length

    def point(self, body: str, at: Any) -> Point:
        """A point given in global axes at the start."""
        b = -1 if body == "ground" else self.names.index(body)
        return Point(b, np.array(at, dtype=float), np.zeros(2) if b < 0 else self.q0[3 * b : 3 * b + 2], self.n)

    def _joint(self, joint: dict[str, Any]) -> tuple[Point, Point, Vector]:
        at = joint["at"] if joint["type"] == "distance" else [joint["at"], joint["at"]]
        axis = np.array(joint.get("axis", [1.0, 0.0]))
        a, b = (self.point(body, place) for body, place in zip(joint["bodies"], at, strict=True))
        return a, b, QUARTER @ axis / np.hypot(*axis)

    def rows(self, q: Vector, v: Vector, t: float) -> tuple[Vector, Vector]:
        """Phi_q (m, n) and what Phi_q q'' has to be (m,)."""
        rows, right = [], []
        for _, kind, a, b, normal in self.joints:
            if kind == "distance":
                _, _, jacobian, bias = stretch(a, b, q, v)
                rows.append(jacobian)
                right.append(-bias)
                continue
            (xa, va, ja, ba), (xb, vb, jb, bb) = a.seen(q, v), b.seen(q, v)
            if kind == "revolute":
                rows += list(jb - ja)
                right += list(ba - bb)
                continue
            turn, w = (q[3 * a.b + 2], v[3 * a.b + 2]) if a.b >= 0 else (0.0, 0.0)
            n = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ normal
            row, level = n @ (jb - ja), np.zeros(self.n)
            level[3 * b.b + 2] = 1.0
            if a.b >= 0:
                row[3 * a.b + 2] += QUARTER @ n @ (xb - xa)
                level[3 * a.b + 2] = -1.0
            rows += [row, level]
            right += [-float(n @ (bb - ba) + 2.0 * w * (QUARTER @ n) @ (vb - va) - w * w * n @ (xb - xa)), 0.0]
        for d, table in self.driven.items():
            row = np.zeros(self.n)
            row[d] = 1.0
            rows.append(row)
            right.append(float(np.interp(t, *table)))
        return np.array(rows).reshape(-1, self.n), np.array(right)

    def _touch(self, where: list[Any], q: Vector, v: Vector) -> tuple[Any, ...]:
        """Place along an edge, depth, rate of that, sliding; the edge's axes (2, 2), the point's J and the edge's."""
        at, edge, begin, e = where
        x, speed, jacobian, _ = at.seen(q, v)
        origin, moving, turn, w = np.zeros(2), np.zeros(2), 0.0, 0.0
        there = np.zeros((2, self.n))
        if edge >= 0:
            i = 3 * edge
            origin, moving, turn, w = q[i : i + 2], v[i : i + 2], q[i + 2], v[i + 2]
            there[0, i] = there[1, i + 1] = 1.0
            there[:, i + 2] = QUARTER @ (x - origin)
        back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        place = back @ (x - origin) - begin
        rate = back @ (speed - moving - w * (QUARTER @ (x - origin)))
        axes = np.array([e, QUARTER @ e])
        (s, height), (slide, rise) = axes @ place, axes @ rate
        return float(s), -float(height), -float(rise), float(slide), axes @ back, jacobian, there

    def balance(self, t: float, y: Vector) -> tuple[Vector, Vector]:
        """q'' (n,) and the multipliers, in the modes that all is in."""
        q, v = y[: self.n_q], y[self.n_q :]
        mass, force = self._applied(t, q, v)
        for (scale, free, laws, _, _), (now, rate, row, bias) in self._stretched(q, v):
            for law in laws:
                if law.inertance != 0.0:
                    mass += scale * law.inertance * np.outer(row, row)
                force -= scale * (law.force(now - free, rate, t) + law.inertance * bias) * row
        for contact, *where in self.contacts:
            if contact.mode == ACTS:
                _, depth, rate, slide, axes, jacobian, there = self._touch(where, q, v)
                force += (axes.T @ contact.force(depth, rate, slide)) @ (jacobian - there)
        rows, right = self.rows(q, v, t)
        m = len(rows)
        matrix = np.block([[mass, rows.T], [rows, np.zeros((m, m))]])
        found = np.linalg.solve(matrix, np.concatenate([force, right]))
        return found[: self.n], found[self.n :]

    def _stretched(self, q: Vector, v: Vector) -> Iterator[tuple[Member, Any]]:
        """Every member with its `stretch`."""
        yield from ((one, stretch(one.a, one.b, q, v)) for own in self.members.values() for one in own)

    def _applied(self, t: float, q: Vector, v: Vector) -> tuple[Vector, Vector]:
        """The matrix of mass (n, n), and what acts beside members, contacts and joints (n,)."""
        force = self.weight.copy()
        for load in self.document.get("loads", []):
            force[3 * self.names.index(load["body"]) + 2] += np.interp(t, *np.array(load["moment"]["table"]).T)
        return np.diag(self.mass), force

    def _moved(self, q: Vector, v: Vector) -> Vector:
        """q' (n_q,)."""
        return v

    def _given(self) -> list[Vector]:
        """Times of the tables of motions and loads."""
        tables = [table[0] for table in self.driven.values()]
        return tables + [np.array(load["moment"]["table"])[:, 0] for load in self.document.get("loads", [])]

    def breaks(self) -> list[float]:
        """Times at which something given has a kink."""
        tables = self._given()
        laws = [law for own in self.members.values() for law in own[0].laws]
        tables += [np.array(law.keys["table"])[:, 0] for law in laws if law.kind == "table"]
        return sorted({0.0, self.end, *(float(t) for table in tables for t in table if 0.0 < t < self.end)})

    def _seen(self, y: Vector) -> Iterator[tuple[Any, tuple[float, ...]]]:
        """All that switches, with what it switches by."""
        q, v = y[: self.n_q], y[self.n_q :]
        if self.switches:
            for one, (now, rate, _, _) in self._stretched(q, v):
                yield from ((law, (now - one.free, rate)) for law in one.laws if law.switches)
        for contact, *where in self.contacts:
            yield contact, self._touch(where, q, v)[:3]

    def _margins(self, y: Vector) -> Vector:
        return np.array([each.margin(*seen) for each, seen in self._seen(y)])

    def solve(self) -> None:
        """The motion, in pieces."""
        t, y = 0.0, np.concatenate([self.q0, self.v0])
        for each, seen in self._seen(y):
            each.place(*seen)
        self.pieces: list[Piece] = []
        switched = 0
        for high in self.breaks()[1:]:
            self.span = t, high
            while t < high:
                steps, who = self._steps(t, y, high)
                self.pieces.append(Piece(t, steps[-1].t, steps, self._modes()))
                t, y = steps[-1].t, np.asarray(steps[-1](steps[-1].t))
                if who >= 0:
                    each, seen = list(self._seen(y))[who]
                    each.after(*seen)
                    switched += 1
                    if switched > MOST:
                        raise ArithmeticError("it chatters")

    def _steps(self, t: float, y: Vector, high: float) -> tuple[list[Any], int]:
        """Steps from a state to a time, or to where a margin is used up: that of number so much, else -1."""
        solver = DOP853(
            lambda t, y: np.concatenate([self._moved(y[: self.n_q], y[self.n_q :]), self.balance(t, y)[0]]),
            t, y, high, rtol=RTOL, atol=ATOL, max_step=self.end / STEPS,
        )  # fmt: skip
        steps: list[Any] = []
        before = self._margins(y)
        while solver.status == "running":
            solver.step()
            step = solver.dense_output()
            steps.append(step)
            if not len(before):
                continue
            for low, end in pairwise(np.linspace(step.t_old, step.t, CHECKS).tolist()):
                after = self._margins(step(end))
                gone = [
                    (self._used_up(step, i, low, end, before[i]), i) for i in np.flatnonzero(after < -NOUGHT).tolist()
                ]
                if gone:
                    step.t, who = min(gone)
                    return steps, who
                before = after
        return steps, -1

    def _used_up(self, step: Any, i: int, low: float, high: float, at_low: float) -> float:
        """When, between two times at the second of which it is, the margin of number i is used up."""

        def margin(t: float) -> float:
            each, seen = next(found for k, found in enumerate(self._seen(step(t))) if k == i)
            return float(each.margin(*seen))

        if at_low <= 0.0:  # as good as used up when the piece began; a little further it may be inside yet
            inside = low + 1e-3 * (high - low)
            if margin(inside) <= 0.0:
                return low + 1e-12 * (high - low)
            low = inside
        return float(brentq(margin, low, high, xtol=1e-15, rtol=1e-15))

    def _modes(self) -> list[tuple[int, float]]:
        return [(each.mode, getattr(each, "growth", 0.0)) for each in self.switching]

    def _restore(self, piece: Piece) -> None:
        """Put all into the modes of a piece."""
        self.span = piece.low, piece.high
        for each, (mode, growth) in zip(self.switching, piece.modes, strict=True):
            each.mode, each.growth = mode, growth

    def look(self, response: Any, t: float, y: Vector) -> Vector:
        """The components of a response at a time and state, in the modes that all is in."""
        q, v = y[: self.n_q], y[self.n_q :]
        if response == "energy":
            stored = [
                one.scale * law.energy(now - one.free) for one, (now, *_) in self._stretched(q, v) for law in one.laws
            ]
            return np.array([sum(stored)])
        ((kind, keys),) = response.items()
        if kind == "member_force":
            acceleration, _ = self.balance(t, y)
            forces = []
            for scale, free, laws, p, end in self.members[keys["group"]]:
                length, rate, row, bias = stretch(p, end, q, v)
                inertial = row @ acceleration + bias
                total = sum(law.force(length - free, rate, t) + law.inertance * inertial for law in laws)
                forces.append(scale * float(total))
            return np.array(forces)
        return self._motion(kind, keys, t, y)

    def _motion(self, kind: str, keys: dict[str, Any], t: float, y: Vector) -> Vector:
        """The components of a response of bodies and joints."""
        q, v = y[: self.n_q], y[self.n_q :]
        if kind in ("displacement", "velocity"):
            x, u, _, _ = (point := self.point(keys["body"], keys["at"])).seen(q, v)
            return x - point.fixed if kind == "displacement" else u
        if kind in ("angle", "angular_velocity"):
            place = 3 * self.names.index(keys["body"]) + 2
            return np.array([(q if kind == "angle" else v)[place]])
        acceleration, lam = self.balance(t, y)
        if kind == "acceleration":
            _, _, jacobian, extra = self.point(keys["body"], keys["at"]).seen(q, v)
            return np.asarray(jacobian @ acceleration + extra)
        first = 0
        for name, kind_of, *_ in self.joints:
            count = 1 if kind_of == "distance" else 2
            if name == keys["joint"]:
                return np.asarray(lam[first : first + count])
            first += count
        raise KeyError(kind)

    def _panels(self, piece: Piece) -> tuple[float, int]:
        """How well panels of an integral are to agree with their halves, and into how many a piece is divided."""
        return AGREE, PANELS

    def _signed(self, response: Any) -> bool:
        """Whether a response is a number with a sign, and no length."""
        return isinstance(response, dict) and ("angle" in response or "angular_velocity" in response)

    def objective(self, response: Any, over_time: str) -> tuple[float, float]:
        """The value, and the largest size that the response has at the places looked at."""
        led = isinstance(response, dict) and "member_force" in response
        signed = self._signed(response)
        power = 2 if over_time == "rms" else 1
        size = total = value = 0.0
        best: list[float] = []
        for piece in self.pieces:
            self._restore(piece)

            def components(t: float, piece: Piece = piece) -> Vector:
                return self.look(response, t, piece(t))

            def g(t: float, components: Look = components) -> float:
                found = components(t)
                return float(found[0]) if signed else length(found, led)

            grid = np.linspace(piece.low, piece.high, 4 + int(LOOKS * (piece.high - piece.low) / self.end))
            seen = np.array([components(t) for t in grid])
            cuts = [] if signed else sorted(kinks(components, grid, seen, led))
            sizes = seen[:, 0] if signed else np.array([length(each, led) for each in seen])
            size = max(size, float(np.abs(sizes).max()))
            if over_time == "final":
                value = float(sizes[-1])
            elif over_time in ("max", "min", "max_abs"):
                at = np.array([g(t) for t in cuts])
                order = np.argsort(np.append(grid, cuts), kind="stable")
                every, values = np.append(grid, cuts)[order], np.append(sizes, at)[order]
                signs = {"max": (1.0,), "min": (-1.0,), "max_abs": (1.0, -1.0)}[over_time]
                best += [highest(g, every, values, sign) for sign in signs]
            else:
                total += integral(lambda t, g=g: g(t) ** power, [piece.low, *cuts, piece.high], *self._panels(piece))  # type: ignore[misc]
        if over_time == "final":
            return value, size
        if best:
            return (-max(best) if over_time == "min" else max(best)), size
        if over_time == "integral":
            return total, size
        return (total / self.end if over_time == "mean" else float(np.sqrt(total / self.end))), size
