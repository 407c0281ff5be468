"""The equations of motion as scalar expressions of CasADi.

Scalars (SX) are what CasADi compiles best: written as vectors (MX), or as one function called for each group, the
compiled ring took three times as long. Lengths need few operations a member because members meet in few points.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from benchmarks.peers.problem import GROUND, Floats, Indices, Problem

Scalar = Any


class Model(NamedTuple):
    """Expressions in the state y (6 B: coordinates, then velocities), multipliers z (2 J) and alpha (N).

    rate: y', multipliers eliminated; energy: of the springs; power: its time derivative; free: y' with the multipliers
    as they are; misfit: what the accelerations then miss the hinges by (without hinges: nothing).
    """

    y: Scalar
    z: Scalar
    alpha: Scalar
    rate: Scalar
    energy: Scalar
    power: Scalar
    free: Scalar
    misfit: Scalar


def model_of(problem: Problem) -> Model:
    """The expressions for a problem."""
    n, rows = 3 * problem.bodies, 2 * len(problem.hinges)
    y, z, alpha = ca.SX.sym("y", 2 * n), ca.SX.sym("z", rows), ca.SX.sym("alpha", problem.members)
    x, v = y[:n], y[n:]
    pull, energy = _members(problem, x, alpha)
    inverse = 1.0 / ca.DM(problem.mass.ravel())
    force = pull + ca.DM(problem.force.ravel())
    free, misfit, acceleration = inverse * force, ca.SX(0, 1), inverse * force
    if rows:
        gap = ca.vertcat(*_gaps(problem, x))
        slope = ca.jacobian(gap, x)
        wanted = -ca.jtimes(ca.jtimes(gap, x, v), x, v)
        # sparse, factorised symbol by symbol
        factors = ca.ldl(slope @ ca.diag(inverse) @ slope.T)
        held = ca.ldl_solve(slope @ (inverse * force) - wanted, *factors)
        acceleration = inverse * (force - slope.T @ held)
        free = inverse * (force - slope.T @ z)
        misfit = slope @ free - wanted
    # what the springs pull is minus the slope of their energy
    power = -ca.dot(pull, v)
    return Model(y, z, alpha, ca.vertcat(v, acceleration), energy, power, ca.vertcat(v, free), misfit)


def _members(problem: Problem, x: Scalar, alpha: Scalar) -> tuple[Scalar, Scalar]:
    """Forces (3 B) of the springs on the bodies, and their energy."""
    pull: list[Scalar] = [ca.SX(0.0) for _ in range(3 * problem.bodies)]
    energy = ca.SX(0.0)
    for bodies, part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        (p, at_p), (q, at_q) = _points(problem.p[part]), _points(problem.q[part])
        ends = [[_arm(x, body, point) for point in points] for body, points in zip(bodies, (p, q), strict=True)]
        sums = [[[ca.SX(0.0), ca.SX(0.0)] for _ in points] for points in (p, q)]
        for i, (one, two) in enumerate(zip(at_p.tolist(), at_q.tolist(), strict=True), start=part.start):
            dx = ends[1][two][0] - ends[0][one][0]
            dy = ends[1][two][1] - ends[0][one][1]
            length, natural = ca.sqrt(dx * dx + dy * dy), float(problem.length[i])
            stiffness = float(problem.stiffness[i]) * alpha[i]
            share = stiffness * (1.0 - natural / length)
            energy += stiffness * (length - natural) ** 2
            for side, k, sign in ((0, one, 1.0), (1, two, -1.0)):
                sums[side][k][0] += sign * share * dx
                sums[side][k][1] += sign * share * dy
        for body, own, forces in zip(bodies, ends, sums, strict=True):
            if body != GROUND:
                for (_, _, rx, ry), (fx, fy) in zip(own, forces, strict=True):
                    pull[3 * body] += fx
                    pull[3 * body + 1] += fy
                    pull[3 * body + 2] += rx * fy - ry * fx
    return ca.vertcat(*pull), 0.5 * energy


def _points(ends: Floats) -> tuple[Floats, Indices]:
    """The different points among the ends of members, and which of them each member has."""
    points, index = np.unique(ends, axis=0, return_inverse=True)
    return points, index.ravel()


def _arm(x: Scalar, body: int, point: Floats) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """A point of a body in global coordinates, and its way from the centre of mass."""
    px, py = map(float, point)
    if body == GROUND:
        return ca.SX(px), ca.SX(py), ca.SX(px), ca.SX(py)
    c, s = ca.cos(x[3 * body + 2]), ca.sin(x[3 * body + 2])
    rx, ry = c * px - s * py, s * px + c * py
    return x[3 * body] + rx, x[3 * body + 1] + ry, rx, ry


def _gaps(problem: Problem, x: Scalar) -> list[Scalar]:
    """Point on the second body less that on the first, of every hinge."""
    found: list[Scalar] = []
    for bodies, points in zip(problem.hinges.tolist(), problem.at, strict=True):
        one, two = (_arm(x, body, point) for body, point in zip(bodies, points, strict=True))
        found += [two[0] - one[0], two[1] - one[1]]
    return found
