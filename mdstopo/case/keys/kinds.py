"""Kinds of single values: each reads a node, with located mistakes, and states itself as JSON Schema.

Reader and JSON Schema cannot disagree on a type, a limit, a word or a default: both come from one object.
A kind that finds a mistake notes it and returns BAD; it never raises.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from mdstopo.case.text.nodes import SCALAR, SEQUENCE, Node
from mdstopo.case.text.quantities import PATTERN, QuantityError, in_si, is_quantity, unit_at
from mdstopo.case.text.reading import BAD, Bad, Reading, Reference, found
from mdstopo.case.text.scalars import to_float
from mdstopo.case.text.words import did_you_mean, listed, number_text, shown
from mdstopo.case.value import Value, frozen

Schema = dict[str, Any]


def expressible(kind: str) -> Schema:
    """The JSON Schema of a number (or integer), or of text: an expression (`definitions`), or a quantity with its
    unit."""
    return {"type": [kind, "string"], "pattern": "^\\s*=" if kind == "integer" else f"^\\s*=|{PATTERN}"}


NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
TAKEN = ("ground", "all", "default")


class Kind(Protocol):
    """The interface of a kind: what a value of the case file may be."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The value at `node`, or BAD."""

    def schema(self) -> Schema:
        """The JSON Schema (draft 2020-12) of such values."""


@frozen
class Number(Value):
    """The kind of a finite number with limits; `above` and `below` are exclusive. whole: integers only (20.0 is
    one)."""

    minimum: float | None = None
    above: float | None = None
    maximum: float | None = None
    below: float | None = None
    whole: bool = False

    def allowed(self) -> str:
        """The limits of the number in words, for messages."""
        noun = "a whole number" if self.whole else "a number"
        limits = [
            f"{sign} {number_text(limit)}"
            for sign, limit in (
                (">", self.above), (">=", self.minimum), ("<", self.below), ("<=", self.maximum),
            )
            if limit is not None
        ]  # fmt: skip
        return f"{noun} {' and '.join(limits)}" if limits else noun

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The number at a node (int where it has to be whole), or BAD with a mistake noted."""
        raw: Any = node.scalar() if node.kind == SCALAR else None
        if has_unit(node) and not self.whole:
            raw = with_unit(node, path, reading)
            if raw is BAD:
                return BAD
        if isinstance(raw, bool) or not isinstance(raw, (int, float)):
            hint = self._hint(node, reading.unit)
            reading.mistake(path, f"found {found(node)}{hint}, allowed is {self.allowed()}", node)
            return BAD
        value = to_float(raw)
        if not math.isfinite(value):
            reading.mistake(path, f"found {found(node)}, allowed is {self.allowed()} that is finite", node)
            return BAD
        fits = (
            (self.above is None or value > self.above)
            and (self.minimum is None or value >= self.minimum)
            and (self.below is None or value < self.below)
            and (self.maximum is None or value <= self.maximum)
            and (not self.whole or value == math.floor(value))
        )
        if not fits:
            reading.mistake(path, f"found {found(node)}, allowed is {self.allowed()}", node)
            return BAD
        return int(raw) if self.whole else value

    @staticmethod
    def _hint(node: Node, unit: str) -> str:
        if node.kind != SCALAR or not node.text:
            return ""
        if not node.plain and re.fullmatch(r"[-+.0-9eExX]+", node.text):
            return " (a quoted number is text)"
        if node.plain and re.match(r"[-+.]?[0-9].*[a-zA-Z]", node.text):
            quoted = '; with its unit a number stands in quotes: "40 mm"' if unit else ""
            return f" (without quotes units are SI and not written{quoted})"
        if node.plain and re.fullmatch(r"[-+]?[0-9]+,[0-9]+", node.text):
            return " (the decimal sign is a point)"
        if re.search(r"[A-Za-z0-9_)] *[-+*/^(] *[A-Za-z0-9_(]", node.text) and not node.text.startswith(("-", "+")):
            return " (an expression begins with =)"
        return ""

    def schema(self) -> Schema:
        """The JSON Schema: a number within its limits, or text that is an expression."""
        limits = {
            "minimum": self.minimum,
            "exclusiveMinimum": self.above,
            "maximum": self.maximum,
            "exclusiveMaximum": self.below,
        }
        kind = "integer" if self.whole else "number"
        return {**expressible(kind), **{word: limit for word, limit in limits.items() if limit is not None}}


@frozen
class ScalarInPlane(Number):
    """The kind of a number in a plane which in space is a vector or a tensor."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The number at a node of the file, or BAD with a mistake noted."""
        if node.kind == SEQUENCE:
            words = "; a list is for a case with `dimension: 3`"
            reading.mistake(path, f"found {found(node)}, allowed is {self.allowed()}{words}", node)
            return BAD
        return Number(self.minimum, self.above, self.maximum, self.below, self.whole).read(node, path, reading)


def has_unit(node: Node) -> bool:
    """Whether a node is a text that begins with a number, as one with a unit does."""
    return node.kind == SCALAR and not node.plain and is_quantity(node.text)


def with_unit(node: Node, path: str, reading: Reading) -> float | Bad:
    """The number of a node with a unit (`has_unit`), in the SI unit of its key, or BAD."""
    needed = unit_at(reading.unit, path)
    try:
        reading.measured[path] = in_si(node.text, needed)
        return reading.measured[path]
    except QuantityError as error:
        reading.mistake(path, f"found {found(node)}; {error}", node)
    return BAD


NUMBER = Number()
POSITIVE = Number(above=0)
NOT_NEGATIVE = Number(minimum=0)


