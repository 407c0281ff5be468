"""Formulas in case files, and what they have names for. See `mdstopo.case.keys.kinds`."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

from mdstopo.case.keys.kinds import Kind, Schema
from mdstopo.case.text.nodes import MAPPING, SCALAR, Node
from mdstopo.case.text.reading import BAD, Reading, found
from mdstopo.case.text.words import inside, shown
from mdstopo.case.value import Value, frozen
from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.parser import TIME, WORD, parse, reserved


@frozen
class FormulaText(Value):
    """The kind of a text that is a formula. without: names of a motion that it may not use, with the reason."""

    without: tuple[str, ...] = ()
    why: str = ""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The text at a node, or BAD; whether names are known is checked where the law's parameters are."""
        value = node.scalar() if node.kind == SCALAR else None
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            value = node.text
        if not isinstance(value, str):
            reading.mistake(path, f"found {found(node)}, allowed is an expression", node)
            return BAD
        try:
            formula = parse(value)
        except FormulaError as error:
            reading.mistake(path, str(error), node)
            return BAD
        for part, column in formula.columns.items():
            if part.word in self.without:
                why = f"{part.word!r} is not allowed here: {self.why} (column {column} of the expression)"
                reading.mistake(path, why, node)
                return BAD
        reading.mark(path, node)
        return value

    def schema(self) -> Schema:
        """The JSON Schema: text, or a number, which is a formula too."""
        return {"type": ["string", "number"]}


def why_no_name(word: str, taken: Container[str], message: str) -> str:
    """Why a word cannot be a name in a formula; empty where it can.

    taken: names that such formulas have of their own. message: what is said of these, and of functions.
    """
    if not WORD.fullmatch(word):
        return f"found the name {shown(word)}, allowed is a letter (a to z, A to Z) or _, then letters, digits or _"
    if word in taken or reserved(word):
        return message
    return ""


@frozen
class FormulaNames(Value):
    """The kind of a mapping from names that a formula uses to values of one kind.

    what: their plural; at_least, most: how many there may be.
    """

    item: Kind
    what: str
    at_least: int = 0
    most: int = 20

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The values at a node by their names, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING or not self.at_least <= len(node.entries) <= self.most:
            how_many = (
                f"{self.at_least} to {self.most} {self.what}" if self.at_least else f"{self.most} {self.what} at most"
            )
            reading.mistake(path, f"found {found(node)}, allowed is a mapping from names to {how_many}", node)
            return BAD
        values = {}
        for word, (key, value) in node.entries.items():
            here = inside(path, word)
            reading.mark(here, value, key)
            values[word] = self.item.read(value, here, reading)
            why = why_no_name(word, (TIME,), f"the name {word!r} is taken: it means something in every expression")
            if why:
                reading.mistake(here, why, key)
                values[word] = BAD
        return values

    def schema(self) -> Schema:
        """The JSON Schema: a mapping from names to such values."""
        return {
            "type": "object", "propertyNames": {"pattern": f"^{WORD.pattern}$"}, "minProperties": self.at_least,
            "maxProperties": self.most, "additionalProperties": self.item.schema(),
        }  # fmt: skip
