"""Laws of formulas in case files: what is read, refused, uncertain, resized and written."""

from __future__ import annotations

import pickle
import time
from pathlib import Path
from typing import Any

import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.cli.group import run_group
from mdstopo.finalize.scaled_laws import scaled_law
from mdstopo.robust.sample import design_sample
from mdstopo.robust.sampled_case import case_at
from mdstopo.store.same_case import describe, differences
from tests.tiers import examples

from .scenes import SMALL, mistakes

LAW = '{type: expression, force: "k*x + c*xd", energy: "k*x^2/2", parameters: {k: 225, c: "=2 * 3"}}'


def with_law(law: str, more: str = "") -> str:
    return SMALL.replace("{type: spring, stiffness: 225}", law).replace("loads:", f"{more}loads:")


def test_a_law_of_formulas_is_read() -> None:
    case = read_case(with_law(LAW))
    law: Any = case.members[0].laws[0]
    assert (law.type, law.k, law.c, law.values) == ("expression", 225.0, 6.0, {"k": 225.0, "c": 6.0})
    assert law.depends_on_rate
    assert pickle.loads(pickle.dumps(case)) == case
    other = read_case(with_law(LAW.replace("225", "226")))
    assert differences(describe(case), other) == ("members.belts.law.k",)


def test_a_force_may_be_a_number_and_one_parameter_need_not_be_there() -> None:
    law: Any = read_case(with_law("{type: expression, force: 30}")).members[0].laws[0]
    assert law.program.groups[0].values[0].value == 30.0
    assert not law.depends_on_rate


@pytest.mark.parametrize(
    ("law", "key", "words"),
    [
        ("{type: expression}", "", "needed is one of them, or both"),
        ("{type: expression, parameters: {k: 1}}", "", "needed is one of them, or both"),
        ('{type: expression, force: "kk*x", parameters: {k: 1}}', ".force", "did you mean 'k'?"),
        ('{type: expression, force: "k.x", parameters: {k: 1}}', ".force", "found '.'"),
        ('{type: expression, force: "x", damping: "3*xd"}', ".damping", "goes with `energy` alone"),
        ('{type: expression, energy: "x*xd"}', ".energy", "'xd' is not allowed here"),
        ('{type: expression, energy: "x*t"}', ".energy", "'t' is not allowed here"),
        ('{type: expression, force: "x", parameters: {x: 1}}', ".parameters.x", "is taken"),
        ('{type: expression, force: "x", parameters: {force: 1}}', ".parameters.force", "is used by the program"),
        ('{type: expression, force: "x", parameters: {a-b: 1}}', ".parameters.a-b", "allowed is a letter"),
        ('{type: expression, force: "x", parameters: {k: abc}}', ".parameters.k", "found the text 'abc'"),
        ('{type: expression, force: "x", parameters: {a: 1, b: 1, c: 1, d: 1, e: 1, f: 1, g: 1, h: 1}}', ".parameters",
         "found 8 parameters, allowed are 7"),
        ("{type: expression, force: [1]}", ".force", "allowed is an expression"),
        ('{type: expression, force: "' + " + ".join(f"abs(x - {i})" for i in range(41)) + '"}', "",
         "than allowed, which are 40"),
    ],
)  # fmt: skip
def test_one_mistake_is_told_at_its_key(law: str, key: str, words: str) -> None:
    (found,) = mistakes(with_law(law))
    assert found.path_key == f"members.belts.law{key}"
    assert words in found.message
    assert found.line == 10


def test_parameters_are_design_variables_and_others_are_not() -> None:
    variables = "design: {variables: {v: {group: belts, parameter: PARAMETER, lower: 1, upper: 500}}}\n"
    case = read_case(with_law(LAW, variables.replace("PARAMETER", "k")))
    assert (case.variables[0].parameter, case.variables[0].initial) == ("k", 225.0)
    with pytest.raises(CaseError, match="parameter"):
        read_case(with_law(LAW, variables.replace("PARAMETER", "kk")))


def test_parameters_are_uncertain() -> None:
    more = (
        "uncertainty: {parameters: {members.belts.law.parameters.k: {uniform: {from: 100, to: 300}}}, sample: 4}\n"
    )  # fmt: skip
    case = read_case(with_law(LAW, more))
    assert case.uncertainty is not None
    sample = design_sample(case.uncertainty)
    made: Any = case_at(case, sample, 1)
    assert made.members[0].laws[0].k == sample.values[1, 0]


