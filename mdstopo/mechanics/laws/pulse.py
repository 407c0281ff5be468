"""`pulse` (Eq. 4): f = f0 exp(-sigma (t - t0)^2). Parameters: f0, sigma, t0."""

import math

from mdstopo.jit import inline


@inline
def pulse_force(p, t):  # type: ignore[no-untyped-def]
    """f, f_x, f_xd, V, V_x."""
    s = t - p[2]
    return p[0] * math.exp(-min(p[1] * min(s * s, 1e300), 745.0)), 0.0, 0.0, 0.0, 0.0


def pulse_landings(rate: float, time: float) -> list[float]:
    """Times that integrators land on, so that no step passes over a narrow pulse."""
    if not rate > 0.0:
        return []
    width = 1.0 / math.sqrt(rate)
    return [time + side * part * width for part in (1.0, 2.5, 4.0, 6.0) for side in (-1.0, 1.0)] + [time]
