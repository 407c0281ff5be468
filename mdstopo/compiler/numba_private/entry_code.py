"""An entry compiled by Numba, as machine code that needs neither Numba nor Python's interface.

Numba's function takes each array as seven or more arguments. `_glue` writes the function that unfolds the block of
numbers which `compiler.call` fills into those, and what the code expects of Numba's run time (`run_time`).
"""

import contextlib
import ctypes
import functools
import gc
from collections.abc import Iterator, Mapping
from typing import Any

from llvmlite import binding as llvm
from llvmlite import ir as llvm_ir
from numba import types

from mdstopo.compiler import compiled_units as units
from mdstopo.compiler.entry import EXCUSE, LENGTHS, NUMBERS
from mdstopo.compiler.numba_plain import numba_type
from mdstopo.compiler.numba_private.libraries import Split
from mdstopo.compiler.numba_private.run_time import PROVIDED, add_runtime
from mdstopo.compiler.store import CALL, PREPARED, Code


def build(dispatcher: Any, letters: str) -> Code | None:
    """Machine code of a function for these types (`compiler.entry.types_of`).

    Nothing where the code would need more of Numba's run time than is provided.
    """
    arguments = tuple(map(numba_type, letters.split()))
    with _untold(), _uncollected():
        return _built(dispatcher, arguments, letters)