def test_a_law_with_a_members_size_in_it() -> None:
    law: Any = read_case(with_law(LAW.replace("}}", "}, free_length: 2}"))).members[0].laws[0]
    stated = scaled_law(law, 0.25)
    assert stated == {
        "type": "expression",
        "force": "0.25 * (k*x + c*xd)",
        "energy": "0.25 * (k*x^2/2)",
        "parameters": {"k": 225.0, "c": 6.0},
        "free_length": 2.0,
    }
    assert scaled_law(law, 1.0)["force"] == "k*x + c*xd"


#: what no formula of a law is: names and calls of Python, other languages, and mistakes of grammar
HOSTILE = (
    "__import__('os')", "x.__class__", "x.real", "x**2", "lambda: x", "eval(x)", "exec('1')", "open('a')", "x[0]",
    "x if x else t", "x; t", "x = 1", "x == 1", "f(x)", "sin x", "sin(x, t)", "min()", "clip(x, 1)", "if(x, 1, 2)",
    "if(x > 0, 1)", "x > 0", "1e999*x", "exp(exp(", "9^9^9*(", "2x", "x x", "()", "", "x +", "* x", "k*v", "X", "tt",
    "xdd", "L", "l_0", "Pi", "x\\n", "print(x)", "getattr(x, k)", "globals()", "None", "True", "nan", "inf", "1j",
    "0x10", "1_000", "x!", "x % 2", "x // 2", "x & 1", "not x", "x and t", "x ? 1 : 2", "{x}", "`x`", "$x", "#x",
)  # fmt: skip
WHOLE = "if(x > 0, -k*x^1.5*(1 - 2*xd), clip(k*sin(t)/l, -1, max(l0, 2)))"


def hostile_texts() -> list[str]:
    """By hand, and a good one with a wrong character anywhere, and cut anywhere."""
    texts = [*HOSTILE, "(" * 2000, "-" * 4000 + "x", "x+" * 2400 + "x", "9" * 5001, "sin(" * 1200, "x" * 5000]
    for i in range(len(WHOLE)):
        texts += [f"{WHOLE[:i]}{character}{WHOLE[i:]}" for character in "@;\u03b1"]
        texts += [WHOLE[:i]] if i else []
    return texts


def test_formulas_that_are_hostile_are_refused_at_their_column() -> None:
    read_case(with_law(f'{{type: expression, force: "{WHOLE}", parameters: {{k: 2}}}}'))
    texts = hostile_texts()
    assert len(texts) > 300
    begun = time.process_time()
    for number, text in enumerate(texts):
        quoted = "".join(("\\" + c if c in '"\\' else c) if ord(c) < 127 else f"\\u{ord(c):04x}" for c in text)
        (found,) = mistakes(with_law(f'{{type: expression, force: "{quoted}", parameters: {{k: 2}}}}'))
        assert "of the expression)" in found.message, (number, text)
        assert len(found.message) < 700
        assert (found.path_key, found.line) == ("members.belts.law.force", 10)
    assert time.process_time() - begun < 60.0


def test_formulas_that_would_take_all_time_and_memory_are_refused() -> None:
    # each switch is inside of the next, so that every margin and every derivative has all of those before it
    inner = "x"
    for _ in range(examples(14, 40)):
        inner = f"abs(a*{inner}/(b + c*xd) - d*sin(e*t + f*xd)^g)"
    letters = "{a: 1, b: 2, c: 3, d: 4, e: 5, f: 6, g: 7}"
    (found,) = mistakes(with_law(f'{{type: expression, force: "{inner}", parameters: {letters}}}'))
    assert "operations in the formulas with all derivatives, allowed are 20000" in found.message


def test_a_hostile_law_ends_a_command_with_status_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(with_law('{type: expression, force: "k*lenght", parameters: {k: 1, length: 2}}'))
    assert run_group(["check", str(path)]) == 2
    told = capsys.readouterr()
    assert f"{path}:10:" in told.err + told.out
    assert "there is no name 'lenght', did you mean 'length'?" in told.err + told.out
    assert "(column 3 of the expression)" in told.err + told.out
