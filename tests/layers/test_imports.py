"""Imports point downwards, without exceptions."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def contract(name: str) -> dict[str, list[str]]:
    """The lines of each setting of a contract."""
    parser = ConfigParser()
    parser.read(ROOT / ".importlinter", encoding="utf-8")
    return {key: text.split("\n") for key, text in parser[f"importlinter:contract:{name}"].items()}


@pytest.mark.parametrize("name", ["layers", "general", "case", "optimizer", "reading"])
def test_a_contract_has_no_exceptions(name: str) -> None:
    assert not {key for key in contract(name) if key.startswith(("ignore", "allow", "unmatched"))}


def test_imports_for_types_count() -> None:
    parser = ConfigParser()
    parser.read(ROOT / ".importlinter", encoding="utf-8")
    assert not parser["importlinter"].getboolean("exclude_type_checking_imports", fallback=False)


@pytest.mark.parametrize(
    ("name", "folder"), [("layers", "mdstopo"), ("general", "mdstopo/general"), ("case", "mdstopo/case")]
)
def test_every_module_has_a_layer(name: str, folder: str) -> None:
    told = " ".join(contract(name)["layers"]).replace("|", " ").replace(":", " ").split()
    inside = list((ROOT / folder).iterdir())
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
