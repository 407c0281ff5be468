"""The glossary names what there is: modules, symbols, equations, and each term once."""

from __future__ import annotations

import re

import pytest

from mdstopo.case.laws import LAWS

from .pages import DOCS, ROOT

PAGE = (DOCS / "glossary.md").read_text(encoding="utf-8")
TERMS, _, INNER = PAGE.partition("## Names that are still to be renamed")
#: equations of the paper
LAST = 36


def rows(text: str) -> list[list[str]]:
    """The cells of all lines of tables, without headings."""
    lines = [
        line
        for line in text.splitlines()
        if line.startswith("| ") and not line.startswith(("| term", "| name", "| ---"))
    ]
    return [[cell.strip() for cell in line.strip("|").split(" |")] for line in lines]


ROWS = rows(TERMS)
WHERE = [
    (name, place)
    for *_, where in ROWS
    for names, place in re.findall(r"((?:`[\w.]+`(?:, | and )?)+) in `([\w/.]+)`", where)
    for name in re.findall(r"`([\w.]+)`", names)
]


def test_every_term_stands_once_with_its_meaning_and_its_place() -> None:
    assert len(ROWS) > 70
    assert {len(row) for row in ROWS} == {5}
    terms = [term for row in ROWS for term in row[0].replace("`", "").split(", ")]
    assert sorted(set(terms)) == sorted(terms)
    assert all(row[2] and row[4] for row in ROWS)


def test_equations_are_those_of_the_paper() -> None:
    for _, _, _, equation, _ in ROWS:
        without = re.sub(r"(Sec|Fig)\. [\w.]+|\$[^$]*\$", "", equation)
        assert all(1 <= int(number) <= LAST for number in re.findall(r"\d+", without)), equation


def test_every_row_leads_to_the_code() -> None:
    assert len(WHERE) > 80
    assert all(" in `" in row[4] for row in ROWS)


@pytest.mark.parametrize(("name", "place"), WHERE, ids=lambda text: text)
def test_a_name_is_where_the_glossary_says(name: str, place: str) -> None:
    path = ROOT / "mdstopo" / place
    if path.is_dir():
        assert (path / name).is_file()
        return
    source = path.read_text(encoding="utf-8")
    assert re.search(rf"^\s*(?:def|class) {name}\b|^{name}\b[^=\n]*=", source, re.MULTILINE), f"{name} in {place}"


def test_the_kinds_of_laws_are_those_of_the_code() -> None:
    (row,) = [row for row in ROWS if row[0].startswith("passive")]
    told = [set(re.findall(r"`(\w+)`", part)) for part in row[2].split(";")]
    kinds = row[0].split(", ")
    assert dict(zip(kinds, told, strict=True)) == {
        kind: {name for name, law in LAWS.items() if law.kind == kind} for kind in kinds
    }


def test_names_that_are_to_be_renamed_are_still_there() -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in sorted((ROOT / "mdstopo").rglob("*.py")))
    names = [name for cells in rows(INNER) for name in re.findall(r"`(\w+)`", cells[0])]
    assert names
    gone = [name for name in names if not re.search(rf"\b{name}\b", sources)]
    assert gone == [], "renamed: take them out of the glossary"
