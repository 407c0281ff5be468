"""What one reading of a case file gathers: mistakes, warnings, places of keys, references to names."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.marks import Marks, enclosing
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node
from mdstopo.case.text.words import GROUND, did_you_mean, listed, shown

MOST_MISTAKES = 1000


class Bad:
    """What stands for a value that could not be read; its mistake is already noted."""

    def __repr__(self) -> str:
        return "BAD"


BAD = Bad()


class Fields(dict[str, Any]):
    """The keys of one mapping as read: defaults filled in, BAD where wrong.

    path: its key path; stated: the keys that the file gives.
    """

    def __init__(self, path: str, stated: Iterable[str] = ()) -> None:
        super().__init__()
        self.path = path
        self.stated = frozenset(stated)

    def good(self, *keys: str) -> bool:
        """Whether `keys` (all, where none is named) were read without a mistake, to any depth."""
        return all(is_good(self[key]) for key in (keys or self))


def is_good(value: Any) -> bool:
    """Whether a value and all that it contains could be read."""
    if isinstance(value, dict):
        return all(is_good(part) for part in value.values())
    if isinstance(value, (list, tuple)):
        return all(is_good(part) for part in value)
    return value is not BAD


class Reference(NamedTuple):
    """A name that must be declared: `kind` is body, point grid, member group, joint, load case, objective. also: words
    that may stand in its place."""

    path: str
    kind: str
    name: str
    also: tuple[str, ...] = ()


class Reading:
    """One reading of one file: the mistakes, remarks and names found so far. folder: where relative paths of included
    files start."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        #: the unit of the key that is read, as its description has it
        self.unit = ""
        #: by their path, the SI values of numbers that were written with a unit
        self.measured: dict[str, float] = {}
        #: by the path of a number that follows from a defined name which is a design variable: that variable
        self.followed: dict[str, str] = {}
        self.mistakes: list[Mistake] = []
        self.warnings: list[Mistake] = []
        self.files: dict[str, str] = {}
        self.references: list[Reference] = []
        self.declared: dict[str, dict[str, None]] = {}
        self._places: dict[str, tuple[int, int]] = {}
        self._origins: dict[str, str] = {}
        self._included: dict[str, bytes | str] = {}
        self._ignored: set[tuple[int, int, str]] = set()

    def again(self) -> Reading:
        """A reading of the same file that goes on from here, with mistakes of its own."""
        other = Reading(self.folder)
        other.mistakes, other.warnings, other.files = [*self.mistakes], [*self.warnings], dict(self.files)
        other._ignored, other._included = set(self._ignored), self._included
        return other

    def mark(self, path: str, node: Node, key: Node | None = None) -> None:
        """Note where in the file the value of `path` stands, or its key where the value begins on a later line."""
        at = key if key is not None and (key.line != node.line or key.origin != node.origin) else node
        if node.origin:
            self._origins[path] = node.origin
        elif not at.origin:
            self._places[path] = (at.line, at.column)

    def has_place(self, path: str) -> bool:
        """Whether `path` itself was noted."""
        return path in self._places or path in self._origins

    def marks(self) -> Marks:
        """Where in the file each key path stands, for messages that come later."""
        return Marks(FrozenDict(self._places), FrozenDict(self._origins))

    def mistake(self, path: str, message: str, node: Node | None = None) -> None:
        """Note a mistake at `node`, or where `path` (else what encloses it) stands."""
        if node is not None and (node.line, node.column, node.origin) in self._ignored:
            return
        if len(self.mistakes) < MOST_MISTAKES:
            self.mistakes.append(self._located(path, message, node))
        elif len(self.mistakes) == MOST_MISTAKES:
            self.mistakes.append(self._located(path, "there are more mistakes; this is the last one told", node))

    def ignore(self, node: Node) -> None:
        """Note no further mistake at a node: what is wrong there has been told."""
        self._ignored.add((node.line, node.column, node.origin))

    def warning(self, path: str, message: str) -> None:
        """Note at `path` what is no mistake and the user should know."""
        self.warnings.append(self._located(path, message, None))

    def _located(self, path: str, message: str, node: Node | None) -> Mistake:
        if node is not None:
            return Mistake(path, message, node.line, node.column, node.origin)
        at = path
        while at and at not in self._places and at not in self._origins:
            at = enclosing(at)
        line, column = self._places.get(at, (1, 1))
        return Mistake(path, message, line, column, self._origins.get(at, ""))

    def check_references(self) -> None:
        """Check that every reference names something that is declared; else note a mistake, with the nearest right
        word."""
        for path, kind, name, also in self.references:
            if not self.knows(kind, name) and len(self.mistakes) < MOST_MISTAKES:
                names = self.names(kind)
                words = also if names and kind != "load case" else ()  # `default` is of cases that name no load case
                there = f"there are {listed(names)}" if names else f"the case has no {kind}"
                there += f"; or {listed(words)}" if words else ""
                hint = did_you_mean(name, [*names, *words]) or ";"
                self.mistake(path, f"no {kind} is called {shown(name)}{hint} {there}")

    def names(self, kind: str) -> list[str]:
        """The names of a kind that may be referred to."""
        declared = list(self.declared.get(kind, ()))
        return list(dict.fromkeys([GROUND, *declared])) if kind == "body" else declared

    def declare(self, kind: str, name: str) -> None:
        """Make `name` known as a thing of that kind."""
        self.declared.setdefault(kind, {})[name] = None

    def knows(self, kind: str, name: str) -> bool:
        """Whether a thing of that kind and name is declared."""
        return (kind == "body" and name == GROUND) or name in self.declared.get(kind, ())

    def include(self, name: str) -> bytes | str:
        """The bytes of the file `name` (relative to the case file), or the sentence why it cannot be read."""
        if name not in self._included:
            self._included[name] = self._read(name)
        return self._included[name]

    def _read(self, name: str) -> bytes | str:
        try:
            path = self.folder / name
            if path.is_dir():
                return f"{shown(name)} is a folder, not a file"
            if not path.is_file():  # a device or a pipe could be read for ever
                return f"there is no file {shown(str(path))}"
            data = path.read_bytes()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            return f"the file {shown(name)} cannot be read: {reason}"
        self.files[name] = hashlib.sha256(data).hexdigest()
        return data


def found(node: Node) -> str:
    """What stands at a node of the file, in words, for messages."""
    if node.kind == SEQUENCE:
        return f"a list of {len(node.items)}" if node.items else "an empty list"
    if node.kind == MAPPING:
        keys = [shown(key) for key in list(node.entries)[:3]]
        return f"a mapping with {listed(keys)}{', ...' if len(node.entries) > 3 else ''}" if keys else "{}"
    assert node.kind == SCALAR
    value = node.scalar()
    if value is None:
        return "nothing"
    if isinstance(value, str):
        return f"the text {shown(node.text)}"
    told = shown(node.text)[1:-1]
    return f"{told}, the value of {shown(node.source)}" if node.source else told
