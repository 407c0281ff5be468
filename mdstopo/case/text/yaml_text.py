"""Plain values as the text of a case file: blocks where lines would be long, else one line."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from mdstopo.case.text.overrides import as_yaml
from mdstopo.case.text.scalars import resolve

LONGEST_LINE = 118
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")
#: words that other readers of YAML do not take for text
_OTHER = re.compile(r"(?i)y|n|yes|no|on|off|true|false|null")
#: sections whose parts always have lines of their own
_OPEN = 1


def text_of(content: Mapping[str, Any]) -> str:
    """The YAML text of a document of mappings, lists, text, numbers, truth values and None."""
    return "\n".join(_block(content, "", 0)) + "\n"


def _block(value: Any, indent: str, depth: int) -> Iterator[str]:
    """The lines of a mapping or a list, one part after the other."""
    parts: list[tuple[str, Any]]
    if isinstance(value, Mapping):
        parts = [(f"{_flow(str(key))}:", part) for key, part in value.items()]
    else:
        parts = [("-", part) for part in value]
    for head, part in parts:
        line = f"{indent}{head} {_flow(part)}"
        nested = isinstance(part, (Mapping, list, tuple)) and len(part) > 0
        if not nested or (len(line) <= LONGEST_LINE and not (depth < _OPEN and _deep(part))):
            yield line
            continue
        lines = _block(part, indent + "  ", depth + 1)
        yield f"{indent}- {next(lines).lstrip()}" if head == "-" else f"{indent}{head}"
        yield from lines


def _deep(part: Any) -> bool:
    return any(isinstance(each, Mapping) for each in (part.values() if isinstance(part, Mapping) else part))


def _flow(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_flow(str(key))}: {_flow(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_flow(part) for part in value) + "]"
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) and isinstance(resolve(value), str) and not _OTHER.fullmatch(value)
        return value if plain else json.dumps(value, ensure_ascii=False)
    return as_yaml(value)
