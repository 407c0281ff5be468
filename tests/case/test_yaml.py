"""YAML 1.2's core schema, anchors and merge keys; what is not a case file at all is refused at its place."""

from __future__ import annotations

import time

import pytest

from mdstopo.case.text.nodes import DEEPEST_NESTING
from mdstopo.case.text.scalars import resolve

from .scenes import SMALL, changed, mistakes, small


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3), ("1E3", 1000.0), ("010", 10), ("-0", 0), ("+3", 3), (".5", 0.5), ("5.", 5.0),
         ("0o17", 15),
        ("0xFf", 255), ("on", "on"), ("no", "no"), ("yes", "yes"), ("y", "y"), ("1:30", "1:30"), ("1_000",
         "1_000"),
        ("0b1", "0b1"), ("2001-01-01", "2001-01-01"), ("e3", "e3"), (".", "."), ("-", "-"), ("1e", "1e"),
        ("true", True), ("TRUE", True), ("tRUE", "tRUE"), ("False", False), ("null", None), ("~", None),
         ("", None),
        (".inf", float("inf")), ("-.INF", float("-inf")), ("inf", "inf"), ("nan", "nan"), ("0o8", "0o8"),
        ("1e400", float("inf")), ("9" * 5000, float("inf")),
    ],
)  # fmt: skip
def test_plain_scalars_follow_the_core_schema(text: str, value: object) -> None:
    found = resolve(text)
    assert found == value
    assert type(found) is type(value)


def test_nan_is_a_number_that_is_not_one() -> None:
    found = resolve(".nan")
    assert isinstance(found, float)
    assert found != found


def test_scalars_in_a_case_are_resolved_after_the_core_schema() -> None:
    case = small(
        ("mass: 2,", "mass: 010,"),
        ("stiffness: 225", "stiffness: 1e-3"),
        ("format: 1", "format: 1\ntitle: on"),
    )
    assert case.bodies[0].mass == 10.0
    assert case.members[0].laws[0].stiffness == 1e-3  # type: ignore[attr-defined]
    assert case.title == "on"


def test_anchors_aliases_and_merge_keys_work() -> None:
    case = small(
        ("  a: {mass: 2,", "  a: &body {mass: &m 2,"),
        ("  b: {mass: 4, inertia: 5, position: [2, 0]}", "  b: {<<: *body, inertia: *m, position: [2, 0]}"),
    )
    a, b = case.bodies
    assert (b.mass, b.inertia, b.position) == (a.mass, a.mass, (2.0, 0.0))


def test_earlier_merged_mappings_win_over_later_ones() -> None:
    merge = "<<: [{mass: 7}, {mass: 8, inertia: 9}], position: [2, 0]"
    case = small(("mass: 4, inertia: 5, position: [2, 0]", merge))
    assert (case.bodies[1].mass, case.bodies[1].inertia) == (7.0, 9.0)


def test_a_mistake_in_an_alias_is_told_where_the_alias_stands() -> None:
    text = changed(SMALL, ("mass: 2,", "mass: &m -2,"), ("mass: 4", "mass: *m"))
    assert [(m.path_key, m.line, m.column) for m in mistakes(text)] == [
        ("bodies.a.mass", 4, 13),
        ("bodies.b.mass", 5, 13),
    ]


@pytest.mark.parametrize(
    ("text", "place", "word"),
    [
        ("", (1, 1), "nothing"),
        ("# only a remark\n", (1, 1), "nothing"),
        ("---\n...\n", (2, 1), "nothing"),
        ("- 1\n", (1, 1), "list"),
        ("hello\n", (1, 1), "'hello'"),
        ("format: 1\n---\nformat: 1\n", (2, 1), "second document"),
        ("a: [1, 2\nb: 3\n", (2, 2), "expected"),
        ("a:\n\tb: 1\n", (2, 1), "tab"),
        ("a: 'x\n", (2, 1), "quoted"),
        ("a: b: c\n", (1, 5), "mapping values"),
        ("a: \x00\n", (1, 4), "U+0000"),
        ("a: 1\nb: \x07\n", (2, 4), "U+0007"),
        ("a: \ud800\n", (1, 1), "UTF-8"),
        ("a: *b\n", (1, 4), "&b"),
        ("a: &a [*a]\n", (1, 8), "inside"),
        ("%YAML 3.0\n---\na: 1\n", (1, 1), "incompatible"),
        ("a: " + "[" * 900, (1, 3 + DEEPEST_NESTING), "deeper"),
        ("- " * 900, (1, 2 * DEEPEST_NESTING + 1), "deeper"),
    ],
)
def test_what_is_no_case_file_is_refused_at_its_place(text: str, place: tuple[int, int], word: str) -> None:
    (mistake,) = mistakes(text)
    assert (mistake.line, mistake.column) == place
    assert word in mistake.message


@pytest.mark.parametrize("text", ["a: " + "[" * 100_000, "- " * 100_000])
def test_what_is_nested_very_deeply_is_refused_by_its_depth(text: str) -> None:
    """Some versions of the parser refuse it themselves, further on in the line."""
    (mistake,) = mistakes(text)
    assert mistake.line == 1
    assert mistake.message == f"nested deeper than {DEEPEST_NESTING} levels"


def test_an_alias_bomb_is_refused_with_its_count_and_at_once() -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 40)]
    start = time.perf_counter()
    (mistake,) = mistakes("\n".join(lines))
    assert time.perf_counter() - start < 1.0
    assert "10^40" in mistake.message


def test_a_merge_bomb_does_no_harm() -> None:
    lines = ["a0: &a0 {x: 1}"]
    lines += [f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 10)}]}}" for i in range(1, 30)]
    start = time.perf_counter()
    assert mistakes("\n".join(lines))
    assert time.perf_counter() - start < 1.0
