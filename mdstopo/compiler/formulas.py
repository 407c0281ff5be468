"""Formulas as machine code: made by LLVM in some milliseconds, and called by kernels through an address.

A kernel that calls one is compiled once for all formulas. Each group of a set of formulas is a function that gives the
numbers of the group; the address of a set is that of a table of the addresses of these functions:

    void group(const double *p, double x, double xd, double t, double l0, int64 mode, double *out)

Names in formulas are those of `NAMES`, "p 0" and so on for the numbers of p, and "bit 0" and so on for those of mode.

A mode's formulas go on a little beyond its end, for steps that are shortened afterwards. A root or a fractional power
of a negative number is taken as that of 0 there; a NaN anywhere else, where the smallest margin is more than `CLEAR`.
"""

from __future__ import annotations

import ctypes
import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.compiler.kernel import when_compiling
from mdstopo.formula.law_formulas import LOWEST, Group
from mdstopo.formula.tree import COMPARISONS, NAME, NUMBER, Expression, number, operation, parts

#: names of a formula that are arguments of its function
NAMES = ("x", "xd", "t", "l0")
#: numbers that a group has at most
WIDTH = 5
#: powers up to this one are products
_PRODUCTS = 16
#: margins above this are those of a mode that holds, whatever rounding does
CLEAR = 1e-9
#: functions of LLVM's; all others are those of the C library
_LLVM = {"sqrt": "llvm.sqrt.f64", "abs": "llvm.fabs.f64"}

_FORM = ctypes.CFUNCTYPE(None, ctypes.c_void_p, *[ctypes.c_double] * len(NAMES), ctypes.c_int64, ctypes.c_void_p)
Floats = NDArray[np.float64]

#: what keeps machine code in memory
_ENGINES: list[Any] = []


def call_formula(address: float, p: Floats, x: float, xd: float, t: float, l0: float, mode: int, group: int) -> Any:
    """Numbers of a group of formulas, WIDTH of them; those that a group has not are 0.

    address: where the table of functions is.
    p: parameters.
    x, xd: elongation (m) and its rate (m/s).
    t: time (s).
    l0: free length (m).
    mode: the bits of the switches.
    group: which group of formulas.
    """
    return tuple(FormulaCalls(address, p).numbers(x, xd, t, l0, mode, group))


class FormulaCalls:
    """Calls from Python of the functions whose table is at an address, all with the parameters p (any,)."""

    def __init__(self, address: float, p: Floats) -> None:
        self._table = ctypes.cast(int(address), ctypes.POINTER(ctypes.c_void_p))
        self._functions: dict[int, Callable[..., None]] = {}
        self._p, self._out = np.ascontiguousarray(p), np.zeros(WIDTH)
        self._p_place, self._out_place = self._p.ctypes.data, self._out.ctypes.data

    def numbers(self, x: float, xd: float, t: float, l0: float, mode: int, group: int) -> list[float]:
        """Numbers of a group, WIDTH of them; arguments as in `call_formula`.

        x, xd: elongation (m) and its rate (m/s).
        t: time (s).
        l0: free length (m).
        mode: the bits of the switches.
        group: which group of formulas.
        """
        function = self._functions.get(group)
        if function is None:
            function = self._functions[group] = _FORM(self._table[group] or 0)
        function(self._p_place, x, xd, t, l0, mode, self._out_place)
        found: list[float] = self._out.tolist()
        return found


@when_compiling
def _register() -> None:
    """Make `call_formula` known to Numba."""
    import mdstopo.compiler.formula_lowering  # noqa: F401


@functools.cache
def address_of(groups: tuple[Group, ...]) -> int:
    """Where the table of the machine code of groups of formulas is; made at the first call."""
    import llvmlite.binding as llvm

    from mdstopo.compiler.call import target

    code = llvm.parse_assembly(str(_Module(groups).module))
    code.verify()
    machine = target().create_target_machine(jit=True, opt=2)
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
    builder.getModulePassManager().run(code, builder)
    engine = llvm.create_mcjit_compiler(code, machine)
    engine.finalize_object()
    _ENGINES.append(engine)
    return int(engine.get_global_value_address("formulas"))


