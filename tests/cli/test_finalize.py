"""`mdstopo finalize`: the members kept, their sizes, and the case that repeats their motion."""

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest

from mdstopo.case.laws import LAWS
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Table
from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.yaml_text import text_of
from mdstopo.cli.group import run_group
from mdstopo.engine import Evaluator
from mdstopo.finalize.document import _versions, content_of, final_content
from mdstopo.finalize.equilibria import _Distance
from mdstopo.finalize.finalize_design import Column, finalize, ready, worse_than_promised
from mdstopo.finalize.keep import chosen, places, restricted
from mdstopo.finalize.scaled_laws import scaled_law
from mdstopo.mechanics.kinematics.spatial import SPATIAL
from mdstopo.status import Status
from tests.commands import call

SPRINGS = """\
format: 1
title: "1e-3"
gravity: [0, -9.8]
time: {end: 0.1}
bodies:
  torso: {mass: 60, inertia: 10, position: [0, 0], angle: 0.3}
  vehicle: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: torso, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 4}}}
  back: {body: torso, frame: body, grid: {line: {from: [-0.2, 0.3], to: [0.2, 0.3], count: 3}}}
  frame: {body: vehicle, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 3}}}
members:
  belts: {from: edge, to: frame, law: {type: spring, stiffness: 20000}, cost: length}
  base: {from: edge, to: {body: ground, at: [0, -2]}, law: {type: spring, stiffness: 300}, design: false}
  ties: {from: back, to: frame, law: {type: spring, stiffness: 9000}}
load_cases:
  turn: {loads: [{body: vehicle, angular_acceleration: {file: pulse.csv}}]}
  brake: {loads: [{body: vehicle, acceleration: [20, 0]}]}
design: {initial: 0.2, lower: {belts: 0.001}, power: {belts: 2}}
objectives:
  G1: {response: energy, load_case: turn}
  G2: {response: {displacement: {body: torso}}, load_case: brake}
combine: {weights: {G1: 1, G2: 2}, normalize: false}
constraints:
  - {volume: all, equals: 2.4}
  - {volume: [belts], fraction: 0.9}
optimizer: {max_iterations: 5}
"""
LAWS_OF_ALL_KINDS = """\
format: 1
gravity: [0, -9.81]
time: {end: 0.3}
bodies:
  load: {mass: 20, inertia: 2, position: [0, 1]}
points:
  low: {body: load, grid: {line: {from: [-0.4, 0.8], to: [0.4, 0.8], count: 3}}}
  feet: {body: ground, grid: {line: {from: [-0.6, 0], to: [0.6, 0], count: 3}}}
members:
  legs:
    from: low
    to: feet
    law:
      - {type: spring, stiffness: 900, damping: 30, preload: -20}
      - {type: gap, stiffness: 4000, damping: 20, gap: 0.001, side: compression, clip: true}
      - {type: pulse, peak: 60, rate: 300, time: 0.15, active_until: 0.25}
  stays:
    from: low
    to: feet
    connect: pairs
    law:
      - {type: curve, curve: [[-0.1, -40], [0, 0], [0.05, 50], [0.1, 60]], free_length: 0.79}
      - {type: actuator, proportional: 500, derivative: 10, limit: 15}
      - {type: crush, stiffness: 3000, force: 25}
objectives:
  force: {response: {member_force: {group: legs}}}
  drop: {response: {displacement: {body: load, component: y}}, over_time: max_abs}
combine: {weights: {force: 1, drop: 0}}
design: {initial: {legs: 0.35, stays: 0.6}, power: {legs: 2, stays: 1}}
constraints:
  - {volume: [legs], limit: 6}
  - {response: {member_force: {group: legs}}, limit: 5000}
optimizer: {max_iterations: 2}
solver: {tolerance: 1.0e-10}
"""


UNCERTAIN = "uncertainty={parameters: {bodies.torso.mass: {normal: {deviation: 6}}}}"


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "pulse.csv").write_text("t;value\n0;0\n0.05;20\n0.1;5\n")
    (tmp_path / "in" / "probe.yaml").write_text(SPRINGS)
    (tmp_path / "in" / "legs.yaml").write_text(LAWS_OF_ALL_KINDS)


#: laws with keys that are forces; of `expression` the formulas are sized (tests/case/test_expression_laws.py)
WITH_FORCES = {name: law for name, law in LAWS.items() if name != "expression"}


