"""Machine code on the disk: one folder for exactly these sources and versions, one file for an entry and its types."""

import contextlib
import functools
import hashlib
import json
import os
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from mdstopo.compiler.trusted import make_private, open_lock, read_private, write_private
from mdstopo.installed import version_of

#: folders and modules of the package that hold no kernels and that no kernel takes a number from; `tests/compiler`
#: looks after that
WITHOUT_KERNELS = (
    "bench", "cli", "finalize", "fit", "front", "limiting", "plan", "plots", "report", "robust", "session", "starts",
    "store", "stress", "workers",
    "api.py", "functions.py", "jax.py", "openmdao.py", "shown.py", "torch.py",
)  # fmt: skip
#: the folder of the package with machine code that came with it, a folder for a kind of processor, and what it is of
SHIPPED, MANIFEST = "kernels", "manifest.json"
#: kinds of x86-64 processors that code is shipped for, the best first: what LLVM calls them, and what they have to have
PROCESSORS = {
    "avx512": ("x86-64-v4", ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx2", "fma", "bmi", "bmi2")),
    "avx2": ("x86-64-v3", ("avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe", "popcnt")),
}
_COMPILER = ("numba", "llvmlite", "numpy")
#: what decides for which processor, and how, kernels are compiled
SETTINGS = (
    "NUMBA_OPT",
    "NUMBA_CPU_NAME",
    "NUMBA_CPU_FEATURES",
    "NUMBA_ENABLE_AVX",
    "NUMBA_LOOP_VECTORIZE",
    "NUMBA_BOUNDSCHECK",
)
_MAGIC = b"mdstopo code 4\n"
#: folders of other sources and versions: how many are kept, and how long after their last use, in seconds
_KEPT, _LASTING = 12, 30 * 86400.0
_DAY = 86400.0
#: seconds to wait for another process that is compiling the same kernel
_PATIENCE = 600.0

#: a hash of the sources that `include` has added; empty where there are none
_foreign = ""
_included: set[str] = set()

#: the functions in the glue that Python calls: with what `Native.block_of` fills, and with what is prepared
CALL, PREPARED = "mdstopo_call", "mdstopo_prepared"


class Code(NamedTuple):
    """Machine code of an entry.

    body, glue: object files, of the entry and of the function that calls it. result: a letter for each number that it
    returns (i integer, f float, b truth), in parentheses for a tuple, which is empty where it returns nothing. needs:
    names of files with what it calls by symbols; such a file has no glue, and its symbol for a result
    (`compiled_units`).
    """

    body: bytes
    glue: bytes
    result: str
    needs: tuple[str, ...] = ()


@functools.cache
def cache_root() -> Path:
    """The first of the stated, the user's and the temporary folder that can be written to and that nobody else can.

    Where there is none, a fresh folder, which this process shares with those that it starts and removes in the end.
    """
    stated = os.environ.get("MDSTOPO_CACHE_DIR") or os.environ.get("NUMBA_CACHE_DIR")
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    places = ([Path(stated)] if stated else []) + [Path(base) / "mdstopo"]
    with contextlib.suppress(OSError):  # a computer without any folder for temporary files
        places.append(Path(tempfile.gettempdir()) / f"mdstopo-{os.getuid()}")
    for place in places:
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            folder = place.resolve()
            if make_private(folder) and os.access(folder, os.W_OK | os.X_OK):
                return folder
    return _fresh()


def _fresh() -> Path:
    """A folder of this process."""
    try:
        folder = Path(tempfile.mkdtemp(prefix="mdstopo-")).resolve()
    except OSError:
        return Path(os.devnull) / "mdstopo"  # nothing can be kept anywhere: every process compiles for itself
    os.environ["MDSTOPO_CACHE_DIR"] = str(folder)
    import atexit
    import shutil

    def remove(maker: int = os.getpid()) -> None:
        if os.getpid() == maker:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


def include(module: str) -> None:
    """Have machine code hold kernels of another distribution from now on: it is kept apart, by their sources too.

    module: an imported module; of a package all files count. The order counts, for codes follow it.
    """
    global _foreign
    if module in _included:
        return
    _included.add(module)
    top = sys.modules[module.partition(".")[0]]
    file = Path(getattr(top, "__file__", None) or sys.modules[module].__file__ or "")
    files = sorted(file.parent.rglob("*.py")) if file.name == "__init__.py" else [file]
    digest = hashlib.sha256(f"{_foreign} {module}".encode())
    for each in files:
        digest.update(each.read_bytes())
    _foreign = digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of the machine code that belongs to exactly this source, these versions and this processor.

    The name is a hash over the sources: a changed line anywhere means a fresh folder, never stale code.
    """
    return _folder(_foreign)


@functools.cache
def _folder(foreign: str) -> Path:
    """What `cache_folder` gives, made where it is not there. foreign: the hash of sources that `include` has added."""
    folder = cache_root() / f"kernels-{_key()}{'-' if foreign else ''}{foreign}"
    new = not folder.exists()
    if not make_private(folder):
        return _fresh() if folder.exists() else folder  # what others could write to is left alone
    with contextlib.suppress(OSError):
        if new:
            remove_old(folder)
        elif time.time() - folder.stat().st_mtime > _DAY:
            os.utime(folder)
    return folder


def _key() -> str:
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    digest = hashlib.sha256(f"{sys.version} {sys.platform} {get_host_cpu_name()}".encode())
    with contextlib.suppress(RuntimeError):  # a processor whose features LLVM cannot tell
        digest.update(get_host_cpu_features().flatten().encode())
    for name in _COMPILER:
        digest.update(f"{name} {version_of(name)}".encode())
    for setting in SETTINGS:
        digest.update(f"{setting}={os.environ.get(setting)}".encode())
    digest.update(digest_of_sources().encode())
    return digest.hexdigest()[:16]


@functools.cache
def digest_of_sources() -> str:
    """A hash over all modules that may hold kernels, or numbers that kernels take."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for source in _sources(package):
        digest.update(source.encode())
        with open(os.path.join(package, source), "rb") as stream:
            digest.update(stream.read())
    return digest.hexdigest()


def layout() -> str:
    """What machine code takes for granted of where it runs, beside the processor."""
    return f"{sys.platform} {sys.implementation.name} {object.__basicsize__} {sys.byteorder} {sys.maxsize}"


@functools.cache
def shipped_folder() -> Path | None:
    """The folder of machine code that came with the package and fits here; None where there is none.

    It has to be of exactly these sources, and none of the settings that decide how kernels are compiled may be made.
    What lies in the package is trusted as its modules are.
    """
    place = Path(__file__).parent.parent / SHIPPED
    try:
        manifest = json.loads((place / MANIFEST).read_bytes())
    except (OSError, ValueError):
        return None
    if any(os.environ.get(setting) for setting in SETTINGS):
        return None
    if (manifest.get("layout"), manifest.get("sources")) != (layout(), digest_of_sources()):
        return None
    from llvmlite.binding import get_host_cpu_features

    try:
        has = get_host_cpu_features()
    except RuntimeError:  # a processor whose features LLVM cannot tell
        return None
    fitting = (place / name for name, (_, needed) in PROCESSORS.items() if all(has.get(each) for each in needed))
    return next((folder for folder in fitting if folder.is_dir()), None)


def is_kept(name: str) -> bool:
    """Whether the kernels are there that a note of that name, in the folder of this source, says have been compiled.

    A package that came with kernels has all of them (`packaging/ship_kernels.py`) and needs no notes.
    """
    return (not _foreign and shipped_folder() is not None) or (cache_folder() / name).exists()


def are_kept(prefix: str) -> bool:
    """Whether any file whose name begins so came with the package, or lies in the folder of this source."""
    places = [cache_folder()] if _foreign else [shipped_folder(), cache_folder()]
    return any(next(place.glob(f"{prefix}*"), None) is not None for place in places if place is not None)


def _sources(package: Path) -> list[str]:
    """The package's modules that may hold kernels, or numbers that kernels take, in one order."""
    found = []
    for folder, inner, names in os.walk(package):
        if folder == str(package):
            inner[:] = [name for name in inner if name not in WITHOUT_KERNELS]
            names = [name for name in names if name not in WITHOUT_KERNELS]
        place = os.path.relpath(folder, package)
        found += [os.path.join(place, name) for name in names if name.endswith(".py")]
    return sorted(found)


def remove_old(current: Path) -> None:
    """Remove folders beside this one that belong to other sources, and have not been used for long or are many."""
    import shutil

    others = [each for each in current.parent.glob("kernels-*") if each != current and not each.is_symlink()]
    used = sorted(((each.stat().st_mtime, each) for each in others), reverse=True)
    for k, (last, folder) in enumerate(used):
        if k >= _KEPT or time.time() - last > _LASTING:
            shutil.rmtree(folder, ignore_errors=True)


def path_of(module: str, name: str, types: str) -> Path:
    """The file of an entry for these types of arguments."""
    return cache_folder() / f"{module}.{name}-{hashlib.sha256(types.encode()).hexdigest()[:12]}.code"


def read(path: Path) -> Code | None:
    """The code in a file, or in the one of that name that came with the package.

    Nothing where there is none, or where it is not what was written.
    """
    data = read_shipped(path.name)
    if data is None:
        data = read_checked(path)
    if data is None:
        return None
    start, _, rest = data.partition(b"\n")
    try:
        size, result, needs = json.loads(start)
        return Code(rest[:size], rest[size:], result, tuple(needs))
    except (ValueError, TypeError):
        return None


def write(path: Path, code: Code) -> None:
    """Keep code on the disk, whole or not at all. A disk that cannot be written to is no reason to stop."""
    write_checked(path, json.dumps([len(code.body), code.result, code.needs]).encode() + b"\n" + code.body + code.glue)


def read_shipped(name: str) -> bytes | None:
    """What is in a file that came with the package; nothing where there is none."""
    place = None if _foreign else shipped_folder()
    if place is None:
        return None
    try:
        return _checked((place / name).read_bytes())
    except OSError:
        return None


def read_checked(path: Path) -> bytes | None:
    """What `write_checked` has put in a file; nothing where there is none, or anything else."""
    return _checked(read_private(path))


def _checked(data: bytes | None) -> bytes | None:
    """What stands behind a checksum that is right."""
    if data is None or not data.startswith(_MAGIC) or len(data) < len(_MAGIC) + 4:
        return None
    rest = data[len(_MAGIC) + 4 :]
    return rest if zlib.crc32(rest).to_bytes(4, "little") == data[len(_MAGIC) : len(_MAGIC) + 4] else None


def write_checked(path: Path, data: bytes) -> None:
    """Keep bytes with a checksum over all of them, where that is possible."""
    if make_private(path.parent):
        write_private(path, [_MAGIC, zlib.crc32(data).to_bytes(4, "little"), data])


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """The right to compile what belongs in a file: whoever comes second waits, and then finds it there.

    Where nothing can be locked, and where the first one takes too long (it may have been halted), everybody compiles.
    """
    import fcntl

    lock = path.with_suffix(".lock")
    try:
        make_private(lock.parent)
        descriptor = open_lock(lock)
    except OSError:
        yield
        return
    held = False
    try:
        until = time.monotonic() + _PATIENCE
        while not held and time.monotonic() < until:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                held = True
            except BlockingIOError:
                time.sleep(0.05)
            except OSError:  # a file system without locks
                break
        yield
    finally:
        if held:
            with contextlib.suppress(OSError):
                lock.unlink(missing_ok=True)
        os.close(descriptor)
