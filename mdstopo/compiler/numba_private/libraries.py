"""What is kept of a function while an entry is compiled: its intermediate code without that of what it calls
(`compiled_units`).

Numba makes machine code of every function, and optimises each with all that it calls. Here only entries are called
from outside. What an entry reaches is linked into it once, and a function at body level (`jit.kernel`) is optimised
there; before, one of `general` is only made short. In entries for scenes with joints and other laws, long functions
have machine code of their own, which all these entries share. A loop over members is optimised by itself, so that its
vectors do not depend on who calls it, and once more where it is linked in; in the modules `units.STAYING` it stays as
it is. Loops of entries are not unrolled.
"""

import functools
import hashlib
from collections.abc import Callable, Mapping
from types import CodeType, MappingProxyType
from typing import Any

import numba
from llvmlite import binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from mdstopo.compiler import compiled_units as units
from mdstopo.compiler.numba_private.function_passes import LEAN, LEANER, Passes


class Optimised(JITCodeLibrary):
    """Intermediate code of a function with all that it calls, optimised, but for long ones that have been optimised.

    split: all long functions that it calls are left out, and called by their symbols (`compiled_units`).
    """

    split = False
    #: the functions left out, by their symbols
    apart: Mapping[str, units.Unit] = MappingProxyType({})
    _unit: units.Unit | None = None
    _symbol = ""
    #: instructions of the function as written for LLVM, and whether whoever calls it is to hold it
    _size = 0
    _inlined = False

    def add_ir_module(self, ir_module: Any) -> None:
        """Note what the function is, which stands first, and go on."""
        if not self._symbol:
            own = next(each for each in ir_module.functions if each.blocks)
            self._symbol = own.name
            self._size = sum(len(block.instructions) for block in own.blocks)
            self._inlined = "alwaysinline" in own.attributes
        super().add_ir_module(ir_module)

    def finalize(self) -> None:
        """Link in what it calls, once, and optimise it."""
        self._raise_if_finalized()
        self.apart = units.link(self._final_module, self._needs(), self.split)
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()

    def _needs(self) -> list[units.Unit]:
        """What it calls."""
        if hasattr(self, "_reload_init"):  # Numba 0.60 and 0.62 have none
            for library in self._linking_libraries:
                self._reload_init.update(library._reload_init)
        return [_unit_of(library) for library in self._linking_libraries]

    @property
    def unit(self) -> units.Unit:
        """What is linked into others that call it."""
        self._ensure_finalized()
        if self._unit is None:
            units.share(self._final_module, self._symbol)
            is_done = units.is_of(self._symbol, units.STAYING)
            is_done = is_done and units.is_long(self._size, self._symbol, self._inlined)
            bitcode = self._final_module.as_bitcode()
            self._unit = units.Unit(self._symbol, bitcode, self.apart.values(), is_done, is_done=is_done)
        return self._unit

    def _finalize_final_module(self) -> None:
        # read back as from the disk: there it is in another order in memory, on which LLVM's choices may depend
        self._take(llvm.parse_bitcode(self._final_module.as_bitcode()))

    def _take(self, module: Any) -> None:
        """Have this module, to which nothing is added any more."""
        self._final_module = module
        self._finalize_dynamic_globals()
        self._finalized = True

    def take_unit(self, unit: units.Unit) -> None:
        """Be a function that was kept."""
        self._unit = unit
        self._take(unit.module)

    def _get_module_for_linking(self) -> Any:
        """All of it, for libraries that are not ours."""
        if self._shared_module is None:
            self._shared_module = self.unit.module.clone()
            units.complete(self._shared_module, self.unit.needs)
            self._shared_module.get_function(self.unit.symbol).linkage = "linkonce_odr"
        return self._shared_module

    @property
    def codegen(self) -> Any:
        """Who is told which Python objects the function holds: nobody, as nothing runs here."""
        return self

    def set_env(self, name: str, held: Any) -> None:
        """Do nothing: there are no Python objects here to be told of."""

    def serialize_using_object_code(self) -> tuple[str, str, str]:
        """What the disk keeps of it: where the unit is."""
        units.keep(self.unit)
        return self.name, "unit", self.unit.key


