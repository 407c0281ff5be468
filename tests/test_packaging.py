"""What a wheel has beside the modules: the project's cases and templates, and compiled kernels where they are given."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize("kernels", [False, True])
def test_the_package_that_is_built_has_cases_and_kernels(tmp_path: Path, kernels: bool) -> None:
    code = tmp_path / "code"
    (code / "avx2").mkdir(parents=True)
    (code / "avx2" / "a.code").write_bytes(b"code")
    built = tmp_path / "built"
    words = [sys.executable, "setup.py", "-q", "egg_info", "--egg-base", str(tmp_path), "build_py"]
    subprocess.run(
        [*words, "--build-lib", str(built)],
        cwd=ROOT,
        env={**os.environ, "MDSTOPO_KERNELS": str(code) if kernels else "", "PYTHONWARNINGS": "ignore"},
        check=True,
        capture_output=True,
    )
    package = built / "mdstopo"
    for name in ("cases/fig6.yaml", "cases/data/mooring-swell-force.csv", "cli/templates/seat.yaml", "py.typed"):
        assert (package / name).is_file(), name
    assert (package / "kernels" / "avx2" / "a.code").exists() == kernels
    assert not (ROOT / "mdstopo" / "cases").exists()
