"""A compiled function that Python calls.

Its machine code takes one block of eight-byte numbers: for an array where its object is, or, prepared, the address of
its data and its lengths; for a number the number. What it returns comes after them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.compiler.kernel import Kernel, way

if TYPE_CHECKING:
    from pathlib import Path

    from mdstopo.compiler.call import Native
    from mdstopo.compiler.store import Code

#: by letter, the numbers of an array
DTYPES = {"d": np.dtype(np.float64), "q": np.dtype(np.int64), "?": np.dtype(np.bool_)}
_LETTERS = {dtype: letter for letter, dtype in DTYPES.items()}
#: what an array has to be, of `flags.num`: in C order and aligned
PLAIN = 0x1 | 0x100
#: words behind the results that tell what was raised: where a pickle of its class and arguments is, which size it has,
#: and how many arguments were known only then and are not in it
EXCUSE = 3
#: of an array object's words, behind those that all objects have: where its numbers are, how many dimensions it has,
#: and where its lengths are (NumPy's ndarraytypes.h)
NUMBERS, DIMENSIONS, LENGTHS = (object.__basicsize__ // 8 + k for k in range(3))


def types_of(arguments: tuple[Any, ...]) -> str | None:
    """The types of arguments in letters; nothing where the machine code takes no such thing.

    d2: a two-dimensional array of floats; b, i, f: truth, integer, float; t3: a tuple of three integers.
    """
    letters = []
    for argument in arguments:
        if issubclass(type(argument), np.ndarray):  # its `__class__` may lie, its memory does not
            letter = _LETTERS.get(argument.dtype)
            if letter is None or argument.flags.num & PLAIN != PLAIN:
                return None
            letters.append(f"{letter}{argument.ndim}")
        elif isinstance(argument, (bool, np.bool_)):
            letters.append("b")
        elif isinstance(argument, (int, np.integer)):
            letters.append("i")
        elif isinstance(argument, (float, np.floating)):
            letters.append("f")
        elif type(argument) is tuple and all(type(each) is int for each in argument):
            letters.append(f"t{len(argument)}")
        else:
            return None
    return " ".join(letters)


class NotCompiledError(Exception):
    """An entry was called in `without_compiling` that has not been compiled on this machine."""


#: whether entries may be compiled here
_may_compile: ContextVar[bool] = ContextVar("may_compile", default=True)


@contextmanager
def without_compiling() -> Iterator[None]:
    """Entries that have not been compiled raise NotCompiledError instead of taking a minute."""
    token = _may_compile.set(False)
    try:
        yield
    finally:
        _may_compile.reset(token)


class Entry(Kernel):
    """A compiled function that Python calls; other compiled functions may call it too."""

    def __init__(self, function: Callable[..., Any], fastmath: frozenset[str]) -> None:
        super().__init__(function, fastmath)
        self._native: dict[str, Native | None] = {}
        self._last: Native | None = None
        self._callable: Any = None

    def forget(self) -> None:
        """Look for machine code anew when it is next called. What was prepared stays as it is."""
        super().forget()
        self._native.clear()
        self._last = self._callable = None

    def __call__(self, *arguments: Any) -> Any:
        last = self._last
        if last is not None:  # nearly always they are of the types that they were last time
            block = last.block_of(arguments)
            if block is not None:
                return last.run(block)
        native = self._for(arguments)
        if native is None:
            return self._by_numba(*arguments)
        self._last = native
        return native(*arguments)

    def prepare(self, *arguments: Any) -> Callable[..., Any]:
        """The entry with these arguments, to be called again and again; numbers are changed by their position, to stay.

        Arrays stay these arrays, wherever their contents change; they must not be resized.
        """
        native = self._for(arguments)
        if native is not None:
            return native.prepare(*arguments)

        now = list(arguments)

        def call(*changes: tuple[int, Any]) -> Any:
            for place, value in changes:
                now[place] = value
            return self._by_numba(*now)

        return call

    def compile(self, *arguments: Any) -> None:
        """Have the machine code for such arguments on the disk, without calling it."""
        self._for(arguments)

    def _for(self, arguments: tuple[Any, ...]) -> Native | None:
        types = types_of(arguments)
        if types is None:
            return None
        if types not in self._native:
            self._native[types] = self._ready(types)
        return self._native[types]

    def _ready(self, types: str) -> Native | None:
        """Machine code for these types, from the disk or from Numba; nothing where only Numba itself can call it."""
        if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
            return None
        from mdstopo.compiler import store, tried
        from mdstopo.compiler.call import Native, arrays_are_known, provide

        if not arrays_are_known():
            return None
        path = store.path_of(self.py_func.__module__, self.py_func.__qualname__, types)
        code = store.read(path)
        if code is None or not provide(code):
            with store.alone(path), tried.interruptible():
                code = store.read(path)
                if code is None or not provide(code):
                    code = self._built(path, types)
                    if code is not None and not provide(code):
                        return None
        return None if code is None else Native(self.py_func.__qualname__, code, types)

    def _built(self, path: Path, types: str) -> Code | None:
        from mdstopo.compiler import store, told, tried

        if not _may_compile.get():
            raise NotCompiledError
        name = f"{self.py_func.__module__.removeprefix('mdstopo.')}.{self.py_func.__name__}"
        told.compiling(name)
        way()
        found = tried.private()
        if found is None:
            return None
        try:
            code: Code | None = found.build(self.dispatcher, types)
        except Exception as error:
            with tried.without_private(error, name):
                self._callable = self._wrapped()
                way().compile_for(self._callable, types)
            return None
        if code is not None:
            store.write(path, code)
        return code

    def _by_numba(self, *arguments: Any) -> Any:
        """Called through Numba's own wrapper: the slow way in, for what the machine code does not take."""
        if self._callable is None:
            self._callable = self._wrapped()
        return self._callable(*arguments)

    def _wrapped(self) -> Any:
        return way().wrapped(self.py_func, self.fastmath)

    def _inside(self) -> Any:
        return way().outer(self.py_func, self.fastmath)
