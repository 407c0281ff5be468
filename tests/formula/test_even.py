"""Formulas of which few values tell all others, wherever no switch changes its side."""

from __future__ import annotations

import pytest

from mdstopo.formula.law_formulas import program

#: force and energy with damping, parameters -> whether they are
FOUND = {
    ("k*max(x - g, 0)", "kg"): True,
    ("if(x > g, k*(x - g)^1.5*(1 + c*xd), 0)", "kgc"): True,
    ("abs(xd)*xd*c + k*clip(x, -g, g)", "ckg"): True,
    ("k*x*sin(9*t) + b*sqrt(x - g)", "kbg"): True,
    ("k*(x^8 - x)/b", "kb"): True,
    ("k*l*x", "k"): True,
    # as sharp as a kink within a short way, and flat on both sides of it
    ("k*tanh(x/g)", "kg"): False,
    ("k*x/(1 + b*x^2)", "kb"): False,
    ("k*exp(-b*x*x)", "kb"): False,
    ("k*sin(b*x)", "kb"): False,
    ("k*x^9", "k"): False,
    ("k*x^b", "kb"): True,
    ("k*(x^2)^b", "kb"): False,
    # switches whose margins are not linear, or differ between members by their free length
    ("k*max(x*x - g, 0)", "kg"): False,
    ("k*max(x*xd - g, 0)", "kg"): False,
    ("k*max(l - g, 0)", "kg"): False,
    ("if(x > g*t^2, k*x, 0)", "kg"): True,
}


@pytest.mark.parametrize("law", FOUND)
def test_formulas_that_few_values_tell_are_found(law: tuple[str, str]) -> None:
    force, names = law
    assert program(force, None, None, tuple(names)).even == FOUND[law]


def test_the_energy_counts_as_the_force_does() -> None:
    assert program(None, "k*max(x, 0)^2.5", "c*xd", ("k", "c")).even
    assert not program(None, "k*log(1 + x*x)", "c*xd", ("k", "c")).even
    assert not program("k*x", "log(1 + x*x)", None, ("k",)).even
