"""Where a result comes from: versions, machine, command."""

import os
import sys
import time
from dataclasses import dataclass, fields

from mdstopo._version import __version__
from mdstopo.installed import version_of


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
        """The provenance of this process. `command`: the command line, where there is one."""
        import h5py
        import numpy as np

        machine = os.uname()
        return cls(
            python=".".join(str(part) for part in sys.version_info[:3]),
            numpy=np.__version__,
            numba=version_of("numba"),
            h5py=h5py.__version__,
            hdf5=h5py.version.hdf5_version,
            mdstopo=__version__,
            platform=f"{machine.sysname} {machine.release} {machine.machine}",
            created=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            command=command,
        )

    def attributes(self) -> dict[str, str]:
        """The values by name, as the file holds them."""
        return {f.name: getattr(self, f.name) for f in fields(self)}
