"""The quantities that `check` and `gradient` derive."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from mdstopo.case.reader import read_case
from mdstopo.cli.check import _say_frequencies
from mdstopo.cli.check_numbers import depths, frequencies, material, totals
from mdstopo.cli.gradient import _note_other_peaks
from mdstopo.cli.gradient_numbers import (
    DifferenceSteps,
    changes_peak,
    chosen_members,
    difference_steps,
    differences,
    disagreement,
)
from mdstopo.cli.output import Output
from mdstopo.evaluation import Peak
from mdstopo.scene.vibration_modes import Modes
from mdstopo.status import Status

Floats = NDArray[np.float64]

CASE = """
format: 1
gravity: [0, -10]
time: {start: 1, end: 3}
bodies:
  a: {mass: 1, inertia: 1, position: [0, 0]}
  b: {mass: 3, inertia: 1, position: [4, 0]}
members:
  m: {from: {body: a, at: [0, 1]}, to: {body: b, at: [4, 1]}, law: {type: spring, stiffness: 5}, cost: 2}
loads:
  - {body: a, force: {table: [[0, 0, 0], [2, 8, 0]]}}
objectives:
  G: {response: energy}
constraints:
  - {volume: all, fraction: 0.5}
"""


def test_totals_are_those_of_the_bodies_members_and_loads() -> None:
    case = read_case(CASE.replace("force: {table: [[0, 0, 0], [2, 8, 0]]}", "force: [4, 0]"))
    found = {name: (value, unit) for name, value, unit in totals(case)}
    assert found["mass"] == (4.0, "kg")
    assert found["centre of mass, x"] == (3.0, "m")
    assert found["duration"] == (2.0, "s")
    assert found["stiffness of all springs at alpha = 1"] == (5.0, "N/m")
    assert found["volume at alpha = 1"] == (2.0, "")
    assert found["external force at the start, x"] == (4.0, "N")
    assert found["external force at the start, y"] == (-40.0, "N")


def test_loads_that_change_are_taken_at_the_start() -> None:
    case = read_case(CASE.replace("{table: [[0, 0, 0], [2, 8, 0]]}", "{table: [[0, 0, 0], [2, 8, 0]]}"))
    found = {name: value for name, value, _ in totals(case)}
    assert found["external force at the start, x"] == pytest.approx(4.0)


def test_material_rows_show_what_the_bounds_allow() -> None:
    assert material(read_case(CASE)) == [["m", "at most", "1", "0.2", "0.002", "2"]]


class Vibrating:
    """Small motion with these squares of angular frequencies at alpha = 0.1, which alpha raises in proportion."""

    def __init__(self, squares: list[float], held: float = 0.0) -> None:
        self.squares, self.held = np.array(squares), held

    def start_modes(self, alpha: Floats, load_case: str) -> Modes:
        squares = self.squares * alpha[0] / 0.1 - self.held
        return Modes(np.diag(squares), np.eye(len(squares)), scale=0.0)


def test_the_criterion_takes_the_lowest_elastic_mode() -> None:
    (entry,) = frequencies(read_case(CASE), Vibrating([0.0, 1e-18, 900.0, 25.0]))
    assert entry["initial"] == [5.0, 30.0]
    assert entry["criterion"] == pytest.approx(5.0 * 5.0 * np.sqrt(0.001 / 0.1) * 4.0)
    assert entry["growing"] == {"initial": [], "lower": []}


def test_cases_without_elastic_modes_have_no_criterion() -> None:
    (entry,) = frequencies(read_case(CASE), Vibrating([0.0] * 6))
    assert entry["initial"] == []
    assert entry["criterion"] is None


def test_modes_that_grow_at_the_lower_bounds_stand_in_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    case = read_case(CASE)
    (entry,) = frequencies(case, Vibrating([9e6, 25.0], held=9.0))
    assert entry["growing"]["initial"] == []
    assert entry["growing"]["lower"] == pytest.approx([np.sqrt(9.0 - 0.25)])
    _say_frequencies(Output(), case, [entry])
    told = capsys.readouterr().out.splitlines()
    assert told[1].split()[-2:] == ["growing,", "1/s"]
    assert [line.split()[-1] for line in told[2:4]] == ["none", "2.958"]


def smooth(alpha: Floats) -> dict[str, float]:
    weights = np.arange(1.0, len(alpha) + 1.0)
    return {"G": float(np.sin(weights * alpha).sum()), "H": float((weights / (0.5 + alpha)).sum())}


def test_differences_are_right_to_many_digits_also_near_and_at_zero() -> None:
    alpha = np.array([0.1, 1e-3, 0.0, 1.0, 0.4])
    members = np.arange(5)
    weights = np.arange(1.0, 6.0)
    found = differences(smooth, alpha, members)
    assert np.abs(found["G"] - weights * np.cos(weights * alpha)).max() < 1e-9
    assert np.abs(found["H"] + weights / (0.5 + alpha) ** 2).max() < 1e-7


def test_differences_never_ask_for_negative_alpha() -> None:
    asked: list[float] = []

    def watched(alpha: Floats) -> dict[str, float]:
        asked.append(float(alpha.min()))
        return smooth(alpha)

    differences(watched, np.array([1e-6, 0.0, 1.0]), np.arange(3))
    assert min(asked) >= 0.0


def test_members_are_chosen_reproducibly_without_repeats() -> None:
    chosen = chosen_members(1020, 10, seed=0)
    assert len(set(chosen.tolist())) == 10
    assert chosen.tolist() == chosen_members(1020, 10, seed=0).tolist() == sorted(chosen.tolist())
    assert chosen_members(3, 10, seed=0).tolist() == [0, 1, 2]


def test_disagreement_is_relative_to_the_largest_entry() -> None:
    assert disagreement(np.array([1.0, 10.1]), np.array([1.0, 10.0])) == pytest.approx(0.01)
    assert disagreement(np.zeros(2), np.zeros(2)) == 0.0


def test_the_repository_cases_can_be_summed_up() -> None:
    from mdstopo.case.reader import load_case

    for path in sorted((Path(__file__).parents[2] / "cases").glob("fig*.yaml")):
        assert {name: value for name, value, _ in totals(load_case(path))}["mass"] == 2060.0, path.name


def test_points_behind_an_edge_at_the_start_are_told():
    case = read_case("""
