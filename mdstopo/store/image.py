"""A result file as bytes: HDF5 made in memory, so that the disk sees one plain write.

HDF5 is never open on a file that is being written: errors of the disk come from the write itself, and
nothing is held open between writes. Arrays carry checksums, and so does the whole, so that damage is found on reading.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import h5py
import numpy as np
from h5py import h5a, h5d, h5ds, h5g, h5o, h5p, h5s, h5t
from numpy.typing import NDArray

from mdstopo.store.seal import seal

Value = NDArray[np.generic] | str | Sequence[str]
Attribute = str | int | float | bool

# Readable by HDF5 1.10 (2016) and later; the older default lays metadata down without checksums.
_FORMAT = ("v110", "v110")
_BLOCK = 1 << 16


def encode(
    attributes: Mapping[str, Mapping[str, Attribute]],
    datasets: Mapping[str, Value],
    scales: Mapping[str, Sequence[str]] | None = None,
) -> bytes:
    """The bytes of an HDF5 file, sealed with its attributes (`store.seal`).

    Parameters
    ----------
    attributes
        of each group, by its path; the root's under "".
    datasets
        by path: arrays, texts, or lists of texts; text is UTF-8.
    scales
        by path of a dataset: the dataset that is the scale of each of its dimensions, or "".
    """
    size = sum(value.nbytes for value in datasets.values() if isinstance(value, np.ndarray))
    with h5py.File(
        "result", "w", driver="core", backing_store=False, libver=_FORMAT, block_size=max(_BLOCK, size // 8)
    ) as file:
        writer = _Writer(file)
        for path, value in datasets.items():
            writer.write(path, value)
        for path, pairs in attributes.items():
            writer.describe(path, pairs)
        writer.attach(scales or {})
        file.flush()
        image: bytes = file.id.get_file_image()
    return seal(image, head_of(attributes).encode())


def head_of(attributes: Mapping[str, Mapping[str, Attribute]]) -> str:
    """Attributes of groups as JSON, {path: {name: value}}."""
    plain = {path: {key: _plain(value) for key, value in pairs.items()} for path, pairs in attributes.items()}
    return json.dumps(plain)


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def texts(values: Sequence[str]) -> NDArray[np.bytes_]:
    """Texts as one array of fixed length: a million group names take no million allocations."""
    encoded = [_encoded(value) for value in values]
    length = max((len(value) for value in encoded), default=1) or 1
    return np.array(encoded, dtype=f"S{length}")


def as_array(value: Value) -> NDArray[np.generic]:
    """A dataset's value as the array that the file holds, texts with a fixed length."""
    if isinstance(value, str):
        array: NDArray[np.generic] = texts([value]).reshape(())
    elif not isinstance(value, np.ndarray):
        array = texts(value)
    else:
        array = value if value.ndim == 0 else np.ascontiguousarray(value)
    return array.astype(h5py.string_dtype(length=array.dtype.itemsize)) if array.dtype.kind == "S" else array


def _encoded(text: str) -> bytes:
    """UTF-8 for HDF5, whose texts end at the first NUL; what is no Unicode (from a file's name) becomes a mark."""
    return text.replace("\0", "\N{REPLACEMENT CHARACTER}").encode(errors="replace")


class _Writer:
    """Makes a file through h5py's low-level interface, at a third of the cost of `create_dataset` and its like.

    A file has some seventy of them, most of them small, and every checkpoint writes them all.
    """

    def __init__(self, file: "h5py.File") -> None:
        self._file = file.id
        self._made: dict[str, Any] = {"": file.id}
        self._words = h5t.py_create(h5py.string_dtype(), logical=True)
        self._one = h5s.create(h5s.SCALAR)
        self._links = h5p.create(h5p.LINK_CREATE)
        self._links.set_char_encoding(h5t.CSET_UTF8)
        self._plain = _without_times(h5p.DATASET_CREATE)
        self._group = _without_times(h5p.GROUP_CREATE)

    def write(self, path: str, value: Value) -> None:
        """One dataset, the groups above it included."""
        array = as_array(value)
        kind = h5t.py_create(array.dtype, logical=True)
        space = self._one if array.ndim == 0 else h5s.create_simple(array.shape)
        layout = self._plain
        if array.size and array.ndim:
            layout = _without_times(h5p.DATASET_CREATE)
            layout.set_chunk(_chunks(array))
            layout.set_fletcher32()
        dataset = h5d.create(self._file, None, kind, space, layout)
        if array.size:
            dataset.write(h5s.ALL, h5s.ALL, array)
        self._enter(path, dataset)

    def _enter(self, path: str, made: Any) -> None:
        above = path.rpartition("/")[0]
        if above not in self._made:
            self._enter(above, h5g.create(self._file, None, gcpl=self._group))
        h5o.link(made, self._file, path.encode(errors="surrogateescape"), self._links)
        self._made[path] = made

    def describe(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        """Attributes of a dataset, or of a group, which is made where there is none."""
        if path not in self._made:
            self._enter(path, h5g.create(self._file, None, gcpl=self._group))
        for key, value in attributes.items():
            words = isinstance(value, str)
            data = np.array(_encoded(str(value)), dtype=h5py.string_dtype()) if words else np.array(value)
            kind = self._words if words else h5t.py_create(data.dtype, logical=True)
            h5a.create(self._made[path], key.encode(), kind, self._one).write(data)

    def attach(self, scales: Mapping[str, Sequence[str]]) -> None:
        """Dimension scales, named as their datasets."""
        scaled: set[str] = set()
        for path, names in scales.items():
            for axis, scale in enumerate(names):
                if not scale:
                    continue
                if scale not in scaled:
                    h5ds.set_scale(self._made[scale], scale.split("/")[-1].encode())
                    scaled.add(scale)
                h5ds.attach_scale(self._made[path], self._made[scale], axis)


def _without_times(kind: Any) -> Any:
    """Properties of objects that do not keep when they were made: the same content makes the same bytes."""
    properties = h5p.create(kind)
    properties.set_obj_track_times(False)
    return properties


def _chunks(array: NDArray[np.generic]) -> tuple[int, ...]:
    """Whole, but for arrays so large that a chunk could not be (HDF5 allows 4 GiB)."""
    row = max(1, array.nbytes // array.shape[0])
    rows = max(1, min(array.shape[0], (1 << 28) // row))
    return (rows, *array.shape[1:])
