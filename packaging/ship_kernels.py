"""Machine code for the wheel: `python packaging/ship_kernels.py FOLDER` compiles what cases of every kind call.

For each kind of processor in `compiler.store.PROCESSORS` that this one can stand for, the commands below are run with
an empty cache, and what they have compiled is put into FOLDER, with a manifest that says of which sources it is. An
entry that none of them calls is a mistake. A wheel built with MDSTOPO_KERNELS=FOLDER carries it (setup.py); `make
wheel` does both, and `python packaging/try_wheel.py` tells whether what it brings is enough.
"""

import ast
import json
import os
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from llvmlite.binding import get_host_cpu_features

from mdstopo.case.integrators import INTEGRATORS
from mdstopo.case.shipped import names
from mdstopo.cli.new import templates
from mdstopo.compiler.store import MANIFEST, PROCESSORS, SETTINGS, digest_of_sources, layout

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parent / "mdstopo"
#: small problems, one of each kind (`make gallery`), and those that have what these have not
GALLERY, KINDS = HERE.parent / "gallery", HERE / "kinds"
#: methods of differentiation that go with variables, and one that does not
EXACT = ("--method", "adjoint", "--method", "direct", "--history")
HELD = ("--method", "adjoint", "--method", "constant_load")
#: options that keep every run short
SHORT = ("--set", "optimizer.max_iterations=1", "--overwrite", "--quiet")
#: members of a scene whose kernels are those of many variables
MANY = ("--set", "points.torso_edge.grid.rectangle.count=200")


def commands(folder: Path) -> list[list[str]]:
    """Commands that between them call every kernel that cases need: of each a list of words."""
    found = [["run", name, *SHORT] for name in (*names(), *map(str, sorted(GALLERY.glob("*.yaml"))))]
    for name in templates():
        found += [["new", name, "--template", name, "--quiet"], ["run", f"{name}.yaml", *SHORT]]
        found += [[verb, f"{name}.yaml", "--quiet"] for verb in ("check", "gradient")]
    for integrator in INTEGRATORS:
        chosen = ("--set", f"solver.integrator={integrator}")
        found.append(["run", "fig6", *chosen, *SHORT])
        found += [[verb, "fig6", *chosen, "--quiet"] for verb in ("check", "gradient")]
        if integrator != "gauss":
            found += [["run", "mechanism.yaml", *chosen, *SHORT], ["run", "space.yaml", *chosen, *SHORT]]
    found += [
        ["run", "fig6", *MANY, *SHORT],
        ["pareto", "fig7", "--points", "2", "--workers", "1", *SHORT],
        ["gradient", "fig6", "--history", "--error-estimate", "--quiet"],
        ["simulate", "fig6", "--overwrite", "--quiet"],
        ["finalize", "results/fig6.h5", "--keep", "10", "--quiet", "--overwrite"],
        ["report", "results/fig6.h5", "--quiet"],
        ["run", "mechanism.yaml", "--set", "solver.settle=true", *SHORT],
        ["check", "mooring", "--set", "solver.settle=true", "--quiet"],
        ["bound", "isolator", "--quiet"],
        ["fit", str(KINDS / "fit.yaml"), "--overwrite", "--quiet"],
        ["run", str(KINDS / "priced.yaml"), "--set", "optimizer.max_iterations=20", "--overwrite", "--quiet"],
    ]
    return found + of_kinds()


def of_kinds() -> list[list[str]]:
    """Every method of differentiation with every integrator that goes with it, in a plane and in space."""
    found = []
    for integrator in INTEGRATORS:
        chosen = ("--set", f"solver.integrator={integrator}", "--set", "solver.step=0.002")
        others = (*HELD, "--method", "iterative") if integrator == "generalized_alpha" else HELD
        found += [
            ["gradient", "fig6", *chosen, *EXACT, "--error-estimate", "--quiet"],
            ["gradient", "fig6", *chosen, *others, "--quiet"],
        ]
        for name in ("planar", "space") if integrator != "gauss" else ():
            file = str(KINDS / f"{name}.yaml")
            found += [
                ["run", file, *chosen, *SHORT],
                ["check", file, *chosen, "--quiet"],
                ["gradient", file, *chosen, *EXACT, "--error-estimate", "--quiet"],
                ["gradient", file, *chosen, *others, "--set", "design.variables={}", "--quiet"],
                ["simulate", file, *chosen, "--overwrite", "--quiet"],
            ]
    free = str(KINDS / "free.yaml")
    for integrator in ("gauss", "runge_kutta"):
        chosen = ("--set", f"solver.integrator={integrator}")
        found += [["run", free, *chosen, *SHORT], ["gradient", free, *chosen, *EXACT, "--quiet"]]
    return [*found, ["gradient", free, *HELD, "--quiet"]]


def without_code(folder: Path) -> list[str]:
    """Entries of the package, module and name, of which a folder has no machine code."""
    found = []
    for source in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(("mdstopo", *source.relative_to(PACKAGE).with_suffix("").parts))
        for each in ast.parse(source.read_text(encoding="utf-8")).body:
            if not isinstance(each, ast.FunctionDef):
                continue
            marks = {mark.id for mark in each.decorator_list if isinstance(mark, ast.Name)}
            if marks & {"entry", "vector_entry"} and not any(folder.glob(f"{module}.{each.name}-*.code")):
                found.append(f"{module}.{each.name}")
    return found


def compiled(processor: str, destination: Path) -> list[str]:
    """Compile for one kind of processor into a folder of its name; the commands that failed."""
    name, features = PROCESSORS[processor]
    environment = {key: value for key, value in os.environ.items() if key not in SETTINGS}
    environment |= {"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ",".join(f"+{each}" for each in features)}
    failed = []
    with tempfile.TemporaryDirectory(prefix="mdstopo-ship-") as place:
        folder = Path(place)
        environment["MDSTOPO_CACHE_DIR"] = str(folder / "cache")
        for words in commands(folder):
            program = [sys.executable, "-m", "mdstopo", *words]
            done = subprocess.run(program, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            print(f"{processor}: mdstopo {' '.join(words)}: {done.returncode}", flush=True)
            if done.returncode not in (0, 1) or "Traceback" in done.stderr:
                failed.append(f"mdstopo {' '.join(words)}\n{done.stderr}")
        (kept,) = (folder / "cache").glob("kernels-*")
        target = destination / processor
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        for path in sorted(kept.iterdir()):
            if path.suffix in (".code", ".compiled") or path.name.startswith("ready-"):
                shutil.copyfile(path, target / path.name)
    return failed + [f"{processor}: no command has called {each}" for each in without_code(target)]


def main(destination: Path) -> int:
    """Compile for all kinds of processors that this one can run, one beside the other."""
    has = get_host_cpu_features()
    chosen = [name for name, (_, needed) in PROCESSORS.items() if all(has.get(each) for each in needed)]
    with ThreadPoolExecutor() as pool:
        failed = [each for found in pool.map(lambda name: compiled(name, destination), chosen) for each in found]
    for each in failed:
        print(each, file=sys.stderr)
    manifest = {"sources": digest_of_sources(), "layout": layout(), "processors": chosen}
    (destination / MANIFEST).write_text(json.dumps(manifest) + "\n", encoding="utf-8")
    return 1 if failed or not chosen else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve()))
