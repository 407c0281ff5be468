"""Everything that is private or undocumented in Numba and llvmlite, as far as this program uses it. Imports Numba.

`tried` decides whether this module serves: it is imported only with versions that it was tried with, and `check` then
compiles and calls a function that needs all of it. No other module may name anything of `numba.core`, `numba.np` or
`numba.experimental.structref._Utils`; `tests/compiler` looks after that.

In order: the shorter way from typed code to LLVM's (`Lower`), passes, libraries that make no machine code, the cache
of functions inside entries, kernels chosen by types, threads, what Numba is spared, the run time that machine code
needs, and an entry's machine code itself (`build`).
"""

import contextlib
import ctypes
import functools
import gc
import hashlib
import inspect
import os
import pickle
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MappingProxyType, ModuleType
from typing import Any

import numba
import numba.core.typing.cffi_utils  # here, while cffi and scipy are spared: see `kernel`
import numba.np.arraymath
import numba.np.arrayobj
import numpy as np
from llvmlite import binding as llvm
from llvmlite import ir as llvm_ir
from numba import types
from numba.core import (
    analysis,
    base,
    callconv,
    cgutils,
    consts,
    cpu_options,
    errors,
    ir,
    itanium_mangler,
    lowering,
    postproc,
    targetconfig,
    transforms,
    typeinfer,
)
from numba.core.caching import FunctionCache, _Cache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, Flags
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager, _pass_registry, register_pass
from numba.core.cpu import CPUContext
from numba.core.imputils import impl_ret_borrowed
from numba.core.lowering import Lower as NumbaLower
from numba.core.registry import CPUDispatcher, CPUTarget
from numba.core.runtime import _nrt_python  # type: ignore[attr-defined]
from numba.core.runtime.nrt import MemInfo
from numba.core.serialize import dumps
from numba.core.target_extension import CPU, dispatcher_registry, jit_registry, target_override, target_registry
from numba.core.targetconfig import ConfigStack
from numba.core.typed_passes import AnnotateTypes, BaseNativeLowering, NativeLowering, NopythonRewrites
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.core.unsafe import eh
from numba.core.untyped_passes import InlineClosureLikes
from numba.experimental import structref
from numba.experimental.jitclass.base import imp_dtor
from numba.extending import lower_builtin, overload, type_callable
from numba.np.arrayobj import fix_integer_index, load_item, store_item

from mdstopo.compiler import compiled_units as units
from mdstopo.compiler import threads
from mdstopo.compiler.entry import EXCUSE, LENGTHS, NUMBERS
from mdstopo.compiler.instructions import Builder, prune
from mdstopo.compiler.numba_plain import numba_type
from mdstopo.compiler.store import CALL, PREPARED, Code, cache_folder, read_checked, write_checked
from mdstopo.compiler.tried import UnexpectedError, has_own_passes

#: whether our passes over a function fit this version
_LEAN = has_own_passes()
#: of what is not typed
_ERRORS: Any = errors


# The way from typed code to LLVM's
# From Numba's typed code to LLVM's, in half as many instructions: the time to compile goes with their number.
#
# Numba's own `Lower` leaves the same to LLVM to find out. What is computed is the same, but for the last bits where
# LLVM may fuse or reorder what it sees:
#
# What a function got from its caller lives as long as the call. So neither it nor views of it are counted: a scene is a
# tuple or structure of thirty arrays, each of which would be counted at every mention of it. The fields of a structure
# are set when it is made, and never again.
#
# A variable that is assigned once, before all its uses, is a value and needs no place in memory; and a part of a tuple
# or array that has just been put together is known.
#
# Numbers that index an array in C order become an address from the array's fields, not from a copy of them in memory.
# So does another shape of one that a function got. A computed place does not count from the end.

#: what a step of a loop over `range` gives: a number, and whether there is one
_COUNTED = types.Pair(types.int64, types.boolean)

#: places of an array's fields in Numba's structure of it
_HOLDER, _PARENT, _COUNT, _SIZE, _DATA, _SHAPE, _STRIDES = range(7)


