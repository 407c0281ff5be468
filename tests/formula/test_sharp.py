"""Switches at which slopes of a law begin with a root."""

from __future__ import annotations

import pytest

from mdstopo.formula.law_formulas import program

#: force, parameters -> the switches, as bits
FOUND = {
    ("if(x > 0, k*x^n*(1 + d*xd), 0)", "knd"): 1,
    ("if(x < 0, -k*(-x)^1.5, 0)", "k"): 1,
    ("-k*max(0, -x - g)^2.5/m", "kgm"): 1,
    ("k*max(0, x)^n", "kn"): 1,
    ("if(x > g, k*((x - g)/h)^1.2, 0)", "kgh"): 1,
    ("k*sqrt(abs(x))", "k"): 1,
    # another switch than that of the power's base
    ("if(x > g, k*x^1.5, 0) + sign(xd)", "kg"): 0,
    ("step(t - b)*k*max(0, x)^1.5", "bk"): 2,
    ("if(x > g, k*(x - g)^2*(l/l0)^1.5, 0)", "kg"): 0,
    # smooth enough
    ("if(x > 0, k*x^2, 0) + if(xd > 0, xd, 0)", "k"): 0,
    ("k*max(0, x)^4.5", "k"): 0,
    ("exp(-x)*max(0, x)", ""): 0,
}


@pytest.mark.parametrize("law", FOUND)
def test_switches_at_which_a_fractional_power_begins_are_found(law: tuple[str, str]) -> None:
    force, names = law
    assert program(force, None, None, tuple(names)).sharp == FOUND[law]
