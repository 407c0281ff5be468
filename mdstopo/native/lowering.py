"""From Numba's typed code to LLVM's, with fewer instructions: they are what the time to compile goes with.

Two things differ from Numba's own `Lower`, and neither changes what is computed.

What a function got from its caller lives as long as the call, so neither it nor views of it are counted: a scene is a
tuple of thirty arrays, each of which would be counted at every mention of it.

Numbers that index an array in C order are turned into an address from the array's fields as values, not from a copy of
them in memory.
"""

from typing import Any

from llvmlite import ir as code
from numba.core import analysis, cgutils, ir, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.lowering import Lower as NumbaLower
from numba.np.arrayobj import fix_integer_index, load_item, store_item

#: places of an array's fields in Numba's structure of it
_HOLDER, _PARENT, _COUNT, _SIZE, _DATA, _SHAPE, _STRIDES = range(7)


class Lower(NumbaLower):
    """Numba's, with less to optimise away."""

    def init(self) -> None:
        self._borrowed = borrowed(self.blocks, self.fndesc.typemap)
        super().init()
        self._counting = self.context
        self._plain = self.context.subtarget(enable_nrt=False)
        self._plain.__dict__.pop("nrt", None)  # made for the other one, where it was made

    def setup_function(self, fndesc: Any) -> None:
        super().setup_function(fndesc)
        self.builder = _Builder(self.entry_block)
        self.call_helper = self.call_conv.init_call_helper(self.builder)

    def _find_singly_assigned_variable(self) -> None:
        super()._find_singly_assigned_variable()
        once = _reaching(self.blocks)
        self._held = {name for name in once if self._counts(name)} - self._singly_assigned_vars
        self._singly_assigned_vars |= once - self._held
        self._values: dict[str, Any] = {}

    def _counts(self, name: str) -> bool:
        return name not in self._borrowed and self.context.data_model_manager[self.typeof(name)].contains_nrt_meminfo()

    def loadvar(self, name: str) -> Any:
        held = self._values.get(name)
        return super().loadvar(name) if held is None else held

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        self._values.pop(name, None)
        super().storevar(value, name, argidx)
        if name in self._held:
            self._values[name] = value

    def delvar(self, name: str) -> None:
        if self._counts(name):
            super().delvar(name)

    def lower_inst(self, inst: Any) -> None:
        if isinstance(inst, ir.Assign):
            name = inst.target.name
        else:
            name = None
        if name not in self._borrowed:
            super().lower_inst(inst)
            return
        self.context = self._plain
        try:
            super().lower_inst(inst)
        finally:
            self.context = self._counting

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        array, wanted = signature.args
        kinds = _numbers(array, wanted)
        if not kinds or self.context.enable_boundscheck:
            return super().lower_getitem(resty, expr, value, index, signature)
        build, context = self.builder, self.context
        given = self.loadvar(value.name)
        places = self._places(index.name, wanted)
        shape = [build.extract_value(given, [_SHAPE, k]) for k in range(array.ndim)]
        address = _address(context, build, given, shape, kinds, places)
        rest = array.ndim - len(kinds)
        if rest == 0:
            found = load_item(context, build, array, address)
        else:
            found = impl_ret_borrowed(
                context, build, signature.return_type, _view(context, build, signature.return_type, given, address, shape[-rest:])
            )
        return context.cast(build, found, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        array, wanted, kind = signature.args
        kinds = _numbers(array, wanted)
        if not kinds or len(kinds) < array.ndim or self.context.enable_boundscheck:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        build, context = self.builder, self.context
        given = self.loadvar(target_var.name)
        value = context.cast(build, self.loadvar(value_var.name), self.typeof(value_var.name), kind)
        places = self._places(index_var.name, wanted)
        shape = [build.extract_value(given, [_SHAPE, k]) for k in range(array.ndim)]
        address = _address(context, build, given, shape, kinds, places)
        store_item(context, build, array, context.cast(build, value, kind, array.dtype), address)
        return None

    def _places(self, name: str, wanted: Any) -> list[Any]:
        """The numbers of an index."""
        value = self.context.cast(self.builder, self.loadvar(name), self.typeof(name), wanted)
        if not isinstance(wanted, types.BaseTuple):
            return [value]
        return [self.builder.extract_value(value, k) for k in range(len(wanted))]


class _Builder(code.IRBuilder):
    """A writer of instructions that knows the parts of what it has put together."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self._found: dict[Any, Any] = {}

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        places = list(idx) if isinstance(idx, (tuple, list)) else [idx]
        while places:
            made = agg
            while isinstance(made, code.instructions.InsertValue) and list(made.indices) != places[: len(made.indices)]:
                if list(made.indices)[: len(places)] == places:
                    break  # only a part of what is asked for
                made = made.operands[0]
            if not isinstance(made, code.instructions.InsertValue) or list(made.indices) != places[: len(made.indices)]:
                break
            agg, places = made.operands[1], places[len(made.indices) :]
        if not places:
            return agg
        key = id(self.block), id(agg), tuple(places)
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = super().extract_value(agg, places, name)
        return found


def _reaching(blocks: Any) -> set[str]:
    """Variables assigned once, at a place that every use comes after on all ways: a value, not a place in memory."""
    made: dict[str, list[int]] = {}
    for k, block in blocks.items():
        for inst in block.find_insts(ir.Assign):
            made.setdefault(inst.target.name, []).append(k)
    once = {name: places[0] for name, places in made.items() if len(places) == 1}
    before = analysis.compute_cfg_from_blocks(blocks).dominators()
    lost = set(analysis.must_use_alloca(blocks))
    for k, block in blocks.items():
        known = set()
        for inst in block.body:
            used = [] if isinstance(inst, ir.Del) else [each.name for each in inst.list_vars()]
            if isinstance(inst, ir.Assign):
                used.remove(inst.target.name)
            for name in used:
                start = once.get(name)
                if start is not None and not (name in known if start == k else start in before[k] and start < k):
                    lost.add(name)
            if isinstance(inst, ir.Assign):
                known.add(inst.target.name)
    return once.keys() - lost


def _numbers(array: Any, wanted: Any) -> tuple[Any, ...]:
    """The types of the numbers that index an array; none where it is not indexed by numbers, or not in C order."""
    if not isinstance(array, types.Array) or array.layout != "C":
        return ()
    kinds = tuple(wanted.types) if isinstance(wanted, types.BaseTuple) else (wanted,)
    return kinds if len(kinds) <= array.ndim and all(isinstance(kind, types.Integer) for kind in kinds) else ()


def _address(context: Any, build: Any, given: Any, shape: Any, kinds: Any, places: Any) -> Any:
    fixed = [fix_integer_index(context, build, *each) for each in zip(kinds, places, shape, strict=False)]
    return cgutils.get_item_pointer2(context, build, build.extract_value(given, _DATA), shape, (), "C", fixed)


def _view(context: Any, build: Any, kind: Any, given: Any, address: Any, shape: Any) -> Any:
    """The array of what is left when the first dimensions of another have been indexed."""
    made = context.get_constant_undef(kind)
    count = code.Constant(cgutils.intp_t, 1)
    for length in shape:
        count = build.mul(count, length, flags=["nsw"])
    for place, value in (
        (_HOLDER, build.extract_value(given, _HOLDER)),
        (_PARENT, build.extract_value(given, _PARENT)),
        (_COUNT, count),
        (_SIZE, build.extract_value(given, _SIZE)),
        (_DATA, address),
    ):
        made = build.insert_value(made, value, place)
    first = len(given.type.elements[_SHAPE]) - len(shape)
    for k, length in enumerate(shape):
        made = build.insert_value(made, length, [_SHAPE, k])
        made = build.insert_value(made, build.extract_value(given, [_STRIDES, first + k]), [_STRIDES, k])
    return made


def borrowed(blocks: Any, typemap: Any) -> set[str]:
    """Names of variables that only ever hold what the function was given, or parts and views of it."""
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


def _borrows(value: Any, names: set[str], typemap: Any) -> bool:
    if isinstance(value, (ir.Arg, ir.Const, ir.Global, ir.FreeVar)):
        return True
    if isinstance(value, ir.Var):
        return value.name in names
    if not isinstance(value, ir.Expr):
        return False
    if value.op == "build_tuple":
        return all(item.name in names for item in value.items)
    if value.op not in ("getattr", "getitem", "static_getitem", "exhaust_iter") or value.value.name not in names:
        return False
    kind = typemap[value.value.name]
    if isinstance(kind, types.BaseTuple):
        return True
    if not isinstance(kind, types.Array) or value.op not in ("getitem", "static_getitem"):
        return False
    index = value.index if value.op == "getitem" else value.index_var
    wanted = typemap[index.name] if index is not None else None
    kinds = wanted.types if isinstance(wanted, types.BaseTuple) else (wanted,)
    return all(isinstance(each, (types.Integer, types.SliceType)) for each in kinds)
