"""A second model of planar scenes, from the case document alone: plain NumPy and SciPy's DOP853.

Written from the format's description and nothing of the package: positions in global axes, one joint or member after
the other, accelerations and multipliers from one dense system of equations, motion at tolerances of 1e-12. Joints are
imposed on accelerations; what they drift by in so short a motion is of the order of that tolerance. Bodies begin
unturned. It knows what `hunt_scenes` draws; anything else is a KeyError.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize_scalar

Vector = np.ndarray[Any, np.dtype[np.float64]]
QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
#: tolerances of the motion; panels of integrals at first, and how well they are to agree with their halves
RTOL, ATOL, PANELS, AGREE, DEPTH = 1e-12, 1e-14, 24, 1e-11, 22
#: places of a motion at which extremes are looked for before they are refined
LOOKS = 500


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
    length = float(np.hypot(*d))
    e = d / length
    along = float(e @ rate)
    return length, along, e @ (jb - ja), float((rate @ rate - along**2) / length + e @ (bb - ba))


class Law:
    """Force and stored energy of one law at elongation x, rate r and time t; an inerter's force is in the mass."""

    def __init__(self, keys: dict[str, Any]) -> None:
        self.kind, self.keys = keys["type"], keys
        if self.kind == "curve":
            x, f = np.array(keys["curve"]).T
            self.ends, self.inside = (x[0], x[-1]), PchipInterpolator(x, f)
            self.slope, self.whole = self.inside.derivative(), self.inside.antiderivative()

    def force(self, x: float, r: float, t: float) -> float:
        """N, tension positive."""
        k = self.keys
        match self.kind:
            case "spring":
                return float(k["stiffness"] * x + k.get("damping", 0.0) * r + k.get("preload", 0.0))
            case "gap":
                side = 1.0 if k.get("side", "tension") == "tension" else -1.0
                y = side * x - k["gap"]
                if y < 0.0:
                    return 0.0
                pull = k["stiffness"] * y + k.get("damping", 0.0) * side * r
                return float(side * (max(pull, 0.0) if k.get("clip", False) else pull))
            case "cubic":
                return float(k["stiffness"] * x + k["cubic"] * x**3)
            case "curve":
                end = min(max(x, self.ends[0]), self.ends[1])
                return float(self.inside(end) + (x - end) * self.slope(end))
            case "pulse":
                return float(k["peak"] * np.exp(-k["rate"] * (t - k["time"]) ** 2))
            case "table":
                return float(np.interp(t, *np.array(k["table"]).T))
            case "actuator":
                demand = k["proportional"] * (x - k["target"]) + k["derivative"] * r
                return float(min(max(demand, -k.get("limit", np.inf)), k.get("limit", np.inf)))
            case "inerter":
                return 0.0
        raise KeyError(self.kind)

    def energy(self, x: float) -> float:
        """J."""
        k = self.keys
        match self.kind:
            case "spring":
                return float(0.5 * k["stiffness"] * x * x)
            case "gap":
                y = max((x if k.get("side", "tension") == "tension" else -x) - k["gap"], 0.0)
                return float(0.5 * k["stiffness"] * y * y)
            case "cubic":
                return float(0.5 * k["stiffness"] * x**2 + 0.25 * k["cubic"] * x**4)
            case "curve":
                end = min(max(x, self.ends[0]), self.ends[1])
                s = x - end
                return float(self.whole(end) - self.whole(0.0) + s * (self.inside(end) + 0.5 * s * self.slope(end)))
        return 0.0

    @property
    def inertance(self) -> float:
        """kg."""
        return float(self.keys["inertance"]) if self.kind == "inerter" else 0.0


