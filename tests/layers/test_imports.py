"""Imports point downwards, and the list of exceptions only shrinks."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: exceptions that are left; lower it with each that goes, never raise it
EXCEPTIONS = 20


def contract(name: str) -> dict[str, list[str]]:
    """The lines of each setting of a contract."""
    parser = ConfigParser()
    parser.read(ROOT / ".importlinter", encoding="utf-8")
    return {key: text.split("\n") for key, text in parser[f"importlinter:contract:{name}"].items()}


def exceptions() -> list[str]:
    return [line for line in contract("layers").get("ignore_imports", []) if line]


def path_of(module: str) -> Path:
    place = ROOT.joinpath(*module.split("."))
    return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")


def test_the_list_of_exceptions_only_shrinks() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert len(exceptions()) == len(set(exceptions())) == EXCEPTIONS
    assert f"{EXCEPTIONS} imports that still point upwards" in page.replace("\n", " ")


@pytest.mark.parametrize("line", exceptions())
def test_an_exception_is_one_import_between_two_modules(line: str) -> None:
    importer, _, imported = line.partition(" -> ")
    assert path_of(importer).is_file(), importer
    assert path_of(imported).is_file(), imported


def test_the_optimiser_has_no_exceptions() -> None:
    assert set(contract("optimizer")) == {"name", "type", "source_modules", "forbidden_modules"}


def test_every_module_has_a_layer() -> None:
    told = " ".join(contract("layers")["layers"]).replace("|", " ").replace(":", " ").split()
    inside = list((ROOT / "mdstopo").iterdir())
    there = {path.stem for path in inside if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert sorted(told) == sorted(there - {"__init__"})


@pytest.mark.skipif(
    importlib.util.find_spec("importlinter") is None, reason="import-linter is not installed: pip install -e '.[dev]'"
)
def test_imports_keep_the_contracts() -> None:
    program = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
