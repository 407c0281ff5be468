"""Tests call entries with such types of arguments alone as a wheel has machine code for (packaging/entries.txt).

What cannot be compiled by `numba_private` fails there and then. Outside of tests a process goes on in Numba's own way,
with a notice; of a test that passes nobody reads it, and those behind it would compile for minutes.
"""

import gc
import runpy
import sys
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

from mdstopo.compiler import tried
from mdstopo.compiler.entry import Entry

SHIP = Path(__file__).resolve().parents[1] / "packaging" / "ship_kernels.py"


@cache
def table() -> frozenset[tuple[str, str, str]]:
    """Of all entries module, name, and types of the arguments, one text for all of them."""
    return frozenset(runpy.run_path(str(SHIP))["table"]())


def held(entry: Entry, types: str) -> None:
    """Raise AssertionError where an entry of the package is called with types that are not in the table."""
    module, name = entry.__module__, entry.__name__
    of_package = module.startswith("mdstopo.") and getattr(sys.modules.get(module), name, None) is entry
    if of_package and (module, name, types) not in table():
        raise AssertionError(f"{SHIP.with_name('entries.txt')} has no line for this call: {module}.{name} {types}")


def hold_calls() -> None:
    """Have all calls of this process held to the table.

    What the compiler leaves in memory lives on: Python is spared to look through it for what could go.
    """
    ready, built = Entry._ready, Entry._built

    def checked(entry: Entry, types: str) -> object:
        held(entry, types)
        return ready(entry, types)

    def frozen(entry: Entry, path: Path, types: str) -> Any:
        try:
            return built(entry, path, types)
        finally:
            gc.freeze()

    def fail(error: Exception, _: str) -> NoReturn:
        raise error

    tried.without_private = fail  # type: ignore[assignment]
    Entry._ready = checked  # type: ignore[method-assign,assignment]
    Entry._built = frozen  # type: ignore[method-assign]