class Lower(NumbaLower):
    """Numba's, with less for LLVM to do away with."""

    def init(self) -> None:
        # a generator's variables outlive the call that sets them: they are kept between calls
        self._lasting = bool(self.func_ir.func_id.is_generator)
        self._borrowed = set() if self._lasting else borrowed(self.blocks, self.fndesc.typemap)
        self._counting = self.context
        self._plain = self.context.subtarget(enable_nrt=False)
        self._plain.__dict__.pop("nrt", None)  # the other one's counter, where it has been made
        super().init()

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        self.builder = Builder(self.entry_block)
        self.builder.catches = any(
            isinstance(inst.value, ir.Global) and inst.value.value is eh.mark_try_block
            for block in self.blocks.values()
            for inst in block.find_insts(ir.Assign)
        )
        self._data: dict[int, Any] = {}
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def lower_normal_function(self, fndesc: Any) -> None:
        """Write the function, without what nobody uses."""
        super().lower_normal_function(fndesc)
        prune(self.function)

    def _find_singly_assigned_variable(self) -> None:
        """Those that need no place in memory; ones that are counted keep it, because they may be let go of twice."""
        super()._find_singly_assigned_variable()
        once = set() if self._lasting else assigned_once(self.blocks)
        self._held = {name for name in once if self._is_counted(name)} - self._singly_assigned_vars
        self._singly_assigned_vars |= once - self._held
        self._values: dict[str, Any] = {}

    def _is_counted(self, name: str) -> bool:
        return name not in self._borrowed and _counts(self.context, self.typeof(name))

    def loadvar(self, name: str) -> Any:
        held = self._values.get(name)
        return super().loadvar(name) if held is None else held

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        self._values.pop(name, None)  # what it held before, which is let go of, is read from memory
        if argidx is None and name not in self._singly_assigned_vars and not self._is_counted(name):
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))  # nothing is let go of
        else:
            super().storevar(value, name, argidx)
        if name in self._held:
            self._values[name] = value

    def delvar(self, name: str) -> None:
        if self._is_counted(name):
            super().delvar(name)

    def lower_inst(self, inst: Any) -> None:
        if not isinstance(inst, ir.Assign) or inst.target.name not in self._borrowed:
            super().lower_inst(inst)
            return
        self.context = self._plain
        try:
            super().lower_inst(inst)
        finally:
            self.context = self._counting

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        if expr.op in ("getiter", "iternext", "pair_first", "pair_second"):
            found = self._counted_off(expr)
            if found is not None:
                return found
        if self.context is self._plain and expr.op == "getattr":
            kind = self.typeof(expr.value.name)
            if isinstance(kind, types.StructRef):
                return self._field(kind, self.loadvar(expr.value.name), expr.attr, resty)
        if self.context is self._plain and expr.op == "call":
            return self._reshaped(resty, expr)
        return super().lower_expr(resty, expr)

    def _counted_off(self, expr: Any) -> Any:
        """A step of a loop over `range` by a number that is written; nothing where it is something else.

        Numba's way, but without choosing what is known beforehand, and with values in place of structures in memory.
        """
        build, kind = self.builder, self.typeof(expr.value.name)
        if self._lasting or kind not in (_COUNTED, types.range_iter64_type, types.range_state64_type):
            return None
        given = self.loadvar(expr.value.name)
        if expr.op.startswith("pair"):
            return build.extract_value(given, int(expr.op == "pair_second"))
        if expr.op == "iternext":
            place, left = (build.extract_value(given, k) for k in (0, 3))
            count, value = build.load(left), build.load(place)
            build.store(build.sub(count, count.type(1), flags=["nsw"]), left)
            build.store(build.add(value, build.extract_value(given, 2)), place)
            goes_on = build.icmp_signed(">", count, count.type(0))
            return cgutils.pack_struct(build, (value, goes_on))
        start, stop, step = (build.extract_value(given, k) for k in range(3))
        if not isinstance(step, llvm_ir.Constant) or step.constant not in (1, -1):
            return None
        distance = build.sub(stop, start) if step.constant == 1 else build.sub(start, stop)
        zero = start.type(0)
        count = build.select(build.icmp_signed(">", distance, zero), distance, zero)
        place, left = (cgutils.alloca_once_value(build, value) for value in (start, count))
        return cgutils.pack_struct(build, (place, stop, step, left))

    def _field(self, kind: Any, given: Any, name: str, wanted: Any) -> Any:
        """A field of a structure that lives as long as the call, not counted."""
        k = self.context.data_model_manager[kind.get_data_type()].get_field_position(name)
        value = self.builder.load(_field_of(self.context, self.builder, kind, self._data_of(given), k))
        return self.context.cast(self.builder, value, kind.field_dict[name], wanted)

    def _data_of(self, given: Any) -> Any:
        """Where the fields of a structure are; of one that the function was given it is found out once."""
        held = self.builder.extract_value(given, 0)
        if id(held) in self._data:
            return self._data[id(held)]
        if not isinstance(held, llvm_ir.Argument):
            return self._counting.nrt.meminfo_data(self.builder, held)
        with self.builder.goto_entry_block():
            self._data[id(held)] = self._counting.nrt.meminfo_data(self.builder, held)
        return self._data[id(held)]

    def _reshaped(self, kind: Any, call: Any) -> Any:
        """An array in C order, in another shape, of which no length is -1; the numbers must be as many."""
        build = self.builder
        given = self.loadvar(call.func.name)
        shape = [size for each in call.args for size in self._index(each.name, _lengths(self.typeof(each.name)))]
        count = llvm_ir.Constant(cgutils.intp_t, 1)
        strides: list[Any] = []
        for length in reversed(shape):
            strides.insert(0, build.mul(count, build.extract_value(given, _SIZE)))
            count = build.mul(count, length)
        other = build.icmp_signed("!=", count, build.extract_value(given, _COUNT))
        with build.if_then(other, likely=False):
            self.call_conv.return_user_exc(build, ValueError, ("total size of new array must be unchanged",))
        made = self.context.get_constant_undef(kind)
        for k in (_HOLDER, _PARENT, _COUNT, _SIZE, _DATA):
            made = build.insert_value(made, build.extract_value(given, k), k)
        for k, pair in enumerate(zip(shape, strides, strict=True)):
            for place, value in zip((_SHAPE, _STRIDES), pair, strict=True):
                made = build.insert_value(made, value, [place, k])
        return made

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        array, wanted = signature.args
        made = signature.return_type
        kinds = self._numbers(value.name, array, wanted) or self._slices(value.name, array, wanted, made)
        if not kinds:
            return super().lower_getitem(resty, expr, value, index, signature)
        given, places = self.loadvar(value.name), self._index(index.name, wanted)
        count = None
        if kinds[-1] == types.slice2_type:
            start, count = self._span(places[-1], self.builder.extract_value(given, [_SHAPE, len(kinds) - 1]))
            kinds, places = (*kinds[:-1], types.intp), [*places[:-1], start]
        address = self._address(array, given, kinds, places, checked=len(places) - (count is not None))
        if len(kinds) == array.ndim and count is None:
            found = load_item(self.context, self.builder, array, address)
        else:
            found = self._view(made, given, address, count)
            found = impl_ret_borrowed(self.context, self.builder, made, found)
        return self.context.cast(self.builder, found, made, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        array, wanted, kind = signature.args
        kinds = self._numbers(target_var.name, array, wanted)
        if not kinds or len(kinds) < array.ndim:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        given = self.loadvar(target_var.name)
        value = self.context.cast(self.builder, self.loadvar(value_var.name), self.typeof(value_var.name), kind)
        address = self._address(array, given, kinds, self._index(index_var.name, wanted))
        store_item(
            self.context, self.builder, array, self.context.cast(self.builder, value, kind, array.dtype), address
        )

    def _numbers(self, name: str, array: Any, wanted: Any) -> tuple[Any, ...]:
        """The types of the numbers that index an array; none where something else does, or it is not in C order.

        Nor where the variable may also hold None: then it is more than the array.
        """
        if not isinstance(array, types.Array) or array.layout != "C":
            return ()
        if isinstance(self.typeof(name), types.Optional):
            return ()
        kinds = _kinds(wanted)
        fits = len(kinds) <= array.ndim and all(isinstance(kind, types.Integer) for kind in kinds)
        return kinds if fits else ()

    def _slices(self, name: str, array: Any, wanted: Any, made: Any) -> tuple[Any, ...]:
        """The types of numbers and a slice behind them, without a step, that cut an array out of one in C order."""
        kinds = _kinds(wanted)  # none: an array without dimensions
        if kinds[-1:] != (types.slice2_type,) or not isinstance(made, types.Array) or made.layout != "C":
            return ()
        return kinds if self._numbers(name, array, types.UniTuple(types.intp, len(kinds))) else ()

    def _span(self, given: Any, length: Any) -> tuple[Any, Any]:
        """Where a slice begins along a dimension, and how many it has; as in Python it may count from the end."""
        build = self.builder
        zero = length.type(0)
        ends = []
        for end in (build.extract_value(given, k) for k in (0, 1)):
            if isinstance(end, llvm_ir.Constant) and end.constant == types.intp.maxval:
                ends.append(length)
                continue
            for other in (build.add(end, length), zero):
                end = build.select(build.icmp_signed("<", end, zero), other, end)
            ends.append(build.select(build.icmp_signed("<", end, length), end, length))
        count = build.sub(ends[1], ends[0])
        return ends[0], build.select(build.icmp_signed(">", count, zero), count, zero)

    def _index(self, name: str, wanted: Any) -> list[Any]:
        """The numbers of an index."""
        value = self.context.cast(self.builder, self.loadvar(name), self.typeof(name), wanted)
        if not isinstance(wanted, types.BaseTuple):
            return [value]
        return [self.builder.extract_value(value, k) for k in range(len(wanted))]

    def _address(self, array: Any, given: Any, kinds: Any, index: Any, checked: int | None = None) -> Any:
        """Where the item is, or the first one of the view; the arithmetic is Numba's own.

        checked: of how many of the places NUMBA_BOUNDSCHECK asks; None: of all. The start of a slice may be its end.
        """
        build = self.builder
        shape = [build.extract_value(given, [_SHAPE, k]) for k in range(array.ndim)]
        places = [self._place(*each) for each in zip(kinds, index, shape, strict=False)]
        if self.context.enable_boundscheck:
            for place, length in list(zip(places, shape, strict=False))[:checked]:
                cgutils.do_boundscheck(self.context, build, place, length)
        data = build.extract_value(given, _DATA)
        return cgutils.get_item_pointer2(self.context, build, data, shape, (), "C", places)

    def _place(self, kind: Any, index: Any, length: Any) -> Any:
        """A place along one dimension. One that is written as a number may count from the end, a computed one may not.

        Code that asks of every place whether it counts from the end keeps loops from reading and writing vectors.
        """
        if isinstance(index, llvm_ir.Constant):
            place = fix_integer_index(self.context, self.builder, kind, index, length)
        else:
            place = self.context.cast(self.builder, index, kind, types.intp)
        return place

    def _view(self, kind: Any, given: Any, address: Any, count: Any = None) -> Any:
        """The array of the last dimensions of another, or of so many along the first of these."""
        build = self.builder
        first = len(given.type.elements[_SHAPE]) - kind.ndim
        shape = [build.extract_value(given, [_SHAPE, first + k]) for k in range(kind.ndim)]
        if count is not None:
            shape[0] = count
        size = llvm_ir.Constant(cgutils.intp_t, 1)
        for length in shape:
            size = build.mul(size, length, flags=["nsw"])
        made = build.insert_value(self.context.get_constant_undef(kind), address, _DATA)
        made = build.insert_value(made, size, _COUNT)
        for k in (_HOLDER, _PARENT, _SIZE):
            made = build.insert_value(made, build.extract_value(given, k), k)
        for k, length in enumerate(shape):
            made = build.insert_value(made, length, [_SHAPE, k])
            made = build.insert_value(made, build.extract_value(given, [_STRIDES, first + k]), [_STRIDES, k])
        return made


@functools.cache
def _counts(context: Any, kind: Any) -> bool:
    """Whether something of a type is, or holds, memory that counts who holds it."""
    return bool(context.data_model_manager[kind].contains_nrt_meminfo())


def _lengths(given: Any) -> Any:
    """The type of a shape, or of one of its lengths, as lengths are kept."""
    return types.UniTuple(types.intp, len(given)) if isinstance(given, types.BaseTuple) else types.intp


def _kinds(index: Any) -> tuple[Any, ...]:
    """The types of the parts of an index."""
    return tuple(index.types) if isinstance(index, types.BaseTuple) else (index,)  # type: ignore[attr-defined]


def assigned_once(blocks: Any) -> set[str]:
    """Names of variables with one assignment, which every use comes after on all ways."""
    made: dict[str, list[int]] = {}
    for k, block in blocks.items():
        for inst in block.find_insts(ir.Assign):
            made.setdefault(inst.target.name, []).append(k)
    once = {name: places[0] for name, places in made.items() if len(places) == 1}
    before = analysis.compute_cfg_from_blocks(blocks).dominators()
    others = set(analysis.must_use_alloca(blocks))
    for k, block in blocks.items():
        here = set()  # assigned in this block so far
        for inst in block.body:
            used = [] if isinstance(inst, ir.Del) else [each.name for each in inst.list_vars()]
            if isinstance(inst, ir.Assign):
                used.remove(inst.target.name)
            for name in used:
                start = once.get(name)
                # blocks are written by rising number
                if start is not None and not (name in here if start == k else start in before[k] and start < k):
                    others.add(name)
            if isinstance(inst, ir.Assign):
                here.add(inst.target.name)
    return once.keys() - others


def borrowed(blocks: Any, typemap: Any) -> set[str]:
    """Names of variables that only ever hold what the function was given, parts of it, and views of its arrays."""
    made: dict[str, list[Any]] = {}
    for block in blocks.values():
        for inst in block.find_insts(ir.Assign):
            made.setdefault(inst.target.name, []).append(inst.value)
    names = set(made)
    while True:
        others = {name for name in names if not all(_borrows(value, names, typemap) for value in made[name])}
        if not others:
            return names
        names -= others


def _reshapes(kind: Any) -> bool:
    """Whether a type is that of the method `reshape` of an array."""
    return isinstance(kind, types.BoundFunction) and bool(kind.typing_key == "array.reshape")


def _borrows(value: Any, names: set[str], typemap: Any) -> bool:
    if isinstance(value, (ir.Arg, ir.Const, ir.Global, ir.FreeVar)):
        return True
    if isinstance(value, ir.Var):
        return value.name in names
    if not isinstance(value, ir.Expr):
        return False
    if value.op == "build_tuple":
        return all(item.name in names for item in value.items)
    if value.op == "call":
        return value.func.name in names and _reshapes(typemap[value.func.name])
    if value.op not in ("getattr", "getitem", "static_getitem", "exhaust_iter") or value.value.name not in names:
        return False
    whole = typemap[value.value.name]
    if isinstance(whole, types.StructRef):
        return bool(value.op == "getattr")
    if isinstance(whole, types.BaseTuple):
        return True
    if value.op == "getattr":
        return isinstance(whole, types.Array) and whole.layout == "C" and bool(value.attr == "reshape")
    index = {"getitem": "index", "static_getitem": "index_var"}.get(value.op)
    if index is None or not isinstance(whole, types.Array) or getattr(value, index) is None:
        return False
    return all(
        isinstance(each, (types.Integer, types.SliceType)) for each in _kinds(typemap[getattr(value, index).name])
    )


# Passes over a function


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(BaseNativeLowering):
    """By our `Lower`."""

    _name = "mdstopo_lowering"  # type: ignore[assignment]
    lowering_class = Lower


@register_pass(mutates_CFG=True, analysis_only=False)
class _Rewrites(NopythonRewrites):
    """Only where there is something to rewrite: arithmetic with whole arrays."""

    _name = "mdstopo_rewrites"

    def run_pass(self, state: Any) -> bool:
        return any(_is_array_arithmetic(inst, state.typemap) for inst in _assignments(state)) and super().run_pass(
            state
        )


def _assignments(state: Any) -> Iterator[Any]:
    for block in state.func_ir.blocks.values():
        yield from block.find_insts(ir.Assign)


def _is_array_arithmetic(inst: Any, typemap: Any) -> bool:
    made = inst.value
    if not isinstance(made, ir.Expr) or not isinstance(typemap[inst.target.name], types.Array):
        return False
    if made.op == "call":
        return isinstance(getattr(typemap[made.func.name], "typing_key", None), np.ufunc)
    return made.op in ("binop", "inplace_binop", "unary")


@register_pass(mutates_CFG=True, analysis_only=False)
class _Closures(InlineClosureLikes):
    """Only where a function holds another."""

    _name = "mdstopo_closures"

    def run_pass(self, state: Any) -> bool:
        held = state.func_id.code.co_consts
        return any(isinstance(each, CodeType) for each in held) and super().run_pass(state)


@register_pass(mutates_CFG=False, analysis_only=True)
class _Unannotated(AnnotateTypes):
    """No listing of types beside the source."""

    _name = "mdstopo_unannotated"

    def run_pass(self, state: Any) -> bool:
        state.type_annotation = ""
        return False


#: ours, by the pass of Numba's that it takes the place of; none where they do not fit
_LEANER: dict[Any, Any] = {
    NativeLowering: _Lowering,
    NopythonRewrites: _Rewrites,
    InlineClosureLikes: _Closures,
    AnnotateTypes: _Unannotated,
}
if not _LEAN:
    _LEANER = {}

# Libraries
# What is kept of a function while an entry is compiled: its intermediate code without that of what it calls
# (`compiled_units`).
#
# Numba makes machine code of every function, and optimises each with all that it calls. Here only entries are called
# from outside. What an entry reaches is linked into it once, and a function at body level (`jit.kernel`) is optimised
# there; before, one of `general` is only made short. In entries for scenes with joints and other laws, long functions
# have machine code of their own, which all these entries share. A loop over members is optimised by itself, so that its
# vectors do not depend on who calls it, and once more where it is linked in; in the modules `units.STAYING` it stays as
# it is. Loops of entries are not unrolled.


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
        if not _LEAN or not units.is_of(self._symbol, (units.SPLIT,)):
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
        if not _LEAN:
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
                manager.passes = [(_LEANER.get(each, each), told) for each, told in manager.passes]
                manager.finalize()
                if _LEAN:
                    manager.__class__ = _Passes
            return found

    return Lean


_OPTIMISED, _LEFT, _ROLLED, _SPLIT = map(_compiler, (Optimised, Left, Rolled, Split))


def inner(function: Callable[..., Any], fastmath: frozenset[str], part: bool) -> Any:
    """Numba's object for a function that other compiled functions call."""
    found = _made(function, _OPTIMISED if fastmath else _LEFT, fastmath, part)
    found._cache = Cache(function)
    return found


def outer(function: Callable[..., Any], fastmath: frozenset[str]) -> Any:
    """Numba's object for an entry, for `build`; its machine code is kept by `store`."""
    way = _SPLIT if function.__module__.startswith(units.SPLIT) else _ROLLED
    return _made(function, _OPTIMISED if fastmath else way, fastmath, False)


def wrapped(function: Callable[..., Any], fastmath: frozenset[str]) -> Any:
    """Numba's object for a function that Python calls through Numba's own wrapper; it is not kept on the disk."""
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": set(fastmath) or False, "_target": _TARGET}
    return numba.njit(**options)(function)


def _made(function: Callable[..., Any], pipeline: type[Compiler], fastmath: frozenset[str], part: bool) -> Any:
    # Wrappers for calls from Python cost a large part of the compilation, so nothing has one.
    options: dict[str, Any] = {"no_cfunc_wrapper": True, "no_cpython_wrapper": True, "pipeline_class": pipeline}
    options |= {"error_model": "numpy", "fastmath": set(fastmath) or False, "forceinline": part, "_target": _TARGET}
    return numba.njit(**options)(function)


class _Reader:
    """Numba's target, reading libraries of this kind."""

    def __init__(self, target: Any) -> None:
        self._target = target

    def __getattr__(self, name: str) -> Any:
        return getattr(self._target, name)

    def codegen(self) -> "_Reader":
        return self

    def unserialize_library(self, kept: tuple[str, str, str]) -> Optimised:
        library = Optimised(self._target.codegen(), kept[0])
        library.take_unit(units.kept(kept[2]))
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
            return CompileResult._rebuild(_Reader(target_context), *pickle.loads(kept))
        except Exception:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep it where that is possible."""
        if any(not each.can_cache for each in data.lifted) or data.library.has_dynamic_globals:
            return
        try:
            whole = self._read()
            whole[self._key(sig, data.codegen)] = dumps(data._reduce())
            write_checked(self._path, dumps(whole))
        except Exception:
            return

    def _read(self) -> dict[Any, bytes]:
        """All that is kept of the function, by its key."""
        data = read_checked(self._path)
        found = {} if data is None else pickle.loads(data)
        return found if isinstance(found, dict) else {}

    def _key(self: Any, sig: Any, codegen: Any) -> Any:
        """Types, processor, the function's bytecode and closure, and the file that it stands in."""
        key = FunctionCache._index_key(self, sig, codegen)
        return (*key, _source(inspect.getfile(self._py_func)))

    def enable(self) -> None:
        """Do nothing: this cache is always enabled."""

    def disable(self) -> None:
        """Not needed."""

    def flush(self) -> None:
        """Forget it."""
        self._path.unlink(missing_ok=True)


# Kernels chosen by types


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


# Structures


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
            build.store(field, _field_of(context, build, whole, data, k))
        return cgutils.pack_struct(build, [held])


def _field_of(context: Any, build: Any, kind: Any, data: Any, k: int) -> Any:
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


# Threads

_WORD, _SMALL, _MEMORY = llvm_ir.IntType(64), llvm_ir.IntType(32), llvm_ir.IntType(8).as_pointer()
_BODY = llvm_ir.FunctionType(_MEMORY, [_MEMORY])
#: the system's threads: `pthread_create(name, attributes, body, argument)`, `pthread_join(name, result)`
_CREATE = llvm_ir.FunctionType(_SMALL, [_WORD.as_pointer(), _MEMORY, _BODY.as_pointer(), _MEMORY])
_JOIN = llvm_ir.FunctionType(_SMALL, [_WORD, _MEMORY.as_pointer()])


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
        most = llvm_ir.Constant(_WORD, threads.MOST)
        fits = build.icmp_signed("<", wanted, most)
        self._count = build.sub(build.select(fits, wanted, most), llvm_ir.Constant(_WORD, 1))
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


# What Numba is spared
# It asks again and again what the sum of two floats is, trying dozens of candidates each time; and it makes machine
# code of every little function of its own that a kernel calls, though a kernel holds a copy of what it calls.
#
# Both is changed for our kernels only. They are compiled for a target of their own, which is Numba's processor by
# another name: it has its own tables of what has been compiled. So a kernel's code is the same whoever else uses Numba
# in this process, and nobody else's is changed by us.


class _Target(CPU):
    """The processor, for our kernels."""


_TARGET = "mdstopo"


class _Calls(callconv.CPUCallConv):
    """Numba's convention of calls, in fewer instructions."""

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
        if not _LEAN:
            return super()._compile_subroutine_no_cache(builder, impl, sig, locals, flags)
        if flags is None:
            flags, above = Flags(), ConfigStack()
            flags.nrt = bool(above) and above.top().is_set("nrt") and above.top().nrt
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        compiler = _LEFT(self.typing_context, self, None, sig.args, sig.return_type, flags, locals or {})
        with global_compiler_lock:
            made = compiler.compile_extra(impl)
        self.active_code_library.add_linking_library(made.library)
        return made


class _OwnTarget(CPUTarget):
    """The target of our kernels, with its own context."""

    @functools.cached_property
    def _toplevel_target_context(self) -> CPUContext:
        return _Context(self.typing_context, self._target_name)


class _Dispatcher(CPUDispatcher):
    """Numba's object for a function that is compiled for our target."""

    targetdescr = _OwnTarget(_TARGET)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a call is of. A number that is written in the call has the type of any other: Numba would compile the
        function once more for every such number. Where sums may be reordered it does, for their order may depend on
        numbers that are known."""
        if _LEAN and not self.targetoptions.get("fastmath"):
            args, kws = tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(args, kws)

    def compile(self, sig: Any) -> Any:
        """Compile for these types. What calls in it are of is found out for our target, too, where Numba asks late."""
        with target_override(_TARGET):
            return super().compile(sig)


def _jit_without_code(*given: Any, **options: Any) -> Any:
    """How a function of Numba's own is compiled where our kernels call it: without machine code."""
    return numba.jit(*given, **{"no_cfunc_wrapper": True, "pipeline_class": _LEFT, "_target": _TARGET, **options})


def _enter_sizes() -> None:
    """What is said where a part of an array is given numbers of another size, without the sizes: how they are written
    would be compiled in every process."""

    def without(given: Any, place: Any) -> Any:
        def impl(given: Any, place: Any) -> None:
            raise ValueError("cannot assign slice from input of different size")

        return impl

    arrays: Any = numba.np.arrayobj
    overload(arrays.raise_with_shape_context, target=_TARGET)(without)


def _enter_target() -> None:
    target_registry[_TARGET] = _Target
    dispatcher_registry[_Target] = _Dispatcher
    jit_registry[_Target] = _jit_without_code if _LEAN else functools.partial(numba.jit, _target=_TARGET)


_LASTING = (types.Number, types.Boolean, types.Literal, types.Array, types.BaseTuple)


def _spare_registries() -> None:
    """Before every function Numba imports all that may have something to register: at the first one is enough, and
    then what has been registered since is taken from those that it came to."""
    for context in (_Dispatcher.targetdescr.typing_context, _Dispatcher.targetdescr.target_context):
        _load_once(context)


def _load_once(context: Any) -> None:
    whole = context.load_additional_registries
    known: list[Any] = []

    def load() -> None:
        if not known:
            whole()
            known.extend(context._registries)
        for each in known:
            context.install_registry(each)

    context.load_additional_registries = load


def _remember_signatures() -> None:
    """What operators give for numbers, arrays and tuples of them is looked for once."""
    function: Any = types.Function
    ask = function.get_call_type
    known: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, asked: Any, named: Any) -> Any:
        lasting = _is_operator(self.typing_key)
        ours = context is _Dispatcher.targetdescr.typing_context
        if not (lasting and ours) or named or not all(isinstance(each, _LASTING) for each in asked):
            return ask(self, context, asked, named)
        key = self, asked if isinstance(asked, tuple) else tuple(asked)
        found = known.get(key)
        if found is None:
            found = known[key] = ask(self, context, asked, named)
        return found

    function.get_call_type = get_call_type


