"""The member laws: by code in kernels, by record in Python. All of it follows from `LawKernels` of each law.

Codes follow the order of `case.laws.LAWS`; a law of another distribution gets the next one when a scene first has it.
The branches by code are made by `compiler.choice_by_code`. Linear laws share a code, for they share their vectors; the
inertial ones are part of the mass (`general.dynamics.forces`), and their code stands for no kernel.
"""

import importlib
import inspect

import numpy as np

from mdstopo.case.laws import LAWS, Law
from mdstopo.case.laws.law import numbers, with_role
from mdstopo.compiler import store
from mdstopo.compiler.choice_by_code import Listed, chosen
from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels

PARAMETERS = 8
#: what a parameter that varies may be beside one in the law's row
FREE_LENGTH, ACTIVE_FROM, ACTIVE_UNTIL = range(PARAMETERS, PARAMETERS + 3)
COMMON = {"free_length": FREE_LENGTH, "active_from": ACTIVE_FROM, "active_until": ACTIVE_UNTIL}
#: codes of linear laws, and of laws whose force is proportional to acceleration
SPRING, INERTER = 0, -1

LISTED: Listed[LawKernels] = Listed()
#: of the laws that are known so far, by their word
CODES: dict[str, int] = {}
KERNELS: dict[str, LawKernels] = {}


def kernels_of(law: type[Law]) -> LawKernels:
    """The kernels of a law; TypeError where it names none."""
    if law.type not in KERNELS:
        enter(law)
        store.include(law.kernels)
    return KERNELS[law.type]


def code_of(law: type[Law]) -> int:
    """The code of a law; TypeError where it has no kernels."""
    kernels_of(law)
    return CODES[law.type]


def enter(law: type[Law]) -> None:
    """Give a law a code and add its kernels to the table."""
    if not hasattr(law, "kernels"):
        raise TypeError(f"no kernels are named for the law {law.__name__}")
    found = importlib.import_module(law.kernels).KERNELS
    if found.inertial:
        CODES[law.type] = INERTER
    elif found.linear and len(LISTED) > SPRING:
        CODES[law.type] = SPRING
    else:
        CODES[law.type] = LISTED.add(found)
    KERNELS[law.type] = found


for _law in LAWS.values():
    if _law.kernels.startswith("mdstopo."):
        enter(_law)
LISTED.is_filled = True


def _asks_for_time(each: LawKernels) -> bool:
    """Whether a law's force takes the time, or a value that is given over time."""
    asked = inspect.signature(getattr(each.force, "py_func", each.force)).parameters if each.force else {}
    return "t" in asked or "value" in asked


@chosen(LISTED, lambda each: each.force, inline)
def law(code, p, x, xd, mode, t, value, curves, l0):
    """Force of a member by its law, its slopes, and the energy that it stores.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    value: present force of a law whose force is given over time (N).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).

    Returns f (N), f_x (N/m), f_xd (N s/m), V (J), V_x (N); NaN for inertial laws.
    """
    return np.nan, np.nan, np.nan, np.nan, np.nan  # inertial laws have no place here


@chosen(LISTED, lambda each: each.slopes, inline)
def _own_slopes(code, p, place, x, xd, mode, t, value, curves, l0):
    """Slopes of force and energy by a parameter in the row of a law.

    code: of the law.
    p (PARAMETERS,): its parameters.
    place: of the parameter in p.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    value: present force of a law whose force is given over time (N).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).

    Returns df/dp, dV/dp; NaN where no parameter may vary.
    """
    return np.nan, np.nan


@chosen(LISTED, lambda each: each.rest_slopes, inline)
def _rest_slopes(code, p, x, xd, mode, t, curves, l0):
    """Slopes of force and energy by the free length at fixed elongation.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0, 0.0


@inline
def law_slopes(code, p, place, x, xd, mode, t, value, curves, l0):
    """Slopes of force and energy by a parameter of a law, or by the free length; not of inertial laws.

    code: of the law.
    p (PARAMETERS,): its parameters.
    place: of the parameter in p, or FREE_LENGTH.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    value: present force of a law whose force is given over time (N).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).

    Returns df/dp, dV/dp.
    """
    if place == FREE_LENGTH:
        _, f_x, _, _, pull = law(code, p, x, xd, mode, t, value, curves, l0)
        by_force, by_energy = _rest_slopes(code, p, x, xd, mode, t, curves, l0)
        return by_force - f_x, by_energy - pull
    return _own_slopes(code, p, place, x, xd, mode, t, value, curves, l0)


@chosen(LISTED, lambda each: each.unstretched, inline)
def law_unstretched(code, p, curves):
    """The largest force by the law's parameters that does not come from elongation, N."""
    return 0.0


