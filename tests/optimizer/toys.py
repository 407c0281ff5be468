"""Small problems with known answers, cheap enough to be solved by the hundred."""

import numpy as np

from mdstopo.optimizer.problem import Floats, LinearRows, Sample
from mdstopo.status import Status


class Toy:
    """Rows given by a function x -> (rows, gradients[, constraints, constraint gradients])."""

    def __init__(self, functions, initial, lower, upper, linear=None, constraints=None):
        self.functions = functions
        self.constraints = constraints
        self.initial = np.asarray(initial, dtype=float)
        n = len(self.initial)
        self.lower = np.broadcast_to(np.asarray(lower, dtype=float), (n,)).copy()
        self.upper = np.broadcast_to(np.asarray(upper, dtype=float), (n,)).copy()
        self.linear = linear if linear is not None else LinearRows.none(n)
        self.evaluated: list[Floats] = []

    def evaluate(self, x, gradient=True):
        self.evaluated.append(x.copy())
        rows, gradients = self.functions(x)
        order = np.argsort(-rows, kind="stable")
        extra = {}
        if self.constraints is not None:
            c, dc = self.constraints(x)
            extra = {"constraint_rows": c, "constraint_gradients": dc}
        return Sample(
            float(rows[order[0]]),
            rows[order],
            gradients[order],
            info={"objectives": rows.max()[None]},
            **extra,
        )


def volume(n, bound, equal=False, coefficients=None):
    """One row a x <= bound, or = bound."""
    a = np.ones(n) if coefficients is None else np.asarray(coefficients, dtype=float)
    return LinearRows(a[None, :], np.array([float(bound)]), np.array([equal]))


def compliance(weights):
    """sum w/x, whose minimum under sum x = V is x ~ sqrt(w)."""

    def functions(x):
        return np.array([np.sum(weights / x)]), (-weights / x**2)[None, :]

    return functions


def compliance_problem(n=30, bound=6.0, equal=True, seed=0):
    """Minimise sum w/x under a volume row; bounds 0.001 to 1."""
    weights = np.random.default_rng(seed).uniform(0.1, 2.0, n)
    return Toy(compliance(weights), np.full(n, bound / n), 1e-3, 1.0, volume(n, bound, equal)), weights


def two_peaks(n=20, seed=1):
    """The larger of two shifted quadratics: tied at the optimum."""
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.2, 0.8, n), rng.uniform(0.2, 0.8, n)

    def functions(x):
        rows = np.array([np.sum((x - a) ** 2), np.sum((x - b) ** 2)])
        return rows, np.stack([2 * (x - a), 2 * (x - b)])

    return Toy(functions, np.full(n, 0.9), 0.0, 1.0), a, b


def failing(problem, when, status=Status.ZERO_LENGTH, message="belts[3]"):
    """`problem`, whose evaluations with a number in `when` (0 is the first) fail."""
    inner, count = problem.evaluate, iter(range(10**9))

    def evaluate(x, gradient=True):
        sample = inner(x, gradient)
        if next(count) in when:
            return Sample(float("nan"), status=status, message=message)
        return sample

    problem.evaluate = evaluate
    return problem


def shaken_block(n, share, seed=0, directions=6, frequencies=20):
    """The rms of a block on n springs over a band of frequencies of a force: smooth, and bent
    both ways by the resonances; a share of all springs may be spent."""
    rng = np.random.default_rng(seed)
    along = rng.normal(size=(n, directions))
    along /= np.linalg.norm(along, axis=1)[:, None]
    force = rng.normal(size=directions)
    eye = np.eye(directions)

    def functions(x):
        stiffness = (along.T * x) @ along
        square, slope = 0.0, np.zeros(n)
        for omega in np.linspace(0.1, 3.0, frequencies) ** 2:
            dynamic = stiffness - (omega - 0.1j * np.sqrt(omega)) * eye
            u = np.linalg.solve(dynamic, force)
            adjoint = np.linalg.solve(dynamic.T, u.conj())
            square += float((np.abs(u) ** 2).sum()) / frequencies
            slope -= 2.0 * np.real((along @ adjoint) * (along @ u)) / frequencies
        rms = np.sqrt(square)
        return np.array([rms]), (slope / (2.0 * rms))[None]

    return Toy(functions, np.full(n, share), 0.0, 1.0, volume(n, share * n))
