"""Derivatives of formulas, and what becomes of expressions that are made of simpler ones.

The functions here simplify what they make: numbers are combined, terms and factors that do nothing are left out. With
equal parts being one object that is what keeps derivatives short.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from mdstopo.formula.formula_values import value_of
from mdstopo.formula.tree import NAME, NUMBER, Expression, number, operation, parts

ZERO, ONE, TWO = number(0.0), number(1.0), number(2.0)


def is_number(part: Expression, value: float) -> bool:
    """Whether a part is this number."""
    return part.operator == NUMBER and part.value == value


def add(a: Expression, b: Expression) -> Expression:
    """The expression a + b, simplified."""
    if is_number(a, 0.0):
        return b
    if is_number(b, 0.0):
        return a
    if b.operator == "neg":
        return subtract(a, b.operands[0])
    if a.operator == "neg":
        return subtract(b, a.operands[0])
    return multiply(TWO, a) if a is b else _folded("+", a, b)


def subtract(a: Expression, b: Expression) -> Expression:
    """The expression a - b, simplified."""
    if is_number(b, 0.0):
        return a
    if is_number(a, 0.0):
        return negate(b)
    if b.operator == "neg":
        return add(a, b.operands[0])
    return ZERO if a is b else _folded("-", a, b)


def negate(a: Expression) -> Expression:
    """The expression -a, simplified."""
    if a.operator == NUMBER:
        return number(-a.value + 0.0)
    if a.operator == "neg":
        return a.operands[0]
    return subtract(a.operands[1], a.operands[0]) if a.operator == "-" else operation("neg", a)


def multiply(a: Expression, b: Expression) -> Expression:
    """The expression a b, simplified."""
    if is_number(a, 0.0) or is_number(b, 0.0):
        return ZERO
    if is_number(a, 1.0):
        return b
    if is_number(b, 1.0):
        return a
    if is_number(a, -1.0):
        return negate(b)
    if is_number(b, -1.0):
        return negate(a)
    if a.operator == "neg":
        return negate(multiply(a.operands[0], b))
    if b.operator == "neg":
        return negate(multiply(a, b.operands[0]))
    if b.operator == NUMBER and a.operator != NUMBER:
        a, b = b, a  # numbers come first
    if a.operator == NUMBER and b.operator == "*" and b.operands[0].operator == NUMBER:
        return multiply(number(a.value * b.operands[0].value), b.operands[1])
    return power(a, TWO) if a is b else _folded("*", a, b)


def divide(a: Expression, b: Expression) -> Expression:
    """The expression a / b, simplified."""
    if is_number(b, 1.0):
        return a
    if is_number(a, 0.0) and not is_number(b, 0.0):
        return ZERO
    if a.operator == "neg":
        return negate(divide(a.operands[0], b))
    if a is b and b.operator != NUMBER:
        return ONE
    return _folded("/", a, b)


def power(a: Expression, b: Expression) -> Expression:
    """The expression a^b, simplified."""
    if is_number(b, 0.0) or is_number(a, 1.0):
        return ONE
    return a if is_number(b, 1.0) else _folded("^", a, b)


def choose(condition: Expression, a: Expression, b: Expression) -> Expression:
    """The expression `if(condition, a, b)`, simplified."""
    return a if a is b else operation("if", condition, a, b)


def where_not_zero(part: Expression, make: Callable[[Expression], Expression]) -> Expression:
    """What `make` makes of a part, and 0 where an `if` says that the part is 0, whatever else is multiplied with it."""
    if part.operator == "if":
        condition, one, other = part.operands
        if is_number(one, 0.0) or is_number(other, 0.0):
            made = [each if is_number(each, 0.0) else where_not_zero(each, make) for each in (one, other)]
            return choose(condition, *made)
    return make(part)


def call(function: str, *operands: Expression) -> Expression:
    """The expression of any other function of operands."""
    return _folded(function, *operands)


def _folded(operator: str, *operands: Expression) -> Expression:
    """An operation, or the number that it is."""
    made = operation(operator, *operands)
    if all(each.operator == NUMBER for each in operands):
        value = value_of(made, {})
        if math.isfinite(value):
            return number(value)
    return made


_BINARY = {"+": add, "-": subtract, "*": multiply, "/": divide, "^": power}


def rebuilt(part: Expression, operands: tuple[Expression, ...]) -> Expression:
    """The operation of a part with other operands, simplified."""
    if not operands:
        return part
    if part.operator in _BINARY:
        return _BINARY[part.operator](*operands)
    if part.operator == "neg":
        return negate(*operands)
    if part.operator == "if":
        condition, a, b = operands
        return (a if condition.value else b) if condition.operator == NUMBER else choose(condition, a, b)
    return call(part.operator, *operands)


def substituted(root: Expression, by_part: Mapping[Expression, Expression]) -> Expression:
    """An expression with some of its parts replaced, simplified."""
    found: dict[Expression, Expression] = {}
    for part in parts(root):
        found[part] = by_part.get(part) or rebuilt(part, tuple(found[each] for each in part.operands))
    return found[root]


def simplified(root: Expression) -> Expression:
    """An expression without parts that change nothing, such as sums with 0 and products with 1."""
    return substituted(root, {})


def derivative(root: Expression, word: str) -> Expression:
    """The derivative of an expression by a name, simplified. Where there is a kink, that of the side in which it is."""
    found: dict[Expression, Expression] = {}
    for part in parts(root):
        if part.operator == NAME:
            found[part] = ONE if part.word == word else ZERO
        elif part.operator == NUMBER:
            found[part] = ZERO
        else:
            slopes = [found.get(each, ZERO) for each in part.operands]
            quiet = all(is_number(each, 0.0) for each in slopes[1 if part.operator == "if" else 0 :])
            found[part] = ZERO if quiet else _slope(part, slopes)
    return found[root]


def _slope(part: Expression, slopes: list[Expression]) -> Expression:
    """The derivative of an operation from those of its operands."""
    operator, u = part.operator, part.operands
    if operator in ("+", "-"):
        return _BINARY[operator](*slopes)
    if operator == "neg":
        return negate(slopes[0])
    if operator == "*":
        by_left = where_not_zero(slopes[0], lambda slope: multiply(slope, u[1]))
        return add(by_left, where_not_zero(slopes[1], lambda slope: multiply(u[0], slope)))
    if operator == "/":
        by_upper = where_not_zero(slopes[0], lambda slope: divide(slope, u[1]))
        return subtract(by_upper, where_not_zero(slopes[1], lambda slope: divide(multiply(part, slope), u[1])))
    if operator == "^":
        by_base = _times(multiply(u[1], power(u[0], subtract(u[1], ONE))), slopes[0])
        return by_base if is_number(slopes[1], 0.0) else add(by_base, _times(call("powlog", *u), slopes[1]))
    if operator == "if":
        return choose(u[0], slopes[1], slopes[2])
    if operator in ("min", "max"):
        return _slope_of_extreme(operator, u, slopes)
    if operator == "clip":
        below = _slope_of_extreme("min", (u[0], u[2]), [slopes[0], slopes[2]])
        return choose(operation("<", operation("min", u[0], u[2]), u[1]), slopes[1], below)
    if operator == "atan2":
        square = add(power(u[0], TWO), power(u[1], TWO))
        return divide(subtract(_times(u[1], slopes[0]), _times(u[0], slopes[1])), square)
    if operator in ("sign", "step", "<", "<=", ">", ">="):
        return ZERO
    if operator == "powlog":
        return _slope_of_powlog(part, slopes)
    return _times(_slope_of_function(operator, u[0], part), slopes[0])


def _times(outer: Expression, slope: Expression) -> Expression:
    """The chain rule: nothing where the slope of what is inside is 0, even where the outer one is infinite."""
    return where_not_zero(slope, lambda each: multiply(outer, each))


def _slope_of_powlog(part: Expression, slopes: list[Expression]) -> Expression:
    """Of u^v log u: by u it is v u^(v-1) log u + u^(v-1), by v it is u^v log^2 u."""
    base, exponent = part.operands
    less = subtract(exponent, ONE)
    by_base = add(multiply(exponent, call("powlog", base, less)), power(base, less))
    by_exponent = multiply(part, call("log", base))
    return add(_times(by_base, slopes[0]), _times(by_exponent, slopes[1]))


def _slope_of_extreme(operator: str, u: tuple[Expression, ...], slopes: list[Expression]) -> Expression:
    """The slope of `min` or `max`: that of the first operand that is the least or largest."""
    best, slope = u[0], slopes[0]
    sign = "<" if operator == "min" else ">"
    for each, of_each in zip(u[1:], slopes[1:], strict=True):
        slope = choose(operation(sign, each, best), of_each, slope)
        best = operation(operator, best, each)
    return slope


def _slope_of_function(function: str, u: Expression, value: Expression) -> Expression:
    """The derivative of a function of one operand at u, where it has a value."""
    square = power(u, TWO)
    match function:
        case "abs":
            return call("sign", u)
        case "sqrt":
            return divide(number(0.5), value)
        case "exp":
            return value
        case "log":
            return divide(ONE, u)
        case "sin":
            return call("cos", u)
        case "cos":
            return negate(call("sin", u))
        case "tan":
            return add(ONE, power(value, TWO))
        case "asin":
            return divide(ONE, call("sqrt", subtract(ONE, square)))
        case "acos":
            return divide(number(-1.0), call("sqrt", subtract(ONE, square)))
        case "atan":
            return divide(ONE, add(ONE, square))
        case "sinh":
            return call("cosh", u)
        case "cosh":
            return call("sinh", u)
        case "tanh":
            return subtract(ONE, power(value, TWO))
    raise AssertionError(function)