def test_every_law_says_which_keys_are_forces() -> None:
    for name, law in WITH_FORCES.items():
        assert with_role(law, "scales"), name


@pytest.mark.parametrize("name", WITH_FORCES)
def test_a_sized_law_has_its_forces_scaled_and_nothing_else(name: str) -> None:
    given: dict[str, Any] = {"active_from": 0.5}
    for key, field in LAWS[name].__dataclass_fields__.items():
        if field.type in ("float", "float | None") and not key.startswith("active"):
            given[key] = 3.0
    given |= {"curve": {"curve": np.array([[-1.0, -2.0], [1.0, 4.0]])}}.get(name, {})
    given |= {"table": {"table": Table(np.array([0.0, 1.0]), np.array([[2.0], [4.0]]))}}.get(name, {})
    found = scaled_law(LAWS[name](**given), 0.25)
    assert found.pop("type") == name
    for key, value in found.items():
        if key in ("curve", "table"):
            assert [row[1] for row in value] in ([-0.5, 1.0], [0.5, 1.0])
            assert value[1][0] == 1.0
        elif key == "active_from":
            assert value == 0.5
        else:
            assert value == (0.75 if key in with_role(LAWS[name], "scales") else 3.0), key
    assert set(found) == set(given)


def test_the_largest_are_kept_and_of_equal_ones_the_first() -> None:
    alpha = np.array([0.1, 1.0, 0.5, 1.0, 1.0, 0.0])
    assert chosen(alpha, 2, None).tolist() == [1, 3]
    assert chosen(alpha, 4, None).tolist() == [1, 2, 3, 4]
    assert chosen(alpha, 99, None).tolist() == [0, 1, 2, 3, 4, 5]
    assert chosen(alpha, None, 0.5).tolist() == [1, 2, 3, 4]


def test_text_survives_the_reader() -> None:
    content = {
        "format": 1,
        "title": 'on: "1e-3" \u00e4\U0001f600\n#',
        "time": {"end": 1e-9},
        "bodies": {"no": {"mass": 0.1 + 0.2, "inertia": 1e20, "position": [0, -1.5]}, "y": {"mass": 1, "inertia": 1}},
        "points": {"p": {"body": "no", "grid": {"list": [[i / 3, 1e-17 * i] for i in range(60)]}}},
        "loads": [{"body": "no", "moment": [[i / 7, float(i)] for i in range(30)]}, {"body": "y", "force": [1, 2]}],
        "members": {"m": {"from": "p", "to": {"body": "y", "at": [5, 5]}, "law": {"type": "spring", "stiffness": 2}}},
    }
    content["bodies"]["y"]["position"] = [9, 9]  # type: ignore[index]
    case = read_case(text_of(content))
    assert case.title == content["title"]
    assert [body.name for body in case.bodies] == ["no", "y"]
    assert (case.bodies[0].mass, case.bodies[0].inertia) == (0.1 + 0.2, 1e20)
    assert case.load_cases[0].end == 1e-9
    assert np.array_equal(case.points["p"].world, [[i / 3, 1e-17 * i] for i in range(60)])
    assert case.load_cases[0].loads[0].moment == Table(np.arange(30) / 7, np.arange(30.0)[:, None])
    assert case.load_cases[0].loads[1].force == (1.0, 2.0)
    assert max(map(len, text_of(content).splitlines())) < 120


def final_of(case: Any, kept: np.ndarray, alpha: np.ndarray) -> tuple[Any, Any, list[str]]:
    """The reduced case, and the final one as it is read again."""
    reduced = restricted(case, kept, case.initial)
    content, told = final_content(content_of(case), reduced, places(case, kept), alpha)
    return reduced, read_case(text_of(content)), told


def same_motion(reduced: Any, final: Any, alpha: np.ndarray) -> float:
    """The largest difference of states between both at common times, relative to the largest of each state."""
    worst = 0.0
    designed, standing = Evaluator(reduced), Evaluator(final)
    for loads in reduced.load_cases:
        one = designed.trajectory(alpha, loads.name)
        two = standing.trajectory(final.start, loads.name)
        assert one.status.ok
        assert two.status.ok
        times = np.linspace(loads.start, loads.end, 41)
        first, second = one.at(times), two.at(times)
        for key in ("q", "v"):
            a, b = getattr(first, key), getattr(second, key)
            worst = max(worst, float((np.abs(a - b).max(axis=0) / np.maximum(np.abs(a).max(axis=0), 1e-3)).max()))
    return worst


