"""Machine code for the wheel: `python packaging/ship_kernels.py FOLDER` compiles all entries of the package.

`entries.txt` beside this file states the types of arguments that each entry is called with; the tests hold every call
that they make to it. No case is computed: an entry is compiled for stated types. That is done for each
kind of processor in `compiler.store.PROCESSORS` that this one can stand for, and the machine code is put into FOLDER,
with a manifest that says of which sources it is. What was compiled before, as when it was interrupted, is found in the
cache and not compiled again.

A wheel built with MDSTOPO_KERNELS=FOLDER carries it (setup.py); `make wheel` does both, and `python
packaging/try_wheel.py` tells whether it is enough.
"""

import gc
import importlib
import json
import os
import pkgutil
import shutil
import subprocess
import sys
import time
from argparse import ArgumentParser
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from inspect import signature
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from llvmlite.binding import get_host_cpu_features

import mdstopo
from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.model import SolverSettings
from mdstopo.compiler import store
from mdstopo.compiler.entry import DTYPES, Entry, types_of
from mdstopo.compiler.threads import cores
from mdstopo.general.driver.entries import entries_of
from mdstopo.integrators.integrator_choice import method_of

HERE = Path(__file__).resolve().parent
TABLE = HERE / "entries.txt"
#: shares of the work on one kind of processor. Entries for scenes in space have functions of their own inside, so two
#: processes do little twice
SPACE, REST = "space", "rest"
#: the integers of a packed scene: in a plane, and in space, which is known by their dimensions
#: (`general.model.general_model`)
PLANAR_SCENE, SPATIAL_SCENE = "q1", "q2"


class Stated(NamedTuple):
    """An entry and types of its arguments, as of `compiler.entry.types_of`: module, name, types."""

    module: str
    name: str
    types: str

    @property
    def share(self) -> str:
        """Which process compiles it."""
        kinds = self.types.split()
        return SPACE if self.module.startswith("mdstopo.general.") and SPATIAL_SCENE in kinds[:2] else REST


class Variant(NamedTuple):
    """What differs where an entry takes the steps of an integrator: the module of `simulate`, then types."""

    module: str
    method: str
    tables: str
    scene: str


def variants(general: bool) -> list[Variant]:
    """What there is of each integrator that computes springs between free bodies, or all other scenes."""
    found = []
    for name, kind in INTEGRATORS.items():
        made = method_of(name, SolverSettings())
        if general:
            loaded: Any = entries_of(kind)
            scenes = [PLANAR_SCENE] + [SPATIAL_SCENE] * (not kind.planar)
        elif kind.springs:
            loaded, scenes = importlib.import_module(kind.springs), [PLANAR_SCENE]
        else:
            continue
        types = types_of((loaded.TAG, made.tables))
        assert types is not None
        found += [Variant(loaded.simulate.__module__, *types.split(), scene) for scene in scenes]
    return found


def expanded(stated: Stated) -> list[Stated]:
    """A line with what its words stand for: a line for every integrator, in a plane and in space.

    `simulate` of an integrator has neither others' coefficients nor scenes that it does not compute.
    """
    general = stated.module.startswith("mdstopo.general.")
    asked = stated.types.split()
    found = variants(general)
    if "method" not in asked and "tables" in asked:
        found = [each for each in found if each.module == stated.module]
    types = [" ".join(getattr(each, word, word) for word in asked) for each in found]
    return [stated._replace(types=each) for each in dict.fromkeys(types)]


def table() -> list[Stated]:
    """All entries with all types of arguments."""
    found = []
    for line in TABLE.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            place, types = line.split(maxsplit=1)
            found += expanded(Stated(*place.rsplit(".", 1), types))
    return found


def entries() -> dict[tuple[str, str], Entry]:
    """All entries of the package by module and name: whatever may hold kernels is imported for it."""
    found = {}
    for module in _modules():
        for name, each in vars(importlib.import_module(module)).items():
            if isinstance(each, Entry) and each.__module__ == module:
                found[module, name] = each
    return found


def _modules() -> Iterator[str]:
    """Names of the package's modules that may hold kernels."""
    for found in pkgutil.iter_modules(mdstopo.__path__, "mdstopo."):
        top = found.name.partition(".")[2]
        if found.ispkg and top not in store.WITHOUT_KERNELS:
            inside = pkgutil.walk_packages([str(Path(mdstopo.__path__[0]) / top)], f"{found.name}.")
            yield from (each.name for each in inside)


