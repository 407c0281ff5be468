"""What pyproject.toml cannot say: what goes into the package beside its modules.

The project's cases, so that they are found by name after an installation, and, where MDSTOPO_KERNELS names a folder
that `packaging/ship_kernels.py` has made, compiled kernels; the wheel is one for x86-64 Linux then.
"""

import os
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
KERNELS = os.environ.get("MDSTOPO_KERNELS", "")


class BuildWithData(build_py):
    """Copies cases and kernels into the package that is built, not into the one that is edited."""

    def run(self) -> None:
        """Build, then copy."""
        super().run()
        if self.editable_mode:
            return
        package = Path(self.build_lib) / "mdstopo"
        for name, source in (("cases", ROOT / "cases"), ("kernels", Path(KERNELS) if KERNELS else None)):
            shutil.rmtree(package / name, ignore_errors=True)
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
