"""Which versions of Numba have been tried with what is private in it, and what happens with others.

`numba_private` compiles several times as fast as Numba by itself and keeps machine code that is called without Numba.
For that it reaches into Numba and llvmlite where nothing is promised. So it is used with versions that `make
test-numba` has tried, and where a check passes that compiles and calls a small function. With any other version, where
a name is missing, the check fails or a compilation goes wrong, `numba_plain` compiles, which uses documented parts
only; a notice says so once.
"""

import contextlib
import importlib
import os
import sys
import traceback
from collections.abc import Iterator
from types import ModuleType
from typing import ClassVar

from mdstopo.installed import version_of

#: versions (numba, llvmlite) up to their second number that were tried; whether our passes fit them, or Numba's are
#: used, and our way of keeping machine code only
TRIED = {("0.60", "0.43"): False, ("0.64", "0.46"): True, ("0.68", "0.50"): True}

#: set for the processes that this one starts, once the notice has been given
_TOLD = "MDSTOPO_NUMBA_NOTICE"


class UnexpectedError(Exception):
    """Something of Numba's is not as it was in the versions that were tried; a clause that says what."""


class _Way:
    """How this process compiles: not known yet, by `numba_private` (`module`), or, where that is None, in Numba's own
    way."""

    known = False
    module: ModuleType | None = None
    #: what interrupts have come out of, see `interruptible`
    broken_off: ClassVar[list[BaseException]] = []


def versions() -> tuple[str, str]:
    """The versions of Numba and llvmlite up to their second number; without importing them."""
    numba, llvmlite = (".".join(version_of(name).split(".")[:2]) for name in ("numba", "llvmlite"))
    return numba, llvmlite


def has_own_passes() -> bool:
    """Whether our passes over a function fit this version."""
    return TRIED.get(versions(), False)


def is_our_process() -> bool:
    """Whether this is the command line, or a process that it started."""
    started = getattr(sys.modules.get("__main__"), "__spec__", None)
    return "mdstopo.cli" in sys.modules or (started is not None and started.name.startswith("mdstopo."))


def is_decided() -> bool:
    """Whether it is known what compiles in this process."""
    return _Way.known


def load() -> None:
    """Import what this process is going to compile by, and with it Numba."""
    if "numba" not in sys.modules:
        importlib.import_module("numba")
    if _Way.known or versions() not in TRIED:
        return
    try:
        importlib.import_module("mdstopo.compiler.numba_private")
    except Exception as error:
        give_up(error)


def private() -> ModuleType | None:
    """`numba_private`, checked; nothing where Numba is to compile in its own way."""
    if not _Way.known:
        _decide()
    return _Way.module


def way() -> ModuleType:
    """What compiles: `numba_private` or `numba_plain`."""
    return private() or importlib.import_module("mdstopo.compiler.numba_plain")


def _decide() -> None:
    if versions() not in TRIED:
        give_up(UnexpectedError("these versions have not been tried with this program"))
        return
    load()
    if _Way.known:
        return
    try:
        found = importlib.import_module("mdstopo.compiler.numba_private")
        found.check()
    except Exception as error:
        give_up(error)
    else:
        _Way.known, _Way.module = True, found


def give_up(error: Exception, compiled: str = "") -> None:
    """Compile in Numba's own way from now on, and say so once. Raises the error where an interrupt has led to it.

    compiled: the name of the function that could not be compiled; empty where it is not about one.
    """
    _raise_if_interrupted(error)
    _Way.known, _Way.module = True, None
    if not os.environ.get(_TOLD):
        os.environ[_TOLD] = "given"
        print(notice(error, compiled), file=sys.stderr, flush=True)


@contextlib.contextmanager
def without_private(error: Exception, compiled: str) -> Iterator[None]:
    """Try in Numba's own way what has raised an error in ours; where that goes well, `give_up`.

    Raises the error where that goes wrong as well: then what is compiled is wrong, or what it is called with.

    compiled: the name of the function that could not be compiled.
    """
    _raise_if_interrupted(error)
    found = _Way.module
    assert found is not None
    _Way.module = None
    try:
        yield
    except Exception:
        _Way.module = found
        found.check()
        raise error from None
    give_up(error, compiled)


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Compile what an interrupt may break off.

    One that falls between LLVM's taking a module and llvmlite's note of it leaves a module with two owners. To free it
    for the second of them ends the process by a segmentation fault, so what the interrupted functions refer to is kept
    for good.
    """
    try:
        yield
    except BaseException as error:
        if _is_interrupt(error):
            _Way.broken_off.append(error)
        raise


def _raise_if_interrupted(error: Exception) -> None:
    """Raise an error that a KeyboardInterrupt has led to: one that falls into the compiler may come out as another."""
    if _is_interrupt(error):
        raise error


def _is_interrupt(error: BaseException) -> bool:
    """Whether an error is a KeyboardInterrupt, or one has led to it."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, KeyboardInterrupt):
            return True
        cause = cause.__cause__ or cause.__context__
    return False


def notice(error: Exception, compiled: str = "") -> str:
    """Which versions these are, why Numba compiles in its own way, and what is slower for it.

    compiled: the name of the function that could not be compiled.
    """
    reason = str(error) if isinstance(error, UnexpectedError) else f"{type(error).__name__}: {error}"
    reason = " ".join(reason.split())[:300]
    if compiled:
        place = traceback.extract_tb(error.__traceback__)[-1]
        reason += f"; in {place.name}, line {place.lineno} of {os.path.basename(place.filename)}, for {compiled}"
    tried = ", ".join(f"{numba} with {llvmlite}" for numba, llvmlite in sorted(TRIED))
    return (
        f"Numba {version_of('numba')} with llvmlite {version_of('llvmlite')} compiles in its own way ({reason}): the "
        "first run takes several times as long, every start some seconds more, and passes over many members are not "
        f"shared by threads; results agree to rounding. Tried: {tried}."
    )
