"""Where formulas are 0 whatever else there is: sides of switches on which a law does nothing.

`if(x >= g, k*(x - g), 0)` is 0 while its switch is on the one side, and `k*max(-x, 0)^n` is, too, where n is above 0.
Nothing is computed there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from mdstopo.formula.calculus import ONE, ZERO, is_number, substituted
from mdstopo.formula.formula_values import value_of
from mdstopo.formula.smooth_modes import bit
from mdstopo.formula.tree import NAME, NUMBER, Expression, names_in, operation, parts

#: sides that are kept at most, and sides that are evaluated
MOST_SIDES, MOST_TRIED = 8, 100


class Idle(NamedTuple):
    """A combination of sides of switches on which formulas are 0.

    which, sides: the switches as bits, and on which side each has to be. place, above: where place is not negative, the
    parameter there has to be above this.
    """

    which: int
    sides: int
    place: int = -1
    above: float = 0.0

    def holds(self, mode: int, parameters: Sequence[float]) -> bool:
        """Whether the formulas are 0 because of this, at these sides of switches and these parameters."""
        return mode & self.which == self.sides and (self.place < 0 or parameters[self.place] > self.above)


class _NotKnownError(Exception):
    """It is not known whether formulas are 0."""


def idle_sides(formulas: tuple[Expression, ...], guards: Sequence[tuple[Expression, Expression]]) -> tuple[Idle, ...]:
    """The sides of switches ("bit 0" and so on) on which formulas are 0, as far as they are found with little work.

    guards: operations that may have no value, and of each what is not 0 where it is evaluated. Where one may have none,
    formulas are not taken to be 0.
    """
    found: list[Idle] = []
    waiting = [(formulas, 0, 0)]
    looks = 0
    while waiting and looks < MOST_TRIED and len(found) < MOST_SIDES:
        looks += 1
        roots, which, sides = waiting.pop()
        try:
            of_parameters = _zero(roots, guards, _on_sides(which, sides))
        except _NotKnownError:
            place = _first_switch(roots)
            if place is not None:
                split = []
                for side in range(2):
                    on_side = {bit(place): ONE if side else ZERO}
                    kept = tuple(substituted(each, on_side) for each in roots)
                    split.append((kept, which | 1 << place, sides | side << place))
                # what is left of less first: more of it may be 0
                waiting += sorted(split, key=lambda each: -sum(1 for _ in parts(*each[0])))
            continue
        found.append(Idle(which, sides, *of_parameters))
    return tuple(found)


def _first_switch(roots: tuple[Expression, ...]) -> int | None:
    """The switch that is evaluated first in some formulas; None where they have none."""
    words = (word for word in names_in(*roots) if word.startswith("bit "))
    return next((int(word.removeprefix("bit ")) for word in words), None)


def _on_sides(which: int, sides: int) -> dict[Expression, Expression]:
    """What stands for switches that are on some sides."""
    places = (place for place in range(which.bit_length()) if which >> place & 1)
    return {bit(place): ONE if sides >> place & 1 else ZERO for place in places}


def _zero(
    roots: Sequence[Expression], guards: Sequence[tuple[Expression, Expression]], on_sides: dict[Expression, Expression]
) -> tuple[int, float]:
    """Of which parameter, and above what, formulas are 0 (`Idle`). Raises _NotKnownError.

    on_sides: what stands for switches, in guards.
    """
    exponents: set[Expression] = set()
    for root in roots:
        if not is_number(_without_powers_of_zero(root, exponents), 0.0):
            raise _NotKnownError
    for part, reached in guards:
        if not is_number(substituted(reached, on_sides), 0.0):
            operands = [substituted(each, on_sides) for each in part.operands]
            if not _has_value(part.operator, operands, exponents):
                raise _NotKnownError
    place, above = -1, -math.inf
    for exponent in exponents:
        which, least = _parameter_above(exponent)
        if place not in (-1, which):
            raise _NotKnownError
        place, above = which, max(above, least)
    return (place, above) if place >= 0 else (-1, 0.0)


def _without_powers_of_zero(root: Expression, exponents: set[Expression]) -> Expression:
    """An expression with 0 in place of powers of 0, whose exponents, which have to be above 0, are added."""
    while True:
        powers = [part for part in parts(root) if part.operator == "^" and is_number(part.operands[0], 0.0)]
        if not powers:
            return root
        exponents.update(part.operands[1] for part in powers)
        root = substituted(root, dict.fromkeys(powers, ZERO))


def _has_value(operator: str, operands: Sequence[Expression], positive: set[Expression]) -> bool:
    """Whether an operation is known to have a value. positive: what is above 0 for another reason."""
    last = operands[-1]
    if all(each.operator == NUMBER for each in operands):
        return math.isfinite(value_of(operation(operator, *operands), {}))
    if operator == "/":
        return last in positive or (last.operator == NUMBER and last.value != 0.0)
    return operator in ("^", "powlog") and is_number(operands[0], 0.0) and last in positive


def _parameter_above(exponent: Expression) -> tuple[int, float]:
    """The place of a parameter, and above what it has to be for an exponent to be above 0. Raises _NotKnownError."""
    shift = 0.0
    part = exponent
    while part.operator in ("+", "-"):
        left, right = part.operands
        if right.operator == NUMBER:
            part, shift = left, shift + (right.value if part.operator == "+" else -right.value)
        elif left.operator == NUMBER and part.operator == "+":
            part, shift = right, shift + left.value
        else:
            raise _NotKnownError
    if part.operator != NAME or not part.word.startswith("p "):
        raise _NotKnownError
    return int(part.word.removeprefix("p ")), -shift


def as_numbers(sides: Sequence[Idle]) -> Iterator[float]:
    """The combinations as numbers for kernels: how many there are, and of each four numbers."""
    yield float(len(sides))
    for each in sides:
        yield from (float(each.which), float(each.sides), float(each.place), each.above)
