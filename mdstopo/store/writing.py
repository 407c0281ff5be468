"""A result as a whole into its file; what a process writes first is read back before it replaces anything."""

from pathlib import Path

import h5py
import numpy as np
from h5py import h5d, h5s

from mdstopo.store.atomic import replace_file
from mdstopo.store.contents import Contents, Datasets, result_image
from mdstopo.store.image import as_array
from mdstopo.store.seal import read_seal
from mdstopo.store.store_errors import UnreadableError

#: files that this process has written, and read back when it did so first
_written: set[Path] = set()


def write_result(path: Path, contents: Contents) -> None:
    """Replace a result file.

    Raises WriteError where the file system refuses, UnreadableError where what was written cannot be read again; the
    file is then as it was.
    """
    first = path not in _written
    replace_file(path, result_image(contents), (lambda made: read_back(made, contents.datasets)) if first else None)
    _written.add(path)


def read_back(path: Path, datasets: Datasets) -> None:
    """Compare a file with what it is to hold. Raises UnreadableError, with the versions that made it."""
    try:
        with path.open("rb") as stream:
            wrong = "" if read_seal(stream).whole else "its checksum differs"
        with h5py.File(path, "r", locking=False) as file:
            for name, value in datasets.items():
                wanted = as_array(value)
                dataset = h5d.open(file.id, name.encode(errors="surrogateescape"))
                found = np.empty(dataset.shape, dtype=wanted.dtype)
                if found.size:
                    dataset.read(h5s.ALL, h5s.ALL, found)
                if found.shape != wanted.shape or found.tobytes() != wanted.tobytes():
                    wrong = f"{name} differs"
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
        wrong = " ".join(str(error).split())
    if wrong:
        raise UnreadableError(
            f"{path.parent}: a result that was just written there cannot be read back ({wrong}): "
            f"h5py {h5py.__version__} with HDF5 {h5py.version.hdf5_version}, NumPy {np.__version__}"
        )
