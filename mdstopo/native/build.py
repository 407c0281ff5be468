"""An entry compiled by Numba, as machine code that needs neither Numba nor Python's interface.

Numba's function takes each array as seven or more arguments. `_glue` writes the function that unfolds the block of
numbers which `native.call` fills into those, and what the code expects of Numba's run time (`runtime`).
"""

import ctypes
from typing import Any

from mdstopo.native.entry import LENGTHS, NUMBERS
from mdstopo.native.runtime import PROVIDED, add_runtime
from mdstopo.native.store import CALL, PREPARED, Code


def build(dispatcher: Any, types: str) -> Code | None:
    """Machine code of a function for these types (`native.entry.types_of`).

    Nothing where the code would need more of Numba's run time than is provided.
    """
    import llvmlite.binding as llvm
    from llvmlite import ir

    arguments = tuple(_numba_type(kind) for kind in types.split())
    dispatcher.compile(arguments)
    compiled = dispatcher.overloads[arguments]
    result = _result(compiled.signature.return_type)
    library = compiled.library
    if result is None or _missing(library._final_module):
        return None
    context = dispatcher.targetctx
    signature = context.call_conv.get_function_type(compiled.signature.return_type, arguments)
    module = ir.Module("mdstopo")
    module.triple = library._final_module.triple
    module.data_layout = library._final_module.data_layout
    function = ir.Function(module, signature, compiled.fndesc.llvm_func_name)
    for name in (CALL, PREPARED):
        _glue(module, function, types.split(), result, name)
    add_runtime(module)
    checked = llvm.parse_assembly(str(module))
    checked.verify()
    machine = library._codegen._tm
    return Code(machine.emit_object(library._final_module), machine.emit_object(checked), result)


def _numba_type(kind: str) -> Any:
    from numba import types

    scalars = {"b": types.boolean, "i": types.int64, "f": types.float64}
    if kind in scalars:
        return scalars[kind]
    if kind[0] == "t":
        return types.UniTuple(types.int64, int(kind[1:]))  # type: ignore[no-untyped-call]
    items = {"d": types.float64, "q": types.int64, "?": types.boolean}
    return types.Array(items[kind[0]], int(kind[1:]), "C")


def _result(kind: Any) -> str | None:
    """What a function returns, in the letters of `native.store.Code`; nothing where there is no letter for it."""
    from numba import types

    letters = {types.boolean: "b", types.int64: "i", types.float64: "f"}
    if kind is types.none:
        return "()"
    if isinstance(kind, types.BaseTuple):
        parts = [letters.get(part) for part in kind.types]  # type: ignore[attr-defined]
        return None if None in parts else f"({''.join(part for part in parts if part)})"
    return letters.get(kind)


def _missing(module: Any) -> list[str]:
    """Functions that the code calls and that neither the process nor `runtime` has."""
    process = ctypes.CDLL(None)
    names = [f.name for f in module.functions if f.is_declaration and not f.name.startswith("llvm.")]
    return [name for name in names if name not in PROVIDED and not hasattr(process, name)]


def _glue(module: Any, function: Any, kinds: list[str], result: str, name: str) -> None:
    """`int32 name(block)`: unfold the block, call the function, put what it returns and its excuse behind.

    An array is in the block of `CALL` as the place of its object, in that of `PREPARED` as address and lengths: to ask
    some forty objects for theirs takes a microsecond, which is much where a call is made again and again.

    Numba unfolds an array into two pointers to its owner, the number of items, their size, the address, lengths and
    strides.
    """
    from llvmlite import ir

    word = ir.IntType(64)
    call = ir.Function(module, ir.FunctionType(ir.IntType(32), [word.as_pointer()]), name)
    build = ir.IRBuilder(call.append_basic_block())
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
        if isinstance(kind, ir.PointerType):
            return build.inttoptr(value, kind)
        if isinstance(kind, ir.DoubleType):
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
    excuse = build.bitcast(slot(at + len(letters)), wanted[1])
    status = build.call(function, [held, excuse, *passed])
    for k, letter in enumerate(letters):
        place = [ir.IntType(32)(0), ir.IntType(32)(k)] if result.startswith("(") else []
        value = build.load(build.gep(held, place) if place else held)
        if letter == "f":
            value = build.bitcast(value, word)
        elif value.type != word:
            value = build.zext(value, word)
        build.store(value, slot(at + k))
    build.ret(status)