class Model:
    """A scene with a design alpha (N,): `solve`, then `objectives`."""

    def __init__(self, document: dict[str, Any], alpha: Vector) -> None:
        self.document = document
        bodies = document["bodies"]
        self.names = list(bodies)
        self.n = 3 * len(bodies)
        self.mass = np.array([m for b in bodies.values() for m in (b["mass"], b["mass"], b["inertia"])])
        self.q0 = np.array([c for b in bodies.values() for c in (*b["position"], 0.0)])
        self.v0 = np.array([c for b in bodies.values() for c in (*b["velocity"], b["angular_velocity"])])
        self.end = float(document["time"]["end"])
        self.weight = self.mass * np.tile([*document["gravity"], 0.0], len(bodies))
        self.members: dict[str, list[tuple[float, float, list[Law], Point, Point]]] = {}
        first = 0
        for name, group in document["members"].items():
            laws = [Law(keys) for keys in (group["law"] if isinstance(group["law"], list) else [group["law"]])]
            p, q = (document["points"][group[key]] for key in ("from", "to"))
            self.members[name] = own = []
            for i, (a, b) in enumerate(zip(p["grid"]["list"], q["grid"]["list"], strict=True)):
                scale = float(alpha[first + i]) ** document["design"]["power"]
                ends = self.point(p["body"], a), self.point(q["body"], b)
                own.append((scale, float(np.hypot(*np.subtract(b, a))), laws, *ends))
            first += len(own)
        self.joints = [(joint["name"], joint["type"], *self._joint(joint)) for joint in document.get("joints", [])]
        self.driven = {
            3 * self.names.index(motion["body"]) + i: np.array(motion[key]["acceleration"]["table"]).T
            for motion in document.get("motions", [])
            for i, key in enumerate(("x", "y", "angle"))
        }

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

    def balance(self, t: float, y: Vector) -> tuple[Vector, Vector]:
        """q'' (n,) and the multipliers."""
        q, v = y[: self.n], y[self.n :]
        mass, force = np.diag(self.mass), self.weight.copy()
        for own in self.members.values():
            for scale, free, laws, a, b in own:
                length, rate, row, bias = stretch(a, b, q, v)
                for law in laws:
                    mass += scale * law.inertance * np.outer(row, row)
                    force -= scale * (law.force(length - free, rate, t) + law.inertance * bias) * row
        for load in self.document.get("loads", []):
            force[3 * self.names.index(load["body"]) + 2] += np.interp(t, *np.array(load["moment"]["table"]).T)
        rows, right = self.rows(q, v, t)
        m = len(rows)
        matrix = np.block([[mass, rows.T], [rows, np.zeros((m, m))]])
        found = np.linalg.solve(matrix, np.concatenate([force, right]))
        return found[: self.n], found[self.n :]

    def breaks(self) -> list[float]:
        """Times at which something given has a kink."""
        tables = [table[0] for table in self.driven.values()]
        tables += [np.array(load["moment"]["table"])[:, 0] for load in self.document.get("loads", [])]
        laws = [law for own in self.members.values() for member in own[:1] for law in member[2]]
        tables += [np.array(law.keys["table"])[:, 0] for law in laws if law.kind == "table"]
        return sorted({0.0, self.end, *(float(t) for table in tables for t in table if 0.0 < t < self.end)})

    def solve(self) -> None:
        """The motion, as pieces (start, end, dense solution)."""
        y = np.concatenate([self.q0, self.v0])
        self.pieces = []
        for low, high in pairwise(self.breaks()):
            found = solve_ivp(
                lambda t, y: np.concatenate([y[self.n :], self.balance(t, y)[0]]), (low, high), y, method="DOP853",
                rtol=RTOL, atol=ATOL, max_step=self.end / 60.0, dense_output=True,
            )  # fmt: skip
            self.pieces.append((low, high, found.sol))
            y = found.y[:, -1]

    def look(self, response: Any, t: float, y: Vector) -> float:
        """A response at a time and state."""
        q, v = y[: self.n], y[self.n :]
        if response == "energy":
            return sum(
                scale * law.energy(stretch(a, b, q, v)[0] - free)
                for own in self.members.values()
                for scale, free, laws, a, b in own
                for law in laws
            )
        ((kind, keys),) = response.items()
        if kind in ("displacement", "velocity"):
            x, u, _, _ = (point := self.point(keys["body"], keys["at"])).seen(q, v)
            return float(np.hypot(*(x - point.fixed if kind == "displacement" else u)))
        if kind in ("angle", "angular_velocity"):
            return float((q if kind == "angle" else v)[3 * self.names.index(keys["body"]) + 2])
        acceleration, lam = self.balance(t, y)
        if kind == "acceleration":
            _, _, jacobian, extra = self.point(keys["body"], keys["at"]).seen(q, v)
            return float(np.hypot(*(jacobian @ acceleration + extra)))
        if kind == "member_force":
            largest = 0.0
            for scale, free, laws, p, end in self.members[keys["group"]]:
                length, rate, row, bias = stretch(p, end, q, v)
                force = sum(
                    law.force(length - free, rate, t) + law.inertance * (row @ acceleration + bias) for law in laws
                )
                largest = max(largest, abs(scale * float(force)))
            return largest
        first = 0
        for name, kind_of, *_ in self.joints:
            count = 1 if kind_of == "distance" else 2
            if name == keys["joint"]:
                return float(np.linalg.norm(lam[first : first + count]))
            first += count
        raise KeyError(kind)

    def objective(self, response: Any, over_time: str) -> tuple[float, float]:
        """The value, and the largest size that the response has at the places looked at."""

        def along(sol: Callable[[float], Vector], power: int = 1) -> Callable[[float], float]:
            return lambda t: self.look(response, t, sol(t)) ** power

        g = [along(sol) for _, _, sol in self.pieces]
        spans = [(low, high) for low, high, _ in self.pieces]
        grids = [np.linspace(low, high, 2 + int(LOOKS * (high - low) / self.end)) for low, high in spans]
        values = [np.array([f(t) for t in grid]) for f, grid in zip(g, grids, strict=True)]
        size = max(float(np.abs(each).max()) for each in values)
        if over_time == "final":
            return float(values[-1][-1]), size
        if over_time in ("max", "min", "max_abs"):
            signs = {"max": (1.0,), "min": (-1.0,), "max_abs": (1.0, -1.0)}[over_time]
            best = max(
                highest(f, grid, seen, sign) for f, grid, seen in zip(g, grids, values, strict=True) for sign in signs
            )
            return (-best if over_time == "min" else best), size
        power = 2 if over_time == "rms" else 1
        total = sum(integral(along(sol, power), low, high) for low, high, sol in self.pieces)
        if over_time == "integral":
            return total, size
        return (total / self.end if over_time == "mean" else float(np.sqrt(total / self.end))), size


