"""The grammar of formulas: what is read, what it comes to, and where mistakes are."""

from __future__ import annotations

import math
import pickle

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mdstopo.formula.formula_error import FormulaError
from mdstopo.formula.formula_values import finite_value, value_of
from mdstopo.formula.parser import DEEPEST_NESTING, MOST_CHARACTERS, MOST_PARTS, parse
from mdstopo.formula.tree import FUNCTIONS, name, number, operation, parts, text_of
from tests.tiers import examples

from .random_formulas import evaluate, formulas

NAMES = {"x": 0.7, "k": 3.0, "long_name": -2.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1 + 2 * 3", 7.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("(2^3)^2", 64.0),
        ("10 - 4 - 3", 3.0),
        ("48 / 4 / 3", 4.0),
        ("--3", 3.0),
        ("+k * -x", -2.1),
        ("2*-3", -6.0),
        (".5e1 + 1.", 6.0),
        ("1e-3*k", 3e-3),
        ("pi", math.pi),
        ("if(x < k, 1, 2)", 1.0),
        ("if(x >= k, 1, if(k <= 3, 4, 5))", 4.0),
        ("if(x > 0, x, 1 / 0)", 0.7),
        ("min(k, x, 2) + max(1, k)", 3.7),
        ("clip(k, 0, 2) + clip(-1, 0, 2) + clip(x, 0, 2)", 2.7),
        ("sign(-3) + sign(0) + step(0) + step(-1e-300)", 1.0),
        ("abs(long_name) ^ 2", 4.0),
        ("atan2(1, -1)", 0.75 * math.pi),
        ("sqrt(2) * sqrt(2)", 2.0),
        ("log(exp(2))", 2.0),
        ("sin(x)^2 + cos(x)^2 + cosh(x)^2 - sinh(x)^2", 2.0),
        ("tan(atan(3)) + asin(0.5) + acos(0.5) + tanh(0)", 3.0 + 0.5 * math.pi),
    ],
)
def test_a_formula_has_the_value_that_it_has_on_paper(text: str, value: float) -> None:
    assert finite_value(parse(text, NAMES), NAMES) == pytest.approx(value, rel=1e-15)


