"""Keys set from outside the file (``--set KEY=VALUE``): the tree with one value replaced."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node, YamlSyntaxError, parse
from mdstopo.case.text.quantities import PATTERN
from mdstopo.case.text.words import count_text, did_you_mean, inside, shown

_STEP = re.compile(r"\.?([^.\[\]]+)|\[([0-9]{1,9})\]")


def apply_overrides(
    root: Node, overrides: Mapping[str, Any], report: Callable[[Mistake], None]
) -> tuple[Node, dict[str, str]]:
    """The tree with every override applied in order, and the overrides as text (key path -> YAML).

    A key path is written as in messages: ``solver.step``, ``constraints[0].equals`` (also ``.0.``).
    Mappings on the way that are missing are made. A value that is text is read as YAML, others as they are; but a
    number with a unit needs no quotation marks, which a shell takes away. ``null`` removes the key, which has to be
    there.
    """
    texts: dict[str, str] = {}
    for key, value in overrides.items():
        name = str(key)
        origin = f"--set {name}"
        try:
            node = _value(value, report, origin)
            root = _replaced(root, steps_of(name), node, "", origin)
        except WrongPathError as error:
            report(Mistake(error.path, error.message, 1, 1, origin))
        except YamlSyntaxError as error:
            report(error.mistake)
        else:
            texts[name] = value if isinstance(value, str) else as_yaml(value)
    return root, texts


class WrongPathError(Exception):
    """A key path does not lead to anything in the case."""

    def __init__(self, path: str, message: str) -> None:
        self.path = path
        self.message = message
        super().__init__(message)


def steps_of(key: str) -> list[str | int]:
    """A key path as names and places in lists. Raises WrongPathError where it is none."""
    steps: list[str | int] = []
    position = 0
    while position < len(key):
        match = _STEP.match(key, position)
        if match is None or (position == 0 and key[0] == "."):
            break
        steps.append(match[1] if match[1] is not None else int(match[2]))
        position = match.end()
    if not steps or position < len(key) or len(steps) > 20:
        message = f"{shown(key)} is no key path, such as solver.step or constraints[0].equals"
        raise WrongPathError("", message)
    return steps


def _value(value: Any, report: Callable[[Mistake], None], origin: str) -> Node:
    if isinstance(value, str):
        try:
            value.encode("utf-8")
        except UnicodeEncodeError:
            raise WrongPathError("", "the value is not text in UTF-8") from None
        node = parse(value, report, origin)
        if node is None:
            node = Node(SCALAR, 1, 1, origin)
            node.plain = True
        _quote_units(node)
        return node
    return node_of(value, origin)


def _quote_units(node: Node) -> None:
    """Take numbers with a unit, `40 mm`, as if they stood in quotation marks."""
    for part in (*node.items, *(value for _, value in node.entries.values())):
        _quote_units(part)
    if node.kind == SCALAR and node.plain and isinstance(node.scalar(), str) and re.match(PATTERN, node.text):
        node.plain = False


def node_of(value: Any, origin: str, depth: int = 0) -> Node:
    """The node of a file that a Python value (number, text, boolean, None, list, mapping, or numpy's like of it) would
    be."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping) and depth < 20:
        node = Node(MAPPING, 1, 1, origin)
        for key, part in value.items():
            name = Node(SCALAR, 1, 1, origin)
            name.text = str(key)
            node.entries[name.text] = (name, node_of(part, origin, depth + 1))
        return node
    if isinstance(value, Sequence) and not isinstance(value, (str, bytes)) and depth < 20:
        node = Node(SEQUENCE, 1, 1, origin)
        node.items = [node_of(part, origin, depth + 1) for part in value]
        return node
    node = Node(SCALAR, 1, 1, origin)
    node.plain = value is None or isinstance(value, (bool, int, float))
    node.text = as_yaml(value) if node.plain else str(value)
    return node


def as_yaml(value: Any) -> str:
    """A Python value in YAML's flow style, on one line."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if value != value else (".inf" if value > 0 else "-.inf")
    if isinstance(value, int):
        return str(value) if value.bit_length() < 10_000 else (".inf" if value > 0 else "-.inf")
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{as_yaml(str(k))}: {as_yaml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(as_yaml(part) for part in value) + "]"
    return json.dumps(str(value))


def _is_empty(node: Node) -> bool:
    """Whether nothing stands there, or `null`."""
    return node.kind == SCALAR and node.plain and node.scalar() is None


def _replaced(node: Node, steps: list[str | int], value: Node, path: str, origin: str) -> Node:
    """A copy of `node` with the value at `steps` replaced; everything beside the way is shared."""
    if not steps:
        return value
    step, rest = steps[0], steps[1:]
    empty = _is_empty(node)
    if node.kind == SEQUENCE:
        index = int(step) if isinstance(step, int) or (step.isascii() and step.isdigit()) else None
        if index is None or index >= len(node.items):
            count = count_text(len(node.items))
            allowed = f"an index below {count}" if node.items else "nothing"
            message = f"this is a list of {count}; found {shown(str(step))}, allowed is {allowed}"
            raise WrongPathError(path, message)
        twin = node.at(node.line, node.column)
        twin.items = list(node.items)
        twin.items[index] = _replaced(node.items[index], rest, value, f"{path}[{index}]", origin)
        return twin
    if (node.kind == MAPPING or empty) and isinstance(step, str):
        twin = node.at(node.line, node.column)
        twin.kind = MAPPING
        twin.entries = dict(node.entries)
        key, old = node.entries.get(step, (None, None))
        if value.text and _is_empty(value):  # an empty text is a mistake: something was forgotten
            if old is None:
                hint = did_you_mean(step, node.entries)
                raise WrongPathError(inside(path, step), f"there is no such key to remove{hint}")
            if not rest:
                del twin.entries[step]
                return twin
        if key is None:
            key = Node(SCALAR, 1, 1, origin)
            key.text = step
        if old is None:
            old = Node(MAPPING, 1, 1, origin)
        twin.entries[step] = (key, _replaced(old, rest, value, inside(path, step), origin))
        return twin
    what = "a mapping" if node.kind == MAPPING else "a single value"
    raise WrongPathError(path, f"this is {what}; {shown(str(step))} cannot be set in it")
