"""Bundles of arrays that kernels hand to each other as one pointer.

A named tuple of thirty arrays is two hundred arguments to the compiler, at every call; a reference to a structure is
one. Inside kernels a structure is made and read like a named tuple; Python never sees one.
"""

from typing import Any

from mdstopo.compiler.kernel import numba, way, when_compiling

_KINDS: dict[str, type] = {}
_ENDING = "Structure"


def __getattr__(name: str) -> type:
    """The types of structures, made when something is compiled.

    Numba's disk cache asks this module for them, also in a process that compiles kernels for scenes without any: a
    kernel's cache lists all the types that it was ever compiled for.
    """
    if name.endswith(_ENDING) and name not in _KINDS:
        from mdstopo.general import (  # noqa: F401 (which have them)
            accelerations,
            dense_output,
            gauss_window,
            general_model,
            generalized_alpha_step,
            priced_candidates,
            step_history,
        )

        numba()
    try:
        return _KINDS[name]
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None


def __dir__() -> list[str]:
    """The module's own names and the types that are made by now."""
    return sorted({*globals(), *_KINDS})


def bundle(maker: type, fields: tuple[str, ...]) -> None:
    """Register how `maker(...)` in kernels makes a structure from its fields, in their order; each maker has its own
    type."""

    @when_compiling
    def register() -> None:
        from numba import types
        from numba.experimental import structref

        def preprocess_fields(self: Any, given: Any) -> Any:
            """Literal types would make every literal another structure."""
            return tuple((name, types.unliteral(kind)) for name, kind in given)

        members = {"preprocess_fields": preprocess_fields, "__module__": __name__}
        kind = type(f"{maker.__name__}{_ENDING}", (types.StructRef,), members)
        _KINDS[kind.__name__] = kind
        structref.register(kind)
        way().enter_structure(maker, kind, fields)
