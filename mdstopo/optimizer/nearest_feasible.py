"""The nearest design that satisfies bounds and linear rows."""

import numpy as np

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.interior import interior_point
from mdstopo.optimizer.problem import Floats, LinearRows

ROUNDING = 1e-14
FEASIBLE = 1e-9


class InfeasibleRows(ValueError):  # noqa: N818 - it names the state of the rows
    """No design within the bounds satisfies the linear rows."""


def project(x: Floats, lower: Floats, upper: Floats, linear: LinearRows) -> Floats:
    """The Euclidean projection of x (N,) on {lower <= x <= upper, A x <= b or = b}.

    x itself where it is feasible. Raises InfeasibleRows where there is no such design.
    """
    inside = np.clip(x, lower, upper)
    if satisfied(inside, linear):
        return inside
    active = np.abs(linear.A).max(axis=1, initial=0.0) > 0.0
    rows = LinearRows(linear.A[active], linear.b[active], linear.equal[active])
    if len(rows) == 1:
        inside = _one_row(x, lower, upper, rows.A[0], float(rows.b[0]))
    elif len(rows):
        inside = _several_rows(x, lower, upper, rows)
    inside = repair(inside, lower, upper, rows)
    if not satisfied(inside, linear, FEASIBLE):
        raise InfeasibleRows("no design within the bounds satisfies the volume rows")
    return inside


def excess_scale(x: Floats, linear: LinearRows) -> Floats:
    """The size of the sums in A x - b, (m,): what their rounding errors are relative to."""
    return np.asarray(np.einsum("ij,j->i", np.abs(linear.A), np.abs(x)) + np.abs(linear.b))


def satisfied(x: Floats, linear: LinearRows, tolerance: float = ROUNDING) -> bool:
    """Whether the linear rows hold to `tolerance`, relative to the size of their sums."""
    excess = linear.excess(x)
    excess = np.where(linear.equal, np.abs(excess), excess)
    return bool(np.all(excess <= tolerance * excess_scale(x, linear)))


def repair(x: Floats, lower: Floats, upper: Floats, linear: LinearRows) -> Floats:
    """Remove small misses of the linear rows from an x in the box, moving the variables off their bounds the
    least.

    Leaves x as close as it gets where the rows cannot be met.
    """
    for _ in range(20):
        if satisfied(x, linear):
            break
        excess = linear.excess(x)
        broken = np.where(linear.equal, excess != 0.0, excess > 0.0)
        free = (x > lower) & (x < upper)
        if not np.abs(linear.A[broken][:, free]).any():
            free = upper > lower
        A = np.where(free, linear.A[broken], 0.0)
        gram = np.einsum("ik,jk->ij", A, A)
        push = np.linalg.lstsq(gram, excess[broken], rcond=1e-12)[0]
        x = np.clip(x - np.einsum("i,ij->j", push, A), lower, upper)
    return x


def _one_row(x: Floats, lower: Floats, upper: Floats, a: Floats, b: float) -> Floats:
    """Projection on one row that is known to be active: a . clip(x - lambda a) falls with lambda."""
    least = np.where(a > 0.0, lower, upper)
    most = np.where(a > 0.0, upper, lower)
    _refuse_out_of_reach(lower, upper, LinearRows(a[None], np.array([b]), np.array([True])))
    moving = a != 0.0
    reach_low = (x[moving] - least[moving]) / a[moving]
    reach_high = (x[moving] - most[moving]) / a[moving]
    lo, hi = float(reach_high.min()), float(reach_low.max())
    multiplier = 0.5 * (lo + hi)
    for _ in range(200):
        y = np.clip(x - multiplier * a, lower, upper)
        miss = float(np.einsum("i,i->", a, y)) - b
        if miss > 0.0:
            lo = multiplier
        elif miss < 0.0:
            hi = multiplier
        else:
            return y
        inner = (y > lower) & (y < upper)
        curvature = float(np.einsum("i,i->", a[inner], a[inner]))
        newton = multiplier + miss / curvature if curvature > 0.0 else np.inf
        following = newton if lo < newton < hi else 0.5 * (lo + hi)
        if following == multiplier or following in (lo, hi):
            break
        multiplier = following
    return np.asarray(np.clip(x - multiplier * a, lower, upper))


def _refuse_out_of_reach(lower: Floats, upper: Floats, rows: LinearRows) -> None:
    """Raise InfeasibleRows where the bounds leave no design that satisfies a row by itself."""
    A, b = rows.A, rows.b
    size = np.einsum("ij,j->i", np.abs(A), np.maximum(np.abs(lower), np.abs(upper))) + np.abs(b)
    low = np.einsum("ij,ij->i", A, np.where(A > 0.0, lower, upper))
    high = np.einsum("ij,ij->i", A, np.where(A > 0.0, upper, lower))
    if np.any((low > b + FEASIBLE * size) | (rows.equal & (high < b - FEASIBLE * size))):
        raise InfeasibleRows("no design within the bounds satisfies the volume rows")


def _several_rows(x: Floats, lower: Floats, upper: Floats, rows: LinearRows) -> Floats:
    _refuse_out_of_reach(lower, upper, rows)  # the interior point would look for multipliers without an end
    free = upper > lower
    out = np.clip(x, lower, upper)
    if not free.any():
        return out
    rest = LinearRows(rows.A[:, free], rows.b - np.einsum("ij,j->i", rows.A[:, ~free], out[~free]), rows.equal)
    used = np.abs(rest.A).max(axis=1, initial=0.0) > 0.0
    rest = LinearRows(rest.A[used], rest.b[used], rest.equal[used])
    n = int(free.sum())
    one = np.ones(n)
    distance = Approximation(x[free], one, one, np.zeros(0), np.zeros((0, n)), 0, 1.0, False, one)
    out[free] = interior_point(distance, lower[free], upper[free], rest, np.zeros(0)).x
    return np.where(np.isfinite(out), out, np.clip(x, lower, upper))
