"""Random formulas as text, and their values by Python's own arithmetic: a second reading of the same text."""

from __future__ import annotations

import cmath
import math
import re
from typing import Any

from hypothesis import strategies as st

SMOOTH = ("sin", "cos", "atan", "tanh", "exp", "sqrt", "log", "asin", "acos", "tan", "sinh", "cosh")


@st.composite
def formulas(draw: st.DrawFn, depth: int = 3, names: tuple[str, ...] = ("x", "k"), smooth: bool = False) -> str:
    """A formula of some names."""

    def inner() -> str:
        return draw(formulas(depth - 1, names, smooth))

    kinds = ["name", "number"]
    if depth > 0:
        kinds += ["sum", "product", "power", "neg", "call", "bracket"] + ([] if smooth else ["kink", "if"])
    match draw(st.sampled_from(kinds)):
        case "name":
            return draw(st.sampled_from(names))
        case "number":
            return draw(st.sampled_from(("0", "1", "2", "0.5", "1.25", "3e-1", "pi")))
        case "sum":
            return f"{inner()} {draw(st.sampled_from('+-'))} {inner()}"
        case "product":
            return f"({inner()}) {draw(st.sampled_from('*/'))} ({inner()})"
        case "power":
            return f"({inner()})^{draw(st.sampled_from(('2', '3', '1.5', '-1', 'k', '(x / 2)')))}"
        case "neg":
            return f"-({inner()})"
        case "bracket":
            return f"({inner()})"
        case "call":
            function = draw(st.sampled_from((*SMOOTH, "atan2")))
            return f"{function}({inner()}, {inner()})" if function == "atan2" else f"{function}({inner()})"
        case "kink":
            function, count = draw(
                st.sampled_from((("abs", 1), ("sign", 1), ("step", 1), ("min", 2), ("max", 3), ("clip", 3)))
            )
            return f"{function}({', '.join(inner() for _ in range(count))})"
    sign = draw(st.sampled_from(("<", "<=", ">", ">=")))
    return f"if({inner()} {sign} {inner()}, {inner()}, {inner()})"


def _real(x: Any) -> float:
    return float(x.real)


def _atan2(y: Any, x: Any) -> Any:
    if isinstance(y, complex) or isinstance(x, complex):
        angle = math.atan2(_real(y), _real(x))
        # the part that complex numbers add: the derivative along what is imaginary
        return angle + cmath.atan((y * _real(x) - x * _real(y)) / (x * _real(x) + y * _real(y)))
    return math.atan2(y, x)


def _by_real(function: str, complex_numbers: bool) -> Any:
    module: Any = cmath if complex_numbers else math
    return getattr(module, function)


def evaluate(text: str, names: dict[str, Any]) -> Any:
    """The value of a formula by Python, real or complex; of what is compared, real parts count."""
    is_complex = any(isinstance(value, complex) for value in names.values())
    scope: dict[str, Any] = {
        **{word: _by_real(word, is_complex) for word in SMOOTH},
        "pi": math.pi,
        "atan2": _atan2,
        "abs": lambda a: a if _real(a) >= 0.0 else -a,
        "sign": lambda a: 1.0 if _real(a) >= 0.0 else -1.0,
        "step": lambda a: 1.0 if _real(a) >= 0.0 else 0.0,
        "min": lambda *all_of: min(all_of, key=_real),
        "max": lambda *all_of: max(all_of, key=_real),
        "clip": lambda a, low, high: max(low, min(a, high, key=_real), key=_real),
        "when": lambda holds, a, b: a if holds else b,
        "real": _real,
        **names,
    }
    python = re.sub(r"\bif\(", "when(", text.replace("^", "**"))
    return eval(_compared(python), {"__builtins__": {}}, scope)


def _compared(python: str) -> str:
    """Comparisons by real parts: `when(a < b, ...)` as `when(real(a) < real(b), ...)`."""
    at = 0
    while (at := python.find("when(", at)) >= 0:
        start = at + len("when(")
        depth, sign, end = 0, -1, -1
        for i in range(start, len(python)):
            character = python[i]
            depth += (character == "(") - (character == ")")
            if depth == 0 and character in "<>" and sign < 0:
                sign = i
            if depth == 0 and character == ",":
                end = i
                break
        width = 2 if python[sign + 1] == "=" else 1
        left, middle, right = python[start:sign], python[sign : sign + width], python[sign + width : end]
        python = f"{python[:start]}real({left}) {middle} real({right}){python[end:]}"
        at = start
    return python
