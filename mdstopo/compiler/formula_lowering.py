"""What `compiler.formulas.call_formula` becomes in machine code: a call through a table of addresses. Imports Numba."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

from mdstopo.compiler.formulas import NAMES, WIDTH, call_formula

_RESULT = types.UniTuple(types.float64, WIDTH)
_FLOATS = [types.float64] * (1 + len(NAMES))


@type_callable(call_formula)
def _typed(_context: Any) -> Any:
    def typed(address: Any, p: Any, x: Any, xd: Any, t: Any, l0: Any, mode: Any, group: Any) -> Any:
        """What a call gives for arguments of these types: address, p, x, xd, t, l0, mode, group."""
        if not (isinstance(p, types.Array) and p.ndim == 1 and p.layout == "C" and p.dtype == types.float64):
            return None
        return _RESULT(types.float64, p, *_FLOATS[1:], types.int64, types.int64)

    return typed


@lower_builtin(call_formula, types.float64, types.Array, *_FLOATS[1:], types.int64, types.int64)
def _lowered(context: Any, build: Any, kinds: Any, arguments: Any) -> Any:
    double, whole = ir.DoubleType(), ir.IntType(64)
    numbers = double.as_pointer()
    address, p, *rest, group = arguments
    data = cgutils.create_struct_proxy(kinds.args[1])(context, build, value=p).data
    form = ir.FunctionType(ir.VoidType(), [numbers, *[double] * len(NAMES), whole, numbers]).as_pointer()
    table = build.inttoptr(build.fptosi(address, whole), form.as_pointer())
    function = build.load(build.gep(table, [group]))
    out = cgutils.alloca_once(build, double, size=WIDTH)
    build.call(function, [data, *rest, out])
    values = [build.load(build.gep(out, [ir.Constant(whole, i)])) for i in range(WIDTH)]
    return context.make_tuple(build, _RESULT, values)
