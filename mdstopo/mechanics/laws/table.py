"""The member laws of the format: by code in kernels, by record in Python.

A law gives f, f_x, f_xd, V, V_x from its parameters p (PARAMETERS,), elongation x = Delta, rate xd = dDelta/dt, its
mode, the time t, the present `value` of a tabulated force, and the scene's `curves`. A law that switches is smooth
within a mode; its margin is not negative as long as the mode holds. The inerter's force needs accelerations and is part
of the mass (`general.forces`). A law that remembers has a permanent set, which its elongation comes without.
"""

import numpy as np

from mdstopo.case.laws import (
    ActuatorLaw,
    CrushLaw,
    CubicLaw,
    CurveLaw,
    GapLaw,
    InerterLaw,
    Law,
    PulseLaw,
    SpringLaw,
    TableLaw,
)
from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.actuator import (
    actuator_force,
    actuator_margin,
    actuator_margin_slope,
    actuator_margin_slopes,
    actuator_next,
    actuator_slopes,
    actuator_start,
)
from mdstopo.mechanics.laws.crush import (
    crush_first_set,
    crush_force,
    crush_grazes,
    crush_margin,
    crush_margin_slope,
    crush_margin_slopes,
    crush_next,
    crush_set,
    crush_set_slope,
    crush_slopes,
    crush_start,
)
from mdstopo.mechanics.laws.cubic import cubic_force, cubic_slopes
from mdstopo.mechanics.laws.curve import (
    curve_data,
    curve_force,
    curve_margin,
    curve_margin_slopes,
    curve_piece,
    curve_start,
)
from mdstopo.mechanics.laws.gap import (
    gap_force,
    gap_grazes,
    gap_margin,
    gap_margin_slope,
    gap_margin_slopes,
    gap_next,
    gap_slopes,
    gap_start,
)
from mdstopo.mechanics.laws.linear import linear_force, linear_slopes
from mdstopo.mechanics.laws.pulse import pulse_force, pulse_landings, pulse_slopes

PARAMETERS = 8
SPRING, GAP, CUBIC, CURVE, PULSE, TABLE, ACTUATOR, CRUSH = range(8)
#: an inerter is no function of elongation and rate
INERTER = -1
CODES = {
    "spring": SPRING,
    "gap": GAP,
    "cubic": CUBIC,
    "curve": CURVE,
    "pulse": PULSE,
    "table": TABLE,
    "actuator": ACTUATOR,
    "crush": CRUSH,
    "inerter": INERTER,
}
#: the place of each parameter that may be a design variable: in the law's row, and beyond it what all laws share
PLACES = {
    "spring": {"stiffness": 0, "damping": 1, "preload": 2},
    "gap": {"stiffness": 0, "damping": 1, "gap": 2},
    "cubic": {"stiffness": 0, "cubic": 1},
    "curve": {},
    "pulse": {"peak": 0, "rate": 1, "time": 2},
    "table": {},
    "actuator": {"proportional": 0, "derivative": 1, "target": 2, "limit": 3},
    "crush": {"stiffness": 0, "force": 1, "gap": 2},
    "inerter": {"inertance": 0},
}
FREE_LENGTH, ACTIVE_FROM, ACTIVE_UNTIL = range(PARAMETERS, PARAMETERS + 3)
COMMON = {"free_length": FREE_LENGTH, "active_from": ACTIVE_FROM, "active_until": ACTIVE_UNTIL}


@inline
def law(code, p, x, xd, mode, t, value, curves):  # type: ignore[no-untyped-def]
    """f, f_x, f_xd, V, V_x."""
    if code == SPRING:
        return linear_force(p, x, xd)
    if code == GAP:
        return gap_force(p, x, xd, mode)
    if code == CUBIC:
        return cubic_force(p, x)
    if code == CURVE:
        return curve_force(p, x, mode, curves)
    if code == PULSE:
        return pulse_force(p, t)
    if code == TABLE:
        return value, 0.0, 0.0, 0.0, 0.0
    if code == ACTUATOR:
        return actuator_force(p, x, xd, mode)
    if code == CRUSH:
        return crush_force(p, x, mode)
    return np.nan, np.nan, np.nan, np.nan, np.nan  # an inerter has no place here


@inline
def law_slopes(code, p, place, x, xd, mode, t, value, curves):  # type: ignore[no-untyped-def]
    """df/dp, dV/dp by the parameter at a place of the law's row, or by the free length; not of an inerter."""
    if place == FREE_LENGTH:
        _, f_x, _, _, pull = law(code, p, x, xd, mode, t, value, curves)
        return -f_x, -pull
    if code == SPRING:
        return linear_slopes(p, place, x, xd)
    if code == GAP:
        return gap_slopes(p, place, x, xd, mode)
    if code == CUBIC:
        return cubic_slopes(p, place, x)
    if code == PULSE:
        return pulse_slopes(p, place, t)
    if code == ACTUATOR:
        return actuator_slopes(p, place, x, xd, mode)
    if code == CRUSH:
        return crush_slopes(p, place, x, mode)
    return np.nan, np.nan


@inline
def law_margin_slope(code, p, place, x, xd, mode, curves):  # type: ignore[no-untyped-def]
    """Slope of the margin by the parameter at a place of the law's row, or by the free length."""
    if place == FREE_LENGTH:
        by_x, _ = law_margin_slopes(code, p, x, xd, mode, curves)
        return -by_x
    if code == GAP:
        return gap_margin_slope(p, place, x, xd, mode)
    if code == ACTUATOR and p[3] > 0.0:
        return actuator_margin_slope(p, place, x, xd, mode)
    if code == CRUSH:
        return crush_margin_slope(p, place, x, mode)
    return 0.0