@given(formulas(), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@settings(max_examples=examples(30, 300), deadline=None, derandomize=True)
def test_values_are_those_of_a_second_evaluation(text: str, x: float, k: float) -> None:
    formula = parse(text, ("x", "k"))
    found = value_of(formula.root, {"x": x, "k": k})
    # Python raises where a part has no value
    assume(all(math.isfinite(value_of(part, {"x": x, "k": k})) for part in parts(formula.root)))
    wanted = evaluate(text, {"x": x, "k": k})
    assert found == pytest.approx(wanted, rel=1e-14, abs=1e-300)


@given(formulas())
@settings(max_examples=examples(30, 200), deadline=None, derandomize=True)
def test_an_expression_is_written_so_that_it_is_read_again(text: str) -> None:
    root = parse(text).root
    assert parse(text_of(root)).root is root
    assert pickle.loads(pickle.dumps(root)) is root


def test_equal_parts_are_one_object_and_cannot_be_changed() -> None:
    root = parse("(x + k) * (x + k)").root
    assert root.operands[0] is root.operands[1]
    assert root.operands[0] is parse("x+k").root
    assert number(0.0) is not number(-0.0)
    with pytest.raises(AttributeError, match="cannot be changed"):
        root.value = 1.0
    with pytest.raises(AttributeError, match="cannot be deleted"):
        del root.value
    with pytest.raises(ValueError, match="if of 2 operands"):
        operation("if", name("x"), name("x"))


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("", 1, "found nothing"),
        ("   ", 1, "found nothing"),
        ("1 +", 4, "found the end, allowed is a number, a name, a function or ("),
        ("1 2", 3, "found '2', allowed is an operator or the end"),
        ("2x", 2, "write 2*x"),
        ("1.2.3", 4, "right after a number"),
        ("0x10", 2, "right after a number"),
        ("1_000", 2, "right after a number"),
        ("1e999", 1, "too large"),
        ("x ** 2", 3, "a power is written ^"),
        ("if(x == 1, 2, 3)", 6, "compare with"),
        ("if(x, 2, 3)", 5, "a comparison"),
        ("if(x < 1, 2)", 1, "if has 3 values, found 2"),
        ("if(x < 1, 2, 3, 4)", 1, "if has 3 values, found 4"),
        ("x < 1", 3, "comparisons stand in the first value of `if`"),
        ("if(0 < x < 1, 1, 2)", 10, "comparisons stand"),
        ("min(x)", 1, "min has at least 2 values, found 1"),
        ("sin(x, k)", 1, "sin has 1 values, found 2"),
        ("sin()", 5, "found ')'"),
        ("sin", 1, "is a function and is written sin(...)"),
        ("sinn(x)", 1, "did you mean 'sin'?"),
        ("kk + x", 1, "did you mean 'k'?"),
        ("long_nam", 1, "did you mean 'long_name'?"),
        ("zzz", 1, "names are k, long_name, x"),
        ("k(3)", 1, "write k*(...) for a product"),
        ("pi(3)", 1, "is no function"),
        ("(x", 3, "for the bracket at column 1"),
        ("x)", 2, "found ')'"),
        ("(x]", 3, "found ']'"),
        ("x.real", 2, "found '.', which no expression has"),
        ("x['a']", 2, "found '['"),
        ("'a'", 1, "which no expression has"),
        ("x := 1", 3, "found ':'"),
        ("x @ k", 3, "found '@'"),
        ("x, k", 2, "found ','"),
        ("x\N{MINUS SIGN}1", 2, "found '\\u2212'"),
        ("\N{GREEK SMALL LETTER ALPHA}", 1, "found '\\u03b1'"),
        ("x if x else k", 3, "found 'if'"),
        ("lambda: 0", 7, "found ':'"),
        ("x && k", 3, "write one `if` inside another"),
        ("and", 1, "there is no name 'and'"),
    ],
)
def test_a_mistake_is_told_with_its_column(text: str, column: int, words: str) -> None:
    with pytest.raises(FormulaError) as caught:
        parse(text, NAMES)
    assert words in caught.value.message
    assert caught.value.column == column
    assert str(caught.value).endswith(f"(column {column} of the expression)")


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("1 / (x - x)", 3, "1 / (x - x) divides by zero (with 1, 0)"),
        ("2 + sqrt(-k)", 5, "sqrt(-k) has no value (with -3)"),
        ("log(0)", 1, "log(0) is not finite"),
        ("9^9^9", 2, "9 ^ (9 ^ 9) is not finite"),
        ("exp(1e6)", 1, "is not finite"),
        ("if(1/0 > 0, 1, 2) + exp(800)", 21, "exp(800) is not finite"),
        ("if(x > 9, 1, asin(2))", 14, "asin(2) has no value"),
        ("(0 - 8)^(1/3)", 8, "has no value"),
        ("1e308 * 10", 7, "is not finite"),
    ],
)
def test_a_value_that_is_not_finite_is_told_by_what_makes_it(text: str, column: int, words: str) -> None:
    with pytest.raises(FormulaError) as caught:
        finite_value(parse(text, NAMES), NAMES)
    assert words in caught.value.message
    assert caught.value.column == column


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1" * (MOST_CHARACTERS + 1), f"allowed are {MOST_CHARACTERS:,}"),
        ("(" * 100 + "1" + ")" * 100, f"deeper than {DEEPEST_NESTING}"),
        ("-" * 100 + "1", f"deeper than {DEEPEST_NESTING}"),
        ("2^" * 100 + "2", f"deeper than {DEEPEST_NESTING}"),
        ("sin(" * 100 + "1" + ")" * 100, f"deeper than {DEEPEST_NESTING}"),
        ("1+" * 2000 + "1", f"more than {MOST_PARTS:,}"),
    ],
)
def test_what_would_take_long_or_much_memory_is_refused(text: str, words: str) -> None:
    with pytest.raises(FormulaError, match=words):
        parse(text)


def test_the_largest_formula_is_computed() -> None:
    text = "+".join(["x"] * (MOST_PARTS // 2))
    assert value_of(parse(text).root, {"x": 2.0}) == 2.0 * (MOST_PARTS // 2)


@given(st.text(max_size=60) | st.text(alphabet="xk019.e+-*/^()<>=, if\t" + "".join(FUNCTIONS), max_size=40))
@settings(max_examples=examples(40, 500), deadline=None, derandomize=True)
def test_any_text_is_a_formula_or_a_located_mistake(text: str) -> None:
    columns = [1]
    try:
        formula = parse(text, NAMES)
        finite_value(formula, NAMES)
    except FormulaError as error:
        columns.append(error.column)
    assert 1 <= columns[-1] <= len(text) + 1
