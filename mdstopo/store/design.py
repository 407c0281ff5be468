"""A design read from a file: `--alpha FILE`."""

from pathlib import Path
from tokenize import TokenError  # numpy parses the header of a .npy file as Python

import numpy as np
from numpy.typing import NDArray

from mdstopo.store.errors import StoreError
from mdstopo.store.reader import read_result

_SUFFIXES = ".npy, .txt or .h5 (a result file)"


def read_design(path: Path | str, count: int) -> NDArray[np.float64]:
    """The design variables in a file, (count,).

    `.npy` holds one array, `.txt` numbers separated by blanks or lines (text after # is ignored), `.h5` is a
    result file, whose best design is taken.

    Raises
    ------
    StoreError
        if the file cannot be read, does not hold `count` numbers, or holds negative or non-finite ones.
    """
    path = Path(path)
    reader = {".npy": _read_npy, ".txt": _read_text, ".h5": _read_h5, ".hdf5": _read_h5}.get(path.suffix.lower())
    if reader is None:
        raise StoreError(f"{path}: a design is read from {_SUFFIXES}, not from {path.suffix or 'a bare name'!r}")
    alpha = np.squeeze(reader(path))
    if alpha.ndim == 0 and count == 1:
        alpha = alpha.reshape(1)
    if alpha.ndim != 1 or len(alpha) != count:
        shape = " x ".join(str(n) for n in alpha.shape) or "1"
        raise StoreError(f"{path}: it holds {shape} values; the case has {count} design variables")
    wrong = np.flatnonzero(~(np.isfinite(alpha) & (alpha >= 0.0)))
    if len(wrong):
        first = int(wrong[0])
        raise StoreError(
            f"{path}: alpha must be finite and not negative; value {first} (from 0) is {alpha[first]}"
            + (f", and {len(wrong) - 1} more are wrong" if len(wrong) > 1 else "")
        )
    return np.ascontiguousarray(alpha)


def _read_npy(path: Path) -> NDArray[np.float64]:
    try:
        array = np.load(path, allow_pickle=False)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, EOFError, SyntaxError, TokenError, MemoryError, OverflowError) as error:
        raise StoreError(f"{path}: not an array of numbers") from error
    if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
        raise StoreError(f"{path}: not an array of real numbers")
    return array.astype(np.float64)


def _read_text(path: Path) -> NDArray[np.float64]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: not a text file") from error
    values: list[float] = []
    for number, line in enumerate(text.splitlines(), start=1):
        for word in line.partition("#")[0].replace(",", " ").split():
            try:
                values.append(float(word))
            except ValueError as error:
                raise StoreError(f"{path}:{number}: {word!r} is not a number") from error
    return np.array(values, dtype=np.float64)


def _read_h5(path: Path) -> NDArray[np.float64]:
    return read_result(path, leave_out=("trajectories", "sensitivities", "optimizer", "members")).alpha
