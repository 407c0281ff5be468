"""Defined names, and numbers of a case that are expressions."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.group import run_group
from mdstopo.finalize.document import content_of
from mdstopo.robust.sample import design_sample
from mdstopo.robust.sampled_case import case_at
from mdstopo.store.same_case import describe, differences
from mdstopo.store.store_errors import StoreError
from tests.tiers import examples

from .scenes import EVERYTHING_IN_SPACE, SMALL, mistakes

_NAMES = 'title: "=no number"\ndefine: {k: 22.5, n: 2, pulse: n * 9.81, far: "=n + 0"}\n'
DEFINED = (
    SMALL.replace("format: 1\n", f"format: 1\n{_NAMES}")
    .replace("stiffness: 225", 'stiffness: "=k * 10"')
    .replace("grid: {list: [[0, 0], [0, 1]]}", 'grid: {line: {from: [0, 0], to: ["=far - 2", 1], count: "=n"}}')
    .replace("force: [1, 0]", 'force: {table: [[0, 0, "=-pulse"], ["=n * 0.05", =pulse, 0]]}')
)


def test_expressions_are_the_numbers_that_they_come_to() -> None:
    case = read_case(DEFINED)
    plain = read_case(
        SMALL.replace("format: 1\n", 'format: 1\ntitle: "=no number"\n').replace(
            "force: [1, 0]", "force: {table: [[0, 0, -19.62], [0.1, 19.62, 0]]}"
        )
    )
    assert describe(case) == describe(plain)
    assert case.title == "=no number"
    assert case.text == DEFINED


def test_names_are_set_from_outside_and_what_uses_them_follows() -> None:
    case = read_case(DEFINED, overrides={"define.k": "300", "define.n": 3, "define.pulse": "=k / n"})
    assert case.members[0].laws[0].stiffness == 3000.0  # type: ignore[attr-defined]
    assert len(case.points["p"].local) == 3
    assert case.load_cases[0].loads[0].force[0].values[1, 0] == 100.0  # type: ignore[attr-defined, union-attr]
    assert differences(describe(read_case(DEFINED)), case)[0] == "points.p.local"


def test_a_name_may_come_from_outside_alone() -> None:
    case = read_case(SMALL.replace("225", '"=k"'), overrides={"define.k": 5})
    assert case.members[0].laws[0].stiffness == 5.0  # type: ignore[attr-defined]


def test_in_space_too() -> None:
    text = EVERYTHING_IN_SPACE.replace("dimension: 3", "define: {three: 3}\ndimension: 3")
    number = "mass: 60" if "mass: 60" in text else "mass: 2"
    assert number in text
    changed = text.replace(number, f'mass: "=three * {float(number[6:]) / 3.0!r}"', 1)
    assert describe(read_case(changed)) == describe(read_case(EVERYTHING_IN_SPACE))


@pytest.mark.parametrize(
    ("definitions", "stiffness", "path", "words"),
    [
        ("k: j, j: i + 1, i: 2 * k", "225", "define.k", "is defined by itself: k -> j -> i -> k"),
        ("k: k", "225", "define.k", "is defined by itself: k -> k"),
        ("k: lenght + 1, length: 2", "225", "define.k", "did you mean 'length'?"),
        ("k: 1 / (j - 2), j: 2", "225", "define.k", "1 / (j - 2) divides by zero (with 1, 0) (column 3"),
        ("k: 3 mm", "225", "define.k", "defined numbers are in SI units, without them: write 0.003"),
        ("k: 3", '"=k * t"', "members.belts.law.stiffness", "names are k; a formula of time has no leading ="),
        ("k: true", "225", "define.k", "found true, allowed is a number or an expression"),
        ("k: [1]", "225", "define.k", "found a list of 1"),
        ("k: .nan", '"=k"', "define.k", "found .nan, allowed is a number or an expression that is finite"),
        ("a-b: 3", "225", "define.a-b", "allowed is a letter"),
        ("sin: 3", "225", "define.sin", "is taken"),
        ("k: 3", '"=k * 1O"', "members.belts.law.stiffness", "right after a number; write 1*O (column 7"),
        ("k: 3", '"=  kk"', "members.belts.law.stiffness", "no name 'kk', did you mean 'k'? names are k (column 4"),
        ("k: 3", '"=-k"', "members.belts.law.stiffness", "found -3, the value of '=-k', allowed is a number >= 0"),
        ("k: 3", '"=exp(k^9)"', "members.belts.law.stiffness", "exp(k ^ 9) is not finite"),
        ("k: 3", "k * 3", "members.belts.law.stiffness", "(an expression begins with =)"),
        ("k: 3", '"k*3"', "members.belts.law.stiffness", "(an expression begins with =)"),
    ],
)
def test_one_mistake_is_told_once_at_its_place(definitions: str, stiffness: str, path: str, words: str) -> None:
    text = SMALL.replace("format: 1\n", f"format: 1\ndefine: {{{definitions}}}\n").replace("225", stiffness)
    (found,) = mistakes(text)
    assert found.path_key == path
    assert words in found.message
    assert found.line == (2 if path.startswith("define") else 11)
    if found.line == 11:
        assert text.splitlines()[10][found.column - 1 :].startswith(stiffness)


@pytest.mark.parametrize(
    ("definition", "words"),
    [
        ("3*t", "there is no name 't'; names are k (column 3"),
        ('"=3*t"', "there is no name 't'; names are k (column 4"),
        ("3 * t", "there is no name 't'; names are k (column 5"),
        ("1/h", "there is no name 'h'; names are k (column 3"),
        ("2 / s", "there is no name 's'; names are k (column 5"),
    ],
)
def test_products_of_names_are_not_told_as_units_or_times(definition: str, words: str) -> None:
    (found,) = mistakes(SMALL.replace("format: 1\n", f"format: 1\ndefine: {{k: {definition}}}\n"))
    assert words in found.message
    assert "SI units" not in found.message
    assert "formula of time" not in found.message


def test_what_uses_a_name_that_has_a_mistake_is_not_told_again() -> None:
    text = DEFINED.replace("k: 22.5", "k: 22.5.1").replace("pulse: n", "pulse: k")
    (found,) = mistakes(text)
    assert found.path_key == "define.k"


def test_counts_have_to_come_out_whole() -> None:
    (found,) = mistakes(DEFINED.replace('count: "=n"', 'count: "=n / 4"'))
    assert found.message == "found 0.5, the value of '=n / 4', allowed is a whole number >= 1"


def test_a_section_that_is_no_mapping() -> None:
    (found,) = mistakes(SMALL.replace("format: 1\n", "format: 1\ndefine: [1]\n"))
    assert (found.path_key, found.line) == ("define", 2)


def test_aliases_and_merge_keys_share_expressions() -> None:
    text = DEFINED.replace("  a: {mass: 2, inertia: 3", '  a: &a {mass: "=n", inertia: 3').replace(
        "  b: {mass: 4, inertia: 5, position: [2, 0]}", "  b: {<<: *a, position: [2, 0]}"
    )
    bodies = read_case(text).bodies
    assert [body.mass for body in bodies] == [2.0, 2.0]


UNCERTAIN = DEFINED + (
    "uncertainty:\n  parameters: {define.k: {uniform: {from: 10, to: 30}}}\n  sample: 4\n"
)  # fmt: skip


def test_defined_names_may_be_uncertain() -> None:
    case = read_case(UNCERTAIN)
    assert case.uncertainty is not None
    assert [(number.key, number.nominal) for number in case.uncertainty.numbers] == [("define.k", 22.5)]
    sample = design_sample(case.uncertainty)
    for i in range(4):
        made: Any = case_at(case, sample, i)
        assert made.members[0].laws[0].stiffness == 10.0 * sample.values[i, 0]


def test_scenarios_set_names_and_expressions() -> None:
    scenarios = '{set: {define.k: 30, loads.0.force: [0, "=k"]}}'
    case = read_case(DEFINED + f"uncertainty:\n  scenarios: {{stiff: {scenarios}}}\n")
    assert case.uncertainty is not None
    made: Any = case_at(case, design_sample(case.uncertainty), 0)
    assert made.members[0].laws[0].stiffness == 300.0
    assert made.load_cases[0].loads[0].force == (0.0, 30.0)


def test_a_document_made_of_a_case_has_numbers_in_place_of_expressions() -> None:
    content = content_of(read_case(DEFINED))
    assert "define" not in content
    assert content["members"]["belts"]["law"]["stiffness"] == 225
    with pytest.raises(StoreError, match=r"define\.k is uncertain"):
        content_of(read_case(UNCERTAIN))


def test_large_cases_stay_fast() -> None:
    rows = ", ".join(f'[{i + 5}, "=n * {i}"]' for i in range(4000))
    text = DEFINED.replace("list: [[2, 0], [2, 1], [2, 2]]", f"list: [{rows}]").replace("equals: 3", "fraction: 0.5")
    begun = time.process_time()
    points = read_case(text).points["q"].world
    assert time.process_time() - begun < 20.0
    assert np.array_equal(points[:, 1], 2.0 * np.arange(4000.0))


HOSTILE = """
__import__('os').system('touch pwned')
().__class__.__bases__[0].__subclasses__()
open('pwned', 'w')
k.__class__
k.real
k['a']
exec("1")
eval("1")
[x for x in (1,2)]
{1: 2}
lambda: 1
k if k else k
k; k
k = 3
k := 3
f"{k}"
'a' * 10**9
9**9**9**9
2**9999999
1 << 99999999
1 >> 1
~k
!k
k // 2
k % 2
k @ k
`k`
$k
\\x41
k\\
#
k # k
0b1
0o7
0x7
1j
1e
1e+
1e99999
.
..
...
1..2
--
+
*
/
^
()
(,)
(1,2)
min()
min(1)
max(1
clip(1,2)
if()
if(1)
if(k,1,2)
if(k<1)
if(k<1,2)
if(k<1<2,1,2)
if(if(k<1,1,2),1,2)
if((k<1),1,2)
if(k=1,1,2)
if(k==1,1,2)
if(k!=1,1,2)
k < 1
k and k
not k
k or k
None
True
nan
inf
-inf
NaN
import os
print(1)
globals()
abs
abs()
abs(1,2)
abs 1
sin cos
sin(cos)
sqrt(-1)
log(-1)
log(0)
asin(2)
acos(-2)
1/0
0/0
0^-1
(-1)^0.5
exp(710)
1e308*10
k k
k(k)
3(4)
(3)(4)
)(
((((
))))
k)
(k
k,
,k
k,,k
""".strip().splitlines()


def hostile_texts() -> list[str]:
    """By hand, and made of them: nested, long, with characters that no expression has, and cut anywhere."""
    texts = list(HOSTILE)
    texts += [f"sqrt({text})" for text in HOSTILE[:60]]
    texts += [f"2 * k + ({text}" for text in HOSTILE[:60]]
    texts += [f"k {character} 1" for character in "\u00d7\u2212\u03b1\u2028\u200b\u00a0\ufeff!\"#$%&'.:;=?@[]_`{|}~\\"]
    texts += ["(" * depth + "1" for depth in (10, 100, 1000, 4999)] + [
        "-" * 4000 + "1",
        "2^" * 2000 + "2",
        "k+" * 2400 + "k",
        "1" * 400,
        "9" * 5001,
        "k" * 5000,
        "sin(" * 1200,
    ]
    whole = "if(k > 1, sqrt(k) + min(k, 2), clip(k, 0, 1))"
    texts += [whole[:i] for i in range(1, len(whole))]
    return texts


def test_hostile_expressions_are_mistakes_with_a_column(tmp_path: Path) -> None:
    texts = hostile_texts()
    assert len(texts) > 300
    begun = time.process_time()
    for number, text in enumerate(texts):
        quoted = "".join(f"\\u{ord(c):04x}" if ord(c) > 126 else ("\\" + c if c in '"\\' else c) for c in text)
        case = SMALL.replace("format: 1\n", "format: 1\ndefine: {k: 3}\n").replace("225", f'"={quoted}"')
        with pytest.raises(CaseError) as caught:
            read_case(case)
        (found,) = caught.value.mistakes
        assert "of the expression)" in found.message, (number, text)
        assert len(found.message) < 700
        assert (found.path_key, found.line) == ("members.belts.law.stiffness", 11)
    assert time.process_time() - begun < 60.0
    assert not (tmp_path / "pwned").exists()
    assert not Path("pwned").exists()


def test_a_command_ends_with_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(DEFINED.replace("=k * 10", "=k * k.real"))
    assert run_group(["check", str(path)]) == 2
    told = capsys.readouterr()
    assert f"{path}:12:" in told.err + told.out
    assert "found '.', which no expression has (column 7 of the expression)" in told.err + told.out


@given(st.text(alphabet="k019.e+-*/^()<>=, ifsqrtlogmn_'\"[]{}:;\\\t", min_size=1, max_size=30))
@settings(max_examples=examples(30, 150), deadline=None, derandomize=True)
def test_any_text_is_a_number_or_one_located_mistake(text: str) -> None:
    quoted = text.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t")
    try:
        case = read_case(SMALL.replace("format: 1\n", "format: 1\ndefine: {k: 3}\n").replace("225", f'"={quoted}"'))
    except CaseError as error:
        (found,) = error.mistakes
        assert "expression)" in found.message or "the value of" in found.message
    else:
        assert case.members[0].laws[0].stiffness >= 0.0  # type: ignore[attr-defined]


def test_cases_of_the_project_are_read_from_files_with_names(tmp_path: Path) -> None:
    path = tmp_path / "named.yaml"
    path.write_text(DEFINED)
    assert load_case(path).members[0].laws[0].stiffness == 225.0  # type: ignore[attr-defined]
