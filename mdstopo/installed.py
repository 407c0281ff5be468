"""Versions of packages, without importing them: that would take longer than a run."""

import importlib.util
import sys
from pathlib import Path


def version_of(package: str) -> str:
    """The version of an installed package; empty where it is not installed."""
    module = sys.modules.get(package)
    if module is not None:
        return str(module.__version__)
    # Its installation's folder says it; reading metadata costs as much as a run.
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
