"""Products whose factors LLVM may order as it likes, which it does otherwise in some processes."""

import ast
from pathlib import Path

import pytest

from mdstopo.compiler.jit import inline, member_kernel, vector_entry
from tests.sources import functions_of, tree

ROOT = Path(__file__).resolve().parents[2]
#: what allows LLVM to order sums and products
FREE = {mark.__name__ for mark in (member_kernel, vector_entry, inline)}
#: how often a factor stands in a product that was seen to be ordered in two ways
OFTEN = 3


def factors(product: ast.expr) -> list[str]:
    """The factors of a product, powers written out, and what it is divided by."""
    if isinstance(product, ast.BinOp):
        left, right = product.left, product.right
        if isinstance(product.op, ast.Mult):
            return factors(left) + factors(right)
        if isinstance(product.op, ast.Div):
            return [*factors(left), f"1/{ast.unparse(right)}"]
        if isinstance(product.op, ast.Pow) and isinstance(right, ast.Constant) and isinstance(right.value, int):
            return factors(left) * right.value
    return factors(product.operand) if isinstance(product, ast.UnaryOp) else [ast.unparse(product)]


def free_powers(module: ast.Module) -> list[str]:
    """Products of a module with a factor that stands there `OFTEN`, beside another one, where LLVM orders them."""
    return [
        ast.unparse(each)
        for function in functions_of(module)
        if any(isinstance(mark, ast.Name) and mark.id in FREE for mark in function.decorator_list)
        for each in ast.walk(function)
        if isinstance(each, ast.BinOp)
        for found in [factors(each)]
        if max(map(found.count, found)) >= OFTEN and len(set(found)) > 1
    ]


def test_no_product_of_powers_is_one_that_llvm_may_order() -> None:
    """The aim of an interior point was one: a run took 42 or 83 evaluations by which process had compiled it."""
    places = sorted((ROOT / "mdstopo").rglob("*.py"))
    found = [(path.name, each) for path in places for each in free_powers(tree(path))]
    assert len(places) > 300
    assert found == []


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("a * b ** 3", ["a * b ** 3"]),
        ("-b * (b * (a * b))", ["-b * (b * (a * b))"]),
        ("a / c * min(1.0, b) ** 3", ["a / c * min(1.0, b) ** 3"]),
        ("a * b ** 2 + b ** 3", []),
        ("a * b * c * d", []),
    ],
)
def test_such_a_product_is_found(line: str, found: list[str]) -> None:
    for mark in FREE:
        assert free_powers(ast.parse(f"@{mark}\ndef f(a, b, c, d):\n    return {line}\n")) == found
    assert free_powers(ast.parse(f"@kernel\ndef f(a, b, c, d):\n    return {line}\n")) == []
