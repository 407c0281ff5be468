"""Bundles of arrays that kernels hand to each other as one pointer.

A named tuple of thirty arrays is two hundred arguments to the compiler, at every call; a reference to a structure is
one. Inside kernels a structure is made and read like a named tuple; Python never sees one.
"""

import importlib
from typing import Any

from mdstopo.native.kernel import numba, when_compiling

_KINDS: dict[str, type] = {}


#: the modules that have structures
_OWNERS = ("model", "track", "balance")


def __getattr__(name: str) -> type:
    """The types of structures, made when something is compiled: Numba's disk cache asks this module for them.

    It asks in a process that computes nothing general, too: kernels that both families share are in one file of it.
    """
    if name.endswith("Structure") and name not in _KINDS:
        for owner in _OWNERS:
            importlib.import_module(f"{__package__}.{owner}")
        numba()
    try:
        return _KINDS[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


def bundle(maker: type, fields: tuple[str, ...]) -> None:
    """Let `maker(...)` in kernels make a structure from its fields, in their order; each maker has its own type."""

    @when_compiling
    def register() -> None:
        from numba import types
        from numba.experimental import structref

        def preprocess_fields(self: Any, given: Any) -> Any:
            """Literal types would make every literal another structure."""
            return tuple((name, types.unliteral(kind)) for name, kind in given)

        members = {"preprocess_fields": preprocess_fields, "__module__": __name__}
        kind = type(f"{maker.__name__}Structure", (types.StructRef,), members)
        _KINDS[kind.__name__] = kind
        structref.register(kind)
        structref.define_constructor(maker, kind, list(fields))
