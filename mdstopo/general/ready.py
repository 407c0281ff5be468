"""Calls of compiled entries whose arguments are nearly always the same arrays."""

from collections.abc import Callable
from typing import Any


class Ready:
    """Entries prepared with their arrays (`Entry.prepare`), and again where one of these is another: a call takes a
    microsecond instead of twenty.
    """

    def __init__(self) -> None:
        self._kept: dict[str, tuple[tuple[Any, ...], list[int], list[int], Callable[..., Any]]] = {}

    def __call__(self, name: str, entry: Any, *arguments: Any) -> Any:
        """entry(*arguments); the types of arguments are always the same under one name."""
        kept = self._kept.get(name)
        if kept is None or any(arguments[k] is not kept[0][k] for k in kept[1]):
            numbers = [k for k, each in enumerate(arguments) if isinstance(each, (bool, int, float))]
            others = [k for k in range(len(arguments)) if k not in numbers]
            kept = self._kept[name] = arguments, others, numbers, entry.prepare(*arguments)
        return kept[3](*[(k, arguments[k]) for k in kept[2]])
