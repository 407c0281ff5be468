"""Formulas without kinks and jumps: what is left of them while every comparison keeps its outcome.

Each comparison becomes a switch: an expression that is not negative on one side. In a formula stands the switch's bit,
a name whose value is 1 or 0, in its place. While the bits stay as they are the formula is smooth; where a switch passes
zero its bit changes. Comparisons of what does not change during a motion are no switches and stay.
"""

from __future__ import annotations

from collections.abc import Collection
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
    multiply,
    negate,
    power,
    rebuilt,
    subtract,
    where_not_zero,
)
from mdstopo.formula.tree import COMPARISONS, NUMBER, Expression, name, names_in, number, operation, parts

HALF = number(0.5)
#: names that change while a mode lasts
MOTION = ("x", "xd", "t")
#: switches of a law at most: the side of each is a bit of a number
MOST_SWITCHES = 40


class TooManySwitchesError(Exception):
    """Formulas with more than `MOST_SWITCHES` kinks and jumps."""


class Switch(NamedTuple):
    """A switch of a formula. margin: an expression whose sign sets its bit; relevant: an expression of bits, 1 where
    the switch is evaluated, else 0."""

    margin: Expression
    relevant: Expression


class Smooth(NamedTuple):
    """Formulas in which comparisons have become bits, and the switches that set the bits, inner ones first."""

    formulas: tuple[Expression, ...]
    switches: tuple[Switch, ...]


def bit(place: int) -> Expression:
    """The expression for the bit of a switch: 1 on one of its sides, 0 on the other."""
    return name(f"bit {place}")


def is_set(place: int) -> Expression:
    """The condition of an `if`: that the bit of a switch is 1."""
    return operation(">", bit(place), HALF)


def smooth(formulas: tuple[Expression, ...], moving: Collection[str]) -> Smooth:
    """Formulas in their smooth form. moving: the names that change during a motion; the others are parameters.

    Raises TooManySwitchesError.
    """
    made = _Switches(frozenset(moving))
    found = tuple(made.smooth(each) for each in formulas)
    margins = tuple(made.margins)
    reached = _reached(found, margins)
    return Smooth(found, tuple(Switch(margin, reached[i]) for i, margin in enumerate(margins)))


class _Switches:
    def __init__(self, moving: frozenset[str]) -> None:
        self.moving = moving
        self.margins: list[Expression] = []
        self.known: dict[Expression, Expression] = {}

    def smooth(self, root: Expression) -> Expression:
        """One formula."""
        for part in parts(root):
            if part not in self.known and part.operator not in COMPARISONS:
                self.known[part] = self.part(part, tuple(self.known.get(each, each) for each in part.operands))
        return self.known[root]

    def part(self, part: Expression, u: tuple[Expression, ...]) -> Expression:
        """An operation of operands that are smooth already."""
        match part.operator:
            case "abs":
                return self.either(u[0], u[0], negate(u[0]))
            case "sign":
                return self.either(u[0], ONE, number(-1.0))
            case "step":
                return self.either(u[0], ONE, ZERO)
            case "min" | "max":
                best = u[0]
                for each in u[1:]:
                    one, other = (each, best) if part.operator == "max" else (best, each)
                    best = self.either(subtract(each, best), one, other)
                return best
            case "clip":
                highest = self.either(subtract(u[1], u[2]), u[1], u[2])
                return self.either(subtract(u[2], u[0]), self.either(subtract(u[0], u[1]), u[0], u[1]), highest)
            case "if":
                left, right = (self.known[each] for each in part.operands[0].operands)
                if part.operands[0].operator in (">", ">="):
                    return self.either(subtract(left, right), u[1], u[2])
                return self.either(subtract(right, left), u[1], u[2])
        # step(x)*x^1.5 is nothing where step(x) is, though x^1.5 has no value there
        if part.operator == "*":
            return where_not_zero(u[0], lambda one: where_not_zero(u[1], lambda other: multiply(one, other)))
        if part.operator == "/":
            return where_not_zero(u[0], lambda one: divide(one, u[1]))
        if part.operator == "^" and u[1].operator == NUMBER and u[1].value > 0.0:
            return where_not_zero(u[0], lambda one: power(one, u[1]))
        return rebuilt(part, u)

    def either(self, margin: Expression, one: Expression, other: Expression) -> Expression:
        """The one where a margin is not negative, else the other."""
        if margin.operator == NUMBER:
            return one if margin.value >= 0.0 else other
        if one is other:
            return one
        if not self.moving.intersection(names_in(margin)) and not has_bits(margin):
            return choose(operation(">=", margin, ZERO), one, other)
        margin = self.scaled(margin)
        if margin in self.margins:
            return choose(is_set(self.margins.index(margin)), one, other)
        if (opposite := negate(margin)) in self.margins:
            return choose(is_set(self.margins.index(opposite)), other, one)
        if len(self.margins) == MOST_SWITCHES:
            raise TooManySwitchesError
        self.margins.append(margin)
        return choose(is_set(len(self.margins) - 1), one, other)

    def scaled(self, margin: Expression) -> Expression:
        """The margin by its slopes where these are numbers, so that comparisons of the same have one switch."""
        slopes = [derivative(margin, word) for word in MOTION]
        if any(slope.operator != NUMBER for slope in slopes):
            return margin
        return _divided(margin, sum(abs(slope.value) for slope in slopes))


