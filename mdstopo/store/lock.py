"""One writer for one result file.

The lock is held on a small file beside the result, with `flock`: the kernel gives it back when its holder
ends, however it ends, so there are no stale locks to judge and no process id that another program may have
inherited. The file's text only says who holds it.
"""

import errno
import fcntl
import os
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from mdstopo.compiler.trusted import NotOursError, open_lock
from mdstopo.store.store_errors import InUseError, StoreError

_LONGEST = 300  # bytes of a holder's name
_UNSUPPORTED = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}


class Lock:
    """The right to write one result file; a context manager.

    Raises
    ------
    InUseError
        on entering, if another process holds it; the message names its process id.
    StoreError
        on entering, if no file can be made beside the result, or what is there is no file of this user's: a symbolic
        link is not followed, as what it points to would be overwritten.
    """

    def __init__(self, path: Path) -> None:
        self._result = path
        self._path = path.with_name(f".{path.name}.lock")
        self._descriptor: int | None = None

    def __enter__(self) -> "Lock":
        while self._descriptor is None:
            descriptor = self._open()
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                try:
                    raise self._in_use(descriptor) from error
                finally:
                    os.close(descriptor)
            except OSError as error:
                if error.errno not in _UNSUPPORTED:
                    os.close(descriptor)
                    raise StoreError(f"{self._path}: cannot be locked: {error.strerror}") from error
                # A file system without locks: better to run than to refuse every run.
            if _is_at(descriptor, self._path):
                self._descriptor = descriptor
            else:
                # The last holder removed the file between our opening and locking it.
                os.close(descriptor)
        with suppress(OSError):  # on a full disk the lock holds all the same, only without a name
            os.ftruncate(self._descriptor, 0)
            os.write(self._descriptor, f"{os.getpid()} {os.uname().nodename}\n".encode())
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._descriptor is not None:
            # Removed while still held: whoever opened it meanwhile sees that it is gone and makes a new one.
            with suppress(OSError):
                self._path.unlink(missing_ok=True)
            os.close(self._descriptor)
            self._descriptor = None

    def _open(self) -> int:
        try:
            return open_lock(self._path)
        except NotOursError as error:
            raise StoreError(f"{self._path}: cannot be the lock on {self._result.name}: {error}") from error
        except OSError as error:
            raise StoreError(f"{self._result}: no file can be made in {self._path.parent}: {error.strerror}") from error

    def _in_use(self, descriptor: int) -> InUseError:
        pid, host = _holder(descriptor)
        where = f" on {host}" if host not in (None, os.uname().nodename) else ""
        who = f"process {pid}{where}" if pid is not None else "another process"
        return InUseError(f"{self._result} is in use by {who}", pid, host)


def _holder(descriptor: int) -> tuple[int | None, str | None]:
    # The holder may have the lock and not yet have written its name.
    for _ in range(20):
        words = os.pread(descriptor, _LONGEST, 0).split()
        if len(words) == 2 and words[0].isdigit():
            return int(words[0]), words[1].decode(errors="replace")
        time.sleep(0.01)
    return None, None


def _is_at(descriptor: int, path: Path) -> bool:
    """Is the open file still the one that has this name?"""
    try:
        named = os.lstat(path)
    except FileNotFoundError:
        return False
    held = os.fstat(descriptor)
    return (held.st_dev, held.st_ino) == (named.st_dev, named.st_ino)
