"""A scene as a binary glTF 2.0 file: numbers in a buffer, and the JSON that says what they are.

Khronos Group, glTF 2.0 specification (ISO/IEC 12113:2022), sections 3.6 (accessors) and 4.4 (the binary container).
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: of accessors: float32 and uint32; what buffer views are for
FLOAT, UNSIGNED, VERTICES, INDICES = 5126, 5125, 34962, 34963
#: of primitives
POINTS, LINES, TRIANGLES = 0, 1, 4
_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class GltfFile:
    """What a file is put together from. parts: its top-level arrays; entries refer to each other by index."""

    def __init__(self, generator: str) -> None:
        self.parts: dict[str, list[dict[str, Any]]] = {}
        self._asset = {"version": "2.0", "generator": generator}
        self._data = bytearray()

    def add(self, part: str, **entry: Any) -> int:
        """The index of a new entry of one of the top-level arrays (nodes, meshes, materials, ...)."""
        entries = self.parts.setdefault(part, [])
        entries.append(entry)
        return len(entries) - 1

    def numbers(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """The index of an accessor for float32 values (n,) or (n, k), or uint32 where they are integers.

        target: VERTICES or INDICES where a mesh uses them; bounds: with their smallest and largest.
        """
        whole = np.issubdtype(values.dtype, np.integer)
        stored = np.ascontiguousarray(values, dtype="<u4" if whole else "<f4")
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._data), "byteLength": stored.nbytes}
        if target is not None:
            view["target"] = target
        self._data += stored.tobytes()  # of four-byte numbers: the next view is aligned
        entry: dict[str, Any] = {
            "bufferView": self.add("bufferViews", **view),
            "componentType": UNSIGNED if whole else FLOAT,
            "count": len(stored),
            "type": _TYPES[1 if stored.ndim == 1 else stored.shape[1]],
        }
        if bounds:
            entry["min"], entry["max"] = (np.atleast_1d(f(stored, axis=0)).tolist() for f in (np.min, np.max))
        return self.add("accessors", **entry)

    def binary(self) -> bytes:
        """The bytes of the whole file."""
        document: dict[str, Any] = {"asset": self._asset, "scene": 0, **self.parts}
        document["buffers"] = [{"byteLength": len(self._data)}]
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(self._data), _BIN) + self._data
        return struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks)) + chunks
