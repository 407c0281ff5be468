"""`pulse` (Eq. 4): f = f0 exp(-sigma (t - t0)^2). Parameters: f0, sigma, t0."""

import math

from mdstopo.case.laws import PulseLaw
from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels


@inline
def pulse_force(p, t):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    s = t - p[2]
    return p[0] * math.exp(-min(p[1] * min(s * s, 1e300), 745.0)), 0.0, 0.0, 0.0, 0.0


@inline
def pulse_slopes(p, place, t):
    """Slopes of force and energy by a parameter: df/dp, dV/dp."""
    s = t - p[2]
    share = math.exp(-min(p[1] * min(s * s, 1e300), 745.0))
    if place == 0:
        return share, 0.0
    if place == 1:
        return -min(s * s, 1e300) * p[0] * share, 0.0
    return 2.0 * p[1] * s * p[0] * share, 0.0


#: steps in the width of a pulse where they are of second order
FINE = 16


def pulse_breakpoints(record: PulseLaw, fine: bool) -> list[float]:
    """Times that integrators land on, so that no step passes over a narrow pulse.

    fine: for steps of low order and given length, which have to follow the pulse itself.
    """
    if not record.rate > 0.0:
        return []
    width, time = 1.0 / math.sqrt(record.rate), record.time
    if fine:
        return [time + i / FINE * width for i in range(-6 * FINE, 6 * FINE + 1)]
    return [time + side * part * width for part in (1.0, 2.5, 4.0, 6.0) for side in (-1.0, 1.0)] + [time]


@inline
def pulse_unstretched(p):
    """The largest force at no elongation and rate: the peak of the pulse (N)."""
    return abs(p[0])


KERNELS = LawKernels(
    force=pulse_force, slopes=pulse_slopes, unstretched=pulse_unstretched, breakpoints=pulse_breakpoints
)
