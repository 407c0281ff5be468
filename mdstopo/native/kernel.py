"""A function to be compiled, which Numba takes for one of its own when it meets it in another.

Numba asks an unknown global for its `_numba_type_`; only then is it imported here and the function handed to it.
"""

import contextlib
import functools
import importlib
import os
import sys
from collections.abc import Callable
from typing import Any

#: has Numba's errors in plain letters: it makes thousands that only itself sees, when it looks for what fits
_PLAIN = "NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING"

_PENDING: list[Callable[[], None]] = []


def when_compiling(register: Callable[[], None]) -> Callable[[], None]:
    """Have this run before anything is compiled: what has to be entered in Numba's own tables."""
    _PENDING.append(register)
    return register


def numba() -> Any:
    """Numba, with everything entered that waits for it."""
    module = _import_lean()
    while _PENDING:
        _PENDING.pop(0)()
    return module


def _import_lean() -> Any:
    """Import Numba; in a process of our own without scipy and cffi, which no kernel here uses, and spared some work.

    They would cost 0.2 s. Elsewhere Numba may serve others too.
    """
    if not _is_our_process() or "numba" in sys.modules:
        return importlib.import_module("numba")
    spared = {"scipy", "cffi"} - sys.modules.keys()
    if len(spared) < 2:
        spared = set()
    for name in spared:
        sys.modules[name] = None  # type: ignore[assignment]  # an import of it now fails, which Numba allows for
    stated = os.environ.get(_PLAIN)
    os.environ[_PLAIN] = "1"
    try:
        module = importlib.import_module("numba")
        for user in ("numba.np.arraymath", "numba.core.typing.cffi_utils"):
            with contextlib.suppress(ImportError):
                importlib.import_module(user)
    finally:
        del os.environ[_PLAIN]
        if stated is not None:
            os.environ[_PLAIN] = stated
        for name in spared:
            del sys.modules[name]
    from mdstopo.native.library import IS_KNOWN

    if IS_KNOWN:
        from mdstopo.native.sparing import spare

        spare()
    return module


def _is_our_process() -> bool:
    """Whether this is the command line, or a process that it started."""
    started = getattr(sys.modules.get("__main__"), "__spec__", None)
    return "mdstopo.cli" in sys.modules or (started is not None and started.name.startswith("mdstopo."))


class Kernel:
    """A compiled function that other compiled functions call.

    fastmath: the flags of its floating point; part: whether it becomes part of whatever calls it. `py_func` is the
    function as written, to be run in Python.
    """

    _inner = True

    def __init__(self, function: Callable[..., Any], fastmath: frozenset[str], part: bool = False) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self._fastmath = fastmath
        self._part = part
        self._dispatcher: Any = None

    def __call__(self, *arguments: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is called by kernels only; from Python, call its py_func")

    @property
    def dispatcher(self) -> Any:
        """Numba's object for it."""
        if self._dispatcher is None:
            self._dispatcher = self._inside()
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def _inside(self) -> Any:
        """Numba's object for the function where compiled functions call it."""
        numba()
        from mdstopo.native.library import LEFT, OPTIMISED, ROLLED, Cache

        # Wrappers for calls from Python cost a large part of the compilation, so nothing has one.
        library = OPTIMISED if self._fastmath else LEFT if self._inner else ROLLED
        made = self._made(no_cpython_wrapper=True, pipeline_class=library)
        if self._inner:  # an entry's machine code is kept by `native.store`
            made._cache = Cache(self.py_func)
        return made

    def _made(self, **options: Any) -> Any:
        """Numba's object for the function."""
        fastmath = set(self._fastmath) or False
        options["forceinline"] = self._part
        made = numba().njit(error_model="numpy", fastmath=fastmath, no_cfunc_wrapper=True, **options)
        return made(self.py_func)
