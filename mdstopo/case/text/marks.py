"""Where each key of a case file stands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.text.errors import Mistake
from mdstopo.case.value import Value, frozen


@frozen
class Marks(Value):
    """Where in the file each key stands, for messages: key path -> (line, column), both from 1.

    origins: key path -> ``--set KEY`` for values that came from outside the file.
    """

    places: Mapping[str, tuple[int, int]]
    origins: Mapping[str, str] = field(default_factory=FrozenDict)

    def __getitem__(self, path: str) -> tuple[int, int]:
        """Line and column of `path`, or of the nearest key that encloses it; (1, 1) where nothing does."""
        while path:
            place = self.places.get(path)
            if place is not None:
                return place
            path = enclosing(path)
        return self.places.get("", (1, 1))

    def mistake(self, path: str, message: str) -> Mistake:
        """A mistake at the place of `path`, for later stages that refuse what the reader accepted."""
        line, column = self[path]
        origin, around = self.origins.get(path, ""), path
        while not origin and around and around not in self.places:
            around = enclosing(around)
            origin = self.origins.get(around, "")
        return Mistake(path, message, line, column, origin)

    def __contains__(self, path: object) -> bool:
        return path in self.places

    def __iter__(self) -> Iterator[str]:
        return iter(self.places)


def enclosing(path: str) -> str:
    """The key path around a key path: ``joints[0].axis`` -> ``joints[0]`` -> ``joints`` -> empty."""
    return path[: max(path.rfind("."), path.rfind("["), 0)]