format: 1
time: {end: 1}
bodies: {box: {mass: 1, inertia: 1, position: [0, 0.4], angle: 1.5}}
points: {corners: {body: box, grid: {list: [[0.3, -0.1], [-0.3, 0.9], [5, -1]]}}}
contacts:
  - {points: corners, on: {body: ground, from: [-1, 0], to: [1, 0]}, stiffness: 1000}
  - {points: corners, on: {body: ground, from: [1, 0.2], to: [-1, 0.2]}, stiffness: 1000}
""")
    floor, ceiling = depths(case)
    assert floor == pytest.approx([0.1, -0.9, -np.inf])
    assert ceiling == pytest.approx([-0.3, 0.7, -np.inf])


class Listener:
    """Takes down what is said."""

    def __init__(self) -> None:
        self.said: list[str] = []
        self.tables: list[list[list[str]]] = []

    def say(self, text: str = "") -> None:
        self.said.append(text)

    def table(self, rows: list[list[str]]) -> None:
        self.tables.append(rows)


def test_load_cases_with_the_same_frequencies_and_duration_are_said_once() -> None:
    def entry(name: str, duration: float, initial: float) -> dict[str, Any]:
        still: dict[str, list[float]] = {"initial": [], "lower": []}
        both = {"initial": [initial], "lower": [1.0], "growing": still}
        return {"load_case": name, "duration": duration, "criterion": None, **both}

    heard = Listener()
    found = [entry("front", 1.0, 2.0), entry("side", 1.0, 2.0), entry("stiff", 1.0, 3.0), entry("long", 2.0, 2.0)]
    _say_frequencies(cast(Output, heard), read_case(CASE), found)
    assert [text.removeprefix("natural frequencies at the start, ") for text in heard.said] == [
        "load cases front, side, times the duration 1 s",
        "load case stiff, times the duration 1 s",
        "load case long, times the duration 2 s",
    ]
    assert [table[1] for table in heard.tables] == [["initial", "2", "2"], ["initial", "3", "3"], ["initial", "2", "4"]]


def peak(value, *gradient):
    return Peak(0.1, value, np.array(gradient))


def test_a_step_of_differences_that_makes_another_peak_decisive_is_known():
    steps = DifferenceSteps(np.array([1]), np.array([1e-3]), np.array([True]))
    first = peak(2.0, 3.0, -1.0)
    assert changes_peak([first, peak(2.0 - 1e-4, 3.0, -2.0)], steps)
    assert not changes_peak([first, peak(2.0 - 2e-3, 3.0, -2.0)], steps)
    assert not changes_peak([first, peak(2.0 - 1e-4, 30.0, -1.0)], steps)  # by a member that is not taken
    assert not changes_peak([first], steps)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["largest", "smallest"])
def test_a_step_to_one_side_is_judged_by_its_side(sign):
    steps = DifferenceSteps(np.array([0]), np.array([1e-3]), np.array([False]))
    first = peak(sign * 2.0, sign * 3.0)
    assert not changes_peak([first, peak(sign * (2.0 - 1e-4), sign * -9.0)], steps)
    assert changes_peak([first, peak(sign * (2.0 - 1e-4), sign * 9.0)], steps)


def test_gradient_tells_where_differences_are_no_derivative():
    """The first method's message has it, and no other; nothing is asked for where differences agree."""
    peaks = {"G": (peak(2.0, 3.0), peak(2.0, 1.0)), "H": (peak(2.0, 3.0),)}
    asked = []

    def evaluate(alpha, sensitivity, rows):
        asked.append(sensitivity)
        return SimpleNamespace(status=Status.OK, peaks=peaks)

    steps = DifferenceSteps(np.array([0]), np.array([1e-3]), np.array([True]))
    for off, told in ((1e-3, True), (1e-9, False)):
        results = {m: {"differences": {"G": off, "H": off}, "message": ""} for m in ("adjoint", "direct")}
        _note_other_peaks(cast(Any, SimpleNamespace(evaluate=evaluate)), np.array([0.5]), steps, results)
        assert results["adjoint"]["message"].startswith("of G another peak") is told
        assert results["direct"]["message"] == ""
    assert asked == ["adjoint"]


def test_the_steps_of_differences_are_those_of_the_design_and_the_bounds():
    text = CASE.replace(
        "objectives:", "design: {variables: {k: {group: m, parameter: stiffness, lower: 1, upper: 21}}}\nobjectives:"
    )
    case = read_case(text)
    steps = difference_steps(case, np.array([0.0, 5.0]), np.array([0]), np.array([0]))
    assert steps.places.tolist() == [0, 1]
    assert steps.both.tolist() == [False, True]
    assert steps.longest == pytest.approx([2e-3, 2e-3 * 20.0])
