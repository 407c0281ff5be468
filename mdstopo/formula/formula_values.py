"""Values of formulas: with floats, where nothing raises, and what is to blame where a value is not finite."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.parser import Formula
from mdstopo.formula.tree import COMPARISONS, NAME, NUMBER, Expression, parts, text_of

#: characters of an operation that a message shows
_LONGEST = 60


def _guarded(function: Callable[..., float]) -> Callable[..., float]:
    """The function, NaN where it has no value, and infinite where it is too large."""

    def guarded(*operands: float) -> float:
        try:
            return function(*operands)
        except ValueError:
            return math.nan
        except OverflowError:
            return math.inf

    return guarded


def _power(base: float, exponent: float) -> float:
    try:
        return math.pow(base, exponent)
    except OverflowError:
        return -math.inf if base < 0.0 and exponent % 2.0 == 1.0 else math.inf
    except ValueError:  # 0 to a negative power, or a root of a negative number
        return math.inf if base == 0.0 else math.nan


def _divided(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


def _powlog(base: float, exponent: float) -> float:
    if base == 0.0 and exponent > 0.0:
        return 0.0
    return _power(base, exponent) * math.log(base) if base > 0.0 else math.nan


_KERNELS: dict[str, Callable[..., float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": _divided,
    "^": _power,
    "powlog": _powlog,
    "neg": lambda a: -a,
    "<": lambda a, b: float(a < b),
    "<=": lambda a, b: float(a <= b),
    ">": lambda a, b: float(a > b),
    ">=": lambda a, b: float(a >= b),
    "abs": abs,
    "min": lambda *all_of: math.nan if any(a != a for a in all_of) else min(all_of),
    "max": lambda *all_of: math.nan if any(a != a for a in all_of) else max(all_of),
    "clip": lambda a, low, high: math.nan if a != a else max(low, min(a, high)),
    "sign": lambda a: math.nan if a != a else (1.0 if a >= 0.0 else -1.0),
    "step": lambda a: math.nan if a != a else float(a >= 0.0),
    "if": lambda holds, a, b: a if holds else b,
    "log": _guarded(lambda a: -math.inf if a == 0.0 else math.log(a)),
    **{
        word: _guarded(getattr(math, word))
        for word in ("sqrt", "exp", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "cosh", "tanh")
    },
    "sinh": lambda a: a if abs(a) == math.inf else _guarded(lambda x: math.copysign(math.sinh(abs(x)), x))(a),
}


def all_values(names: Mapping[str, float], *roots: Expression) -> dict[Expression, float]:
    """Every part's value; nothing raises, what has no value is NaN. Both values of an `if` are computed."""
    found: dict[Expression, float] = {}
    for part in parts(*roots):
        if part.operator == NUMBER:
            found[part] = part.value
        elif part.operator == NAME:
            found[part] = names[part.word]
        else:
            found[part] = _KERNELS[part.operator](*(found[each] for each in part.operands))
    return found


def values_of(names: Mapping[str, float], roots: Sequence[Expression]) -> list[float]:
    """Values of several expressions; parts that they have in common are computed once. NaN where there is none."""
    found = all_values(names, *roots)
    return [found[root] for root in roots]


def value_of(root: Expression, names: Mapping[str, float]) -> float:
    """An expression's value, NaN where it has none."""
    return all_values(names, root)[root]


def finite_value(formula: Formula, names: Mapping[str, float]) -> float:
    """A formula's value; raises FormulaError, at the part to blame, where it is not finite."""
    found = all_values(names, formula.root)
    if math.isfinite(found[formula.root]):
        return found[formula.root]
    part = _to_blame(formula.root, found)
    values = ", ".join(f"{found[each]:.10g}" for each in part.operands if each.operator not in COMPARISONS)
    what = "has no value" if math.isnan(found[part]) else "is not finite"
    if part.operator == "/" and found[part.operands[1]] == 0.0:
        what = "divides by zero"
    text = text_of(part)
    text = text if len(text) <= _LONGEST else f"the operation {part.operator}"
    raise FormulaError(f"{text} {what} (with {values})", formula.column(part))


def _to_blame(root: Expression, found: Mapping[Expression, float]) -> Expression:
    """The innermost part that is not finite and made of finite ones."""
    part = root
    while True:
        counted = part.operands
        if part.operator == "if":
            condition, one, other = part.operands
            wrong = [each for each in condition.operands if not math.isfinite(found[each])]
            counted = (*wrong, one if found[condition] else other)
        inner = [each for each in counted if not math.isfinite(found[each])]
        if not inner:
            return part
        part = inner[0]
