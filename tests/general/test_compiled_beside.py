"""What a second process compiles beside the first is what an evaluation then calls."""

from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.compiler.entry import Entry, types_of
from mdstopo.engine import Evaluator

CASE = """
format: 1
gravity: [0, -9.8]
time: {end: 0.1}
bodies: {rod: {mass: 1, inertia: 0.1, position: [0.5, 0]}}
joints:
  - {type: revolute, bodies: [ground, rod], at: [0, 0]}
members:
  spring: {from: {body: ground, at: [1, 1]}, to: {body: rod, at: [1, 0]}, law: {type: spring, stiffness: 50}}
objectives:
  tip: {response: {displacement: {body: rod, component: y}}, over_time: max_abs}
"""


#: a second objective: then all rows go through the steps in one sweep
SECOND = "  turn: {response: {displacement: {body: rod, component: x}}, over_time: max_abs}\n"
TOGETHER = "combine: {method: weighted_sum, weights: {tip: 1, turn: 1}}\n"
MEAN = ("max_abs", "mean")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (CASE, {"rows_with_gradients"}),
        (CASE.replace("max_abs", "final"), {"rows_with_gradients"}),
        (CASE.replace(*MEAN), {"integral_with_gradient"}),
        (CASE + SECOND + TOGETHER, {"rows_vjp", "peaks_of_steps"}),
        (CASE + SECOND.replace(*MEAN) + TOGETHER, {"rows_vjp", "peaks_of_steps", "integral_with_gradient"}),
    ],
    ids=["peak", "end", "mean", "peaks", "peak and mean"],
)
def test_it_is_what_an_evaluation_calls(monkeypatch: pytest.MonkeyPatch, text: str, names: set[str]) -> None:
    engine = Evaluator(read_case(text))
    looked_for = Entry._for
    asked: list[tuple[str, str | None]] = []

    def noted(entry: Entry, arguments: tuple[Any, ...]) -> Any:
        asked.append((entry.py_func.__name__, types_of(arguments)))
        return looked_for(entry, arguments) if evaluating else None

    monkeypatch.setattr(Entry, "_for", noted)
    evaluating = False
    engine.compile_responses()
    engine.compile_steps()
    compiled, asked[:] = set(asked), []
    assert {name for name, _ in compiled} == {"simulate", *names}
    evaluating = True
    assert np.all(np.isfinite(engine.evaluate(engine.case.start, gradient=True).gradients["tip"]))
    assert compiled <= set(asked)


def test_it_is_what_a_method_calls_that_carries_derivatives_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Evaluator(read_case(CASE + SECOND.replace(*MEAN) + TOGETHER))
    looked_for = Entry._for
    asked: set[tuple[str, str | None]] = set()
    monkeypatch.setattr(Entry, "_for", lambda entry, given: asked.add((entry.py_func.__name__, types_of(given))))
    engine.compile_method("adjoint")
    assert not asked
    engine.compile_method("direct")
    ((name, types),) = asked
    assert name == "push"

    def noted(entry: Entry, arguments: tuple[Any, ...]) -> Any:
        seen.add((entry.py_func.__name__, types_of(arguments)))
        return looked_for(entry, arguments)

    seen: set[tuple[str, str | None]] = set()
    monkeypatch.setattr(Entry, "_for", noted)
    found = engine.evaluate(engine.case.start, sensitivity="direct")
    assert np.all(np.isfinite(found.gradients["turn"]))
    assert (name, types) in seen


DAMPED = CASE.replace("stiffness: 50}", "stiffness: 50, damping: 2}")


@pytest.mark.parametrize(
    ("text", "simulates"),
    [
        (DAMPED, True),
        (CASE, False),
        (DAMPED + "solver: {integrator: runge_kutta}\n", False),
        (DAMPED + "solver: {integrator: generalized_alpha, step: 1e-3}\n", False),
    ],
    ids=["damped", "undamped", "stated", "fixed steps"],
)
def test_steps_are_compiled_for_a_choice_only_where_auto_simulates(
    text: str, simulates: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine = Evaluator(read_case(text))
    assert engine.may_simulate_to_choose == simulates
    asked = []

    def held_short(*_arguments: Any) -> str:
        asked.append(True)
        return ""

    monkeypatch.setattr("mdstopo.general.driver.stiffness.held_short", held_short)
    monkeypatch.setattr(Evaluator, "_made", lambda *_: None)
    assert engine.integrator
    assert bool(asked) == simulates
