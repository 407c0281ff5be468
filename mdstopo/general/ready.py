"""Calls of compiled entries whose arguments are nearly always the same arrays."""

from collections.abc import Callable
from operator import is_, itemgetter
from typing import Any


class Ready:
    """Entries prepared with their arrays (`Entry.prepare`), and again where one of these is another: a call takes a
    microsecond instead of twenty.
    """

    def __init__(self) -> None:
        #: by name: the arguments that stay, how they are taken from all, places of the others, the call
        self._kept: dict[str, tuple[tuple[Any, ...], Callable[..., Any], list[int], Callable[..., Any]]] = {}

    def __call__(self, name: str, entry: Any, *arguments: Any) -> Any:
        """entry(*arguments), two arrays or more among them; their types are always the same under one name."""
        kept = self._kept.get(name)
        if kept is None or not all(map(is_, kept[1](arguments), kept[0])):
            numbers = [k for k, each in enumerate(arguments) if isinstance(each, (bool, int, float))]
            stay = itemgetter(*(k for k in range(len(arguments)) if k not in numbers))
            kept = self._kept[name] = stay(arguments), stay, numbers, entry.prepare(*arguments)
        return kept[3](*[(k, arguments[k]) for k in kept[2]])
