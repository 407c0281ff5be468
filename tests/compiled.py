"""Kernels called from a test: `compiled`."""

from collections.abc import Callable
from typing import Any

from mdstopo.compiler.entry import Entry


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that calls kernels, compiled for the same target as they are; nothing of it is kept on the disk."""
    return Entry(function, frozenset())._by_numba
