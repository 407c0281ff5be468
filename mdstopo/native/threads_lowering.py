"""What `native.threads` becomes in machine code. Imported by what compiles, because it imports Numba."""

import os
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from mdstopo.native import threads

_WORD, _SMALL, _MEMORY = ir.IntType(64), ir.IntType(32), ir.IntType(8).as_pointer()
_BODY = ir.FunctionType(_MEMORY, [_MEMORY])
#: the system's threads: `pthread_create(name, attributes, body, argument)`, `pthread_join(name, result)`
_CREATE = ir.FunctionType(_SMALL, [_WORD.as_pointer(), _MEMORY, _BODY.as_pointer(), _MEMORY])
_JOIN = ir.FunctionType(_SMALL, [_WORD, _MEMORY.as_pointer()])


@infer_global(threads.taken)
class _TakenTyped(AbstractTemplate):
    key = threads.taken

    def generic(self, asked: Any, _named: Any) -> Any:
        return signature(types.int64, *asked)


@lower_builtin(threads.taken, types.Array)
def _taken(context: Any, build: Any, sig: Any, arguments: Any) -> Any:
    place = context.make_array(sig.args[0])(context, build, arguments[0]).data
    return build.atomic_rmw("add", place, ir.Constant(_WORD, 1), "monotonic")


@infer_global(threads.shared)
class _SharedTyped(AbstractTemplate):
    key = threads.shared

    def generic(self, asked: Any, _named: Any) -> Any:
        kernel, _, job = asked
        kernel.get_call_type(self.context, tuple(job.types), {})  # compiles it
        return signature(types.none, kernel, types.int64, job)


@lower_builtin(threads.shared, types.Dispatcher, types.int64, types.BaseTuple)
def _shared(context: Any, build: Any, sig: Any, arguments: Any) -> Any:
    kernel, _, job = sig.args
    compiled = kernel.dispatcher.overloads[tuple(job.types)]
    context.active_code_library.add_linking_library(compiled.library)
    called = signature(types.none, *job.types)
    values = cgutils.unpack_tuple(build, arguments[2], len(job.types))
    wrapped = ir.LiteralStructType([value.type for value in values])
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
        with cgutils.if_unlikely(build, build.icmp_unsigned("!=", failed, ir.Constant(_WORD, 0))):
            context.call_conv.return_user_exc(build, RuntimeError, ("a thread of a pass over the members failed",))
    with cgutils.if_unlikely(build, status.is_error):
        context.call_conv.return_status_propagate(build, status)
    return context.get_dummy_value()


def _body(context: Any, module: Any, kernel: Any, called: Any, wrapped: Any) -> Any:
    """What a thread runs: the kernel with the wrapped arguments; not null where it has failed."""
    function = ir.Function(module, _BODY, module.get_unique_name("mdstopo_thread"))
    function.linkage = "internal"
    build = ir.IRBuilder(function.append_basic_block())
    given = build.bitcast(function.args[0], wrapped.as_pointer())
    values = [build.load(cgutils.gep_inbounds(build, given, 0, k)) for k in range(len(wrapped.elements))]
    status, _ = context.call_internal_no_propagate(build, kernel, called, values)
    build.ret(build.inttoptr(build.zext(status.is_error, _WORD), _MEMORY))
    return function


class _Crew:
    """Threads beside this one: made at once, joined by `ended`."""

    def __init__(self, build: Any, wanted: Any, body: Any, argument: Any) -> None:
        self._build = build
        most = ir.Constant(_WORD, threads.MOST)
        fits = build.icmp_signed("<", wanted, most)
        self._count = build.sub(build.select(fits, wanted, most), ir.Constant(_WORD, 1))
        self._names = cgutils.alloca_once(build, _WORD, threads.MOST)
        self._refused = cgutils.alloca_once(build, _SMALL, threads.MOST)
        create = cgutils.get_or_insert_function(build.module, _CREATE, "pthread_create")
        with cgutils.for_range(build, self._count) as loop:
            name = build.gep(self._names, [loop.index])
            refused = build.call(create, [name, _MEMORY(None), body, argument])
            build.store(refused, build.gep(self._refused, [loop.index]))

    def ended(self) -> Any:
        """Wait for all; not zero where one has failed."""
        build = self._build
        failed = cgutils.alloca_once_value(build, ir.Constant(_WORD, 0))
        result = cgutils.alloca_once(build, _MEMORY)
        join = cgutils.get_or_insert_function(build.module, _JOIN, "pthread_join")
        with cgutils.for_range(build, self._count) as loop:
            refused = build.load(build.gep(self._refused, [loop.index]))
            with build.if_then(build.icmp_unsigned("==", refused, ir.Constant(_SMALL, 0))):
                build.call(join, [build.load(build.gep(self._names, [loop.index])), result])
                code = build.ptrtoint(build.load(result), _WORD)
                build.store(build.or_(build.load(failed), code), failed)
        return build.load(failed)
