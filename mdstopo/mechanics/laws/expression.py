"""`expression`: force and energy are formulas. Parameters: those of the formulas; last, where its data begin.

The data are where the machine code of the formulas is (`compiler.formulas`), the number of parameters, that of
switches, whether any of these depends on time, which group has the force's slope by time, 0 where that is none, bits of
the switches at which slopes begin with a root (`formula.sharp`), and on which sides of switches nothing acts
(`formula.idle`). Its groups of numbers are those of `formula.law_formulas`.

The mode's bits say on which side each switch is; as long as they stay the formulas are smooth (`formula.smooth_modes`).
A bit above them says that nothing acts.
"""

import math

import numpy as np

from mdstopo.case.laws.expression_law import OfFormulas
from mdstopo.compiler.formulas import address_of, call_formula
from mdstopo.compiler.jit import inline
from mdstopo.formula.idle import as_numbers
from mdstopo.formula.law_formulas import FIRST, FORCE, LOWEST
from mdstopo.formula.smooth_modes import MOST_SWITCHES
from mdstopo.mechanics.laws.law_kernels import LawKernels, Modes

#: place in the row of where the data begin
AT = 7
#: the bit of a mode in which nothing acts
IDLE = 2**MOST_SWITCHES
#: margins that are smaller than this, times the size of things, are zero where something begins
ZERO_MARGIN = 1e-13


def expression_data(record: OfFormulas, at: int) -> tuple[list[float], list[float]]:
    """The parameters of a law of formulas for kernels, and its data, which begin at place `at`."""
    made = record.program
    values = list(record.values.values())
    row = [*values, *[0.0] * (AT - len(values)), float(at)]
    timed = float(made.has_timed_switches)
    by_time = float(made.by_time if made.is_timed else 0)
    head = [float(address_of(made.groups)), float(made.parameters), float(made.switches), timed, by_time]
    return row, [*head, float(made.sharp), *as_numbers(made.idle)]


def expression_is_smooth(record: OfFormulas) -> bool:
    """Whether the formulas have no switches."""
    return record.program.switches == 0


def expression_is_watched(record: OfFormulas) -> bool:
    """Whether a switch depends on time, other than linearly, so that steps have to be short."""
    return record.program.has_curved_switches


def expression_is_even(record: OfFormulas) -> bool:
    """Whether formulas are polynomials of elongation and rate, or roots of what is linear, with linear switches."""
    return record.program.even


@inline
def expression_force(p, x, xd, mode, t, curves, l0):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    return call_formula(curves[int(p[AT])], p, x, xd, t, l0, mode, FORCE)


@inline
def expression_slopes(p, place, x, xd, mode, t, curves, l0):
    """Slopes of force and energy by a parameter: df/dp, dV/dp.

    p (PARAMETERS,): its parameters, and where its data begin.
    place: of the parameter.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    by_force, by_energy, _, _, _ = call_formula(curves[int(p[AT])], p, x, xd, t, l0, mode, FIRST + place)
    return by_force, by_energy


@inline
def expression_rest_slopes(p, x, xd, mode, t, curves, l0):
    """Slopes of force and energy by the free length at fixed elongation: df/dl0, dV/dl0.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    at = int(p[AT])
    by_force, by_energy, _, _, _ = call_formula(curves[at], p, x, xd, t, l0, mode, FIRST + int(curves[at + 1]))
    return by_force, by_energy


@inline
def expression_is_timed(p, curves):
    """Whether the force depends on time by itself."""
    return curves[int(p[AT]) + 4] > 0.0


