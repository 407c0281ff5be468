"""Writing LLVM's instructions without those that do nothing.

Numba keeps small structures (an array's fields, a slice, a loop's state) on the stack, writes each before it is read,
and computes what nobody asks for. LLVM finds all this out; but to write, print and read an instruction takes longer
than to see that it is not needed. What is computed is the same.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable
from typing import Any

from llvmlite import ir

#: instructions that do nothing but have a value
_PURE = frozenset(
    {
        "add", "alloca", "and", "ashr", "bitcast", "extractelement", "extractvalue", "fadd", "fcmp", "fdiv", "fmul",
        "fneg", "fptosi", "fsub", "getelementptr", "icmp", "insertelement", "insertvalue", "inttoptr", "load", "lshr",
        "mul", "or", "phi", "ptrtoint", "select", "sext", "shl", "shufflevector", "sitofp", "sub", "trunc", "uitofp",
        "xor", "zext",
    }
)  # fmt: skip
#: how two integers compare, by LLVM's sign
_COMPARED = {
    "==": lambda x, y: x == y,
    "!=": lambda x, y: x != y,
    "<": lambda x, y: x < y,
    "<=": lambda x, y: x <= y,
    ">": lambda x, y: x > y,
    ">=": lambda x, y: x >= y,
}
_INDEX = ir.IntType(32)
#: where a part of a structure is
_Path = tuple[int, ...]


class Builder(ir.IRBuilder):  # type: ignore[misc]  # llvmlite is not typed
    """A writer of instructions that takes a value from where it was put, and computes with constants itself.

    A place on the stack is followed within a block, as long as nobody else is told where it is.
    """

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        self._taken: dict[Any, Any] = {}
        #: of a pointer, by its id (instructions live as long as their function): the place and the part of it
        self._places: dict[int, tuple[int, _Path]] = {}
        #: pointers to a place and its parts
        self._pointers: dict[int, list[int]] = {}
        #: what was stored in the parts of a place in a block, in this order
        self._stored: dict[tuple[int, int], list[tuple[_Path, Any]]] = {}
        self._at_end = True
        self._follows = True
        #: whether the function catches what others raise
        self.catches = False

    # Where it writes: what was stored is known only to those who come later

    def position_before(self, instr: Any) -> None:
        """Go on before an instruction."""
        super().position_before(instr)
        self._at_end = instr.parent.terminator is instr

    def position_after(self, instr: Any) -> None:
        """Go on behind an instruction."""
        super().position_after(instr)
        self._at_end = False

    def position_at_start(self, block: Any) -> None:
        """Go on at the start of a block."""
        super().position_at_start(block)
        self._at_end = not block.instructions

    def position_at_end(self, block: Any) -> None:
        """Go on at the end of a block."""
        super().position_at_end(block)
        self._at_end = True

    # Parts of values

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """A part of a value, from where it was put in, or was last taken."""
        places = list(idx) if isinstance(idx, (tuple, list)) else [idx]
        while places:
            put = _put_in(agg, places)
            if put is None:
                break
            agg, places = put.operands[1], places[len(put.indices) :]
        if not places:
            return agg
        if type(agg) is ir.Constant and (agg.constant is None or agg.constant is ir.Undefined):
            kind = agg.type
            for place in places:
                kind = kind.gep(_INDEX(place))
            return ir.Constant(kind, agg.constant)
        key = id(self.block), id(agg), tuple(places)  # the instruction below keeps both alive
        if key not in self._taken:
            self._taken[key] = super().extract_value(agg, places, name)
        return self._taken[key]

    def insert_value(self, agg: Any, value: Any, idx: Any, name: str = "") -> Any:
        """A value with another part."""
        self._share(value)
        return super().insert_value(agg, value, idx, name)

    # Places on the stack

    def alloca(self, typ: Any, size: Any = None, name: str = "") -> Any:
        """A place."""
        made = super().alloca(typ, size, name)
        if size is None and self._follows:
            self._places[id(made)] = id(made), ()
            self._pointers[id(made)] = [id(made)]
        return made

    def gep(self, ptr: Any, indices: Any, *rest: Any, **named: Any) -> Any:
        """The address of a part."""
        made = super().gep(ptr, indices, *rest, **named)
        place = self._places.get(id(ptr))
        if place is not None:
            known = [_number(each) for each in indices]
            if known[0] == 0 and None not in known:
                self._places[id(made)] = place[0], (*place[1], *known[1:])  # type: ignore[arg-type]
                self._pointers[place[0]].append(id(made))
            else:
                self._share(ptr)
        return made

    def store(self, value: Any, ptr: Any, *rest: Any, **named: Any) -> Any:
        """Store a value, and know it from then on."""
        self._share(value)
        made = super().store(value, ptr, *rest, **named)
        place = self._places.get(id(ptr))
        if place is not None:
            key, path = (id(self.block), place[0]), place[1]
            if not self._at_end or not path:
                self._stored.pop(key, None)
            if self._at_end:
                self._stored.setdefault(key, []).append((path, value))
        return made

    def load(self, ptr: Any, *rest: Any, **named: Any) -> Any:
        """What is at a place, where this block has stored it."""
        place = self._places.get(id(ptr))
        if place is None or not self._at_end:
            return super().load(ptr, *rest, **named)
        stored = self._stored.setdefault((id(self.block), place[0]), [])
        found = self._known(stored, place[1])
        if found is None:
            found = super().load(ptr, *rest, **named)
            stored.append((place[1], found))
        return found

    def _known(self, stored: list[tuple[_Path, Any]], path: _Path) -> Any:
        """What the part at a path holds; None where something of it is not known."""
        parts: list[tuple[_Path, Any]] = []
        for at, value in reversed(stored):
            if at == path[: len(at)]:
                found = self.extract_value(value, path[len(at) :]) if len(at) < len(path) else value
                for inside, part in reversed(parts):
                    found = self.insert_value(found, part, inside)
                return found
            if at[: len(path)] == path:
                parts.append((at[len(path) :], value))
        return None

    # Ways on which others may come to know of a place

    def _share(self, *values: Any) -> None:
        for value in values:
            place = self._places.get(id(value))
            if place is not None:
                for each in self._pointers.pop(place[0]):
                    del self._places[each]

    def call(self, fn: Any, args: Any, *rest: Any, **named: Any) -> Any:
        """Call a function."""
        self._share(*args)
        return super().call(fn, args, *rest, **named)

    def bitcast(self, value: Any, typ: Any, name: str = "") -> Any:
        """The same bits as of another type."""
        self._share(value)
        return super().bitcast(value, typ, name)

    def ptrtoint(self, value: Any, typ: Any, name: str = "") -> Any:
        """An address as a number."""
        self._share(value)
        return super().ptrtoint(value, typ, name)

    def select(self, cond: Any, lhs: Any, rhs: Any, *rest: Any, **named: Any) -> Any:
        """The one or the other."""
        known = _number(cond)
        if known is not None:
            return lhs if known else rhs
        self._share(lhs, rhs)
        return super().select(cond, lhs, rhs, *rest, **named)

    def addrspacecast(self, value: Any, typ: Any, name: str = "") -> Any:
        """The same address in another space."""
        self._share(value)
        return super().addrspacecast(value, typ, name)

    def atomic_rmw(self, op: str, ptr: Any, val: Any, ordering: str, name: str = "") -> Any:
        """Change what others may change as well."""
        self._share(ptr, val)
        return super().atomic_rmw(op, ptr, val, ordering, name)

    def cmpxchg(self, ptr: Any, cmp: Any, val: Any, *rest: Any, **named: Any) -> Any:
        """Exchange what others may change as well."""
        self._share(ptr, cmp, val)
        return super().cmpxchg(ptr, cmp, val, *rest, **named)

    def store_atomic(self, value: Any, ptr: Any, *rest: Any, **named: Any) -> Any:
        """Store what others may read and change as well."""
        self._share(value, ptr)
        return super().store_atomic(value, ptr, *rest, **named)

    def invoke(self, fn: Any, args: Any, *rest: Any, **named: Any) -> Any:
        """Call a function that may raise."""
        self._share(*args)
        return super().invoke(fn, args, *rest, **named)

    def phi(self, typ: Any, name: str = "", flags: Iterable[str] = ()) -> Any:
        """A value by the block that one comes from; of addresses it may be any, and no place is followed any more."""
        if isinstance(typ, ir.PointerType):
            self._follows = False
            self._places.clear()
            self._pointers.clear()
        return super().phi(typ, name, flags)

    # Arithmetic with constants

    def add(self, lhs: Any, rhs: Any, name: str = "", flags: Iterable[str] = ()) -> Any:
        """A sum of integers."""
        x, y = _number(lhs), _number(rhs)
        if x == 0 or y == 0:
            return rhs if x == 0 else lhs
        if x is not None and y is not None:
            return _constant(lhs.type, x + y)
        return super().add(lhs, rhs, name, flags)

    def sub(self, lhs: Any, rhs: Any, name: str = "", flags: Iterable[str] = ()) -> Any:
        """A difference of integers."""
        x, y = _number(lhs), _number(rhs)
        if y == 0:
            return lhs
        if x is not None and y is not None:
            return _constant(lhs.type, x - y)
        return super().sub(lhs, rhs, name, flags)

    def mul(self, lhs: Any, rhs: Any, name: str = "", flags: Iterable[str] = ()) -> Any:
        """A product of integers."""
        x, y = _number(lhs), _number(rhs)
        if x == 1 or y == 1:
            return rhs if x == 1 else lhs
        if x is not None and y is not None:
            return _constant(lhs.type, x * y)
        return super().mul(lhs, rhs, name, flags)

    def icmp_signed(self, cmpop: str, lhs: Any, rhs: Any, name: str = "") -> Any:
        """Whether integers, or addresses, compare in a way."""
        x, y = _number(lhs), _number(rhs)
        if x is not None and y is not None:
            return ir.Constant(ir.IntType(1), int(_COMPARED[cmpop](x, y)))
        return super().icmp_signed(cmpop, lhs, rhs, name)


def _number(value: Any) -> int | None:
    """An integer that is written, with its sign; None for all else."""
    if type(value) is not ir.Constant or not isinstance(value.type, ir.IntType):
        return None
    number = 0 if value.constant is None else value.constant
    return _signed(int(number), value.type.width) if isinstance(number, int) else None


def _signed(number: int, width: int) -> int:
    """An integer as so many bits hold it; a truth is 0 or 1."""
    number &= (1 << width) - 1
    return number if width == 1 or number < 1 << (width - 1) else number - (1 << width)


def _constant(kind: Any, number: int) -> Any:
    return ir.Constant(kind, _signed(number, kind.width))


def _put_in(value: Any, places: list[int]) -> Any:
    """The instruction that put in the part of a value at these places, whole or as part of more; else nothing."""
    while isinstance(value, ir.InsertValue):
        at = list(value.indices)
        if at == places[: len(at)]:
            return value
        if at[: len(places)] == places:
            return None  # it is put together from parts
        value = value.operands[0]
    return None


# What nobody uses


def prune(function: Any) -> None:
    """Take out of a function what has no effect: blocks that nothing leads to, values that nobody uses, and places that
    nobody reads."""
    _reach(function)
    written = [each for block in function.blocks for each in block.instructions]
    uses = Counter(id(value) for each in written for value in _used(each))
    gone: set[int] = set()
    _drop([each for each in written if each.opname in _PURE and not uses[id(each)]], uses, gone)
    _drop(_unread([each for each in written if id(each) not in gone]), uses, gone)
    for block in function.blocks:
        block.instructions = [each for each in block.instructions if id(each) not in gone]


def _reach(function: Any) -> None:
    """Take out blocks that nothing leads to, where it is known which way a branch goes."""
    for block in function.blocks:
        last = block.terminator
        known = _number(last.operands[0]) if isinstance(last, ir.ConditionalBranch) else None
        if known is not None:
            block.instructions[-1] = block.terminator = ir.Branch(block, "br", [last.operands[1 if known else 2]])
    first = function.blocks[0]
    met, waiting, edges = {id(first)}, [first], set()
    while waiting:
        block = waiting.pop()
        last = block.terminator
        if last is None:
            continue
        for each in [*last.operands, *getattr(last, "destinations", ()), *_cases(last)]:
            if not isinstance(each, ir.Block):
                continue
            edges.add((id(block), id(each)))
            if id(each) not in met:
                met.add(id(each))
                waiting.append(each)
    function.blocks = [block for block in function.blocks if id(block) in met]
    for block in function.blocks:
        for each in block.instructions:
            if isinstance(each, ir.PhiInstr):  # a branch whose way is known leads no more to where it might have
                each.incomings = [way for way in each.incomings if (id(way[1]), id(block)) in edges]


def _cases(last: Any) -> list[Any]:
    """The blocks that a switch leads to; none of anything else."""
    return [last.default, *(block for _, block in last.cases)] if isinstance(last, ir.SwitchInstr) else []


def _used(instruction: Any) -> Iterable[Any]:
    """The values that an instruction mentions."""
    if isinstance(instruction, ir.PhiInstr):
        return [value for value, _ in instruction.incomings]
    called = getattr(instruction, "callee", None)
    return instruction.operands if called is None else [*instruction.operands, called]


def _drop(waiting: list[Any], uses: "Counter[int]", gone: set[int]) -> None:
    """Note that instructions are gone, and with them those whose values were used there only."""
    gone.update(map(id, waiting))
    while waiting:
        for value in _used(waiting.pop()):
            uses[id(value)] -= 1
            if (
                not uses[id(value)]
                and isinstance(value, ir.Instruction)
                and value.opname in _PURE
                and id(value) not in gone
            ):
                gone.add(id(value))
                waiting.append(value)


def _unread(written: list[Any]) -> list[Any]:
    """Stores in places on the stack that nobody reads."""
    stores: dict[int, list[Any]] = defaultdict(list)
    read: set[int] = set()
    for each in written:
        used = list(_used(each))
        if isinstance(each, ir.GEPInstr):
            used = []  # who uses it tells
        elif isinstance(each, ir.StoreInstr):
            place = _place(used.pop())
            if place is not None:
                stores[place].append(each)
        read.update(place for place in map(_place, used) if place is not None)
    return [each for place, found in stores.items() if place not in read for each in found]


def _place(pointer: Any) -> int | None:
    """The place on the stack, by its id, that a pointer points to or into; None where it is none that is known."""
    while isinstance(pointer, ir.GEPInstr):
        pointer = pointer.operands[0]
    return id(pointer) if isinstance(pointer, ir.AllocaInstr) else None
