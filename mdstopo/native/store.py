"""Machine code on the disk: one folder for exactly these sources and versions, one file for an entry and its types."""

import contextlib
import functools
import hashlib
import json
import os
import sys
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mdstopo.installed import version_of

_ROOMS = ("general", "mechanics", "integrators", "responses", "sensitivity", "optimizer", "scene", "native")
_COMPILER = ("numba", "llvmlite", "numpy")
_SETTINGS = ("NUMBA_OPT", "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX", "NUMBA_LOOP_VECTORIZE")
_MAGIC = b"mdstopo code 1\n"

#: the functions in the glue that Python calls: with what `Native.block_of` fills, and with what is prepared
CALL, PREPARED = "mdstopo_call", "mdstopo_prepared"


class Code(NamedTuple):
    """Machine code of an entry.

    body, glue: object files, of the entry and of the function that calls it. result: a letter for each number that it
    returns (i integer, f float, b truth), in parentheses for a tuple, which is empty where it returns nothing.
    """

    body: bytes
    glue: bytes
    result: str


def cache_root() -> Path:
    """The first of the stated, the user's and the temporary folder that can be written to."""
    stated = os.environ.get("MDSTOPO_CACHE_DIR") or os.environ.get("NUMBA_CACHE_DIR")
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    last = Path(tempfile.gettempdir()) / f"mdstopo-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"
    for folder in ([Path(stated)] if stated else []) + [Path(base) / "mdstopo"]:
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            if os.access(folder, os.W_OK):
                return folder
    return last


@functools.cache
def cache_folder() -> Path:
    """Folder of the machine code that belongs to exactly this source, these versions and this processor.

    The name is a hash over every source file that holds kernels: a changed line anywhere means a fresh folder, never
    stale code.
    """
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    package = Path(__file__).parent.parent
    digest = hashlib.sha256(f"{sys.version} {sys.platform} {get_host_cpu_name()}".encode())
    with contextlib.suppress(RuntimeError):  # a processor whose features LLVM cannot tell
        digest.update(get_host_cpu_features().flatten().encode())
    for name in _COMPILER:
        digest.update(f"{name} {version_of(name)}".encode())
    for setting in _SETTINGS:
        digest.update(f"{setting}={os.environ.get(setting)}".encode())
    for source in [package / "jit.py", *(path for room in _ROOMS for path in sorted((package / room).glob("**/*.py")))]:
        digest.update(source.read_bytes())
    return cache_root() / f"kernels-{digest.hexdigest()[:16]}"


def path_of(module: str, name: str, types: str) -> Path:
    """The file of an entry for these types of arguments."""
    return cache_folder() / f"{module}.{name}-{hashlib.sha256(types.encode()).hexdigest()[:12]}.code"


def read(path: Path) -> Code | None:
    """The code in a file; nothing where there is none, or where it is not what was written."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    start, _, rest = data[len(_MAGIC) :].partition(b"\n")
    if not data.startswith(_MAGIC):
        return None
    try:
        head = json.loads(start)
        size, checksum, result = head["body"], head["checksum"], head["result"]
    except (ValueError, KeyError, TypeError):
        return None
    if zlib.crc32(rest) != checksum:
        return None
    return Code(rest[:size], rest[size:], result)


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """The right to compile what belongs in a file: whoever comes second waits, and then finds it there.

    Where nothing can be locked, everybody compiles.
    """
    import fcntl

    lock = path.with_suffix(".lock")
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError:
        yield
        return
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        lock.unlink(missing_ok=True)
        os.close(descriptor)


def write(path: Path, code: Code) -> None:
    """Keep code on the disk, whole or not at all. A disk that cannot be written to is no reason to stop."""
    rest = code.body + code.glue
    head = {"body": len(code.body), "checksum": zlib.crc32(rest), "result": code.result}
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(_MAGIC + json.dumps(head).encode() + b"\n" + rest)
        os.replace(file.name, path)