@inline
def expression_by_time(p, x, xd, mode, t, curves, l0):
    """Slope of the force by time at fixed elongation and rate: df/dt.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    if not expression_is_timed(p, curves):
        return 0.0
    at = int(p[AT])
    by, _, _, _, _ = call_formula(curves[at], p, x, xd, t, l0, mode, int(curves[at + 4]))
    return by


@inline
def expression_unstretched(p, curves):
    """The force at no elongation and time 0, the larger of two: with all switches on one side, or all on the other."""
    at = int(p[AT])
    one, _, _, _, _ = call_formula(curves[at], p, 0.0, 0.0, 0.0, 1.0, 0, FORCE)
    other, _, _, _, _ = call_formula(curves[at], p, 0.0, 0.0, 0.0, 1.0, 2 ** int(curves[at + 2]) - 1, FORCE)
    one = abs(one) if math.isfinite(one) else 0.0
    other = abs(other) if math.isfinite(other) else 0.0
    return max(one, other)


@inline
def expression_switches(p, curves):
    """Whether the formulas of the law have switches."""
    return curves[int(p[AT]) + 2] > 0.0


@inline
def expression_idle(mode):
    """Whether the switches are on sides on which force and energy are 0."""
    return mode >= IDLE


@inline
def _marked(p, mode, curves):
    """A mode of bits of switches, with IDLE where force and energy are 0."""
    at = int(p[AT]) + 6
    for i in range(int(curves[at])):
        which = int(curves[at + 4 * i + 1])
        place = int(curves[at + 4 * i + 3])
        if mode & which == int(curves[at + 4 * i + 2]) and (place < 0 or p[place] > curves[at + 4 * i + 4]):
            return mode | IDLE
    return mode


@inline
def _seen(p, x, xd, mode, t, curves, l0, switch):
    """The margin of a switch, signed so that it is not negative in the mode, its slopes by x, xd and t, and 1 where it
    is evaluated.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    switch: its number.
    """
    at = int(p[AT])
    group = FIRST + 1 + int(curves[at + 1]) + switch
    g, by_x, by_rate, by_time, relevant = call_formula(curves[at], p, x, xd, t, l0, mode, group)
    if (mode >> switch) & 1 == 0:
        return -g, -by_x, -by_rate, -by_time, relevant
    return g, by_x, by_rate, by_time, relevant


@inline
def _lowest(p, x, xd, mode, t, curves, l0):
    """The smallest margin, its slopes by x, xd and t, and whose it is: -1 where no switch is evaluated.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    best = np.inf
    slopes = (0.0, 0.0, 0.0)
    who = -1
    for switch in range(int(curves[int(p[AT]) + 2])):
        s, by_x, by_rate, by_time, relevant = _seen(p, x, xd, mode, t, curves, l0, switch)
        if relevant > 0.5 and s < best:
            best = s
            slopes = (by_x, by_rate, by_time)
            who = switch
    return best, slopes[0], slopes[1], slopes[2], who


@inline
def expression_sharp(p, x, xd, mode, t, curves, l0):
    """Whether the slopes of the force grow like a root behind the switch whose margin is the smallest.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    sharp = int(curves[int(p[AT]) + 5])
    if sharp == 0 or mode >= IDLE:
        return False
    _, _, _, _, who = _lowest(p, x, xd, mode, t, curves, l0)
    return who >= 0 and (sharp >> who) & 1 == 1


@inline
def expression_margin(p, x, xd, mode, t, curves, l0):
    """The smallest margin of the switches: how far the mode is from its end.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    best, _, _, _, _ = call_formula(curves[int(p[AT])], p, x, xd, t, l0, mode, LOWEST)
    return best


@inline
def expression_margins(p, curves):
    """How many margins a law has: one for each switch in its formulas."""
    return int(curves[int(p[AT]) + 2])


@inline
def expression_one_margin(p, which, x, xd, mode, t, curves, l0):
    """One margin and its slopes by x, xd and t; infinite where it is not evaluated.

    p (PARAMETERS,): its parameters, and where its data begin.
    which: of which switch.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    s, by_x, by_rate, by_time, relevant = _seen(p, x, xd, mode, t, curves, l0, which)
    if relevant < 0.5:
        return np.inf, 0.0, 0.0, 0.0
    return s, by_x, by_rate, by_time


@inline
def expression_margin_slopes(p, x, xd, mode, t, curves, l0):
    """Slopes of the smallest margin by x and xd.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    _, by_x, by_rate, _, _ = _lowest(p, x, xd, mode, t, curves, l0)
    return by_x, by_rate


@inline
def expression_margin_by_time(p, x, xd, mode, t, curves, l0):
    """Slope of the smallest margin by time.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    if curves[int(p[AT]) + 3] == 0.0:
        return 0.0
    _, _, _, by_time, _ = _lowest(p, x, xd, mode, t, curves, l0)
    return by_time


@inline
def _margin_by(p, place, x, xd, mode, t, curves, l0):
    """Slope of the smallest margin by the parameter at a place; behind the last one, by the free length.

    p (PARAMETERS,): its parameters, and where its data begin.
    place: of the parameter.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    _, _, _, _, who = _lowest(p, x, xd, mode, t, curves, l0)
    if who < 0:
        return 0.0
    at = int(p[AT])
    count = int(curves[at + 1])
    group = FIRST + 1 + count + int(curves[at + 2]) + who * (count + 1) + place
    by, _, _, _, _ = call_formula(curves[at], p, x, xd, t, l0, mode, group)
    return by if (mode >> who) & 1 == 1 else -by


@inline
def expression_margin_slope(p, place, x, xd, mode, t, curves, l0):
    """Slope of the smallest margin by a parameter.

    p (PARAMETERS,): its parameters, and where its data begin.
    place: of the parameter.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    return _margin_by(p, place, x, xd, mode, t, curves, l0)


@inline
def expression_margin_rest_slope(p, x, xd, mode, t, curves, l0):
    """Slope of the smallest margin by the free length, at fixed elongation.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    return _margin_by(p, int(curves[int(p[AT]) + 1]), x, xd, mode, t, curves, l0)


