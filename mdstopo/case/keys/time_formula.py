"""Quantities that are formulas of time, as case files have them. See `mdstopo.case.keys.kinds`."""

from __future__ import annotations

import re
from typing import Any

from mdstopo.case.arrays import TimeFormula
from mdstopo.case.keys.formula_keys import FormulaNames, FormulaText
from mdstopo.case.keys.kinds import NUMBER
from mdstopo.case.keys.records import ByShape, Key, ListOf, Record
from mdstopo.case.text.nodes import MAPPING, Node
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside
from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.parser import TIME, parse

#: a number, and behind it an operator or nothing
_BEGINS = re.compile(r"\s*[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?\s*(?:[-+*/^(),<>=]|$)")
#: parameters of a formula of time at most
MOST_PARAMETERS = 8


def formula_record(names: tuple[str, ...]) -> Record:
    """The keys of a mapping that states formulas of time for some quantities."""
    text = FormulaText()
    several = ListOf(text, len(names), "formulas")
    kind = text if len(names) == 1 else ByShape(f"a list of {len(names)} expressions", sequence=several)
    doc = "[expression](expressions.md#loads) of t (s) and `parameters`"
    return Record(
        "a formula of time",
        (
            Key("formula", kind, f"an {doc}" if len(names) == 1 else f"of each an {doc}", required=True),
            Key(
                "parameters", FormulaNames(NUMBER, "numbers", most=MOST_PARAMETERS), "numbers by their name in it",
                unit="yours",
            ),
        ),
        doc="A quantity over time. Kinks and jumps of it are ends of steps, as rows of a table are.",
    )  # fmt: skip


def read_formulas(node: Node, names: tuple[str, ...], path: str, reading: Reading, instead: str) -> Any:
    """The formulas of time that a mapping, or a text, states, one a quantity; BAD where something is a mistake.

    instead: what else a text may have been meant to be, in words.
    """
    if node.kind != MAPPING:
        try:
            parse(node.text, (TIME,))
        except FormulaError as error:
            reading.mistake(path, f"{error}; {instead}", node)
            return BAD
        return _made([(path, node.text)], {}, reading)
    fields: Fields = formula_record(names).read(node, path, reading)
    if not fields.good():
        return BAD
    here = inside(path, "formula")
    stated = fields["formula"]
    texts = [(here, stated)] if isinstance(stated, str) else [(f"{here}[{i}]", text) for i, text in enumerate(stated)]
    if len(texts) != len(names):
        reading.mistake(here, f"found {len(texts)} expressions, needed are {len(names)}")
        return BAD
    return _made(texts, fields["parameters"] or {}, reading)


def _made(texts: list[tuple[str, str]], parameters: dict[str, float], reading: Reading) -> Any:
    """The formulas of texts and where they stand; BAD where one cannot be used."""
    found = []
    for path, text in texts:
        formula = TimeFormula(text, tuple(parameters.items()))
        why = why_unusable(formula)
        if why:
            reading.mistake(path, why)
            return BAD
        found.append(formula)
    return tuple(found)


def why_unusable(formula: TimeFormula) -> str:
    """Why a formula of time cannot be computed; empty where it can."""
    from mdstopo.formula.law_formulas import why_too_large  # most cases have no formulas

    names = [name for name, _ in formula.parameters]
    if len(names) > MOST_PARAMETERS:
        return f"found {len(names)} parameters, allowed are {MOST_PARAMETERS} at most"
    try:
        parse(formula.text, (*names, TIME))
    except FormulaError as error:
        return str(error)
    return why_too_large(lambda: formula.program.groups)


def is_formula(node: Node) -> bool:
    """Whether a mapping in the file states formulas of time."""
    return node.kind == MAPPING and "formula" in node.entries


def is_expression(text: str) -> bool:
    """Whether a text that begins with a number goes on as an expression does, not with a unit."""
    return _BEGINS.match(text) is not None
