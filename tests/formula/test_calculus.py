"""Derivatives of formulas against complex steps of a second evaluation, and what simplification leaves."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mdstopo.formula.calculus import derivative, simplified, substituted
from mdstopo.formula.formula_values import value_of
from mdstopo.formula.parser import parse
from mdstopo.formula.tree import name, number, parts, text_of
from tests.tiers import examples

from .random_formulas import evaluate, formulas

STEP = 1e-30
#: numbers at which random formulas have no kink, however they are put together
XS, KS = (-1.7341, -0.6123, 0.2937, 0.8713, 1.9127), (0.6377, 1.3291, 2.4173)


@given(formulas(), st.sampled_from(XS), st.sampled_from(KS), st.sampled_from("xk"))
@settings(max_examples=examples(60, 400), deadline=None, derandomize=True)
def test_derivatives_are_those_of_complex_steps(text: str, x: float, k: float, word: str) -> None:
    values = {"x": x, "k": k}
    root = parse(text).root
    slope = derivative(root, word)
    found = value_of(slope, values)
    assume(math.isfinite(value_of(root, values)) and math.isfinite(found) and abs(found) < 1e6)
    assume(all(math.isfinite(value_of(part, values)) for part in parts(root)))
    complex_values = {**values, word: complex(values[word], STEP)}
    try:
        stepped = evaluate(text, complex_values)
    except (ZeroDivisionError, OverflowError, ValueError):
        assume(False)
    wanted = complex(stepped).imag / STEP
    assume(math.isfinite(wanted))
    largest = max(abs(value_of(part, values)) for part in parts(root, slope))
    assert found == pytest.approx(wanted, rel=1e-10, abs=1e-12 * max(largest, 1.0))


@given(formulas(), st.sampled_from(XS), st.sampled_from(KS))
@settings(max_examples=examples(30, 200), deadline=None, derandomize=True)
def test_simplification_changes_no_value(text: str, x: float, k: float) -> None:
    values = {"x": x, "k": k}
    root = parse(text).root
    assume(all(math.isfinite(value_of(part, values)) for part in parts(root)))
    largest = max(abs(value_of(part, values)) for part in parts(root))
    assert value_of(simplified(root), values) == pytest.approx(
        value_of(root, values), rel=1e-9, abs=1e-12 * max(largest, 1.0)
    )


@pytest.mark.parametrize(
    ("text", "word", "slope"),
    [
        ("k*x^2/2 + b*x^4/4", "k", "x ^ 2 / 2"),
        ("k*x + c*v + b*x^3", "x", "k + b * (3 * x ^ 2)"),
        ("k*x + c*v + b*x^3", "v", "c"),
        ("k*x + c*v + b*x^3", "t", "0"),
        ("exp(2*x)", "x", "2 * exp(2 * x)"),
        ("k*x*(1 + c*v)", "v", "k * x * c"),
        ("abs(x)", "x", "sign(x)"),
        ("if(x > 0, k*x, 0)", "x", "if(x > 0, k, 0)"),
        ("0*x + 1*x - 0 + x^1 - x/1", "x", "1"),
    ],
)
def test_a_derivative_is_short(text: str, word: str, slope: str) -> None:
    assert text_of(derivative(parse(text).root, word)) == slope


def test_slopes_by_an_exponent_have_their_limit_at_zero() -> None:
    root = parse("k*x^n").root
    assert value_of(derivative(root, "n"), {"k": 3.0, "x": 0.0, "n": 1.5}) == 0.0
    assert value_of(derivative(root, "n"), {"k": 3.0, "x": 2.0, "n": 1.5}) == pytest.approx(
        3.0 * 2.0**1.5 * math.log(2.0)
    )


def test_parts_are_replaced() -> None:
    root = parse("if(x > 0, x, -x) + k").root
    condition = root.operands[0].operands[0]
    assert substituted(root, {condition: number(1.0)}) is parse("x + k").root
    assert substituted(root, {name("k"): number(0.0), condition: number(0.0)}) is parse("-x").root


def test_derivatives_of_derivatives_stay_small_for_common_parts_are_shared() -> None:
    root = parse("exp(sin(x)*cos(x))^3 * atan(x*exp(x))").root
    for most in (70, 220, 700):
        root = derivative(root, "x")
        assert len(list(parts(root))) < most
