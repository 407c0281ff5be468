"""What a wheel's kernels are worth: `python packaging/try_wheel.py WHEEL`.

It installs the wheel into an environment of its own, and runs every case of the project, of the gallery and of the
templates there. It tells which commands have compiled something all the same, and how long each took, the first first.
"""

import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
SHORT = ("--set", "optimizer.max_iterations=1", "--overwrite")
#: of what a command says on standard error where it compiles, and of what a cache then holds
SAID, KEPT = "compiling", "kernels-*/*.code"


def commands(program: Path, folder: Path) -> list[list[str]]:
    """What is run, the first one first."""
    found = [["run", "fig6", "--overwrite"]]
    cases = sorted(each.stem for each in (HERE.parent / "cases").glob("*.yaml"))
    for case in (*cases, *map(str, sorted((HERE.parent / "gallery").glob("*.yaml")))):
        found += [["run", case, *SHORT], ["check", case]]
    listed = subprocess.run([program, "new", "--list"], capture_output=True, text=True, check=True, cwd=folder).stdout
    templates = sorted(each.stem for each in (HERE.parent / "mdstopo/cli/templates").glob("*.yaml"))
    for name in templates:
        assert name in listed, f"mdstopo new --list does not know {name}"
        found += [["new", name, "--template", name], ["run", f"{name}.yaml", *SHORT], ["gradient", f"{name}.yaml"]]
    return found


def main(wheel: Path) -> int:
    """0 where no command compiled anything or failed."""
    wrong = 0
    with tempfile.TemporaryDirectory(prefix="mdstopo-wheel-") as place:
        folder = Path(place)
        venv.create(folder / "venv", with_pip=True)
        install = [folder / "venv/bin/python", "-m", "pip", "install", "--quiet", str(wheel.resolve())]
        subprocess.run(install, check=True)
        program = folder / "venv/bin/mdstopo"
        kept = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "PYTHON"))}
        environment = kept | {"MDSTOPO_CACHE_DIR": str(folder / "cache")}
        for words in commands(program, folder):
            before = set((folder / "cache").glob(KEPT))
            began = time.perf_counter()
            done = subprocess.run(
                [program, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
            )
            seconds = time.perf_counter() - began
            new = sorted(each.name for each in set((folder / "cache").glob(KEPT)) - before)
            bad = done.returncode not in (0, 1) or SAID in done.stderr or bool(new)
            wrong += bad
            print(f"{'BAD ' if bad else 'good'} {seconds:6.2f} s  mdstopo {' '.join(words)}", *new, flush=True)
            if done.returncode not in (0, 1):
                print(done.stderr)
    print(f"{wrong} commands compiled something or failed")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
