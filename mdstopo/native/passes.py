"""Numba's passes over a function, as our kernels need them. Imports Numba."""

from collections.abc import Iterator
from types import CodeType
from typing import Any

import numpy as np
from numba.core import ir, types
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import AnnotateTypes, BaseNativeLowering, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes

from mdstopo.native.lowering import Lower


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


#: ours, by the pass of Numba's that it takes the place of
LEANER = {
    NativeLowering: _Lowering,
    NopythonRewrites: _Rewrites,
    InlineClosureLikes: _Closures,
    AnnotateTypes: _Unannotated,
}
