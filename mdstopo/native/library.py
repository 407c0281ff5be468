"""What is kept of a function while an entry is compiled: its intermediate code, nothing else.

Numba makes machine code of every function, and optimises each with all that it calls. Here only entries are called
from outside, and an entry holds a copy of all that it calls. So a function inside gets no machine code, and one at body
level (`jit.kernel`) is optimised in its entry only: a quarter of the compile time is saved. A loop over members is
optimised by itself too, so that its vectors do not depend on who calls it. Loops of entries are not unrolled.
"""

from typing import Any

import numba
from llvmlite import binding as llvm
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult

#: versions of Numba whose insides `passes`, `lowering` and `sparing` are known to fit; others compile in their own way
KNOWN = ("0.68.",)
IS_KNOWN = numba.__version__.startswith(KNOWN)

LEANER: dict[Any, Any] = {}
if IS_KNOWN:
    from mdstopo.native.passes import LEANER


class Optimised(JITCodeLibrary):
    """Intermediate code of a function with all that it calls, optimised."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._verify_declare_only_symbols()  # type: ignore[no-untyped-call]
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """Who is told which Python objects the function holds: nobody, as nothing runs here."""
        return self

    def set_env(self, name: str, held: Any) -> None:
        """Tell nobody."""

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What the disk keeps; of these libraries that is no machine code."""
        kept: tuple[str, str, bytes] = self.serialize_using_bitcode()  # type: ignore[no-untyped-call]
        return kept


class Left(Optimised):
    """The same, left to be optimised where it is called."""

    def _optimize_final_module(self) -> None:
        pass


class Rolled(Optimised):
    """An entry by Numba's passes, but that its loops are not unrolled.

    Most of it runs once a call, over few bodies, and copies of loops are only more to read. Loops over members at body
    level (strengths, gathering) are left as they are, too; member kernels have been optimised before.
    """

    def _optimize_final_module(self) -> None:
        if not IS_KNOWN:
            super()._optimize_final_module()  # type: ignore[no-untyped-call]
            return
        target: Any = self._codegen
        first, builder = target._module_pass_manager(
            loop_vectorize=target._loopvect, slp_vectorize=False, opt=target._opt_level, cost="cheap"
        )
        first.run(self._final_module, builder)
        config: Any = numba.config
        options = llvm.create_pipeline_tuning_options(int(config.OPT))
        options.loop_vectorization = bool(config.LOOP_VECTORIZE)
        options.slp_vectorization = False
        options.loop_interleaving = options.loop_unrolling = False
        builder = llvm.create_pass_builder(target._tm, options)
        full = builder.getModulePassManager()
        full.add_refprune_pass()
        full.run(self._final_module, builder)


def _compiler(library: type[Optimised]) -> type[Compiler]:
    class Lean(Compiler):
        def __init__(self, typingctx: Any, targetctx: Any, given: Any, *rest: Any) -> None:
            super().__init__(typingctx, targetctx, given, *rest)  # type: ignore[no-untyped-call]
            self.state.library = library(targetctx.codegen(), library.__name__)

        def define_pipelines(self) -> Any:
            found = super().define_pipelines()  # type: ignore[no-untyped-call]
            for manager in found:
                manager.passes = [(LEANER.get(each, each), told) for each, told in manager.passes]
                manager.finalize()
            return found

    return Lean


OPTIMISED = _compiler(Optimised)
LEFT = _compiler(Left)
ROLLED = _compiler(Rolled)


class _Reader:
    """Numba's target, reading libraries of this kind."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> "_Reader":
        return self

    def unserialize_library(self, kept: tuple[str, str, bytes]) -> Optimised:
        library = Optimised(self._target.codegen(), kept[0])  # type: ignore[no-untyped-call]
        library._final_module = llvm.parse_bitcode(kept[2])
        library._finalize_final_module()
        return library


class _Entries(CompileResultCacheImpl):
    def rebuild(self, target_context: Any, payload: Any) -> Any:
        return CompileResult._rebuild(_Reader(target_context), *payload)  # type: ignore[no-untyped-call]


class Cache(FunctionCache):
    """Functions inside entries on the disk, for other processes that compile entries which call them."""

    _impl_class = _Entries
