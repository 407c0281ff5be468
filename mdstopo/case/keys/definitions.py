"""Defined names, and numbers of a case that are expressions of them: what they come to, in the tree of nodes.

The section `define` gives names to numbers; any number of the case may then be written as text with a leading `=`. Here
all of these become numbers before anything else is read, so that no kind of value has to know of expressions.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node
from mdstopo.case.text.quantities import as_si
from mdstopo.case.text.reading import BAD, Reading, found
from mdstopo.case.text.scalars import to_float
from mdstopo.case.text.words import inside, shown
from mdstopo.case.value import Value, frozen
from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.formula_values import finite_value
from mdstopo.formula.parser import TIME, WORD, Formula, parse, reserved
from mdstopo.formula.tree import names_in

SECTION = "define"
#: text that begins so is an expression
MARK = "="
_WHOLE = 2.0**53
_WITH_UNIT = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s+[A-Za-zµ°]")


@frozen
class Definitions(Value):
    """A mapping from names to numbers; expressions in it have become numbers before it is read."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """Defined numbers by their names, BAD in the place of what cannot be read; BAD where it is no mapping."""
        if node.kind != MAPPING:
            reading.mistake(path, f"found {found(node)}, allowed is a mapping from names to numbers", node)
            return BAD
        values: dict[str, Any] = {}
        for text, (key, value) in node.entries.items():
            here = inside(path, text)
            reading.mark(here, value, key)
            if not WORD.fullmatch(text):
                allowed = "allowed is a letter (a to z, A to Z) or _, then letters, digits or _"
                reading.mistake(here, f"found the name {shown(text)}, {allowed}", key)
            elif reserved(text):
                reading.mistake(here, f"the name {text!r} is taken: it means something in every expression", key)
            number = value.scalar() if value.kind == SCALAR else None
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                reading.mistake(here, f"found {found(value)}, allowed is a number or an expression", value)
                values[text] = BAD
            elif not math.isfinite(to_float(number)):
                allowed = "allowed is a number or an expression that is finite"
                reading.mistake(here, f"found {found(value)}, {allowed}", value)
                values[text] = BAD
            else:
                values[text] = to_float(number)
        return values

    def schema(self) -> dict[str, Any]:
        """The JSON Schema: numbers, or texts with expressions, by names."""
        names = {"pattern": f"^{WORD.pattern}$"}
        return {"type": "object", "propertyNames": names, "additionalProperties": {"type": ["number", "string"]}}


@frozen
class DefinedName(Value):
    """The kind of a key path to a defined name, `define.k`."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """The name behind `define.`, or BAD with a mistake noted."""
        value = node.scalar() if node.kind == SCALAR else None
        section, _, word = value.partition(".") if isinstance(value, str) else ("", "", "")
        if section != SECTION or not word:
            reading.mistake(path, f"found {found(node)}, allowed is a name in `define`, as in define.k", node)
            return BAD
        return word

    def schema(self) -> dict[str, Any]:
        """The JSON Schema: a text that begins with `define.`."""
        return {"type": "string", "pattern": f"^{SECTION}\\.{WORD.pattern}$"}


DEFINED_NAME = DefinedName()


def beginning(root: Node) -> Node:
    """The tree in which defined names that are design variables are the `initial` values of these, where stated."""
    defined, design = (_entries(root, key) for key in (SECTION, "design"))
    variables = _entries(design["variables"][1], "") if "variables" in design else {}
    begun: dict[str, Node] = {}
    for _, variable in variables.values():
        stated = {key: value for key, (_, value) in variable.entries.items()}
        word = DEFINED_NAME.read(stated["of"], "", Reading(Path())) if "of" in stated else BAD
        initial = stated.get("initial")
        if word is not BAD and word in defined and initial is not None and _is_number(initial):
            begun[word] = initial
    if not begun:
        return root
    section = root.entries[SECTION]
    twin, names = root.at(root.line, root.column), section[1].at(section[1].line, section[1].column)
    names.entries = {word: (key, begun.get(word, value)) for word, (key, value) in defined.items()}
    twin.entries = {**root.entries, SECTION: (section[0], names)}
    return twin


def _entries(node: Node, key: str) -> dict[str, tuple[Node, Node]]:
    """The entries of a mapping at a key of a node (empty: the node itself); none where none is there."""
    if key:
        if node.kind != MAPPING or key not in node.entries:
            return {}
        node = node.entries[key][1]
    return node.entries if node.kind == MAPPING else {}


def _is_number(node: Node) -> bool:
    """Whether a node is a number, or an expression."""
    value = node.scalar() if node.kind == SCALAR else None
    if isinstance(value, str):
        return value.lstrip().startswith(MARK)
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def with_numbers(root: Node, reading: Reading, kept: Container[str] = ()) -> Node:
    """The tree with a number in the place of each expression; mistakes are noted where they stand.

    kept: key paths of expressions that stay as they are.
    """
    names = _Names(root, reading)
    return _Numbers(names.values(), names.failed, reading, kept).tree(root, "")


def formula_in(node: Node, path: str, names: Any, reading: Reading) -> Formula | None:
    """The formula at a node of text, perhaps with its mark before it; None where it is none, which is noted."""
    text, hints = node.text, {}
    if text.lstrip().startswith(MARK):
        text = text.replace(MARK, " ", 1)  # columns count from where the text begins
        if not path.startswith(f"{SECTION}."):  # defined numbers do not change with time
            hints = {TIME: f"a formula of time has no leading {MARK}"}
    try:
        return parse(text, names, hints)
    except FormulaError as error:
        reading.mistake(path, f"{error}{_without_unit(path, node.text)}", node)
        reading.ignore(node)
        return None


def _without_unit(path: str, text: str) -> str:
    """What a defined number with a unit has to be, for the end of a message; empty where there is no such thing.

    A unit stands behind a blank: `3*t` and `1/h` are products and shares of names.
    """
    number = as_si(text) if path.startswith(f"{SECTION}.") and _WITH_UNIT.match(text) else None
    return "" if number is None else f"; defined numbers are in SI units, without them: write {number:.15g}"


class _Names:
    """The defined names on their way to numbers."""

    def __init__(self, root: Node, reading: Reading) -> None:
        entry = root.entries.get(SECTION)
        self.nodes: dict[str, Node] = {}
        if entry is not None and entry[1].kind == MAPPING:
            self.nodes = {word: value for word, (_, value) in entry[1].entries.items()}
        self.reading = reading
        self.numbers: dict[str, float] = {}
        #: names without a number; their mistake is noted already, or will be where the section is read
        self.failed: set[str] = set()
        self.formulas: dict[str, Formula] = {}

    def values(self) -> Mapping[str, float]:
        """The numbers of all names that have one."""
        for word, node in self.nodes.items():
            value = node.scalar() if node.kind == SCALAR else None
            if isinstance(value, str):
                formula = formula_in(node, inside(SECTION, word), self.nodes, self.reading)
                if formula is None:
                    self.failed.add(word)
                else:
                    self.formulas[word] = formula
            elif isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(to_float(value)):
                self.failed.add(word)
            else:
                self.numbers[word] = to_float(value)
        for word in self.formulas:
            self._evaluate(word)
        return self.numbers

    def _evaluate(self, first: str) -> None:
        """A name after those that it uses; `open_names` is the way to it, so that a cycle is told with its path."""
        open_names = [first]
        while open_names:
            word = open_names[-1]
            if word in self.numbers or word in self.failed:
                open_names.pop()
                continue
            formula = self.formulas[word]
            used = names_in(formula.root)
            missing = next((each for each in used if each not in self.numbers), None)
            if missing is None:
                self._set(word, formula)
            elif missing in self.failed:
                self.failed.add(word)
                self.reading.ignore(self.nodes[word])
            elif missing in open_names:
                self._cycle([*open_names[open_names.index(missing) :], missing])
            else:
                open_names.append(missing)

    def _set(self, word: str, formula: Formula) -> None:
        try:
            self.numbers[word] = finite_value(formula, self.numbers)
        except FormulaError as error:
            self.reading.mistake(inside(SECTION, word), str(error), self.nodes[word])
            self.reading.ignore(self.nodes[word])
            self.failed.add(word)

    def _cycle(self, way: list[str]) -> None:
        node = self.nodes[way[0]]
        self.reading.mistake(inside(SECTION, way[0]), f"is defined by itself: {' -> '.join(way)}", node)
        for word in way:
            self.reading.ignore(self.nodes[word])
        self.failed.update(way)


class _Numbers:
    """The tree on its way to numbers; parts that aliases share stay shared."""

    def __init__(self, values: Mapping[str, float], failed: set[str], reading: Reading, kept: Container[str]) -> None:
        self.numbers = values
        self.kept = kept
        self.names = [*values, *failed]
        self.failed = failed
        self.reading = reading
        self.made: dict[int, Node] = {}

    def tree(self, node: Node, path: str) -> Node:
        """The node with numbers in it; itself where it has no expression."""
        known = self.made.get(id(node))
        if known is None:
            known = self.made[id(node)] = self._tree(node, path)
        return known

    def _tree(self, node: Node, path: str) -> Node:
        if node.kind == SCALAR:
            if path in self.kept:
                return node
            is_text = node.text.lstrip().startswith(MARK) or path.startswith(f"{SECTION}.")
            return self._number(node, path) if is_text and isinstance(node.scalar(), str) else node
        if is_kept_as_text(path):
            return node
        if node.kind == SEQUENCE:
            items = [self.tree(item, f"{path}[{index}]") for index, item in enumerate(node.items)]
            if all(new is old for new, old in zip(items, node.items, strict=True)):
                return node
            twin = node.at(node.line, node.column)
            twin.items = items
            return twin
        entries = {
            word: (key, value if word == "title" and not path else self.tree(value, inside(path, word)))
            for word, (key, value) in node.entries.items()
        }
        if all(new[1] is old[1] for new, old in zip(entries.values(), node.entries.values(), strict=True)):
            return node
        twin = node.at(node.line, node.column)
        twin.entries = entries
        return twin

    def _number(self, node: Node, path: str) -> Node:
        """The number that an expression comes to; the node itself where it comes to none, which is noted."""
        word = path.removeprefix(f"{SECTION}.")
        if word != path:
            return _with_number(node, self.numbers[word]) if word in self.numbers else node
        formula = formula_in(node, path, self.names, self.reading)
        if formula is None:
            return node
        if self.failed.intersection(names_in(formula.root)):
            self.reading.ignore(node)
            return node
        try:
            return _with_number(node, finite_value(formula, self.numbers))
        except FormulaError as error:
            self.reading.mistake(path, str(error), node)
            self.reading.ignore(node)
            return node


def _with_number(node: Node, value: float) -> Node:
    twin = node.at(node.line, node.column)
    twin.source, twin.plain = node.text, True
    twin.text = str(int(value)) if value == int(value) and abs(value) < _WHOLE else repr(value)
    return twin


def is_kept_as_text(path: str) -> bool:
    """Whether expressions stay as they are: what scenarios set is read again for each of them."""
    return path.startswith("uncertainty.scenarios.") and path.endswith(".set") and path.count(".") == 3
