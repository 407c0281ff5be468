"""What the engine cannot compute is refused by name, each at its place."""

from __future__ import annotations

from mdstopo.case.reader import read_case
from mdstopo.scene.refusals import refusals

from .scenes import EVERYTHING, SMALL, changed, place


def test_what_the_engine_computes_is_not_refused() -> None:
    assert refusals(read_case(SMALL), optimizing=True) == []


def test_only_an_optimisation_of_several_objectives_is_not_computed() -> None:
    case = read_case(EVERYTHING)
    assert refusals(case) == []
    assert [m.path_key for m in refusals(case, optimizing=True)] == ["combine"]


def test_an_integrator_that_does_not_go_with_the_scene_is_named_at_its_place() -> None:
    text = SMALL + "joints:\n  - {type: revolute, bodies: [a, ground], at: [0, 0]}\nsolver: {integrator: gauss}\n"
    (refusal,) = refusals(read_case(text))
    assert refusal.path_key == "solver.integrator"
    assert "gauss does not compute joints; runge_kutta does" in refusal.message
    assert (refusal.line, refusal.column) == place(text, "integrator: gauss", 12)


def test_several_objectives_are_refused_only_where_one_is_needed() -> None:
    two = "  G: {response: energy}\n  H: {response: energy, over_time: mean}\ncombine: {weights: {G: 1, H: 1}}"
    case = read_case(changed(SMALL, ("  G: {response: energy}", two)))
    assert refusals(case) == []
    assert [m.path_key for m in refusals(case, optimizing=True)] == ["combine"]