def _name_flags_in_order() -> None:
    """Symbols have the flags of fast arithmetic in them: sorted, because the order of a set differs by process."""
    options: Any = cpu_options.FastMathOptions
    options.encode = lambda self: str(sorted(self.flags))


def _shorten_symbols() -> None:
    """A structure is in the symbols of all functions that are given one: by a hash of its name, which has the types of
    all its fields."""
    structure: Any = types.StructRef
    structure.mangling_args = property(
        lambda self: (f"{type(self).__name__}_{hashlib.sha256(self.name.encode()).hexdigest()[:16]}", ())
    )


def _spare_flags() -> None:
    """Flags of functions are looked up and compared at every call, option by option. Of those that were set only the
    ones count that differ from the defaults."""
    config: Any = targetconfig.TargetConfig

    @functools.cache
    def defaults(kind: Any) -> dict[str, Any]:
        return {key: option.default for key, option in kind.options.items()}

    def values(self: Any) -> dict[str, Any]:
        return {**defaults(self.__class__), **self._values}

    def changed(self: Any) -> dict[str, Any]:
        usual = defaults(self.__class__)
        return {key: value for key, value in self._values.items() if value != usual[key]}

    def is_equal(self: Any, other: Any) -> Any:
        if not isinstance(other, config):
            return NotImplemented
        if type(self) is not type(other):
            return self.values() == other.values()
        return self._values == other._values or changed(self) == changed(other)

    @functools.cache
    def hash_of(kind: Any) -> int:
        return hash(tuple(kind.options))

    config.values, config.__eq__, config.__hash__ = values, is_equal, lambda self: hash_of(self.__class__)


