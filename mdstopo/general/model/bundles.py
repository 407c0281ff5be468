"""Bundles of arrays that kernels hand to each other as one pointer.

A named tuple of thirty arrays is two hundred arguments to the compiler, at every call; a reference to a structure is
one. Inside kernels a structure is made and read like a named tuple; Python never sees one.
"""

from importlib import import_module
from typing import Any

from mdstopo.compiler.kernel import way, when_compiling

#: the module that types of structures are said to be in, and what their names end with
PLACE, ENDING = "mdstopo.general.structures", "Structure"
#: the types that are made by now, by name; `general.structures` has them all
KINDS: dict[str, type] = {}


def bundle(maker: type, fields: tuple[str, ...]) -> None:
    """Register how `maker(...)` in kernels makes a structure from its fields, in their order; each maker has its own
    type."""

    @when_compiling
    def register() -> None:
        from numba import types
        from numba.experimental import structref

        # a type is kept by its name only where the module that has it is loaded; else a copy of it is
        import_module(PLACE)

        def preprocess_fields(self: Any, given: Any) -> Any:
            """Literal types would make every literal another structure."""
            return tuple((name, types.unliteral(kind)) for name, kind in given)

        members = {"preprocess_fields": preprocess_fields, "__module__": PLACE}
        kind = type(f"{maker.__name__}{ENDING}", (types.StructRef,), members)
        KINDS[kind.__name__] = kind
        structref.register(kind)
        way().enter_structure(maker, kind, fields)