ROOMY = {"constraints[0]": "{volume: all, limit: 30}"}


def test_the_final_case_moves_as_the_design_with_springs() -> None:
    case = load_case("in/probe.yaml", ROOMY)
    kept = np.array([0, 4, 7, 11, 13, 20])
    alpha = np.linspace(0.3, 0.9, 6)
    reduced, final, told = final_of(case, kept, alpha)
    assert told == []
    assert final.files == {}
    assert same_motion(reduced, final, alpha) < 1e-9
    assert [g.name for g in final.members] == ["belts_0", "belts_4", "belts_7", "belts_11", "base", "ties_1", "ties_8"]
    assert set(final.points) == {"edge"}
    one = Evaluator(reduced).evaluate(alpha)
    two = Evaluator(final).evaluate(final.start)
    assert two.objectives == pytest.approx(one.objectives, rel=1e-12)
    assert two.constraints == pytest.approx(one.constraints, abs=1e-12)
    for name, gradient in two.gradients.items():  # d/dalpha at alpha = 1 is alpha d/dalpha
        assert gradient == pytest.approx(alpha * one.gradients[name], rel=1e-6, abs=1e-9 * np.abs(gradient).max())


def test_points_have_the_same_body_coordinates_to_the_bit() -> None:
    case = load_case("in/probe.yaml", ROOMY)
    kept = np.arange(case.n_design)
    reduced, final, _ = final_of(case, kept, np.full(case.n_design, 0.5))
    old = np.concatenate([g.p_local for g in reduced.design_groups])
    assert np.array_equal(np.concatenate([g.p_local for g in final.design_groups]), old)
    assert np.array_equal(
        np.concatenate([g.q_local for g in final.design_groups]),
        np.concatenate([g.q_local for g in reduced.design_groups]),
    )


def test_the_final_case_moves_as_the_design_with_lists_of_laws() -> None:
    case = load_case("in/legs.yaml")
    kept = np.array([0, 2, 4, 7, 9, 11])
    alpha = np.array([0.5, 0.7, 0.9, 0.8, 0.4, 0.6])
    reduced, final, told = final_of(case, kept, alpha)
    assert same_motion(reduced, final, alpha) < 1e-9
    assert len(told) == 1
    assert "objective force" in told[0]
    assert [objective.name for objective in final.objectives] == ["drop"]
    rows = [row for row in final.constraints if hasattr(row, "response")]
    assert [row.response.group for row in rows] == ["legs_0", "legs_2", "legs_4", "legs_7"]
    one, two = Evaluator(reduced).evaluate(alpha), Evaluator(final).evaluate(final.start)
    assert two.objectives["drop"] == pytest.approx(one.objectives["drop"], rel=1e-9)
    assert two.constraints[0] == pytest.approx(one.constraints[0], abs=1e-12)
    assert max(two.constraints[1:]) == pytest.approx(one.constraints[1], rel=1e-9)


def test_members_without_size_are_left_out() -> None:
    case = load_case("in/legs.yaml", {"design.lower": "0"})
    _, final, told = final_of(case, np.array([0, 1, 9]), np.array([0.0, 0.5, 0.5]))
    assert [group.name for group in final.members] == ["legs_1", "stays_0"]
    assert [objective.name for objective in final.objectives] == ["force", "drop"]
    assert told == []
    _, final, told = final_of(case, np.array([0, 9]), np.array([0.0, 0.5]))
    assert [objective.name for objective in final.objectives] == ["drop"]
    assert final.constraints == ()
    assert [sentence.partition(" is left out")[0] for sentence in told] == [
        "the objective force",
        "constraints[0] (volume of legs)",
        "constraints[1] (max member force in legs)",
    ]


