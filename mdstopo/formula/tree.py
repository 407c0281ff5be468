"""Trees of formulas: immutable, and equal parts are one object, so that common parts are found by identity.

An expression is an operation with its operands. `NUMBER` has a value, `NAME` a name; all others are in `OPERATIONS`:
those that a formula may write, and a few that only derivatives need.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, NoReturn
from weakref import WeakValueDictionary

NUMBER, NAME = "number", "name"


class Operation(NamedTuple):
    """What an operation is: least and most operands (None: any number); doc: of a function that formulas may call."""

    least: int
    most: int | None
    doc: str = ""


#: functions that a formula may call
FUNCTIONS: dict[str, Operation] = {
    "abs": Operation(1, 1, "magnitude"),
    "min": Operation(2, None, "the least of several"),
    "max": Operation(2, None, "the largest of several"),
    "clip": Operation(3, 3, "clip(x, low, high): x, kept between the two"),
    "sign": Operation(1, 1, "1 from 0 on, -1 below"),
    "step": Operation(1, 1, "1 from 0 on, 0 below"),
    "if": Operation(3, 3, "if(c, a, b): a where the comparison c holds, else b"),
    "sqrt": Operation(1, 1, "square root"),
    "exp": Operation(1, 1, "exponential function"),
    "log": Operation(1, 1, "natural logarithm"),
    "sin": Operation(1, 1, "of an angle in rad"),
    "cos": Operation(1, 1, "of an angle in rad"),
    "tan": Operation(1, 1, "of an angle in rad"),
    "asin": Operation(1, 1, "in rad"),
    "acos": Operation(1, 1, "in rad"),
    "atan": Operation(1, 1, "in rad"),
    "atan2": Operation(2, 2, "atan2(y, x): the angle of the point (x, y), in rad"),
    "sinh": Operation(1, 1, "hyperbolic sine"),
    "cosh": Operation(1, 1, "hyperbolic cosine"),
    "tanh": Operation(1, 1, "hyperbolic tangent"),
}
COMPARISONS = ("<", "<=", ">", ">=")
#: `powlog` is u^v log u, with its limit 0 at u = 0: the slope of a power by its exponent
OPERATIONS: dict[str, Operation] = {
    **FUNCTIONS,
    **{word: Operation(2, 2) for word in ("+", "-", "*", "/", "^", "powlog", *COMPARISONS)},
    "neg": Operation(1, 1),
}


class Expression:
    """A formula, or a part of one. Made by `number`, `name` and `operation`; equal ones are the same object."""

    __slots__ = ("__weakref__", "operands", "operator", "value", "word")

    operator: str
    operands: tuple[Expression, ...]
    value: float
    word: str

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{name} of an expression cannot be changed")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"{name} of an expression cannot be deleted")

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (_listed(self),)

    def __repr__(self) -> str:
        return f"<{text_of(self)}>"


_KNOWN: WeakValueDictionary[tuple[Any, ...], Expression] = WeakValueDictionary()


def _made(operator: str, operands: tuple[Expression, ...], value: float, word: str) -> Expression:
    # 0 and -0 are equal, and not the same
    key = (operator, operands, value.hex(), word)
    known = _KNOWN.get(key)
    if known is None:
        known = Expression.__new__(Expression)
        for field, content in (("operator", operator), ("operands", operands), ("value", value), ("word", word)):
            object.__setattr__(known, field, content)
        known = _KNOWN.setdefault(key, known)
    return known


def number(value: float) -> Expression:
    """The expression that is a number."""
    return _made(NUMBER, (), float(value), "")


def name(word: str) -> Expression:
    """The expression that is a name."""
    return _made(NAME, (), 0.0, word)


def operation(operator: str, *operands: Expression) -> Expression:
    """An operation as it is written, without simplification."""
    least, most, _ = OPERATIONS[operator]
    if len(operands) < least or (most is not None and len(operands) > most):
        raise ValueError(f"{operator} of {len(operands)} operands")
    return _made(operator, operands, 0.0, "")


def parts(*roots: Expression) -> Iterator[Expression]:
    """Every part of some expressions once, operands before what is made of them; the order is always the same."""
    seen: set[Expression] = set()
    waiting = [(root, False) for root in reversed(roots)]
    while waiting:
        part, is_open = waiting.pop()
        if is_open:
            yield part
        elif part not in seen:
            seen.add(part)
            waiting.append((part, True))
            waiting.extend((operand, False) for operand in reversed(part.operands))


def names_in(*roots: Expression) -> list[str]:
    """The names that occur in expressions, each once."""
    return [part.word for part in parts(*roots) if part.operator == NAME]


def _listed(root: Expression) -> list[tuple[str, tuple[int, ...], float, str]]:
    """The parts, operands by their place: what is kept of an expression elsewhere."""
    order = {part: i for i, part in enumerate(parts(root))}
    return [(p.operator, tuple(order[each] for each in p.operands), p.value, p.word) for p in order]


def _rebuilt(listed: list[tuple[str, tuple[int, ...], float, str]]) -> Expression:
    made: list[Expression] = []
    for operator, operands, value, word in listed:
        made.append(_made(operator, tuple(made[i] for i in operands), value, word))
    return made[-1]


_STRENGTH = {**dict.fromkeys(COMPARISONS, 1), "+": 2, "-": 2, "*": 3, "/": 3, "neg": 4, "^": 5}
_LONGEST = 10_000


def text_of(root: Expression) -> str:
    """An expression as it may be written; cut where it is very long."""
    texts: dict[Expression, tuple[str, int]] = {}
    for part in parts(root):
        texts[part] = _text(part, [texts[each] for each in part.operands])
    return texts[root][0]


def _text(part: Expression, inner: list[tuple[str, int]]) -> tuple[str, int]:
    """The text of a part, and how strongly it holds together, from those of its operands."""
    if part.operator == NUMBER:
        whole = part.value == round(part.value) and abs(part.value) < 1e15
        return f"{part.value:.0f}" if whole else repr(part.value), (4 if part.value < 0.0 else 9)
    if part.operator == NAME:
        return part.word, 9
    strength = _STRENGTH.get(part.operator)
    if strength is None:
        text = f"{part.operator}({', '.join(each for each, _ in inner)})"
        return text[:_LONGEST], 9
    if part.operator == "neg":
        (text, own), *_ = inner
        return f"-{text if own > strength else f'({text})'}"[:_LONGEST], strength
    (left, of_left), (right, of_right) = inner
    # powers take what is to their right first, all others what is to their left
    left = left if of_left > strength or (of_left == strength and part.operator != "^") else f"({left})"
    right = right if of_right > strength else f"({right})"
    return f"{left} {part.operator} {right}"[:_LONGEST], strength
