"""`actuator`: f = clip(kp (x - target) + kd x', -limit, limit). Parameters: kp, kd, target, limit (0: none).

Modes: linear, held at +limit, held at -limit.
"""

import numpy as np

from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels, Modes, always

LINEAR, UPPER, LOWER = range(3)


@inline
def actuator_force(p, x, xd, mode):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    if mode == UPPER:
        return p[3], 0.0, 0.0, 0.0, 0.0
    if mode == LOWER:
        return -p[3], 0.0, 0.0, 0.0, 0.0
    return p[0] * (x - p[2]) + p[1] * xd, p[0], p[1], 0.0, 0.0


@inline
def actuator_margins(mode):
    """How many margins a mode has: in the linear one there are two limits."""
    return 2 if mode == LINEAR else 1


@inline
def actuator_one_margin(p, which, x, xd, mode):
    """One margin, in parts of the limit, and its slopes by x, xd and time, where there is a limit: in the linear mode
    up to the upper one, then to the lower one."""
    f = (p[0] * (x - p[2]) + p[1] * xd) / p[3]
    sign = 1.0 / p[3]
    if mode == UPPER:
        return f - 1.0, sign * p[0], sign * p[1], 0.0
    if mode == LINEAR and which == 1:
        return 1.0 + f, sign * p[0], sign * p[1], 0.0
    return (1.0 if mode == LINEAR else -1.0) - f, -sign * p[0], -sign * p[1], 0.0


@inline
def _least(p, x, xd):
    """The number of the margin that is the least in the linear mode: of the limit that the force points to."""
    return 0 if p[0] * (x - p[2]) + p[1] * xd >= 0.0 else 1


@inline
def actuator_margin(p, x, xd, mode):
    """How far the force is from the end of its mode, in parts of the limit; infinite where there is no limit."""
    if p[3] <= 0.0:
        return np.inf
    s, _, _, _ = actuator_one_margin(p, _least(p, x, xd), x, xd, mode)
    return s


@inline
def actuator_margin_slopes(p, x, xd, mode):
    """Slopes of the margin, which says how far the mode is from its end, by x and xd."""
    if p[3] <= 0.0:
        return 0.0, 0.0
    _, by_x, by_rate, _ = actuator_one_margin(p, _least(p, x, xd), x, xd, mode)
    return by_x, by_rate


@inline
def actuator_slopes(p, place, x, xd, mode):
    """Slopes of force and energy by a parameter: df/dp, dV/dp."""
    if mode != LINEAR:
        return ((1.0 if mode == UPPER else -1.0) if place == 3 else 0.0), 0.0
    if place == 0:
        return x - p[2], 0.0
    if place == 1:
        return xd, 0.0
    return (-p[0] if place == 2 else 0.0), 0.0


@inline
def actuator_margin_slope(p, place, x, xd, mode):
    """The slope of the margin, which says how far the mode is from its end, by a parameter."""
    if p[3] <= 0.0:
        return 0.0
    f = p[0] * (x - p[2]) + p[1] * xd
    sign = 1.0 / p[3]
    if mode == LOWER or (mode == LINEAR and f >= 0.0):
        sign = -sign
    if place == 0:
        return sign * (x - p[2])
    if place == 1:
        return sign * xd
    return -sign * p[0] if place == 2 else -sign * f / p[3]


@inline
def actuator_start(p, x, xd):
    """The mode by the force alone: it is continuous at both limits."""
    if p[3] <= 0.0:
        return LINEAR
    f = p[0] * (x - p[2]) + p[1] * xd
    if f > p[3]:
        return UPPER
    if f < -p[3]:
        return LOWER
    return LINEAR


@inline
def actuator_next(p, x, xd, mode):
    """The mode that follows when the margin of this one is used up."""
    if mode != LINEAR:
        return LINEAR
    return UPPER if p[0] * (x - p[2]) + p[1] * xd > 0.0 else LOWER


@inline
def actuator_switches(p):
    """Whether the law has modes: only where its force has a limit."""
    return p[3] > 0.0


@inline
def actuator_unstretched(p):
    """The size of the force at no elongation, which steers to the target."""
    return abs(p[0] * p[2])


KERNELS = LawKernels(
    force=actuator_force,
    slopes=actuator_slopes,
    unstretched=actuator_unstretched,
    modes=Modes(
        margin=actuator_margin,
        margin_slopes=actuator_margin_slopes,
        margin_slope=actuator_margin_slope,
        margins=actuator_margins,
        one_margin=actuator_one_margin,
        next_mode=actuator_next,
        first_mode=actuator_start,
        switches=actuator_switches,
        degree=1,
    ),
    is_even=always,
)
