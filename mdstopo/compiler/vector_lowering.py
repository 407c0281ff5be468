"""What `compiler.vector` becomes in machine code, by what Numba documents for those who extend it. Imports Numba."""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import binding, ir
from numba import config, types
from numba.core import cgutils
from numba.extending import lower_builtin, models, register_model, type_callable

from mdstopo.compiler import vector


def _has_avx512() -> bool:
    """Whether Numba compiles for a processor with AVX-512: not so under NUMBA_ENABLE_AVX=0."""
    settings: Any = config
    if settings.CPU_FEATURES is not None:
        return "+avx512f" in settings.CPU_FEATURES.split(",")
    try:
        return bool(settings.ENABLE_AVX) and bool(binding.get_host_cpu_features().get("avx512f"))
    except RuntimeError:  # a processor whose features LLVM cannot tell
        return False


_AVX512 = _has_avx512()
_LANES = vector.WIDE if _AVX512 else vector.NARROW
#: products are fused with sums, as in `compiler.jit.member_kernel`; sums are added in the order that is written
_FUSED = ("contract", "nsz")


class VectorType(types.Type):
    """So many numbers in double precision: `code` is the vector as LLVM knows it."""

    def __init__(self, count: int) -> None:
        super().__init__(name=f"vector{count}x{types.float64}")
        self.count = count
        self.code = ir.VectorType(ir.DoubleType(), count)


VECTOR = VectorType(_LANES)
#: how far apart addresses of numbers are
_BYTES = 8


@register_model(VectorType)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, kind.code)


#: code of a call: the builder, the types of the arguments, the arguments
Lower = Callable[[Any, Any, Any], Any]
#: type of what a call gives, or nothing where it cannot be: of the types of the arguments
Result = Callable[..., Any]


def _implement(function: Callable[..., Any], given: tuple[type, ...], result: Result, lower: Lower) -> None:
    """Tell Numba what `function` gives for arguments of types of these classes, and by what code."""

    def found(*asked: Any) -> Any:
        return result(*asked) if all(map(_fits, asked, given)) else None

    # Numba asks how many arguments there are
    with_arguments: tuple[Callable[..., Any], ...] = (
        lambda: found(),
        lambda a: found(a),
        lambda a, b: found(a, b),
        lambda a, b, c: found(a, b, c),
    )

    def lowered(context: Any, build: Any, kinds: Any, arguments: Any) -> Any:
        values = [_data(context, build, *pair) for pair in zip(kinds.args, arguments, strict=True)]
        value = lower(build, kinds.args, values)
        return context.get_dummy_value() if kinds.return_type is types.none else value

    type_callable(function)(lambda _context: with_arguments[len(given)])
    lower_builtin(function, *given)(lowered)


def _fits(asked: Any, given: type) -> bool:
    if given is types.Array:
        return bool(
            isinstance(asked, types.Array) and asked.ndim == 1 and asked.layout == "C" and asked.dtype == types.float64
        )
    return isinstance(asked, given)


def _data(context: Any, build: Any, kind: Any, given: Any) -> Any:
    """The address of an array's numbers; anything else as it is."""
    if not isinstance(kind, types.Array):
        return given
    return cgutils.create_struct_proxy(kind)(context, build, value=given).data


def _declared(build: Any, form: Any, name: str) -> Any:
    """A function of LLVM's, declared once in a module."""
    found = build.module.globals.get(name)
    return ir.Function(build.module, form, name) if found is None else found


def _vector(*_: Any) -> Any:
    """What vectors give, and vectors with numbers."""
    return VECTOR


def _constant(value: float) -> Any:
    return ir.Constant(VECTOR.code, [value] * _LANES)


def _same(build: Any, number: Any) -> Any:
    """A vector of one number."""
    places = ir.VectorType(ir.IntType(32), _LANES)
    nothing = ir.Constant(VECTOR.code, ir.Undefined)
    first = build.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return build.shuffle_vector(first, nothing, ir.Constant(places, [0] * _LANES))


def _arithmetic(instruction: str) -> Lower:
    def lower(build: Any, kinds: Any, arguments: Any) -> Any:
        both = [
            given if isinstance(kind, VectorType) else _same(build, given)
            for kind, given in zip(kinds, arguments, strict=True)
        ]
        return getattr(build, instruction)(*both, flags=_FUSED)

    return lower


def _at(build: Any, data: Any, i: Any) -> Any:
    return build.bitcast(build.gep(data, [i]), VECTOR.code.as_pointer())


def _load(build: Any, _kinds: Any, arguments: Any) -> Any:
    loaded = build.load(_at(build, *arguments))
    loaded.align = _BYTES
    return loaded


