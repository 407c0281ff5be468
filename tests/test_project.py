"""What the project says about itself is true: changelog, peers, docstrings, start-up."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mdstopo
from tests.sources import tree

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted((ROOT / "mdstopo").rglob("*.py"))
HEAVY = ("numpy", "numba", "scipy", "h5py", "rich", "yaml", "click", "llvmlite")


def test_joining_the_peers_is_the_same_problem(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    from types import SimpleNamespace

    from benchmarks.join_peers import make

    case = mdstopo.load_case(ROOT / "cases" / "fig6.yaml")
    (group,) = case.members
    at = np.zeros(12)
    at[4] = -1.0
    theirs = SimpleNamespace(
        T=0.2, m=[60.0, 10.0, 2000.0, 6000.0], y0=at, P=group.from_local, Q=group.to_local, k=225.0,
        ext=np.array([0.0, -9.8, 0.0, 9.8, -9.8, 20.0]),
    )  # fmt: skip
    alpha = np.random.default_rng(1).uniform(0.01, 1.0, case.n_design)
    value, gradient = make(theirs, tolerance=1e-9)(alpha)
    expected = mdstopo.evaluate(case, alpha)
    np.testing.assert_allclose(value, expected.objectives["G"], rtol=1e-8)
    np.testing.assert_allclose(gradient, expected.gradients["G"], atol=1e-7 * np.abs(gradient).max())


def test_version_agrees_with_the_changelog():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## \[([^\]]+)\]", changelog, re.MULTILINE)
    assert newest is not None
    assert newest[1] == mdstopo.__version__


def test_modules_say_what_they_are():
    assert len(SOURCES) > 300
    silent = [path for path in SOURCES if path.stat().st_size and not ast.get_docstring(tree(path))]
    assert silent == []


@pytest.mark.parametrize(
    "code",
    [
        "import mdstopo",
        "import mdstopo.cli",
        "import mdstopo.cli; sys.argv = ['mdstopo', '--help']; mdstopo.cli.main()",
        "import mdstopo.cli; sys.argv = ['mdstopo', '--version']; mdstopo.cli.main()",
    ],
)
def test_nothing_heavy_is_imported_before_it_is_needed(code):
    watch = f"import atexit, sys; atexit.register(lambda: print('loaded:', [m for m in {HEAVY} if m in sys.modules]))\n"
    done = subprocess.run([sys.executable, "-c", watch + code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "loaded: []"
