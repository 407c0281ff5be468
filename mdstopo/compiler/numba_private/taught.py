"""What Numba is told of our own ways to call: kernels chosen by types, structures of many fields, threads."""

import functools
import inspect
import os
from collections.abc import Callable
from typing import Any

from llvmlite import ir as llvm_ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.experimental.jitclass.base import imp_dtor
from numba.extending import lower_builtin, type_callable

from mdstopo.compiler import threads

_WORD, _SMALL, _MEMORY = llvm_ir.IntType(64), llvm_ir.IntType(32), llvm_ir.IntType(8).as_pointer()
_BODY = llvm_ir.FunctionType(_MEMORY, [_MEMORY])
#: the system's threads: `pthread_create(name, attributes, body, argument)`, `pthread_join(name, result)`
_CREATE = llvm_ir.FunctionType(_SMALL, [_WORD.as_pointer(), _MEMORY, _BODY.as_pointer(), _MEMORY])
_JOIN = llvm_ir.FunctionType(_SMALL, [_WORD, _MEMORY.as_pointer()])


def offer(stub: Callable[..., Any], choose: Callable[..., Any]) -> None:
    """Have Numba call, for `stub`, the kernel that `choose` returns for the types; none is an error of types.

    Numba's own `overload` would compile the kernel once more, and all of it to machine code.
    """
    compiled: dict[Any, Any] = {}

    class Chosen(AbstractTemplate):
        key = stub

        def generic(self, asked: Any, named: Any) -> Any:
            kernel = choose(*asked, **named)
            if kernel is None:
                return None
            kind = types.Dispatcher(kernel.dispatcher)
            found = kind.get_call_type(self.context, asked, named)
            if found is not None:
                compiled[found.args] = kind.get_impl_key(found)
            return found

        def get_impl_key(self, found: Any) -> Any:
            return compiled[found.args]

    infer_global(stub)(Chosen)


def enter_structure(maker: type, kind: type, fields: tuple[str, ...]) -> None:
    """Have `maker(...)` make a structure of a kind where it is called. Numba's own way is a function for each, which is
    given the fields in hundreds of arguments."""
    named = inspect.Signature([inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in fields])

    @type_callable(maker)
    def typed(_context: Any) -> Any:
        def typer(*given: Any) -> Any:
            return kind(list(zip(fields, given, strict=True)))

        typer.pysig = named  # type: ignore[attr-defined]
        return typer

    @lower_builtin(maker, types.VarArg(types.Any))
    def made(context: Any, build: Any, sig: Any, given: Any) -> Any:
        whole = sig.return_type
        form = context.data_model_manager[whole.get_data_type()].get_value_type()
        size = context.get_constant(types.uintp, context.get_abi_sizeof(form))
        held = context.nrt.meminfo_alloc_dtor(build, size, imp_dtor(context, build.module, whole))
        data = context.nrt.meminfo_data(build, held)
        for k, (value, asked, has) in enumerate(zip(given, sig.args, whole.field_dict.values(), strict=True)):
            field = context.cast(build, value, asked, has)
            context.nrt.incref(build, has, field)
            build.store(field, field_of(context, build, whole, data, k))
        return cgutils.pack_struct(build, [held])


def field_of(context: Any, build: Any, kind: Any, data: Any, k: int) -> Any:
    """Where a field of a structure is: an address that names the whole structure's type would be long to write and to
    read."""
    whole, offset = _offset(context, kind, k)
    address = build.gep(data, [llvm_ir.Constant(_WORD, offset)], inbounds=True)
    return build.bitcast(address, whole.elements[k].as_pointer())


@functools.cache
def _offset(context: Any, kind: Any, k: int) -> tuple[Any, int]:
    """LLVM's type of a structure, and how far into it a field is."""
    whole = context.data_model_manager[kind.get_data_type()].get_value_type()
    target = context.target_data
    if hasattr(whole, "get_element_offset"):
        return whole, whole.get_element_offset(target, k)
    pointer = whole._get_ll_pointer_type(target)  # llvmlite 0.43
    return whole, target.get_element_offset(pointer.element_type, k)


def enter_threads(shared: Callable[..., Any] = threads.shared, taken: Callable[..., Any] = threads.taken) -> None:
    """Tell Numba what `threads.shared` and `threads.taken` do, or functions in their place."""

    class TakenTyped(AbstractTemplate):
        key = taken

        def generic(self, asked: Any, _named: Any) -> Any:
            return signature(types.int64, *asked)

    class SharedTyped(AbstractTemplate):
        key = shared

        def generic(self, asked: Any, _named: Any) -> Any:
            kernel, _, job = asked
            found = kernel.get_call_type(self.context, tuple(job.types), {})  # compiles it
            return signature(types.none, kernel, types.int64, types.BaseTuple.from_types(found.args))

    infer_global(taken)(TakenTyped)
    infer_global(shared)(SharedTyped)
    lower_builtin(taken, types.Array)(_taken)
    lower_builtin(shared, types.Dispatcher, types.int64, types.BaseTuple)(_shared)


