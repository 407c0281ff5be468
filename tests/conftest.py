"""What holds for all tests."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tests import rewriting, tiers, times
from tests.entries import hold_calls
from tests.tiers import mark, without_test

_WHERE = "import importlib.util as u; found = u.find_spec('mdstopo'); print(found and found.origin or '')"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Options of our own."""
    times.add_option(parser)


def pytest_configure(config: pytest.Config) -> None:
    """Hold calls of entries to the wheel's table; refuse to begin where programs that tests start would be those of
    another checkout."""
    tiers.begin(config)
    hold_calls()
    times.begin(config)
    config.pluginmanager.register(rewriting)
    if hasattr(config, "workerinput"):
        return  # the process that gives the tests out has asked
    asked = [sys.executable, "-P", "-c", _WHERE]
    with tempfile.TemporaryDirectory() as elsewhere:
        found = subprocess.run(asked, cwd=elsewhere, capture_output=True, text=True, check=True).stdout.strip()
    own = Path(__file__).parent.parent / "mdstopo" / "__init__.py"
    if os.path.realpath(found) != os.path.realpath(own):
        raise pytest.UsageError(
            f"{sys.executable} has {found or 'no mdstopo'} installed, not {own}: "
            f"install this checkout (pip install --editable .), or set PYTHONPATH={own.parent.parent}"
        )


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what `make test` leaves out; an entry for it that names no test is a mistake."""
    mark(items)
    if config.args == config.getini("testpaths"):
        lost = without_test([item.nodeid for item in items])
        if lost:
            raise pytest.UsageError(f"tests/tiers.py has entries without a test: {', '.join(lost)}")
