"""Result files, read back: what `show`, `--alpha` and resuming read."""

import json
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from mdstopo.store.contents import FORMAT
from mdstopo.store.seal import Seal, read_seal
from mdstopo.store.store_errors import DamagedError, StoreError
from mdstopo.store.untrusted import check_heaps, contents_of, integer_attribute

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
        """The text of the case file as it was read."""
        return self.text("case")

    @property
    def alpha(self) -> NDArray[np.float64]:
        """(N,) alpha of the best design so far."""
        return np.asarray(self.array("design/alpha"), dtype=np.float64)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the run, in words."""
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
    seal = _sealed(path)
    with _reading(path), h5py.File(path, "r", locking=False) as file:
        if not seal.head:  # an earlier version's, or another program has changed it
            _check_number(path, integer_attribute(file.id, b"format"))
            check_heaps(path.read_bytes())
        head = json.loads(seal.head) if seal.head else _attributes(file)
        root = head[""]
        _check_number(path, root.get("format"))
        if "case_sha256" not in root or "mdstopo" not in root:
            raise DamagedError(f"{path}: not a result file of mdstopo")
        arrays, texts = contents_of(file.id, path.stat().st_size, leave_out, varying=not seal.head)
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
            provenance={key: str(value) for key, value in head["provenance"].items()},
            settings={key: _plain(value) for key, value in head["settings"].items()},
        )
    if view.status not in _STATUS:
        raise DamagedError(f"{path}: damaged: its status is {view.status!r}")
    return view


def _sealed(path: Path) -> Seal:
    """The seal of a file that is HDF5 and as it was written. Raises StoreError, DamagedError."""
    try:
        with open(path, "rb", opener=_open_at_once) as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise StoreError(f"{path}: cannot be read: it is no file on a disk")
            start = stream.read(len(_SIGNATURE))
            seal = read_seal(stream)
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    if start != _SIGNATURE:
        what = "is empty" if not start else "is no HDF5 file"
        raise DamagedError(f"{path}: not a result file of mdstopo: it {what}")
    if seal.whole is False:
        raise DamagedError(f"{path}: damaged or cut off: its length or its checksum is not that of its contents")
    return seal


def _open_at_once(path: str, flags: int) -> int:
    """Open a file as `open` does; a pipe, too, without waiting for its writer."""
    return os.open(path, flags | os.O_NONBLOCK)


def _check_number(path: Path, number: object) -> None:
    """Refuse another program's file, and a later format."""
    if number is None:
        raise DamagedError(f"{path}: not a result file of mdstopo")
    if not isinstance(number, (int, np.integer)) or number < 1:
        raise DamagedError(f"{path}: damaged: its format is {number!r}")
    if number > FORMAT:
        raise DamagedError(f"{path}: written in format {number}; this version of mdstopo reads up to format {FORMAT}")


def _attributes(file: "h5py.File") -> dict[str, dict[str, object]]:
    """The attributes of groups in a file of an earlier version, or that another program changed."""
    return {path: dict(file[path or "/"].attrs) for path in ("", "provenance", "settings")}


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever HDF5 makes of a broken file becomes one sentence."""
    try:
        yield
    except DamagedError as error:
        raise (error if error.args[0].startswith(str(path)) else DamagedError(f"{path}: {error}")) from None
    except _TROUBLE as error:
        sentence = " ".join(str(error).split())
        raise DamagedError(f"{path}: damaged or cut off: {sentence}") from error


def _plain(value: object) -> str | int | float | bool:
    plain = value.item() if isinstance(value, np.generic) else value
    return plain if isinstance(plain, (str, int, float, bool)) else str(plain)