@contextlib.contextmanager
def _untold() -> Iterator[None]:
    """Have nobody told of every call into LLVM, which takes a tenth of the time."""
    told: list[Any] = getattr(getattr(llvm.ffi.lib, "_lock", None), "_cblist", [])
    before = told[:]
    told.clear()
    try:
        yield
    finally:
        told.extend(before)


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Have Python not look for what could go: what the compiler makes lives on, and it takes a tenth of the time."""
    looks = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if looks:
            gc.enable()


def _built(dispatcher: Any, arguments: tuple[Any, ...], letters: str) -> Code | None:
    dispatcher.compile(arguments)
    compiled = dispatcher.overloads[arguments]
    result = _result(compiled.signature.return_type)
    library = compiled.library
    if not library.split:
        units.complete(library._final_module, library.apart.values())
        library.apart = {}
    if result is None or _missing(library._final_module, library.apart):
        return None
    needs = _made_apart(library)
    if needs is None:
        return None
    context = dispatcher.targetctx
    form = context.call_conv.get_function_type(compiled.signature.return_type, arguments)
    module = llvm_ir.Module("mdstopo")
    module.triple = library._final_module.triple
    module.data_layout = library._final_module.data_layout
    function = llvm_ir.Function(module, form, compiled.fndesc.llvm_func_name)
    for name in (CALL, PREPARED):
        _glue(module, function, letters.split(), result, name)
    add_runtime(module)
    checked = llvm.parse_assembly(str(module))
    checked.verify()
    machine = library._codegen._tm
    return Code(machine.emit_object(library._final_module), machine.emit_object(checked), result, needs)


def _made_apart(library: Any) -> tuple[str, ...] | None:
    """Names of the files with the long functions that a library calls, which are compiled where there are none.

    Nothing where one of them would need more of Numba's run time than is provided.
    """
    if not library.apart:
        return ()

    def runtime() -> Code:
        module = llvm_ir.Module("mdstopo")
        module.triple, module.data_layout = library._final_module.triple, library._final_module.data_layout
        add_runtime(module)
        return Code(library._codegen._tm.emit_object(llvm.parse_assembly(str(module))), b"", "")

    def compiled(unit: units.Unit) -> Code | None:
        made = Split(library._codegen, "apart")
        made._final_module.link_in(unit.module, preserve=True)
        made.apart = units.link(made._final_module, unit.needs, split=True)
        if not unit.is_done:
            made._optimize_final_module()
        made._final_module.verify()
        if _missing(made._final_module, made.apart):
            return None
        needs = _made_apart(made)
        body = library._codegen._tm.emit_object(made._final_module)
        return None if needs is None else Code(body, b"", unit.symbol, (units.RUNTIME, *needs))

    units.made(units.RUNTIME, runtime)
    names = []
    for unit in library.apart.values():
        name = units.name_of(unit)
        if units.made(name, functools.partial(compiled, unit)) is None:
            return None
        names.append(name)
    return tuple(names)


def _result(kind: Any) -> str | None:
    """What a function returns, in the letters of `compiler.store.Code`; nothing where there is no letter for it."""
    letters = {types.boolean: "b", types.int64: "i", types.float64: "f"}
    if kind is types.none:
        return "()"
    if isinstance(kind, types.BaseTuple):
        parts = [letters.get(part) for part in kind.types]  # type: ignore[attr-defined]
        return None if None in parts else f"({''.join(part for part in parts if part)})"
    return letters.get(kind)


def _missing(module: Any, apart: Mapping[str, units.Unit]) -> list[str]:
    """Functions that the code calls and that neither the process nor `runtime` has; apart: those it has elsewhere."""
    process = ctypes.CDLL(None)
    names = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    names = [name for name in names if name not in apart]
    return [name for name in names if name not in PROVIDED and not hasattr(process, name)]


def _glue(module: Any, function: Any, kinds: list[str], result: str, name: str) -> None:
    """`int32 name(block)`: unfold the block, call the function, put what it returns and what it raises behind.

    An array is in the block of `CALL` as the place of its object, in that of `PREPARED` as address and lengths: to ask
    some forty objects for theirs takes a microsecond, which is much where a call is made again and again.

    Numba unfolds an array into two pointers to its owner, the number of items, their size, the address, lengths and
    strides.
    """

    word = llvm_ir.IntType(64)
    call = llvm_ir.Function(module, llvm_ir.FunctionType(llvm_ir.IntType(32), [word.as_pointer()]), name)
    build = llvm_ir.IRBuilder(call.append_basic_block())
    block = call.args[0]
    wanted = list(function.function_type.args)
    following = iter(wanted[2:])
    at = 0

    def slot(place: int) -> Any:
        return build.gep(block, [word(place)])

    def given() -> Any:
        nonlocal at
        at += 1
        return build.load(slot(at - 1))

    def cast(value: Any) -> Any:
        """A word as the next argument."""
        kind = next(following)
        if isinstance(kind, llvm_ir.PointerType):
            return build.inttoptr(value, kind)
        if isinstance(kind, llvm_ir.DoubleType):
            return build.bitcast(value, kind)
        return value if kind == word else build.trunc(value, kind)

    held = build.alloca(wanted[0].pointee)
    passed: list[Any] = []
    for kind in kinds:
        if kind[0] in "dq?":
            dimensions = range(int(kind[1:]))
            if name == CALL:
                start = build.inttoptr(given(), word.as_pointer())
                address, lengths_at = (build.load(build.gep(start, [word(k)])) for k in (NUMBERS, LENGTHS))
                where = build.inttoptr(lengths_at, word.as_pointer())
                lengths = [build.load(build.gep(where, [word(k)])) for k in dimensions]
            else:
                address, lengths = given(), [given() for _ in dimensions]
            size = word(1 if kind[0] == "?" else 8)
            items, strides = word(1), [size]
            for length in lengths:
                items = build.mul(items, length)
            for length in reversed(lengths[1:]):
                strides.insert(0, build.mul(strides[0], length))
            unfolded = word(0), word(0), items, size, address, *lengths, *(strides if lengths else ())
            passed += [cast(value) for value in unfolded]
        else:
            passed += [cast(given()) for _ in range(int(kind[1:]) if kind[0] == "t" else 1)]
    letters = result.strip("()")
    behind = at + len(letters)
    build.store(word(0), slot(behind))
    excuse = build.bitcast(slot(behind), wanted[1])
    status = build.call(function, [held, excuse, *passed])
    for k, letter in enumerate(letters):
        place = [llvm_ir.IntType(32)(0), llvm_ir.IntType(32)(k)] if result.startswith("(") else []
        value = build.load(build.gep(held, place) if place else held)
        if letter == "f":
            value = build.bitcast(value, word)
        elif value.type != word:
            value = build.zext(value, word)
        build.store(value, slot(at + k))
    _tell(build, [slot(behind + k) for k in range(EXCUSE)])
    build.ret(status)


def _tell(build: Any, slots: list[Any]) -> None:
    """Put what was raised in place of where Numba's record of it is, unless nothing was.

    The record: where the pickle is, its size (32 bits), its hash, how arguments known only then are made, and their
    number (32 bits).
    """
    word = llvm_ir.IntType(64)
    record = build.load(slots[0])
    for each in slots[1:]:
        build.store(word(0), each)
    with build.if_then(build.icmp_unsigned("!=", record, word(0)), likely=False):
        start = build.inttoptr(record, word.as_pointer())
        for k, (place, bits) in zip(range(EXCUSE), ((0, -1), (1, 0xFFFF_FFFF), (4, 0xFFFF_FFFF)), strict=True):
            build.store(build.and_(build.load(build.gep(start, [word(place)])), word(bits)), slots[k])
