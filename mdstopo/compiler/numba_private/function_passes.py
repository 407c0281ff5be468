"""Passes over a function, in the places of Numba's own, with the versions that they fit."""

from collections.abc import Iterator
from types import CodeType
from typing import Any

import numpy as np
from numba import types
from numba.core import errors, ir, postproc, transforms
from numba.core.compiler_machinery import PassManager, _pass_registry, register_pass
from numba.core.typed_passes import AnnotateTypes, BaseNativeLowering, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes

from mdstopo.compiler.numba_private.lean_lowering import Lower
from mdstopo.compiler.tried import has_own_passes

#: whether our passes over a function fit this version
LEAN = has_own_passes()
#: of what is not typed
_ERRORS: Any = errors


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


#: ours, by the pass of Numba's that it takes the place of; none where they do not fit
LEANER: dict[Any, Any] = {
    NativeLowering: _Lowering,
    NopythonRewrites: _Rewrites,
    InlineClosureLikes: _Closures,
    AnnotateTypes: _Unannotated,
}
if not LEAN:
    LEANER = {}


def canonicalise(function: Any) -> None:
    """Give each loop a single back edge, as Numba does after every pass: where a pass has left the edges between blocks
    as they were found to be right before, there is nothing to do."""
    edges = _edges(function)
    if getattr(function, "_mdstopo_edges", None) != edges:
        function.blocks = transforms.canonicalize_cfg(function.blocks)
        function._mdstopo_edges = edges if _edges(function) == edges else None


def _edges(function: Any) -> list[tuple[Any, ...]]:
    """Of each block its place, and those of the blocks that it leads to."""
    return [(place, *block.terminator.get_targets()) for place, block in function.blocks.items()]


class Passes(PassManager):
    """Passes over a function of ours: nobody listens to them or asks how long each took."""

    def _runPass(self, index: int, each: Any, state: Any) -> None:
        each.analysis = self._analysis
        with _ERRORS.new_error_context("Pass {name}", name=each.name()):
            changed = [step(state) for step in (each.run_initialization, each.run_pass, each.run_finalizer)]
        if not _pass_registry.get(each.__class__).mutates_CFG:
            return
        if any(changed):
            postproc.PostProcessor(state.func_ir).run()
        else:
            canonicalise(state.func_ir)
