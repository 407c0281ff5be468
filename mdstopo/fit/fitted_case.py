"""The text of a case with fitted numbers in the place of its own: as it was written where that can be, else anew."""

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.extending import lead, text_of_tree
from mdstopo.case.text.key_paths import led_to
from mdstopo.case.text.nodes import Node, parse
from mdstopo.case.text.overrides import apply_overrides

_QUOTED = re.compile(r"\"(?:[^\"\\]|\\.)*\"|'(?:[^']|'')*'", re.DOTALL)


def fitted_text(case: Case, numbers: Mapping[str, float], place: Path) -> str:
    """The case with numbers at some keys, to be written at a place; files that it includes are found from there.

    Comments and the order stay where only numbers change: not where --set has changed the case, where the case extends
    another, or where the new place is in another folder than files that it includes.
    """
    folder = Path() if case.path is None else case.path.parent
    moved = folder.resolve() != place.resolve().parent
    meant = read_case(case.text, path=case.path, overrides={**case.overrides, **numbers})
    if not case.overrides and not (moved and _includes(case)):
        text = _replaced(case.text, numbers)
        if text is not None and _same(text, place, meant):
            return text
    root = _tree(case.text)
    root, _ = apply_overrides(root, {**case.overrides, **numbers}, lambda _mistake: None)
    if moved:
        lead(root, Path(os.path.relpath(folder, place.resolve().parent)))
    return text_of_tree(root)


def _tree(text: str) -> Node:
    root = parse(text.removeprefix("\ufeff"), lambda _mistake: None)
    assert root is not None  # it has been read before
    return root


def _includes(case: Case) -> bool:
    return bool(case.files) or case.fit is not None


def _replaced(text: str, numbers: Mapping[str, float]) -> str | None:
    """The text with other numbers where they stand; None where that is not certain."""
    root = _tree(text)
    lines = text.removeprefix("\ufeff").splitlines(keepends=True)
    ends: dict[tuple[int, int], tuple[int, str]] = {}
    for key, value in numbers.items():
        node = led_to(key, root)[1]
        line, first = node.line - 1, node.column - 1
        rest = lines[line][first:]
        quoted = _QUOTED.match(rest)
        old = quoted[0] if quoted is not None else node.text if rest.startswith(node.text) else ""
        if not old or (line, first) in ends:
            return None
        ends[line, first] = (first + len(old), repr(value))
    for (line, first), (last, new) in sorted(ends.items(), reverse=True):
        lines[line] = lines[line][:first] + new + lines[line][last:]
    return "".join(lines)


def _same(text: str, place: Path, meant: Case) -> bool:
    """Whether a text means a case; what it is called, and where it comes from, aside."""
    try:
        read = read_case(text, path=place)
    except CaseError:
        return False
    aside = {
        name: getattr(meant, name) for name in ("path", "name", "text", "sha256", "overrides", "marks", "warnings")
    }
    return replace(read, **aside) == meant
