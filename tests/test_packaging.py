"""What a wheel has beside the modules: the project's cases and templates, and compiled kernels where they are given."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from mdstopo.compiler.store import MANIFEST, digest_of_sources

ROOT = Path(__file__).resolve().parents[1]


def build(built: Path, kernels: Path | None) -> "subprocess.CompletedProcess[str]":
    """Have the package built into a folder; kernels: what goes into it beside."""
    words = [sys.executable, "setup.py", "-q", "egg_info", "--egg-base", str(built.parent), "build_py"]
    return subprocess.run(
        [*words, "--build-lib", str(built)],
        cwd=ROOT,
        env={**os.environ, "MDSTOPO_KERNELS": str(kernels or ""), "PYTHONWARNINGS": "ignore"},
        check=False,
        capture_output=True,
        text=True,
    )


def compiled(folder: Path, sources: str) -> Path:
    """A folder with machine code of some sources."""
    (folder / "avx2").mkdir(parents=True)
    (folder / "avx2" / "a.code").write_bytes(b"code")
    (folder / MANIFEST).write_text(json.dumps({"sources": sources}))
    return folder


@pytest.mark.parametrize("kernels", [False, True])
def test_the_package_that_is_built_has_cases_and_kernels_and_nothing_of_an_older_one(
    tmp_path: Path, kernels: bool
) -> None:
    package = tmp_path / "built" / "mdstopo"
    (package / "general").mkdir(parents=True)
    (package / "general" / "gone.py").touch()
    done = build(package.parent, compiled(tmp_path / "code", digest_of_sources()) if kernels else None)
    assert done.returncode == 0, done.stderr
    for name in ("cases/fig6.yaml", "cases/data/mooring-swell-force.csv", "cli/templates/seat.yaml", "py.typed"):
        assert (package / name).is_file(), name
    assert (package / "kernels" / "avx2" / "a.code").exists() == kernels
    assert not (package / "general" / "gone.py").exists()
    assert not (ROOT / "mdstopo" / "cases").exists()


def test_kernels_of_other_sources_are_not_packaged(tmp_path: Path) -> None:
    done = build(tmp_path / "built", compiled(tmp_path / "code", "others"))
    assert done.returncode != 0
    assert done.stderr.endswith("compiled from other sources than these; `make wheel` compiles them anew\n")
    done = build(tmp_path / "built", tmp_path / "none")
    assert done.returncode != 0
    assert "none: no folder that packaging/ship_kernels.py has made (" in done.stderr
    assert "Traceback" not in done.stderr
