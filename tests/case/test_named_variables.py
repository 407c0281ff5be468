"""Design variables of defined names: what follows from them, its values and slopes, and what is refused in time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.case.design.following import Expressions, expressions_of
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.store.same_case import describe, differences

from .scenes import mistakes

SCENE = """
format: 1
define: {k: 60, m: 2, c: "k/30", wide: 0.5, n: 2}
gravity: [0, -9.81]
time: {end: 0.5}
bodies: {b: {mass: "=m", inertia: "=0.1*m", position: [0, 0], velocity: [0, 0.3]}}
points:
  p: {body: b, grid: {rectangle: {center: [0, 0], size: ["=wide", 0.2], count: 8}}}
  q: {body: ground, grid: {list: [[1, 0], [2, 0]]}}
loads: [{body: b, force: [1, "=2*m"]}]
members:
  one: {from: p, to: q, law: {type: spring, stiffness: "=k*10", damping: "=c"}}
  two:
    from: {body: ground, at: [1, 1]}
    to: {body: b, at: [0, 0]}
    law:
      - {type: spring, stiffness: 5}
      - {type: expression, force: "a*x", energy: "a*x^2/2", parameters: {a: "=k^2/m"}}
objectives: {G: {response: energy}}
design: {variables: {VARIABLES}}
constraints: [{volume: all, limit: 1000}]
"""
STIFF = "s: {of: define.k, lower: 10, upper: 100}"


def text(variables: str = STIFF, **changes: str) -> str:
    made = SCENE.replace("VARIABLES", variables)
    for old, new in changes.items():
        made = made.replace(f"{old}: ", f"{old}: {new} #", 1) if old.isidentifier() else made
    return made


def read(variables: str = STIFF) -> Case:
    return read_case(text(variables))


def test_every_number_that_is_an_expression_of_the_name_follows_through_other_names_too() -> None:
    case = read()
    assert case.follows is not None
    found = {each.key: (each.group, each.law, each.parameter) for each in case.follows.numbers}
    assert found == {
        "members.one.law.stiffness": ("one", 0, "stiffness"),
        "members.one.law.damping": ("one", 0, "damping"),
        "members.two.law[1].parameters.a": ("two", 1, "a"),
    }
    (variable,) = case.variables
    assert (variable.initial, variable.count, variable.reached, variable.of) == (60.0, 1, ("one", "two"), "define.k")
    expressions = expressions_of(case.follows, case.follows.numbers)
    np.testing.assert_allclose(expressions.values(np.array([60.0])), [600.0, 2.0, 1800.0], rtol=1e-15)
    np.testing.assert_allclose(expressions.slopes(np.array([60.0]))[:, 0], [10.0, 1.0 / 30.0, 60.0], rtol=1e-15)


def test_names_reach_points_masses_and_loads_and_one_number_may_follow_from_several() -> None:
    case = read("s: {of: define.k, lower: 10, upper: 100}, h: {of: define.m, lower: 1, upper: 3}, "
                "w: {of: define.wide, lower: 0.2, upper: 0.8}")  # fmt: skip
    assert case.follows is not None
    assert {each.kind for each in case.follows.numbers} == {"law", "scene", "points"}
    assert [each.moved for each in case.variables] == [(), (), ("p",)]
    assert case.variables[2].reached == ("one",)
    laws = case.follows.of_kind("law")
    slopes = expressions_of(case.follows, laws).slopes(np.array([60.0, 2.0, 0.5]))
    np.testing.assert_allclose(slopes[2], [60.0, -900.0, 0.0], rtol=1e-15)


def test_initial_takes_the_place_of_the_defined_number_wherever_it_is_used() -> None:
    case = read("s: {of: define.k, initial: 90, lower: 10, upper: 100}")
    assert case.variables[0].initial == 90.0
    assert case.members[0].laws[0].stiffness == 900.0  # type: ignore[attr-defined]
    assert read("s: {of: define.k, initial: '=50*n - 10', lower: 10, upper: 100}").variables[0].initial == 90.0


def test_a_number_set_from_outside_is_where_the_variable_begins() -> None:
    case = read_case(text(), overrides={"define.k": "30"})
    assert case.variables[0].initial == 30.0
    assert case.members[0].laws[0].stiffness == 300.0  # type: ignore[attr-defined]


def test_a_name_that_follows_from_another_is_cut_off_from_it_where_it_varies_itself() -> None:
    case = read("s: {of: define.k, lower: 10, upper: 100}, d: {of: define.c, lower: 0, upper: 9}")
    assert case.follows is not None
    expressions = expressions_of(case.follows, case.follows.numbers)
    damping = [each.key for each in case.follows.numbers].index("members.one.law.damping")
    np.testing.assert_array_equal(expressions.slopes(np.array([60.0, 2.0]))[damping], [0.0, 1.0])


def test_other_expressions_of_the_same_numbers_are_another_case() -> None:
    other = read_case(text().replace('"=k*10"', '"=k*5 + 300"'))
    assert differences(describe(read()), other)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("of: define.k", "of: define.kk", "no name 'kk' stands in `define`, did you mean 'k'? there are k, m, c, wide"),
        ("of: define.k", "of: k", "allowed is a name in `define`, as in define.k"),
        ("of: define.k", "of: [define.k]", "allowed is a name in `define`, as in define.k"),
        ("lower: 10", "lower: 10, each: member", "found of and each, allowed is one of them"),
        ("of: define.k", "of: define.k, group: one, parameter: stiffness", "exactly one of group, of"),
        ("lower: 10", "lower: 70", "found 60 (define.k), allowed is 70 to 100"),
        ("lower: 10", "lower: 200", "found 200, allowed is at most upper 100"),
        ("of: define.k, lower: 10", "of: define.n, lower: 1", "nothing in the case follows from define.n"),
        ("end: 0.5", 'end: "=k/120"', "time.end follows from define.k, and nothing is differentiated by it"),
        ("limit: 1000", 'limit: "=k*100"', "constraints[0].limit follows from define.k, and nothing is"),
        ("count: 8", 'count: "=k/7.5"', "points.p.grid.rectangle.count follows from define.k, and nothing"),
        ("upper: 100", 'upper: "=k*2"', "design.variables.s.upper follows from define.k, and nothing"),
        ('"=k*10"', '"=step(k)*k*10"', "members.one.law.stiffness follows from define.k, by a jump, step;"),
        ('"=k*10"', '"=if(c < 3, k, 7)"', "follows from define.k, by a jump, if; allowed are kinks"),
        ('"=k*10"', '"=k - 20"', "at k = 10, members.one.law.stiffness is -10, allowed is a number >= 0"),
        ('"=k*10"', '"=sqrt(k - 10)"', "at k = 10, members.one.law.stiffness has an infinite slope"),
        ('"=k*10"', '"=1/(100 - k)"', "at k = 100, members.one.law.stiffness has no finite value"),
        ("body: b, grid", 'movable: {within: {around: 0.1}}, body: b, grid', ""),
        ("limit: 1000", "limit: 1000}, {volume: one, limit: 4", ""),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_before_anything_is_computed(old: str, new: str, words: str) -> None:
    made = text().replace(old, new, 1)
    if not words:
        read_case(made)
        return
    assert any(words in each.message for each in mistakes(made)), mistakes(made)


def test_a_number_has_one_owner() -> None:
    twice = "s: {of: define.k, lower: 10, upper: 100}, t: {of: define.k, lower: 1, upper: 90}"
    (found,) = mistakes(text(twice))
    assert (found.path_key, found.message) == ("design.variables.t.of", "define.k is varied by 's' already")
    both = "s: {of: define.k, lower: 10, upper: 100}, d: {group: one, parameter: damping, lower: 0, upper: 5}"
    (found,) = mistakes(text(both))
    assert found.message == "members.one.law.damping follows from define.k, but 'd' varies it already"
    moving = text("w: {of: define.wide, lower: 0.2, upper: 0.8}").replace(
        "p: {body: b,", "p: {body: b, movable: {within: {around: 0.1}},"
    )
    (found,) = mistakes(moving)
    assert "but these points are movable" in found.message


def test_points_that_touch_something_or_that_nothing_ends_at_cannot_follow() -> None:
    made = text("w: {of: define.wide, lower: 0.2, upper: 0.8}")
    unused = made.replace("from: p, to: q", "from: {body: b, at: [0, 0]}, to: q")
    assert any("no member begins or ends at these points" in each.message for each in mistakes(unused))


def test_what_varies_is_neither_uncertain_nor_fitted() -> None:
    uncertain = text() + "uncertainty: {sample: 4, parameters: {KEY: {normal: {deviation: 1}}}}\n"
    (found,) = mistakes(uncertain.replace("KEY", "define.k"))
    assert found.message == "define.k cannot be uncertain: it is the design variable s"
    (found,) = mistakes(uncertain.replace("KEY", "members.one.law.damping"))
    assert found.message == "members.one.law.damping cannot be uncertain: it follows from the design variable s"
    fitted = text() + (
        "fit: {estimate: {define.k: {lower: 1, upper: 99}}, measured: {x: {file: a.csv, response: energy}}}\n"
    )
    assert any("define.k cannot be estimated: it is the design variable s" in each.message for each in mistakes(fitted))


def test_a_case_that_changes_another_may_vary_its_names(tmp_path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "base.yaml").write_text(text())
    (tmp_path / "other.yaml").write_text(
        "format: 1\nextends: base.yaml\ndefine: {k: 50}\ndesign: {variables: {s: {upper: 70}}}\n"
    )
    from mdstopo.case.reader import load_case

    (variable,) = load_case(tmp_path / "other.yaml").variables
    assert (variable.initial, variable.lower, variable.upper) == (50.0, 10.0, 70.0)


_NUMBERS = st.floats(0.2, 3.0)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(_NUMBERS, _NUMBERS, st.permutations(["p", "q", "r"]))
def test_slopes_are_those_of_the_expressions_whatever_the_order_of_names(x: float, y: float, order: list[str]) -> None:
    defined = {"p": "a^2 + q", "q": "exp(-b) * r", "r": "sin(a*b) + 3"}
    given_names = {word: defined[word] for word in order}
    texts = ["p*q", "max(a, b) * r", "atan2(p, b)^1.5", "7", "clip(q, 0.1, 99) / sqrt(a)"]
    expressions = Expressions(["a", "b"], given_names, texts)
    slopes = expressions.slopes(np.array([x, y]))
    if abs(x - y) < 1e-2:
        return
    for v in range(2):
        h = np.eye(2)[v] * 1e-3
        by = sum(
            weight * (expressions.values(np.array([x, y]) + m * h) - expressions.values(np.array([x, y]) - m * h))
            for m, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0))
        ) / 1e-3  # fmt: skip
        np.testing.assert_allclose(slopes[:, v], by, rtol=1e-9, atol=1e-9)
