"""Tables of arrays that lie one after the other in two flat ones, of floats and of integers.

A class names each array once, with its shape and what it holds:

    class Pairs(NamedTuple):
        pair: Annotated[IndexArray, Field("n_pair, 2", "the two bodies of each pair")]
        reach: Annotated[FloatArray, Field("n_pair", "largest distance of an attachment point (m)")]

    PAIRS = Fields(Pairs)

From it follow the flat arrays (`Fields.packed`) or how long they have to be (`Fields.lengths`), the kernel that gives
the arrays back as views (`views_of`), and a table for the documentation (`Fields.rows`). Every array that is handed to
a compiled function costs about a microsecond; two cost as much whatever there is in them.

A shape is written as in a kernel: numbers, sizes, fields of integers that stand before, and arithmetic with them.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from mdstopo.compiler.kernel import Kernel
from mdstopo.compiler.written import WrittenKernel

F = TypeVar("F", bound=Callable[..., Any])
FloatArray = NDArray[np.float64]
IndexArray = NDArray[np.int64]

#: numbers in a line of the cache
LINE = 8
_SIZE = re.compile(r"[a-z]\w*")


@dataclass(frozen=True)
class Field:
    """What a field is.

    shape: its axes, separated by commas; empty of an integer. what: its meaning, with the unit. on_a_line: whether it
    begins on a line of the cache, where the flat array does.
    """

    shape: str
    what: str
    on_a_line: bool = False

    @property
    def axes(self) -> list[str]:
        """The sizes of its axes, as written."""
        return [axis.strip() for axis in self.shape.split(",")] if self.shape else []

    @property
    def count(self) -> str:
        """How many numbers it has, as written in a kernel."""
        return " * ".join(axis if axis.isidentifier() or axis.isdigit() else f"({axis})" for axis in self.axes)


class Fields:
    """The fields of a class, by name in their order: of floats, of integers, and single integers.

    sizes: what the names in shapes stand for, in terms of a kernel's arguments. Where there are none, the flat integers
    begin with them: a size is the length of the first axis that is nothing but its name.
    """

    def __init__(self, record: type, sizes: Mapping[str, str] | None = None) -> None:
        kinds = record.__annotations__  # each is `Annotated[kind, field]`
        self.fields: dict[str, Field] = {name: kind.__metadata__[0] for name, kind in kinds.items()}
        self.floats, self.ints, self.numbers = (
            {name: field for name, field in self.fields.items() if kinds[name].__origin__ == kind}
            for kind in (FloatArray, IndexArray, int)
        )
        self.first = self._first_axes() if sizes is None else {}
        self.sizes = dict(sizes or {})
        for place, name in enumerate([*self.first, *self.numbers]):
            self.sizes[name] = f"ints[{place}]"
        #: integers before the arrays
        self.header = len(self.first) + len(self.numbers)

    @property
    def names(self) -> tuple[str, ...]:
        """All fields, in the order of the class."""
        return tuple(self.fields)

    def place_of(self, size: str) -> int:
        """Where a size, or a field that is a single integer, stands among the flat integers."""
        return [*self.first, *self.numbers].index(size)

    def _first_axes(self) -> dict[str, tuple[str, int]]:
        """Of each size the field and axis that it is read from."""
        found: dict[str, tuple[str, int]] = {}
        for name, field in self.fields.items():
            for axis, size in enumerate(field.axes):
                if _SIZE.fullmatch(size):
                    found.setdefault(size, (name, axis))
        return found

    def packed(self, record: Any) -> tuple[IndexArray, FloatArray]:
        """A record as flat integers, sizes first, and flat floats that begin on a line of the cache."""
        header = [getattr(record, name).shape[axis] for name, axis in self.first.values()]
        header += [getattr(record, name) for name in self.numbers]
        ints = [np.array(header), *(getattr(record, name).ravel() for name in self.ints)]
        parts: list[Any] = []
        count = 0
        for name, field in self.floats.items():
            parts.append(np.zeros(-count % LINE if field.on_a_line else 0))
            parts.append(np.asarray(getattr(record, name), dtype=np.float64).ravel())
            count += len(parts[-2]) + len(parts[-1])
        floats = aligned((count,))
        np.concatenate(parts, out=floats)
        return np.concatenate(ints).astype(np.int64), floats

    def lengths(self, **given: Any) -> tuple[int, int]:
        """How many floats and integers there have to be room for, with these arguments of the kernel (`views_of`)."""
        known = dict(given)
        for name, size in self.sizes.items():
            known[name] = int(eval(size, {"__builtins__": {}}, known))  # what the table says, nothing of a user's
        floats, ints = (
            sum(int(eval(field.count, {"__builtins__": {}}, known)) for field in fields.values())
            for fields in (self.floats, self.ints)
        )
        return floats, self.header + ints

    def rows(self) -> list[tuple[str, str, str]]:
        """Name, shape and meaning of each field."""
        return [(name, field.shape, field.what) for name, field in self.fields.items()]

    def source(self, name: str, arguments: str, made: str) -> str:
        """The kernel that gives the fields as views of `ints` and `floats`; made: what is called with them."""
        lines = [f"def {name}({arguments}):"]
        lines += [f"    {size} = {value}" for size, value in self.sizes.items()]
        lines += self._views("ints", self.ints, self.header) + self._views("floats", self.floats, 0)
        lines.append(f"    return {made}({', '.join(self.names)})")
        return "\n".join(lines)

    def _views(self, flat: str, fields: Mapping[str, Field], begin: int) -> list[str]:
        lines = [f"    i = {begin}"]
        for name, field in fields.items():
            if field.on_a_line:
                lines.append(f"    i += -i % {LINE}")
            shaped = f".reshape(({field.shape}))" if len(field.axes) > 1 else ""
            lines += [f"    {name} = {flat}[i : i + {field.count}]{shaped}", f"    i += {field.count}"]
        return lines


def views_of(fields: Fields, made: Any, how: Callable[[F], F]) -> Callable[[F], F]:
    """Compile, in the place of a function without contents, what gives the fields as views of two flat arrays.

    The function's arguments are `ints`, `floats` and what sizes are found by. made: the class, or what stands for it in
    kernels; None: a plain tuple. how: `jit.kernel` or `jit.part`.
    """

    def make(stub: F) -> F:
        function = cast(FunctionType, stub)
        plain: Kernel = cast(Any, how)(function)
        arguments = ", ".join(function.__code__.co_varnames[: function.__code__.co_argcount])
        source = fields.source(function.__name__, arguments, "" if made is None else "made")
        return cast(F, WrittenKernel(function, source, {"made": made}, plain))

    return make


def aligned(shape: tuple[int, ...]) -> FloatArray:
    """An array of zeros that begins on a line of the cache: a wide vector across two costs twice."""
    count = int(np.prod(shape))
    room = np.zeros(count + LINE)
    first = -room.ctypes.data // 8 % LINE
    return room[first : first + count].reshape(shape)
