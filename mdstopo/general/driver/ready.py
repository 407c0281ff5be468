"""Calls of compiled entries whose arguments are nearly always the same arrays."""

from collections.abc import Callable
from operator import is_, itemgetter
from typing import Any


class _Kept:
    """A prepared call. stay, numbers: the arguments that stay, and the others as they were last, with how both are
    taken from all; places: of the numbers."""

    __slots__ = ("call", "numbers", "places", "stay", "take_numbers", "take_stay")

    def __init__(self, entry: Any, arguments: tuple[Any, ...]) -> None:
        self.places = [k for k, each in enumerate(arguments) if isinstance(each, (bool, int, float))]
        self.take_stay = itemgetter(*(k for k in range(len(arguments)) if k not in self.places))
        self.take_numbers: Callable[..., Any] = itemgetter(*self.places) if self.places else len
        self.stay = self.take_stay(arguments)
        self.numbers = self.take_numbers(arguments)
        self.call: Callable[..., Any] = entry.prepare(*arguments)


class Ready:
    """Compiled functions prepared with their arguments (`Entry.prepare`), again where an argument is another: a call
    then takes a microsecond instead of twenty."""

    def __init__(self) -> None:
        self._kept: dict[str, _Kept] = {}
        self._often: dict[str, tuple[tuple[Any, ...], tuple[tuple[int, Any], ...], Callable[..., Any]]] = {}

    def __call__(self, name: str, entry: Any, *arguments: Any) -> Any:
        """entry(*arguments), two arrays or more among them; their types are always the same under one name."""
        kept = self._kept.get(name)
        if kept is None or not all(map(is_, kept.take_stay(arguments), kept.stay)):
            kept = self._kept[name] = _Kept(entry, arguments)
        numbers = kept.take_numbers(arguments)
        if numbers == kept.numbers:
            return kept.call()
        kept.numbers = numbers
        return kept.call(*[(k, arguments[k]) for k in kept.places])

    def often(
        self,
        name: str,
        entry: Any,
        changing: tuple[Any, ...],
        numbers: tuple[tuple[int, Any], ...],
        arguments: Callable[[], tuple[Any, ...]],
    ) -> Any:
        """entry(*arguments()) of a call that is made at every evaluation, where few arguments ever change: these alone
        are looked at, and the others asked for when it is prepared.

        changing: those of the arguments, or what they come from, that may be other objects than last time.
        numbers: places among the arguments of the numbers that may be others, and what they are.
        """
        found = self._often.get(name)
        if found is None or not all(map(is_, found[0], changing)):
            call = entry.prepare(*arguments())
            self._often[name] = changing, numbers, call
            return call()
        _, last, call = found
        if last == numbers:
            return call()
        self._often[name] = changing, numbers, call
        return call(*numbers)
