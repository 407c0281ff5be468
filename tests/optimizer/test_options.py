"""Settings by name: the table is sound, mistakes are caught with the nearest right word."""

import subprocess
import sys

import pytest

from mdstopo.settings.optimizer_options import OPTIONS
from mdstopo.settings.optimizer_presets import PRESETS, mistakes, resolve, settings


def test_defaults_and_presets_lie_within_the_limits():
    for name, option in OPTIONS.items():
        assert type(option.default) is option.type, name
        assert option.doc
    for name, preset in PRESETS.items():
        assert mistakes(name, preset) == {}


def test_single_settings_override_the_preset():
    values = resolve("oc", {"move_limit": 0.1, "peaks": 3.0})
    assert values["move_limit"] == 0.1
    assert values["peaks"] == 3
    assert isinstance(values["peaks"], int)
    assert values["zero_shift"] is True
    assert values.keys() == OPTIONS.keys()


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("moov_limit", 0.1, "did you mean 'move_limit'"),
        ("peaks", 0, "between 1 and 6"),
        ("peaks", 2.5, "whole number"),
        ("power", 1.5, "between -5 and 1"),
        ("power", True, "must be a number"),
        ("power", "high", "must be a number"),
        ("power", float("nan"), "between"),
        ("trust_region", 1, "true or false"),
    ],
)
def test_a_mistake_is_a_sentence(name, value, words):
    assert words in mistakes("default", {name: value})[name]
    with pytest.raises(ValueError, match=name):
        settings("default", {name: value})


def test_a_misspelt_preset_is_named():
    assert "did you mean 'mma'" in mistakes("mmma", {})["preset"]
    with pytest.raises(ValueError, match="preset"):
        resolve("mmma", {})


def test_the_table_imports_nothing_heavy():
    heavy = "('numpy', 'numba', 'scipy')"
    code = f"import sys, mdstopo.settings.optimizer_presets; sys.exit(any(m in sys.modules for m in {heavy}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
