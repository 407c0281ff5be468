"""The cases that come with the package, found by name: in an installation beside its modules, in a checkout above."""

from pathlib import Path


def folder() -> Path:
    """Where they are."""
    package = Path(__file__).parent.parent
    inside = package / "cases"
    return inside if inside.is_dir() else package.parent / "cases"


def names() -> list[str]:
    """The names of all of them."""
    return sorted(path.stem for path in folder().glob("*.yaml"))


def case_file(path: Path) -> Path:
    """The file that is meant: `path`, or `path`.yaml, where there is one, else the case of that name, else `path`."""
    if path.exists() or path.name != str(path):
        return path
    wanted = path if path.suffix in (".yaml", ".yml") else path.with_name(f"{path.name}.yaml")
    shipped = folder() / wanted.name
    if wanted.exists() or not shipped.is_file():
        return wanted if wanted.exists() else path
    return shipped
