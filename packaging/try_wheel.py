"""What a wheel's kernels are worth: `python packaging/try_wheel.py WHEEL [--as PROCESSOR]`.

It installs the wheel into an environment of its own, and runs there every case of the project, of the gallery and of
the templates, and scenes of `kinds` beside this file by every integrator and method of differentiation. It tells which
commands have compiled something all the same, and how long each took, the first one first. With `--as avx2` the
environment is made to believe that its processor is of that kind.
"""

import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

from mdstopo import load_case
from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.text.shipped import names
from mdstopo.cli.new import templates
from mdstopo.compiler.store import PROCESSORS

HERE = Path(__file__).resolve().parent
#: small problems, one of each kind (`make gallery`), and those that have what these have not
GALLERY, KINDS = HERE.parent / "gallery", HERE / "kinds"
#: of what a command says on standard error where it compiles, and of what a cache then holds
SAID, KEPT = "compiling", "kernels-*/*.code"
#: methods of differentiation that go with variables, and one that does not
EXACT = ("--method", "adjoint", "--method", "direct", "--history")
HELD = ("--method", "adjoint", "--method", "constant_load")
#: options that keep every run short
SHORT = ("--set", "optimizer.max_iterations=1", "--overwrite")
#: the same of one with candidates that are priced, which it is after some iterations
FEW_ROUNDS = ("--set", "optimizer.max_iterations=20", "--overwrite")
#: members of a scene whose kernels are those of many variables
MANY = ("--set", "points.torso_edge.grid.rectangle.count=200")


def commands() -> list[list[str]]:
    """What is run, the first one first: of each command a list of words."""
    found = [["run", "fig6", "--overwrite"]]
    for case in (*names(), *map(str, sorted(GALLERY.glob("*.yaml")))):
        designs = bool(load_case(case).objectives)
        found += [["run", case, *SHORT] if designs else ["simulate", case, "--overwrite"], ["check", case]]
    for name in templates():
        found += [["new", name, "--template", name], ["run", f"{name}.yaml", *SHORT], ["gradient", f"{name}.yaml"]]
    return found + of_fig6() + of_kinds() + of_verbs()


def of_fig6() -> list[list[str]]:
    """Springs between free bodies, by every integrator that has kernels of its own for them, and one that has not."""
    found = []
    for name, kind in INTEGRATORS.items():
        chosen = ("--set", f"solver.integrator={name}")
        others = (*HELD, "--method", "iterative") if kind.iterative else HELD
        found += [
            ["run", "fig6", *chosen, *SHORT],
            ["gradient", "fig6", *chosen, "--set", "solver.step=0.002", *EXACT, "--error-estimate", "--overwrite"],
            ["gradient", "fig6", *chosen, "--set", "solver.step=0.002", *others],
        ]
        if kind.springs:
            found.append(["run", str(KINDS / "priced.yaml"), *chosen, *FEW_ROUNDS])
    return [*found, ["run", "fig6", *MANY, *SHORT]]


def of_kinds() -> list[list[str]]:
    """Other scenes, by every integrator that computes them, with every method of differentiation."""
    found = []
    for name, kind in INTEGRATORS.items():
        chosen = ("--set", f"solver.integrator={name}", "--set", "solver.step=0.002")
        others = (*HELD, "--method", "iterative") if kind.iterative else HELD
        scenes = {"free": kind.free_only, "planar": not kind.free_only, "space": not (kind.free_only or kind.planar)}
        for scene in (scene for scene, computed in scenes.items() if computed):
            found += _of_scene(str(KINDS / f"{scene}.yaml"), chosen, others)
    return found


def _of_scene(file: str, chosen: tuple[str, ...], others: tuple[str, ...]) -> list[list[str]]:
    """What is asked of a scene. chosen: options for the integrator; others: methods that go without variables."""
    return [
        ["run", file, *chosen, *SHORT],
        ["check", file, *chosen],
        ["gradient", file, *chosen, *EXACT, "--error-estimate", "--overwrite"],
        ["gradient", file, *chosen, *others, "--set", "design.variables={}"],
        ["simulate", file, *chosen, "--overwrite"],
    ]


def of_verbs() -> list[list[str]]:
    """Commands beside `run`, `check` and `gradient`."""
    return [
        ["pareto", "fig7", "--points", "2", "--workers", "1", *SHORT],
        ["sweep", "set", "fig6", "members.belts.law.stiffness=200,250", "optimizer.max_iterations=1", "--overwrite"],
        ["simulate", "fig6", "--overwrite"],
        ["run", "fig6", *SHORT],
        ["finalize", "results/fig6.h5", "--keep", "200", "--overwrite"],
        ["report", "results/fig6.h5"],
        ["run", "mechanism.yaml", "--set", "solver.settle=true", *SHORT],
        ["check", "mechanism.yaml", "--set", "solver.settle=true"],
        ["bound", "isolator"],
        ["fit", str(KINDS / "fit.yaml"), "--overwrite"],
    ]


def install(wheel: Path, folder: Path, kind: str) -> Path:
    """An environment with nothing but the wheel and what it asks for; its command.

    kind: a kind of processor; the environment's compiler is told that ours has no more than that. Empty: as it is.
    """
    venv.create(folder, with_pip=True)
    subprocess.run([folder / "bin/python", "-m", "pip", "install", "--quiet", wheel.resolve()], check=True)
    if kind:
        (site,) = folder.glob("lib/python*/site-packages")
        has = dict.fromkeys(PROCESSORS[kind][1], True)
        line = f"import llvmlite.binding as b; b.get_host_cpu_features = lambda has=b.targets.FeatureMap({has}): has\n"
        (site / "another_processor.pth").write_text(line)
    return folder / "bin/mdstopo"


def main(wheel: Path, kind: str = "") -> int:
    """0 where no command compiled anything or failed."""
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="mdstopo-wheel-") as place:
        folder = Path(place)
        program = install(wheel, folder / "venv", kind)
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "PYTHON"))}
        environment = kept | {"MDSTOPO_CACHE_DIR": str(folder / "cache")}
        for words in commands():
            before = set((folder / "cache").glob(KEPT))
            began = time.perf_counter()
            done = subprocess.run(
                [program, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            seconds = time.perf_counter() - began
            new = sorted(each.name for each in set((folder / "cache").glob(KEPT)) - before)
            failed = done.returncode not in (0, 1) or "Traceback" in done.stderr
            bad = failed or SAID in done.stderr or bool(new)
            wrong += bad
            print(f"{'BAD ' if bad else 'good'} {seconds:6.2f} s  mdstopo {' '.join(words)}", *new, flush=True)
            if failed:
                print(done.stderr)
    print(f"{wrong} of {len(commands())} commands compiled something or failed")
    return 1 if wrong else 0


if __name__ == "__main__":
    words = sys.argv[1:]
    sys.exit(main(Path(words[0]), words[words.index("--as") + 1] if "--as" in words else ""))
