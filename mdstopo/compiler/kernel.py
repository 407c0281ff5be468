"""A function to be compiled, which Numba takes for one of its own when it meets it in another.

Numba asks an unknown global for its `_numba_type_`; only then is it imported here and the function handed to it.
"""

import contextlib
import functools
import os
import sys
import weakref
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

from mdstopo.compiler import tried

#: has Numba's errors in plain letters: it makes thousands that only itself sees, when it looks for what fits
_PLAIN = "NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"

_PENDING: list[Callable[[], None]] = []
#: Numba's objects that are used no more: its tables hold them weakly, and it fails where it meets one that is gone
_FORGOTTEN: list[Any] = []
#: all kernels of this process
_MADE: "weakref.WeakSet[Kernel]" = weakref.WeakSet()


def when_compiling(register: Callable[[], None]) -> Callable[[], None]:
    """Have this run before anything is compiled: what has to be entered in Numba's own tables."""
    _PENDING.append(register)
    return register


def compile_anew() -> None:
    """Forget what was compiled in this process: kernels that others call have changed."""
    for each in tuple(_MADE):
        each.forget()


def numba() -> Any:
    """Numba, with everything entered that waits for it."""
    way()
    return sys.modules["numba"]


def way() -> ModuleType:
    """What compiles, `numba_private` or `numba_plain`, with everything entered that waits for it."""
    if not tried.is_decided():
        with _spared():
            tried.load()
        tried.private()
    while _PENDING:
        _PENDING.pop(0)()
    return tried.way()


@contextlib.contextmanager
def _spared() -> Iterator[None]:
    """Have Numba imported without scipy and cffi, which no kernel here uses, in a process of our own.

    They would cost 0.2 s. Elsewhere Numba may serve others too.
    """
    if not tried.is_our_process() or "numba" in sys.modules:
        yield
        return
    spared = {"scipy", "cffi"} - sys.modules.keys()
    if len(spared) < 2:
        spared = set()
    stated = os.environ.get(_PLAIN)
    os.environ[_PLAIN] = "1"
    for name in spared:
        sys.modules[name] = None  # type: ignore[assignment]  # an import of it now fails, which Numba allows for
    try:
        yield
    finally:
        for name in spared:
            del sys.modules[name]
        del os.environ[_PLAIN]
        if stated is not None:
            os.environ[_PLAIN] = stated


class Kernel:
    """A compiled function that other compiled functions call.

    fastmath: the flags of its floating point; part: whether it becomes part of whatever calls it. `py_func` is the
    function as written, to be run in Python.
    """

    def __init__(self, function: Callable[..., Any], fastmath: frozenset[str], part: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self.fastmath = fastmath
        self.part = part
        self._dispatcher: Any = None
        self._way: ModuleType | None = None
        _MADE.add(self)

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is called by kernels only; from Python, call its py_func")

    def forget(self) -> None:
        """Make Numba's object anew when it is next asked for."""
        if self._dispatcher is not None:
            _FORGOTTEN.append(self._dispatcher)
        self._dispatcher = self._way = None

    @property
    def dispatcher(self) -> Any:
        """Numba's object for it."""
        now = way()
        if self._way is not now:  # not made yet, or before something went wrong
            self._way, self._dispatcher = now, self._inside()
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def _inside(self) -> Any:
        """Numba's object for the function where compiled functions call it."""
        return way().inner(self.py_func, self.fastmath, self.part)
