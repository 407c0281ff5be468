"""The case with fitted numbers: as it was written where that can be, and always the same case."""

from __future__ import annotations

from pathlib import Path

import pytest

from mdstopo.case.reader import load_case
from mdstopo.fit.fitted_case import fitted_text

TEXT = """\
format: 1
define: {m: 5}            # the block's mass
time: {end: 0.5}
bodies:
  block: {mass: "=m", inertia: "0.1 kg m^2", position: [0, 0.5]}
points:
  feet: {body: block, grid: {list: {file: feet.csv}}}
members:
  # what it falls on
  foam: {from: {body: ground, at: [0, -1]}, to: feet, design: false,
         law: {type: spring, stiffness: 8e3, damping: '20 N s/m'}}
fit:
  estimate:
    members.foam.law.stiffness: {lower: 1, upper: 1.e+5}
    members.foam.law.damping: {lower: 1, upper: 100}
    define.m: {lower: 1, upper: 10}
    bodies.block.inertia: {lower: 0.01, upper: 1}
    bodies.block.position[1]: {lower: 0, upper: 1}
  measured:
    y: {file: y.csv, response: {displacement: {body: block, component: y}}}
"""
NUMBERS = {
    "members.foam.law.stiffness": 7654.321,
    "members.foam.law.damping": 12.5,
    "define.m": 4.75,
    "bodies.block.inertia": 0.0625,
    "bodies.block.position[1]": 0.25,
}


@pytest.fixture
def place(tmp_path: Path) -> Path:
    (tmp_path / "feet.csv").write_text("0,0\n0.1,0\n", encoding="utf-8")
    (tmp_path / "case.yaml").write_text(TEXT, encoding="utf-8")
    return tmp_path


def check(path: Path) -> None:
    case = load_case(path)
    assert case.bodies[0].mass == 4.75
    assert case.bodies[0].inertia == 0.0625
    assert case.bodies[0].position == (0.0, 0.25)
    law = case.members[0].laws[0]
    assert (law.stiffness, law.damping) == (7654.321, 12.5)  # type: ignore[attr-defined]
    assert len(case.members[0]) == 2
    assert case.fit is not None
    assert case.fit.numbers[2].range.initial == 4.75


def test_in_the_same_folder_only_numbers_change(place: Path) -> None:
    text = fitted_text(load_case(place / "case.yaml"), NUMBERS, place / "fitted.yaml")
    (place / "fitted.yaml").write_text(text, encoding="utf-8")
    check(place / "fitted.yaml")
    assert "# what it falls on" in text
    assert "define: {m: 4.75}            # the block's mass" in text
    assert len(text.splitlines()) == len(TEXT.splitlines())


def test_in_another_folder_files_are_found(place: Path) -> None:
    (place / "results").mkdir()
    text = fitted_text(load_case(place / "case.yaml"), NUMBERS, place / "results" / "fitted.yaml")
    (place / "results" / "fitted.yaml").write_text(text, encoding="utf-8")
    check(place / "results" / "fitted.yaml")
    assert "../y.csv" in text


def test_what_was_set_from_outside_is_kept(place: Path) -> None:
    case = load_case(place / "case.yaml", {"time.end": 0.25})
    text = fitted_text(case, NUMBERS, place / "fitted.yaml")
    (place / "fitted.yaml").write_text(text, encoding="utf-8")
    check(place / "fitted.yaml")
    assert load_case(place / "fitted.yaml").load_cases[0].end == 0.25


def test_a_number_that_others_share_by_an_anchor_changes_alone(place: Path) -> None:
    text = TEXT.replace('mass: "=m"', "mass: &five 5").replace("stiffness: 8e3", "stiffness: *five")
    (place / "case.yaml").write_text(text.replace("    define.m: {lower: 1, upper: 10}\n", ""), encoding="utf-8")
    numbers = {key: value for key, value in NUMBERS.items() if key != "define.m"}
    written = fitted_text(load_case(place / "case.yaml"), numbers, place / "fitted.yaml")
    (place / "fitted.yaml").write_text(written, encoding="utf-8")
    case = load_case(place / "fitted.yaml")
    assert case.bodies[0].mass == 5.0
    assert case.members[0].laws[0].stiffness == 7654.321  # type: ignore[attr-defined]


def test_a_law_that_another_group_shares_by_an_anchor_changes_alone(place: Path) -> None:
    text = TEXT.replace("law: {type", "law: &foam {type").replace(
        "fit:\n", "  more: {from: {body: ground, at: [0, -2]}, to: feet, law: *foam, design: false}\nfit:\n"
    )
    (place / "case.yaml").write_text(text, encoding="utf-8")
    written = fitted_text(load_case(place / "case.yaml"), NUMBERS, place / "fitted.yaml")
    (place / "fitted.yaml").write_text(written, encoding="utf-8")
    check(place / "fitted.yaml")
    assert load_case(place / "fitted.yaml").members[1].laws[0].stiffness == 8e3  # type: ignore[attr-defined]


def test_a_case_that_extends_another_is_written_whole(place: Path) -> None:
    (place / "more.yaml").write_text("format: 1\nextends: case.yaml\ntitle: More\n", encoding="utf-8")
    text = fitted_text(load_case(place / "more.yaml"), NUMBERS, place / "fitted.yaml")
    (place / "fitted.yaml").write_text(text, encoding="utf-8")
    check(place / "fitted.yaml")
    assert "extends" not in text
