"""Where slopes of a formula begin with a root: at `if(x > 0, k*x^1.5, 0)` the slope is as the root of x.

The motion is smooth enough there for steps of any length, but its derivatives by the design are not: beside such a
switch steps have to be short (`general.integrators.adaptive_steps`).
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from mdstopo.formula.formula_values import value_of
from mdstopo.formula.tree import NUMBER, Expression, names_in, parts

#: a power from here on begins smoothly enough for steps of any length
SMOOTH = 4.0
#: points at which quotients are compared, and how alike they are where they are the same
_POINTS, _ALIKE = 3, 1e-9


def sharp_switches(formula: Expression, margins: Sequence[Expression], moving: Sequence[str]) -> int:
    """The switches at which the base of a fractional power vanishes, as bits: slopes grow like a root behind these.

    margins: of the switches. moving: names that change during a motion.
    """
    found = 0
    bases = {part.operands[0] for part in parts(formula) if _is_fractional(part)}
    for base in bases:
        if set(moving) & set(names_in(base)):
            for place, margin in enumerate(margins):
                found |= _vanish_together(base, margin, moving) << place
    return found


def _is_fractional(part: Expression) -> bool:
    """Whether an operation is a root or a power with a number that is not whole, or not known."""
    if part.operator == "sqrt":
        return True
    if part.operator != "^":
        return False
    exponent = part.operands[1]
    return exponent.operator != NUMBER or (exponent.value < SMOOTH and exponent.value != round(exponent.value))


def _vanish_together(one: Expression, other: Expression, moving: Sequence[str]) -> bool:
    """Whether one of two expressions is the other times what does not move, on some sides of the switches in them."""
    bits = sorted(word for word in names_in(one, other) if word.startswith("bit "))
    return any(_are_alike(one, other, moving, dict.fromkeys(bits, side)) for side in (1.0, 0.0))


def _are_alike(one: Expression, other: Expression, moving: Sequence[str], bits: dict[str, float]) -> bool:
    """The same with these sides, as values at a few points tell."""
    source = random.Random(7)
    words = sorted({*names_in(one, other)} - {*moving, *bits})
    fixed = {**bits, **{word: source.uniform(0.5, 1.5) for word in words}}
    quotients = []
    for _ in range(_POINTS):
        values = {**fixed, **{word: source.uniform(0.5, 1.5) for word in moving}}
        above, below = value_of(one, values), value_of(other, values)
        if not (math.isfinite(above) and math.isfinite(below)) or below == 0.0:
            return False
        quotients.append(above / below)
    first = quotients[0]
    return first != 0.0 and all(abs(each - first) <= _ALIKE * abs(first) for each in quotients)
