"""An integral that is next to nothing makes evaluations slow: which, and what to do, is said."""

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.session import near_zero as near_zero_module
from mdstopo.session.near_zero import ADDED, SQUARED, NearZeroNotice, near_zero

#: a lamp that hangs 1e-11 m beside the vertical below the hook of a hull that goes up and down; what it sways by is
#: hardly more than rounding
LAMP = """
format: 1
time: {end: 4}
gravity: [0, -9.81]
bodies:
  hull: {mass: 500, inertia: 300, position: [0, 0]}
  lamp: {mass: 2, inertia: 0.05, position: [1.0e-11, 1]}
joints:
  - {name: hook, type: revolute, bodies: [hull, lamp], at: [0, 1.5]}
motions:
  - {body: hull, x: {velocity: 0}, y: {position: {formula: "0.2*(1-cos(9*t))"}}, angle: {velocity: 0}}
members:
  ties: {from: {body: hull, at: [0.5, 1]}, to: {body: lamp, at: [0, 1]}, law: {type: spring, stiffness: 400}}
objectives:
  sway: {response: RESPONSE, over_time: mean}
constraints:
  - {volume: all, limit: 1}
solver: {tolerance: 1e-6}
"""
SWAY = "{displacement: {body: lamp, relative_to: hull}}"


def told(response: str, over_time: str = "mean") -> tuple[str, int]:
    case = read_case(LAMP.replace("RESPONSE", response).replace("over_time: mean", f"over_time: {over_time}"))
    engine = Evaluator(case, in_background=False)
    found = engine.evaluate(case.start, gradient=False)
    return near_zero(case, engine), found.work["steps"]


def test_an_integral_next_to_nothing_is_named_with_what_it_costs_and_what_helps() -> None:
    sentence, steps = told(SWAY)
    assert sentence.startswith("objective sway (mean displacement of lamp relative to hull) is ")
    assert f"takes {steps:,} steps where the motion takes " in sentence
    assert "add that to the response by an expression" in sentence


@pytest.mark.parametrize(("over_time", "formula"), [("mean", ADDED), ("rms", SQUARED)])
def test_what_is_advised_helps(over_time: str, formula: str) -> None:
    advice, slow = told(SWAY, over_time)
    assert f"(formula: {formula})" in advice
    sentence, fast = told(f"{{expression: {{formula: {formula}, unit: m, of: {{x: {SWAY}}}}}}}", over_time)
    assert sentence == ""
    assert fast < 0.1 * slow


@pytest.mark.parametrize("over_time", ["max", "final"])
def test_what_is_no_integral_is_not_told(over_time: str) -> None:
    case = read_case(LAMP.replace("RESPONSE", SWAY).replace("over_time: mean", f"over_time: {over_time}"))
    engine = Evaluator(case, in_background=False)
    engine.evaluate(np.array([0.1]), gradient=False)
    assert near_zero(case, engine) == ""


def test_a_run_says_so_once_as_soon_as_it_is_so(monkeypatch: pytest.MonkeyPatch) -> None:
    found = iter(["", "slow", "slow"])
    monkeypatch.setattr(near_zero_module, "near_zero", lambda case, engine: next(found))
    said: list[str] = []
    notice = NearZeroNotice(read_case(LAMP.replace("RESPONSE", SWAY)), None, said.append)
    notice.look()
    assert said == []
    for _ in range(3):
        notice.look()
    assert said == ["warning: slow"]
