"""From YAML text to a tree of located nodes.

The tree is built here from the parser's events, not by PyYAML's composer: so nesting, aliases and duplicate
keys are checked while reading, every node knows its place, and no recursion depends on the input.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.scalars import Scalar, resolve
from mdstopo.case.text.words import count_text, inside, shown

SCALAR, SEQUENCE, MAPPING = "scalar", "sequence", "mapping"
DEEPEST_NESTING = 50
MOST_EXPANDED = 5_000_000


class Node:
    """A value of a YAML file with its place (line and column).

    kind: SCALAR (`text`, `plain`), SEQUENCE (`items`) or MAPPING (`entries`: key -> (key node, value node),
    merge keys applied). line, column: from 1. origin: as in `Mistake`. size: nodes below and itself, aliases
    expanded. source: the expression that a number comes from, else empty. Nodes are not changed once the tree stands:
    aliases share them.
    """

    __slots__ = ("column", "entries", "items", "kind", "line", "origin", "plain", "size", "source", "text")

    def __init__(self, kind: str, line: int, column: int, origin: str = "") -> None:
        self.kind = kind
        self.line = line
        self.column = column
        self.origin = origin
        self.text = ""
        self.plain = False
        self.items: list[Node] = []
        self.entries: dict[str, tuple[Node, Node]] = {}
        self.size = 1
        self.source = ""

    def at(self, line: int, column: int) -> Node:
        """The same value at another place in the file: what an alias stands for. Children are shared."""
        twin = Node(self.kind, line, column, self.origin)
        twin.text, twin.plain, twin.size, twin.source = self.text, self.plain, self.size, self.source
        twin.items, twin.entries = self.items, self.entries
        return twin

    def scalar(self) -> Scalar:
        """The value of a scalar node after YAML 1.2's core schema; a quoted one is text."""
        return resolve(self.text) if self.plain else self.text


class YamlSyntaxError(Exception):
    """The text is no YAML document that the format allows; carries the one located mistake."""

    def __init__(self, mistake: Mistake) -> None:
        self.mistake = mistake
        super().__init__(mistake.message)


def parse(text: str, report: Callable[[Mistake], None], origin: str = "") -> Node | None:
    """The document in `text`; None where it is empty.

    Mistakes that leave a tree (keys given twice, tags, merge keys of the wrong kind) go to `report`. Raises
    YamlSyntaxError for those that do not: bad syntax, several documents, too deep nesting, aliases that
    expand to too much.
    """
    return _Builder(text, report, origin).document()


