"""Functions inside entries, each on its own: its intermediate code, and what it calls.

A unit is linked into an entry that reaches it. One that is long would not be inlined there: in entries of `SPLIT` it
gets machine code of its own, once for all entries that reach it, and is called by its symbol. Both lie in the folder of
the entries: `unit-*.kept` the intermediate code, `apart-*.code` the machine code.
"""

import functools
import hashlib
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm

from mdstopo.compiler.store import Code, alone, cache_folder, read, read_checked, write, write_checked

#: modules whose entries call long functions by their symbols
SPLIT = "mdstopo.general."
#: instructions, as written for LLVM, from which on a function is long. LLVM inlines functions of some fifty, when what
#: can be done away with is gone; so what is called by its symbol instead loses nothing
LONG_FUNCTION = 160
#: modules of deep calls, whose long functions would else be optimised once more with everyone that calls them
STAYING = (
    "mdstopo.optimizer.conic_kernels", "mdstopo.optimizer.reduced", "mdstopo.optimizer.cones",
    "mdstopo.optimizer.wide_slots", "mdstopo.optimizer.wide_sorting", "mdstopo.optimizer.wide_kernels",
)  # fmt: skip
#: what a symbol of our own kernels begins with; symbols of functions that Numba makes differ between processes
_OURS = "_ZN7mdstopo"


class Unit:
    """A function: its symbol, its intermediate code as LLVM writes it, and the units that it calls."""

    def __init__(
        self, symbol: str, bitcode: bytes, needs: Iterable["Unit"] = (),
        is_long: bool = False, is_whole: bool = False, is_done: bool = False,
    ) -> None:  # fmt: skip
        """A unit.

        symbol: what it is called by.
        bitcode: its intermediate code.
        needs: what it calls.
        is_long: whether it may have machine code of its own.
        is_whole: whether it is Numba's, several functions with all that they call.
        is_done: whether it is long and optimised, so that no caller does it once more.
        """
        self.symbol, self.bitcode = symbol, bitcode
        self.is_long, self.is_whole, self.is_done = is_long, is_whole, is_done
        self.needs = sorted({each.key: each for each in needs}.values(), key=_order)

    @functools.cached_property
    def key(self) -> str:
        """What tells it from others, in every process."""
        return hashlib.sha256(self.symbol.encode() + self.bitcode).hexdigest()[:24]

    @functools.cached_property
    def module(self) -> Any:
        """The code, read: the same in memory whether it was just made or comes from the disk."""
        return llvm.parse_bitcode(self.bitcode)


def _order(unit: Unit) -> tuple[str, str]:
    return unit.symbol, unit.key


def share(module: Any, symbol: str) -> None:
    """Let several modules define what a module defines for others beside the function of a symbol."""
    for each in module.functions:
        if not each.is_declaration and each.linkage.name == "external" and each.name != symbol:
            each.linkage = "linkonce_odr"


def link(module: Any, needs: Iterable[Unit], split: bool) -> dict[str, Unit]:
    """Link into a module all that it reaches but what is optimised already, and with `split` but what has machine code
    of its own; both are returned, by their symbols."""
    apart: dict[str, Unit] = {}
    linked: dict[str, Unit] = {}
    waiting = sorted(needs, key=_order)
    while waiting:
        unit = waiting.pop()
        if unit.symbol in linked or unit.symbol in apart:
            continue
        if unit.is_done or (split and unit.is_long):
            apart[unit.symbol] = unit
        else:
            linked[unit.symbol] = unit
            waiting += unit.needs
    _link(module, linked.values())
    return dict(sorted(apart.items()))


def complete(module: Any, needs: Iterable[Unit]) -> None:
    """Link into a module that has been optimised what was optimised before it, with all that this reaches."""
    reached = {unit.symbol: unit for unit in all_of(needs)}
    _link(module, reached.values())


def _link(module: Any, found: Iterable[Unit]) -> None:
    """Link units into a module, without what they call."""
    ordered = sorted(found, key=lambda each: (each.is_whole, *_order(each)))
    for unit in ordered:
        module.link_in(unit.module, preserve=True)
    for unit in ordered:
        if not unit.is_whole:
            module.get_function(unit.symbol).linkage = "linkonce_odr"  # gone where nobody calls it any more