def highest(f: Callable[[float], float], grid: Vector, seen: Vector, sign: float) -> float:
    """The largest value of sign f over a grid (K,) with values seen (K,), refined about those that come near."""
    values = sign * seen
    best = float(np.max(values))
    near = np.flatnonzero(values >= best - 0.02 * max(abs(best), float(np.ptp(values))))
    for i in near.tolist():
        low, high = max(i - 1, 0), min(i + 1, len(grid) - 1)
        if values[i] < values[low] or values[i] < values[high]:
            continue
        found = minimize_scalar(
            lambda t: -sign * f(t), bounds=(grid[low], grid[high]), method="bounded", options={"xatol": 1e-12}
        )
        best = max(best, -float(found.fun))
    return best


def integral(f: Callable[[float], float], low: float, high: float) -> float:
    """By Gauss-Legendre panels that are halved where they do not agree with their halves."""
    nodes, weights = np.polynomial.legendre.leggauss(6)

    def panel(a: float, b: float) -> float:
        middle, half = 0.5 * (a + b), 0.5 * (b - a)
        return half * float(sum(w * f(middle + half * x) for x, w in zip(nodes, weights, strict=True)))

    edges = np.linspace(low, high, PANELS + 1)
    left = [(a, b, panel(a, b), 0) for a, b in pairwise(edges)]
    whole = sum(abs(rough) for _, _, rough, _ in left)
    total = 0.0
    while left:
        a, b, rough, depth = left.pop()
        middle = 0.5 * (a + b)
        one, two = panel(a, middle), panel(middle, b)
        if abs(one + two - rough) <= AGREE * whole or depth == DEPTH:
            total += one + two
        else:
            left += [(a, middle, one, depth + 1), (middle, b, two, depth + 1)]
    return total
