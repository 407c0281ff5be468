"""What kernels ask of a formula of time: its value, rate and second derivative, and margins of its switches, in groups.

Names in it are t, and "p 0" and so on for its parameters.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from mdstopo.formula.calculus import ONE, derivative, substituted
from mdstopo.formula.formula_values import value_of
from mdstopo.formula.law_formulas import Group, by_place, group_of, guards_of, lowest_of
from mdstopo.formula.parser import TIME, parse
from mdstopo.formula.smooth_modes import smooth

#: group of value, rate and second derivative; that of the smallest margin; those of a switch: margin, rate, evaluated
VALUE, LOWEST, MARGIN = 0, 1, 2


class TimeProgram(NamedTuple):
    """Groups of a formula of time, and how many switches it has."""

    groups: tuple[Group, ...]
    switches: int


@functools.lru_cache(maxsize=256)
def time_program(text: str, names: tuple[str, ...]) -> TimeProgram:
    """Value, derivatives and switches of a formula; names: of its parameters. Raises TooManySwitchesError."""
    root = substituted(parse(text).root, by_place(names))
    found = smooth((root,), (TIME,))
    (f,) = found.formulas
    rate = derivative(f, TIME)
    margins = [switch.margin for switch in found.switches]
    groups = [
        group_of((f, rate, derivative(rate, TIME)), guards_of([(f, ONE)])),
        group_of((lowest_of(margins, found.switches),)),
    ]
    groups += [group_of((each.margin, derivative(each.margin, TIME), each.relevant)) for each in found.switches]
    return TimeProgram(tuple(groups), len(margins))


def value_at(text: str, parameters: tuple[tuple[str, float], ...], time: float) -> float:
    """The value of a formula of time; NaN where it has none."""
    return value_of(parse(text).root, {**dict(parameters), TIME: time})


def rate_at(text: str, parameters: tuple[tuple[str, float], ...], time: float) -> float:
    """The rate of a formula of time, that of the side in which it is at a kink; NaN where it has none."""
    return value_of(derivative(parse(text).root, TIME), {**dict(parameters), TIME: time})