def mistakes(stated: list[Stated]) -> list[str]:
    """What is wrong with the table: entries that it lacks or that there are not, other numbers of arguments."""
    known = entries()
    has = {(each.module, each.name) for each in stated}
    found = [f"{module}.{name} has no line in {TABLE.name}" for module, name in sorted(known.keys() - has)]
    found += [f"{TABLE.name}: there is no entry {module}.{name}" for module, name in sorted(has - known.keys())]
    for each in stated:
        if (each.module, each.name) in known:
            asked = len(signature(known[each.module, each.name].py_func).parameters)
            if asked != len(each.types.split()):
                found.append(f"{TABLE.name}: {each.module}.{each.name} takes {asked} arguments, not {each.types}")
    return found


def arguments_of(types: str) -> tuple[Any, ...]:
    """Arguments of these types, to compile an entry for, not to call it with."""
    numbers = {"b": True, "i": 0, "f": 0.0}
    found: list[Any] = []
    for each in types.split():
        letter, count = each[0], int(each[1:] or 0)
        if letter in DTYPES:
            found.append(np.zeros((1,) * count, DTYPES[letter]))
        else:
            found.append((0,) * count if letter == "t" else numbers[letter])
    return tuple(found)


def compile_share(share: str) -> None:
    """Compile a share of the table for the processor that the environment states.

    Prints as JSON, one line each, the names of the files that an entry needs, and last the folder in which they are.
    """
    gc.disable()  # as in `session.compiling_apart`
    known = entries()
    for each in table():
        if each.share == share:
            known[each.module, each.name].compile(*arguments_of(each.types))
            print(json.dumps(_files(store.path_of(*each).name)), flush=True)
    print(json.dumps(str(store.cache_folder())), flush=True)


def _files(name: str) -> list[str]:
    """A file and all that hold what its code calls."""
    found: dict[str, None] = {}
    waiting = [name]
    while waiting:
        name = waiting.pop()
        if name not in found:
            path = store.cache_folder() / name
            code = store.read(path)
            if code is None:
                raise SystemExit(f"{path} was not written: is the disk full, or Numba of a version that was not tried?")
            found[name] = None
            waiting += code.needs
    return list(found)


def compiled(processor: str, share: str, destination: Path) -> str:
    """Have a process compile a share for one kind of processor, and copy what it is; in words what went wrong."""
    name, features = store.PROCESSORS[processor]
    environment = {key: value for key, value in os.environ.items() if key not in store.SETTINGS}
    environment |= {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ",".join(f"+{each}" for each in features)}
    program = [sys.executable, __file__, "--share", share]
    files: set[str] = set()
    last = ""
    lines = iter([each for each in table() if each.share == share])
    began = time.monotonic()
    with subprocess.Popen(program, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            found = json.loads(line)
            if isinstance(found, str):
                last = found
                continue
            files.update(found)
            each = next(lines)
            print(f"{time.monotonic() - began:5.0f} s  {processor}  {each.module}.{each.name} {each.types}", flush=True)
    if process.returncode or not last:
        return f"{processor}, {share}: ended with {process.returncode}, after {len(files)} files"
    for file in files:
        shutil.copyfile(Path(last) / file, destination / processor / file)
    return ""


def main(destination: Path) -> int:
    """Compile for all kinds of processors that this one can run, as many side by side as there are cores."""
    wrong = mistakes(table())
    has = get_host_cpu_features()
    chosen = [name for name, (_, needed) in store.PROCESSORS.items() if all(has.get(each) for each in needed)]
    for name in store.PROCESSORS.keys() - set(chosen):
        print(f"left out: {name}, which this processor cannot run", flush=True)
    if not chosen:
        wrong.append("this processor can run none of the kinds that code is shipped for")
    if not wrong:
        shutil.rmtree(destination, ignore_errors=True)
        for name in chosen:
            (destination / name).mkdir(parents=True)
        with ThreadPoolExecutor(max(1, cores())) as pool:
            tasks = product((SPACE, REST), chosen)
            wrong = [each for each in pool.map(lambda task: compiled(task[1], task[0], destination), tasks) if each]
    for each in wrong:
        print(each, file=sys.stderr)
    if wrong:
        return 1
    manifest = {"sources": store.digest_of_sources(), "layout": store.layout(), "processors": chosen}
    (destination / store.MANIFEST).write_text(json.dumps(manifest) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    parser = ArgumentParser(description="Compile all entries of the package for a wheel.")
    parser.add_argument("folder", type=Path, nargs="?", help="where the machine code is put")
    parser.add_argument("--share", choices=(SPACE, REST), help="compile a share for this process's processor only")
    asked = parser.parse_args()
    if asked.share:
        compile_share(asked.share)
    elif asked.folder:
        sys.exit(main(asked.folder.resolve()))
    else:
        parser.error("name a folder")
