"""Docstrings of functions with many arguments name each of them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: a function with more arguments than this names them in its docstring
FEW = 5


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """The names of all arguments but `self` and `cls`."""
    given = function.args
    every = [*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg]
    return [each.arg for each in every if each is not None and each.arg not in ("self", "cls")]


def unnamed(source: str) -> Iterator[tuple[int, str, list[str]]]:
    """Line and name of each function with many arguments, and those that its docstring does not name as words."""
    for function in ast.walk(ast.parse(source)):
        if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names = arguments(function)
            words = set(re.findall(r"\w+", ast.get_docstring(function) or ""))
            missing = [name for name in names if name not in words]
            if len(names) > FEW and missing:
                yield function.lineno, function.name, missing


def test_a_docstring_names_every_argument_of_many() -> None:
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line} {name}: {', '.join(missing)}"
        for path in sorted((ROOT / "mdstopo").rglob("*.py"))
        for line, name, missing in unnamed(path.read_text(encoding="utf-8"))
    ]
    assert found == []


def test_an_argument_that_is_not_named_is_found() -> None:
    head = "def f(self, a, b, /, cc, *d, e, **f):\n    "
    assert list(unnamed(head + "'''a, b: numbers. c, d, e, f: others.'''")) == [(1, "f", ["cc"])]
    assert list(unnamed(head + "pass")) == [(1, "f", ["a", "b", "cc", "d", "e", "f"])]
    assert list(unnamed(head + "'''a, b, cc, d, e, f: numbers.'''")) == []
    assert list(unnamed("def f(a, b, c, d, e): pass")) == []
