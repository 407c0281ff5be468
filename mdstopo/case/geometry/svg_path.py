"""The kind of a text that is a path of a drawing in SVG (`svg_areas`)."""

from __future__ import annotations

from typing import Any

from mdstopo.case.keys.kinds import Schema
from mdstopo.case.text.nodes import SCALAR, Node
from mdstopo.case.text.reading import BAD, Reading, found
from mdstopo.case.value import Value, frozen


@frozen
class SvgPath(Value):
    """The kind of a text that is the attribute `d` of an SVG path."""

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """Closed lines, a tuple of arrays (n, 2) with n >= 3, or BAD."""
        value = node.scalar() if node.kind == SCALAR else None
        if not isinstance(value, str):
            reading.mistake(path, f"found {found(node)}, allowed is the text of a path in SVG", node)
            return BAD
        from mdstopo.case.geometry.svg_areas import PathError, areas

        try:
            return areas(value)
        except PathError as error:
            reading.mistake(path, str(error), node)
            return BAD

    def schema(self) -> Schema:
        """The JSON Schema of a text."""
        return {"type": "string", "minLength": 1}
