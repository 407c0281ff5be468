"""Sides of switches on which a law's formulas are 0."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdstopo.formula.formula_values import value_of
from mdstopo.formula.idle import Idle
from mdstopo.formula.law_formulas import FORCE, Program, program
from mdstopo.formula.smooth_modes import TooManySwitchesError
from tests.formula.random_formulas import formulas
from tests.tiers import examples


def idle(force: str | None, energy: str | None, *names: str, damping: str | None = None) -> tuple[Idle, ...]:
    """What is found of a law."""
    return program(force, energy, damping, names).idle


#: force, energy, parameters -> sides on which both are 0
FOUND: dict[tuple[str | None, str | None, str], tuple[Idle, ...]] = {
    ("if(x >= g, k*(x - g) + c*xd, 0)", "if(x >= g, k*(x - g)^2/2, 0)", "kcg"): (Idle(1, 0),),
    ("if(x < 0, 0, k*x)", "k*max(x, 0)^2/2", "k"): (Idle(1, 1),),
    ("-k*max(0, -x - g)^1.5/m", None, "kgm"): (Idle(1, 0),),
    (None, "k*max(0, x - g)^3/3", "kg"): (Idle(1, 0),),
    ("max(0, k*x + c*xd)", None, "kc"): (Idle(1, 0),),
    ("k*x*step(x)*step(t - b)", None, "kb"): (Idle(3, 1), Idle(1, 0)),
    ("if(x > 0, max(k*x + c*xd, 0), 0)", None, "kc"): (Idle(3, 3), Idle(2, 0)),
    # a power of 0 is 0 where its exponent is above 0
    ("if(x < 0, -k*(-x)^n, 0)", "k*max(-x, 0)^(n + 1)/(n + 1)", "kn"): (Idle(1, 0, 1, -1.0),),
    ("k*max(0, x)^(n - 2) + c*max(0, x)^n*xd", None, "knc"): (Idle(1, 0, 1, 2.0),),
    # something acts, is stored, or has no value
    ("clip(k*x, -f, f)", None, "kf"): (),
    ("if(x > 0, k*x, 0)", "k*x^2/2", "k"): (),
    ("max(0, x)^n + max(0, x)^m", None, "nm"): (),
    ("if(x > 0, k*x, 0) + max(0, log(x))", None, "k"): (),
    ("(if(x > 0, 1, 0) + if(x > 0, x, 0))/m", None, "m"): (),
}


@pytest.mark.parametrize("law", FOUND)
def test_sides_on_which_nothing_acts_are_found(law: tuple[str | None, str | None, str]) -> None:
    force, energy, names = law
    assert set(idle(force, energy, *names)) == set(FOUND[law])


def values_at(made: Program, mode: int, **values: float) -> list[float]:
    """Force, energy and their slopes, with the switches on the sides of a mode."""
    names: dict[str, Any] = {f"bit {place}": float(mode >> place & 1) for place in range(made.switches)}
    return [value_of(each, {**names, **values}) for each in made.groups[FORCE].values]


@settings(max_examples=examples(20, 60), deadline=None)
@given(
    text=formulas(depth=3), gate=st.sampled_from(("step(x - 1)*({})", "if(x < k, 0, {})", "max(0, {})")), data=st.data()
)
def test_where_a_law_is_idle_every_value_is_zero(text: str, gate: str, data: st.DataObject) -> None:
    try:
        made = program(gate.format(text), None, None, ("k",))
    except TooManySwitchesError:
        return
    for side in made.idle:
        free = data.draw(st.integers(0, 2**made.switches - 1)) & ~side.which
        p = data.draw(st.floats(-3.0, 3.0))
        if side.holds(side.sides | free, [p]):
            x = data.draw(st.floats(-3.0, 3.0))
            assert values_at(made, side.sides | free, **{"x": x, "p 0": p, "xd": 0.3, "t": 0.2, "l0": 1.0}) == [0.0] * 5


def test_the_search_ends_with_very_many_switches() -> None:
    text = " + ".join(f"max(0, x - {i})" for i in range(40))
    assert idle(text, None) == (Idle(2**40 - 1, 0),)
