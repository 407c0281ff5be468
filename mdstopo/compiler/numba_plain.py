"""Numba's own way to compile, by what its documentation describes: for versions that `numba_private` does not fit.

The functions are those of `numba_private` that kernels need. Entries are called through Numba's wrappers and kept in
Numba's own cache; one thread makes all passes.
"""

from collections.abc import Callable
from typing import Any

import numba
from numba import types
from numba.experimental import structref
from numba.extending import overload

from mdstopo.compiler import threads
from mdstopo.compiler.store import cache_folder


def inner(function: Callable[..., Any], fastmath: frozenset[str], part: bool) -> Any:
    """Numba's object for a function that other compiled functions call."""
    return numba.njit(error_model="numpy", fastmath=set(fastmath) or False, forceinline=part)(function)


def outer(function: Callable[..., Any], fastmath: frozenset[str]) -> Any:
    """Numba's object for a function that Python calls, kept on the disk in Numba's own cache."""
    config: Any = numba.config
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": set(fastmath) or False}
    stated = config.CACHE_DIR
    try:
        config.CACHE_DIR = str(cache_folder() / "numba")  # Numba reads it when it makes the object
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # nothing can be written there
        return numba.njit(**options)(function)
    finally:
        config.CACHE_DIR = stated


#: Numba's object for a function that Python calls through Numba's own wrapper: here that is how all are called
wrapped = outer


def compile_for(dispatcher: Any, letters: str) -> None:
    """Have Numba compile a function for types of arguments (`compiler.entry.types_of`)."""
    dispatcher.compile(tuple(map(numba_type, letters.split())))


def numba_type(kind: str) -> Any:
    """Numba's type for the letters of one argument."""
    scalars = {"b": types.boolean, "i": types.int64, "f": types.float64}
    if kind in scalars:
        return scalars[kind]
    if kind[0] == "t":
        return types.UniTuple(types.int64, int(kind[1:]))
    items = {"d": types.float64, "q": types.int64, "?": types.boolean}
    return types.Array(items[kind[0]], int(kind[1:]), "C")


def offer(stub: Callable[..., Any], choose: Callable[..., Any]) -> None:
    """Have Numba call, for `stub`, the kernel that `choose` returns for the types of the arguments."""

    @overload(stub, strict=False)
    def chosen(*asked):  # type: ignore[no-untyped-def]
        kernel = choose(*asked)
        if kernel is None:
            return None
        held = kernel.dispatcher

        def call(*given):  # type: ignore[no-untyped-def]
            return held(*given)

        return call


def enter_threads() -> None:
    """Tell Numba what `threads.shared` and `threads.taken` do, with one thread."""

    # inlined, because Numba does not cache what hands over an object of its own
    @overload(threads.shared, jit_options={"forceinline": True})
    def shared(kernel, threads, job):  # type: ignore[no-untyped-def]
        def call(kernel, threads, job):  # type: ignore[no-untyped-def]
            kernel(*job)

        return call

    @overload(threads.taken)
    def taken(counter):  # type: ignore[no-untyped-def]
        def first(counter):  # type: ignore[no-untyped-def]
            counter[0] += 1
            return counter[0] - 1

        return first


def enter_structure(maker: type, kind: type, fields: tuple[str, ...]) -> None:
    """Have `maker(...)` make a structure of a kind."""
    structref.define_constructor(maker, kind, list(fields))