def _divided(margin: Expression, by: float) -> Expression:
    """A margin by a number's magnitude, term by term."""
    size = abs(by)
    if size in (0.0, 1.0):
        return margin
    if margin.operator in ("+", "-"):
        left, right = (_divided(each, size) for each in margin.operands)
        return add(left, right) if margin.operator == "+" else subtract(left, right)
    if margin.operator == "neg":
        return negate(_divided(margin.operands[0], size))
    return multiply(number(1.0 / size), margin)


def has_bits(root: Expression) -> bool:
    """Whether sides of switches are in a formula."""
    return any(word.startswith("bit ") for word in names_in(root))


def _reached(formulas: tuple[Expression, ...], margins: tuple[Expression, ...]) -> list[Expression]:
    """Of each switch, from the bits: 1 where a formula needs it, by itself or through a switch that is evaluated."""
    relevant = [ZERO] * len(margins)
    for root in formulas:
        _note(root, ONE, relevant)
    for place in reversed(range(len(margins))):  # a margin has bits of earlier switches alone
        if not is_number(relevant[place], 0.0):
            _note(margins[place], relevant[place], relevant)
    return relevant


def _note(root: Expression, reached: Expression, relevant: list[Expression]) -> None:
    """Add where a formula needs switches, if it is evaluated itself where `reached` is 1."""
    for part, way in ways_to((root, reached)).items():
        if part.operator == "if" and part.operands[0].operands[1] is HALF and has_bits(part.operands[0]):
            place = int(part.operands[0].operands[0].word.removeprefix("bit "))
            relevant[place] = either_of(relevant[place], way)


def ways_to(*roots: tuple[Expression, Expression]) -> dict[Expression, Expression]:
    """Of every part of some formulas, the condition (1 or 0) under which it is evaluated.

    Of what an `if` chooses from, one is evaluated.
    """
    order = list(parts(*(root for root, _ in roots)))
    ways = dict.fromkeys(order, ZERO)
    for root, reached in roots:
        ways[root] = either_of(ways[root], reached)
    for part in reversed(order):
        way = ways[part]
        if part.operator == "if":
            condition, one, other = part.operands
            ways[condition] = either_of(ways[condition], way)
            ways[one] = either_of(ways[one], choose(condition, way, ZERO))
            ways[other] = either_of(ways[other], choose(condition, ZERO, way))
        else:
            for each in part.operands:
                ways[each] = either_of(ways[each], way)
    return ways


def either_of(a: Expression, b: Expression) -> Expression:
    """The expression that is 1 where one of two conditions, each 0 or 1, is 1."""
    if a is b or is_number(b, 0.0) or is_number(a, 1.0):
        return a
    if is_number(a, 0.0) or is_number(b, 1.0):
        return b
    return call("max", a, b)
