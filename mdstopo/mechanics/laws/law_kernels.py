"""What a member law does: one record of kernels; `law_table` makes the branches by code from these records.

A kernel is an `inline` function. It takes what it needs of the following, in any order, by these names:

    p (PARAMETERS,)  the law's parameters, `Law.row` of its record
    x, xd            elongation Delta in m, of a law that remembers less its permanent set, and its rate in m/s
    xdd              d2Delta/dt2 in m/s^2 (`next_mode`, `first_mode`)
    mode             the mode that the member is in, a whole number; 0 for laws that do not switch
    t                time in s
    value            the present value in N of a force that is given over time (`signal`)
    curves           numbers of all laws of the scene (`data`)
    l0               the member's free length in m
    place            of a parameter in p (kernels that differentiate by it)
    old, new         modes (kernels of a permanent set)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mdstopo.case.arrays import Table
from mdstopo.compiler.kernel import Kernel

#: kernels are typed as functions where they are written
Function = Kernel | Callable[..., Any]


@dataclass(frozen=True, kw_only=True)
class Modes:
    """The kernels of a law that switches: within a mode it is smooth, and a member stays in it until its margin is
    used up.

    margin: how far the mode is from its end, not negative as long as it holds. margin_slopes: of it by x and xd.
    margin_slope: of it by the parameter at a place; None where no parameter that may vary is in it.
    margin_by_time: its slope by time; None where it does not depend on it.
    margin_rest_slope: its slope by the free length at fixed elongation; None where there is none.
    margins (p, mode, curves), one_margin: of a law whose margin is the least of several, how many there are in a mode,
    and one of them by its number `which`, with its slopes by x, xd and t; None where there is one. Each has to be as
    smooth as the motion: a member that leaves its mode and comes back within a step is found on a cubic through each.
    `margin` and `margin_slopes` may be those of the least of them, as in `crush`.
    next_mode: where to go behind the end. first_mode: at the start of the motion.
    switches (p, curves): whether this law has several modes at all; None where it always has.
    idle (mode): whether nothing acts and nothing is stored in a mode; None where that is true of none.
    grazes (p, x, mode, t, curves, l0): what a margin that is only just used up (or not) does to derivatives: nothing 0,
    the force 1, the motion 2; None where it is always 0.
    sharp (p, x, xd, mode, t, curves, l0): whether slopes of the force begin with a root at the end of a mode that is
    nearest, so that steps beside it have to be short; None where that is true of none.
    degree: of a law whose force in a mode is a polynomial in x of this degree at most, and a constant times xd, and
    whose energy is one in x of the next degree: 1 to 3; None where that is not so, or not known. Of such a
    law the margin of a mode is the lesser of at most two linear functions of elongation and rate, and knows no time.
    pieces: whether modes are pieces of one function whose stiffness is continuous: steps may pass over the end of a
    mode, and then lose accuracy, derivatives most of all (`general.dynamics.members.knotted_at`).
    """

    margin: Function
    margin_slopes: Function
    next_mode: Function
    first_mode: Function
    margin_slope: Function | None = None
    margin_by_time: Function | None = None
    margin_rest_slope: Function | None = None
    margins: Function | None = None
    one_margin: Function | None = None
    switches: Function | None = None
    idle: Function | None = None
    grazes: Function | None = None
    sharp: Function | None = None
    degree: int | None = None
    pieces: bool = False


@dataclass(frozen=True, kw_only=True)
class PermanentSet:
    """The kernels of a law that remembers: its elongation counts from a permanent set, which grows where a mode
    ends.

    growth (p, x, old, new): by how much in m. first (p, x, mode): what a member has that begins in a mode.
    is_made (old, new): whether the set is written down where `old` gives way to `new`, and not just left as it was.
    slope (p, place): of the set, where it is made, by a parameter, at fixed places of the member's ends.
    divides (p, x, xd, mode, near): whether a member begins so, within `near` m, that it has a set which depends on the
    law's parameters on one side only.
    """

    growth: Function
    first: Function
    is_made: Function
    slope: Function
    divides: Function


@dataclass(frozen=True, kw_only=True)
class LawKernels:
    """The kernels of a member law, and what it can do.

    force: f, f_x, f_xd, V, V_x: force in N, its slopes by x and xd, stored energy in J and its slope by x.
    slopes: df/dp, dV/dp by the parameter at a place; None where no parameter may vary.
    rest_slopes: df/dl0, dV/dl0 by the free length at fixed elongation; None where there are none.
    by_time: df/dt in N/s at fixed elongation and rate; None where the force is not of time, or by a table of it.
    is_timed (p, curves): whether `by_time` may be other than zero; None where it may always be.
    unstretched (p, curves): the largest force that does not come from elongation; None where there is none, or it is
    given.
    modes: of a law that switches. permanent_set: of one that remembers, which switches too.
    linear: the force is p[0] x + p[1] xd + p[2], for which there are vectors over many members.
    inertial: the force is p[0] d2Delta/dt2: part of the mass (`general.dynamics.forces`), with no kernel here.
    signal (record): of a force that is given over time, the table.
    breakpoints (record, fine): times at which steps have to end: kinks, jumps, narrow peaks; fine: see
    `pulse.breakpoints`.
    is_smooth (record): of a law with modes, whether it has one mode only as it is stated.
    is_watched (record): whether modes may come and go by time alone, so that steps have to be short.
    is_even (record): of a law with modes or formulas, whether what members near each other do can be told from few of
    them where their modes are the same: margins are, at one time, the least of functions that are linear in x and xd
    and know no free length; and within a mode force and energy are as smooth as polynomials. None: it is not.
    data (record, at): parameters and numbers for `curves`, of which the first will stand at place `at`; a law that has
    it does not use `Law.row`; parameters that vary stand first in its row.
    """

    force: Function | None = None
    slopes: Function | None = None
    rest_slopes: Function | None = None
    by_time: Function | None = None
    is_timed: Function | None = None
    unstretched: Function | None = None
    modes: Modes | None = None
    permanent_set: PermanentSet | None = None
    linear: bool = False
    inertial: bool = False
    signal: Callable[[Any], Table] | None = None
    breakpoints: Callable[[Any, bool], list[float]] | None = None
    is_smooth: Callable[[Any], bool] | None = None
    is_watched: Callable[[Any], bool] | None = None
    is_even: Callable[[Any], bool] | None = None
    data: Callable[[Any, int], tuple[list[float], list[float]]] | None = None


def always(record: Any) -> bool:
    """True of every law of a kind, whatever its parameters are: for `LawKernels.is_even`."""
    return True