@inline
def law_switches(code, p):  # type: ignore[no-untyped-def]
    """Whether the law has more than one mode."""
    return code in (GAP, CRUSH, CURVE) or (code == ACTUATOR and p[3] > 0.0)


@inline
def law_margin(code, p, x, xd, mode, curves):  # type: ignore[no-untyped-def]
    """How far the mode is from its end; infinite where a law has one mode only."""
    if code == GAP:
        return gap_margin(p, x, xd, mode)
    if code == ACTUATOR and p[3] > 0.0:
        return actuator_margin(p, x, xd, mode)
    if code == CRUSH:
        return crush_margin(p, x, xd, mode)
    if code == CURVE:
        return curve_margin(p, x, mode, curves)
    return np.inf


@inline
def law_margin_slopes(code, p, x, xd, mode, curves):  # type: ignore[no-untyped-def]
    """Slopes of the margin by x and xd."""
    if code == GAP:
        return gap_margin_slopes(p, x, xd, mode)
    if code == ACTUATOR and p[3] > 0.0:
        return actuator_margin_slopes(p, x, xd, mode)
    if code == CRUSH:
        return crush_margin_slopes(p, x, xd, mode)
    if code == CURVE:
        return curve_margin_slopes(p, x, mode, curves)
    return 0.0, 0.0


@inline
def law_next(code, p, x, xd, xdd, mode, curves):  # type: ignore[no-untyped-def]
    """The mode to go to where the margin is used up."""
    if code == GAP:
        return gap_next(p, x, xd, xdd, mode)
    if code == CRUSH:
        return crush_next(p, x, mode)
    if code == CURVE:
        return curve_piece(p, x, curves)
    return actuator_next(p, x, xd, mode)


@inline
def law_start(code, p, x, xd, xdd, curves):  # type: ignore[no-untyped-def]
    """The mode at the start of the motion."""
    if code == GAP:
        return gap_start(p, x, xd, xdd)
    if code == ACTUATOR and p[3] > 0.0:
        return actuator_start(p, x, xd)
    if code == CRUSH:
        return crush_start(p, x, xd, xdd)
    if code == CURVE:
        return curve_start(p, x, xd, xdd, curves)
    return 0


@inline
def law_set(code, p, x, old, new):  # type: ignore[no-untyped-def]
    """By how much the permanent set of a member grows where one mode gives way to another."""
    return crush_set(p, x, old, new) if code == CRUSH else 0.0


@inline
def law_first_set(code, p, x, mode):  # type: ignore[no-untyped-def]
    """The permanent set of a member that begins in a mode."""
    return crush_first_set(p, x, mode) if code == CRUSH else 0.0


@inline
def law_set_slope(code, p, place):  # type: ignore[no-untyped-def]
    """Slope of a permanent set, where it is made, by the parameter at a place of the law's row, or by the free length.

    At fixed places of the member's ends.
    """
    if code != CRUSH:
        return 0.0
    return -1.0 if place == FREE_LENGTH else crush_set_slope(p, place)


@inline
def law_grazes(code, p, x, mode):  # type: ignore[no-untyped-def]
    """What a margin that is only just used up (or not) at x does to derivatives: nothing 0, force 1, motion 2."""
    if code == CRUSH:
        return crush_grazes(p, x, mode)
    return gap_grazes(p, mode) if code == GAP else 0


def parameters(record: Law, curves: list[float]) -> list[float]:
    """The row (PARAMETERS,) of a law as the case states it; what it keeps in `curves` is appended there."""
    row: list[float]
    match record:
        case SpringLaw():
            row = [record.stiffness, record.damping, record.preload]
        case GapLaw():
            side = 1.0 if record.side == "tension" else -1.0
            row = [record.stiffness, record.damping, record.gap, side, float(record.clip)]
        case CubicLaw():
            row = [record.stiffness, record.cubic]
        case CurveLaw():
            row, data = curve_data(record.curve, len(curves))
            curves += data
        case PulseLaw():
            row = [record.peak, record.rate, record.time]
        case TableLaw():
            row = []
        case ActuatorLaw(limit=0.0):
            row = []  # clipped to nothing
        case ActuatorLaw():
            limit = 0.0 if record.limit is None else record.limit
            row = [record.proportional, record.derivative, record.target, limit]
        case CrushLaw():
            row = [record.stiffness, record.force, record.gap, 1.0 if record.side == "tension" else -1.0]
        case InerterLaw():
            row = [record.inertance]
        case _:
            raise TypeError(f"no kernel for the law {record.type!r}")
    return row + [0.0] * (PARAMETERS - len(row))


def depends_on_rate(record: Law) -> bool:
    """Whether a law's force depends on velocities."""
    match record:
        case SpringLaw() | GapLaw():
            return record.damping > 0.0
        case ActuatorLaw():
            return record.derivative != 0.0
        case InerterLaw():
            return True
    return False


def landings(record: Law, fine: bool = False) -> list[float]:
    """Times at which a law's force has a kink, a jump or a narrow peak; fine: see `pulse_landings`."""
    times = [t for t in (record.active_from, record.active_until) if t is not None]
    if isinstance(record, TableLaw):
        times += record.table.times.tolist()
    if isinstance(record, PulseLaw):
        times += pulse_landings(record.rate, record.time, fine)
    return times
