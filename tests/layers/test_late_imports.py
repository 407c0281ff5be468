"""Imports inside functions are those that the page on the architecture lists, each with its reason."""

import ast
import re
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

from tests.sources import functions_of, statements, tree

ROOT = Path(__file__).resolve().parents[2]
Late = tuple[str, str]
#: an import inside something: most modules have none and need not be parsed
INDENTED = re.compile(r"^ +(import|from) ", re.MULTILINE)


def listed() -> list[tuple[list[str], list[str]]]:
    """Patterns of files and of modules, a pair a row of the table."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = page.partition("{ #late }")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:4] for line in section.splitlines() if line.startswith("| `")]
    assert all(reason.strip() for _, _, reason in rows)
    return [
        (re.findall("`([^`]+)`", where), re.findall("`([^`]+)`", what) or ["*"] * (what.strip() == "everything"))
        for where, what, _ in rows
    ]


@cache
def late() -> tuple[Late, ...]:
    """File and module of each import inside a function of the package."""
    found: list[Late] = []
    for path in sorted((ROOT / "mdstopo").rglob("*.py")):
        if not INDENTED.search(path.read_text(encoding="utf-8")):
            continue
        for function in functions_of(tree(path)):
            for node in statements(function):
                file = path.relative_to(ROOT).as_posix()
                if isinstance(node, ast.Import):
                    found += [(file, name.name) for name in node.names]
                elif isinstance(node, ast.ImportFrom):
                    found.append((file, node.module or ""))
    return tuple(found)


def fits(found: Late, row: tuple[list[str], list[str]]) -> bool:
    return all(any(fnmatch(name, each) for each in some) for name, some in zip(found, row, strict=True))


def test_every_import_inside_a_function_is_listed() -> None:
    rows = listed()
    assert [found for found in late() if not any(fits(found, row) for row in rows)] == []


def test_every_row_has_an_import_for_each_of_its_files_and_modules() -> None:
    found = late()
    unused = [
        name
        for files, modules in listed()
        for name in (*files, *modules)
        if not any(
            fits(each, (files, modules)) and (fnmatch(each[0], name) if "/" in name else fnmatch(each[1], name))
            for each in found
        )
    ]
    assert unused == []
