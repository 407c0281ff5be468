"""The subproblem with one function row and at most one linear row, solved in its dual to rounding.

For a multiplier of the linear row each variable's minimiser has a closed form: with slope f', coefficient a
and pressure lambda a, a falling term gives u^(xi-1) = lambda a/(-f'), a rising one w^(xi-1) = -lambda a/f',
and the box clips. This is the update of OC, and of MMA and CONLIN with one function. The row's value a
x(lambda) falls with lambda, so the multiplier is a bracketed root; where terms are linear the value jumps
there, and the solution is the point between the two sides of the jump that meets the row.
"""

import numpy as np

from mdstopo.optimizer.approximation import Approximation
from mdstopo.optimizer.interior import Optimum
from mdstopo.optimizer.problem import Floats, LinearRows

MAX_STEPS = 200


def closed_form(model: Approximation, linear: LinearRows) -> bool:
    """Whether `solve_dual` can solve the subproblem."""
    return len(model.values) == 1 == model.n_objective and len(linear) <= 1 and not model.kappa.any()


def solve_dual(model: Approximation, lower: Floats, upper: Floats, linear: LinearRows) -> Optimum:
    """Solve the subproblem in the box. Some x in it must satisfy the linear row."""
    if not len(linear):
        return Optimum(minimiser(model, lower, upper, np.zeros_like(lower)), np.ones(1), np.zeros(0), 0, True)
    a, b = linear.A[0], float(linear.b[0])

    def excess(multiplier: float) -> tuple[Floats, float]:
        x = minimiser(model, lower, upper, multiplier * a)
        return x, float(np.einsum("i,i->", a, x)) - b

    x, value = excess(0.0)
    if value == 0.0 or (value < 0.0 and not linear.equal[0]):
        return Optimum(x, np.ones(1), np.zeros(1), 1, True)
    rounding = 1e-15 * (float(np.einsum("i,i->", np.abs(a), np.maximum(np.abs(lower), np.abs(upper)))) + abs(b))
    # `near` is the side at zero, `far` the other; the root lies between.
    sign = 1.0 if value > 0.0 else -1.0
    unit = float(np.abs(model.slopes).max()) / float(np.abs(a).max())
    unit = unit if unit > 0.0 else 1.0
    near, x_near, f_near = 0.0, x, value
    far, x_far, f_far = sign * unit, x, value
    step = 0
    while step < MAX_STEPS:
        step += 1
        x_far, f_far = excess(far)
        if f_far * sign <= 0.0:
            break
        near, x_near, f_near = far, x_far, f_far
        far *= 4.0
    else:
        return Optimum(x_far, np.ones(1), np.array([far]), step, abs(f_far) <= 1e-9 * (1.0 + abs(b)))
    # Illinois: false position that halves the value of an end that stays twice; a bisection where that lags.
    g_near, g_far = f_near, f_far
    width = abs(far - near)
    last = 0.0
    while step < MAX_STEPS and min(abs(f_near), abs(f_far)) > rounding:
        step += 1
        middle = near - g_near * (far - near) / (g_far - g_near)
        if step % 3 == 0 and abs(far - near) > 0.25 * width:
            middle = 0.5 * (near + far)
        if step % 3 == 0:
            width = abs(far - near)
        if not min(near, far) < middle < max(near, far):
            middle = 0.5 * (near + far)
            if middle in (near, far):
                break
        x_middle, f_middle = excess(middle)
        if f_middle * sign > 0.0:
            near, x_near, f_near, g_near = middle, x_middle, f_middle, f_middle
            g_far *= 0.5 if last * f_middle > 0.0 else 1.0
        else:
            far, x_far, f_far, g_far = middle, x_middle, f_middle, f_middle
            g_near *= 0.5 if last * f_middle > 0.0 else 1.0
        last = f_middle
    share = f_near / (f_near - f_far)
    root = near if abs(f_near) < abs(f_far) else far
    return Optimum(x_near + share * (x_far - x_near), np.ones(1), np.array([root]), step, True)


def minimiser(model: Approximation, lower: Floats, upper: Floats, pressure: Floats) -> Floats:
    """(N,) the x in the box at which the model's row plus pressure . x is least, without the convex term.

    Where nothing pushes, x stays at the iterate.
    """
    slope = model.slopes[0]
    x = np.where(slope + pressure > 0.0, lower, np.where(slope + pressure < 0.0, upper, model.x))
    if model.linear:
        return x
    power = 1.0 / (model.power - 1.0)
    falls = (slope < 0.0) & (pressure > 0.0)
    u = (pressure[falls] / -slope[falls]) ** power
    x[falls] = model.x[falls] + model.below[falls] * (u - 1.0)
    x[(slope < 0.0) & (pressure <= 0.0)] = np.inf
    if not model.linear_above:
        rises = (slope > 0.0) & (pressure < 0.0)
        w = (-pressure[rises] / slope[rises]) ** power
        x[rises] = model.x[rises] - model.above[rises] * (w - 1.0)
        x[(slope > 0.0) & (pressure >= 0.0)] = -np.inf
    return np.clip(x, lower, upper)
