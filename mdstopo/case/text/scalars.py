"""YAML 1.2's core schema: what the text of a plain scalar means.

PyYAML resolves after YAML 1.1, where ``1e-3`` is text, ``010`` eight, ``on`` true and ``1:30`` ninety.
"""

from __future__ import annotations

import re

Scalar = None | bool | int | float | str

_INTEGER = re.compile(r"[-+]?[0-9]+")
_BASED = re.compile(r"0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
_WORDS: dict[str, Scalar] = {
    "": None, "~": None, "null": None, "Null": None, "NULL": None,
    "true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False,
    ".nan": float("nan"), ".NaN": float("nan"), ".NAN": float("nan"),
}  # fmt: skip
# Python converts no longer integers from decimal text; the double that such a text means is infinite anyway.
_LONGEST_INTEGER = 400


def resolve(text: str) -> Scalar:
    """The value of an unquoted scalar of YAML: None, bool, int, float (infinite where out of range, NaN) or text."""
    if text in _WORDS:
        return _WORDS[text]
    first = text[0]
    if not (first.isdigit() or first in "+-."):
        return text
    if _INTEGER.fullmatch(text):
        return int(text) if len(text) <= _LONGEST_INTEGER else float(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _BASED.fullmatch(text):
        return int(text, 0)
    if _INFINITE.fullmatch(text):
        return float("-inf") if first == "-" else float("inf")
    return text


def to_float(value: int | float) -> float:
    """The double nearest to `value`, infinite where it is out of range."""
    try:
        return float(value)
    except OverflowError:
        return float("-inf") if value < 0 else float("inf")
