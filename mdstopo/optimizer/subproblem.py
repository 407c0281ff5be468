"""One convex subproblem, whatever its rows: the two solvers' common front.

Takes fixed variables and empty rows out, chooses the solver (the dual in closed form where that is enough,
else the interior point), puts the pieces back and removes the solution's last rounding errors in the linear
rows.
"""

import numpy as np

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.dual import closed_form, solve_dual
from mdstopo.optimizer.interior import Optimum, interior_point
from mdstopo.optimizer.nearest_feasible import repair
from mdstopo.optimizer.problem import Floats, LinearRows


def solve(model: Approximation, lower: Floats, upper: Floats, linear: LinearRows, penalty: Floats) -> Optimum:
    """Minimise the model in the box under the linear rows; penalty (C,) of violating each constraint row.

    The iterate model.x must lie in the box and satisfy the linear rows. The solution does so too; it is the
    iterate itself, unconverged, where no solution could be computed.
    """
    free = upper > lower
    x = np.clip(model.x, lower, upper)
    row_multipliers = np.zeros(len(linear))
    multipliers = np.zeros(len(model.values))
    multipliers[0] = 1.0
    if not free.any():
        return Optimum(x, multipliers, row_multipliers, 0, True)
    whole = bool(free.all())
    rest = (
        linear
        if whole
        else LinearRows(linear.A[:, free], linear.b - np.einsum("ij,j->i", linear.A[:, ~free], x[~free]), linear.equal)
    )
    used = np.abs(rest.A).max(axis=1, initial=0.0) > 0.0
    if not used.all():
        rest = LinearRows(rest.A[used], rest.b[used], rest.equal[used])
    part = model if whole else model.restricted(free)
    low, high = (lower, upper) if whole else (lower[free], upper[free])
    if closed_form(part, rest):
        found = solve_dual(part, low, high, rest)
    else:
        found = interior_point(part, low, high, rest, penalty)
    finite = bool(np.isfinite(found.x).all() and np.isfinite(found.multipliers).all())
    if not finite:
        return Optimum(x, multipliers, row_multipliers, found.steps, False)
    x[free] = repair(found.x, low, high, rest)
    row_multipliers[used] = found.linear_multipliers
    return Optimum(x, found.multipliers, row_multipliers, found.steps, found.converged)
