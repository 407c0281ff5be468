"""Formulas as machine code: made by LLVM in some milliseconds, and called by kernels through an address.

A kernel that calls one is compiled once for all formulas. The function of a set of formulas gives the numbers of one of
its groups:

    void f(const double *p, double x, double xd, double t, double l0, int64 mode, int64 group, double *out)

Names in formulas are those of `NAMES`, "p 0" and so on for the numbers of p, and "bit 0" and so on for those of mode.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.compiler.kernel import when_compiling
from mdstopo.formula.tree import COMPARISONS, NAME, NUMBER, Expression, parts

#: names of a formula that are arguments of its function
NAMES = ("x", "xd", "t", "l0")
#: numbers that a group has at most
WIDTH = 5
#: powers up to this one are products
_PRODUCTS = 16
#: functions of LLVM's; all others are those of the C library
_LLVM = {"sqrt": "llvm.sqrt.f64", "abs": "llvm.fabs.f64"}

_FORM = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, *[ctypes.c_double] * len(NAMES), ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p
)
Floats = NDArray[np.float64]
Group = tuple[Expression, ...]

#: what keeps machine code in memory
_ENGINES: list[Any] = []


def call_formula(address: float, p: Floats, x: float, xd: float, t: float, l0: float, mode: int, group: int) -> Any:
    """Numbers of a group of formulas, WIDTH of them; those that a group has not are 0.

    address: where the function is.
    p: parameters.
    x, xd: elongation (m) and its rate (m/s).
    t: time (s).
    l0: free length (m).
    mode: the bits of the switches.
    group: which group of formulas.
    """
    out = np.zeros(WIDTH)
    numbers = np.ascontiguousarray(p)
    _FORM(int(address))(numbers.ctypes.data, x, xd, t, l0, mode, group, out.ctypes.data)
    return tuple(out.tolist())


@when_compiling
def _register() -> None:
    """Make `call_formula` known to Numba."""
    import mdstopo.compiler.formula_lowering  # noqa: F401


@functools.cache
def address_of(groups: tuple[Group, ...]) -> int:
    """Where the machine code of groups of formulas is; made at the first call."""
    import llvmlite.binding as llvm

    from mdstopo.compiler.call import target

    code = llvm.parse_assembly(str(_module(groups)))
    code.verify()
    engine = llvm.create_mcjit_compiler(code, target().create_target_machine(jit=True, opt=2))
    engine.finalize_object()
    _ENGINES.append(engine)
    return int(engine.get_function_address("formulas"))


def _module(groups: Sequence[Group]) -> Any:
    """The module with the function of these groups."""
    from llvmlite import ir

    double, whole = ir.DoubleType(), ir.IntType(64)
    numbers = double.as_pointer()
    module = ir.Module("formulas")
    form = ir.FunctionType(ir.VoidType(), [numbers, *[double] * len(NAMES), whole, whole, numbers])
    function = ir.Function(module, form, "formulas")
    entry = function.append_basic_block("entry")
    end = function.append_basic_block("end")
    ir.IRBuilder(end).ret_void()
    branch = ir.IRBuilder(entry).switch(function.args[-2], end)
    for number, group in enumerate(groups):
        block = function.append_basic_block(f"group{number}")
        branch.add_case(ir.Constant(whole, number), block)
        build = ir.IRBuilder(block)
        values = _Values(ir, build, module, function.args).of(group)
        for place in range(WIDTH):
            value = values[place] if place < len(values) else ir.Constant(double, 0.0)
            build.store(value, build.gep(function.args[-1], [ir.Constant(whole, place)]))
        build.branch(end)
    return module


class _Values:
    """Code of the values of expressions in one block; common parts are computed once."""

    def __init__(self, ir: Any, build: Any, module: Any, arguments: Any) -> None:
        self.ir, self.build, self.module = ir, build, module
        self.double = ir.DoubleType()
        self.p, *named = arguments[: 1 + len(NAMES)]
        self.mode = arguments[1 + len(NAMES)]
        self.named = dict(zip(NAMES, named, strict=True))

    def of(self, group: Group) -> list[Any]:
        """The values of a group."""
        found: dict[Expression, Any] = {}
        for part in parts(*group):
            if part.operator == NUMBER:
                found[part] = self.constant(part.value)
            elif part.operator == NAME:
                found[part] = self.name(part.word)
            else:
                found[part] = self.operation(part, [found[each] for each in part.operands])
        return [found[each] for each in group]

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
        simple = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv", "neg": "fneg"}
        if part.operator in simple:
            return getattr(build, simple[part.operator])(*u)
        if part.operator in COMPARISONS:
            return build.fcmp_ordered(part.operator, *u)
        if part.operator == "if":
            return build.select(*u)
        if part.operator == "^":
            return self.power(u, part.operands[1])
        if part.operator == "powlog":
            value = build.fmul(self.call("pow", u), self.call("log", u[:1]))
            return build.select(build.fcmp_ordered("==", u[0], self.constant(0.0)), self.constant(0.0), value)
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
        return self.call(_LLVM.get(part.operator, part.operator), u)

    def power(self, u: list[Any], exponent: Expression) -> Any:
        """A power: products for whole exponents, roots for halves."""
        if exponent.operator == NUMBER:
            size = abs(exponent.value)
            if size == 0.5:
                root = self.call(_LLVM["sqrt"], u[:1])
                return root if exponent.value > 0.0 else self.build.fdiv(self.constant(1.0), root)
            if size == int(size) and 1.0 <= size <= _PRODUCTS:
                product = self.product(u[0], int(size))
                return product if exponent.value > 0.0 else self.build.fdiv(self.constant(1.0), product)
        return self.call("pow", u)

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