def test_a_result_becomes_a_case_that_repeats_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(capsys, "run", "in/probe.yaml", "--out", "probe.h5", "--quiet")[0] == 0
    status, out, err = call(capsys, "finalize", "probe.h5", "--keep", "7", "--out", "made/final.yaml", "--json")
    assert status == 0, err
    told = json.loads(out)
    full, kept, sized_anew, verified = told["designs"]
    assert [each["members"] for each in told["designs"]] == [21, 7, 7, 7]
    with h5py.File("probe.h5") as file:
        alpha = file["design/alpha"][()]
        assert full["objectives"]["G1"] == pytest.approx(file["iterations/objectives"][-1, 0], rel=0.2)
    assert min(each["alpha_before"] for each in told["kept"]) == np.sort(alpha)[-7]
    assert sized_anew["constraints"][0] == pytest.approx(0.0, abs=1e-12)
    assert verified["objectives"] == pytest.approx(sized_anew["objectives"], rel=1e-7)
    assert verified["objectives"] != sized_anew["objectives"]
    assert told["difference"] < 1e-11
    goal = {each["name"]: each["objectives"]["G1"] + 2 * each["objectives"]["G2"] for each in (kept, sized_anew)}
    assert kept["constraints"][0] != pytest.approx(0.0, abs=1e-3)
    assert goal["re-optimised"] != goal["kept as they were"]

    assert call(capsys, "check", "made/final.yaml", "--quiet")[0] == 0
    assert call(capsys, "simulate", "made/final.yaml", "--out", "final.h5", "--quiet")[0] == 0
    case = restricted(load_case("in/probe.yaml"), chosen(alpha, 7, None), alpha)
    sizes = np.array([each["alpha"] for each in told["kept"]])
    with h5py.File("final.h5") as file:
        for name in ("turn", "brake"):
            motion = Evaluator(case).trajectory(sizes, name)
            assert file[f"trajectories/{name}/q"][-1] == pytest.approx(motion.q[-1], rel=1e-9, abs=1e-11)
            assert file[f"trajectories/{name}/v"][-1] == pytest.approx(motion.v[-1], rel=1e-9, abs=1e-11)
    assert call(capsys, "gradient", "made/final.yaml", "--out", "gradient.h5", "--quiet")[0] == 0
    status, out, _ = call(capsys, "run", "made/final.yaml", "--out", "again.h5")
    assert status == 0
    assert "7 present, 0 grey, 0 absent of 7" in out


UNWANTED = """\
format: 1
time: {end: 0.1}
bodies:
  load: {mass: 2, inertia: 0.1, position: [0, 0], velocity: [1, 0]}
points:
  eye: {body: load, grid: {list: [[0, 0]]}}
  posts: {body: ground, grid: {list: [[-1, 0], [-1, 0.5]]}}
members:
  ropes: {from: eye, to: posts, law: {type: spring, stiffness: 100}}
  push:
    from: eye
    to: {body: ground, at: [-2, 0]}
    law: {type: pulse, peak: -20, rate: 1e4, time: 0.05}
    design: false
design: {initial: 0.5, lower: 0, variables: {peak: {group: push, parameter: peak, lower: -80, upper: -10}}}
objectives:
  speed: {response: {velocity: {body: load, component: x}}, over_time: final, sense: maximize}
"""


def test_chosen_parameters_are_written_where_no_member_is_wanted(capsys: pytest.CaptureFixture[str]) -> None:
    Path("unwanted.yaml").write_text(UNWANTED)
    assert call(capsys, "run", "unwanted.yaml", "--out", "unwanted.h5", "--quiet")[0] == 0
    status, _, err = call(capsys, "finalize", "unwanted.h5", "--keep", "1", "--out", "unwanted.final.yaml")
    assert status == 0, err
    final = load_case("unwanted.final.yaml")
    assert [group.name for group in final.members] == ["push"]
    reached = Evaluator(final).evaluate(final.start, gradient=False).objectives["speed"]
    with h5py.File("unwanted.h5") as file:
        assert file["design/alpha"][()].max() == 0.0
        assert reached == pytest.approx(file["iterations/objectives"][-1, 0], rel=1e-7)
    assert reached > 1.1


