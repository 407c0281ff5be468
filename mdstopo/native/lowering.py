"""From Numba's typed code to LLVM's, in half as many instructions: the time to compile goes with their number.

Numba's own `Lower` leaves the same to LLVM to find out. What is computed is the same, but for the last bits where LLVM
may fuse or reorder what it sees:

What a function got from its caller lives as long as the call. So neither it nor views of it are counted: a scene is a
tuple or structure of thirty arrays, each of which would be counted at every mention of it. The fields of a structure
are set when it is made, and never again.

A variable that is assigned once, before all its uses, is a value and needs no place in memory; and a part of a tuple or
array that has just been put together is known.

Numbers that index an array in C order become an address from the array's fields, not from a copy of them in memory.
So does another shape of one that a function got.
"""

from typing import Any

from llvmlite.ir import Constant, IRBuilder
from llvmlite.ir.instructions import InsertValue
from numba.core import analysis, cgutils, ir, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.lowering import Lower as NumbaLower
from numba.experimental.structref import _Utils as _Structure
from numba.np.arrayobj import fix_integer_index, load_item, store_item

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
        self.builder = _Builder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def _find_singly_assigned_variable(self) -> None:
        """Those that need no place in memory; ones that are counted keep it, because they may be let go of twice."""
        super()._find_singly_assigned_variable()
        once = set() if self._lasting else assigned_once(self.blocks)
        self._held = {name for name in once if self._is_counted(name)} - self._singly_assigned_vars
        self._singly_assigned_vars |= once - self._held
        self._values: dict[str, Any] = {}

    def _is_counted(self, name: str) -> bool:
        return name not in self._borrowed and self.context.data_model_manager[self.typeof(name)].contains_nrt_meminfo()

    def loadvar(self, name: str) -> Any:
        held = self._values.get(name)
        return super().loadvar(name) if held is None else held

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        self._values.pop(name, None)  # what it held before, which is let go of, is read from memory
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
        if self.context is self._plain and expr.op == "getattr":
            kind = self.typeof(expr.value.name)
            if isinstance(kind, types.StructRef):
                return self._field(kind, self.loadvar(expr.value.name), expr.attr, resty)
        if self.context is self._plain and expr.op == "call":
            return self._reshaped(resty, expr)
        return super().lower_expr(resty, expr)

    def _field(self, kind: Any, given: Any, name: str, wanted: Any) -> Any:
        """A field of a structure that lives as long as the call, not counted."""
        fields = _Structure(self._counting, self.builder, kind).get_data_struct(given)
        return self.context.cast(self.builder, getattr(fields, name), kind.field_dict[name], wanted)

    def _reshaped(self, kind: Any, call: Any) -> Any:
        """An array in C order, in another shape, of which no length is -1; the numbers must be as many."""
        build = self.builder
        given = self.loadvar(call.func.name)
        shape = [size for each in call.args for size in self._index(each.name, _lengths(self.typeof(each.name)))]
        count = Constant(cgutils.intp_t, 1)
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
        kinds = self._numbers(value.name, array, wanted)
        if not kinds:
            return super().lower_getitem(resty, expr, value, index, signature)
        given = self.loadvar(value.name)
        address = self._address(array, given, kinds, self._index(index.name, wanted))
        if len(kinds) == array.ndim:
            found = load_item(self.context, self.builder, array, address)
        else:
            found = self._view(signature.return_type, given, address)
            found = impl_ret_borrowed(self.context, self.builder, signature.return_type, found)
        return self.context.cast(self.builder, found, signature.return_type, resty)

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
        if not isinstance(array, types.Array) or array.layout != "C" or self.context.enable_boundscheck:
            return ()
        if isinstance(self.typeof(name), types.Optional):
            return ()
        kinds = _kinds(wanted)
        fits = len(kinds) <= array.ndim and all(isinstance(kind, types.Integer) for kind in kinds)
        return kinds if fits else ()

    def _index(self, name: str, wanted: Any) -> list[Any]:
        """The numbers of an index."""
        value = self.context.cast(self.builder, self.loadvar(name), self.typeof(name), wanted)
        if not isinstance(wanted, types.BaseTuple):
            return [value]
        return [self.builder.extract_value(value, k) for k in range(len(wanted))]

    def _address(self, array: Any, given: Any, kinds: Any, index: Any) -> Any:
        """Where the item is, or the first one of the view; the arithmetic is Numba's own."""
        build = self.builder
        shape = [build.extract_value(given, [_SHAPE, k]) for k in range(array.ndim)]
        places = [fix_integer_index(self.context, build, *each) for each in zip(kinds, index, shape, strict=False)]
        data = build.extract_value(given, _DATA)
        return cgutils.get_item_pointer2(self.context, build, data, shape, (), "C", places)

    def _view(self, kind: Any, given: Any, address: Any) -> Any:
        """The array of the last dimensions of another."""
        build = self.builder
        first = len(given.type.elements[_SHAPE]) - kind.ndim
        shape = [build.extract_value(given, [_SHAPE, first + k]) for k in range(kind.ndim)]
        count = Constant(cgutils.intp_t, 1)
        for length in shape:
            count = build.mul(count, length, flags=["nsw"])
        made = build.insert_value(self.context.get_constant_undef(kind), address, _DATA)
        made = build.insert_value(made, count, _COUNT)
        for k in (_HOLDER, _PARENT, _SIZE):
            made = build.insert_value(made, build.extract_value(given, k), k)
        for k, length in enumerate(shape):
            made = build.insert_value(made, length, [_SHAPE, k])
            made = build.insert_value(made, build.extract_value(given, [_STRIDES, first + k]), [_STRIDES, k])
        return made


def _lengths(given: Any) -> Any:
    """The type of a shape, or of one of its lengths, as lengths are kept."""
    return types.UniTuple(types.intp, len(given)) if isinstance(given, types.BaseTuple) else types.intp


def _kinds(index: Any) -> tuple[Any, ...]:
    """The types of the parts of an index."""
    return tuple(index.types) if isinstance(index, types.BaseTuple) else (index,)  # type: ignore[attr-defined]


class _Builder(IRBuilder):  # type: ignore[misc]  # llvmlite is not typed
    """A writer of instructions that takes a part of a value from where it was put in, or was last taken."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self._taken: dict[Any, Any] = {}

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        places = list(idx) if isinstance(idx, (tuple, list)) else [idx]
        while places:
            put = _put_in(agg, places)
            if put is None:
                break
            agg, places = put.operands[1], places[len(put.indices) :]
        if not places:
            return agg
        key = id(self.block), id(agg), tuple(places)  # the instruction below keeps both alive
        if key not in self._taken:
            self._taken[key] = super().extract_value(agg, places, name)
        return self._taken[key]


def _put_in(value: Any, places: list[int]) -> Any:
    """The instruction that put in the part of a value at these places, whole or as part of more; else nothing."""
    while isinstance(value, InsertValue):
        at = list(value.indices)
        if at == places[: len(at)]:
            return value
        if at[: len(places)] == places:
            return None  # it is put together from parts
        value = value.operands[0]
    return None


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