def _spare_variables() -> None:
    """Which variables a statement mentions is asked again and again: what by its type can hold none is passed over."""
    instruction: Any = ir.Inst
    found_in, variable = instruction._rec_list_vars, ir.Var
    others = frozenset({ir.Loc, str, int, float, bool, type(None)})

    def variables(self: Any, held: Any) -> list[Any]:
        kind = type(held)
        if kind is variable:
            return [held]
        if kind in others:
            return []
        if kind is not dict and kind is not tuple and kind is not list:
            return list(found_in(self, held))
        found = []
        for each in held.values() if kind is dict else held:
            if type(each) is variable:
                found.append(each)
            elif type(each) not in others:
                found += variables(self, each)
        return found

    instruction._rec_list_vars = variables


def _spare_globals() -> None:
    """A function or module that a kernel names is looked for first among those that Numba knows: it is nothing else."""
    context: Any = _Dispatcher.targetdescr.typing_context
    ask, known = context.resolve_value_type, context._get_global_type

    def resolve(value: Any) -> Any:
        if isinstance(value, (FunctionType, BuiltinFunctionType, ModuleType)) and not hasattr(value, "_numba_type_"):
            found = known(value)
            if found is not None:
                return found
        return ask(value)

    context.resolve_value_type = resolve


def _spare_lifetimes() -> None:
    """After most passes over a function nobody asks which variables live where: it is found out when somebody does."""
    processor: Any = postproc.PostProcessor
    whole = processor.run

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        function = self.func_ir
        if emit_dels or function.is_generator:
            whole(self, emit_dels, extend_lifetimes)
            return
        function.blocks = transforms.canonicalize_cfg(function.blocks)
        function.variable_lifetime = postproc.VariableLifetime(function.blocks)
        function.generator_info = None

    processor.run = run