@inline
def _side(p, x, xd, xdd, mode, t, curves, l0, switch):
    """The bit of a switch by its sign; where it is zero by its rate, so that what rests there has reached it.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    xdd: d2Delta/dt2 (m/s^2).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    switch: its number.
    """
    g, by_x, by_rate, by_time, _ = _seen(p, x, xd, mode | (1 << switch), t, curves, l0, switch)
    if abs(g) > ZERO_MARGIN * max(1.0, abs(x)):
        return 1 if g > 0.0 else 0
    rate = by_x * xd + by_rate * xdd + by_time
    if rate == 0.0:
        rate = by_x * xdd
    return 1 if rate >= 0.0 else 0


@inline
def expression_next(p, x, xd, xdd, mode, t, curves, l0):
    """The mode behind the end of a mode: the switch whose margin is used up changes sides.

    With it do those whose margins it makes another, and those that are evaluated only then, which may have changed
    sides unseen: they get the side on which they are.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    xdd: d2Delta/dt2 (m/s^2).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    _, _, _, _, who = _lowest(p, x, xd, mode, t, curves, l0)
    if who < 0:
        return mode
    mode &= IDLE - 1
    new = mode ^ (1 << who)
    near = ZERO_MARGIN * max(1.0, abs(x))
    for switch in range(int(curves[int(p[AT]) + 2])):
        if switch == who:
            continue
        g, _, _, _, before = _seen(p, x, xd, mode | (1 << switch), t, curves, l0, switch)
        now, _, _, _, after = _seen(p, x, xd, new | (1 << switch), t, curves, l0, switch)
        if after > 0.5 and (before < 0.5 or abs(now - g) > near):
            side = _side(p, x, xd, xdd, new, t, curves, l0, switch)
            if (new >> switch) & 1 != side:
                new ^= 1 << switch
    return _marked(p, new, curves)


@inline
def expression_start(p, x, xd, xdd, t, curves, l0):
    """The mode at the start: inner switches first, of which margins of later ones may depend.

    p (PARAMETERS,): its parameters, and where its data begin.
    x, xd: elongation (m) and its rate (m/s).
    xdd: d2Delta/dt2 (m/s^2).
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    mode = 0
    for switch in range(int(curves[int(p[AT]) + 2])):
        if _side(p, x, xd, xdd, mode, t, curves, l0, switch) == 1:
            mode |= 1 << switch
    return _marked(p, mode, curves)


@inline
def expression_grazes(p, x, mode, t, curves, l0):
    """How derivatives would change if a mode were only just left: not at all (0), by the force (1), by the motion
    (2).

    As at a gap: a force that jumps changes the motion; one that begins with the rate changes itself, and the motion too
    where further switches may hold it on the way back.

    p (PARAMETERS,): its parameters, and where its data begin.
    x: elongation (m).
    mode: the bits of the switches.
    t: time (s).
    curves: data of all laws.
    l0: free length (m).
    """
    _, _, _, _, who = _lowest(p, x, 0.0, mode, t, curves, l0)
    if who < 0:
        return 0
    at = int(p[AT])
    other = mode ^ (1 << who)
    f, _, by_rate, _, _ = call_formula(curves[at], p, x, 0.0, t, l0, mode, FORCE)
    g, _, of_rate, _, _ = call_formula(curves[at], p, x, 0.0, t, l0, other, FORCE)
    if abs(f - g) > 1e-6 * max(abs(f), abs(g)):
        return 2
    if by_rate == of_rate:
        return 0
    return 2 if curves[at + 2] > 1.0 else 1


KERNELS = LawKernels(
    is_smooth=expression_is_smooth,
    is_watched=expression_is_watched,
    is_even=expression_is_even,
    force=expression_force,
    slopes=expression_slopes,
    rest_slopes=expression_rest_slopes,
    by_time=expression_by_time,
    is_timed=expression_is_timed,
    unstretched=expression_unstretched,
    modes=Modes(
        margin=expression_margin,
        margin_slopes=expression_margin_slopes,
        margin_by_time=expression_margin_by_time,
        margins=expression_margins,
        one_margin=expression_one_margin,
        margin_slope=expression_margin_slope,
        margin_rest_slope=expression_margin_rest_slope,
        next_mode=expression_next,
        first_mode=expression_start,
        switches=expression_switches,
        idle=expression_idle,
        grazes=expression_grazes,
        sharp=expression_sharp,
    ),
    data=expression_data,
)
