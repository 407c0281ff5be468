"""Laws by formula that are springs, linear or cubic, are recognised, and no others."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from mdstopo.case.laws.cubic_law import CubicLaw
from mdstopo.case.laws.spring_law import SpringLaw
from mdstopo.case.reader import read_case
from mdstopo.formula.parser import parse
from mdstopo.general.scene.formula_springs import polynomial, spring_of, with_springs
from mdstopo.mechanics.laws import law_table
from tests.formula.random_formulas import evaluate

from .test_expression_kernels import law_of

NUMBERS = {"k": 225.0, "c": 2.0, "p": 3.0}
SPRINGS = [
    ("k*x + c*xd", "k*x^2/2", None, (225.0, 2.0, 0.0), {"k": "stiffness", "c": "damping"}),
    ("p - -c*xd + x*k", "x*k*x*0.5", None, (225.0, 2.0, 3.0), {"k": "stiffness", "c": "damping", "p": "preload"}),
    (None, "k*x^2/2", None, (225.0, 0.0, 0.0), {"k": "stiffness"}),
    (None, "x^2*k/2", "c*xd + 7", (225.0, 2.0, 7.0), {"k": "stiffness", "c": "damping"}),
    ("c*xd", None, None, (0.0, 2.0, 0.0), {"c": "damping"}),
    ("225*x + (l - l0 - x)", "450*x^2/4", None, (225.0, 0.0, 0.0), {}),
]
OTHERS = [
    ("k*x", None, None),  # stores nothing, as a spring does not
    ("k*x + c*x^2", "k*x^2/2", None),
    ("k*x", "c*x^2/2", None),
    ("k*x", "k*x^2/2 + p", None),
    ("k*x + k*xd", "k*x^2/2", None),
    ("k*c*x", "k*c*x^2/2", None),
    ("2*k*x", "k*x^2", None),
    ("k*x + t", "k*x^2/2", None),
    ("k*x + c*x^3", "k*x^2/2 + c*x^4/2", None),
    ("k*x + k*x^3", "k*x^2/2 + k*x^4/4", None),
    ("k*x + c*x^3 + p", "k*x^2/2 + c*x^4/4 + p*x", None),
    ("k*l", "k*l^2/2", None),
    ("k*x + c*xd^2", "k*x^2/2", None),
    ("k*abs(x)", "k*x*abs(x)/2", None),
    ("k*sin(x)", "-k*cos(x)", None),
]


@pytest.mark.parametrize(("force", "energy", "damping", "numbers", "words"), SPRINGS)
def test_a_spring_is_recognised_however_it_is_written(
    force: str | None,
    energy: str | None,
    damping: str | None,
    numbers: tuple[float, float, float],
    words: dict[str, str],
) -> None:
    law = law_of(force, energy, damping, **NUMBERS)
    found = spring_of(law)
    assert found is not None
    spring, taken = found
    assert isinstance(spring, SpringLaw)
    assert (spring.stiffness, spring.damping, spring.preload) == numbers
    assert taken == words
    # both say the same, computed apart
    for x, xd in ((0.3, -2.0), (-0.1, 0.7)):
        names = {"x": x, "xd": xd, "t": 0.4, "l0": 0.7, "l": x + 0.7, **NUMBERS}
        if force is not None:
            assert evaluate(force, names) == pytest.approx(float(spring.force_at(np.array(x), np.array(xd))), rel=1e-14)
        if energy is not None:
            assert evaluate(energy, names) == pytest.approx(0.5 * spring.stiffness * x**2, rel=1e-14)


CUBICS = [
    ("k*x + c*x^3", "k*x^2/2 + c*x^4/4", (225.0, 2.0), {"k": "stiffness", "c": "cubic"}),
    (None, "x^2*(k/2 + c*x^2/4)", (225.0, 2.0), {"k": "stiffness", "c": "cubic"}),
    ("3*x*x*x", "0.75*x^4", (0.0, 3.0), {}),
]


@pytest.mark.parametrize(("force", "energy", "numbers", "words"), CUBICS)
def test_a_cubic_spring_is_recognised(
    force: str | None, energy: str, numbers: tuple[float, float], words: dict[str, str]
) -> None:
    found = spring_of(law_of(force, energy, **NUMBERS))
    assert found is not None
    spring, taken = found
    assert isinstance(spring, CubicLaw)
    assert (spring.stiffness, spring.cubic) == numbers
    assert taken == words


@pytest.mark.parametrize(("force", "energy", "damping"), OTHERS)
def test_what_is_no_spring_is_none(force: str, energy: str | None, damping: str | None) -> None:
    assert spring_of(law_of(force, energy, damping, **NUMBERS)) is None


def test_polynomials_are_exact_and_anything_else_is_none() -> None:
    form = polynomial(parse("(x + 2*k)^2 - x*x - 4*x*k").root)
    assert form == {("k", "k"): Fraction(4)}
    for text in ("x/k", "x^k", "x^5", "sqrt(x)", "if(x > 0, x, k)", "x/0"):
        assert polynomial(parse(text).root) is None, text


CASE = """
format: 1
time: {end: 0.1}
bodies: {load: {mass: 20, inertia: 0.5, position: [0, 0], velocity: [1, 0.4]}}
points:
  eye: {body: load, grid: {list: [[0.1, 0]]}}
  hook: {body: ground, grid: {list: [[1, 0]]}}
members:
  one: {from: eye, to: hook, law: {type: expression, force: "k*x", energy: "k*x^2/2", parameters: {k: 800}}}
  two: {from: eye, to: hook, law: {type: expression, force: "k*x^3", parameters: {k: 900}}}
  three: {from: eye, to: hook, law: {type: expression, energy: "k*x^2/2", damping: "c*xd", parameters: {k: 700, c: 2}}}
design:
  variables:
    VARIABLE
    c: {group: three, parameter: c, lower: 0, upper: 9}
    rest: {group: one, parameter: free_length, lower: 0.5, upper: 2, initial: 1}
objectives: {G: {response: energy}}
"""


@pytest.mark.parametrize(
    ("groups", "springs", "parameter"),
    [("one", ("one", "three"), "stiffness"), ("[one, three]", ("one", "three"), "stiffness"),
     ("[one, two]", ("three",), "k"), ("two", ("one", "three"), "k")],
)  # fmt: skip
def test_variables_of_springs_are_those_of_springs_and_what_shares_one_with_others_stays(
    groups: str, springs: tuple[str, ...], parameter: str
) -> None:
    text = CASE.replace("VARIABLE", f"k: {{group: {groups}, parameter: k, lower: 100, upper: 9000, initial: 500}}")
    found = with_springs(read_case(text))
    assert tuple(group.name for group in found.members if isinstance(group.laws[0], SpringLaw)) == springs
    assert [each.parameter for each in found.variables] == [parameter, "damping", "free_length"]
    for each in found.variables:
        group = next(group for group in found.members if group.name == each.groups[0])
        assert law_table.place_of(type(group.laws[0]), each.parameter) >= 0


def test_a_case_without_such_laws_is_left_as_it_is() -> None:
    case = read_case(CASE.replace("    VARIABLE\n", "").replace("^2/2", "^4/4"))
    assert with_springs(case) is case
