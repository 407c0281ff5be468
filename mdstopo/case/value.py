"""Immutable value classes: dataclasses whose methods are shared instead of generated.

`dataclasses.dataclass` compiles half a dozen functions for every class at import, a millisecond each; a case
has some fifty classes and is to be read in a few. `fields` and `replace` of `dataclasses` work as usual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, FrozenInstanceError, dataclass, field, fields
from typing import Any, TypeVar, dataclass_transform, overload

_T = TypeVar("_T")


class Value:
    """Base of all values: cannot be changed, compares and prints by its fields, is pickled by them."""

    __slots__ = ()

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        cls = type(self)
        own = fields(cls)  # type: ignore[arg-type]
        names = [f.name for f in own]
        if len(args) > len(names):
            raise TypeError(f"{cls.__name__} takes at most {len(names)} values, got {len(args)}")
        given = dict(zip(names, args, strict=False))
        for name, value in kwargs.items():
            if name not in names or name in given:
                raise TypeError(f"{cls.__name__} got an unexpected or second value for {name!r}")
            given[name] = value
        for f in own:
            if f.name in given:
                value = given[f.name]
            elif f.default is not MISSING:
                value = f.default
            elif f.default_factory is not MISSING:
                value = f.default_factory()
            else:
                raise TypeError(f"{cls.__name__} needs a value for {f.name!r}")
            object.__setattr__(self, f.name, value)
        self.__post_init__()

    def __post_init__(self) -> None:
        """Bring fields into their normal form, with `object.__setattr__`."""

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"{type(self).__name__}.{name} cannot be changed")

    def __delattr__(self, name: str) -> None:
        raise FrozenInstanceError(f"{type(self).__name__}.{name} cannot be deleted")

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]

    def __repr__(self) -> str:
        parts = (f"{f.name}={getattr(self, f.name)!r}" for f in fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(parts)})"

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self) or not isinstance(other, Value):
            return NotImplemented
        return all(_same(a, b) for a, b in zip(self._values(), other._values(), strict=True))

    def __hash__(self) -> int:
        return hash((type(self), *self._values()))

    def __reduce__(self) -> tuple[Any, ...]:
        # Through the constructor: numpy forgets the read-only flag in a pickle, __post_init__ sets it again.
        return _rebuild, (type(self), {f.name: getattr(self, f.name) for f in fields(self)})  # type: ignore[arg-type]


def _rebuild(cls: type[Any], values: dict[str, Any]) -> Any:
    return cls(**values)


def _same(a: Any, b: Any) -> bool:
    if hasattr(a, "dtype") or hasattr(b, "dtype"):
        import numpy as np

        return np.array_equal(a, b)
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    return bool(a == b)


def stated(kind: Any, doc: str, *, unit: str = "", default: Any = MISSING, otherwise: str = "", **roles: Any) -> Any:
    """A field of a class that is a key of the case file, described as `records.Key` is.

    kind: what the value may be.
    doc: what it means.
    unit: what its numbers are in.
    default: the value where the key is left out; without one the key is required.
    otherwise: what is taken then, in words, where no constant is.
    roles: what else the key is for, by name.
    """
    metadata = {"kind": kind, "doc": doc, "unit": unit, "otherwise": otherwise, **roles}
    return field(default=default, metadata=metadata)


@overload
def frozen(cls: type[_T], /) -> type[_T]: ...


@overload
def frozen(*, kw_only: bool = False) -> Callable[[type[_T]], type[_T]]: ...


@dataclass_transform(frozen_default=True, field_specifiers=(field, stated))
def frozen(cls: type[Any] | None = None, /, *, kw_only: bool = False) -> Any:
    """Make a subclass of `Value` from its annotations, slotted; kw_only: its values are given by name."""

    def make(cls: type[Any]) -> type[Any]:
        return dataclass(init=False, repr=False, eq=False, slots=True, kw_only=kw_only)(cls)

    return make if cls is None else make(cls)