class _Module:
    """The module with the functions of some groups, and their table."""

    def __init__(self, groups: Sequence[Group]) -> None:
        from llvmlite import ir

        self.ir = ir
        self.double, self.whole = ir.DoubleType(), ir.IntType(64)
        self.module = ir.Module("formulas")
        self.lowest = self.lowest_of(groups[LOWEST])
        made = [self.write(place, group) for place, group in enumerate(groups)]
        kind = ir.ArrayType(made[0].type, len(made))
        table = ir.GlobalVariable(self.module, kind, "formulas")
        table.global_constant, table.initializer = True, ir.Constant(kind, made)

    def function(self, name: str, result: Any, more: list[Any]) -> Any:
        """A function of parameters, names and mode, with what comes behind them."""
        numbers = self.double.as_pointer()
        form = self.ir.FunctionType(result, [numbers, *[self.double] * len(NAMES), self.whole, *more])
        function = self.ir.Function(self.module, form, name)
        function.append_basic_block("entry")
        return function

    def lowest_of(self, group: Group) -> Any:
        """The function that returns the smallest margin."""
        function = self.function("lowest", self.double, [])
        build = self.ir.IRBuilder(function.entry_basic_block)
        (value,) = _Values(self.ir, build, self.module, function.args).of(group.values)
        build.ret(value)
        return function

    def write(self, place: int, group: Group) -> Any:
        """The function of one group."""
        function = self.function(f"group{place}", self.ir.VoidType(), [self.double.as_pointer()])
        build = self.ir.IRBuilder(function.entry_basic_block)
        common = function.args[: 2 + len(NAMES)]
        if place == LOWEST:
            self.store(function, build, [build.call(self.lowest, common)])
            return function
        made = _Values(self.ir, build, self.module, function.args)
        reached = [each.reached for each in group.guards]
        found = made.of([*group.values, *(each.part for each in group.guards), *reached])
        count = len(group.values)
        values = found[:count]
        outside = None
        for guard, way in zip(group.guards, found[count + len(reached) :], strict=True):
            one = build.and_(made.outside[guard.part], build.fcmp_ordered(">", way, made.constant(0.5)))
            outside = one if outside is None else build.or_(outside, one)
        if outside is not None:
            rare, usual = (function.append_basic_block(word) for word in ("outside", "inside"))
            build.cbranch(outside, rare, usual)
            build = self.ir.IRBuilder(rare)
            clear = build.fcmp_unordered(">", build.call(self.lowest, common), made.constant(CLEAR))
            self.store(function, build, [build.select(clear, made.constant(math.nan), each) for each in values])
            build = self.ir.IRBuilder(usual)
        self.store(function, build, values)
        return function

    def store(self, function: Any, build: Any, values: list[Any]) -> None:
        """Write the values, and 0 behind them, and return."""
        for place in range(WIDTH):
            value = values[place] if place < len(values) else self.ir.Constant(self.double, 0.0)
            build.store(value, build.gep(function.args[-1], [self.ir.Constant(self.whole, place)]))
        build.ret_void()


