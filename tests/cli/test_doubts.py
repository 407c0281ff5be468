"""What `check`, runs and `finalize` doubt: what nothing holds, odd scales, steps that are too long, worse designs."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mdstopo.case.reader import load_case, read_case
from mdstopo.cli.check_cost import in_words as cost_in_words
from mdstopo.cli.check_scene import (
    in_words,
    left_behind,
    long_step,
    odd_scales,
    restraint,
    unlike_partners,
    unrestrained,
)
from mdstopo.cli.front_display import line
from mdstopo.cli.group import run_group
from mdstopo.cli.progress import Rate
from mdstopo.finalize.finalize_design import worse_than_promised
from mdstopo.front.run_front import Ask, _FrontRun
from mdstopo.plan.solve_task import failed
from mdstopo.session.coarse_steps import coarse_steps
from mdstopo.starts.callbacks import ignore, never
from mdstopo.status import Status
from tests.front.support import CASE as FRONT

ROOT = Path(__file__).resolve().parents[2]
CRATE = """\
format: 1
gravity: [0, {gravity}]
time: {{end: 0.1}}
bodies:
  crate: {{mass: 60, inertia: {inertia}, position: [0, {height}]}}
  deck: {{mass: 2000, inertia: 6000, position: [0, 0]}}
points:
  low: {{body: crate, grid: {{list: [[-0.2, {height}], [0.2, {height}]]}}}}
  bed: {{body: deck, grid: {{list: [[-0.5, 0], [0.5, 0]]}}}}
members:
  straps: {{from: low, to: bed, law: {{type: spring, stiffness: 4000}}}}
objectives:
  G: {{response: energy}}
{more}
"""
PLAIN = {"gravity": "-9.8", "inertia": "6", "height": "0.6", "more": ""}


def case_of(**changes: str) -> Any:
    return read_case(CRATE.format(**{**PLAIN, **changes}))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"height": "60"}, ["60 m", "0.4 m", "millimetres"]),
        ({"inertia": "6.0e+6"}, ["crate", "kg m^2"]),
        ({"gravity": "-9810"}, ["mm/s^2"]),
    ],
)
def test_lengths_inertias_and_gravity_in_other_units_are_asked_about(changes: dict[str, str], words: list[str]) -> None:
    assert odd_scales(case_of()) == []
    told = " ".join(odd_scales(case_of(**changes)))
    for word in words:
        assert word in told


def test_the_cases_of_the_project_have_no_odd_scales_and_leave_no_body_behind() -> None:
    for path in sorted((ROOT / "cases").glob("*.yaml")):
        assert odd_scales(load_case(path)) == [], path
        assert left_behind(load_case(path)) == [], path


SEATED = """\
format: 1
gravity: [0, -9.8]
time: {end: 1}
bodies:
  car: {mass: 1500, inertia: 900, position: [0, 0], velocity: [CAR, 0]}
  driver: {mass: 80, inertia: 4, position: [0, HEIGHT], velocity: [DRIVER, 0]}
points:
  hips: {body: driver, grid: {list: [[-0.2, HEIGHT], [0.2, HEIGHT]]}}
  cushion: {body: car, grid: {list: [[-0.4, 0], [0.4, 0]]}}
contacts:
  - {name: seat, points: hips, on: {body: car, from: [-0.4, 0.0], to: [0.4, 0.0]}, stiffness: 2.0e4}
members:
  belts: {from: hips, to: cushion, law: {type: spring, stiffness: 4000}}
objectives:
  G: {response: energy}
"""


@pytest.mark.parametrize(
    ("car", "driver", "height", "asked"),
    [(20, 0, 0.001, True), (20, 20, 0.001, False), (20, 0, 0.5, False), (0.1, 0, 0.001, False), (0, 0, 0.001, False)],
)
def test_a_body_that_stands_on_one_that_drives_away_is_asked_about(
    car: float, driver: float, height: float, asked: bool
) -> None:
    text = SEATED.replace("CAR", str(car)).replace("DRIVER", str(driver)).replace("HEIGHT", str(height))
    told = left_behind(read_case(text))
    assert len(told) == asked
    for sentence in told:
        assert "body driver stands" in sentence
        assert "contact seat" in sentence
        assert "20 m/s" in sentence


MIRRORED = """\
format: 1
time: {end: 1}
bodies:
  mast: {mass: 10, inertia: 1, position: [0, 1]}
