"""Replace a file as a whole or not at all.

A file is written beside its final place, flushed to the disk, and moved over the old one in a single step of
the file system; whatever kills the process, a reader finds the old file or the new one.
"""

import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from mdstopo.store.store_errors import WriteError


def replace_file(path: Path, data: bytes, check: Callable[[Path], None] | None = None) -> None:
    """Make `path` hold `data`, atomically and durably.

    check: is given the file that is about to take the place; what it raises keeps that from happening.

    Raises
    ------
    WriteError
        if the file system refuses; the previous file is then unharmed.
    """
    temporary = path.with_name(f"{_prefix(path)}{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:
        try:
            # Not tempfile.mkstemp: that makes files which only the owner can read, whatever the umask says.
            descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
            with os.fdopen(descriptor, "wb", buffering=0) as stream:
                rest = memoryview(data)
                while rest:  # a raw write may take less than it is given
                    rest = rest[stream.write(rest) :]
                os.fsync(stream.fileno())
            if check is not None:
                check(temporary)
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        _sync_directory(path.parent)
    except OSError as error:
        raise WriteError(f"{path}: cannot be written: {error.strerror or error}") from error


def remove_leftovers(path: Path) -> int:
    """Delete temporary files which writers of `path` that died have left; the number of them.

    Only for the holder of the lock on `path`: nobody else writes to it, so all there are have no writer any
    more.
    """
    prefix = _prefix(path)
    count = 0
    leftovers: list[str] = []
    with suppress(OSError), os.scandir(path.parent) as entries:  # a folder whose contents may not be listed
        leftovers = [e.path for e in entries if e.name.startswith(prefix) and e.name.endswith(".tmp")]
    for leftover in leftovers:
        with suppress(OSError):  # a folder of that name, which is none of ours
            os.unlink(leftover)
            count += 1
    return count


def _prefix(path: Path) -> str:
    return f".{path.name}."


def _sync_directory(directory: Path) -> None:
    """Make the move itself durable."""
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError:
        # Some file systems cannot flush a directory; the file itself is safe.
        pass
    finally:
        os.close(descriptor)
