"""Accelerations and reactions of bodies in space by other means than mdstopo's: global axes, multipliers, numpy.

Every joint is a list of scalar functions of points and directions that ride on bodies; rows of its Jacobian are what
its rate is at unit velocities.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

#: rows of each joint: `point` meets along x, y and z, `plane` along a direction of the first body's, `square` keeps a
#: direction of the first body's perpendicular to one of the second's
KINDS = {
    "spherical": "point",
    "revolute": "point hinge",
    "universal": "point cross",
    "prismatic": "slide hinge roll",
    "cylindrical": "slide hinge",
    "planar": "plane hinge",
    "fixed": "point triad",
    "distance": "link",
}


def orientation(given) -> Rotation:
    """The turn that the case's `orientation` states."""
    if given is None:
        return Rotation.identity()
    if isinstance(given, list):
        turn = Rotation.identity()
        for each in given:
            turn = orientation(each) * turn
        return turn
    if "quaternion" in given:
        return Rotation.from_quat(np.roll(given["quaternion"], -1))
    axis = np.array(given["axis"], dtype=float)
    return Rotation.from_rotvec(given["angle"] * axis / np.linalg.norm(axis))


def perpendicular(axis):
    """Two directions that are perpendicular to an axis and to each other."""
    axis = np.array(axis, dtype=float) / np.linalg.norm(axis)
    one = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    one /= np.linalg.norm(one)
    return one, np.cross(axis, one)