def _taken(context: Any, build: Any, sig: Any, arguments: Any) -> Any:
    place = context.make_array(sig.args[0])(context, build, arguments[0]).data
    return build.atomic_rmw("add", place, llvm_ir.Constant(_WORD, 1), "monotonic")


def _shared(context: Any, build: Any, sig: Any, arguments: Any) -> Any:
    kernel, _, job = sig.args
    compiled = kernel.dispatcher.overloads[tuple(job.types)]
    context.active_code_library.add_linking_library(compiled.library)
    called = signature(types.none, *job.types)
    values = cgutils.unpack_tuple(build, arguments[2], len(job.types))
    wrapped = llvm_ir.LiteralStructType([value.type for value in values])
    held = cgutils.alloca_once(build, wrapped)
    for k, value in enumerate(values):
        build.store(value, cgutils.gep_inbounds(build, held, 0, k))
    crew = None
    if os.name == "posix":
        body = _body(context, build.module, compiled.fndesc, called, wrapped)
        crew = _Crew(build, arguments[1], body, build.bitcast(held, _MEMORY))
    status, _ = context.call_internal_no_propagate(build, compiled.fndesc, called, values)
    if crew is not None:
        failed = crew.ended()
        with cgutils.if_unlikely(build, build.icmp_unsigned("!=", failed, llvm_ir.Constant(_WORD, 0))):
            context.call_conv.return_user_exc(build, RuntimeError, ("a thread of a pass over the members failed",))
    with cgutils.if_unlikely(build, status.is_error):
        context.call_conv.return_status_propagate(build, status)
    return context.get_dummy_value()


def _body(context: Any, module: Any, kernel: Any, called: Any, wrapped: Any) -> Any:
    """What a thread runs: the kernel with the wrapped arguments; not null where it has failed."""
    function = llvm_ir.Function(module, _BODY, module.get_unique_name("mdstopo_thread"))
    function.linkage = "internal"
    build = llvm_ir.IRBuilder(function.append_basic_block())
    given = build.bitcast(function.args[0], wrapped.as_pointer())
    values = [build.load(cgutils.gep_inbounds(build, given, 0, k)) for k in range(len(wrapped.elements))]
    status, _ = context.call_internal_no_propagate(build, kernel, called, values)
    build.ret(build.inttoptr(build.zext(status.is_error, _WORD), _MEMORY))
    return function


class _Crew:
    """Threads beside this one: made at once, joined by `ended`."""

    def __init__(self, build: Any, wanted: Any, body: Any, argument: Any) -> None:
        self._build = build
        most = llvm_ir.Constant(_WORD, threads.MOST_THREADS)
        fits = build.icmp_signed("<", wanted, most)
        self._count = build.sub(build.select(fits, wanted, most), llvm_ir.Constant(_WORD, 1))
        self._names = cgutils.alloca_once(build, _WORD, threads.MOST_THREADS)
        self._refused = cgutils.alloca_once(build, _SMALL, threads.MOST_THREADS)
        create = cgutils.get_or_insert_function(build.module, _CREATE, "pthread_create")
        with cgutils.for_range(build, self._count) as loop:
            name = build.gep(self._names, [loop.index])
            refused = build.call(create, [name, _MEMORY(None), body, argument])
            build.store(refused, build.gep(self._refused, [loop.index]))

    def ended(self) -> Any:
        """Wait for all; not zero where one has failed."""
        build = self._build
        failed = cgutils.alloca_once_value(build, llvm_ir.Constant(_WORD, 0))
        result = cgutils.alloca_once(build, _MEMORY)
        join = cgutils.get_or_insert_function(build.module, _JOIN, "pthread_join")
        with cgutils.for_range(build, self._count) as loop:
            refused = build.load(build.gep(self._refused, [loop.index]))
            with build.if_then(build.icmp_unsigned("==", refused, llvm_ir.Constant(_SMALL, 0))):
                build.call(join, [build.load(build.gep(self._names, [loop.index])), result])
                code = build.ptrtoint(build.load(result), _WORD)
                build.store(build.or_(build.load(failed), code), failed)
        return build.load(failed)