class _Builder:
    def __init__(self, text: str, report: Callable[[Mistake], None], origin: str) -> None:
        import yaml

        self.yaml = yaml
        self.text = text
        self.origin = origin
        self.report = report
        self.anchors: dict[str, Node] = {}
        self.unfinished: set[int] = set()
        self.pending: list[tuple[Node, str, Mistake]] = []
        loader: Any = getattr(yaml, "CSafeLoader", None) or yaml.SafeLoader
        try:
            self.events = loader(text)
        except yaml.YAMLError as error:  # the pure Python reader checks characters at once
            raise self._syntax(error) from None

    def document(self) -> Node | None:
        try:
            return self._document()
        except self.yaml.YAMLError as error:
            raise self._syntax(error) from None
        finally:
            self.events.dispose()

    def _document(self) -> Node | None:
        yaml, events = self.yaml, self.events
        events.get_event()  # stream start
        if isinstance(events.get_event(), yaml.StreamEndEvent):
            return None
        root = self._tree()
        if self.pending:
            paths = _paths(root)
            for owner, key, mistake in self.pending:
                path = paths.get(id(owner), "")
                self.report(replace(mistake, path_key=inside(path, key) if key else path))
        events.get_event()  # document end
        after = events.get_event()
        if not isinstance(after, yaml.StreamEndEvent):
            raise YamlSyntaxError(
                self._mistake(after.start_mark, "a second document starts here; a case file holds one")
            )
        if root.size > MOST_EXPANDED and self.anchors:
            raise YamlSyntaxError(
                Mistake(
                    "",
                    f"the aliases expand to {count_text(root.size)} values; "
                    f"at most {count_text(MOST_EXPANDED)} are read",
                    root.line,
                    root.column,
                    self.origin,
                )
            )
        return root

    def _tree(self) -> Node:
        """The node that the next events describe, iteratively: `stack` holds what is still open."""
        yaml, events = self.yaml, self.events
        stack: list[tuple[Node, list[Node]]] = []
        while True:
            event = events.get_event()
            if isinstance(event, (yaml.MappingEndEvent, yaml.SequenceEndEvent)):
                node, children = stack.pop()
                self.unfinished.discard(id(node))
                self._close(node, children)
            else:
                node = self._open(event)
                if node.kind != SCALAR and not isinstance(event, yaml.AliasEvent):
                    if len(stack) >= DEEPEST_NESTING:
                        raise YamlSyntaxError(
                            self._mistake(event.start_mark, f"nested deeper than {DEEPEST_NESTING} levels")
                        )
                    self.unfinished.add(id(node))
                    stack.append((node, []))
                    continue
            if not stack:
                return node
            stack[-1][1].append(node)

    def _open(self, event: Any) -> Node:
        mark = event.start_mark
        line, column = mark.line + 1, mark.column + 1
        if isinstance(event, self.yaml.AliasEvent):
            name = str(event.anchor)
            target = self.anchors.get(name)
            if target is None:
                raise YamlSyntaxError(self._mistake(mark, f"no anchor &{name} before this alias"))
            if id(target) in self.unfinished:
                raise YamlSyntaxError(self._mistake(mark, f"the alias *{name} stands inside what it refers to"))
            return target.at(line, column)
        if isinstance(event, self.yaml.ScalarEvent):
            node = Node(SCALAR, line, column, self.origin)
            node.text = event.value
            node.plain = event.style is None or event.style == ""
        else:
            sequence = isinstance(event, self.yaml.SequenceStartEvent)
            node = Node(SEQUENCE if sequence else MAPPING, line, column, self.origin)
        if event.tag is not None:
            self._tell(node, node, f"found the tag {shown(event.tag)}; a case file has no tags")
        if event.anchor is not None:
            self.anchors[event.anchor] = node
        return node

    def _close(self, node: Node, children: list[Node]) -> None:
        node.size = 1 + sum(child.size for child in children)
        if node.kind == SEQUENCE:
            node.items = children
            return
        merged: list[tuple[Node, Node]] = []
        entries: dict[str, tuple[Node, Node]] = {}
        for key, value in zip(children[::2], children[1::2], strict=True):
            if key.kind != SCALAR:
                self._tell(node, key, "a key must be a name, not a list or a mapping")
                continue
            first = entries.get(key.text)
            if key.plain and key.text == "<<":
                if merged:
                    self._twice(node, key, merged[0][0])
                merged.append((key, value))
            elif first is not None:
                self._twice(node, key, first[0])
            else:
                entries[key.text] = (key, value)
        node.entries = entries
        if merged:
            self._merge(node, merged[0][1])

    def _merge(self, node: Node, source: Node) -> None:
        """Own keys win over merged ones, earlier merged mappings over later ones."""
        for mapping in source.items if source.kind == SEQUENCE else [source]:
            if mapping.kind != MAPPING:
                self._tell(node, mapping, "a merge key << takes a mapping or a list of mappings (by alias)")
                continue
            for name, entry in mapping.entries.items():
                node.entries.setdefault(name, entry)

    def _twice(self, owner: Node, key: Node, first: Node) -> None:
        message = f"the key is given twice, first at line {first.line}, column {first.column}"
        self._tell(owner, key, message, key.text)

    def _tell(self, owner: Node, node: Node, message: str, key: str = "") -> None:
        """Keep a mistake at `node`, in the value `owner` (at its `key`), until the key paths are known."""
        self.pending.append((owner, key, Mistake("", message, node.line, node.column, self.origin)))

    def _mistake(self, mark: Any, message: str) -> Mistake:
        return Mistake("", message, mark.line + 1, mark.column + 1, self.origin)

    def _character(self, mark: Any) -> str:
        """What stands at a mark of the parser."""
        lines = self.text.split("\n", mark.line + 1)
        return lines[mark.line][mark.column : mark.column + 1] if mark.line < len(lines) else ""

    def _syntax(self, error: Any) -> YamlSyntaxError:
        """The parser's complaint, located. Its reader counts characters, its scanner lines and columns."""
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        if mark is not None:
            problem = error.problem or error.context or "cannot be read"
            if "nesting depth" in problem:  # newer parsers count, too, and look ahead
                return YamlSyntaxError(self._mistake(mark, f"nested deeper than {DEEPEST_NESTING} levels"))
            begun = getattr(error, "context_mark", None)
            context = ""
            if error.context and begun is not None:
                context = f" ({error.context} that starts at line {begun.line + 1}, column {begun.column + 1})"
            if self._character(mark) == "\t":
                problem, context = "a tab stands here; indent with blanks", ""
            return YamlSyntaxError(self._mistake(mark, f"not valid YAML: {problem}{context}"))
        position = _forbidden(self.text)
        before = self.text[:position]
        line = before.count("\n") + 1
        column = position - (before.rfind("\n") + 1) + 1
        code = f"U+{ord(self.text[position]):04X}" if position < len(self.text) else "that stands"
        message = f"not valid YAML: the character {code} is not allowed here"
        return YamlSyntaxError(Mistake("", message, line, column, self.origin))


def _paths(root: Node) -> dict[int, str]:
    """Key path of every node by identity; of a shared one the first."""
    paths: dict[int, str] = {}
    waiting = [(root, "")]
    while waiting:
        node, path = waiting.pop()
        if id(node) in paths:
            continue
        paths[id(node)] = path
        below = [(child, f"{path}[{index}]") for index, child in enumerate(node.items)]
        for name, (key, value) in node.entries.items():
            below.append((value, inside(path, name)))
            paths.setdefault(id(key), inside(path, name))
        waiting.extend(reversed(below))
    return paths


def _forbidden(text: str) -> int:
    """Index of the first character that YAML does not allow in a file, else the end."""
    for index, character in enumerate(text):
        code = ord(character)
        if code < 0x20 and character not in "\t\n\r":
            return index
        if code == 0x7F or (0x80 <= code < 0xA0 and code != 0x85) or 0xD800 <= code < 0xE000:
            return index
        if code in (0xFFFE, 0xFFFF):
            return index
    return len(text)
