"""Long functions have machine code of their own, once for all entries that call them: the same results, found again."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

#: two entries that share a long kernel, which calls another one that takes memory and one that raises
MODULE = """
import sys
import numpy as np
from mdstopo.compiler import compiled_units as units, store
from mdstopo.compiler.jit import entry, kernel

units.SPLIT, units.LONG_FUNCTION, units._OURS = __name__, 1, "_ZN8__main__"

@kernel
def taken(n):
    made = np.zeros(n)
    for i in range(n):
        made[i] = i / 2.0
    return made

@kernel
def total(x):
    if x.shape[0] == 7:
        raise ValueError("seven")
    found = 0.0
    for each in taken(x.shape[0]):
        found += each
    for each in x:
        found += each
    return found

@entry
def once(x):
    return total(x)

@entry
def twice(x):
    return 2.0 * total(x) - taken(x.shape[0])[1]

print(once(np.arange(3.0)), twice(np.arange(4.0)))
try:
    twice(np.zeros(7))
except ValueError as error:
    print(error)
folder = store.cache_folder()
print(*(len(store.read(path).needs) for path in sorted(folder.glob("*.code")) if "apart" not in path.name))
print("compiled" if "numba" in sys.modules else "loaded")
"""

RIGHT = ["4.5 17.5", "seven"]


def told(folder: Path) -> list[str]:
    """What a process prints that compiles the entries, or loads them."""
    (folder / "kernels_of_a_test.py").write_text(MODULE)
    made = subprocess.run(
        [sys.executable, "kernels_of_a_test.py"],
        cwd=folder,
        env={**os.environ, "MDSTOPO_CACHE_DIR": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (made.returncode, made.stderr) == (0, "")
    return made.stdout.splitlines()


def codes(folder: Path) -> dict[str, bytes]:
    """The files with machine code of long functions, by name."""
    return {path.name: path.read_bytes() for path in (folder / "cache").glob("*/apart-*.code")}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the entries have been compiled."""
    folder = tmp_path_factory.mktemp("units")
    *results, needs, how = told(folder)
    assert (results, needs, how) == (RIGHT, "1 2", "compiled")
    return folder


def test_entries_share_the_machine_code_of_long_functions_and_a_later_process_loads_it(compiled: Path) -> None:
    before = codes(compiled)
    assert len(before) == 3  # of both kernels, and the run time
    assert told(compiled) == [*RIGHT, "1 2", "loaded"]
    assert codes(compiled) == before


def test_what_is_missing_or_damaged_of_it_is_compiled_anew_to_the_same_code(compiled: Path) -> None:
    before = codes(compiled)
    (folder,) = (compiled / "cache").glob("kernels-*")
    for name, data in before.items():
        for damage in (None, b"", data[:-1] + bytes([data[-1] ^ 1])):
            if damage is None:
                (folder / name).unlink()
            else:
                (folder / name).write_bytes(damage)
            assert told(compiled) == [*RIGHT, "1 2", "compiled"]
            assert codes(compiled) == before


def test_without_intermediate_code_on_the_disk_functions_are_compiled_anew(compiled: Path) -> None:
    before = codes(compiled).keys()
    for path in (compiled / "cache").glob("*/unit-*.kept"):
        path.unlink()
    for path in (compiled / "cache").glob("*/*.code"):
        path.unlink()
    assert told(compiled) == [*RIGHT, "1 2", "compiled"]
    assert codes(compiled).keys() == before
