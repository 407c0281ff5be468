"""What pyproject.toml cannot say: what goes into the package beside its modules.

The project's cases, so that they are found by name after an installation, and, where MDSTOPO_KERNELS names a folder
that `packaging/ship_kernels.py` has made, compiled kernels; the wheel is one for x86-64 Linux then.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
KERNELS = os.environ.get("MDSTOPO_KERNELS", "")
DIGEST = "from mdstopo.compiler.store import digest_of_sources as digest; print(digest())"


def check_kernels(built: Path) -> None:
    """End where the kernels are not those of the package in a folder, for no installation would take them then."""
    asked = [sys.executable, "-P", "-c", DIGEST]
    environment = {**os.environ, "PYTHONPATH": str(built), "PYTHONDONTWRITEBYTECODE": "1"}
    own = subprocess.run(asked, cwd=built, env=environment, capture_output=True, text=True, check=True).stdout.strip()
    try:
        stated = json.loads((Path(KERNELS) / "manifest.json").read_text(encoding="utf-8"))["sources"]
    except (OSError, ValueError, KeyError) as error:
        sys.exit(f"MDSTOPO_KERNELS={KERNELS}: no folder that packaging/ship_kernels.py has made ({error})")
    if stated != own:
        sys.exit(f"MDSTOPO_KERNELS={KERNELS}: compiled from other sources than these; `make wheel` compiles them anew")


class BuildWithData(build_py):
    """Copies cases and kernels into the package that is built, not into the one that is edited."""

    def run(self) -> None:
        """Build, then copy. What an older version has left there goes: modules that are gone would count as sources."""
        package = Path(self.build_lib) / "mdstopo"
        if not self.editable_mode:
            shutil.rmtree(package, ignore_errors=True)
        super().run()
        if self.editable_mode:
            return
        if KERNELS:
            check_kernels(package.parent.resolve())
        for name, source in (("cases", ROOT / "cases"), ("kernels", Path(KERNELS) if KERNELS else None)):
            if source is not None:
                shutil.copytree(source, package / name)


class WheelOfKernels(bdist_wheel):
    """A wheel with machine code is of one kind of machine, and of any Python."""

    def finalize_options(self) -> None:
        """With kernels it is no wheel for every machine."""
        super().finalize_options()
        self.root_is_pure = not KERNELS

    def get_tag(self) -> tuple[str, str, str]:
        """Python, binary interface, platform."""
        return ("py3", "none", "manylinux_2_17_x86_64") if KERNELS else super().get_tag()


setup(cmdclass={"build_py": BuildWithData, "bdist_wheel": WheelOfKernels})
