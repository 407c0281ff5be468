"""What a run says of a design that restrains less, and where it has no reason to say so."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.optimum import linkages
from mdstopo import optimize
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.session.advice import advise, is_held, without_slope
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
    return {name: SimpleNamespace(status=Status.OK, q=q, lam=np.zeros((2, 0))) for name in ("crash", "drop")}


def said(of: Case) -> str:
    return "\n".join(advise(of, np.array([0.5]), motions(0.1), motions(0.3)))


def test_a_design_that_restrains_less_and_leaves_material_is_told() -> None:
    assert "in load case crash the bodies" in said(case())
    assert "in load case drop" not in said(case())  # no objective looks at it
    assert "only 50.0% of the volume limit" in said(case())


def test_bodies_that_move_hardly_farther_than_before_are_not_told() -> None:
    """A twentieth more is what optima of the same restraint differ by."""
    told = [advise(case(), np.array([0.9]), motions(0.1), motions(reach)) for reach in (0.104, 0.106)]
    assert ["against each other" in "".join(each) for each in told] == [False, True]


@pytest.mark.parametrize("of", [case(more=LIMIT), case(response=SWAY)], ids=["bounded", "minimised"])
def test_nothing_is_said_of_a_load_case_in_which_a_displacement_is_held(of: Case) -> None:
    assert "in load case crash" not in said(of)
    assert "volume limit" not in said(of)


@pytest.mark.parametrize(
    "response",
    [
        "{acceleration: {body: torso}}",
        "{velocity: {body: torso}}",
        "{member_force: {group: belts}}",
        "{angle: {body: torso}}",
    ],
)
def test_nothing_is_said_of_a_soft_branch_where_no_energy_is_minimised(response: str) -> None:
    assert said(case(response=response)) == ""


def test_an_energy_that_is_maximised_has_no_soft_branch() -> None:
    text = CASE.replace("ENERGY", "energy").replace("load_case: crash}", "load_case: crash, sense: maximize}")
    assert said(read_case(text)) == ""


def test_a_motion_that_joints_and_motions_prescribe_has_no_soft_branch() -> None:
    driven = motions(0.1)
    for motion in driven.values():
        motion.lam = np.zeros((2, 6))  # as many rows as coordinates
    assert advise(case(), np.array([0.5]), driven, driven) == ()
    assert "volume limit" in "".join(advise(case(), np.array([0.5]), motions(0.1), motions(0.1)))


def test_the_energy_of_members_of_a_driven_four_bar_is_no_sign_of_a_soft_branch() -> None:
    document = linkages.four_bar(["D"], {})
    document["objectives"] = {"G": {"response": "energy", "over_time": "max"}}
    document["optimizer"] = {"max_iterations": 1}
    done = optimize(read_case(json.dumps(document)), initial=np.zeros(45))
    assert not [each for each in done.warnings if "volume limit" in each or "move" in each]


def test_a_displacement_that_is_bounded_from_below_or_maximised_holds_nothing() -> None:
    assert not is_held(case(more=LIMIT.replace("limit: 0.1", "at_least: 0.1")), "crash")
    whole = read_case(CASE.replace("ENERGY", SWAY).replace("load_case: crash}", "load_case: crash, sense: maximize}"))
    assert not is_held(whole, "crash")
    assert is_held(case(more=LIMIT), "crash")
    assert not is_held(case(more=LIMIT), "drop")


def found(slope: np.ndarray, value: float = 3.0, time: float = 0.25, **more: object) -> SimpleNamespace:
    """An evaluation with one objective."""
    peaks = {"G": (SimpleNamespace(time=time, value=value),)}
    return SimpleNamespace(objectives={"G": value}, gradients={"G": slope}, peaks=peaks, **more)


def test_an_objective_that_no_variable_changes_is_told_with_its_time() -> None:
    (told,) = without_slope(case(), found(np.zeros(1)))
    assert "no design variable changes G = 3 at t = 0.25 s" in told
    (told,) = without_slope(case(), found(np.zeros(1), time=np.nan))
    assert "changes G = 3," in told


@pytest.mark.parametrize(
    "what",
    [
        found(np.array([1e-9])),
        found(np.zeros(1), value=0.0),
        found(np.zeros(1), variable_gradients={"G": {"stiffness": np.array([2.0])}}),
    ],
    ids=["slope", "identically zero", "variable"],
)
def test_nothing_is_said_of_an_objective_that_something_changes_or_that_is_zero(what: SimpleNamespace) -> None:
    stated = "design: {variables: {stiffness: {group: belts, parameter: stiffness, lower: 100, upper: 300}}}"
    assert without_slope(case(more=stated), what) == ()


def test_slopes_of_rounding_are_none() -> None:
    (told,) = without_slope(case(), found(np.array([1e-15])))
    assert "no design variable changes G = 3" in told


PUSHED = """
format: 1
time: {end: 1}
bodies: {mass: {mass: 2, inertia: 1, position: [0, 1]}}
members:
  spring: {from: {body: ground, at: [0, 0]}, to: {body: mass, at: [0, 1]}, law: {type: spring, stiffness: 4}}
loads: [{body: mass, force: [0, 6]}]
objectives: {A: {response: {acceleration: {body: mass}}}}
design: {initial: 0.5}
optimizer: {max_iterations: 3}
constraints: [{volume: all, limit: 1}]
"""


def test_a_run_whose_peak_is_at_the_start_where_no_member_carries_says_so() -> None:
    warnings = optimize(read_case(PUSHED)).warnings
    assert any("no design variable changes A = 3 at t = 0 s" in each for each in warnings)