@chosen(LISTED, lambda each: True if each.signal else None, inline)
def law_is_given(code):
    """Whether the force of a law is given over time, whatever the motion."""
    return False


@chosen(LISTED, lambda each: True if _asks_for_time(each) and each.by_time is None else None, inline)
def law_lacks_rate(code):
    """Whether the force depends on time by itself, and its slope by time is not known."""
    return False


@chosen(LISTED, lambda each: (each.is_timed or True) if each.by_time else None, inline)
def law_is_timed(code, p, curves):
    """Whether the force has a slope by time that is known, and may be other than zero."""
    return False


@chosen(LISTED, lambda each: each.by_time, inline)
def law_by_time(code, p, x, xd, mode, t, curves, l0):
    """Slope of the force by time, at fixed elongation and rate, N/s.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0


# Modes


@chosen(LISTED, lambda each: None if each.modes is None else each.modes.switches or True, inline)
def law_switches(code, p, curves):
    """Whether the law has more than one mode."""
    return False


@chosen(LISTED, lambda each: each.modes and each.modes.idle, inline)
def law_is_idle(code, mode):
    """Whether a member in this mode has no force and stores nothing, wherever its ends are."""
    return False


@chosen(LISTED, lambda each: each.modes and each.modes.degree, inline)
def law_degree(code):
    """Of which degree at most the force is in the elongation within a mode, `Modes.degree`; 0 where none is known."""
    return 0


@chosen(LISTED, lambda each: (each.modes is not None and each.modes.pieces) or None, inline)
def law_has_pieces(code):
    """Whether modes are pieces of one function with a continuous stiffness: steps need not end where a mode does."""
    return False


@chosen(LISTED, lambda each: each.modes and each.modes.margin, inline)
def law_margin(code, p, x, xd, mode, t, curves, l0):
    """How far the mode is from its end; infinite where a law has one mode only.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return np.inf


@chosen(LISTED, lambda each: each.modes and each.modes.margin_slopes, inline)
def law_margin_slopes(code, p, x, xd, mode, t, curves, l0):
    """Slopes of the margin by x and xd; zero where a law has one mode only.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0, 0.0


@chosen(LISTED, lambda each: each.modes and each.modes.margin_by_time, inline)
def law_margin_by_time(code, p, x, xd, mode, t, curves, l0):
    """Slope of the margin by time; zero where it does not depend on it.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0


@chosen(LISTED, lambda each: each.modes and each.modes.margins, inline)
def law_margins(code, p, mode, curves):
    """How many margins a law has in a mode, of which `law_margin` is the least."""
    return 1


@chosen(LISTED, lambda each: each.modes and each.modes.one_margin, inline)
def law_one_margin(code, p, which, x, xd, mode, t, curves, l0):
    """One of the margins, and its slopes by x, xd and time.

    code: of the law.
    p (PARAMETERS,): its parameters.
    which: number of the margin.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    by_x, by_rate = law_margin_slopes(code, p, x, xd, mode, t, curves, l0)
    by_time = law_margin_by_time(code, p, x, xd, mode, t, curves, l0)
    return law_margin(code, p, x, xd, mode, t, curves, l0), by_x, by_rate, by_time


@chosen(LISTED, lambda each: each.modes and each.modes.margin_slope, inline)
def _own_margin_slope(code, p, place, x, xd, mode, t, curves, l0):
    """Slope of the margin by a parameter in the row of a law; zero where it is in no margin.

    code: of the law.
    p (PARAMETERS,): its parameters.
    place: of the parameter in p.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0


@chosen(LISTED, lambda each: each.modes and each.modes.margin_rest_slope, inline)
def _margin_rest_slope(code, p, x, xd, mode, t, curves, l0):
    """Slope of the margin by the free length at fixed elongation.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0.0


@inline
def law_margin_slope(code, p, place, x, xd, mode, t, curves, l0):
    """Slope of the margin by a parameter of a law, or by the free length.

    code: of the law.
    p (PARAMETERS,): its parameters.
    place: of the parameter in p, or FREE_LENGTH.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    if place == FREE_LENGTH:
        by_x, _ = law_margin_slopes(code, p, x, xd, mode, t, curves, l0)
        return _margin_rest_slope(code, p, x, xd, mode, t, curves, l0) - by_x
    return _own_margin_slope(code, p, place, x, xd, mode, t, curves, l0)


