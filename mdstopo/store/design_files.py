"""A design read from a file: `--alpha FILE`."""

import re
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError  # numpy parses the header of a .npy file as Python

import numpy as np
from numpy.typing import NDArray

from mdstopo.store.result_reader import ResultView, read_result
from mdstopo.store.store_errors import StoreError
from mdstopo.store.whole_front import design_of, points_of

_NOT_NEEDED = ("trajectories", "sensitivities", "optimizer", "members", "pareto/tasks", "pareto/visited")
_SUFFIXES = ".npy, .txt or .h5 (a result file)"


def read_design(path: Path | str, count: int, parts: Mapping[str, slice] | None = None) -> NDArray[np.float64]:
    """The design variables in a file, (count,).

    `.npy` holds one array, `.txt` numbers separated by blanks or lines (text after # is ignored), `.h5` is a
    result file, whose best design is taken, `front.h5:3` the design of point 3 of a front. parts: where the values of
    the case's variables stand in a design, by name; a file that has them gives them behind alpha.

    Raises
    ------
    StoreError
        if the file cannot be read, does not hold `count` numbers, or holds negative or non-finite ones.
    """
    path, point = place_of(str(path))
    if path.suffix.lower() in (".h5", ".hdf5"):
        view = read_result(path, leave_out=_NOT_NEEDED)
        alpha = _checked(path, _read_h5(view) if point is None else _read_front(view, point), count)
        return with_values(view, point, alpha, parts or {})
    reader = {".npy": _read_npy, ".txt": _read_text}.get(path.suffix.lower())
    if reader is None:
        raise StoreError(f"{path}: a design is read from {_SUFFIXES}, not from {path.suffix or 'a bare name'!r}")
    found = np.squeeze(reader(path))
    length = max((part.stop for part in (parts or {}).values()), default=count)
    if parts and found.shape == (length,):
        return np.concatenate(
            [_checked(path, found[:count], count), _finite(path, found[count:], "values of variables")]
        )
    return _checked(path, found, count)


def with_values(
    view: ResultView, point: int | None, alpha: NDArray[np.float64], parts: Mapping[str, slice]
) -> NDArray[np.float64]:
    """alpha with the values of all variables behind it where the file has them; alpha alone where it has none.

    point: of a front; None takes the best design of a run. parts: as of `read_design`. Raises StoreError where the file
    has only some of them, or others.
    """
    if point is None:
        values = view.under("design/variables")
    else:
        found = design_of(view, point)
        values = {} if found is None else found[1]
    own = {name: values.get(name) for name in parts}
    if all(values is None for values in own.values()):
        return alpha
    pieces = [alpha]
    for name, part in parts.items():
        if own[name] is None:
            raise StoreError(f"{view.path}: it holds no values of the design variable {name}")
        chosen = np.asarray(own[name], dtype=np.float64)
        if chosen.shape != (part.stop - part.start,):
            raise StoreError(
                f"{view.path}: it holds {chosen.size} values of the design variable {name}; the case has "
                f"{part.stop - part.start}"
            )
        pieces.append(_finite(view.path, chosen, name))
    return np.concatenate(pieces)


def _finite(path: Path, values: NDArray[np.float64], what: str) -> NDArray[np.float64]:
    if not np.isfinite(values).all():
        raise StoreError(f"{path}: {what} must be finite; found {values[~np.isfinite(values)][0]}")
    return values


def place_of(text: str) -> tuple[Path, int | None]:
    """The file and the point of a front that a text names: `front.h5:3` is point 3."""
    found = re.fullmatch(r"(.+\.(?:h5|hdf5)):(\d+)", text, re.IGNORECASE)
    if found is None or Path(text).exists():
        return Path(text), None
    return Path(found[1]), int(found[2])


def _checked(path: Path, alpha: NDArray[np.float64], count: int) -> NDArray[np.float64]:
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


def _read_h5(view: ResultView) -> NDArray[np.float64]:
    path = view.path
    if view.kind == "pareto":
        last = points_of(view) - 1
        raise StoreError(f"{path}: a front has several designs; write {path}:K with K from 0 to {last}")
    if "design/alpha" not in view.arrays:
        raise StoreError(f"{path}: this result of `{view.kind}` holds no design")
    return np.squeeze(view.alpha)


def _read_front(view: ResultView, point: int) -> NDArray[np.float64]:
    path = view.path
    if "pareto/alpha" not in view.arrays:
        raise StoreError(f"{path}: a result of `{view.kind}` has no points")
    found = design_of(view, point)
    if found is None:
        raise StoreError(f"{path}: there is no point {point}; the front has 0 to {points_of(view) - 1}")
    return np.asarray(found[0], dtype=np.float64)
