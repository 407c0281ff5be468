"""What the engine cannot compute is refused by name, each at its place."""

from __future__ import annotations

from mdstopo.case.reader import read_case
from mdstopo.scene.refusals import refusals

from .scenes import EVERYTHING, SMALL, place


def test_what_the_engine_computes_is_not_refused() -> None:
    assert refusals(read_case(SMALL)) == []


def test_every_key_of_the_format_is_computed() -> None:
    assert refusals(read_case(EVERYTHING)) == []


def test_an_integrator_that_does_not_go_with_the_scene_is_named_at_its_place() -> None:
    text = SMALL + "joints:\n  - {type: revolute, bodies: [a, ground], at: [0, 0]}\nsolver: {integrator: gauss}\n"
    (refusal,) = refusals(read_case(text))
    assert refusal.path_key == "solver.integrator"
    assert "gauss does not compute joints; runge_kutta does" in refusal.message
    assert (refusal.line, refusal.column) == place(text, "integrator: gauss", 12)