def _spare_failures() -> None:
    """Numba asks of every index whether it is constant, and is told by an error where it is not: one that is no text
    with the lines of the source."""

    def begin(self: Any, value: Any, loc: Any = None) -> None:
        Exception.__init__(self, value)
        self.msg, self.loc = value, loc

    def fail(_self: Any, value: Any) -> Any:
        raise _ERRORS.ConstantInferenceError(value)

    inference: Any = consts.ConstantInference
    _ERRORS.ConstantInferenceError.__init__, inference._fail = begin, fail


def _spare_classes() -> None:
    """Classes of types are abstract ones, of which Python asks what else was registered for them: nothing is."""
    kind: Any = type(types.Type)
    kind.__instancecheck__ = type.__instancecheck__


def _spare_contexts() -> None:
    """What an error is told to have happened in is put together where there is an error."""
    given: Any = _ERRORS.new_error_context

    class Context:
        """Numba's own, made when it is needed."""

        __slots__ = ("_named", "_parts")

        def __init__(self, *parts: Any, **named: Any) -> None:
            self._parts, self._named = parts, named
            place = named.get("loc")
            if place is not None and not place.filename.startswith(_ERRORS._numba_path):
                _ERRORS.loc_info.update(named)

        def __enter__(self) -> None:
            pass

        def __exit__(self, kind: Any, error: Any, trace: Any) -> Any:
            if kind is None:
                return None
            told = given(*self._parts, **self._named)
            told.__enter__()
            return told.__exit__(kind, error, trace)

    modules: list[Any] = [errors, typeinfer, lowering]
    for module in modules:
        module.new_error_context = Context


