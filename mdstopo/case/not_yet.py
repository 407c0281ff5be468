"""What cases in space may not state yet: refused by name, each where the schema of space names it."""

from __future__ import annotations

from typing import Any

from mdstopo.case.kinds import Kind, Schema
from mdstopo.case.nodes import SCALAR, Node
from mdstopo.case.reading import BAD, Reading, found
from mdstopo.case.value import Value, frozen


@frozen
class NotYet(Value):
    """A value that may not be stated yet. what: the things in words, in the plural."""

    what: str

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """BAD."""
        reading.mistake(path, f"{self.what} are not in space yet", node)
        return BAD

    def schema(self) -> Schema:
        """Nothing fits."""
        return {"not": {}}


@frozen
class NotYetAs(Value):
    """A value of a kind, of which some may not be stated yet. values: these, as the kind reads them."""

    kind: Kind
    values: tuple[Any, ...]

    def read(self, node: Node, path: str, reading: Reading) -> Any:
        """What the kind reads, or BAD."""
        value = self.kind.read(node, path, reading)
        if value is not BAD and node.kind == SCALAR and value in self.values:
            reading.mistake(path, f"found {found(node)}, which is not in space yet", node)
            return BAD
        return value

    def schema(self) -> Schema:
        """That of the kind without these values."""
        return {**self.kind.schema(), "not": {"enum": list(self.values)}}
