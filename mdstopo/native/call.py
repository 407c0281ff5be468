"""Machine code in memory, and calls into it."""

import contextlib
import ctypes
import functools
import struct
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numpy.typing import NDArray

from mdstopo.native.store import CALL, Code

IndexArray = NDArray[np.int64]

#: a call: status, 0 where all went well, of the block of numbers
_CALL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p)


#: the eight bytes of a result, by its letter
_SLOTS = {"f": "d", "i": "q", "b": "?7x"}


class _Excuse(ctypes.Structure):
    _fields_ = (
        ("data", ctypes.c_void_p),
        ("size", ctypes.c_int32),
        ("hash", ctypes.c_void_p),
        ("maker", ctypes.c_void_p),
        ("computed", ctypes.c_int32),
    )


@functools.cache
def _target() -> Any:
    for start in ("initialize", "initialize_native_target", "initialize_native_asmprinter"):
        with contextlib.suppress(RuntimeError):  # done by LLVM itself in later versions
            getattr(llvm, start)()
    return llvm.Target.from_default_triple()


class Native:
    """An entry's machine code for one set of types of arguments."""

    def __init__(self, name: str, code: Code, types: str) -> None:
        # an engine owns its target machine: each has one
        machine = _target().create_target_machine(jit=True)
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        for part in (code.body, code.glue):
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(part))
        self._engine.finalize_object()
        self._call = _CALL(self._engine.get_function_address(CALL))
        self._name = name
        self._kinds = types.split()
        self._result = code.result.strip("()")
        self._single = not code.result.startswith("(")
        self._unpack = struct.Struct("".join(_SLOTS[letter] for letter in self._result)).unpack_from

    def __call__(self, *arguments: Any) -> Any:
        return self._block_of(arguments)[0]()

    def prepare(self, *arguments: Any) -> Callable[..., Any]:
        """These arguments as a block, ready to be called; see `Entry.prepare`."""
        bare, block, places = self._block_of(arguments)
        number = block.view(np.float64)
        placed = [(number if kind == "f" else block, place) for kind, place in zip(self._kinds, places, strict=True)]

        def call(*changes: tuple[int, Any]) -> Any:
            for which, value in changes:
                view, place = placed[which]
                view[place] = value
            return bare()

        return call

    def _block_of(self, arguments: tuple[Any, ...]) -> tuple[Callable[[], Any], IndexArray, list[int]]:
        """A call with these arguments, its block, and where each argument begins in it."""
        numbers: list[int] = []
        places: list[int] = []
        for kind, argument in zip(self._kinds, arguments, strict=True):
            places.append(len(numbers))
            if kind[0] in "dq?":
                numbers.append(argument.__array_interface__["data"][0])
                numbers.extend(argument.shape)
            elif kind[0] == "t":
                numbers.extend(argument)
            elif kind == "f":
                numbers.append(*struct.unpack("q", struct.pack("d", argument)))
            else:
                numbers.append(int(argument))
        first = len(numbers)
        block = np.array(numbers + [0] * (len(self._result) + 1), dtype=np.int64)
        unpack, results, nothing = self._unpack, block[first:].data, not self._result
        address = ctypes.c_void_p(block.__array_interface__["data"][0])
        function, single = self._call, self._single

        # `kept`: the block holds addresses only, and the arrays have to live as long as the call
        def call(kept: Any = arguments) -> Any:
            if function(address):
                self._fail(block.item(-1))
            if nothing:
                return None
            return unpack(results)[0] if single else unpack(results)

        return call, block, places

    def _fail(self, address: int) -> None:
        """Raise what the compiled code raised: its class and arguments, pickled where Numba keeps them.

        Numba's record: the pickle's address and size, its hash, how arguments known only then are made, their number.
        """
        import pickle

        if not address:
            raise RuntimeError(f"the compiled {self._name} failed")
        record = _Excuse.from_address(address)
        raised, arguments = pickle.loads(ctypes.string_at(record.data, record.size))[:2]
        if record.computed > 0:
            raise raised(f"in the compiled {self._name}")
        raise raised(*(arguments or ()))
