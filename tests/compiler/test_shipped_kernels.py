"""Machine code that came with the package is taken where it fits, and nothing else is."""

import json
from collections.abc import Callable
from pathlib import Path

import llvmlite.binding as llvm
import pytest

from mdstopo.compiler import store
from mdstopo.compiler.store import Code

ALL = {feature: True for _, needed in store.PROCESSORS.values() for feature in needed}
CODE = Code(b"body" * 5, b"glue" * 3, "(fi)")
Shipped = Callable[..., Path | None]


@pytest.fixture
def shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shipped:
    """A package with machine code in it, on a processor with some features; the folder that is taken."""
    package = tmp_path / "package"
    (package / "compiler").mkdir(parents=True)
    monkeypatch.setattr(store, "__file__", str(package / "compiler" / "store.py"))
    monkeypatch.setattr(store, "digest_of_sources", lambda: "these")
    for setting in store.SETTINGS:
        monkeypatch.delenv(setting, raising=False)

    def lay(has: dict[str, bool] = ALL, **manifest: str) -> Path | None:
        for name in store.PROCESSORS:
            (package / store.SHIPPED / name).mkdir(parents=True, exist_ok=True)
        stated = {"sources": "these", "layout": store.layout(), **manifest}
        (package / store.SHIPPED / store.MANIFEST).write_text(json.dumps(stated))
        monkeypatch.setattr(llvm, "get_host_cpu_features", lambda: has)
        store.shipped_folder.cache_clear()
        return store.shipped_folder()

    yield lay
    store.shipped_folder.cache_clear()


def test_the_best_kind_that_the_processor_can_run_is_taken(shipped: Shipped) -> None:
    best = shipped()
    assert best is not None
    assert best.name == "avx512"
    other = shipped({**ALL, "avx512vl": False})
    assert other is not None
    assert other.name == "avx2"
    assert shipped({**ALL, "avx512vl": False, "fma": False}) is None


def test_code_of_other_sources_or_for_other_layouts_is_not_taken(
    shipped: Shipped, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shipped(sources="others") is None
    assert shipped(layout="other") is None
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert shipped() is None


def test_what_came_along_is_read_and_damage_is_noticed(
    shipped: Shipped, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = shipped()
    assert place is not None
    monkeypatch.setattr(store, "cache_folder", lambda: tmp_path / "cache")
    path = tmp_path / "cache" / "mdstopo.general.step.x-123.code"
    assert store.read(path) is None
    store.write(path, CODE)
    (place / path.name).write_bytes(path.read_bytes())
    path.unlink()
    assert store.read(path) == CODE
    assert store.are_kept("mdstopo.general.")
    assert not store.are_kept("mdstopo.integrators.")
    damaged = bytearray((place / path.name).read_bytes())
    damaged[-1] ^= 1
    (place / path.name).write_bytes(damaged)
    assert store.read(path) is None


def test_where_kernels_came_along_none_waits_to_be_compiled(
    shipped: Shipped, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store, "cache_folder", lambda: tmp_path)
    assert shipped() is not None
    assert store.is_kept("ready-springs")
    assert shipped(sources="others") is None
    assert not store.is_kept("ready-springs")
    (tmp_path / "ready-springs").touch()
    assert store.is_kept("ready-springs")


def test_a_law_of_another_distribution_has_its_kernels_compiled(
    shipped: Shipped, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = shipped()
    assert place is not None
    (place / "mdstopo.general.step.x-123.code").touch()
    monkeypatch.setattr(store, "cache_folder", lambda: tmp_path / "cache")
    assert store.is_kept("ready-springs")
    assert store.are_kept("mdstopo.general.")
    monkeypatch.setattr(store, "_foreign", "theirs")
    assert not store.is_kept("ready-springs")
    assert not store.are_kept("mdstopo.general.")
