"""What tests read out of the sources of the package."""

import ast
import gc
from collections.abc import Iterator
from functools import cache
from pathlib import Path


@cache
def tree(path: Path) -> ast.Module:
    """The syntax tree of a source file, parsed once for all tests of this process; nobody may change it.

    Trees live on. Python would look through them for what could go, again and again, in half of the time.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(path.read_text(encoding="utf-8"))
    finally:
        if was:
            gc.enable()


def statements_in(node: ast.AST) -> Iterator[ast.AST]:
    """The statements right inside of a module, a definition or a compound statement, handlers and cases among
    them.

    Expressions are left out: most of a tree consists of them, and they define and import nothing.
    """
    for name in ("body", "orelse", "finalbody", "handlers", "cases"):
        inside = getattr(node, name, None)
        if isinstance(inside, list):
            yield from inside


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """A module or statement, and all statements inside of it."""
    waiting = [node]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += statements_in(node)


def functions_of(module: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """All functions of a module, methods and those inside others among them."""
    for node in statements(module):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node
