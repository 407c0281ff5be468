"""Whether formulas of a law are even: between switches all their values can be interpolated from few.

Polynomials of elongation, rate and free length are even, and so are roots and powers of expressions that are linear in
these. Others may bend within a short interval as sharply as at a kink and be flat on both sides of it (`tanh`,
`exp(-x^2)`, `1/(1 + x^2)`), which few values do not show. A switch is even where its margin is linear in elongation and
rate and does not depend on the free length.
"""

from __future__ import annotations

from collections.abc import Iterable

from mdstopo.formula.calculus import derivative, is_number, simplified
from mdstopo.formula.tree import NUMBER, Expression, names_in, parts

#: what differs between members at one time
OF_EACH_MEMBER = frozenset({"x", "xd", "l0"})
#: the highest whole power, and operations of which a polynomial is made
HIGHEST_POWER = 8.0
_PLAIN = frozenset({"+", "-", "*", "neg"})


def is_even(formulas: Iterable[Expression], margins: Iterable[Expression]) -> bool:
    """Whether formulas and margins, with bits for switches, are even."""
    return all(_formula_is_even(each) for each in formulas) and all(_margin_is_even(each) for each in margins)


def _formula_is_even(root: Expression) -> bool:
    return all(_part_is_even(part) for part in parts(root) if _differs(part) and part.operands)


def _part_is_even(part: Expression) -> bool:
    """Whether an operation of what differs between members is one of a polynomial, or a root of what is linear."""
    operands = part.operands
    if part.operator in _PLAIN:
        return True
    if part.operator == "if":
        return not _differs(operands[0])
    if part.operator == "/":
        return not _differs(operands[1])
    if part.operator == "sqrt":
        return _is_linear(operands[0])
    if part.operator == "^" and not _differs(operands[1]):
        exponent = operands[1]
        whole = exponent.operator == NUMBER and exponent.value == round(exponent.value)
        return 0.0 <= exponent.value <= HIGHEST_POWER if whole else _is_linear(operands[0])
    return False


def _margin_is_even(margin: Expression) -> bool:
    return _is_linear(margin) and is_number(simplified(derivative(margin, "l0")), 0.0)


def _is_linear(root: Expression) -> bool:
    """Whether slopes by what differs between members are the same for all of them."""
    return not any(_differs(simplified(derivative(root, word))) for word in OF_EACH_MEMBER)


def _differs(root: Expression) -> bool:
    return not OF_EACH_MEMBER.isdisjoint(names_in(root))