def _spare_ranges() -> None:
    """Lengths are said to be positive where they are read from memory; ours may come from elsewhere."""
    arrays: Any = numba.np.arrayobj
    say = arrays.set_range_metadata

    def said(build: Any, value: Any, *bounds: Any) -> None:
        if isinstance(value, llvm_ir.LoadInstr):
            say(build, value, *bounds)

    arrays.set_range_metadata = said


def _spare_places() -> None:
    """Whether a function takes `loc` is seen in its code; what is made of others is asked as before."""
    implementations: Any = base
    ask = implementations._has_loc

    def has(function: Any) -> bool:
        code = getattr(function, "__code__", None)
        if code is None or hasattr(function, "__wrapped__") or hasattr(function, "__signature__"):
            return bool(ask(function))
        return "loc" in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]

    implementations._has_loc = has


class _Settled:
    """A call in rounds of `_spare_rounds`."""

    __slots__ = ("call", "known", "names")

    def __init__(self, call: Any) -> None:
        self.call = call
        self.known: list[Any] | None = None
        given = [*call.args, *dict(call.kws).values()] + ([] if call.vararg is None else [call.vararg])
        self.names = [call.target, *(each.name for each in given)]
        if type(call) is typeinfer.CallConstraint:
            self.names.append(call.func)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.call, name)

    def __call__(self, infer: Any) -> None:
        if infer.context is not _Dispatcher.targetdescr.typing_context:
            self.call(infer)
        elif self.known is None or self.known != self._types(infer):
            self.known = None
            self.call(infer)
            found, now = self.call.signature, self._types(infer)
            if found is not None and found.return_type.is_precise() and self._lasts(now):
                self.known = now

    def _types(self, infer: Any) -> list[Any]:
        """Of what it returns, of what it is given, and where it has a name of what is called."""
        return [infer.typevars[name].type for name in self.names]

    def _lasts(self, now: list[Any]) -> bool:
        """Whether the same is found for the same types, whenever it is looked for."""
        if type(self.call) is typeinfer.CallConstraint:
            return isinstance(now[-1], types.Dispatcher)
        return all(isinstance(each, _LASTING) for each in now)


def _spare_rounds() -> None:
    """Types are inferred in rounds until nothing changes. A call of one of our kernels, or of an operator, is not
    looked up once more where what it is given and what it is known to return are as they were after it was.

    Functions of Numba's own are: which one is called where several fit is what was looked up last.
    """
    network: Any = typeinfer.ConstraintNetwork
    called, operated = typeinfer.CallConstraint, typeinfer.IntrinsicCallConstraint

    def append(self: Any, constraint: Any) -> None:
        lasts = type(constraint) is called or (type(constraint) is operated and _is_operator(constraint.func))
        self.constraints.append(_Settled(constraint) if lasts else constraint)

    network.append = append


def _is_operator(function: Any) -> bool:
    return getattr(function, "__module__", None) == "_operator"


