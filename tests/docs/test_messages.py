"""The messages that the troubleshooting page quotes are messages of the program."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest

from tests.sources import tree

from .pages import DOCS, ROOT

QUOTED = re.findall(r"^`([^`]+)`$", (DOCS / "troubleshooting.md").read_text(encoding="utf-8"), re.MULTILINE)
#: letters that a quotation, and a part of one, must have to be told from others
SHORTEST, PART = 9, 8


def texts(module: ast.Module) -> Iterator[str]:
    """The texts of a module without its docstrings; `...` stands for what varies, backquotes are left out."""
    docstrings: set[ast.AST] = set()
    for node in ast.walk(module):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node, clean=False):
            docstrings.update(ast.iter_child_nodes(node.body[0]))
        parts: list[object] = []
        if isinstance(node, ast.Constant) and node not in docstrings:
            parts = [node.value]
        elif isinstance(node, ast.JoinedStr):
            parts = [getattr(part, "value", None) for part in node.values]
        if parts:
            yield "".join(part if isinstance(part, str) else "..." for part in parts).replace("`", "")


@cache
def sources() -> str:
    """The texts of all modules, one a line."""
    return "\n".join(
        text.replace("\n", " ") for path in sorted((ROOT / "mdstopo").rglob("*.py")) for text in texts(tree(path))
    )


def test_the_page_quotes_messages_and_each_once() -> None:
    assert len(QUOTED) > 120
    assert len(set(QUOTED)) == len(QUOTED)


@pytest.mark.parametrize("message", QUOTED)
def test_a_quoted_message_is_one_of_the_program(message: str) -> None:
    parts = [part.strip(" ;:,()") for part in message.split("...")]
    assert sum(len(part) for part in parts) >= SHORTEST, "too short to be told from others"
    whole = ".*".join(re.escape(part) for part in parts)
    if re.search(whole, sources()) is None:  # then it is put together from several texts
        long = [part for part in parts if len(part) >= PART]
        assert long
        assert [part for part in long if part not in sources()] == []