def test_nothing_is_written_where_what_was_chosen_is_left_out_with_its_members(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The stiffness of ropes that have no size is no choice that anything is left of."""
    text = UNWANTED.replace("peak: {group: push, parameter: peak, lower: -80, upper: -10}",
                            "k: {group: ropes, parameter: stiffness, lower: 50, upper: 200}")  # fmt: skip
    Path("left_out.yaml").write_text(text)
    assert call(capsys, "run", "left_out.yaml", "--out", "left_out.h5", "--quiet")[0] == 0
    status, out, _ = call(capsys, "finalize", "left_out.h5", "--keep", "1", "--out", "left_out.final.yaml")
    assert status == 1
    assert "all members have alpha = 0" in out
    assert not Path("left_out.final.yaml").exists()


def test_a_threshold_keeps_what_reaches_it_and_the_table_says_all(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "run", "in/probe.yaml", "--out", "probe.h5", "--quiet")
    with h5py.File("probe.h5") as file:
        count = np.count_nonzero(file["design/alpha"][()] >= 0.05)
    assert 2 < count < 8
    status, out, _ = call(capsys, "finalize", "probe.h5", "--threshold", "0.05")
    assert status == 0
    rows = {line[2:].partition("  ")[0]: line.split() for line in out.splitlines() if line.startswith("  ")}
    assert rows["members"] == ["members", "21", *[str(count)] * 3]
    assert rows["volume of belts, ties = 2.4"][-2:] == ["2.4", "2.4"]
    assert Path("probe.final.yaml").exists()
    assert len(load_case("probe.final.yaml").design_groups) == count

    status, _, err = call(capsys, "finalize", "probe.h5", "--keep", "8")
    assert status == 2
    assert "probe.final.yaml exists already" in err
    assert call(capsys, "finalize", "probe.h5", "--keep", "9", "--overwrite", "--quiet")[:2] == (0, "")
    assert len(load_case("probe.final.yaml").design_groups) == 9
    words = ["--keep", "9", "--overwrite", "--quiet", "--set", "optimizer.max_iterations=0", "--set", "gravity=[0, -5]"]
    assert call(capsys, "finalize", "probe.h5", *words)[0] == 0
    final = load_case("probe.final.yaml")
    assert final.load_cases[0].gravity == (0.0, -5.0)
    assert final.optimizer.max_iterations == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "say --keep or --threshold"),
        (["--keep", "3", "--threshold", "0.5"], "say --keep or --threshold"),
        (["--keep", "0"], "x>=1"),
        (["--threshold", "nan"], "nan is no alpha"),
        (["--threshold", "2"], "no member has alpha of 2 or more"),
        (["--keep", "2"], "constraints[0].equals: found the bound 2.4"),
        (["--keep", "5", "--overwrite", "--out", "run.h5"], "this is what the new case is made from"),
        (["--keep", "3", "--set", "points.edge.grid.rectangle.count=5"], "the design has 21 values"),
        (["--keep", "3", "--set", UNCERTAIN], "a case with uncertainty cannot be finalized"),
        (["--keep", "3", "--set", "design.mirrored=[[belts, belts]]"], "belts"),
        (["--keep", "3", "--set", "objectives=null"], "no objective is called 'G2'"),
    ],
)
def test_bad_use_is_refused_before_work(
    words: list[str], message: str, results: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("run.h5").write_bytes(results["run"])
    status, out, err = call(capsys, "finalize", "run.h5", *words)
    assert status == 2, err
    assert out == ""
    assert message in err
    assert not Path("run.final.yaml").exists()


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A result of `run` and one of `simulate`."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "pulse.csv").write_text("0 20\n1 20\n")
    (folder / "probe.yaml").write_text(SPRINGS)
    found = {}
    for name in ("run", "simulate"):
        assert run_group([name, str(folder / "probe.yaml"), "--out", str(folder / name), "--quiet"]) == 0
        found[name] = (folder / name).read_bytes()
    return found


def test_other_results_and_changed_files_are_refused(
    results: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("motion.h5").write_bytes(results["simulate"])
    status, _, err = call(capsys, "finalize", "motion.h5", "--keep", "2")
    assert status == 2
    assert "a result of `simulate`; finalize takes one of `run`" in err
    call(capsys, "run", "in/probe.yaml", "--out", "probe.h5", "--quiet")
    Path("in/pulse.csv").write_text("0 1\n1 1\n")
    status, _, err = call(capsys, "finalize", "probe.h5", "--keep", "5")
    assert status == 2
    assert "the file pulse.csv is no longer the one that the run read" in err


def test_an_unfinished_result_is_taken_with_a_notice(
    results: dict[str, bytes], capsys: pytest.CaptureFixture[str]
) -> None:
    Path("run.h5").write_bytes(results["run"])
    with h5py.File("run.h5", "r+") as file:
        file.attrs["status"] = "interrupted"
    status, _, err = call(capsys, "finalize", "run.h5", "--keep", "5")
    assert status == 0
    assert "the run is not finished (interrupted); its best design so far is taken" in err


def test_what_looks_at_members_that_are_gone_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(capsys, "run", "in/legs.yaml", "--out", "legs.h5", "--quiet")[0] == 0
    with h5py.File("legs.h5", "r+") as file:
        file["design/alpha"][:] = [*([0.1] * 9), 1.0, 1.0, 1.0]
    status, _, err = call(capsys, "finalize", "legs.h5", "--keep", "3")
    assert status == 2
    assert "objectives.force: it looks at the members of 'legs', none of which is kept" in err
    assert "constraints[1]: it looks at the members of 'legs', none of which is kept" in err


def test_bounds_of_the_full_case_stay_for_the_members_kept() -> None:
    case = load_case("in/probe.yaml")
    reduced = restricted(case, np.array([1, 2, 15]), case.initial)
    assert [row.bound for row in reduced.constraints] == [row.bound for row in case.constraints]
    assert np.array_equal(reduced.constraints[0].coefficients, case.constraints[0].coefficients[[1, 2, 15]])
    assert reduced.members[0].p_world == pytest.approx(case.members[0].p_world[[1, 2]])
    assert reduced.members[0].q_world == pytest.approx(case.members[0].q_world[[1, 2]])


def test_a_choice_among_equal_alphas_is_told(capsys: pytest.CaptureFixture[str], results: dict[str, bytes]) -> None:
    Path("run.h5").write_bytes(results["run"])
    with h5py.File("run.h5", "r+") as file:
        file["design/alpha"][:] = [*([1.0] * 6), *([0.5] * 15)]
    _, _, err = call(capsys, "finalize", "run.h5", "--keep", "4")
    assert "2 more members have the alpha of the smallest one kept" in err
    assert [g.name for g in load_case("run.final.yaml").design_groups] == [f"belts_{i}" for i in range(4)]
    _, _, err = call(capsys, "finalize", "run.h5", "--keep", "6", "--overwrite")
    assert "more members" not in err


def test_a_fixed_step_is_verified_with_a_shorter_one(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["--set", "solver={integrator: generalized_alpha, step: 1e-3}", "--set", "optimizer.max_iterations=1"]
    assert call(capsys, "run", "in/probe.yaml", "--out", "probe.h5", "--quiet", *words)[0] == 0
    status, out, _ = call(capsys, "finalize", "probe.h5", "--keep", "6", "--json")
    told = json.loads(out)
    assert status == 0
    assert told["verified_with"] == "step 0.0001 s"
    coarse, fine = (told["designs"][i]["objectives"]["G2"] for i in (2, 3))
    assert 1e-9 < abs(coarse / fine - 1.0) < 1e-2
    assert load_case("probe.final.yaml").solver.step == 1e-3


def test_an_interrupted_run_writes_no_case(tmp_path: Path) -> None:
    case = load_case("in/probe.yaml", {"optimizer": "{max_iterations: 1000, tolerance: 0, move_limit: 1.0e-4}"})
    alpha = np.full(case.n_design, 0.4)
    kept, reduced = ready(case, alpha, 8, None)
    asked = iter([False] * 5)
    done = finalize(case, alpha, kept, reduced, place=tmp_path / "x.yaml", stop_requested=lambda: next(asked, True))
    assert done.outcome.status == "interrupted"
    assert (done.text, done.columns) == ("", ())


@pytest.mark.parametrize(("sense", "worse"), [("minimize", "1.2"), ("maximize", "0.8")])
def test_what_is_worse_than_the_full_design_promised_is_told_by_the_sense_of_the_objective(
    sense: str, worse: str
) -> None:
    case = load_case("in/probe.yaml", {"objectives.G1.sense": sense})

    def column(value: float) -> Column:
        return Column("", 1, SimpleNamespace(status=Status.OK, objectives={"G1": value, "G2": 1.0}))  # type: ignore[arg-type]

    told = [worse_than_promised(case, (column(1.0), column(value))) for value in (0.8, 1.0, 1.2)]
    assert [bool(each) for each in told] == [worse == "0.8", False, worse == "1.2"]
    (sentence,) = next(filter(None, told))
    assert f"G1 of the final design is 20.0% worse than the full design promised: {worse} in place of 1;" in sentence


#: held upright by four stays; a single one is too soft for that
MAST = """\
format: 1
gravity: [0, -10]
time: {end: 0.05}
bodies:
  mast: {mass: 10, inertia: 1, position: [0.02, 1]}
joints:
  - {type: revolute, bodies: [ground, mast], at: [0, 0]}
points:
  top: {body: mast, grid: {list: [[0, 1.5]]}}
  pegs: {body: ground, grid: {list: [[-1, 1.5], [-1, 1.3], [1, 1.5], [1, 1.3]]}}
members:
  stays: {from: top, to: pegs, law: {type: spring, stiffness: 40, damping: 1}}
objectives:
  G: {response: energy}
solver: {settle: true, integrator: runge_kutta}
optimizer: {max_iterations: 0}
"""


@pytest.fixture(scope="module")
def mast(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mast")
    (folder / "mast.yaml").write_text(MAST)
    np.savetxt(folder / "start.txt", [0.9, 0.8, 0.85, 0.8])
    words = ["--alpha", str(folder / "start.txt"), "--out", str(folder / "mast.h5"), "--quiet"]
    assert run_group(["run", str(folder / "mast.yaml"), *words]) in (0, 1)
    return folder / "mast.h5"


def test_a_machine_that_falls_to_another_equilibrium_is_not_accepted(
    mast: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "one.yaml"
    status, said, err = call(capsys, "finalize", str(mast), "--keep", "1", "--out", str(out), "--json")
    assert status == 1
    assert not out.exists()
    document = json.loads(said)
    assert document["path"] is None
    assert re.search(
        r"rests 1\.\d+ m \(body 'mast'\) .* at another equilibrium: .*; keep more", document["not_written"]
    )
    assert document["not_written"] in err
    status, said, _ = call(capsys, "finalize", str(mast), "--keep", "1", "--out", str(out))
    assert status == 1
    head, sizes = said.splitlines()[0], re.search(r"^  sizes +(.*)$", said, re.MULTILINE)
    assert re.search(r": not written - the .*; keep more members$", head), head
    assert sizes is not None
    assert sizes[1].startswith(document["status"].replace("_", " "))


def test_a_machine_that_rests_where_the_full_one_does_is_accepted_and_a_long_way_is_told(
    mast: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "three.yaml"
    status, said, _ = call(capsys, "finalize", str(mast), "--keep", "3", "--out", str(out), "--json")
    document = json.loads(said)
    assert (status, document["path"], document["not_written"]) == (0, str(out), None)
    assert not [each for each in document["warnings"] if "rests" in each]
    # a stay that just holds: it leans over by far, to the same equilibrium
    words = ["--keep", "1", "--set", "members.stays.law.stiffness=56", "--out", str(tmp_path / "leans.yaml"), "--json"]
    status, said, _ = call(capsys, "finalize", str(mast), *words)
    document = json.loads(said)
    assert (status, document["not_written"]) == (0, None)
    (warning,) = [each for each in document["warnings"] if "rests" in each]
    assert re.search(r"rests 0\.\d+ m \(body 'mast'\) and 0\.\d+ rad", warning)


def test_distances_of_places_of_rest_are_known_in_space() -> None:
    text = "format: 1\ndimension: 3\ntime: {end: 1}\nbodies:\n"
    text += "".join(
        f"  {name}: {{mass: 1, inertia: [1, 1, 1], position: [{x}, 0, 0]}}\n" for name, x in (("a", 0), ("b", 1))
    )
    still = np.array([0.0, 0, 0, 1, 0, 0, 0] * 2)
    moved, half = still.copy(), 0.5 * 0.3
    moved[:3] = 0.03, 0.0, 0.04
    moved[10:14] = np.cos(half), 0.0, np.sin(half), 0.0  # b has turned by 0.3 about y
    far = _Distance(read_case(text), SPATIAL, still, moved)
    assert (far.distance, far.body) == (pytest.approx(0.05, rel=1e-14), "a")
    assert (far.angle, far.turned) == (pytest.approx(0.3, rel=1e-12), "b")


def test_an_expression_looks_at_the_group_that_its_member_has_become() -> None:
    def looking(group: str) -> dict[str, object]:
        of = {"f": {"member_force": {"group": group}}, "e": "energy"}
        return {"response": {"expression": {"formula": "f*e", "of": of}}, "over_time": "mean"}

    groups = {"tie": ["tie_0"], "net": []}
    assert _versions(looking("tie"), groups) == [looking("tie_0")]
    assert _versions(looking("net"), groups) == []
    assert _versions(looking("other"), groups) == [looking("other")]
