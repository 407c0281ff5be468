"""SciPy's DOP853 and the adjoint equations by hand, solved backwards on its dense output.

The gradient's integrals are no unknowns of the adjoint run: they are summed afterwards, by Gauss's rule on its steps.
"""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.peers.problem import GROUND, Floats, Problem
from benchmarks.peers.scipy_kernels import energy, forces, reverse
from benchmarks.peers.table import Objective

#: nodes of Gauss's rule on each step of the adjoint run
NODES = 4


def make(problem: Problem, tolerance: float = 1e-8, refine: bool = True) -> Objective:
    """As the table says. refine: look for the peak between steps. Raises ValueError for members tied to the ground."""
    if (problem.groups == GROUND).any():
        raise ValueError("not written for members between a body and the ground")
    ends_of = np.ascontiguousarray(problem.p.T), np.ascontiguousarray(problem.q.T)
    springs = problem.groups, problem.first, *ends_of, problem.length
    n, members = 3 * problem.bodies, problem.members
    mass, applied = problem.mass.ravel(), problem.force.ravel()
    start = np.concatenate([problem.start.ravel(), np.zeros(n)])
    control = {"method": "DOP853", "rtol": tolerance, "atol": 1e-2 * tolerance}
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    nothing, thrown = np.zeros(0), np.empty(members)

    def objective(alpha: Floats, gradient: bool) -> tuple[float, Floats | None]:
        stiffness = problem.stiffness * alpha
        pull = np.empty(n)

        def rate(_: float, y: Floats) -> Floats:
            forces(y, *springs, stiffness, pull)
            return np.concatenate([y[n:], (pull + applied) / mass])

        def power(_: float, y: Floats) -> float:
            forces(y, *springs, stiffness, pull)
            return float(-pull @ y[n:])

        # only where the energy turns downwards; it is at rest at the start, which is no peak
        power.direction = -1.0  # type: ignore[attr-defined]
        looks = power if problem.peak and refine else None
        motion = solve_ivp(rate, (0.0, problem.end), start, dense_output=gradient, events=looks, **control)
        ends = [(float(motion.t[-1]), motion.y[:, -1])]
        if looks is not None:
            turns = zip(motion.t_events[0], motion.y_events[0], strict=True)
            ends += [(t, y) for t, y in turns if t > 1e-9 * problem.end]
        elif problem.peak:
            ends = list(zip(motion.t[1:].tolist(), motion.y.T[1:], strict=True))
        heights = [energy(y, *springs, stiffness, thrown) for _, y in ends]
        best = int(np.argmax(heights))
        if not gradient:
            return heights[best], None
        return heights[best], slopes_at(*ends[best], motion.sol, stiffness)

    def slopes_at(end: float, last: Floats, states: Any, stiffness: Floats) -> Floats:
        slopes, pull, back = np.empty(members), np.empty(n), np.empty(n)
        energy(last, *springs, stiffness, slopes)
        forces(last, *springs, stiffness, pull)

        def rate(t: float, y: Floats) -> Floats:
            reverse(states(t), y[n:] / mass, *springs, stiffness, 0.0, back, nothing)
            return np.concatenate([-back, -y[:n]])

        run = solve_ivp(rate, (end, 0.0), np.concatenate([-pull, np.zeros(n)]), dense_output=True, **control)
        half, middle = 0.5 * (run.t[:-1] - run.t[1:]), 0.5 * (run.t[:-1] + run.t[1:])
        times = (middle[:, None] + half[:, None] * nodes).ravel()
        shares = (half[:, None] * weights).ravel()
        poses, costates = np.ascontiguousarray(states(times)[:n].T), run.sol(times)[n:].T / mass
        for pose, costate, share in zip(poses, np.ascontiguousarray(costates), shares.tolist(), strict=True):
            reverse(pose, costate, *springs, stiffness, share, back, slopes)
        return slopes * problem.stiffness

    return objective