class _Passes(PassManager):
    """Passes over a function of ours: nobody listens to them or asks how long each took."""

    def _runPass(self, index: int, each: Any, state: Any) -> None:
        each.analysis = self._analysis
        with _ERRORS.new_error_context("Pass {name}", name=each.name()):
            changed = [step(state) for step in (each.run_initialization, each.run_pass, each.run_finalizer)]
        if not _pass_registry.get(each.__class__).mutates_CFG:
            return
        if any(changed):
            postproc.PostProcessor(state.func_ir).run()
        else:
            state.func_ir.blocks = transforms.canonicalize_cfg(state.func_ir.blocks)


_enter_target()
_name_flags_in_order()
if _LEAN:
    _enter_sizes()
    _shorten_symbols()
    _spare_registries()
    _remember_signatures()
    _spare_flags()
    _spare_variables()
    _spare_lifetimes()
    _spare_failures()
    _spare_globals()
    _spare_classes()
    _spare_contexts()
    _spare_places()
    _spare_ranges()
    _spare_rounds()
    names: Any = itanium_mangler
    names._escape_string = functools.lru_cache(1 << 16)(names._escape_string)


# Run time
# What compiled code expects of Numba's run time: memory that counts who holds it, and the shapes of views.
#
# Numba's own is reached by importing Numba. These few functions do the same on the memory of C, and are kept with the
# code. An allocation begins with Numba's header (count, destructor, its information, data, size, allocator), of which
# the code itself reads the count and the place of the data.

#: what `add_runtime` defines
PROVIDED = frozenset(
    {
        "NRT_Allocate",
        "NRT_Free",
        "NRT_MemInfo_alloc",
        "NRT_MemInfo_alloc_aligned",
        "NRT_MemInfo_alloc_dtor",
        "NRT_MemInfo_call_dtor",
        "NRT_MemInfo_new_varsize_dtor",
        "NRT_MemInfo_varsize_realloc",
        "numba_attempt_nocopy_reshape",
    }
)
_HEADER = 48


def add_runtime(module: Any) -> None:
    """Define `PROVIDED` in a module of llvmlite.code."""
    byte, word, small = llvm_ir.IntType(8), llvm_ir.IntType(64), llvm_ir.IntType(32)
    memory = byte.as_pointer()
    nothing = llvm_ir.VoidType()
    malloc = llvm_ir.Function(module, llvm_ir.FunctionType(memory, [word]), "malloc")
    realloc = llvm_ir.Function(module, llvm_ir.FunctionType(memory, [memory, word]), "realloc")
    free = llvm_ir.Function(module, llvm_ir.FunctionType(nothing, [memory]), "free")
    destructor = llvm_ir.FunctionType(nothing, [memory, word, memory]).as_pointer()

    def define(name: str, result: Any, arguments: list[Any]) -> tuple[Any, Any]:
        function = llvm_ir.Function(module, llvm_ir.FunctionType(result, arguments), name)
        return function, llvm_ir.IRBuilder(function.append_basic_block())

    def field(build: Any, header: Any, k: int, kind: Any) -> Any:
        return build.bitcast(build.gep(header, [word(8 * k)]), kind.as_pointer())

    def checked(build: Any, address: Any) -> Any:
        """An address; null ends the function with null: there is no memory."""
        with build.if_then(build.icmp_unsigned("==", address, memory(None))):
            build.ret(memory(None))
        return address

    def enter(build: Any, header: Any, data: Any, size: Any, made_by: Any) -> None:
        values = word(1), made_by, memory(None), data, size, memory(None)
        for k, value in enumerate(values):
            build.store(value, field(build, header, k, value.type))

    def allocate(build: Any, size: Any, align: Any, made_by: Any) -> None:
        """Header and data in one piece, the data at a multiple of `align`."""
        header = checked(build, build.call(malloc, [build.add(size, build.add(align, word(_HEADER)))]))
        least = build.add(build.ptrtoint(header, word), word(_HEADER))
        data = build.and_(build.add(least, build.sub(align, word(1))), build.neg(align))
        enter(build, header, build.inttoptr(data, memory), size, made_by)
        build.ret(header)

    function, build = define("NRT_Allocate", memory, [word])
    build.ret(build.call(malloc, [function.args[0]]))

    function, build = define("NRT_Free", nothing, [memory])
    build.call(free, [function.args[0]])
    build.ret_void()

    function, build = define("NRT_MemInfo_alloc", memory, [word])
    allocate(build, function.args[0], word(16), destructor(None))

    function, build = define("NRT_MemInfo_alloc_aligned", memory, [word, small])
    allocate(build, function.args[0], build.zext(function.args[1], word), destructor(None))

    function, build = define("NRT_MemInfo_alloc_dtor", memory, [word, destructor])
    allocate(build, function.args[0], word(16), function.args[1])

    # a list: its data apart from the header, where it can grow
    loose, build = define("mdstopo_free_list", nothing, [memory, word, memory])
    of_items = llvm_ir.FunctionType(nothing, [memory]).as_pointer()
    with build.if_then(build.icmp_unsigned("!=", loose.args[2], memory(None))):
        build.call(build.bitcast(loose.args[2], of_items), [loose.args[0]])
    build.call(free, [loose.args[0]])
    build.ret_void()

    function, build = define("NRT_MemInfo_new_varsize_dtor", memory, [word, memory])
    data = checked(build, build.call(malloc, [function.args[0]]))
    header = checked(build, build.call(malloc, [word(_HEADER)]))
    enter(build, header, data, function.args[0], loose)
    build.store(function.args[1], field(build, header, 2, memory))
    build.ret(header)

    function, build = define("NRT_MemInfo_varsize_realloc", memory, [memory, word])
    header, size = function.args
    data = checked(build, build.call(realloc, [build.load(field(build, header, 3, memory)), size]))
    build.store(data, field(build, header, 3, memory))
    build.store(size, field(build, header, 4, word))
    build.ret(data)

    function, build = define("NRT_MemInfo_call_dtor", nothing, [memory])
    header = function.args[0]
    called = build.load(field(build, header, 1, destructor))
    with build.if_then(build.icmp_unsigned("!=", called, destructor(None))):
        parts = [(3, memory), (4, word), (2, memory)]
        build.call(called, [build.load(field(build, header, k, kind)) for k, kind in parts])
    build.call(free, [header])
    build.ret_void()

    _reshape(*define(
        "numba_attempt_nocopy_reshape",
        small,
        [word, word.as_pointer(), word.as_pointer(), word, word.as_pointer(), word.as_pointer(), word, small],
    ))  # fmt: skip


