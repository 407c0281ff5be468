"""What other distributions bring: records that they register by entry points.

Nothing is looked for until a case names something that is not known here; only then are the installed distributions
read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class BroughtError(Exception):
    """A record that another distribution registers cannot be used; a sentence without a full stop."""


class Brought(Generic[T]):
    """The records that other distributions register in one group of entry points, by the word that case files have
    for them.

    enter (record) takes one in and returns what the reader needs of it; it raises TypeError where it is no such record.
    """

    def __init__(self, group: str, enter: Callable[[Any], T]) -> None:
        self.group = group
        self._enter = enter
        #: those known so far, by word
        self.records: dict[str, T] = {}

    def find(self, word: str) -> T | None:
        """The record that is registered under a word; None where there is none. BroughtError where it cannot be
        used."""
        self._look(word)
        return self.records.get(word)

    def find_all(self) -> dict[str, T]:
        """All records that are registered. BroughtError where one cannot be used; the others are found then."""
        self._look()
        return self.records

    def _look(self, word: str | None = None) -> None:
        from importlib.metadata import entry_points

        wrong = None
        for point in sorted(entry_points(group=self.group), key=lambda each: each.name):
            if point.name in self.records or (word is not None and point.name != word):
                continue
            try:
                self.records[point.name] = self._enter(point.load())
            except Exception as error:
                what = f"{type(error).__name__}: {error}"
                wrong = wrong or BroughtError(f"{point.name!r} of {self.group} ({point.value}) cannot be used: {what}")
        if wrong is not None:
            raise wrong
