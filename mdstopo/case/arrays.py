"""Immutable building blocks of a case: read-only arrays, frozen mappings, tables of time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.value import Value, frozen

if TYPE_CHECKING:
    from mdstopo.formula.time_formulas import TimeProgram

FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.intp]

Pair = tuple[float, float]
Triple = tuple[float, float, float]
#: a Pair in the plane, a Triple in space: what `Case.dimension` says no type can tell
Components: TypeAlias = Any

_K = TypeVar("_K")
_V = TypeVar("_V")


def read_only(array: FloatArray) -> FloatArray:
    """The same numbers as a contiguous float64 array that refuses assignment."""
    frozen = np.ascontiguousarray(array, dtype=np.float64)
    if frozen.flags.writeable:
        frozen = frozen.view()
        frozen.flags.writeable = False
    return frozen


def read_only_index(array: IndexArray) -> IndexArray:
    """The same numbers as a contiguous array of indices that refuses assignment."""
    frozen = np.ascontiguousarray(array, dtype=np.intp)
    if frozen.flags.writeable:
        frozen = frozen.view()
        frozen.flags.writeable = False
    return frozen


class FrozenDict(Mapping[_K, _V]):
    """A mapping that cannot be changed and can be pickled."""

    __slots__ = ("_data",)
    _data: dict[_K, _V]

    def __init__(self, data: Mapping[_K, _V] | None = None) -> None:
        object.__setattr__(self, "_data", dict(data) if data is not None else {})

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a FrozenDict cannot be changed ({name})")

    def __getitem__(self, key: _K) -> _V:
        return self._data[key]

    def __iter__(self) -> Iterator[_K]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)

    def __repr__(self) -> str:
        return repr(self._data)

    def __reduce__(self) -> tuple[Any, ...]:
        return FrozenDict, (self._data,)


@frozen
class Table(Value):
    """A table of time: linear between rows, constant outside them.

    times (n,): not falling, in s; a time that two rows share is a jump, right-continuous there.
    values (n, m): one row of values for each time.
    """

    times: FloatArray
    values: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", read_only(self.times))
        object.__setattr__(self, "values", read_only(self.values))


@frozen
class TimeFormula(Value):
    """A formula of the time t (s) and its parameters, multiplied by `scale`, plus an offset."""

    text: str
    parameters: tuple[tuple[str, float], ...] = ()
    scale: float = 1.0
    offset: float = 0.0

    @property
    def program(self) -> TimeProgram:
        """The formula with its derivatives and switches."""
        from mdstopo.formula.time_formulas import time_program  # most cases have no formulas

        return time_program(self.text, tuple(name for name, _ in self.parameters))

    def at(self, time: float) -> float:
        """The value of the formula at a time (s); NaN where it has none."""
        from mdstopo.formula.time_formulas import value_at  # most cases have no formulas

        return self.scale * value_at(self.text, self.parameters, time) + self.offset

    def rate_at(self, time: float) -> float:
        """The derivative of the formula by time, at a time (s); NaN where it has none."""
        from mdstopo.formula.time_formulas import rate_at  # most cases have no formulas

        return self.scale * rate_at(self.text, self.parameters, time)

    def sampled(self, times: FloatArray) -> FloatArray:
        """(T,) the values of the formula at times (T,)."""
        return np.array([self.at(time) for time in times.tolist()])

    def times(self, factor: float) -> TimeFormula:
        """A formula whose values are multiplied by a factor."""
        return TimeFormula(self.text, self.parameters, self.scale * factor, self.offset * factor)

    def shifted(self, by: float) -> TimeFormula:
        """A formula whose values are larger by a number."""
        return TimeFormula(self.text, self.parameters, self.scale, self.offset + by)


Signal = float | Table | TimeFormula
"""A scalar quantity over time: a constant, a Table with m = 1, or a formula."""

VectorSignal = tuple[Signal, ...]
"""Two components over time, three in space. A table of [t, x, y] becomes two Tables with the same times."""
