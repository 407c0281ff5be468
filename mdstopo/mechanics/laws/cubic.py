"""`cubic`: f = k1 x + k3 x^3, V = k1 x^2/2 + k3 x^4/4. Parameters: k1, k3."""

from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels


@inline
def cubic_force(p, x):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    square = x * x
    f = x * (p[0] + p[1] * square)
    return f, p[0] + 3.0 * p[1] * square, 0.0, square * (0.5 * p[0] + 0.25 * p[1] * square), f


@inline
def cubic_slopes(p, place, x):
    """Slopes of force and energy by a parameter: df/dp, dV/dp."""
    square = x * x
    if place == 0:
        return x, 0.5 * square
    return square * x, 0.25 * square * square


KERNELS = LawKernels(force=cubic_force, slopes=cubic_slopes)
