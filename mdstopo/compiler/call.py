"""Machine code in memory, and calls into it."""

import contextlib
import ctypes
import functools
import struct
from collections.abc import Callable
from itertools import accumulate
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from mdstopo.compiler.compiled_units import Provided
from mdstopo.compiler.entry import DIMENSIONS, DTYPES, EXCUSE, LENGTHS, NUMBERS, PLAIN
from mdstopo.compiler.store import CALL, PREPARED, Code, cache_folder

#: a call: status, 0 where all went well, of the block of numbers
_CALL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)

#: the eight bytes of a result, by its letter
_SLOTS = {"f": "d", "i": "q", "b": "?7x"}


@functools.cache
def target() -> Any:
    """The processor's target."""
    for start in ("initialize", "initialize_native_target", "initialize_native_asmprinter"):
        with contextlib.suppress(RuntimeError):  # done by LLVM itself in later versions
            getattr(llvm, start)()
    return llvm.Target.from_default_triple()


def _engine() -> Any:
    """What holds machine code in memory; it owns its target machine, so each has one."""
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), target().create_target_machine(jit=True))


@functools.cache
def _provided(_folder: str) -> Provided:
    return Provided(_engine())


def provide(code: Code) -> bool:
    """Have all in memory that machine code calls by symbols; False where some of it is missing."""
    return not code.needs or _provided(str(cache_folder())).provide(code.needs)


@functools.cache
def arrays_are_known() -> bool:
    """Whether the fields of array objects are where `numba_private.build` has machine code look for them."""
    array = np.zeros((2, 3))
    words = (ctypes.c_int64 * (LENGTHS + 1)).from_address(id(array))
    dimensions = ctypes.c_int32.from_address(id(array) + 8 * DIMENSIONS).value
    if words[NUMBERS] != array.__array_interface__["data"][0] or dimensions != array.ndim:
        return False
    return tuple((ctypes.c_int64 * 2).from_address(words[LENGTHS])) == array.shape


def _format(kind: str) -> str:
    """How an argument is packed, by its letters in `compiler.entry.types_of`."""
    return "q" * int(kind[1:]) if kind[0] == "t" else {"f": "d"}.get(kind, "q")


def _width(kind: str) -> int:
    """How many words an argument takes where a call is prepared."""
    count = int(kind[1:] or 1)
    return 1 + count if kind[0] in DTYPES else count


#: what numbers may be, by their letters; a bool is an int as well, `block_of` tells them apart
_CLASSES: dict[str, tuple[type, ...]] = {"f": (float, np.floating), "i": (int, np.integer), "b": (bool, np.bool_)}


def _asked(kind: str) -> tuple[str, Any, int, Any]:
    """What an argument of a type has to be: its letter, its class, dimensions or integers it has, and an array's
    numbers."""
    letter, count = kind[0], int(kind[1:] or 0)
    if letter in DTYPES:
        return letter, np.ndarray, count, DTYPES[letter]
    return letter, tuple if letter == "t" else _CLASSES[letter], count, None


class Native:
    """An entry's machine code for one set of types of arguments."""

    def __init__(self, name: str, code: Code, types: str) -> None:
        self._engine = _engine()
        for part in (code.body, code.glue):
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(part))
        self._engine.finalize_object()
        self._call, self._prepared = (_CALL(self._engine.get_function_address(each)) for each in (CALL, PREPARED))
        self._name = name
        self._kinds = types.split()
        self._asked = [_asked(kind) for kind in self._kinds]
        self._single = not code.result.startswith("(")
        result = code.result.strip("()")
        self._unpack = struct.Struct("".join(_SLOTS[letter] for letter in result)).unpack_from if result else None
        form = "".join(_format(kind) for kind in self._kinds)
        self._pack = struct.Struct(form).pack_into
        #: words of what a call returns, with what it raises; of all in a block
        self._behind = len(result) + EXCUSE
        self._block = ctypes.c_int64 * (len(form) + self._behind)

    def __call__(self, *arguments: Any) -> Any:
        block = self.block_of(arguments)
        if block is None:
            raise TypeError(f"the compiled {self._name} takes arguments of other types")
        return self.run(block)

    def run(self, block: Any) -> Any:
        """Call it with a block of numbers."""
        if self._call(block):
            self._fail(*block[-EXCUSE:])
        return self._found(block)

    def prepare(self, *arguments: Any) -> Callable[..., Any]:
        """These arguments as a block, ready to be called; see `Entry.prepare`."""
        *places, words = accumulate(map(_width, self._kinds), initial=0)
        block: Any = (ctypes.c_int64 * (words + self._behind))()
        number = np.frombuffer(block, dtype=np.float64)
        whole = number.view(np.int64)
        placed = [(number if kind == "f" else whole, place) for kind, place in zip(self._kinds, places, strict=True)]
        for (view, place), argument in zip(placed, arguments, strict=True):
            if isinstance(argument, np.ndarray):
                view[place : place + 1 + argument.ndim] = argument.__array_interface__["data"][0], *argument.shape
            else:
                view[place : place + np.size(argument)] = argument
        address = ctypes.c_void_p(ctypes.addressof(block))
        function, found = self._prepared, self._found

        # `kept`: the block only tells where arrays are, and these have to live as long as the call
        def call(*changes: tuple[int, Any], kept: Any = arguments) -> Any:
            for which, value in changes:
                view, place = placed[which]
                view[place] = value
            if function(address):
                self._fail(*block[-EXCUSE:])
            return found(block)

        return call

    def block_of(self, arguments: tuple[Any, ...]) -> Any:
        """The block of numbers for these arguments; nothing where they are not of the types of this code.

        It tells where arrays are, and is good only as long as they live.
        """
        if len(arguments) != len(self._asked):
            return None
        numbers: list[Any] = []
        for (letter, sort, count, dtype), argument in zip(self._asked, arguments, strict=True):
            if not issubclass(type(argument), sort):  # as in `types_of`
                return None
            if dtype is not None:
                own = argument.dtype  # nearly always that very object: to compare them takes five times as long
                if own is not dtype and own != dtype:
                    return None
                if argument.ndim != count or argument.flags.num & PLAIN != PLAIN:
                    return None
                numbers.append(id(argument))  # where the object is: the machine code finds its numbers there
            elif letter == "t":
                if type(argument) is not tuple or len(argument) != count or any(type(k) is not int for k in argument):
                    return None
                numbers.extend(argument)
            elif letter == "b":
                numbers.append(int(argument))
            elif isinstance(argument, bool):
                return None
            else:
                numbers.append(argument)
        block = self._block()
        self._pack(block, 0, *numbers)
        return block

    def _found(self, block: Any) -> Any:
        """What the call has left behind the arguments."""
        if self._unpack is None:
            return None
        results = self._unpack(block, 8 * (len(block) - self._behind))
        return results[0] if self._single else results

    def _fail(self, address: int, size: int, computed: int) -> None:
        """Raise what the compiled code raised: its class and arguments are pickled where it says."""
        import pickle

        if not address:
            raise RuntimeError(f"the compiled {self._name} failed")
        raised, arguments = pickle.loads(ctypes.string_at(address, size))[:2]
        if computed > 0:
            raise raised(f"in the compiled {self._name}")
        raise raised(*(arguments or ()))
