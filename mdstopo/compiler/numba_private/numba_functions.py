"""Numba's objects for kernels and entries, and the cache of functions inside entries on the disk."""

import functools
import hashlib
import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache, _Cache
from numba.core.compiler import Compiler, CompileResult
from numba.core.serialize import dumps

from mdstopo.compiler import compiled_units as units
from mdstopo.compiler.numba_private.libraries import LEFT, OPTIMISED, ROLLED, SPLIT, Optimised
from mdstopo.compiler.numba_private.own_target import TARGET
from mdstopo.compiler.store import cache_folder, read_checked, write_checked


def inner(function: Callable[..., Any], fastmath: frozenset[str], part: bool) -> Any:
    """Numba's object for a function that other compiled functions call."""
    found = numba_object(function, OPTIMISED if fastmath else LEFT, fastmath, part)
    found._cache = Cache(function)
    return found


def outer(function: Callable[..., Any], fastmath: frozenset[str]) -> Any:
    """Numba's object for an entry, for `build`; its machine code is kept by `store`."""
    way = SPLIT if function.__module__.startswith(units.SPLIT) else ROLLED
    return numba_object(function, OPTIMISED if fastmath else way, fastmath, False)


def wrapped(function: Callable[..., Any], fastmath: frozenset[str]) -> Any:
    """Numba's object for a function that Python calls through Numba's own wrapper; it is not kept on the disk."""
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": set(fastmath) or False, "_target": TARGET}
    return numba.njit(**options)(function)


def numba_object(function: Callable[..., Any], pipeline: type[Compiler], fastmath: frozenset[str], part: bool) -> Any:
    # Wrappers for calls from Python cost a large part of the compilation, so nothing has one.
    options: dict[str, Any] = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True, "pipeline_class": pipeline}
    options |= {"error_model": "numpy", "fastmath": set(fastmath) or False, "forceinline": part, "_target": TARGET}
    return numba.njit(**options)(function)


class _Reader:
    """Numba's target, reading libraries of this kind."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> "_Reader":
        return self

    def unserialize_library(self, kept: tuple[str, str, str]) -> Optimised:
        library = Optimised(self._target.codegen(), kept[0])
        library.take_unit(units.kept(kept[2]))
        return library


@functools.cache
def _source(path: str) -> bytes:
    return hashlib.sha256(Path(path).read_bytes()).digest()


class Cache(_Cache):
    """Functions inside entries on the disk, for other processes that compile entries which call them.

    In the place of Numba's own, which ends the program where a file is damaged or the disk full: one file for a
    function, with a checksum; whatever is wrong with it means that the function is compiled once more.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func = function
        code = function.__code__
        names = f"{code.co_filename} {function.__qualname__} {code.co_firstlineno}"
        self._path = cache_folder() / f"inside-{hashlib.sha256(names.encode()).hexdigest()[:24]}.kept"

    @property
    def cache_path(self) -> str:
        """Where it is kept."""
        return str(self._path.parent)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The function compiled for these types; nothing where it has not been kept."""
        target_context.refresh()
        try:
            kept = self._read().get(self._key(sig, target_context.codegen()))
            if kept is None:
                return None
            return CompileResult._rebuild(_Reader(target_context), *pickle.loads(kept))
        except Exception:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep it where that is possible."""
        if any(not each.can_cache for each in data.lifted) or data.library.has_dynamic_globals:
            return
        try:
            whole = self._read()
            whole[self._key(sig, data.codegen)] = dumps(data._reduce())
            write_checked(self._path, dumps(whole))
        except Exception:
            return

    def _read(self) -> dict[Any, bytes]:
        """All that is kept of the function, by its key."""
        data = read_checked(self._path)
        found = {} if data is None else pickle.loads(data)
        return found if isinstance(found, dict) else {}

    def _key(self: Any, sig: Any, codegen: Any) -> Any:
        """Types, processor, the function's bytecode and closure, and the file that it stands in."""
        key = FunctionCache._index_key(self, sig, codegen)
        return (*key, _source(inspect.getfile(self._py_func)))

    def enable(self) -> None:
        """Do nothing: this cache is always enabled."""

    def disable(self) -> None:
        """Not needed."""

    def flush(self) -> None:
        """Forget it."""
        self._path.unlink(missing_ok=True)