@frozen
class Flag(Value):
    """The kind of a value that is true or false."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The truth value at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, bool):
            return value
        reading.mistake(path, f"found {found(node)}, allowed is true or false", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema of a truth value."""
        return {"type": "boolean"}


@frozen
class Text(Value):
    """The kind of a value that is any text."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The text at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, str):
            return value
        hint = " (quote it to make it text)" if node.kind == SCALAR and value is not None else ""
        reading.mistake(path, f"found {found(node)}{hint}, allowed is text", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema of a text."""
        return {"type": "string"}


@frozen
class Word(Value):
    """The kind of one of a few words. instead: what is allowed besides, for the message; meanings: what each word
    means."""

    words: tuple[str, ...]
    instead: str = ""
    meanings: tuple[str, ...] = ()

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The word at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, str) and value in self.words:
            return value
        hint = did_you_mean(value, self.words) if isinstance(value, str) else ""
        allowed = " | ".join(self.words) + self.instead
        reading.mistake(path, f"found {found(node)}{hint or ','} allowed is {allowed}", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema: a list of the words, with their meanings where editors look for them."""
        schema: Schema = {"type": "string", "enum": list(self.words)}
        return {**schema, "enumDescriptions": list(self.meanings)} if any(self.meanings) else schema


@frozen
class OpenWord(Word):
    """The kind of one of several words to which other distributions may add.

    anew (ask) gives them with their meanings; ask: whether distributions are asked for theirs.
    """

    anew: Callable[[bool], Mapping[str, str]] = lambda _: {}

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The word at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        known = self.words if value in self.words else tuple(self.anew(True))
        return Word(known, self.instead).read(node, path, reading)

    def schema(self) -> Schema:
        """The JSON Schema: a list of the words, with those of other distributions that have been asked for."""
        return explained(self.anew(False), self.instead).schema()


def explained(meanings: Mapping[str, str], instead: str = "") -> Word:
    """The kind of a value that is one of the words which `meanings` explains."""
    return Word(tuple(meanings), instead, tuple(meanings.values()))


@frozen
class NumberOrWord(Value):
    """The kind of a value that is a number, or one of a few words."""

    number: Number
    word: Word

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The number or the word at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return self.number.read(node, path, reading)
        return self.word.read(node, path, reading)

    def schema(self) -> Schema:
        """The JSON Schema of a number or one of the words."""
        return {"anyOf": [self.number.schema(), self.word.schema()]}


@frozen
class Version(Value):
    """The kind of the number of the format, of which one can be read."""

    number: int

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The number of the format at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if not isinstance(value, bool) and value == self.number:
            return self.number
        message = f"found {found(node)}, allowed is {self.number}: this program reads no other"
        reading.mistake(path, message, node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema: the one number that is allowed."""
        return {"const": self.number}


@frozen
class OneOf(Value):
    """The kind of a value that is one of a few whole numbers."""

    numbers: tuple[int, ...]

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The whole number at a node of the file, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        if not isinstance(value, (bool, str)) and value in self.numbers:
            return self.numbers[self.numbers.index(int(value or 0))]
        allowed = " | ".join(str(number) for number in self.numbers)
        reading.mistake(path, f"found {found(node)}, allowed is {allowed}", node)
        return BAD

    def schema(self) -> Schema:
        """The JSON Schema: a list of the numbers that are allowed."""
        return {"enum": list(self.numbers)}


@frozen
class Ref(Value):
    """The kind of a name that is declared elsewhere (see `Reading.declare`). also: words with a meaning of their
    own.

    index: an index may stand for the name.
    """

    kind: str
    also: tuple[str, ...] = ()
    index: bool = False

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The name at a node, or BAD; whether it is declared is checked once all names are known."""
        value = node.scalar() if node.kind == SCALAR else None
        if self.index and isinstance(value, int) and not isinstance(value, bool):
            value = str(value)
        if not isinstance(value, str):
            reading.mistake(path, f"found {found(node)}, allowed is the name of a {self.kind}", node)
            return BAD
        if value not in self.also:
            reading.mark(path, node)
            reading.references.append(Reference(path, self.kind, value, self.also))
        return value

    def schema(self) -> Schema:
        """The JSON Schema of a reference: a name, or a place in a list where that is allowed."""
        text = {"type": "string", "description": f"name of a {self.kind}"}
        return {"anyOf": [text, {"type": "integer", "minimum": 0}]} if self.index else text


@frozen
class Name(Value):
    """The kind of a new name, which nothing in the case has as yet."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The name at a node of the file, or BAD with a mistake noted."""
        if node.kind != SCALAR:
            reading.mistake(path, f"found {found(node)}, allowed is a name", node)
            return BAD
        return node.text if check_name(node, path, reading) else BAD

    def schema(self) -> Schema:
        """The JSON Schema: a text of the characters that names may have."""
        return {"type": "string", "pattern": f"^{NAME.pattern}$", "not": {"enum": list(TAKEN)}}


def check_name(node: Node, path: str, reading: Reading) -> bool:
    """Whether the scalar `node` may name something; notes the mistake where not."""
    if not isinstance(node.scalar(), str):
        reading.mistake(path, f"found {found(node)} as a name; quote it or choose another", node)
    elif node.text in TAKEN:
        why = f"the name {node.text!r} is taken: {listed(TAKEN)} have meanings of their own"
        reading.mistake(path, why, node)
    elif not NAME.fullmatch(node.text):
        reading.mistake(
            path,
            f"found the name {shown(node.text)}, allowed is a letter (a to z, A to Z) or _, "
            "then letters, digits, _ or -",
            node,
        )
    else:
        return True
    return False
