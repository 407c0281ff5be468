"""Result files, read back: what `show`, `--alpha` and resuming look at."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from mdstopo.store.contents import FORMAT
from mdstopo.store.errors import DamagedError, StoreError

Array = NDArray[np.generic]

_STATUS = {"running", "converged", "max_iterations", "stalled", "interrupted", "failed"}
_UNFINISHED = {"running", "interrupted"}
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_TROUBLE = (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError, UnicodeError, MemoryError)


@dataclass(frozen=True, slots=True)
class ResultView:
    """A result file's contents.

    kind: the command that made it (`run`, `simulate`, `gradient`). arrays: every numeric dataset that was
    asked for, by its path in the file. texts: every text dataset, one string or several. provenance,
    settings: attributes of these groups.
    """

    path: Path
    kind: str
    status: str
    reason: str
    version: str
    name: str
    title: str
    case_path: str
    case_sha256: str
    arrays: Mapping[str, Array]
    texts: Mapping[str, str | tuple[str, ...]]
    provenance: Mapping[str, str]
    settings: Mapping[str, str | int | float | bool]

    @property
    def finished(self) -> bool:
        """Whether nothing is left to do: only unfinished runs are protected from being replaced."""
        return self.status not in _UNFINISHED

    @property
    def case_text(self) -> str:
        """The case file as it was read."""
        return self.text("case")

    @property
    def alpha(self) -> NDArray[np.float64]:
        """The best design so far, (N,)."""
        return np.asarray(self.array("design/alpha"), dtype=np.float64)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the run warned of."""
        return self.lines("warnings")

    def array(self, path: str) -> Array:
        """One dataset. Raises DamagedError if the file has none of this name."""
        if path not in self.arrays:
            raise DamagedError(f"{self.path}: damaged: it has no {path}")
        return self.arrays[path]

    def text(self, path: str) -> str:
        """One text. Raises DamagedError if the file has none of this name."""
        value = self.texts.get(path)
        if not isinstance(value, str):
            raise DamagedError(f"{self.path}: damaged: it has no {path}")
        return value

    def lines(self, path: str) -> tuple[str, ...]:
        """Several texts; none where the file has none of this name."""
        value = self.texts.get(path, ())
        return (value,) if isinstance(value, str) else value

    def under(self, prefix: str) -> dict[str, Array]:
        """The arrays below a group, by the rest of their paths."""
        start = f"{prefix}/"
        return {path.removeprefix(start): a for path, a in self.arrays.items() if path.startswith(start)}


def read_result(path: Path | str, leave_out: tuple[str, ...] = ()) -> ResultView:
    """Read a result file as a whole, but for the groups in `leave_out`.

    Raises
    ------
    StoreError
        if there is no such file or it cannot be opened.
    DamagedError
        if it is no result of this program, is cut off or damaged, or was written in a later format.
    """
    path = Path(path)
    _check_signature(path)
    arrays: dict[str, Array] = {}
    texts: dict[str, str | tuple[str, ...]] = {}
    with _reading(path), h5py.File(path, "r", locking=False) as file:
        root = dict(file.attrs)
        _check_format(path, root)
        for name, dataset in _datasets(file, leave_out):
            if h5py.check_string_dtype(dataset.dtype) is not None:
                value = dataset.asstr()[()]
                texts[name] = value if isinstance(value, str) else tuple(value.tolist())
            else:
                # An own copy in native order, free of the file.
                arrays[name] = np.asarray(dataset[()])
        view = ResultView(
            path=path,
            kind=str(root["kind"]),
            status=str(root["status"]),
            reason=str(root["reason"]),
            version=str(root["mdstopo"]),
            name=str(root["name"]),
            title=str(root["title"]),
            case_path=str(root["case_path"]),
            case_sha256=str(root["case_sha256"]),
            arrays=arrays,
            texts=texts,
            provenance={key: str(value) for key, value in file["provenance"].attrs.items()},
            settings={key: _plain(value) for key, value in file["settings"].attrs.items()},
        )
    if view.status not in _STATUS:
        raise DamagedError(f"{path}: damaged: its status is {view.status!r}")
    return view


def _check_signature(path: Path) -> None:
    try:
        with path.open("rb") as stream:
            start = stream.read(len(_SIGNATURE))
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    if start != _SIGNATURE:
        what = "is empty" if not start else "is no HDF5 file"
        raise DamagedError(f"{path}: not a result file of mdstopo: it {what}")


def _check_format(path: Path, root: Mapping[str, object]) -> None:
    number = root.get("format")
    if number is None or "case_sha256" not in root or "mdstopo" not in root:
        raise DamagedError(f"{path}: not a result file of mdstopo")
    if not isinstance(number, (int, np.integer)) or number < 1:
        raise DamagedError(f"{path}: damaged: its format is {number!r}")
    if number > FORMAT:
        raise DamagedError(
            f"{path}: written in format {number} by mdstopo {root['mdstopo']}; this version reads up to format {FORMAT}"
        )


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever HDF5 makes of a broken file becomes one sentence."""
    try:
        yield
    except _TROUBLE as error:
        sentence = " ".join(str(error).split())
        raise DamagedError(f"{path}: damaged or cut off: {sentence}") from error


def _datasets(
    group: "h5py.Group", leave_out: tuple[str, ...], prefix: str = ""
) -> Iterator[tuple[str, "h5py.Dataset"]]:
    for key in group:
        path = f"{prefix}{key}"
        if path in leave_out:
            continue
        node = group[key]  # not .items(), which gives None for what is broken
        if isinstance(node, h5py.Group):
            yield from _datasets(node, leave_out, f"{path}/")
        elif isinstance(node, h5py.Dataset):
            yield path, node


def _plain(value: object) -> str | int | float | bool:
    plain = value.item() if isinstance(value, np.generic) else value
    return plain if isinstance(plain, (str, int, float, bool)) else str(plain)
