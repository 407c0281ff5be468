"""On what machine, and with what versions, the numbers were measured."""

import os
import platform
from pathlib import Path

from mdstopo._version import __version__


def description() -> str:
    """One sentence: `system`, and how busy the machine was."""
    return f"{system()}; load before the run {os.getloadavg()[0]:.1f}"


def system() -> str:
    """Processor, cores, operating system, versions."""
    import numba
    import numpy

    return (
        f"{_processor()}, {os.cpu_count()} cores, {platform.system()} {platform.machine()}; "
        f"Python {platform.python_version()}, NumPy {numpy.__version__}, Numba {numba.__version__}, "
        f"mdstopo {__version__}"
    )


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return " ".join(line.partition(":")[2].split())
    return platform.processor() or "an unknown processor"
