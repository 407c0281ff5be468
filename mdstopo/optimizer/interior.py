"""The subproblem with several rows, solved by a primal-dual interior point.

    minimise   z + sum_j penalty_j e_j + Q(v)
    subject to f_r(v) - z <= 0        objective rows (the bound formulation)
               c_j(v) - e_j <= 0      constraint rows, made elastic: e >= 0
               A v <= b or A v = b,   0 <= v <= 1

Bounds are eliminated variable by variable and e row by row, so that each Newton step solves one dense system
of the size of the rows (function and linear) plus one for z, whatever N. Steps are Mehrotra's predictor and
corrector. Here the problem is scaled (v = (x - lower)/(upper - lower), rows by their largest slope) and
started; `interior_kernels.py` iterates.
"""

from dataclasses import dataclass

import numpy as np

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.interior_kernels import ELASTIC, EQUAL, LIMIT, OBJECTIVE, interior_loop
from mdstopo.optimizer.problem import Floats, LinearRows

MAX_STEPS = 80
GAP = 1e-13
RESIDUAL = 1e-11


@dataclass(frozen=True, slots=True)
class Optimum:
    """A subproblem's solution: x (N,), multipliers of the function rows (R,) and of the linear rows (m,),
    steps
    taken, and whether the optimality conditions hold to the tolerance."""

    x: Floats
    multipliers: Floats
    linear_multipliers: Floats
    steps: int
    converged: bool


def interior_point(model: Approximation, lower: Floats, upper: Floats, linear: LinearRows, penalty: Floats) -> Optimum:
    """Solve the subproblem in the box lower <= x <= upper, lower < upper throughout.

    penalty: (C,) of the constraint rows. Some x in the box must satisfy the linear rows, no one of which may be
    zero.
    """
    width = upper - lower
    R, m, n_obj = len(model.values), len(linear), model.n_objective
    # In C order whatever the model's: another layout would be compiled anew.
    slopes = np.multiply(model.slopes, width, order="C")
    B = np.empty((R + m, len(width)))
    B[:R] = np.abs(slopes)
    np.multiply(linear.A, width, out=B[R:])
    steepest, sums = B.max(axis=1, initial=0.0), B.sum(axis=1)
    steepest[R:] = np.abs(B[R:]).max(axis=1, initial=0.0)
    sums[R:] = np.abs(B[R:]).sum(axis=1)
    # Objective rows share one scale; the others have their own, their units being none of the objective's.
    steepest[:n_obj] = steepest[:n_obj].max(initial=0.0)
    row_scale = np.where(steepest > 0.0, steepest, 1.0)
    scale = float(row_scale[0]) if n_obj else 1.0
    slopes /= row_scale[:R, None]
    B[R:] /= row_scale[R:, None]
    offsets = np.concatenate([model.values, linear.excess(lower)])
    offsets[:n_obj] -= offsets[:n_obj].max(initial=-np.inf)
    offsets /= row_scale
    kind = np.full(R + m, ELASTIC)
    kind[:n_obj] = OBJECTIVE
    kind[R:] = np.where(linear.equal, EQUAL, LIMIT)
    sums /= row_scale
    mu = max(0.1 * float(sums[:R].mean()) / len(width) if R else 0.1, 1e-6)
    rows = np.zeros((6, R + m))
    rows[5] = np.maximum(1.0, sums)
    y, penalties = rows[1], rows[4]
    penalties[n_obj:R] = penalty * row_scale[n_obj:R] / scale
    y[:] = np.minimum(0.5 * penalties, 1.0)
    y[:n_obj] = 1.0 / max(n_obj, 1)
    y[R:] = np.where(linear.equal, 0.0, mu)
    frame = np.empty((4, len(width)))
    frame[0] = (model.x - lower) / width
    frame[1] = model.below / width
    frame[2] = model.above / width
    frame[3] = model.kappa * (width * width / scale)
    bounds = np.empty((4, len(width)))
    np.clip(frame[0], 0.1, 0.9, out=bounds[0])
    bounds[1] = 1.0 - bounds[0]
    bounds[2:] = mu / bounds[:2]
    steps, converged = interior_loop(
        slopes,
        B,
        offsets,
        kind,
        frame,
        model.power,
        model.linear_above,
        bounds,
        rows,
        mu,
        MAX_STEPS,
        GAP,
        RESIDUAL,
    )
    # The compiled loop assumes that nothing is NaN: only here can that be seen.
    converged = converged and bool(np.isfinite(bounds).all() and np.isfinite(rows).all())
    wl, wu, zl, zu = bounds
    x = np.where(wl < wu, lower + wl * width, upper - wu * width)
    # A bound whose multiplier outweighs the distance to it is active.
    x = np.where((zl > wl) & (wl < 1e-6), lower, np.where((zu > wu) & (wu < 1e-6), upper, x))
    multipliers = y * scale / row_scale
    return Optimum(np.clip(x, lower, upper), multipliers[:R], multipliers[R:], steps, converged)
