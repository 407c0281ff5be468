"""What the project says about itself is true: README, changelog, layout, start-up."""

import ast
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import mdstopo
from mdstopo.cli.commands import COMMANDS

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
SOURCES = sorted((ROOT / "mdstopo").rglob("*.py"))
HEAVY = ("numpy", "numba", "scipy", "h5py", "rich", "yaml", "click", "llvmlite")


def blocks(mark: str) -> list[str]:
    """The fenced blocks of the README that stand below a mark."""
    return re.findall(rf"<!-- {mark} -->\n```\w+\n(.*?)```", README, re.DOTALL)


@pytest.mark.parametrize("snippet", blocks("runs"))
def test_readme_python_runs_and_gives_what_it_says(snippet, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    exec(compile(snippet, "README.md", "exec"), names)
    first, second, third = capsys.readouterr().out.strip().rsplit("\n", 2)
    assert names["motion"].at([0.05, 0.1]).q.shape == (2, 6)
    assert first.startswith("0.2 ")
    assert second.endswith("(1020,)")
    assert third.split()[0] in ("converged", "max_iterations")
    assert names["result"].objectives["G"] < 7.0


def test_readme_has_a_python_snippet_and_a_case():
    assert len(blocks("runs")) == 1
    assert len(blocks("case")) == 2


@pytest.mark.parametrize(("number", "members"), [(0, 20 * 17), (1, 6 * 5)])
def test_readme_cases_can_be_optimised(number, members):
    import mdstopo
    from mdstopo.case.reader import read_case
    from mdstopo.scene.refusals import refusals

    case = read_case(blocks("case")[number])
    assert case.n_design == members
    assert refusals(case) == []
    assert mdstopo.evaluate(case).status.ok


def test_readme_names_all_commands_and_no_others():
    named = set(re.findall(r"mdstopo ([a-z]+)\b", README.partition("## The commands")[2].partition("(Outputs")[0]))
    assert named == set(COMMANDS)


def test_options_in_the_readme_exist():
    found = re.findall(r"`?mdstopo ([a-z]+) ([^`\n]*)", README) + re.findall(r"`(gradient) (--[a-z]+)`", README)
    used = [(name, option) for name, rest in found for option in re.findall(r"--[a-z][a-z-]*", rest)]
    assert ("run", "--resume") in used
    for name, option in used:
        command = import_module(f"mdstopo.cli.{name}").command
        assert option in {text for parameter in command.params for text in parameter.opts}, f"{name} {option}"


def test_readme_names_every_integrator_sensitivity_and_preset():
    from mdstopo.api import METHODS as SENSITIVITIES
    from mdstopo.integrators.choice import METHODS as INTEGRATORS
    from mdstopo.optimizer.presets import PRESETS

    part = README.partition("## Integrators")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| `([a-z_]+)` \|", part, re.MULTILINE)
    assert sorted(rows) == sorted([*INTEGRATORS, *(name for name in SENSITIVITIES if name != "auto")])
    assert all(f"`{name}`" in part for name in PRESETS)


def test_paths_in_the_readme_exist():
    part = README.partition("## The code")[2].partition("\n## ")[0]
    named = [name for name in re.findall(r"`([\w/]+/[\w.]+|mdstopo/\w+)`", part) if not name.startswith("results")]
    assert len(named) > 10
    for name in named:
        assert (ROOT / name).exists() or (ROOT / "mdstopo" / name).exists(), name


def test_make_targets_in_the_readme_exist():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z]+):", makefile, re.MULTILINE))
    named = set(re.findall(r"(?:^|`|  )make ([a-z]+)\b", README, re.MULTILINE))
    assert {"run", "test", "bench", "readme"} <= named <= targets


def test_benchmarks_have_their_place_in_the_readme(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks.__main__ import ELSEWHERE, SECTIONS
    from benchmarks.readme import replace_block

    copy = tmp_path / "README.md"
    copy.write_text(README, encoding="utf-8")
    for name in SECTIONS.keys() - set(ELSEWHERE):
        replace_block(copy, name, f"the new {name}")
    for name in SECTIONS.keys() - set(ELSEWHERE):
        assert f"<!-- benchmarks: {name} -->\n\nthe new {name}\n\n<!-- end -->" in copy.read_text(encoding="utf-8")
    with pytest.raises(ValueError, match="has no block"):
        replace_block(copy, "weather", "fine")


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


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_modules_say_what_they_are(path):
    text = path.read_text(encoding="utf-8")
    assert not text or ast.get_docstring(ast.parse(text)), "a module without docstring"


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
