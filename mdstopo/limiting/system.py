"""What is left free of the motion of all centres of mass, once members are replaced by free forces.

The centres' coordinates X (2 n,) = (x_1, y_1, x_2, ...) satisfy linear equations C X(t) = d(t) that hold whatever the
members do:

    prescribed motions            a coordinate is a known function;
    joints between bodies that do not turn, or at their centres of mass
                                  a component of X_B - X_A stays what it is at the start;
    directions in which all bodies that are tied to each other move alike, and nothing that is held
                                  momentum changes by loads alone: members between bodies act and react.

All other equations (joints between turning bodies, equations of rotation) are left out, which leaves more motions and
so a lower bound. X = X_known(t) + Z xi(t) with a basis Z of the null space of C, and xi'' is free.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mdstopo.case.arrays import Signal
from mdstopo.case.model import (
    GROUND,
    Case,
    Joint,
    Load,
    LoadCase,
    Motion,
    Table,
)
from mdstopo.general.scene.drives import drives, motion_times
from mdstopo.general.scene.planar_scene import PLANE
from mdstopo.limiting.known import Cubics, Floats, with_second_derivative
from mdstopo.scene.signal_segments import breakpoints, segment_values

#: singular values of C below this share of the largest count as zero: C is made of unit vectors and mass shares
_RANK = 1e-9


@dataclass(frozen=True)
class Row:
    """One equation: vector (2 n,) . X = known, a function (S, 4) in the segments of `System.times`."""

    vector: Floats
    known: Floats


class System:
    """The equations of the translation of all bodies in one load case.

    names: bodies as declared; times (S + 1,): segments in which all known functions are cubic; start, rate (2 n,): X
    and its derivative at the start. angles: body -> angle, of those that cannot turn (ground included).
    more: times that shall be ends of segments too; extra: further equations.
    """

    def __init__(
        self, case: Case, load_case: LoadCase, more: tuple[float, ...] = (), extra: tuple[Row, ...] = ()
    ) -> None:
        self.case, self.load_case = case, load_case
        self.names = tuple(body.name for body in load_case.bodies)
        self.times = breakpoints(load_case, [*motion_times(load_case, PLANE), *more])
        self.start = np.array([value for body in load_case.bodies for value in body.position])
        self.rate = np.array([value for body in load_case.bodies for value in body.velocity])
        self.angles = _unturned(case, load_case)
        self._extra = extra

    @property
    def n(self) -> int:
        """The number of coordinates of the centres of mass."""
        return 2 * len(self.names)

    def at(self, body: str) -> Floats:
        """(2, 2 n): which coordinates are the body's; zero for ground."""
        matrix = np.zeros((2, self.n))
        if body != GROUND:
            first = 2 * self.names.index(body)
            matrix[0, first] = matrix[1, first + 1] = 1.0
        return matrix

    def mass(self, body: str) -> float:
        """The mass of a body (kg)."""
        return float(self.case.body(body).mass)

    @cached_property
    def _solved(self) -> tuple[Cubics, Floats]:
        rows = [*self.rows(), *self._extra]
        segments = len(self.times) - 1
        if not rows:
            return Cubics(self.times, np.zeros((segments, self.n, 4))), np.eye(self.n)
        matrix = np.array([row.vector for row in rows])
        known = np.stack([row.known for row in rows], axis=1)
        u, s, vt = np.linalg.svd(matrix, full_matrices=len(matrix) < self.n)
        rank = int((s > _RANK * s[0]).sum())
        inverse = vt[:rank].T @ (u[:, :rank] / s[:rank]).T
        return Cubics(self.times, known).mapped(inverse), vt[rank:].T

    @property
    def known(self) -> Cubics:
        """X_known: 2 n functions of time, the part of the coordinates that is known."""
        return self._solved[0]

    @property
    def free(self) -> Floats:
        """Z (2 n, f): the directions in which coordinates are free."""
        return self._solved[1]

    def rows(self) -> Iterator[Row]:
        """The linear equations C X = d that joints and motions impose on the coordinates."""
        yield from self._driven()
        for joint in self.case.joints:
            for vector in self.joint_vectors(joint):
                yield Row(vector, self._constant(float(vector @ self.start)))
        yield from self._floating()

    def joint_vectors(self, joint: Joint) -> list[Floats]:
        """(2 n,) each: the components of the coordinates X that a joint keeps as they are at the start."""
        first, second = joint.bodies
        between = self.at(second) - self.at(first)
        if joint.slide is not None:
            if first not in self.angles:
                return []
            axis = turned(joint.slide, self.angles[first])
            return [np.array([-axis[1], axis[0]]) @ between]
        if joint.keeps_point and all(
            name in self.angles or math.hypot(*at) == 0.0
            for name, at in zip(joint.bodies, (joint.at_first, joint.at_second), strict=True)
        ):
            return [between[0], between[1]]
        return []

    def load_on(self, body: str, axis: int) -> Floats | None:
        """(S, 2) the load, gravity included, after each segment's start, and its slope, N.

        None where a load turns with a body that can turn.
        """
        index = self.names.index(body)
        total = np.zeros((len(self.times) - 1, 2))
        total[:, 0] = self.load_case.gravity[axis] * self.load_case.bodies[index].mass
        for load in self.loads(body):
            if load.frame == "global":
                total += segment_values(load.force[axis], self.times)
            elif body in self.angles:
                c, s = math.cos(self.angles[body]), math.sin(self.angles[body])
                first, second = (c, -s) if axis == 0 else (s, c)
                total += first * segment_values(load.force[0], self.times)
                total += second * segment_values(load.force[1], self.times)
            else:
                return None
        return total

    def loads(self, body: str) -> list[Load]:
        """The loads on a body that can be a force."""
        return [load for load in self.load_case.loads if load.body == body and any(_acts(part) for part in load.force)]

    def driven_axes(self, body: str) -> list[int]:
        """Which of the coordinates x (0) and y (1) of a body are prescribed."""
        motion = _motion(self.load_case, body)
        return [] if motion is None else [axis for axis, part in enumerate((motion.x, motion.y)) if part is not None]

    def _constant(self, value: float) -> Floats:
        known = np.zeros((len(self.times) - 1, 4))
        known[:, 0] = value
        return known

    def _driven(self) -> Iterator[Row]:
        q0 = np.array([value for body in self.load_case.bodies for value in (*body.position, body.angle)])
        v0 = np.array([value for body in self.load_case.bodies for value in (*body.velocity, body.angular_velocity)])
        indices, cubics = drives(self.load_case, self.times, PLANE, q0, v0)[:2]
        cubics[:, :, 0] += q0[indices]
        for i, d in enumerate(indices.tolist()):
            if d % 3 < 2:
                yield Row(self.at(self.names[d // 3])[d % 3], cubics[:, i])

    def _floating(self) -> Iterator[Row]:
        """Directions w (2 n,) in which nothing but loads works on the bodies: w . M X'' = w . loads.

        Members and joints act on two bodies with opposite forces, so they do no work where both move alike; a slide
        acts only across its axis. With a load that turns with its body, the body has to rest.
        """
        held = [
            self.at(self.names[d // 2])[d % 2] for d in range(self.n) if d % 2 in self.driven_axes(self.names[d // 2])
        ]
        for pair in _ties(self.case):
            held += [*(self.at(pair[1]) - self.at(pair[0]))]
        for joint in self.case.joints:
            slides = joint.slide is not None and joint.bodies[0] in self.angles
            held += self.joint_vectors(joint) if slides else [*(self.at(joint.bodies[1]) - self.at(joint.bodies[0]))]
        loads: list[Floats] = []
        for name in self.names:
            own = [self.load_on(name, axis) for axis in (0, 1)]
            known = [each for each in own if each is not None]
            if len(known) < 2:
                held += [*self.at(name)]
                known = [np.zeros((len(self.times) - 1, 2))] * 2
            loads += known
        masses = np.repeat([self.mass(name) for name in self.names], 2)
        for w in _null_space(np.array(held).reshape(-1, self.n)).T:
            total = float(np.abs(w) @ masses)
            vector = w * masses / total
            second: Floats = np.tensordot(w, np.array(loads), 1) / total
            start, rate = np.array([vector @ self.start]), np.array([vector @ self.rate])
            yield Row(vector, with_second_derivative(self.times, second[:, None], start, rate).coefficients[:, 0])


def _null_space(matrix: Floats) -> Floats:
    """(n, f): an orthonormal basis."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    _, s, vt = np.linalg.svd(matrix, full_matrices=len(matrix) < matrix.shape[1])
    return np.asarray(vt[int((s > _RANK * s[0]).sum()) :].T)


def _ties(case: Case) -> Iterator[tuple[str, str]]:
    """Pairs of bodies between which something other than a joint can transmit forces."""
    for group in case.members:
        if len(group):
            yield group.body_from, group.body_to
    for bushing in case.bushings:
        yield bushing.bodies
    for contact in case.contacts:
        yield contact.body, contact.edge_body


def turned(vector: tuple[float, float], angle: float) -> Floats:
    """A vector in coordinates of a body with that angle, in global axes (2,)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]])


def _acts(signal: Signal) -> bool:
    return bool(np.any(signal.values)) if isinstance(signal, Table) else signal != 0.0


def _motion(load_case: LoadCase, body: str) -> Motion | None:
    return next((motion for motion in load_case.motions if motion.body == body), None)


def _unturned(case: Case, load_case: LoadCase) -> dict[str, float]:
    """The bodies that cannot turn, and their angles.

    Ground, those whose angle is prescribed as constant, and those that a slide or a fixed joint ties to one of these.
    """
    found = {GROUND: 0.0}
    for body in load_case.bodies:
        motion = _motion(load_case, body.name)
        if motion is not None and motion.angle is not None and body.angular_velocity == 0.0:
            kind, signal = motion.angle.kind, motion.angle.signal
            rows = signal.values if isinstance(signal, Table) else np.array([signal])
            if np.ptp(rows) == 0.0 if kind == "position" else not np.any(rows):
                found[body.name] = float(rows.flat[0]) if kind == "position" else body.angle
    angle = {body.name: body.angle for body in load_case.bodies} | {GROUND: 0.0}
    grown = True
    while grown:
        grown = False
        for joint in case.joints:
            if joint.keeps_angle and sum(name in found for name in joint.bodies) == 1:
                found |= {name: angle[name] for name in joint.bodies}
                grown = True
    return found
