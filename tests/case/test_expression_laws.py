"""Laws of formulas in case files: what is read, refused, uncertain, resized and written."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

from mdstopo.case.errors import CaseError
from mdstopo.case.reader import read_case
from mdstopo.finalize.scaled_laws import sized
from mdstopo.robust.points import case_at
from mdstopo.robust.sample import design_sample
from mdstopo.store.same_case import describe, differences

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
    assert law.program.groups[0][0].value == 30.0
    assert not law.depends_on_rate


@pytest.mark.parametrize(
    ("law", "key", "words"),
    [
        ("{type: expression}", "", "needed is at least one of force, energy"),
        ("{type: expression, parameters: {k: 1}}", "", "needed is at least one of force, energy"),
        ('{type: expression, force: "kk*x", parameters: {k: 1}}', ".force", "did you mean 'k'?"),
        ('{type: expression, force: "k.x", parameters: {k: 1}}', ".force", "found '.'"),
        ('{type: expression, force: "x", damping: "3*xd"}', ".damping", "goes with `energy` alone"),
        ('{type: expression, energy: "x*xd"}', ".energy", "'xd' is not allowed here"),
        ('{type: expression, energy: "x*t"}', ".energy", "'t' is not allowed here"),
        ('{type: expression, force: "x", parameters: {x: 1}}', ".parameters.x", "is taken"),
        ('{type: expression, force: "x", parameters: {force: 1}}', ".parameters.force", "is taken"),
        ('{type: expression, force: "x", parameters: {a-b: 1}}', ".parameters.a-b", "allowed is a letter"),
        ('{type: expression, force: "x", parameters: {k: abc}}', ".parameters.k", "found the text 'abc'"),
        ('{type: expression, force: "x", parameters: {a: 1, b: 1, c: 1, d: 1, e: 1, f: 1, g: 1, h: 1}}', ".parameters",
         "found 8 parameters, allowed are 7"),
        ("{type: expression, force: [1]}", ".force", "allowed is an expression"),
        ('{type: expression, force: "' + " + ".join(f"abs(x - {i})" for i in range(50)) + '"}', "",
         "found 50 kinks and jumps, allowed are 40"),
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
    stated = sized(law, 0.25)
    assert stated == {
        "type": "expression",
        "force": "0.25 * (k*x + c*xd)",
        "energy": "0.25 * (k*x^2/2)",
        "parameters": {"k": 225.0, "c": 6.0},
        "free_length": 2.0,
    }
    assert sized(law, 1.0)["force"] == "k*x + c*xd"


def test_formulas_that_are_hostile_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for text in (
        "__import__('os')",
        "x.__class__",
        "(" * 2000,
        "x**2",
        "9^9^9^9^9^9^9*(",
        "lambda: x",
        "exp(exp(",
        "1e999*x",
    ):
        with pytest.raises(CaseError) as caught:
            read_case(with_law(f"{{type: expression, force: {text!r}}}".replace("\\'", "''")))
        assert "of the expression)" in str(caught.value)
