"""Branches by code made from a list: which kernel is called with what, and what happens when the list grows."""

import gc
import sys
import weakref
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from mdstopo.compiler import store
from mdstopo.compiler.choice_by_code import Listed, chosen
from mdstopo.compiler.jit import entry, inline


@inline
def twice(x):
    return 2.0 * x


@inline
def product(y, x):
    return x * y + 100.0 * y


def table(*things: Any) -> Listed[Any]:
    listed: Listed[Any] = Listed()
    for thing in things:
        listed.add(thing)
    listed.is_filled = True
    return listed


FEW = table(twice, product, None, True)


@chosen(FEW, lambda each: each, inline)
def few(code, x, y):
    """What an unknown code gives."""
    return -1.0


@entry
def call_few(code, x, y):
    return few(code, x, y)


def test_each_code_has_its_kernel_with_the_arguments_that_it_names() -> None:
    assert [call_few(code, 3.0, 5.0) for code in (0, 1, 2, 3, 4, -1)] == [6.0, 515.0, -1.0, 1.0, -1.0, -1.0]


GROWING = table(twice)


@chosen(GROWING, lambda each: each, inline)
def growing(code, x, y):
    return -1.0


@entry
def call_growing(code, x, y):
    return growing(code, x, y)


def test_what_was_compiled_before_the_list_grew_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "_foreign", "0" * 16)  # a folder that no other test has
    monkeypatch.setattr(store, "_included", set())
    name = f"brought_{tmp_path.name.replace('-', '_')}"
    (tmp_path / f"{name}.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    prepared = call_growing.prepare(0, 3.0, 5.0)  # type: ignore[attr-defined]
    assert (prepared(), call_growing(1, 3.0, 5.0)) == (6.0, -1.0)
    __import__(name)
    GROWING.add(product)
    store.include(name)
    assert call_growing(1, 3.0, 5.0) == 515.0
    assert call_growing(0, 3.0, 5.0) == 6.0
    assert prepared() == 6.0


def test_a_list_that_a_module_fills_makes_nothing_anew() -> None:
    before = few.dispatcher  # type: ignore[attr-defined]
    filling: Listed[Any] = Listed()
    filling.add(twice)
    assert few.dispatcher is before  # type: ignore[attr-defined]
    filling.is_filled = True
    filling.add(product)
    assert few.dispatcher is not before  # type: ignore[attr-defined]


def test_what_was_compiled_outlives_a_list_that_grows() -> None:
    """Numba's tables hold functions weakly, and looking anything up there fails where it meets one that is gone."""
    kept = weakref.ref(few.dispatcher)  # type: ignore[attr-defined]
    FEW.add(None)
    _ = few.dispatcher  # type: ignore[attr-defined]
    gc.collect()
    assert kept() is not None


@chosen(table(product), lambda each: each, inline)
def without(code, x):
    return -1.0


def test_a_kernel_that_asks_for_what_there_is_not_is_told() -> None:
    with pytest.raises(TypeError, match="product asks for y; without has code, x"):
        _ = without.dispatcher  # type: ignore[attr-defined]


def test_the_folder_follows_the_sources_of_other_distributions_and_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.py").write_text(name)
        module = ModuleType(name)
        module.__file__ = str(tmp_path / f"{name}.py")
        monkeypatch.setitem(sys.modules, name, module)

    def folder(*names: str) -> str:
        monkeypatch.setattr(store, "_foreign", "")
        monkeypatch.setattr(store, "_included", set())
        for name in names:
            store.include(name)
        return store._foreign

    seen = [folder(), folder("one"), folder("two"), folder("one", "two"), folder("two", "one")]
    assert len(set(seen)) == len(seen)
    assert folder("one", "one") == folder("one")
    (tmp_path / "one.py").write_text("changed")
    assert folder("one") not in seen
