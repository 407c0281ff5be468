"""What is kept of a function while an entry is compiled: its intermediate code, nothing else.

Numba makes machine code of every function, and optimises each with all that it calls. Here only entries are called
from outside, and an entry holds a copy of all that it calls. So a function inside gets no machine code, and one at body
level (`jit.kernel`) is optimised in its entry only: a quarter of the compile time is saved. A loop over members is
optimised by itself too, so that its vectors do not depend on who calls it. Loops of entries are not unrolled.
"""

import functools
import hashlib
import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from llvmlite import binding as llvm
from numba.core.caching import FunctionCache, _Cache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.serialize import dumps

from mdstopo.native.store import cache_folder, read_checked, write_checked

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


@functools.cache
def _source(path: str) -> bytes:
    return hashlib.sha256(Path(path).read_bytes()).digest()


class Cache(_Cache):
    """Functions inside entries on the disk, for other processes that compile entries which call them.

    In the place of Numba's own, which ends the program where a file is damaged or the disk full: one file for a
    function, with a checksum; whatever is wrong with it means that the function is compiled once more.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._py_func = function
        code = function.__code__
        names = f"{code.co_filename} {function.__qualname__} {code.co_firstlineno}"
        self._path = cache_folder() / f"inside-{hashlib.sha256(names.encode()).hexdigest()[:24]}.kept"

    @property
    def cache_path(self) -> str:
        """Where it is kept."""
        return str(self._path.parent)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The function compiled for these types; nothing where it has not been kept."""
        target_context.refresh()
        try:
            kept = self._read().get(self._key(sig, target_context.codegen()))
            if kept is None:
                return None
            return CompileResult._rebuild(_Reader(target_context), *pickle.loads(kept))  # type: ignore[no-untyped-call]
        except Exception:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep it where that is possible."""
        if any(not each.can_cache for each in data.lifted) or data.library.has_dynamic_globals:
            return
        try:
            whole = self._read()
            whole[self._key(sig, data.codegen)] = dumps(data._reduce())  # type: ignore[no-untyped-call]
            write_checked(self._path, dumps(whole))  # type: ignore[no-untyped-call]
        except Exception:
            return

    def _read(self) -> dict[Any, bytes]:
        """All that is kept of the function, by its key."""
        data = read_checked(self._path)
        found = {} if data is None else pickle.loads(data)
        return found if isinstance(found, dict) else {}

    def _key(self: Any, sig: Any, codegen: Any) -> Any:
        """Types, processor, the function's bytecode and closure, and the file that it stands in."""
        key = FunctionCache._index_key(self, sig, codegen)  # type: ignore[no-untyped-call]
        return (*key, _source(inspect.getfile(self._py_func)))

    def enable(self) -> None:
        """It always is."""

    def disable(self) -> None:
        """Not needed."""

    def flush(self) -> None:
        """Forget it."""
        self._path.unlink(missing_ok=True)
