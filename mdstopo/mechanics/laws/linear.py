"""`spring` (Eq. 2) in scalar form: f = k x + c x' + preload, V = k x^2/2. Parameters: k, c, preload."""

from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels


@inline
def linear_force(p, x, xd):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    pull = p[0] * x
    return pull + p[1] * xd + p[2], p[0], p[1], 0.5 * pull * x, pull


@inline
def linear_slopes(p, place, x, xd):
    """Slopes of force and energy by a parameter: df/dp, dV/dp."""
    if place == 0:
        return x, 0.5 * x * x
    if place == 1:
        return xd, 0.0
    return 1.0, 0.0


@inline
def linear_unstretched(p):
    """The force at no elongation and rate: the preload (N)."""
    return abs(p[2])


KERNELS = LawKernels(force=linear_force, slopes=linear_slopes, unstretched=linear_unstretched, linear=True)