points:
  right: {body: mast, grid: {list: [[0.1, 0.4], [0.1, 0.9], [0.1, 1.7]]}}
  left: {body: mast, grid: {list: LEFT}}
  east: {body: ground, grid: {list: [[1, 0], [1, 0], [1, 0]]}}
  west: {body: ground, grid: {list: [[-1, 0], [-1, 0], [-1, 0]]}}
members:
  a: {from: right, to: east, connect: pairs, law: {type: spring, stiffness: 10}}
  b: {from: left, to: west, connect: pairs, law: {type: spring, stiffness: 10}}
design: {mirrored: [[a, b]]}
objectives:
  G: {response: energy}
"""


@pytest.mark.parametrize(
    ("left", "asked"),
    [
        ("[[-0.1, 0.4], [-0.1, 0.9], [-0.1, 1.7]]", ""),
        ("[[-0.1, 1.7], [-0.1, 0.9], [-0.1, 0.4]]", "2 of 3 mirrored members of a and b differ in length"),
        # a side that is not the image of the other in any order is meant so
        ("[[-0.1, 1.7], [-0.1, 0.9], [-0.1, 0.5]]", ""),
    ],
)
def test_mirrored_members_whose_points_are_in_another_order_are_asked_about(left: str, asked: str) -> None:
    told = unlike_partners(read_case(MIRRORED.replace("LEFT", left)))
    assert len(told) == bool(asked)
    assert all(asked in sentence and "as number 1 does (0.9849 and 1.924 m)" in sentence for sentence in told)


def test_bodies_that_nothing_holds_are_named_together() -> None:
    case = case_of()
    assert unrestrained(case, case.load_cases[0]) == [("crate", "deck")]
    held = case_of(more="motions: [{body: deck, x: {velocity: 0}, y: {velocity: 0}, angle: {velocity: 0}}]")
    assert unrestrained(held, held.load_cases[0]) == []


def modes(squares: list[float], shapes: list[list[float]]) -> Any:
    return SimpleNamespace(squares=np.array(squares), shapes=np.array(shapes).T, least=1e-9)


def test_modes_without_stiffness_and_growing_ones_are_told_with_what_moves() -> None:
    case = case_of(more="joints: [{type: prismatic, bodies: [ground, deck], at: [0, 0], axis: [1, 0]}]")
    along, up, turn = [0.1, 0, 0, 0, 0, 0], [0, 0.1, 0, 0, 0, 0], [0, 0, 0.4, 0, 0, 0]
    found = restraint(
        case, case.load_cases[0], modes([-9.0, 0.0, 400.0], [turn, along, up]), ("crate", "deck", "ground")
    )
    assert found["free"] == []
    assert (found["loose"], found["movers"]) == (1, ["crate along x"])
    assert found["growing"] == [{"rate": 3.0, "mover": "crate turning"}]
    first, second = in_words(found)
    assert "one mode has no stiffness at the start (most of it: crate along x)" in first
    assert "grows with 3/s (most of it: crate turning)" in second


def test_rigid_motion_of_what_nothing_holds_is_no_loose_mode() -> None:
    case = case_of()
    still = [0.1, 0, 0, 0, 0, 0]
    found = restraint(case, case.load_cases[0], modes([0.0, 0.0, 0.0, 4.0], [still] * 4), ("crate", "deck"))
    assert (found["loose"], found["movers"]) == (0, [])
    assert in_words(found) == [
        "nothing holds crate and deck: no member, joint, bushing or contact leads to ground or to a driven body"
    ]


def test_a_step_too_long_for_the_fastest_vibration_is_named() -> None:
    shapes = [[0, 0.1, 0, 0, 0, 0], [0, 0, 0.4, 0, 0, 0]]
    found = modes([100.0, (2.0 * np.pi / 0.05) ** 2], shapes)
    long = case_of(more="solver: {step: 0.01}")
    told = long_step(long, found, ("crate", "deck"))
    assert "0.01 s is 5 to a period" in told
    assert "crate turning" in told
    assert "at most 0.005 s" in told
    assert long_step(case_of(more="solver: {step: 0.005}"), found, ("crate", "deck")) == ""
    assert long_step(case_of(), found, ("crate", "deck")) == ""


def swinging(case: Any, period: float, step: float, share: float = 1.0) -> Any:
    """Body 0 drifts along x with 1 m/s, and swings along y."""
    t = np.arange(0.0, 1.0 + 0.5 * step, step)
    v, a = np.zeros((len(t), 6)), np.zeros((len(t), 6))
    v[:, 0], rate = 1.0, 2.0 * np.pi / period
    v[:, 1], a[:, 1] = share * np.cos(rate * t), -share * rate * np.sin(rate * t)
    return SimpleNamespace(t=t, v=v, a=a, status=Status.OK)


@pytest.mark.parametrize(("period", "coarse"), [(0.2, False), (0.11, False), (0.09, True), (0.025, True)])
def test_a_motion_of_fewer_than_ten_steps_a_period_is_told_with_its_body(period: float, coarse: bool) -> None:
    case = case_of(more="solver: {step: 0.01}")
    told = coarse_steps(case, "default", swinging(case, period, 0.01))
    assert bool(told) == coarse
    if coarse:
        assert "the velocity of crate swings" in told
        assert "fewer than ten steps" in told


def test_small_swings_and_steps_of_the_solver_are_not_told() -> None:
    case = case_of(more="solver: {step: 0.01}")
    assert coarse_steps(case, "default", swinging(case, 0.04, 0.01, share=0.02)) == ""
    assert coarse_steps(case_of(), "default", swinging(case, 0.04, 0.01)) == ""
    short = swinging(case, 3.0, 0.01)
    short.t = short.t[:5]
    assert "fewer than ten steps" in coarse_steps(case, "default", short)


@pytest.mark.parametrize(("rate", "told"), [(90.0, False), (628.3, True), (2000.0, True)])
def test_a_body_in_space_that_turns_too_far_in_a_fixed_step_is_told(rate: float, told: bool) -> None:
    bodies = "wheel: {mass: 1, inertia: [1, 1, 1], position: [0, 0, 0]}"
    case = read_case(f"{{format: 1, dimension: 3, time: {{end: 1}}, bodies: {{{bodies}}}, solver: {{step: 0.01}}}}")
    t = np.arange(0.0, 1.0, 0.01)
    v = np.tile([0.0, 0.0, 0.0, 0.6 * rate, 0.0, 0.8 * rate], (len(t), 1))
    found = coarse_steps(case, "default", SimpleNamespace(t=t, v=v, a=np.zeros_like(v), status=Status.OK))
    assert bool(found) == told
    assert not told or f"wheel turns by {0.01 * rate:.2g} rad in a step" in found


def evaluated(value: float) -> Any:
    return SimpleNamespace(evaluation=SimpleNamespace(status=Status.OK, objectives={"G": value}))


@pytest.mark.parametrize(("sense", "now", "told"), [("minimize", 1.04, 0), ("minimize", 1.2, 1), ("maximize", 0.8, 1)])
def test_a_final_design_much_worse_than_the_full_one_is_told(sense: str, now: float, told: int) -> None:
    case = read_case(CRATE.format(**PLAIN).replace("response: energy", f"response: energy, sense: {sense}"))
    found = worse_than_promised(case, [evaluated(1.0), evaluated(1.5), evaluated(now)])
    assert len(found) == told
    if told:
        assert "20.0% worse than the full design promised" in found[0]


def test_an_objective_of_weight_zero_that_has_become_worse_is_not_told() -> None:
    text = CRATE.format(**PLAIN).replace("objectives:", "objectives:\n  H: {response: energy, over_time: mean}")
    columns = [evaluated(1.0), evaluated(1.5)]
    for column, value in zip(columns, (1.0, 2.0), strict=True):
        column.evaluation.objectives["H"] = value
    for weight, names in ((0, ["G"]), (1, ["H", "G"])):
        case = read_case(f"{text}combine: {{weights: {{G: 1, H: {weight}}}}}\n")
        assert [sentence.split()[0] for sentence in worse_than_promised(case, columns)] == names


def test_how_much_worse_than_nearly_nothing_is_not_told_in_percent() -> None:
    found = worse_than_promised(read_case(CRATE.format(**PLAIN)), [evaluated(1e-14), evaluated(0.3)])
    assert "G of the final design is far worse than the full design promised: 0.3 in place of 1e-14" in found[0]


def test_a_bad_case_is_json_with_every_mistake(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text(CRATE.format(**{**PLAIN, "inertia": "-6", "gravity": "down"}))
    assert run_group(["check", str(path), "--json"]) == 2
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert [each["key"] for each in document["mistakes"]] == ["gravity[1]", "bodies.crate.inertia"]
    assert document["mistakes"][0]["line"] == 2
    assert f"{path}:2:" in said.err
    assert run_group(["check", str(tmp_path / "none.yaml"), "--json"]) == 2
    assert "no such file" in json.loads(capsys.readouterr().out)["mistakes"][0]["message"]


def test_no_time_is_left_only_when_nothing_is_to_come() -> None:
    now = iter([0.0, 10.0, 20.0])
    rate = Rate(lambda: next(now))
    rate.add()
    rate.add()
    last: Any = SimpleNamespace(start=0, starts=1, iteration=5, max_iterations=5)
    assert rate.words(last) == "0.1/s, the last iteration"
    last.iteration = 3
    assert "at most 40 s left" in rate.words(last)


@pytest.mark.parametrize(
    ("left", "more", "words"),
    [
        (float("nan"), float("nan"), "time left not known"),
        (0.0, 0.0, "less than 1 s left"),
        (70.0, 0.5, "about 1 min 10 s left"),
        (2.0, 60.0, "about 2 s left of this round, 1 min 0 s where more are needed"),
        (2.0, float("nan"), "about 2 s left of this round"),
    ],
)
def test_a_front_says_when_it_cannot_tell(left: float, more: float, words: str) -> None:
    snapshot: Any = SimpleNamespace(directions=[0], best={}, running=(), done=3, evaluations=9, left=left, more=more)
    assert line(snapshot).endswith(words)


def test_what_a_front_may_still_need_is_told_apart_from_what_it_is_doing() -> None:
    """At the end of the last round nothing of it is left, whatever such fronts usually need."""
    told: list[Any] = []
    run = _FrontRun(read_case(FRONT), Ask(np.eye(2)), told.append, never, ignore, "")
    run.planner = SimpleNamespace(best={})  # type: ignore[assignment]
    run.solved = {str(i): replace(failed(-1, "", np.zeros(1), 2, ""), seconds=4.0) for i in range(4)}
    run.tell({0: 0})
    run.tell({})
    assert run.expected == pytest.approx(6.4)
    assert [each.left for each in told] == [4.0, 0.0]
    assert [each.more for each in told] == pytest.approx([1.4 * 4.0, 2.4 * 4.0])


@pytest.mark.parametrize(("milliseconds", "told"), [(12.6, "12.6 ms here"), (4870.0, "4.87 s here")])
def test_the_time_of_an_evaluation_is_told_in_a_unit_that_fits(milliseconds: float, told: str) -> None:
    found = {"steps": 25, "force_sums": 16_229, "milliseconds": milliseconds, "points": 1}
    assert cost_in_words(found) == f"25 steps, 16,229 force sums, {told}"
