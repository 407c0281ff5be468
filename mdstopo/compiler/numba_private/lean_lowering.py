"""From Numba's typed code to LLVM's, in half as many instructions: the time to compile goes with their number.

Numba's own `Lower` leaves the same to LLVM to find out. What is computed is the same, but for the last bits where
LLVM may fuse or reorder what it sees:

What a function got from its caller lives as long as the call. So neither it nor views of it are counted: a scene is a
tuple or structure of thirty arrays, each of which would be counted at every mention of it. The fields of a structure
are set when it is made, and never again.

A variable that is assigned once, before all its uses, is a value and needs no place in memory; and a part of a tuple
or array that has just been put together is known.

Numbers that index an array in C order become an address from the array's fields, not from a copy of them in memory.
So does another shape of one that a function got. A computed place does not count from the end.
"""

import functools
from typing import Any

from llvmlite import ir as llvm_ir
from numba import types
from numba.core import analysis, cgutils, ir
from numba.core.imputils import impl_ret_borrowed
from numba.core.lowering import Lower as NumbaLower
from numba.core.unsafe import eh
from numba.np.arrayobj import fix_integer_index, load_item, store_item

from mdstopo.compiler.instructions import Builder, prune
from mdstopo.compiler.numba_private.taught import field_of

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
        self._values.pop(name, None)  # its previous value, whose reference is released below, is read from memory
        if argidx is None and name not in self._singly_assigned_vars and not self._is_counted(name):
            self._alloca_var(name, self.typeof(name))
            self.builder.store(value, self.getvar(name))  # without a reference to release
        else:
            super().storevar(value, name, argidx)
        if name in self._held:
            self._values[name] = value

    def delvar(self, name: str) -> None:
        if self._is_counted(name):
            super().delvar(name)

    def lower_inst(self, inst: Any) -> None:
        kind = type(inst)
        if kind is ir.Del:
            self.delvar(inst.value)
        elif kind is not ir.Assign:
            super().lower_inst(inst)
        elif inst.target.name not in self._borrowed:
            self._assign(inst)
        else:
            self.context = self._plain
            try:
                self._assign(inst)
            finally:
                self.context = self._counting

    def _assign(self, inst: Any) -> None:
        """Numba's own also writes down each statement as text, which only `NUMBA_DEBUG_JIT` shows."""
        place: Any = self.loc
        self.debuginfo.mark_location(self.builder, place.line)
        self.notify_loc(place)
        value = self.lower_assign(self.typeof(inst.target.name), inst)
        argument = None
        if isinstance(inst.value, ir.Arg):
            self.debuginfo.mark_location(self.builder, self.defn_loc.line)
            argument = inst.value.index + 1
        self.storevar(value, inst.target.name, argidx=argument)

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
        value = self.builder.load(field_of(self.context, self.builder, kind, self._data_of(given), k))
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
