"""What `make test` leaves out is listed rightly, and leaves something of every folder."""

from pathlib import Path

from tests import tiers

HERE = Path(__file__).resolve().parent


def test_a_test_is_thorough_where_a_part_of_its_name_is_listed(monkeypatch):
    monkeypatch.setattr(tiers, "THOROUGH", {"a/test_b.py": ("slow", "[alpha"), "a/test_c.py": ("",)})
    for name in ("test_b.py::test_slow_one", "test_b.py::test_x[alpha-1]", "test_c.py::test_any"):
        assert tiers.is_thorough(f"tests/a/{name}")
    for name in ("test_b.py::test_x[gauss-alpha]", "test_d.py::test_slow_one"):
        assert not tiers.is_thorough(f"tests/a/{name}")
    assert tiers.without_test(["tests/a/test_b.py::test_slow_one"]) == ["a/test_b.py: '[alpha'", "a/test_c.py: ''"]


def test_every_folder_keeps_files_that_are_tested_at_once():
    whole = {HERE / file for file, parts in tiers.THOROUGH.items() if "" in parts}
    folders = {path.parent for path in HERE.glob("*/test_*.py")}
    assert len(folders) > 20
    for folder in folders:
        assert set(folder.glob("test_*.py")) - whole, folder
