"""A case that takes another and changes it (`extends`): the tree of both, and its text."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from mdstopo.case.text.errors import Mistake
from mdstopo.case.text.file_text import FileTextError, text_in
from mdstopo.case.text.nodes import MAPPING, SCALAR, SEQUENCE, Node, YamlSyntaxError, parse
from mdstopo.case.text.reading import Reading, found
from mdstopo.case.text.words import shown
from mdstopo.case.text.yaml_text import text_of

KEY = "extends"
DEEPEST_CHAIN = 10
"""Cases that extend each other, one the next."""


class CannotExtendError(Exception):
    """What a case extends cannot be read at all; its mistakes are noted."""


def extended(root: Node, place: Path | None, reading: Reading) -> Node:
    """The tree of a case and of what it extends, the key left out; the tree itself where it extends nothing.

    place: the case's file, None where it has none. Raises CannotExtendError.
    """
    if KEY not in root.entries:
        return root
    above = [] if place is None else [place]
    return _extended(root, Path() if place is None else place.parent, above, Path(), reading)


def text_of_tree(root: Node) -> str:
    """A tree as the text of a case file; expressions stay what they are."""
    content: dict[str, Any] = _plain(root)
    return text_of(content)


def _extended(root: Node, folder: Path, above: list[Path], way: Path, reading: Reading) -> Node:
    """As `extended`.

    root: of a file in `folder`, which a chain of files `above` has led to.
    way: from the folder of the case to `folder`.
    """
    entry = root.entries.get(KEY)
    if entry is None:
        return root
    node = entry[1]
    stated = node.scalar() if node.kind == SCALAR else None
    if not isinstance(stated, str) or not stated or "\0" in stated:
        raise _cannot(reading, f"found {found(node)}, allowed is the path of a case file", node)
    base = folder / stated
    chain = [*above, base]
    if any(_same(base, each) for each in above):
        names = " -> ".join(each.name for each in chain)
        raise _cannot(reading, f"is extended by itself: {names}", node)
    if len(chain) > DEEPEST_CHAIN:
        raise _cannot(reading, f"more than {DEEPEST_CHAIN} cases extend each other", node)
    try:
        text, _ = text_in(base)
    except FileTextError as error:
        raise _cannot(reading, f"{shown(str(base))}: {error.mistake.message}", node) from None
    other = _tree(text, base, reading)
    on = way / Path(stated).parent
    if on != Path():
        lead(other, on)
    other = _extended(other, base.parent, chain, on, reading)
    own = root.at(root.line, root.column)
    own.entries = {word: pair for word, pair in root.entries.items() if word != KEY}
    return _changed(other, own)


def _cannot(reading: Reading, message: str, node: Node) -> CannotExtendError:
    reading.mistake(KEY, message, node)
    return CannotExtendError(message)


def _same(one: Path, other: Path) -> bool:
    try:
        return one.exists() and other.exists() and os.path.samefile(one, other)
    except OSError:
        return False


def _tree(text: str, base: Path, reading: Reading) -> Node:
    """The tree of a file that is extended, of which each node tells the file and its place as its origin."""

    def note(mistake: Mistake) -> None:
        reading.mistakes.append(replace(mistake, origin=f"{base}:{mistake.line}:{mistake.column}"))

    try:
        root = parse(text, note)
    except YamlSyntaxError as error:
        note(error.mistake)
        raise CannotExtendError(error.mistake.message) from None
    if root is None or root.kind != MAPPING:
        what = "nothing" if root is None else found(root)
        note(Mistake("", f"found {what}, allowed is a mapping, which a case is", 1, 1))
        raise CannotExtendError(what)
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if not node.origin:
            node.origin = f"{base}:{node.line}:{node.column}"
            waiting += node.items
            for key, value in node.entries.values():
                waiting += [key, value]
    return root


def lead(root: Node, way: Path) -> None:
    """Change the paths of files that a tree includes, so that they are found from another folder, from which `way`
    leads to the tree's own."""
    seen: set[int] = set()
    waiting = [pair[1] for word, pair in root.entries.items() if word != "define"]
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            continue
        seen.add(id(node))
        waiting += node.items
        for word, (_, value) in node.entries.items():
            if word != "file" or value.kind != SCALAR:
                waiting.append(value)
            elif id(value) not in seen and isinstance(value.scalar(), str) and value.text:
                seen.add(id(value))
                value.text, value.plain = (way / value.text).as_posix(), False


def _changed(base: Node, own: Node) -> Node:
    """A tree with another's keys in the place of its own; what is null there is left out."""
    if base.kind != MAPPING or own.kind != MAPPING:
        return own
    twin = own.at(own.line, own.column)
    twin.entries = dict(base.entries)
    for word, (key, value) in own.entries.items():
        if value.kind == SCALAR and value.scalar() is None:
            twin.entries.pop(word, None)
        elif word in base.entries:
            twin.entries[word] = (key, _changed(base.entries[word][1], value))
        else:
            twin.entries[word] = (key, _without_null(value))
    return twin


def _without_null(node: Node) -> Node:
    """A tree that changes nothing of another, without what it would remove."""
    if node.kind != MAPPING:
        return node
    twin = node.at(node.line, node.column)
    kept = {word: pair for word, pair in node.entries.items() if pair[1].kind != SCALAR or pair[1].scalar() is not None}
    twin.entries = {word: (key, _without_null(value)) for word, (key, value) in kept.items()}
    return twin


def _plain(node: Node) -> Any:
    if node.kind == SCALAR:
        return node.scalar()
    if node.kind == SEQUENCE:
        return [_plain(item) for item in node.items]
    return {word: _plain(value) for word, (_, value) in node.entries.items()}
