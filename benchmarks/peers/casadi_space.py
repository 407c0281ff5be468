"""CasADi in space, with multipliers of the joints eliminated.

As scalar expressions for CVODES and its adjoint; or in fixed steps.
"""

from typing import Any

import casadi as ca
import numpy as np

from benchmarks.peers.casadi_model import Model
from benchmarks.peers.casadi_sundials import objective_of
from benchmarks.peers.problem import GROUND, Floats, Indices
from benchmarks.peers.space_problem import SpatialProblem
from benchmarks.peers.table import Objective

Scalar = Any


def make(problem: SpatialProblem, tolerance: float = 1e-8, compiled: bool = False, steps: int = 0) -> Objective:
    """As the table says. compiled: by a C compiler, which takes minutes, with CVODES many.

    steps: above 0, so many fixed ones in place of CVODES (`casadi_space_steps`).
    """
    start = np.concatenate([problem.start.ravel(), problem.turn.ravel(), np.zeros(6 * problem.bodies)])
    if steps > 0:
        from benchmarks.peers.casadi_space_steps import objective_of_steps

        return objective_of_steps(problem, start, steps, compiled)
    return objective_of(problem, model_of(problem), start, tolerance, "cvodes", compiled)


def model_of(problem: SpatialProblem) -> Model:
    """The expressions of a state of 13 B: places, quaternions, velocities, turning in body axes.

    There are none with multipliers as unknowns.
    """
    count = problem.bodies
    y, alpha = ca.SX.sym("y", 13 * count), ca.SX.sym("alpha", problem.members)
    turns = _turns(problem, y)
    v, w = y[7 * count : 10 * count], y[10 * count :]
    pulls, energy = _members(problem, y, turns, alpha)
    # what the springs pull is minus the slope of their energy
    power = -sum(
        ca.dot(pull[:3], v[3 * b : 3 * b + 3]) + ca.dot(turns[b].T @ pull[3:], w[3 * b : 3 * b + 3])
        for b, pull in enumerate(pulls)
    )
    none = ca.SX(0, 1)
    return Model(y, none, alpha, accelerations_of(problem, y, pulls), energy, power, none, none)


def _turns(problem: SpatialProblem, y: Scalar) -> list[Scalar]:
    count = problem.bodies
    return [rotation_of(y[3 * count + 4 * b : 3 * count + 4 * b + 4]) for b in range(count)]


def accelerations_of(problem: SpatialProblem, y: Scalar, pulls: list[Scalar]) -> Scalar:
    """The rate of a state y (13 B) under forces and moments (6,) of the members on every body, in global axes."""
    count, turns = problem.bodies, _turns(problem, y)
    v, w = y[7 * count : 10 * count], y[10 * count :]
    total = [ca.SX(ca.DM(force)) + pull for force, pull in zip(problem.force, pulls, strict=True)]
    e_rates, forces = [], []
    for b, turn in enumerate(turns):
        e, spin = y[3 * count + 4 * b : 3 * count + 4 * b + 4], w[3 * b : 3 * b + 3]
        vector = e[1:]
        e_rates += [-0.5 * ca.dot(vector, spin), 0.5 * (e[0] * spin + ca.cross(vector, spin))]
        inertia = ca.DM(problem.inertia[b])
        forces += [total[b][:3], turn.T @ total[b][3:] - ca.cross(spin, inertia @ spin)]
    force = ca.vertcat(*forces)
    inverse = ca.diagcat(*(
        part for b in range(count)
        for part in (ca.DM.eye(3) / problem.mass[b], ca.DM(np.linalg.inv(problem.inertia[b])))
    ))  # fmt: skip
    ahead = inverse @ force
    if len(problem.hinges):
        rows, wanted = _held(problem, turns, w)
        factors = ca.ldl(rows @ inverse @ rows.T)
        ahead = inverse @ (force - rows.T @ ca.ldl_solve(rows @ ahead - wanted, *factors))
    by_body = [ahead[6 * b : 6 * b + 6] for b in range(count)]
    return ca.vertcat(v, *e_rates, *(each[:3] for each in by_body), *(each[3:] for each in by_body))


def rotation_of(e: Scalar) -> Scalar:
    """The matrix of a unit quaternion."""
    across = ca.skew(e[1:])
    return ca.SX.eye(3) + 2.0 * e[0] * across + 2.0 * across @ across


def _members(problem: SpatialProblem, y: Scalar, turns: list[Scalar], alpha: Scalar) -> tuple[list[Scalar], Scalar]:
    """Forces and moments (6,) of the springs on every body, and their energy."""
    total = [ca.SX.zeros(6) for _ in range(problem.bodies)]
    energy = ca.SX(0.0)
    for bodies, part in zip(problem.groups.tolist(), problem.slices(), strict=True):
        (p, at_p), (q, at_q) = _points(problem.p[part]), _points(problem.q[part])
        arms = [[_arm(turns, body, point) for point in points] for body, points in zip(bodies, (p, q), strict=True)]
        places = [ca.SX.zeros(3) if body == GROUND else y[3 * body : 3 * body + 3] for body in bodies]
        ends = [[place + arm for arm in own] for place, own in zip(places, arms, strict=True)]
        sums = [[ca.SX.zeros(3) for _ in points] for points in (p, q)]
        for i, (one, two) in enumerate(zip(at_p.tolist(), at_q.tolist(), strict=True), start=part.start):
            d = ends[1][two] - ends[0][one]
            length, natural = ca.sqrt(ca.dot(d, d)), float(problem.length[i])
            stiffness = float(problem.stiffness[i]) * alpha[i]
            energy += 0.5 * stiffness * (length - natural) ** 2
            pull = stiffness * (1.0 - natural / length) * d
            sums[0][one] += pull
            sums[1][two] -= pull
        for body, own, pulls in zip(bodies, arms, sums, strict=True):
            if body != GROUND:
                for arm, pull in zip(own, pulls, strict=True):
                    total[body] += ca.vertcat(pull, ca.cross(arm, pull))
    return total, energy


def _points(ends: Floats) -> tuple[Floats, Indices]:
    """The different points among the ends of members, and which of them each member has."""
    points, index = np.unique(ends, axis=0, return_inverse=True)
    return points, index.ravel()


def _arm(turns: list[Scalar], body: int, point: Floats) -> Scalar:
    return ca.SX(ca.DM(point)) if body == GROUND else turns[body] @ ca.DM(point)


def _held(problem: SpatialProblem, turns: list[Scalar], w: Scalar) -> tuple[Scalar, Scalar]:
    """Rows (3 J, 6 B) of the joints, and what they times the accelerations have to be."""
    rows, wanted = [], []
    for bodies, points in zip(problem.hinges.tolist(), problem.at, strict=True):
        row, right = ca.SX(3, 6 * problem.bodies), ca.SX.zeros(3)
        for body, point, sign in zip(bodies, points, (-1.0, 1.0), strict=True):
            if body == GROUND:
                continue
            c, spin = ca.DM(point), w[3 * body : 3 * body + 3]
            row[:, 6 * body : 6 * body + 3] = sign * ca.SX.eye(3)
            row[:, 6 * body + 3 : 6 * body + 6] = -sign * turns[body] @ ca.skew(c)
            right -= sign * turns[body] @ ca.cross(spin, ca.cross(spin, c))
        rows.append(row)
        wanted.append(right)
    return ca.vertcat(*rows), ca.vertcat(*wanted)
