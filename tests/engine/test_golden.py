"""Values, gradients and iterates are those in `golden.json`: a change of structure changes no bit.

Where a change of the mathematics was meant, the new ones are kept, and the changelog says why:
`python -m benchmarks golden --write tests/engine/golden.json`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.golden import compare, differing, machine, names, read

FILE = Path(__file__).with_name("golden.json")
WHERE, ITEMS = read(FILE)
CASES = sorted({name.partition("/")[0] for name in ITEMS})
#: only there are bits to be the same
SAME_BITS = machine() == WHERE
#: what differs of all iterates, in a process of its own
ITERATES = f"""
from pathlib import Path
from benchmarks.golden import ITERATED, differing
found = differing(Path({str(FILE)!r}), [f"{{case}}/iterates" for case in ITERATED])
print([each for each in found if {SAME_BITS} or not each.agrees])
"""


@pytest.mark.parametrize("case", CASES)
def test_nothing_differs_from_what_was_kept(case: str) -> None:
    own = [name for name in ITEMS if name.partition("/")[0] == case and not name.endswith("/iterates")]
    found = differing(FILE, own)
    assert [each for each in found if SAME_BITS or not each.agrees] == []


def test_iterates_are_those_that_were_kept_where_nothing_was_compiled_before(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", ITERATES],
        cwd=root,
        env={**os.environ, "MDSTOPO_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[]"


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