class Scene:
    """Bodies and joints of a case's content (a mapping), with loads and member forces that the caller gives."""

    def __init__(self, content) -> None:
        bodies = content["bodies"]
        self.names = list(bodies)
        self.masses = np.array([each["mass"] for each in bodies.values()])
        tensors = [np.array(each["inertia"], dtype=float) for each in bodies.values()]
        self.inertias = [np.diag(each) if each.ndim == 1 else each for each in tensors]
        self.places = np.array([each["position"] for each in bodies.values()], dtype=float)
        self.turns = np.array([orientation(each.get("orientation")).as_matrix() for each in bodies.values()])
        self.gravity = np.array(content.get("gravity", [0.0, 0.0, 0.0]))
        self.rows: list[tuple] = []
        self.of_joint: list[int] = []
        for number, joint in enumerate(content.get("joints", [])):
            self._add_joint(joint, number)

    def _number(self, name: str) -> int:
        return -1 if name == "ground" else self.names.index(name)

    def point(self, body: int, at):
        """A global point at the start, in the body's axes."""
        return np.array(at) if body < 0 else self.turns[body].T @ (np.array(at) - self.places[body])

    def direction(self, body: int, axis):
        """A global direction at the start, in the body's axes."""
        unit = np.array(axis, dtype=float) / np.linalg.norm(axis)
        return unit if body < 0 else self.turns[body].T @ unit

    def _add_joint(self, joint, number: int) -> None:
        one, two = (self._number(name) for name in joint["bodies"])
        at = joint.get("at", self.places[two if two >= 0 else one])
        ends = at if joint["type"] == "distance" else (at, at)
        s, c = self.point(one, ends[0]), self.point(two, ends[1])
        axis = joint.get("axis", joint.get("normal", [0, 0, 1]))
        across = perpendicular(axis)
        rows: list[tuple] = []

        def square(n, m):
            rows.append(("square", one, self.direction(one, n), two, self.direction(two, m)))

        def plane(n):
            rows.append(("plane", one, s, two, c, self.direction(one, n)))

        for part in KINDS[joint["type"]].split():
            if part == "point":
                rows += [("point", one, s, two, c, e) for e in np.eye(3)]
            elif part == "hinge":
                square(across[0], axis)
                square(across[1], axis)
            elif part == "cross":
                square(*joint["axes"])
            elif part == "slide":
                plane(across[0])
                plane(across[1])
            elif part == "roll":
                square(*across)
            elif part == "plane":
                plane(axis)
            elif part == "triad":
                for k in range(3):
                    square(np.eye(3)[k], np.eye(3)[(k + 1) % 3])
            else:
                rows.append(("link", one, s, two, c))
        self.rows += rows
        self.of_joint += [number] * len(rows)

    def carried(self, body: int, local, x, turns, v, omega):
        """A point that a body carries, its velocity, and its acceleration where the body's own are zero."""
        if body < 0:
            return local, np.zeros(3), np.zeros(3)
        arm = turns[body] @ local
        rate = np.cross(omega[body], arm)
        return x[body] + arm, v[body] + rate, np.cross(omega[body], rate)

    def value(self, row, x, turns, v, omega):
        """Phi, its rate, and its second rate without accelerations."""
        kind, one, s, two, c = row[:5]
        if kind == "square":
            still = np.zeros_like(x)
            a, a_rate, a_push = self.carried(one, s, still, turns, still, omega)
            b, b_rate, b_push = self.carried(two, c, still, turns, still, omega)
            return a @ b, a_rate @ b + a @ b_rate, a_push @ b + 2.0 * a_rate @ b_rate + a @ b_push
        p, p_rate, p_push = self.carried(one, s, x, turns, v, omega)
        q, q_rate, q_push = self.carried(two, c, x, turns, v, omega)
        d, rate, push = q - p, q_rate - p_rate, q_push - p_push
        if kind == "point":
            return row[5] @ d, row[5] @ rate, row[5] @ push
        if kind == "plane":
            still = np.zeros_like(x)
            n, n_rate, n_push = self.carried(one, row[5], still, turns, still, omega)
            return n @ d, n_rate @ d + n @ rate, n_push @ d + 2.0 * n_rate @ rate + n @ push
        length = np.linalg.norm(d)
        along = d @ rate / length
        return length, along, (rate @ rate - along**2 + d @ push) / length

    def slopes(self, row, x, turns):
        """The row of the Jacobian over (v, omega) of all bodies, global axes."""
        out = np.zeros((len(x), 6))
        for body in {row[1], row[3]} - {-1}:
            for k in range(6):
                v, omega = np.zeros_like(x), np.zeros_like(x)
                (v if k < 3 else omega)[body, k % 3] = 1.0
                out[body, k] = self.value(row, x, turns, v, omega)[1]
        return out.ravel()

    def violations(self, x, turns, v, omega):
        """Phi by how much it has changed since the start, and its rate."""
        now = np.array([self.value(row, x, turns, v, omega)[:2] for row in self.rows])
        still = np.zeros_like(x)
        first = [self.value(row, self.places, self.turns, still, still)[0] for row in self.rows]
        return now[:, 0] - first, now[:, 1]

    def accelerations(self, x, turns, v, omega, forces):
        """(n_bodies, 6) for applied forces and moments (n_bodies, 6), and the wrench of each joint on its first body.

        Wrenches (n_joints, 6) are about the joint's own point of that body; of ground: NaN.
        """
        n = len(x)
        mass = np.zeros((6 * n, 6 * n))
        push = np.array(forces, dtype=float).reshape(n, 6)
        for b in range(n):
            inertia = turns[b] @ self.inertias[b] @ turns[b].T
            mass[6 * b : 6 * b + 3, 6 * b : 6 * b + 3] = self.masses[b] * np.eye(3)
            mass[6 * b + 3 : 6 * b + 6, 6 * b + 3 : 6 * b + 6] = inertia
            push[b, :3] += self.masses[b] * self.gravity
            push[b, 3:] -= np.cross(omega[b], inertia @ omega[b])
        rows = np.array([self.slopes(row, x, turns) for row in self.rows]).reshape(-1, 6 * n)
        bias = np.array([self.value(row, x, turns, v, omega)[2] for row in self.rows])
        free = np.linalg.solve(mass, push.ravel())
        yields = np.linalg.solve(mass, rows.T)
        pulls = np.linalg.lstsq(rows @ yields, -(bias + rows @ free), rcond=1e-10)[0]
        wrenches = np.full((max(self.of_joint, default=-1) + 1, 6), np.nan)
        for number in range(len(wrenches)):
            mine = [i for i, owner in enumerate(self.of_joint) if owner == number]
            body = self.rows[mine[0]][1]
            if body < 0:
                continue
            wrench = sum(pulls[i] * rows[i, 6 * body : 6 * body + 6] for i in mine)
            spot = next(self.rows[i][2] for i in mine if self.rows[i][0] != "square")
            wrench[3:] -= np.cross(turns[body] @ spot, wrench[:3])
            wrenches[number] = wrench
        return (free + yields @ pulls).reshape(n, 6), wrenches


def states(q, v):
    """Places, turns (matrices), velocities and turning rates of one stored state."""
    by_body = q.reshape(-1, 7)
    turns = Rotation.from_quat(np.roll(by_body[:, 3:], -1, axis=1)).as_matrix()
    rates = v.reshape(-1, 6)
    return by_body[:, :3], turns, rates[:, :3], rates[:, 3:]
