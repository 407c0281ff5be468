"""Docstrings of functions with many arguments name each of them, or say where the same function is described."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.sources import functions_of, tree

ROOT = Path(__file__).resolve().parents[2]
#: a function with more arguments than this names them in its docstring
FEW = 5
#: how a function that stands for one of an interface says which
ELSEWHERE = re.compile(r"see `(\w+_interface)\.(\w+)`")


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    """The names of all arguments but `self` and `cls`."""
    given = function.args
    every = [*given.posonlyargs, *given.args, given.vararg, *given.kwonlyargs, given.kwarg]
    return [each.arg for each in every if each is not None and each.arg not in ("self", "cls")]


def described(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether the docstring names a function of an interface of this name, with the same arguments."""
    named = ELSEWHERE.search(ast.get_docstring(function) or "")
    if named is None or named[2] != function.name:
        return False
    there = [each for each in interface(named[1]) if each.name == named[2]]
    return [arguments(each) for each in there] == [arguments(function)]


@cache
def interface(name: str) -> list[ast.FunctionDef]:
    """The functions of an interface's module."""
    (path,) = (ROOT / "mdstopo").rglob(f"{name}.py")
    return [each for each in tree(path).body if isinstance(each, ast.FunctionDef)]


def unnamed(module: ast.Module) -> Iterator[tuple[int, str, list[str]]]:
    """Line and name of each function with many arguments, and those that its docstring does not name as words."""
    for function in functions_of(module):
        names = arguments(function)
        if len(names) > FEW:
            words = set(re.findall(r"\w+", ast.get_docstring(function) or ""))
            missing = [name for name in names if name not in words]
            if missing and not described(function):
                yield function.lineno, function.name, missing


def test_a_docstring_names_every_argument_of_many() -> None:
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line} {name}: {', '.join(missing)}"
        for path in sorted((ROOT / "mdstopo").rglob("*.py"))
        for line, name, missing in unnamed(tree(path))
    ]
    assert found == []


def test_an_argument_that_is_not_named_is_found() -> None:
    head = "def f(self, a, b, /, cc, *d, e, **f):\n    "
    assert list(unnamed(ast.parse(head + "'''a, b: numbers. c, d, e, f: others.'''"))) == [(1, "f", ["cc"])]
    assert list(unnamed(ast.parse(head + "pass"))) == [(1, "f", ["a", "b", "cc", "d", "e", "f"])]
    assert list(unnamed(ast.parse(head + "'''a, b, cc, d, e, f: numbers.'''"))) == []
    assert list(unnamed(ast.parse("def f(a, b, c, d, e): pass"))) == []


def test_a_function_of_an_interface_is_described_there_if_it_has_the_same_arguments() -> None:
    head, tail = "def cubic(model, c, h, q0, v0, q1, v1, ", "):\n    '''The cubic; see `kinematics_interface.cubic`.'''"
    assert list(unnamed(ast.parse(head + "q, v" + tail))) == []
    assert len(list(unnamed(ast.parse(head + "q, v, a" + tail)))) == 1
    assert len(list(unnamed(ast.parse((head + "q, v" + tail).replace("def cubic", "def quartic"))))) == 1
