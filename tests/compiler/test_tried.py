"""Numba's private parts: in one folder, with versions that were tried; with anything unexpected Numba's own way."""

import ast
import gc
import os
import re
import subprocess
import sys
import tomllib
import weakref
from pathlib import Path

import pytest

import mdstopo
from mdstopo.compiler import tried
from tests.sources import tree

PACKAGE = Path(mdstopo.__file__).parent
ROOT = PACKAGE.parent
#: what Numba documents of `numba.core` and `numba.experimental`
DOCUMENTED = {"numba.core.cgutils", "numba.experimental.structref"}
PRIVATE = PACKAGE / "compiler" / "numba_private"

KERNELS = """
import sys
import numpy as np
from mdstopo.compiler import tried
from mdstopo.compiler.vector import lanes, load, total
from mdstopo.compiler.threads import shared, taken
from mdstopo.compiler.jit import by_type, entry, kernel, member_kernel

def chosen(x):
    raise NotImplementedError

@kernel
def of_array(x):
    made = np.zeros((2, 3))
    made[1] = x[0]
    return made[1]

by_type(chosen, "x", lambda x: of_array)

@member_kernel
def work(counter, done):
    k = taken(counter)
    while k < done.size:
        done[k] += k
        k = taken(counter)

@entry
def whole(x, counter, done, wrong):
    if wrong:
        raise ValueError("asked for")
    shared(work, 2, (counter, done))
    sum_of = 0.0
    for i in range(0, x.size, lanes()):
        sum_of += total(load(x, i) * 2.0)
    return sum_of + chosen(x).sum(), done.sum()

def main():
    found = whole(np.arange(64.0) + 1.0, np.zeros(1, np.int64), np.zeros(5, np.int64), False)
    try:
        whole(np.arange(64.0), np.zeros(1, np.int64), np.zeros(5, np.int64), True)
    except ValueError as error:
        print(found, error, tried.private() is not None)
    try:
        whole(1.0, 2)
    except TypeError:
        print("refused")
"""


def run(tmp_path: Path, before: str) -> tuple[list[str], str]:
    """What a process prints and complains of that runs these kernels, with something done before."""
    place = tmp_path / "kernels.py"
    place.write_text(f"{KERNELS}\nif __name__ == '__main__':\n{before}\n    main()\n")
    env = os.environ | {"PYTHONPATH": str(ROOT), "MDSTOPO_CACHE_DIR": str(tmp_path / "cache")}
    env.pop("MDSTOPO_NUMBA_NOTICE", None)
    done = subprocess.run([sys.executable, "-P", str(place)], capture_output=True, text=True, env=env, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines(), done.stderr


RIGHT = "(4163.0, 10) asked for"

BROKEN = {
    "a version that was not tried": "    tried.TRIED.clear()",
    "a name that is missing": "    import numba.core.codegen as inside; del inside.JITCodeLibrary",
    "allocations with another header": (
        "    import ctypes, mdstopo.compiler.numba_private.private_check as p; made = p._nrt_python.meminfo_alloc\n"
        "    class Other:\n"
        "        def meminfo_alloc(self, size):\n"
        "            address = made(size); ctypes.c_int64.from_address(address).value += 1; return address\n"
        "    p._nrt_python = Other()"
    ),
    "code that computes something else": (
        "    import mdstopo.compiler.numba_private.private_check as p; p._probe_inner = lambda x, k: k * x + 1.0"
    ),
    "machine code that asks for more": (
        "    import mdstopo.compiler.numba_private.entry_code as p; p.PROVIDED = frozenset()"
    ),
    "a compilation that goes wrong later": (
        "    import mdstopo.compiler.numba_private as p; build = p.build\n"
        "    def stumbles(dispatcher, letters):\n"
        "        if letters.startswith('t2'): return build(dispatcher, letters)\n"
        "        raise AttributeError('gone')\n"
        "    p.build = stumbles"
    ),
}


@pytest.mark.parametrize("broken", BROKEN)
def test_anything_unexpected_leads_to_numba_s_own_way_with_one_notice(broken: str, tmp_path: Path) -> None:
    printed, complained = run(tmp_path, BROKEN[broken])
    assert printed == [f"{RIGHT} False", "refused"]
    assert len(complained.splitlines()) == 1
    assert "compiles in its own way" in complained
    assert "takes several times as long" in complained
    assert tried.version_of("numba") in complained
    if "stumbles" in BROKEN[broken]:  # the notice names what could not be compiled, and where that went wrong
        assert "(AttributeError: gone; in stumbles, line" in complained
        assert "of kernels.py, for __main__.whole)" in complained
    again, _ = run(tmp_path, BROKEN[broken])  # from Numba's own cache
    assert again == printed


def test_versions_that_were_tried_are_used_without_a_notice_and_without_importing_scipy(tmp_path: Path) -> None:
    assert tried.versions() in tried.TRIED
    told = "    import atexit, mdstopo.cli; atexit.register(lambda: print('scipy' in sys.modules))"
    assert run(tmp_path, told) == ([f"{RIGHT} True", "refused", "False"], "")


def test_the_oldest_and_the_newest_version_are_among_those_that_were_tried() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lowest = dict(each.split(">=") for each in project["dependencies"] if each.startswith(("numba", "llvmlite")))
    oldest = min(tried.TRIED, key=lambda pair: [int(part) for part in pair[0].split(".")])
    assert oldest == (lowest["numba"], lowest["llvmlite"])
    assert len(tried.TRIED) >= 3


def test_an_interrupt_that_comes_out_as_another_error_is_not_taken_for_a_fault_of_numba() -> None:
    def stumble() -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise RuntimeError("no compiled object yet") from None

    try:
        stumble()
    except RuntimeError as error:
        with pytest.raises(RuntimeError, match="no compiled"):
            tried.give_up(error)
    assert tried.private() is not None


class Half:
    """Stands for a module that LLVM has taken, and that llvmlite would free all the same."""


def test_what_an_interrupt_broke_off_in_the_compiler_is_not_freed() -> None:
    kept = []

    def link(error: type[BaseException]) -> None:
        half = Half()
        kept.append(weakref.ref(half))
        raise error

    for error in (KeyboardInterrupt, ValueError):
        with pytest.raises(error), tried.interruptible():
            link(error)
    gc.collect()
    assert [each() is not None for each in kept] == [True, False]


NAMED = re.compile("numba|llvmlite")


def imported(path: Path) -> set[str]:
    """Modules and names that a module imports; of one that does not mention Numba or llvmlite none."""
    found = set()
    for node in ast.walk(tree(path)) if NAMED.search(path.read_text(encoding="utf-8")) else ():
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{each.name}" for each in node.names}
    return found


INSIDE = ("numba.core.", "numba.np.", "numba.experimental.", "numba.cpython.", "numba._", "llvmlite.ir.instructions")


def test_no_other_module_names_what_is_private() -> None:
    for path in PACKAGE.rglob("*.py"):
        found = {each for each in imported(path) if each.startswith(INSIDE)} - DOCUMENTED
        assert path.parent == PRIVATE or not found, path


def test_what_is_private_is_where_it_is_said_to_be() -> None:
    found = set().union(*map(imported, PRIVATE.glob("*.py")))
    assert any(each.startswith("numba.core.codegen") for each in found)