def _store(build: Any, _kinds: Any, arguments: Any) -> None:
    data, i, value = arguments
    build.store(value, _at(build, data, i)).align = _BYTES


def _fetch(build: Any, _kinds: Any, arguments: Any) -> None:
    data, i = arguments
    byte, flag = ir.IntType(8).as_pointer(), ir.IntType(32)
    form = ir.FunctionType(ir.VoidType(), [byte, flag, flag, flag])
    call = _declared(build, form, "llvm.prefetch.p0")
    to_be_read, often, numbers = (ir.Constant(flag, value) for value in (0, 3, 1))
    build.call(call, [build.bitcast(build.gep(data, [i]), byte), to_be_read, often, numbers])


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
    form = ir.FunctionType(VECTOR.code, [VECTOR.code])
    return build.call(_declared(build, form, f"llvm.{name}.v{_LANES}f64"), [x])


def _negative(build: Any, _kinds: Any, arguments: Any) -> Any:
    bits = build.bitcast(build.fcmp_ordered("<", arguments[0], _constant(0.0)), ir.IntType(_LANES))
    return build.zext(bits, ir.IntType(64))


def _unmarked(build: Any, _kinds: Any, arguments: Any) -> Any:
    vector_of, bits = arguments
    marked = build.bitcast(build.trunc(bits, ir.IntType(_LANES)), ir.VectorType(ir.IntType(1), _LANES))
    return build.select(marked, _constant(0.0), vector_of)


def _inverse_root(build: Any, kinds: Any, arguments: Any) -> Any:
    x, floor = arguments
    root = _refined if _AVX512 else _divided
    return _where_larger(build, kinds, (x, floor, root(build, x)))


def _divided(build: Any, x: Any) -> Any:
    return build.fdiv(_constant(1.0), _unary(build, "sqrt", x))


def _refined(build: Any, x: Any) -> Any:
    """From a seed y of 14 bits: with e = 1 - x y^2, 1/sqrt(x) = y (1 + e/2 + 3 e^2/8 + 5 e^3/16 + O(2^-54))."""
    form = ir.FunctionType(VECTOR.code, [VECTOR.code, VECTOR.code, ir.IntType(_LANES)])
    start = _declared(build, form, "llvm.x86.avx512.rsqrt14.pd.512")
    y = build.call(start, [x, _constant(0.0), ir.Constant(ir.IntType(_LANES), -1)])
    # other flags would allow e to be taken apart
    fused = ("contract",)
    e = build.fsub(_constant(1.0), build.fmul(x, build.fmul(y, y), flags=fused), flags=fused)
    series = build.fadd(_constant(0.375), build.fmul(_constant(0.3125), e, flags=fused), flags=fused)
    series = build.fadd(_constant(0.5), build.fmul(series, e, flags=fused), flags=fused)
    return build.fadd(y, build.fmul(build.fmul(y, e), series, flags=fused), flags=fused)


def _where_larger(build: Any, _kinds: Any, arguments: Any) -> Any:
    x, floor, value = arguments
    least = floor if floor.type == x.type else _same(build, floor)
    return build.select(build.fcmp_ordered(">", x, least), value, _constant(0.0))


for _signs, _instruction in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
):
    for _sign in _signs:
        for _pair in ((VectorType, VectorType), (VectorType, types.Float), (types.Float, VectorType)):
            _implement(_sign, _pair, _vector, _arithmetic(_instruction))


_implement(vector.lanes, (), lambda: types.int64, lambda _build, _kinds, _none: ir.Constant(ir.IntType(64), _LANES))
_implement(vector.zero, (), _vector, lambda _build, _kinds, _none: _constant(0.0))
_implement(vector.load, (types.Array, types.Integer), _vector, _load)
_implement(vector.store, (types.Array, types.Integer, VectorType), lambda *_: types.none, _store)
_implement(vector.fetch, (types.Array, types.Integer), lambda _array, _i: types.none, _fetch)
_implement(vector.total, (VectorType,), lambda _whole: types.float64, _folded(_sum_of))
_implement(vector.largest, (VectorType,), lambda _whole: types.float64, _folded(_larger_of))
_implement(vector.larger, (VectorType, VectorType), _vector, lambda build, _kinds, both: _larger_of(build, *both))
_implement(vector.magnitude, (VectorType,), _vector, lambda build, _kinds, given: _unary(build, "fabs", given[0]))
_implement(vector.inverse_root, (VectorType, types.Float), _vector, _inverse_root)
for _floor in (types.Float, VectorType):
    _implement(vector.where_larger, (VectorType, _floor, VectorType), _vector, _where_larger)
_implement(vector.negative, (VectorType,), lambda _vector: types.int64, _negative)
_implement(vector.unmarked, (VectorType, types.Integer), _vector, _unmarked)
