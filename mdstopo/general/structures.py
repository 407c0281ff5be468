"""Bundles of arrays that kernels hand to each other as one pointer.

A named tuple of thirty arrays is two hundred arguments to the compiler, at every call; a reference to a structure is
one. Inside kernels a structure is made and read like a named tuple; Python never sees one.
"""

from typing import Any

from numba import types
from numba.experimental import structref


class Structure(types.StructRef):
    """Numba's type of a bundle; each bundle derives its own from this."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Literal types would make every literal another structure."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)


@structref.register
class ModelStructure(Structure):
    """A `general.model.GeneralModel`."""


@structref.register
class DeskStructure(Structure):
    """A `general.balance.Desk`."""


@structref.register
class TrackStructure(Structure):
    """A `general.track.Track`."""


def bundle(maker: type, kind: type, fields: tuple[str, ...]) -> None:
    """Let `maker(...)` in kernels make a structure of type `kind` from its fields, in their order."""
    structref.define_constructor(maker, kind, list(fields))