def _reshape(function: Any, build: Any) -> None:
    """Strides of a view in C order of another shape; 0 where the array does not lie in C order, or has another size."""
    word, small = llvm_ir.IntType(64), llvm_ir.IntType(32)
    n, shape, strides, n_new, shape_new, strides_new, item, fortran = function.args
    with build.if_then(build.icmp_signed("!=", fortran, small(0))):
        build.ret(small(0))

    def from_last(count: Any, visit: Any) -> Any:
        """Run through the dimensions from the last; `visit(k, stride)` sees each; the size in bytes comes out."""
        place, stride = build.alloca(word), build.alloca(word)
        build.store(count, place)
        build.store(item, stride)
        head, body, after = (build.append_basic_block() for _ in range(3))
        build.branch(head)
        build.position_at_end(head)
        build.cbranch(build.icmp_signed(">", build.load(place), word(0)), body, after)
        build.position_at_end(body)
        k = build.sub(build.load(place), word(1))
        build.store(k, place)
        build.store(build.mul(build.load(stride), visit(k, build.load(stride))), stride)
        build.branch(head)
        build.position_at_end(after)
        return build.load(stride)

    def length(k: Any, stride: Any) -> Any:
        return build.load(build.gep(shape, [k]))

    def checked(k: Any, stride: Any) -> Any:
        size = build.load(build.gep(shape, [k]))
        other = build.icmp_signed("!=", build.load(build.gep(strides, [k])), stride)
        with build.if_then(build.and_(other, build.icmp_signed("!=", size, word(1)))):
            build.ret(small(0))
        return size

    def entered(k: Any, stride: Any) -> Any:
        build.store(stride, build.gep(strides_new, [k]))
        return build.load(build.gep(shape_new, [k]))

    full = build.icmp_signed("!=", from_last(n, length), word(0))
    with build.if_then(full):  # an array without elements lies in any order
        from_last(n, checked)
    same = build.icmp_signed("==", from_last(n, length), from_last(n_new, entered))
    build.ret(build.zext(same, small))


# An entry's machine code
# An entry compiled by Numba, as machine code that needs neither Numba nor Python's interface.
#
# Numba's function takes each array as seven or more arguments. `_glue` writes the function that unfolds the block of
# numbers which `compiler.call` fills into those, and what the code expects of Numba's run time (`runtime`).


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


# The check


def check() -> None:
    """Compile a function that uses what is private, and call it. Raises UnexpectedError where something is wrong.

    Once for these sources and versions on this machine.
    """
    passed = cache_folder() / "numba.checked"
    if passed.exists():
        return
    _check_header()
    _check_code(_probe())
    write_checked(passed, b"")


def _expect(clause: str, found: Any, expected: Any) -> None:
    if found != expected:
        raise UnexpectedError(f"{clause}: {found!r}, not {expected!r}")


def _check_header() -> None:
    """Whether an allocation of Numba's begins as one by `add_runtime` does."""
    size = 40
    address = _nrt_python.meminfo_alloc(size)
    held = MemInfo(address)
    words = (ctypes.c_int64 * (_HEADER // 8)).from_address(address)
    found = words[0], words[3], words[4]
    _expect("the header of an allocation holds count, data, size as", found, (1, held.data, size))


def _probe_inner(x: Any, k: int) -> Any:
    made = np.zeros((3, x.shape[0]))
    for i in range(x.shape[0]):
        made[1, i] = k * x[i]
        made[-1, i] = made[1][i] + 1.0
    return made[1]


def _probe_pass(counter: Any, done: Any) -> None:
    k = _probe_taken(counter)
    while k < done.size:
        done[k] += k
        k = _probe_taken(counter)


def _probe_taken(counter: Any) -> int:
    raise NotImplementedError


def _probe_shared(kernel: Any, count: int, job: Any) -> None:
    raise NotImplementedError


def _probe_chosen(x: Any, k: int) -> Any:
    raise NotImplementedError


class _ProbePair:
    """What makes the structure of the probe."""

    row: Any
    table: Any

    def __init__(self, *_fields: Any) -> None: ...


class _ProbeStructure(types.StructRef):
    """Its type."""


class _Chosen:
    """What `offer` takes for a kernel."""

    def __init__(self, dispatcher: Any) -> None:
        self.dispatcher = dispatcher


def _probe() -> Any:
    """Numba's object for a function with all that our kernels have in them."""
    chosen = _Chosen(_made(_probe_inner, _LEFT, frozenset(), False))
    shared_pass = _made(_probe_pass, _OPTIMISED, frozenset({"nsz"}), False)
    offer(_probe_chosen, lambda _x, _k: chosen)
    enter_threads(_probe_shared, _probe_taken)
    structref.register(_ProbeStructure)
    enter_structure(_ProbePair, _ProbeStructure, ("row", "table"))

    def probe(tag, x, table, yes, counter, done, how):  # type: ignore[no-untyped-def]
        """What is compiled and then called to see whether machine code does what is written.

        tag: two integers; the second says how many copies a list gets.
        x (n,): numbers that another compiled function is called with.
        table (2, 2): its second entry is written.
        yes: a truth, a part of what comes back.
        counter (1,): what threads take pieces of work from.
        done (9,): what they write.
        how: 1 raises ValueError.
        """
        pair = _ProbePair(_probe_chosen(x, 2), table)
        row = pair.row
        if how == 1:
            raise ValueError("asked for")
        _probe_shared(shared_pass, 2, (counter, done))
        listed = [x[1:].copy()]
        for _ in range(tag[1]):
            listed.append(row.copy())  # noqa: PERF401  (one after another, so that it grows)
        pair.table.reshape(table.size)[1] = listed[-1].sum()
        return table[0, -1], len(listed) + done.sum(), yes and row[0] < 1.0

    return outer(probe, frozenset())


def _check_code(dispatcher: Any) -> None:
    """Whether that function's machine code does what is written."""
    from mdstopo.compiler.call import Native

    kinds = "t2 d1 d2 b q1 q1 i"
    made = build(dispatcher, kinds)
    if made is None:
        raise UnexpectedError("machine code asks for functions that it did not ask for before")
    native = Native("probe", made, kinds)
    x, table, counter, done = np.arange(4.0), np.zeros((2, 2)), np.zeros(1, np.int64), np.zeros(9, np.int64)
    given = (0, 50), x, table, True, counter, done
    _expect("a compiled function returned", native(*given, 0), (12.0, 51 + 36, True))
    _expect("and wrote", (done.tolist(), table.tolist()), (list(range(9)), [[0.0, 12.0], [0.0, 0.0]]))
    _expect("called once more, it returned", native.prepare(*given, 0)(), (12.0, 51 + 36, True))
    try:
        native(*given, 1)
    except ValueError as error:
        _expect("it raised", str(error), "asked for")
    else:
        raise UnexpectedError("what a compiled function raises does not arrive")
