"""The cases that come with the package, found by name: in an installation beside its modules, in a checkout above."""

import os
from pathlib import Path


def folder() -> Path:
    """The folder of the cases that come with the package."""
    package = Path(__file__).parents[2]
    inside = package / "cases"
    return inside if inside.is_dir() else package.parent / "cases"


def names() -> list[str]:
    """The names of all cases that come with the package."""
    return sorted(path.stem for path in folder().glob("*.yaml"))


def case_file(path: Path) -> Path:
    """The file that is meant: `path`, or `path`.yaml, where there is one, else the case of that name, else `path`."""
    if path.name != str(path) or os.path.exists(path):
        return path
    wanted = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")
    if os.path.exists(wanted):  # false, too, for what can be no name of a file
        return wanted
    shipped = folder() / wanted.name
    return shipped if os.path.isfile(shipped) else path