@chosen(LISTED, lambda each: each.modes and each.modes.next_mode, inline)
def law_next(code, p, x, xd, xdd, mode, t, curves, l0):
    """The mode to go to where the margin is used up; the same one where a law has no other.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    xdd: d2Delta/dt2 (m/s^2).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return mode


@chosen(LISTED, lambda each: each.modes and each.modes.first_mode, inline)
def law_start(code, p, x, xd, xdd, t, curves, l0):
    """The mode at the start of the motion; 0 for laws that do not switch.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    xdd: d2Delta/dt2 (m/s^2).
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0


@chosen(LISTED, lambda each: each.modes and each.modes.grazes, inline)
def law_grazes(code, p, x, mode, t, curves, l0):
    """How derivatives would change if a mode were only just left at x: not at all (0), by the force (1), by the
    motion (2).

    code: of the law.
    p (PARAMETERS,): its parameters.
    x: elongation, less the permanent set where there is one (m).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return 0


@chosen(LISTED, lambda each: each.modes and each.modes.sharp, inline)
def law_is_sharp(code, p, x, xd, mode, t, curves, l0):
    """Whether the slopes of the force grow like a root behind the nearest end of the mode.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.
    t: time (s).
    curves: numbers of all laws of the scene that have such (`LawKernels.data`).
    l0: free length (m).
    """
    return False


# Permanent sets


@chosen(LISTED, lambda each: True if each.permanent_set else None, inline)
def law_remembers(code):
    """Whether members with a law keep a permanent set."""
    return False


@chosen(LISTED, lambda each: each.permanent_set and each.permanent_set.growth, inline)
def law_set(code, p, x, old, new):
    """By how much the permanent set of a member grows where one mode gives way to another."""
    return 0.0


@chosen(LISTED, lambda each: each.permanent_set and each.permanent_set.first, inline)
def law_first_set(code, p, x, mode):
    """The permanent set of a member that begins in a mode."""
    return 0.0


@chosen(LISTED, lambda each: each.permanent_set and each.permanent_set.is_made, inline)
def law_makes_set(code, old, new):
    """Whether a permanent set is written down where one mode gives way to another."""
    return False


@chosen(LISTED, lambda each: each.permanent_set and each.permanent_set.slope, inline)
def _own_set_slope(code, p, place):
    return 0.0


@inline
def law_set_slope(code, p, place):
    """Slope of a permanent set, where it is made, by the parameter at a place of the law's row, or by the free length.

    At fixed places of the member's ends.
    """
    if not law_remembers(code):
        return 0.0
    return -1.0 if place == FREE_LENGTH else _own_set_slope(code, p, place)


@chosen(LISTED, lambda each: each.permanent_set and each.permanent_set.divides, inline)
def law_divides(code, p, x, xd, mode, near):
    """Whether a member begins within `near` of a state on whose other side its permanent set would depend on
    parameters otherwise.

    code: of the law.
    p (PARAMETERS,): its parameters.
    x, xd: elongation, less the permanent set where there is one (m), and its rate (m/s).
    mode: that the member is in; 0 for laws that do not switch.

    near: how near in elongation (m).
    """
    return False


# Records


def parameters(record: Law, curves: list[float]) -> list[float]:
    """The row (PARAMETERS,) of a law as the case states it; what it keeps in `curves` is appended there."""
    data = kernels_of(type(record)).data
    if data is None:
        row = record.row()
    else:
        row, own = data(record, len(curves))
        curves += own
    return row + [0.0] * (PARAMETERS - len(row))


def place_of(law: type[Law], parameter: str) -> int:
    """The place of a parameter that may be a design variable: in the law's row, or beyond it what all laws share."""
    return COMMON[parameter] if parameter in COMMON else numbers(law).index(parameter)


def may_switch(record: Law) -> bool:
    """Whether a law has modes of which it may leave one for another."""
    own = kernels_of(type(record))
    return own.modes is not None and (own.is_smooth is None or not own.is_smooth(record))


def is_watched(record: Law) -> bool:
    """Whether modes of a law may come and go by time alone, so that steps have to be short."""
    own = kernels_of(type(record)).is_watched
    return own is not None and own(record)


def breakpoints(record: Law, fine: bool = False, varying: frozenset[str] = frozenset()) -> list[float]:
    """Times at which a law's force has a kink, a jump or a narrow peak; fine: see `pulse.breakpoints`.

    varying: parameters whose values may become others; times that depend on them are left out.
    """
    kind = type(record)
    ends = {"active_from": record.active_from, "active_until": record.active_until}
    times = [time for name, time in ends.items() if time is not None and name not in varying]
    own = kernels_of(kind).breakpoints
    if own is None or varying & (set(with_role(kind, "is_time")) - ends.keys()):
        return times
    return times + own(record, fine)
