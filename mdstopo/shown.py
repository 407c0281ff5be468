"""How cases, evaluations, motions and results show themselves in a notebook.

Their classes stand far below the pictures; so the module that writes the HTML is named here, as records name their
kernels, and loaded when a notebook asks.
"""

from importlib import import_module
from typing import Any

WRITER = "mdstopo.plots.notebook"


def html_of(value: Any) -> str:
    """A value as a piece of HTML: a table, and a picture where matplotlib is installed."""
    text: str = import_module(WRITER).html(value)
    return text


def counted(count: int, noun: str) -> str:
    """A number with its noun, in the plural where it is not one: `1 body`, `3 members`."""
    return f"1 {noun}" if count == 1 else f"{count:,} {plural(noun)}"


def plural(noun: str) -> str:
    """A noun in the plural: `bodies`, `members`."""
    return f"{noun[:-1]}ies" if noun.endswith("y") else f"{noun}s"
