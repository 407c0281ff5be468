"""The one place where kernels are compiled: decorators and the disk cache.

Numba keys a cached kernel on its own source file only, so a change in a function that it calls would go unseen.
Here the cache folder is named by a hash over every source file of the package that holds kernels, and over the
versions that the machine code depends on: a changed line anywhere means a fresh folder, never a stale kernel.
"""

import contextlib
import hashlib
import importlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import llvmlite.binding
import numba
import numpy as np

F = TypeVar("F", bound=Callable[..., Any])

_ROOMS = ("general", "mechanics", "integrators", "responses", "sensitivity", "optimizer", "scene")
# Sums may be reordered for the vector units and products fused; NaN and infinity keep their meaning.
_VECTOR = {"reassoc", "contract", "nsz"}


def _without_scipy() -> None:
    """Keep numba from loading scipy.linalg at its first dispatch: 0.1 to 0.2 s for linear algebra no kernel here uses.

    Only in the command line's own process: elsewhere numba and scipy may serve others.
    """
    if "mdstopo.cli" not in sys.modules or "scipy" in sys.modules or "numba.np.arraymath" in sys.modules:
        return
    # an import of it now fails, and numba takes that for a machine without scipy
    sys.modules["scipy"] = None  # type: ignore[assignment]
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        del sys.modules["scipy"]


_without_scipy()


def _cache_root() -> Path:
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


def cache_folder() -> Path:
    """Folder of the compiled kernels that belong to exactly this source and these versions."""
    package = Path(__file__).parent
    versions = sys.version, numba.__version__, llvmlite.__version__, np.__version__
    machine = (*versions, llvmlite.binding.get_host_cpu_name())
    digest = hashlib.sha256(f"{machine} {Path(__file__).read_bytes()!r}".encode())
    for room in _ROOMS:
        for source in sorted((package / room).glob("**/*.py")):
            digest.update(source.read_bytes())
    return _cache_root() / f"kernels-{digest.hexdigest()[:16]}"


_FOLDER = str(cache_folder())


def _compile(function: F, **options: Any) -> F:
    config: Any = numba.config
    kept = config.CACHE_DIR
    config.CACHE_DIR = _FOLDER
    try:
        compiled: F = numba.njit(cache=True, error_model="numpy", **options)(function)
    finally:
        config.CACHE_DIR = kept
    return compiled


# Wrappers for calls from Python cost a large part of the compilation (each unpacks every array of every tuple), so only
# entries have one. A kernel's `py_func` runs in Python, for tests.
_INSIDE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def entry(function: F) -> F:
    """Compile a function that Python calls: strict floating point, cached on disk."""
    return _compile(function, no_cfunc_wrapper=True)


def vector_entry(function: F) -> F:
    """As `entry`, with loops of its own that are vectorised like a `member_kernel`'s."""
    return _compile(function, fastmath=_VECTOR, no_cfunc_wrapper=True)


def kernel(function: F) -> F:
    """Compile a function that other kernels call, at body level: strict floating point, cached on disk."""
    return _compile(function, **_INSIDE)


def member_kernel(function: F) -> F:
    """Compile a loop over members: sums vectorised, NaN and infinities honoured, cached on disk."""
    return _compile(function, fastmath=_VECTOR, **_INSIDE)


def inline(function: F) -> F:
    """Compile a small scalar function that a member kernel inlines; the same arithmetic as there."""
    return _compile(function, fastmath=_VECTOR, **_INSIDE)
