"""What a run says of a design that restrains less, and where it has no reason to say so."""

from types import SimpleNamespace

import numpy as np
import pytest

from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.session.advice import advise, is_held
from mdstopo.status import Status

CASE = """
format: 1
time: {end: 1}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0]}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
members:
  belts: {from: {body: torso, at: [0, 0]}, to: {body: vehicle, at: [0, -1]}, law: {type: spring, stiffness: 225}}
load_cases: {crash: {}, drop: {}}
objectives:
  G: {response: ENERGY, over_time: max, load_case: crash}
constraints:
  - {volume: all, limit: 1}
"""
SWAY = "{displacement: {body: torso, relative_to: vehicle}}"
LIMIT = f"  - {{response: {SWAY}, over_time: max, load_case: crash, limit: 0.1}}\n"


def case(response: str = "energy", more: str = "") -> Case:
    return read_case(CASE.replace("ENERGY", response) + more)


def motions(reach: float) -> dict[str, SimpleNamespace]:
    """Both load cases, in which the torso moves so far."""
    q = np.zeros((2, 6))
    q[1, 0] = reach
    return {name: SimpleNamespace(status=Status.OK, q=q) for name in ("crash", "drop")}


def said(of: Case) -> str:
    return "\n".join(advise(of, np.array([0.5]), motions(0.1), motions(0.3)))


def test_a_design_that_restrains_less_and_leaves_material_is_told() -> None:
    assert "in load case crash the bodies" in said(case())
    assert "in load case drop" in said(case())
    assert "only 50.0% of the volume limit" in said(case())


@pytest.mark.parametrize("of", [case(more=LIMIT), case(response=SWAY)], ids=["bounded", "minimised"])
def test_nothing_is_said_of_a_load_case_in_which_a_displacement_is_held(of: Case) -> None:
    assert "in load case crash" not in said(of)
    assert "in load case drop" in said(of)
    assert "volume limit" not in said(of)


def test_a_displacement_that_is_bounded_from_below_or_maximised_holds_nothing() -> None:
    assert not is_held(case(more=LIMIT.replace("limit: 0.1", "at_least: 0.1")), "crash")
    whole = read_case(CASE.replace("ENERGY", SWAY).replace("load_case: crash}", "load_case: crash, sense: maximize}"))
    assert not is_held(whole, "crash")
    assert is_held(case(more=LIMIT), "crash")
    assert not is_held(case(more=LIMIT), "drop")
