"""Values, gradients and iterates are those in `golden.json`: a change of structure changes no bit.

Where a change of the mathematics was meant, the new ones are kept, and the changelog says why:
`python -m benchmarks golden --write tests/engine/golden.json`.
"""

from pathlib import Path

import pytest

from benchmarks.golden import compare, differing, machine, names, read

FILE = Path(__file__).with_name("golden.json")
WHERE, ITEMS = read(FILE)
CASES = sorted({name.partition("/")[0] for name in ITEMS})
#: only there are bits to be the same
SAME_BITS = machine() == WHERE


@pytest.mark.parametrize("case", CASES)
def test_nothing_differs_from_what_was_kept(case: str) -> None:
    own = [name for name in ITEMS if name.partition("/")[0] == case]
    found = differing(FILE, own)
    assert [each for each in found if SAME_BITS or not each.agrees] == []


def test_every_case_is_kept() -> None:
    assert {name.partition("/")[0] for name in names()} == set(CASES)
    assert set(ITEMS) <= set(names())


def test_a_changed_bit_is_found() -> None:
    name = "fig6/gauss/adjoint"
    item = {key: dict(kept) for key, kept in ITEMS[name].items()}
    item["objectives"]["bytes"] = "0" * 24
    found = compare(name, item)
    assert not found.same
    assert "objectives" in found.what.split(", ")
    assert found.what == "objectives" or not SAME_BITS
    assert found.agrees  # as another processor may have it


def test_a_changed_number_is_found() -> None:
    name = "fig6/gauss/adjoint"
    item = {key: dict(kept) for key, kept in ITEMS[name].items()}
    item["objectives"] = {**item["objectives"], "bytes": "0" * 24}
    item["objectives"]["numbers"] = [1.001 * each for each in item["objectives"]["numbers"]]
    assert not compare(name, item).agrees
