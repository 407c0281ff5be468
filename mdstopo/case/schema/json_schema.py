"""The format of a case file as JSON Schema."""

from __future__ import annotations

from typing import Any

from mdstopo.case.keys.number_rows import FileName
from mdstopo.case.responses.response_kinds import OF_OTHERS
from mdstopo.case.schema.schema_case import FORMAT
from mdstopo.case.schema.schema_scene import LAW
from mdstopo.case.schema.schema_space import SPACE_FORMAT


def json_schema() -> dict[str, Any]:
    """The format as JSON Schema, draft 2020-12: completes and checks a case as it is typed."""
    changed = {key.name: {"description": key.text} for key in FORMAT.keys}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "mdstopo case file, format 1",
        "description": "One design problem. SI units; coordinates are global, at the start.",
        "if": {"required": ["extends"]},
        "then": {
            "description": "What is changed of another case; it is checked when both are together.",
            "type": "object",
            "properties": {**changed, "extends": FileName().schema() | {"description": "the other case"}},
            "additionalProperties": False,
        },
        "else": {
            "if": {"properties": {"dimension": {"const": 3}}, "required": ["dimension"]},
            "then": SPACE_FORMAT.schema(),
            "else": FORMAT.schema(),
        },
    }


def ask_distributions() -> None:
    """Have the schema know the laws and responses of other distributions. BroughtError where one cannot be used."""
    for brought in (LAW.more, OF_OTHERS):
        assert brought is not None
        brought.find_all()
