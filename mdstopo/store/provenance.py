"""Where a result comes from: versions, machine, command."""

import importlib.util
import os
import sys
import time
from dataclasses import dataclass, fields
from pathlib import Path

from mdstopo._version import __version__


@dataclass(frozen=True, slots=True)
class Provenance:
    """What made a result file, as attributes of its group `provenance`; every field is text."""

    python: str
    numpy: str
    numba: str
    h5py: str
    hdf5: str
    mdstopo: str
    platform: str
    created: str
    command: str

    @classmethod
    def collect(cls, command: str = "") -> "Provenance":
        """That of this process. `command`: the command line, where there is one."""
        import h5py
        import numpy as np

        machine = os.uname()
        return cls(
            python=".".join(str(part) for part in sys.version_info[:3]),
            numpy=np.__version__,
            numba=_version_of("numba"),
            h5py=h5py.__version__,
            hdf5=h5py.version.hdf5_version,
            mdstopo=__version__,
            platform=f"{machine.sysname} {machine.release} {machine.machine}",
            created=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            command=command,
        )

    def attributes(self) -> dict[str, str]:
        """By name, as the file holds them."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def _version_of(package: str) -> str:
    module = sys.modules.get(package)
    if module is not None:
        return str(module.__version__)
    # Where the package was not needed. Its installation's folder says it; reading metadata costs as much as a run.
    found = importlib.util.find_spec(package)
    if found is not None and found.origin is not None:
        folders = list(Path(found.origin).parent.parent.glob(f"{package}-*.dist-info"))
        if len(folders) == 1:
            return folders[0].name.removesuffix(".dist-info").partition("-")[2]
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(package)
    except PackageNotFoundError:
        return ""
