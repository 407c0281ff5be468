"""What the documentation shows is true: cases are read, commands and programs run and print what is shown."""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.scene.refusals import refusals

from .pages import DOCS, PAGES, ROOT, Block, blocks, case_with, commands, is_case, occurs

LONGEST = 600


def name_of(page: Path) -> str:
    return str(page.relative_to(DOCS))


def told(page: Path, block: Block) -> str:
    return f"docs/{name_of(page)}, line {block.line}"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where a page's blocks are written and run; the cases of the project are there too."""
    shutil.copytree(ROOT / "cases", tmp_path / "cases")
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_blocks_of_a_page_hold_what_they_show(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "agg")
    names: dict[str, object] = {"__name__": "__page__"}
    for block in blocks(page.read_text(encoding="utf-8")):
        if block.example:
            continue
        if block.title:
            place = folder / block.title
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_text(block.text, encoding="utf-8")
        if block.wrong:
            with pytest.raises(CaseError):
                read_case(block.text)
        elif is_case(block):
            case = load_case(folder / block.title) if block.title else read_case(block.text)
            assert refusals(case) == [], told(page, block)
        elif block.part:
            assert refusals(case_with(block.part, block.text)) == [], told(page, block)
        elif block.language == "python" and all(importlib.util.find_spec(name) for name in block.needs):
            exec(compile("\n" * block.line + block.text, str(page), "exec"), names)
        elif block.language == "console":
            check_console(page, block, folder)


def check_console(page: Path, block: Block, folder: Path, sources: Path = ROOT) -> None:
    """Run the commands of a block; the last one ends as the page says, those before it well."""
    found = commands(block.text)
    own = [each for each in found if each[0].split()[0] == "mdstopo"]
    for command, shown in own:
        done = run(command, folder, sources)
        expected = block.exit if (command, shown) == own[-1] else 0
        printed = done.stdout
        assert done.returncode == expected, f"{told(page, block)}: {command} ended with {done.returncode}:\n{printed}"
        for line in shown:
            assert occurs(line, printed), f"{told(page, block)}: {command} prints no {line!r}; it prints:\n{printed}"


def run(command: str, folder: Path, sources: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """A command line, run by bash in a folder with the program of `sources`; standard output and error together."""
    line = f'mdstopo() {{ "{sys.executable}" -m mdstopo "$@"; }}; set -o pipefail; {command}'
    return subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST,
        check=False,
        env={**os.environ, "COLUMNS": "120", "PYTHONPATH": str(sources)},
    )


def test_blocks_are_found_with_their_titles_and_comments() -> None:
    text = (
        'Text.\n\n<!-- part: loads -->\n```yaml\nloads: []\n```\n\n=== "Tab"\n\n    ```yaml title="a.yaml"\n'
        "    # note\n    format: 1\n    ```\n"
        "<!-- exit: 2 -->\n\n```console\n$ mdstopo check \\\n>   a.yaml\nx 1.234\n```\n"
    )
    part, case, console = blocks(text)
    assert (part.part, part.text, part.line) == ("loads", "loads: []\n", 4)
    assert (case.title, case.text, is_case(case)) == ("a.yaml", "# note\nformat: 1\n", True)
    assert (console.exit, commands(console.text)) == (2, [("mdstopo check a.yaml", ["x 1.234"])])


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("  G  6.81 at 0.2 s", "G 6.80874694 at 0.2 s", True),
        ("G 6.82", "G 6.80874694", False),
        ("shock 122", "shock 121.495", True),
        ("shock 121", "shock 121.505", True),
        ("shock 123", "shock 121.505", False),
        ("46, ... evaluations", "46, 47 evaluations", True),
        ("45 iterations", "46 iterations", False),
        ("a.yaml:3:5: unknown key ...", "a.yaml:3:5: unknown key 'x', allowed", True),
        ("differs by 3e-15", "differs by 2.6e-15", True),
        ("0.00", "0.004", True),
        ("102", "102.4", True),
        ("102", "103.4", False),
        ("0.100", "0.0998", True),
        ("9.99", "10.01", False),
        ("102", "103", False),
        ("nothing", "anything", False),
    ],
)
def test_lines_are_compared_by_words_and_numbers(shown: str, printed: str, same: bool) -> None:
    assert occurs(shown, f"first\n{printed}\nlast") is same


def test_parts_are_read_in_a_case_that_has_what_they_name() -> None:
    rows = "- {response: {joint_force: {joint: hip}}, limit: 3}\n- {volume: [straps], equals: 102}"
    case = case_with("constraints", rows)
    assert [joint.name for joint in case.joints] == ["hip"]
    assert [group.name for group in case.members] == ["straps"]
    with pytest.raises(CaseError, match="unknown key 'masss'"):
        case_with("bodies", "bodies: {a: {masss: 1, inertia: 1, position: [0, 0]}}")
