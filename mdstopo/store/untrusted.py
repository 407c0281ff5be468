"""What is read of a result file, which may come from anybody.

Only the names that this program gives, reached by plain links, each once; only data that lie in the file itself, as
they are, so that nothing read is larger than the file. Other HDF5 (links to other places, compressed, virtual and
external datasets) is refused: following it would read other files, or more than there is memory.
"""

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from h5py import h5a, h5d, h5g, h5l, h5o, h5s, h5t, h5z
from numpy.typing import NDArray

from mdstopo.store.store_errors import DamagedError

Array = NDArray[np.generic]
Texts = dict[str, str | tuple[str, ...]]

#: what stands at the top of a file; others are none of ours and are not read
_KNOWN = frozenset(
    {
        "candidates",
        "case",
        "catalogue",
        "combine",
        "design",
        "differences",
        "failures",
        "files",
        "fit",
        "iterations",
        "members",
        "objectives",
        "optimizer",
        "pareto",
    }
    | {"provenance", "resume", "sensitivities", "settings", "starts", "sweep", "trajectories", "uncertainty"}
    | {"warnings"}
)
_DEEPEST = 12  # groups within groups, more than any file has
_KINDS = "biufS"  # of numbers and fixed-length texts, in NumPy's letters

_HEAP, _HEAP_VERSION = b"GCOL", 1
_HEAP_START, _HEAP_OBJECT = struct.Struct("<4sB3xQ"), struct.Struct("<HH4xQ")


def contents_of(
    file: "h5g.GroupID", length: int, leave_out: tuple[str, ...], varying: bool
) -> tuple[dict[str, Array], Texts]:
    """Numbers and texts of a file by their paths, but for the groups in `leave_out`.

    length: of the file, bytes. varying: whether texts may be of variable length, as in earlier versions; their heaps
    have to be checked before (`check_heaps`). Raises DamagedError, and what HDF5 raises where it is broken.
    """
    arrays: dict[str, Array] = {}
    texts: Texts = {}
    left = length
    for path, dataset in _datasets(file, frozenset(leave_out), "", 0, set()):
        dtype, words = _checked_type(path, dataset, varying)
        left -= dataset.get_space().get_simple_extent_npoints() * dtype.itemsize
        if left < 0:
            raise DamagedError(f"damaged: {path} is larger than the file")
        data = np.empty(dataset.shape, dtype=dtype)
        if data.size:
            dataset.read(h5s.ALL, h5s.ALL, data)
        if words:
            texts[path] = _decoded(data)
        else:
            arrays[path] = data
    return arrays, texts


def integer_attribute(place: Any, name: bytes) -> int | None:
    """An attribute that is one integer; None where there is none, or another."""
    if not h5a.exists(place, name):
        return None
    attribute = h5a.open(place, name)
    if attribute.dtype.kind not in "iu" or attribute.shape != ():
        return None
    value = np.empty((), dtype=attribute.dtype)
    attribute.read(value)
    return int(value)


def _datasets(
    group: "h5g.GroupID", leave_out: frozenset[str], prefix: str, depth: int, seen: set[int]
) -> Iterator[tuple[str, "h5d.DatasetID"]]:
    """Datasets below a group with their paths. seen: addresses of what has been met."""
    if depth > _DEEPEST:
        raise DamagedError(f"damaged: groups within groups at {prefix}")
    for name in group:
        path = prefix + name.decode(errors="surrogateescape")
        if path in leave_out or (not prefix and path not in _KNOWN):
            continue
        if group.links.get_info(name).type != h5l.TYPE_HARD:
            raise DamagedError(f"not as mdstopo writes it: {path} is a link to another place")
        node = h5o.open(group, name)
        address = h5o.get_info(node).addr
        if address in seen:
            raise DamagedError(f"not as mdstopo writes it: {path} is there under another name, too")
        seen.add(address)
        if isinstance(node, h5g.GroupID):
            yield from _datasets(node, leave_out, f"{path}/", depth + 1, seen)
        elif isinstance(node, h5d.DatasetID):
            yield path, node


def _checked_type(path: str, dataset: "h5d.DatasetID", varying: bool) -> tuple[np.dtype[Any], bool]:
    """The type of a dataset's items that may be read, and whether they are texts. Raises DamagedError for others."""
    made = dataset.get_create_plist()
    if made.get_layout() == h5d.VIRTUAL or made.get_external_count():
        raise DamagedError(f"not as mdstopo writes it: {path} lies in another file")
    if {made.get_filter(k)[0] for k in range(made.get_nfilters())} - {h5z.FILTER_FLETCHER32}:
        raise DamagedError(f"not as mdstopo writes it: {path} is compressed")
    kind = dataset.get_type()
    if isinstance(kind, h5t.TypeStringID):
        if kind.is_variable_str() and not varying:
            raise DamagedError(f"not as mdstopo writes it: {path} is text of variable length")
        return kind.dtype, True
    dtype: np.dtype[Any] = kind.dtype
    if dtype.kind not in _KINDS or dtype.shape:
        raise DamagedError(f"not as mdstopo writes it: {path} holds neither numbers nor text")
    return dtype, False


def _decoded(data: Array) -> str | tuple[str, ...]:
    words = [item.decode() if isinstance(item, bytes) else str(item) for item in data.ravel().tolist()]
    return words[0] if data.ndim == 0 else tuple(words)


def check_heaps(data: bytes) -> None:
    """Walk through every heap of texts of variable length as HDF5 does, which hangs or crashes on damaged ones.

    Raises DamagedError where one is not whole.
    """
    place = data.find(_HEAP)
    while place >= 0:
        if data[place + 4 : place + 5] == bytes([_HEAP_VERSION]):
            _check_heap(data, place)
        place = data.find(_HEAP, place + 1)


def _check_heap(data: bytes, start: int) -> None:
    broken = DamagedError("damaged or cut off: a heap of texts is not whole")
    try:
        _, _, size = _HEAP_START.unpack_from(data, start)
        end, place = start + size, start + _HEAP_START.size
        if end > len(data) or size < _HEAP_START.size:
            raise broken
        while end - place >= _HEAP_OBJECT.size:
            index, _, held = _HEAP_OBJECT.unpack_from(data, place)
            # the free rest counts its own start, what is held does not
            step = held if index == 0 else _HEAP_OBJECT.size + (held + 7) // 8 * 8
            if step < _HEAP_OBJECT.size or place + step > end:
                raise broken
            place += step
    except struct.error:
        raise broken from None
