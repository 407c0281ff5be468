"""What kernels ask of a law's formulas: values and derivatives, in groups."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import NamedTuple

from mdstopo.formula.calculus import (
    ONE,
    ZERO,
    add,
    call,
    choose,
    derivative,
    divide,
    is_number,
    negate,
    simplified,
    substituted,
)
from mdstopo.formula.even import is_even
from mdstopo.formula.idle import Idle, idle_sides
from mdstopo.formula.parser import parse
from mdstopo.formula.sharp import sharp_switches
from mdstopo.formula.smooth_modes import (
    HALF,
    MOST_SWITCHES,
    MOTION,
    Smooth,
    Switch,
    TooManySwitchesError,
    is_set,
    smooth,
    ways_to,
)
from mdstopo.formula.tree import NUMBER, Expression, name, names_in, number, operation, parts

#: groups that stand before those of parameters: the force, and the smallest margin
FORCE, LOWEST, FIRST = 0, 1, 2
#: operations of all groups at most
MOST_OPERATIONS = 20_000
#: stands for the smallest margin where no switch is evaluated
NO_MARGIN = number(1e300)
#: slopes below the one count as zero, those above the other as infinite
ZERO_SLOPE, INFINITE_SLOPE = number(1e-300), number(1e100)
#: functions that have no value for some operands; for powers and quotients the second operand decides (`_may_fail`)
PARTIAL = ("sqrt", "powlog", "log", "asin", "acos")


class Guard(NamedTuple):
    """An operation that may have no value, and an expression that is 1 where it is evaluated, else 0."""

    part: Expression
    reached: Expression


class Group(NamedTuple):
    """Formulas that are computed together; guards: what must hold where they are, so that they have values."""

    values: tuple[Expression, ...]
    guards: tuple[Guard, ...] = ()


class Program(NamedTuple):
    """Groups of formulas, and how many parameters and switches they have.

    idle: on which sides of switches force and energy are 0. sharp: the switches, as bits, at which slopes of the force
    begin with a root. even: see `even.is_even`.
    """

    groups: tuple[Group, ...]
    parameters: int
    switches: int
    idle: tuple[Idle, ...]
    sharp: int
    even: bool

    @property
    def has_timed_switches(self) -> bool:
        """Whether the margin of a switch depends on time."""
        first = FIRST + 1 + self.parameters
        return any(not is_number(group.values[3], 0.0) for group in self.groups[first : first + self.switches])

    @property
    def has_curved_switches(self) -> bool:
        """Whether the margin of a switch is not linear in time, and may change its sign while nothing moves."""
        first = FIRST + 1 + self.parameters
        return any("t" in names_in(group.values[3]) for group in self.groups[first : first + self.switches])

    @property
    def by_time(self) -> int:
        """The group with the slope of the force by time."""
        return len(self.groups) - 1

    @property
    def is_timed(self) -> bool:
        """Whether the force depends on time by itself, within a mode."""
        return not is_number(self.groups[-1].values[0], 0.0)

    @property
    def operations(self) -> int:
        """How many operations all groups have, equal ones of a group once."""
        return operations_of(self.groups)


def operations_of(groups: tuple[Group, ...]) -> int:
    """How many operations groups of formulas have, equal ones of a group once."""
    return sum(sum(1 for _ in parts(*group.values)) for group in groups)


def why_too_large(groups: Callable[[], tuple[Group, ...]]) -> str:
    """Why formulas are too large to be used; nothing where they are not. groups: makes them."""
    try:
        operations = operations_of(groups())
    except TooManySwitchesError:
        which = "abs, min, max, clip, sign, step, if"
        return f"found more kinks and jumps ({which}) than allowed, which are {MOST_SWITCHES}"
    if operations <= MOST_OPERATIONS:
        return ""
    return f"found {operations} operations in the formulas with all derivatives, allowed are {MOST_OPERATIONS} at most"


def by_place(names: tuple[str, ...]) -> dict[Expression, Expression]:
    """The names that stand for numbers in formulas: "p 0" and so on, by their places."""
    return {name(word): name(f"p {place}") for place, word in enumerate(names)}


def _smooth(force: str | None, energy: str | None, damping: str | None, names: tuple[str, ...]) -> Smooth:
    """Force and energy, or energy and damping, with bits for comparisons and "p 0" and so on for parameters."""
    known = {**by_place(names), name("l"): add(name("x"), name("l0"))}

    def read(text: str | None) -> Expression:
        return ZERO if text is None else substituted(parse(text).root, known)

    return smooth((read(energy), read(damping)) if force is None else (read(force), read(energy)), MOTION)


@functools.lru_cache(maxsize=256)
def program(force: str | None, energy: str | None, damping: str | None, names: tuple[str, ...]) -> Program:
    """What kernels ask of a law's formulas.

    Names in them are x, xd, t, l0, "p 0" and so on for parameters, "bit 0" and so on for switches. Groups are: f, f_x,
    f_xd, V, V_x; the smallest margin; then for each parameter, and for the free length, f_p, V_p; then for each switch
    its margin g, g_x, g_xd, g_t, and whether it is evaluated; then g_p, by switches, for each parameter and the free
    length; last f_t. Margins and their slopes are divided by `_near`. Raises TooManySwitchesError.
    """
    found = _smooth(force, energy, damping, names)
    if force is None:
        v, damped = found.formulas
        f = add(derivative(v, "x"), damped)
    else:
        f, v = found.formulas
    words = [*(f"p {place}" for place in range(len(names))), "l0"]
    near = [_near(switch.margin) for switch in found.switches]
    margins = [divide(switch.margin, size) for switch, size in zip(found.switches, near, strict=True)]
    guards = guards_of([(f, ONE), (v, ONE), *((each.margin, each.relevant) for each in found.switches)])
    groups = [
        group_of((f, derivative(f, "x"), derivative(f, "xd"), v, derivative(v, "x")), guards),
        group_of((lowest_of(margins, found.switches),)),
    ]
    for word in words:
        both = derivative(f, word), derivative(v, word)
        groups.append(group_of(both, guards_of([(slope, ONE) for slope in both])))
    for (margin, relevant), size, value in zip(found.switches, near, margins, strict=True):
        slopes = tuple(divide(derivative(margin, word), size) for word in MOTION)
        groups.append(group_of((value, *slopes, relevant)))
    for (margin, _), size in zip(found.switches, near, strict=True):
        groups += [group_of((divide(derivative(margin, word), size),)) for word in words]
    by_time = derivative(f, "t")
    groups.append(group_of((by_time,), guards_of([(by_time, ONE)])))
    sharp = sharp_switches(f, [switch.margin for switch in found.switches], MOTION)
    even = is_even((f, v), [switch.margin for switch in found.switches])
    return Program(tuple(groups), len(names), len(found.switches), idle_sides((f, v), guards), sharp, even)


def group_of(values: tuple[Expression, ...], guards: Iterable[Guard] = ()) -> Group:
    """Expressions that are evaluated together, simplified, with the conditions under which they have values."""
    made = (Guard(simplified(each.part), simplified(each.reached)) for each in guards)
    return Group(tuple(simplified(each) for each in values), tuple(each for each in made if _may_fail(each.part)))


def _near(margin: Expression) -> Expression:
    """By what a margin is divided to be about a distance in m, m/s or s: the sum of its slopes; 1 where it is one.

    So a margin of any scale, and one that is a power, is found zero where it is, and not where its value is small.
    """
    slopes = [derivative(margin, word) for word in MOTION]
    if all(slope.operator == NUMBER for slope in slopes):
        return ONE
    size = ZERO
    for slope in slopes:
        size = add(size, call("abs", slope))
    return choose(operation("<", size, INFINITE_SLOPE), call("max", size, ZERO_SLOPE), ONE)


def lowest_of(margins: list[Expression], switches: tuple[Switch, ...]) -> Expression:
    """The smallest margin of the switches that are evaluated, each with the sign that its mode makes positive."""
    lowest = NO_MARGIN
    for place, (margin, switch) in enumerate(zip(margins, switches, strict=True)):
        signed = choose(is_set(place), margin, negate(margin))
        if not is_number(switch.relevant, 1.0):
            signed = choose(operation(">", switch.relevant, HALF), signed, NO_MARGIN)
        lowest = signed if lowest is NO_MARGIN else call("min", lowest, signed)
    return lowest


def guards_of(roots: list[tuple[Expression, Expression]]) -> list[Guard]:
    """The operations in formulas that may have no value, each with a number that is 1 where it is evaluated."""
    ways = ways_to(*roots)
    return [Guard(part, way) for part, way in ways.items() if _may_fail(part) and not is_number(way, 0.0)]


def _may_fail(part: Expression) -> bool:
    """Whether an operation has no value for some operands."""
    if part.operator not in ("^", "/"):
        return part.operator in PARTIAL
    last = part.operands[1]
    return last.operator != NUMBER or (part.operator == "^" and last.value != round(last.value))
