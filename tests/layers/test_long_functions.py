"""Functions that do not fit a screen are those that the page on the architecture names, each with its reason."""

import ast
import re
from fnmatch import fnmatch

from tests.sources import functions_of, tree

from .test_imports import ROOT

#: lines of a screen, without those of a docstring
SCREEN = 70


def listed() -> list[tuple[list[str], list[str]]]:
    """Patterns of files and names of functions, a pair a row of the table."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    section = page.partition("{ #long }")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:4] for line in section.splitlines() if line.startswith("| `")]
    assert all(reason.strip() for _, _, reason in rows)
    return [(re.findall("`([^`]+)`", where), re.findall("`([^`]+)`", names)) for where, names, _ in rows]


def long_functions(module: ast.Module) -> list[str]:
    """The names of functions of a module that are longer than a screen."""
    found = []
    for node in functions_of(module):
        docstring = (ast.get_docstring(node, clean=False) or "").count("\n") + 1
        assert node.end_lineno is not None
        if node.end_lineno - node.lineno + 1 - docstring > SCREEN:
            found.append(node.name)
    return found


def test_the_page_names_the_functions_that_do_not_fit_a_screen_and_no_others() -> None:
    there = {
        (path.relative_to(ROOT).as_posix(), name)
        for path in sorted((ROOT / "mdstopo").rglob("*.py"))
        for name in long_functions(tree(path))
    }
    rows = listed()

    def fits(one: tuple[str, str], files: list[str], names: list[str]) -> bool:
        return any(fnmatch(one[0], file) for file in files) and one[1] in names

    assert sorted(one for one in there if not any(fits(one, *row) for row in rows)) == []
    needless = [
        each
        for files, names in rows
        for each in (*files, *names)
        if not any(fits(one, files, names) and (fnmatch(one[0], each) or one[1] == each) for one in there)
    ]
    assert rows
    assert needless == []


def test_a_long_function_is_found_whatever_its_docstring() -> None:
    lines = "\n".join(["    x = 1"] * SCREEN)
    assert long_functions(ast.parse(f"def f():\n    '''Says.\n\n    More.\n    '''\n{lines}\n")) == ["f"]
    few = "\n".join(["    x = 1"] * (SCREEN - 1))
    assert long_functions(ast.parse(f"def f():\n    '''Says.\n\n    More.\n    '''\n{few}\n")) == []
