"""The target that our kernels are compiled for: Numba's processor by another name.

Numba makes machine code of every little function of its own that a kernel calls, though a kernel holds a copy of what
it calls; and its convention of calls takes more instructions than ours need. Both is changed for our kernels only: a
target of their own has its own tables of what has been compiled. So a kernel's code is the same whoever else uses Numba
in this process, and nobody else's is changed by us.
"""

import functools
import hashlib
from typing import Any

import numba
from numba import types
from numba.core import callconv, cgutils
from numba.core.compiler import Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.cpu import CPUContext
from numba.core.registry import CPUDispatcher, CPUTarget
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.targetconfig import ConfigStack

from mdstopo.compiler.instructions import Builder
from mdstopo.compiler.numba_private.function_passes import LEAN
from mdstopo.compiler.numba_private.libraries import LEFT


class _Target(CPU):
    """The processor, for our kernels."""


TARGET = "mdstopo"


class _Calls(callconv.CPUCallConv):
    """Numba's convention of calls, in fewer instructions."""

    def __init__(self, context: Any) -> None:
        super().__init__(context)
        #: by the places of types in memory, these types, which so live on, and what packs arguments of them
        self._packers: dict[tuple[int, ...], Any] = {}

    def _get_arg_packer(self, argtypes: Any) -> Any:
        """What packs values of these types into arguments, found out once: an array is seven arguments or more."""
        key = tuple(map(id, argtypes))
        if key not in self._packers:
            self._packers[key] = tuple(argtypes), super()._get_arg_packer(argtypes)
        return self._packers[key][1]

    def call_function(
        self, builder: Any, callee: Any, resty: Any, argtys: Any, args: Any, attrs: Any = None
    ) -> tuple[Any, Any]:
        """Call a function of ours: where it puts what it raises is where its caller puts it.

        builder: of the caller. callee, resty, argtys: the function, its result's type and its arguments' types. args:
        the values. attrs: of the call, for LLVM.
        """
        if not isinstance(builder, Builder):
            return super().call_function(builder, callee, resty, argtys, args, attrs)  # type: ignore[no-any-return]
        result = cgutils.alloca_once(builder, self.get_return_type(resty).pointee)
        given = self._get_arg_packer(argtys).as_arguments(builder, args)
        raised = self._get_excinfo_argument(builder.function)
        code = builder.call(callee, [result, raised, *given], attrs=tuple(attrs or ()))
        status: Any = self._get_return_status(builder, code, builder.load(raised))
        if not isinstance(resty, types.Optional):
            failed = builder.icmp_signed("!=", code, code.type(0))
            status = status._replace(is_ok=builder.not_(failed), is_error=failed)
        return status, self.context.get_returned_value(builder, resty, builder.load(result))

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        """End with what a function that was called has raised."""
        if isinstance(builder, Builder) and not builder.catches:
            self._return_errcode_raw(builder, status.code)
        else:
            super().return_status_propagate(builder, status)


class _Context(CPUContext):
    """What is compiled for our target; functions of Numba's own inside ours as `_jit_without_code` has them."""

    @functools.cached_property
    def call_conv(self) -> _Calls:
        """How functions are called."""
        return _Calls(self)

    def insert_const_bytes(self, mod: Any, bytes: bytes, name: str | None = None) -> Any:
        """A constant, named by what is in it: Numba's name has Python's hash of it, which differs by process."""
        return super().insert_const_bytes(mod, bytes, name or hashlib.sha256(bytes).hexdigest()[:16])

    def _compile_subroutine_no_cache(
        self, builder: Any, impl: Any, sig: Any, locals: Any = None, flags: Any = None
    ) -> Any:
        if not LEAN:
            return super()._compile_subroutine_no_cache(builder, impl, sig, locals, flags)
        if flags is None:
            flags, above = Flags(), ConfigStack()
            flags.nrt = bool(above) and above.top().is_set("nrt") and above.top().nrt
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        compiler = LEFT(self.typing_context, self, None, sig.args, sig.return_type, flags, locals or {})
        with global_compiler_lock:
            made = compiler.compile_extra(impl)
        self.active_code_library.add_linking_library(made.library)
        return made


class _OwnTarget(CPUTarget):
    """The target of our kernels, with its own context."""

    @functools.cached_property
    def _toplevel_target_context(self) -> CPUContext:
        return _Context(self.typing_context, self._target_name)


class Dispatcher(CPUDispatcher):
    """Numba's object for a function that is compiled for our target."""

    targetdescr = _OwnTarget(TARGET)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a call is of. A number that is written in the call has the type of any other: Numba would compile the
        function once more for every such number. Where sums may be reordered it does, for their order may depend on
        numbers that are known."""
        if LEAN and not self.targetoptions.get("fastmath"):
            args, kws = tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(args, kws)

    def compile(self, sig: Any) -> Any:
        """Compile for these types. What calls in it are of is found out for our target, too, where Numba asks late."""
        with target_override(TARGET):
            return super().compile(sig)


def _jit_without_code(*given: Any, **options: Any) -> Any:
    """How a function of Numba's own is compiled where our kernels call it: without machine code."""
    return numba.jit(*given, **{"no_cfunc_wrapper": True, "pipeline_class": LEFT, "_target": TARGET, **options})


def enter_target() -> None:
    target_registry[TARGET] = _Target
    dispatcher_registry[_Target] = Dispatcher
    jit_registry[_Target] = _jit_without_code if LEAN else functools.partial(numba.jit, _target=TARGET)
