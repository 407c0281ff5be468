"""The worked examples of docs/extending.md, made in a copy of the project as the page shows them, work."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from .pages import DOCS, ROOT, Block, blocks
from .test_pages import check_console

PAGE = DOCS / "extending.md"
EXAMPLES = [block for block in blocks(PAGE.read_text(encoding="utf-8")) if block.example]
#: the tests that what is new joins: its own in the long ones, all of the short ones
JOINED = [
    ["tests/mechanics/test_laws.py", "-k", "saturating or law"],
    ["tests/mechanics/test_joints.py", "-k", "parallel or codes"],
    ["tests/cli/test_finalize.py", "-k", "which_keys_are_forces or forces_scaled"],
    ["tests/general/test_random_scenes.py", "-k", "gradients"],
    ["tests/general/test_orders.py", "-k", "classical"],
    ["tests/optimizer/test_scalarisation.py"],
    ["tests/robust/test_measures.py", "-k", "slopes"],
    ["tests/robust/test_samples.py", "-k", "interval or distribution"],
    ["tests/general/test_reductions.py"],
    ["tests/fit/test_statistics.py", "-k", "loss"],
    ["tests/docs/test_generated.py"],
    ["tests/layers"],
]


def changed(text: str, block: Block) -> str:
    """A file with the changes of a block; each place that it shows must be there once."""
    for part in re.split(r"^@@\n", block.text, flags=re.MULTILINE):
        lines = part.splitlines()
        before = "".join(f"{line[1:]}\n" for line in lines if line[:1] in ("", " ", "-"))
        after = "".join(f"{line[1:]}\n" for line in lines if line[:1] in ("", " ", "+"))
        found = [each.start() for each in re.finditer(f"^{re.escape(before)}", text, re.MULTILINE)]
        assert len(found) == 1, f"docs/extending.md, line {block.line}: {block.title} has {len(found)} times:\n{before}"
        text = text[: found[0]] + after + text[found[0] + len(before) :]
    return text


def test_changes_are_made_where_their_surroundings_are() -> None:
    block = Block(1, "diff", "a.py", " a\n-b\n+c\n@@\n\n d\n+e\n")
    assert changed("b\na\nb\n\nd\n", block) == "b\na\nc\n\nd\ne\n"
    for text in ("a\nb\na\nb\n\nd\n", "a\nc\n\nd\n", "xa\nb\n\nd\n"):
        with pytest.raises(AssertionError, match=r"docs/extending\.md, line 1: a\.py has"):
            changed(text, block)


def make_examples(folder: Path) -> None:
    """Apply the blocks of the page to the project in a folder."""
    for block in EXAMPLES:
        place = folder / block.title
        if block.language == "diff":
            place.write_text(changed(place.read_text(encoding="utf-8"), block), encoding="utf-8")
        elif block.title:
            assert not place.exists(), block.title
            place.write_text(block.text, encoding="utf-8")


def test_every_change_of_the_page_fits_the_sources(tmp_path: Path) -> None:
    for block in EXAMPLES:
        source = ROOT / block.title
        if block.title:
            (tmp_path / block.title).parent.mkdir(parents=True, exist_ok=True)
        if block.language == "diff" and source.exists():  # the others change what a block before has made
            shutil.copy(source, tmp_path / block.title)
    make_examples(tmp_path)


def test_the_worked_examples_do_what_the_page_says(tmp_path: Path) -> None:
    copy = tmp_path / "project"
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("mdstopo", "tests", "docs", "documentation", "cases", "packaging"):
        shutil.copytree(ROOT / name, copy / name, ignore=ignored)
    for name in ("pyproject.toml", "mkdocs.yml", ".importlinter"):
        shutil.copy(ROOT / name, copy)
    make_examples(copy)
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    for words in JOINED:
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words]
        done = subprocess.run(
            command, cwd=copy, env=environment, capture_output=True, text=True, timeout=1800, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    for block in EXAMPLES:
        if block.language == "console":
            check_console(PAGE, block, copy, copy)