class Left(Optimised):
    """A function without what it calls, left to be optimised where it is linked in."""

    def finalize(self) -> None:
        """Make a unit of it."""
        self._raise_if_finalized()
        units.share(self._final_module, self._symbol)
        is_long = units.is_long(self._size, self._symbol, self._inlined)
        self.take_unit(units.Unit(self._symbol, self._final_module.as_bitcode(), self._needs(), is_long))

    @functools.cached_property
    def has_dynamic_globals(self) -> bool:
        """Whether it, or anything that it calls, holds the address of something in this process."""
        return bool(self._dynamic_globals) or any(each.has_dynamic_globals for each in self._linking_libraries)

    def _optimize_functions(self, ll_module: Any) -> None:
        """At body level have no more than what makes a function short: all else is done where it is linked in.

        What loops over members may hold keeps Numba's passes, because the order of their sums may depend on these.
        """
        if not LEAN or not units.is_of(self._symbol, (units.SPLIT,)):
            super()._optimize_functions(ll_module)
            return
        target: Any = self._codegen
        ll_module.data_layout = target._data_layout
        short, builder = llvm.create_new_function_pass_manager(), target._pass_builder()
        short.add_sroa_pass()
        short.add_instruction_combine_pass()
        short.add_simplify_cfg_pass()
        for function in ll_module.functions:
            if not function.is_declaration:
                short.run(function, builder)


def _unit_of(library: Any) -> units.Unit:
    """What is linked into others of a library, ours or Numba's."""
    if isinstance(library, Optimised):
        return library.unit
    if not hasattr(library, "_mdstopo_unit"):
        module = library._get_module_for_linking()
        names = [each.name for each in module.functions if not each.is_declaration]
        library._mdstopo_unit = units.Unit(" ".join(names), module.as_bitcode(), is_whole=True)
    found: units.Unit = library._mdstopo_unit
    return found


class Rolled(Optimised):
    """An entry by Numba's passes, but that its loops are not unrolled.

    Most of it runs once a call, over few bodies, and copies of loops are only more to read. Loops over members at body
    level (strengths, gathering) are left as they are, too; member kernels have been optimised before.
    """

    def _optimize_final_module(self) -> None:
        if not LEAN:
            super()._optimize_final_module()
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


class Split(Rolled):
    """The same without the long functions that it calls."""

    split = True


#: functions that nothing tells from others but their place in memory, by the numbers in their symbols
_NUMBERED: dict[int, Callable[..., Any]] = {}


def number_of(function: Callable[..., Any]) -> int:
    """The number in a function's symbol, the same in every process; Numba's own counts what was compiled before.

    Two processes that compile side by side hand each other functions by the disk, and what several of these hold is
    one function only where its symbol is the same. Numba makes some of its functions anew for each use, equal but for
    the types that they are compiled for, which are in the symbol as well.
    """
    description = described(function)
    number = int.from_bytes(hashlib.sha256(description.encode()).digest()[:6], "little")
    if _ADDRESS in description:
        while _NUMBERED.setdefault(number, function) is not function:
            number += 1
    return number


#: how Python shows what it knows by its place in memory only
_ADDRESS = " at 0x"


def described(given: Any) -> str:
    """What an object is, in words that are the same in every process where that is possible."""
    written = getattr(given, "py_func", given)  # of a compiled function
    code = getattr(written, "__code__", None)
    if code is None:
        return f"{type(given).__qualname__} {given!s}"
    constants = [each for each in code.co_consts if not isinstance(each, CodeType)]
    names = f"{written.__module__} {written.__qualname__} {code.co_firstlineno} {code.co_names} {constants!r}"
    held = [cell.cell_contents for cell in written.__closure__ or ()]
    around = [described(each) for each in (*held, *(written.__defaults__ or ()))]
    return f"{names} {code.co_code.hex()} {around}"


def _compiler(library: type[Optimised]) -> type[Compiler]:
    class Lean(Compiler):
        def __init__(self, typingctx: Any, targetctx: Any, given: Any, *rest: Any) -> None:
            super().__init__(typingctx, targetctx, given, *rest)
            self.state.library = library(targetctx.codegen(), library.__name__)

        def define_pipelines(self) -> Any:
            self.state.func_id.unique_id = number_of(self.state.func_id.func)
            found = super().define_pipelines()
            for manager in found:
                manager.passes = [(LEANER.get(each, each), told) for each, told in manager.passes]
                manager.finalize()
                if LEAN:
                    manager.__class__ = Passes
            return found

    return Lean


OPTIMISED, LEFT, ROLLED, SPLIT = map(_compiler, (Optimised, Left, Rolled, Split))