class _Values:
    """Code of the values of expressions in one block; common parts are computed once.

    outside: of each operation that may have no value, whether it has none.
    """

    def __init__(self, ir: Any, build: Any, module: Any, arguments: Any) -> None:
        self.ir, self.build, self.module = ir, build, module
        self.double = ir.DoubleType()
        self.p, *named = arguments[: 1 + len(NAMES)]
        self.mode = arguments[1 + len(NAMES)]
        self.named = dict(zip(NAMES, named, strict=True))
        self.outside: dict[Expression, Any] = {}
        self.values: dict[Expression, Any] = {}
        self.lowest_powers: dict[tuple[Expression, Expression], float] = {}
        self.shared: dict[Expression, Any] = {}

    def of(self, group: Sequence[Expression]) -> list[Any]:
        """The values of a group."""
        order = list(parts(*group))
        self.note_powers(order)
        for part in order:
            if part.operator == NUMBER:
                self.values[part] = self.constant(part.value)
            elif part.operator == NAME:
                self.values[part] = self.name(part.word)
            else:
                self.values[part] = self.operation(part, [self.values[each] for each in part.operands])
        return [self.values[each] for each in group]

    def constant(self, value: float) -> Any:
        """A number."""
        return self.ir.Constant(self.double, value)

    def name(self, word: str) -> Any:
        """An argument, a parameter or a bit."""
        if word in self.named:
            return self.named[word]
        kind, place = word.split()
        whole = self.ir.IntType(64)
        if kind == "p":
            return self.build.load(self.build.gep(self.p, [self.ir.Constant(whole, int(place))]))
        shifted = self.build.lshr(self.mode, self.ir.Constant(whole, int(place)))
        return self.build.uitofp(self.build.and_(shifted, self.ir.Constant(whole, 1)), self.double)

    def operation(self, part: Expression, u: list[Any]) -> Any:
        """An operation of values."""
        build = self.build
        simple = {"+": "fadd", "-": "fsub", "*": "fmul", "neg": "fneg"}
        if part.operator in simple:
            return getattr(build, simple[part.operator])(*u)
        if part.operator == "/":
            return self.checked(part, build.fdiv(*u))
        if part.operator in COMPARISONS:
            return build.fcmp_ordered(part.operator, *u)
        if part.operator == "if":
            return build.select(*u)
        if part.operator in ("^", "powlog", "sqrt"):
            return self.root_or_power(part, u)
        if part.operator in ("min", "max"):
            best = u[0]
            for each in u[1:]:
                sign = "<" if part.operator == "min" else ">"
                best = build.select(build.fcmp_ordered(sign, each, best), each, best)
            return best
        if part.operator in ("sign", "step"):
            low = self.constant(-1.0 if part.operator == "sign" else 0.0)
            return build.select(build.fcmp_ordered(">=", u[0], self.constant(0.0)), self.constant(1.0), low)
        if part.operator == "clip":
            upper = build.select(build.fcmp_ordered("<", u[2], u[0]), u[2], u[0])
            return build.select(build.fcmp_ordered("<", upper, u[1]), u[1], upper)
        return self.checked(part, self.call(_LLVM.get(part.operator, part.operator), u))

    def checked(self, part: Expression, value: Any) -> Any:
        """A value that may be none."""
        self.outside[part] = self.build.fcmp_unordered("uno", value, value)
        return value

    def note_powers(self, order: Sequence[Expression]) -> None:
        """Note which powers of one base are apart by whole numbers: one is computed, the others are products of it."""
        for part in order:
            if part.operator in ("^", "powlog"):
                core, offset = _split(part.operands[1])
                key = part.operands[0], core
                self.lowest_powers[key] = min(offset, self.lowest_powers.get(key, math.inf))

    def root_or_power(self, part: Expression, u: list[Any]) -> Any:
        """A root, a power, or a power times the logarithm of its base."""
        build, zero = self.build, self.constant(0.0)
        negative = build.fcmp_ordered("<", u[0], zero)
        if part.operator == "sqrt":
            self.outside[part] = negative
            return build.select(negative, zero, self.call(_LLVM["sqrt"], u))
        exponent = part.operands[1]
        if exponent.operator == NUMBER and part.operator == "^" and _is_short(exponent.value):
            return self.short_power(part, u[0], exponent.value)
        value = self.shared_power(part, u)
        limit = build.select(build.fcmp_ordered("==", u[1], zero), self.constant(1.0), self.constant(math.inf))
        if part.operator == "powlog":
            value = build.fmul(value, self.call("log", u[:1]))
            limit = self.constant(math.nan)
        limit = build.select(build.fcmp_ordered(">", u[1], zero), zero, limit)
        self.outside[part] = build.and_(negative, build.fcmp_unordered("uno", value, value))
        at_end = build.or_(self.outside[part], build.fcmp_ordered("==", u[0], zero))
        return build.select(at_end, limit, value)

    def shared_power(self, part: Expression, u: list[Any]) -> Any:
        """A power by the lowest one of the same base from which it is whole steps away."""
        base, exponent = part.operands
        core, offset = _split(exponent)
        lowest = self.lowest_powers[base, core]
        key = operation("^", base, operation("+", core, number(lowest)))
        if key not in self.shared:
            least = self.constant(core.value + lowest) if core.operator == NUMBER else self.values[core]
            if core.operator != NUMBER and lowest != 0.0:
                least = self.build.fadd(least, self.constant(lowest))
            self.shared[key] = self.call("pow", [u[0], least])
        apart = int(offset - lowest)
        return self.build.fmul(self.shared[key], self.product(u[0], apart)) if apart else self.shared[key]

    def short_power(self, part: Expression, base: Any, exponent: float) -> Any:
        """A power whose exponent is a whole or half number: a product, and a root."""
        build = self.build
        size = abs(exponent)
        value = self.product(base, int(size)) if int(size) else None
        if size != int(size):
            root = self.call(_LLVM["sqrt"], [base])
            self.outside[part] = negative = build.fcmp_ordered("<", base, self.constant(0.0))
            root = build.select(negative, self.constant(0.0), root)
            value = root if value is None else build.fmul(value, root)
        return value if exponent > 0.0 else build.fdiv(self.constant(1.0), value)

    def product(self, base: Any, times: int) -> Any:
        """A whole power, by squares."""
        if times == 1:
            return base
        half = self.product(base, times // 2)
        square = self.build.fmul(half, half)
        return square if times % 2 == 0 else self.build.fmul(square, base)

    def call(self, function: str, u: list[Any]) -> Any:
        """A function of LLVM's or of the C library."""
        known = self.module.globals.get(function)
        if known is None:
            known = self.ir.Function(self.module, self.ir.FunctionType(self.double, [self.double] * len(u)), function)
        return self.build.call(known, u)


def _is_short(exponent: float) -> bool:
    """Whether a power is a product and a root."""
    return 2.0 * exponent == round(2.0 * exponent) and 0.0 < abs(exponent) <= _PRODUCTS


def _split(exponent: Expression) -> tuple[Expression, float]:
    """An exponent as what it has in common with those whole steps away, and the steps."""
    if exponent.operator == NUMBER:
        whole = math.floor(exponent.value)
        return number(exponent.value - whole), float(whole)
    if exponent.operator in ("+", "-"):
        left, right = exponent.operands
        sign = 1.0 if exponent.operator == "+" else -1.0
        if right.operator == NUMBER and _is_step(right.value):
            return left, sign * right.value
        if left.operator == NUMBER and _is_step(left.value) and exponent.operator == "+":
            return right, left.value
    return exponent, 0.0


def _is_step(value: float) -> bool:
    """Whether a power this much higher is a product."""
    return value == round(value) and abs(value) <= _PRODUCTS / 2