def all_of(units: Iterable[Unit]) -> Iterator[Unit]:
    """The units and all that they reach, each once."""
    met: set[str] = set()
    waiting = list(units)
    while waiting:
        unit = waiting.pop()
        if unit.key not in met:
            met.add(unit.key)
            waiting += unit.needs
            yield unit


# On the disk


@functools.cache
def _known(_folder: str) -> dict[str, Unit]:
    """Units of this process that lie in a folder, by their keys."""
    return {}


def keep(unit: Unit) -> None:
    """Keep a unit and all that it reaches, where that is possible."""
    import pickle

    folder = cache_folder()
    known = _known(str(folder))
    for each in all_of([unit]):
        if each.key not in known:
            known[each.key] = each
            flags = each.is_long, each.is_whole, each.is_done
            content = each.symbol, each.bitcode, [need.key for need in each.needs], *flags
            write_checked(folder / f"unit-{each.key}.kept", pickle.dumps(content))


def kept(key: str) -> Unit:
    """A unit that was kept, with all that it reaches. Raises LookupError where something of it is missing."""
    import pickle

    folder = cache_folder()
    known = _known(str(folder))
    if key not in known:
        data = read_checked(folder / f"unit-{key}.kept")
        if data is None:
            raise LookupError(key)
        symbol, bitcode, needs, *flags = pickle.loads(data)
        known[key] = Unit(symbol, bitcode, [kept(each) for each in needs], *flags)
    return known[key]


# Machine code of its own

#: the file with what compiled code expects of Numba's run time
RUNTIME = "apart-runtime.code"

#: machine code that this process has made, or found with all that it calls, by its file: the disk may have refused it
_MADE: dict[Path, Code] = {}


def is_long(size: int, symbol: str, inlined: bool) -> bool:
    """Whether a function of so many instructions is to have machine code of its own; inlined: its callers hold it."""
    return size >= LONG_FUNCTION and not inlined and symbol.startswith(_OURS)


def is_of(symbol: str, modules: Iterable[str]) -> bool:
    """Whether a symbol is that of a function in one of the modules, or of what stands below a package (`a.b.`)."""
    return any(symbol.startswith("_ZN" + "".join(f"{len(each)}{each}" for each in _names(name))) for name in modules)


def _names(module: str) -> list[str]:
    return [each for each in module.split(".") if each]


def name_of(unit: Unit) -> str:
    """The name of the file with its machine code."""
    return f"apart-{hashlib.sha256(unit.symbol.encode()).hexdigest()[:24]}.code"


def found(name: str) -> Code | None:
    """The machine code in a file of that name; nothing where there is none."""
    path = cache_folder() / name
    return _MADE.get(path) or read(path)


def _whole(name: str) -> Code | None:
    """The same where all that it calls is there as well."""
    code = found(name)
    path = cache_folder() / name
    if code is None or (path not in _MADE and any(_whole(each) is None for each in code.needs)):
        return None
    _MADE[path] = code
    return code


def made(name: str, make: Callable[[], Code | None]) -> Code | None:
    """The machine code in a file of that name, which is made where there is none; nothing where it cannot be."""
    code = _whole(name)
    if code is None:
        path = cache_folder() / name
        with alone(path):
            code = _whole(name) or make()
            if code is not None:
                _MADE[path] = code
                write(path, code)
    return code


class Provided:
    """Machine code of long functions in memory, of one folder: what entries call by symbols."""

    def __init__(self, engine: Any) -> None:
        self._engine = engine
        self._names: set[str] = set()
        self._lock = threading.Lock()  # an engine takes all of what it then finalises from one thread

    def provide(self, names: Iterable[str]) -> bool:
        """Have what lies in files of these names in memory, with all that it needs; False where some is missing."""
        with self._lock:
            return self._provide(names)

    def _provide(self, names: Iterable[str]) -> bool:
        codes: dict[str, Code] = {}
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name in self._names or name in codes:
                continue
            code = found(name)
            if code is None:
                return False
            codes[name] = code
            waiting += code.needs
        if codes:
            for code in codes.values():
                self._engine.add_object_file(llvm.ObjectFileRef.from_data(code.body))
            self._engine.finalize_object()
            for code in codes.values():
                if code.result:
                    llvm.add_symbol(code.result, self._engine.get_function_address(code.result))
            self._names |= codes.keys()
        return True
