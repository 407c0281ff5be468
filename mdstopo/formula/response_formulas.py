"""What kernels ask of the formula of a response: its value, slopes, and margins of its switches, in groups.

Names in it are "p 0" and so on: first of the responses that it is made of, then of its parameters; and t.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from mdstopo.formula.calculus import ONE, call, derivative, is_number, substituted
from mdstopo.formula.law_formulas import Group, by_place, group_of, guards_of, lowest_of
from mdstopo.formula.parser import TIME, parse
from mdstopo.formula.smooth_modes import has_bits, smooth
from mdstopo.formula.tree import NUMBER, Expression, name, names_in

#: group of the value and its slope by t; that of the smallest margin; the first of those with slopes by responses
VALUE, LOWEST, SLOPES = 0, 1, 2
#: slopes in a group
WIDTH = 5


class ResponseProgram(NamedTuple):
    """Groups of formulas of a response.

    parts: how many groups its slopes by responses take; those of a margin follow its value, which is a group with its
    slope by t and whether it is evaluated. switches: how many kinks and jumps it has. by_time_alone: of each, whether
    the motion has no part in it, as in that of step(t - 2).
    is_timed: whether t is in it. is_norm: whether it is a root (times a number above 0), which has a kink at zero.
    """

    groups: tuple[Group, ...]
    parts: int
    switches: int
    by_time_alone: tuple[bool, ...]
    is_timed: bool
    is_norm: bool

    def margin_group(self, switch: int) -> int:
        """The group of a switch's margin, its slope by t and whether it is evaluated."""
        return SLOPES + self.parts + switch * (1 + self.parts)


@functools.lru_cache(maxsize=256)
def response_program(
    text: str, names: tuple[str, ...], responses: int, signed: tuple[int, ...] = ()
) -> ResponseProgram:
    """Value, derivatives and switches of a formula. Raises TooManySwitchesError.

    names: of the responses, which come first, and of the parameters. responses: how many they are. signed: the places
    of those that come with a sign, where the formula means the absolute value.
    """
    known = by_place(names)
    known |= {name(names[place]): call("abs", name(f"p {place}")) for place in signed}
    root = substituted(parse(text).root, known)
    moving = [f"p {place}" for place in range(responses)]
    found = smooth((root,), (*moving, TIME))
    (f,) = found.formulas
    margins = [switch.margin for switch in found.switches]
    groups = [
        group_of((f, derivative(f, TIME)), guards_of([(f, ONE)])),
        group_of((lowest_of(margins, found.switches),)),
    ]
    groups += _slopes(f, moving)
    for switch in found.switches:
        groups.append(group_of((switch.margin, derivative(switch.margin, TIME), switch.relevant)))
        groups += _slopes(switch.margin, moving)
    parts = -(-responses // WIDTH)
    alone = tuple(not has_bits(margin) and set(moving).isdisjoint(names_in(margin)) for margin in margins)
    return ResponseProgram(tuple(groups), parts, len(margins), alone, TIME in names_in(root), _is_norm(root))


def _slopes(formula: Expression, moving: list[str]) -> list[Group]:
    """Derivatives by some names, as many groups as they need."""
    slopes = [derivative(formula, word) for word in moving]
    return [group_of(tuple(slopes[first : first + WIDTH])) for first in range(0, len(slopes), WIDTH)]


def _is_norm(root: Expression) -> bool:
    """Whether a formula is a root, perhaps times or by a number above 0."""
    if root.operator in ("*", "/"):
        left, right = root.operands
        if right.operator == NUMBER and right.value > 0.0:
            return _is_norm(left)
        return root.operator == "*" and left.operator == NUMBER and left.value > 0.0 and _is_norm(right)
    return root.operator == "sqrt" or (root.operator == "^" and is_number(root.operands[1], 0.5))
