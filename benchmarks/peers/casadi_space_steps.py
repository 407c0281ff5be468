"""CasADi in space with a fixed number of steps of order 8, as the peer JAX has them, written so that C of it compiles.

One function has the members of a pair of grids, which a map calls for all groups, and one the bodies' accelerations;
both are scalars (SX), and small. What calls them, stage after stage, is a graph (MX) without loops: CasADi's reverse
mode then computes nothing forwards again but the insides of the two. Where all is scalars, those of every member stand
in the C code, and a compiler takes minutes over one function that is so long.
"""

import os
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.peers.casadi_space import accelerations_of, rotation_of
from benchmarks.peers.casadi_sundials import FLAGS
from benchmarks.peers.problem import GROUND, Floats
from benchmarks.peers.space_problem import SpatialProblem
from benchmarks.peers.table import Objective
from benchmarks.peers.tableau import order_eight

Expression = Any


def objective_of_steps(problem: SpatialProblem, start: Floats, steps: int, compiled: bool) -> Objective:
    """The energy at the end, which has to be what is wanted, and its gradient.

    start: the state at the start. compiled: by a C compiler, which for a thousand members takes a minute or two.
    Raises ValueError for a problem whose peak is wanted, or whose groups are not alike.
    """
    if problem.peak:
        raise ValueError("only the energy at the end")
    alpha = ca.MX.sym("alpha", problem.members)
    rate, energy = _model(problem, alpha)
    a, b = order_eight()
    h = problem.end / steps
    y = ca.MX(ca.DM(start))
    for _ in range(steps):
        stages: list[Expression] = []
        for row in a:
            stages.append(rate(_moved(y, h * row, stages)))
        y = _moved(y, h * b, stages)
    value = energy(y)
    alone = ca.Function("alone", [alpha], [value])
    both = ca.Function("both", [alpha], [value, ca.gradient(value, alpha)])
    if compiled:
        alone, both = _compiled(alone, both)

    def objective(design: Floats, gradient: bool) -> tuple[float, Floats | None]:
        if not gradient:
            return float(alone(design)), None
        found, slopes = both(design)
        return float(found), np.asarray(slopes).ravel()

    return objective


def _moved(y: Expression, weights: Floats, stages: list[Expression]) -> Expression:
    """y and the stages times their weights."""
    for weight, stage in zip(weights.tolist(), stages, strict=False):
        if weight != 0.0:
            y = y + weight * stage
    return y


def _model(problem: SpatialProblem, alpha: Expression) -> tuple[Any, Any]:
    """The rate of a state, and the energy in it, as functions from expressions to expressions."""
    count, groups = problem.bodies, len(problem.groups)
    grids = [problem.grid(part) for part in problem.slices()]
    found = [grid for grid in grids if grid is not None]
    if len(found) != groups or len({(len(p), len(q)) for p, q in found}) != 1:
        raise ValueError("only groups of one size, every point with every other")
    p, q = (ca.horzcat(*(ca.DM(grid[side].T) for grid in found)) for side in (0, 1))
    rows, columns = len(found[0][0]), len(found[0][1])
    natural = ca.DM(problem.length.reshape(groups, rows * columns).T)
    stiffness = ca.reshape(alpha * ca.DM(problem.stiffness), rows * columns, groups)
    pulls_of, energy_of = (each.map(groups) for each in _grid_functions(rows, columns))
    ahead = _ahead(problem)
    # the ground is the last column of poses
    columns_of = [[count if body == GROUND else body for body in side] for side in problem.groups.T.tolist()]
    onto = np.zeros((2 * groups, count + 1))
    onto[np.arange(2 * groups), columns_of[0] + columns_of[1]] = 1.0
    adding = ca.sparsify(ca.DM(onto[:, :count]))

    def poses(y: Expression) -> list[Expression]:
        """Places and quaternions (7, K) of the first and of the second body of each group."""
        places = ca.horzcat(ca.reshape(y[: 3 * count], 3, count), ca.DM.zeros(3, 1))
        turns = ca.horzcat(ca.reshape(y[3 * count : 7 * count], 4, count), ca.DM([1, 0, 0, 0]))
        both = ca.vertcat(places, turns)
        return [both[:, side] for side in columns_of]

    def rate(y: Expression) -> Expression:
        return ahead(y, ca.horzcat(*pulls_of(*poses(y), p, q, stiffness, natural)) @ adding)

    def energy(y: Expression) -> Expression:
        return ca.sum2(energy_of(*poses(y), p, q, stiffness, natural))

    return rate, energy


def _grid_functions(rows: int, columns: int) -> tuple[Any, Any]:
    """What the members from every point p (3, rows) to every point q (3, columns) of two bodies, whose poses (7,) are
    given, with their stiffness and lengths at rest, pull these with (6, each), and their energy."""
    poses = [ca.SX.sym(name, 7) for name in ("one", "two")]
    grids = ca.SX.sym("p", 3, rows), ca.SX.sym("q", 3, columns)
    stiffness, natural = ca.SX.sym("stiffness", rows * columns), ca.SX.sym("natural", rows * columns)
    arms = [
        [rotation_of(pose[3:]) @ grid[:, i] for i in range(grid.shape[1])]
        for pose, grid in zip(poses, grids, strict=True)
    ]
    ends = [[pose[:3] + arm for arm in own] for pose, own in zip(poses, arms, strict=True)]
    sums = [[ca.SX.zeros(3) for _ in own] for own in arms]
    energy = ca.SX(0.0)
    for i in range(rows):
        for j in range(columns):
            member = columns * i + j
            d = ends[1][j] - ends[0][i]
            length = ca.sqrt(ca.dot(d, d))
            energy += 0.5 * stiffness[member] * (length - natural[member]) ** 2
            pull = stiffness[member] * (1.0 - natural[member] / length) * d
            sums[0][i] += pull
            sums[1][j] -= pull
    totals = [
        sum((ca.vertcat(pull, ca.cross(arm, pull)) for arm, pull in zip(own, pulls, strict=True)), ca.SX.zeros(6))
        for own, pulls in zip(arms, sums, strict=True)
    ]
    given = [*poses, *grids, stiffness, natural]
    return ca.Function("pulls", given, totals), ca.Function("stored", given, [energy])


def _ahead(problem: SpatialProblem) -> Any:
    """The rate of a state (13 B,) under what members pull the bodies with (6, B)."""
    y, pulls = ca.SX.sym("y", 13 * problem.bodies), ca.SX.sym("pulls", 6, problem.bodies)
    return ca.Function("ahead", [y, pulls], [accelerations_of(problem, y, ca.horzsplit(pulls))])


def _compiled(*functions: Any) -> list[Any]:
    """Functions of CasADi, as C that a compiler has made machine code of."""
    with TemporaryDirectory() as folder:
        code = ca.CodeGenerator("steps.c")
        for function in functions:
            code.add(function)
        code.generate(folder + os.sep)
        library = Path(folder) / "steps.so"
        subprocess.run(
            ["gcc", "-shared", "-fPIC", *FLAGS, str(Path(folder) / "steps.c"), "-o", str(library)], check=True
        )
        return [ca.external(function.name(), str(library)) for function in functions]
