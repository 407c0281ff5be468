"""What `native.vector` becomes in machine code. Imported by what compiles, because it imports Numba."""

import operator
from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin, models, register_model

from mdstopo.native import vector


def _features() -> str:
    """Features of the processor that is compiled for."""
    asked: str | None = config.CPU_FEATURES  # type: ignore[attr-defined]  # set by its reader of the environment
    return str(llvm.get_host_cpu_features().flatten()) if asked is None else asked


_AVX512 = "+avx512f" in _features().split(",")
_LANES = vector.WIDE if _AVX512 else vector.NARROW
_VECTOR = ir.VectorType(ir.DoubleType(), _LANES)
#: products are fused with sums, as in `jit.member_kernel`; sums are added in the order that is written
_FUSED = ("contract", "nsz")


class VectorType(types.Type):
    """`_LANES` doubles."""

    def __init__(self) -> None:
        super().__init__(name=f"vector{_LANES}")


VECTOR = VectorType()


@register_model(VectorType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


#: code of a call: the builder, the types of the arguments, the arguments
Lower = Callable[[Any, Any, Any], Any]


def _implement(function: Callable[..., Any], given: tuple[Any, ...], result: Any, lower: Lower) -> None:
    """Tell Numba what `function` gives for arguments of these types, and by what code."""

    class Typed(AbstractTemplate):
        key = function

        def generic(self, asked: Any, _named: Any) -> Any:
            fits = len(asked) == len(given) and all(_fits(*pair) for pair in zip(asked, given, strict=True))
            return signature(result, *asked) if fits else None

    def lowered(context: Any, build: Any, kinds: Any, arguments: Any) -> Any:
        values = [_data(context, build, *pair) for pair in zip(kinds.args, arguments, strict=True)]
        value = lower(build, kinds.args, values)
        return context.get_dummy_value() if result is types.none else value

    infer_global(function)(Typed)
    lower_builtin(function, *given)(lowered)


def _fits(asked: Any, given: Any) -> bool:
    if given is types.Array:
        return bool(
            isinstance(asked, types.Array) and asked.ndim == 1 and asked.layout == "C" and asked.dtype == types.float64
        )
    return isinstance(asked, given) if isinstance(given, type) else asked == given


def _data(context: Any, build: Any, kind: Any, given: Any) -> Any:
    """The address of an array's numbers; anything else as it is."""
    return context.make_array(kind)(context, build, given).data if isinstance(kind, types.Array) else given


def _constant(value: float) -> Any:
    return ir.Constant(_VECTOR, [value] * _LANES)


def _same(build: Any, number: Any) -> Any:
    """A vector of one number."""
    places = ir.VectorType(ir.IntType(32), _LANES)
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = build.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return build.shuffle_vector(first, nothing, ir.Constant(places, [0] * _LANES))


def _arithmetic(instruction: str) -> Lower:
    def lower(build: Any, kinds: Any, arguments: Any) -> Any:
        both = [given if kind == VECTOR else _same(build, given) for kind, given in zip(kinds, arguments, strict=True)]
        return getattr(build, instruction)(*both, flags=_FUSED)

    return lower


def _at(build: Any, data: Any, i: Any) -> Any:
    return build.bitcast(build.gep(data, [i]), _VECTOR.as_pointer())


def _load(build: Any, _kinds: Any, arguments: Any) -> Any:
    loaded = build.load(_at(build, *arguments))
    loaded.align = 8
    return loaded


def _store(build: Any, _kinds: Any, arguments: Any) -> None:
    data, i, value = arguments
    build.store(value, _at(build, data, i)).align = 8


def _folded(join: Callable[[Any, Any, Any], Any]) -> Lower:
    """One number of all: halves are joined until one is left."""

    def lower(build: Any, _kinds: Any, arguments: Any) -> Any:
        (whole,) = arguments
        wide = _LANES
        while wide > 1:
            places = ir.VectorType(ir.IntType(32), wide // 2)
            low, high = (
                build.shuffle_vector(whole, whole, ir.Constant(places, list(range(k, k + wide // 2))))
                for k in (0, wide // 2)
            )
            whole, wide = join(build, low, high), wide // 2
        return build.extract_element(whole, ir.Constant(ir.IntType(32), 0))

    return lower


def _sum_of(build: Any, one: Any, other: Any) -> Any:
    return build.fadd(one, other)


def _larger_of(build: Any, one: Any, other: Any) -> Any:
    return build.select(build.fcmp_ordered(">", one, other), one, other)


def _unary(build: Any, name: str, x: Any) -> Any:
    kind = ir.FunctionType(_VECTOR, [_VECTOR])
    return build.call(cgutils.get_or_insert_function(build.module, kind, f"llvm.{name}.v{_LANES}f64"), [x])


def _negative(build: Any, _kinds: Any, arguments: Any) -> Any:
    bits = build.bitcast(build.fcmp_ordered("<", arguments[0], _constant(0.0)), ir.IntType(_LANES))
    return build.zext(bits, ir.IntType(64))


def _inverse_root(build: Any, _kinds: Any, arguments: Any) -> Any:
    x, floor = arguments
    root = _refined if _AVX512 else _divided
    return build.select(build.fcmp_ordered(">", x, _same(build, floor)), root(build, x), _constant(0.0))


def _divided(build: Any, x: Any) -> Any:
    return build.fdiv(_constant(1.0), _unary(build, "sqrt", x))


def _refined(build: Any, x: Any) -> Any:
    """From a seed y of 14 bits: with e = 1 - x y^2, 1/sqrt(x) = y (1 + e/2 + 3 e^2/8 + 5 e^3/16 + O(2^-54))."""
    kind = ir.FunctionType(_VECTOR, [_VECTOR, _VECTOR, ir.IntType(8)])
    start = cgutils.get_or_insert_function(build.module, kind, "llvm.x86.avx512.rsqrt14.pd.512")
    y = build.call(start, [x, _constant(0.0), ir.Constant(ir.IntType(8), -1)])
    # other flags would allow e to be taken apart
    fused = ("contract",)
    e = build.fsub(_constant(1.0), build.fmul(x, build.fmul(y, y), flags=fused), flags=fused)
    series = build.fadd(_constant(0.375), build.fmul(_constant(0.3125), e, flags=fused), flags=fused)
    series = build.fadd(_constant(0.5), build.fmul(series, e, flags=fused), flags=fused)
    return build.fadd(y, build.fmul(build.fmul(y, e), series, flags=fused), flags=fused)


for _signs, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
):
    for _sign in _signs:
        for _pair in ((VECTOR, VECTOR), (VECTOR, types.float64), (types.float64, VECTOR)):
            _implement(_sign, _pair, VECTOR, _arithmetic(_instruction))

_implement(vector.lanes, (), types.int64, lambda _build, _kinds, _none: ir.Constant(ir.IntType(64), _LANES))
_implement(vector.zero, (), VECTOR, lambda _build, _kinds, _none: _constant(0.0))
_implement(vector.load, (types.Array, types.Integer), VECTOR, _load)
_implement(vector.store, (types.Array, types.Integer, VECTOR), types.none, _store)
_implement(vector.total, (VECTOR,), types.float64, _folded(_sum_of))
_implement(vector.largest, (VECTOR,), types.float64, _folded(_larger_of))
_implement(vector.larger, (VECTOR, VECTOR), VECTOR, lambda build, _kinds, both: _larger_of(build, *both))
_implement(vector.magnitude, (VECTOR,), VECTOR, lambda build, _kinds, given: _unary(build, "fabs", given[0]))
_implement(vector.inverse_root, (VECTOR, types.float64), VECTOR, _inverse_root)
_implement(vector.negative, (VECTOR,), types.int64, _negative)
