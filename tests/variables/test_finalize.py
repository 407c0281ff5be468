"""`mdstopo finalize` with parameters of laws as variables, and with alphas that are one."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from mdstopo.case.model import VolumeRow
from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.yaml_text import text_of
from mdstopo.engine import Evaluator
from mdstopo.finalize.apart import apart, unlike
from mdstopo.finalize.document import content_of, final_content
from mdstopo.finalize.finalize_design import ready
from mdstopo.finalize.keep import chosen, kept_values, one_alpha, places, restricted
from mdstopo.finalize.parameter_values import bound_of, with_valid_times
from tests.commands import call

#: a stiffness for all, which costs; springs and energy alone, so that the final case needs no general kernels
STIFFNESS = """\
format: 1
gravity: [0, -9.8]
time: {end: 0.2}
bodies:
  crate: {mass: 60, inertia: 10, position: [0, 0]}
  truck: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: crate, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 4}}}
  bed: {body: truck, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 3}}}
members:
  straps: {from: edge, to: bed, law: {type: spring, stiffness: 4000, damping: 20}, cost: length}
loads: [{body: truck, acceleration: [9.8, 0], angular_acceleration: 20}]
design:
  variables: {k: {group: straps, parameter: stiffness, lower: 1000, upper: 8000, cost: 1.0e-3}}
objectives: {stored: {response: energy}}
constraints: [{volume: all, equals: 6}]
optimizer: {max_iterations: 6}
"""
#: values for each member of fixed and of designed groups, one for two groups, and two laws
PARTS = """\
format: 1
gravity: [0, -9.8]
time: {end: 0.2}
bodies:
  crate: {mass: 60, inertia: 10, position: [0, 0]}
  truck: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  left: {body: crate, grid: {line: {from: [-0.25, -0.25], to: [-0.25, 0.25], count: 4}}}
  right: {body: crate, grid: {line: {from: [0.25, -0.25], to: [0.25, 0.25], count: 4}}}
  under: {body: crate, grid: {line: {from: [-0.2, -0.25], to: [0.2, -0.25], count: 2}}}
members:
  port: {from: left, to: {body: truck, at: [-0.8, -1]}, law: {type: gap, stiffness: 8000, gap: 0.01}, cost: length}
  feet:
    from: under
    to: {body: truck, at: [0, -1]}
    law: [{type: spring, stiffness: 3000, damping: 40}, {type: pulse, peak: 10, rate: 800, time: 0.1}]
    design: false
  star: {from: right, to: {body: truck, at: [0.8, -1]}, law: {type: gap, stiffness: 8000, gap: 0.01}, cost: length}
loads: [{body: truck, acceleration: [9.8, 0], angular_acceleration: 20}]
design:
  initial: 0.5
  variables:
    slack: {group: [port, star], parameter: gap, each: member, lower: 0.001, upper: 0.03, cost: 5}
    onset: {group: feet, parameter: active_from, law: 0, each: member, initial: 0.01, lower: 0, upper: 0.05}
    kick: {group: feet, parameter: peak, lower: 0, upper: 100, cost: 0.01}
    k: {group: [port, star], parameter: stiffness, lower: 1000, upper: 9000, cost: 1.0e-4}
objectives:
  slide: {response: {displacement: {body: crate, relative_to: truck}}, over_time: rms}
constraints: [{volume: all, limit: 9}, {volume: [star], limit: 5}, {volume: [feet], limit: 2}]
solver: {tolerance: 1.0e-10}
optimizer: {max_iterations: 4}
"""

#: one member with a law
TIMED = """\
format: 1
time: {end: 0.2}
bodies: {crate: {mass: 60, inertia: 10, position: [0, 0]}}
members: {strap: {from: {body: crate, at: [0, 0]}, to: {body: ground, at: [1, 0]}, law: LAW}}
"""


@pytest.fixture(autouse=True)
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("stiffness.yaml").write_text(STIFFNESS)
    Path("parts.yaml").write_text(PARTS)


def design_of(case, seed: int = 3) -> np.ndarray:
    """Any design between the bounds."""
    rng = np.random.default_rng(seed)
    values = [rng.uniform(each.lower, each.upper, each.count) for each in case.variables]
    return np.concatenate([rng.uniform(0.2, 0.9, case.n_design), *values])


def final_of(case, kept: np.ndarray, design: np.ndarray):
    """The reduced case, its design, and the final case as it is read again with what was told."""
    parted = apart(case, unlike(case, kept))
    reduced = restricted(parted, kept, design)
    own = design[np.concatenate([kept, case.n_design + kept_values(parted, kept)])]
    content, told = final_content(content_of(case), reduced, places(case, kept), own)
    return reduced, own, read_case(text_of(content)), told


def same_motion(one_case, one: np.ndarray, other_case, other: np.ndarray) -> float:
    """The largest difference of states at common times, relative to the largest of each."""
    first, second = (Evaluator(c).trajectory(d, "default") for c, d in ((one_case, one), (other_case, other)))
    assert first.status.ok
    assert second.status.ok
    times = np.linspace(0.0, 0.2, 41)
    worst = 0.0
    for key in ("q", "v"):
        a, b = getattr(first.at(times), key), getattr(second.at(times), key)
        worst = max(worst, float((np.abs(a - b).max(axis=0) / np.maximum(np.abs(a).max(axis=0), 1e-3)).max()))
    return worst


def test_sizes_and_a_shared_stiffness_become_numbers_that_repeat_the_response(capsys) -> None:
    assert call(capsys, "run", "stiffness.yaml", "--out", "run.h5", "--quiet")[0] == 0
    status, out, err = call(capsys, "finalize", "run.h5", "--keep", "5", "--json")
    assert status == 0, err
    told = json.loads(out)
    final = load_case("run.final.yaml")
    assert not final.variables
    (value,) = told["variables"]
    assert (value["name"], value["member"], value["unit"]) == ("k", None, "N/m")
    with h5py.File("run.h5") as file:
        assert value["value_before"] == file["design/variables/k"][0]
    assert 1000.0 <= value["value"] <= 8000.0
    alpha = np.array([each["alpha"] for each in told["kept"]])
    assert [g.laws[0].stiffness for g in final.members] == pytest.approx(alpha * value["value"], rel=1e-14)
    assert [g.laws[0].damping for g in final.members] == pytest.approx(alpha * 20.0, rel=1e-14)
    # what the stiffness costs is no longer there to be bought
    assert final.constraints[0].bound == pytest.approx(6.0 - 1e-3 * value["value"], rel=1e-12)
    _, _, sized, verified = told["designs"]
    assert sized["constraints"] == pytest.approx([0.0], abs=1e-12)

    found = Evaluator(final).evaluate(final.start)
    assert found.objectives["stored"] == pytest.approx(sized["objectives"]["stored"], rel=1e-12)
    assert found.constraints == pytest.approx(sized["constraints"], abs=1e-12)
    assert verified["objectives"]["stored"] == pytest.approx(sized["objectives"]["stored"], rel=1e-6)
    # simulated by itself, by other kernels than those that optimised it
    assert call(capsys, "simulate", "run.final.yaml", "--out", "final.h5", "--quiet")[0] == 0
    tight = read_case(Path("run.final.yaml").read_text(), overrides={"solver.tolerance": "1e-12"})
    exact = Evaluator(tight).evaluate(tight.start).objectives["stored"]
    known = Evaluator(load_case("stiffness.yaml", {"solver.tolerance": "1e-12"}))
    design = np.zeros(12)
    design[[each["member"] for each in told["kept"]]] = alpha
    full = known.evaluate(np.concatenate([design, [value["value"]]])).objectives["stored"]
    assert exact == pytest.approx(full, rel=1e-9)


def test_parameters_and_sizes_are_optimised_together(capsys) -> None:
    """Held at what they were, the same members do worse."""
    words = ["--set", "optimizer.max_iterations=40", "--set", "objectives.stored.over_time=mean", "--quiet"]
    words += ["--set", "design.variables.k.lower=2000", "--set", "constraints[0].equals=9"]
    assert call(capsys, "run", "stiffness.yaml", "--out", "run.h5", *words)[0] == 0
    with h5py.File("run.h5", "r+") as file:  # an optimum of other members
        file["design/variables/k"][0] = 3500.0
    held = [word for key in ("initial", "lower", "upper") for word in ("--set", f"design.variables.k.{key}=3500")]
    free = json.loads(call(capsys, "finalize", "run.h5", "--keep", "6", "--json")[1])
    fixed = json.loads(call(capsys, "finalize", "run.h5", "--keep", "6", "--json", "--overwrite", *held)[1])
    assert fixed["variables"][0]["value"] == 3500.0
    assert free["variables"][0]["value_before"] == 3500.0
    assert abs(free["variables"][0]["value"] - 3500.0) > 100.0
    best, other = (each["designs"][2]["objectives"]["stored"] for each in (free, fixed))
    assert best < 0.99 * other


def test_values_of_each_member_go_with_their_members(capsys) -> None:
    case = load_case("parts.yaml")
    design = design_of(case)
    kept = np.array([1, 3, 5, 7])  # the same of port and star
    reduced, own, final, told = final_of(case, kept, design)
    assert unlike(case, kept) == set()
    assert told == [
        "constraints[2] (volume of feet) is left out: all that it sums up are parameters of laws, which are numbers now"
    ]
    names = ["port_1", "port_3", "feet_0", "feet_1", "star_1", "star_3"]
    assert [g.name for g in final.members] == names
    law = {g.name: g.laws for g in final.members}
    gap = case.space.named(design)["slack"]
    onset = case.space.named(design)["onset"]
    for side in ("port", "star"):
        assert [law[f"{side}_{k}"][0].gap for k in (1, 3)] == [gap[1], gap[3]]
    assert [law[f"feet_{k}"][0].active_from for k in (0, 1)] == list(onset)
    assert law["feet_0"][1].peak == law["feet_1"][1].peak == case.space.named(design)["kick"][0]
    assert [g.design for g in final.members] == [True, True, False, False, True, True]
    assert same_motion(reduced, own, final, final.start) < 1e-9
    one, two = Evaluator(reduced).evaluate(own), Evaluator(final).evaluate(final.start)
    assert two.objectives["slide"] == pytest.approx(one.objectives["slide"], rel=1e-9)
    assert two.constraints == pytest.approx(one.constraints[:2], abs=1e-12)


def test_one_value_of_two_groups_survives_that_different_members_are_kept() -> None:
    case = load_case("parts.yaml")
    design = design_of(case)
    kept = np.array([0, 3, 5, 7])  # port 0 and 3, star 1 and 3
    assert unlike(case, kept) == {"port", "star"}
    reduced, own, final, _ = final_of(case, kept, design)
    assert [(v.name, v.groups) for v in reduced.variables if v.name.startswith("slack")] == [
        ("slack_0", ("port_0",)),
        ("slack_1", ("star_1",)),
        ("slack_3", ("port_3", "star_3")),
    ]
    gap = case.space.named(design)["slack"]
    law = {g.name: g.laws for g in final.members}
    assert [law[n][0].gap for n in ("port_0", "star_1", "port_3", "star_3")] == [gap[0], gap[1], gap[3], gap[3]]
    assert same_motion(reduced, own, final, final.start) < 1e-9
    one, two = Evaluator(reduced).evaluate(own), Evaluator(final).evaluate(final.start)
    assert two.objectives["slide"] == pytest.approx(one.objectives["slide"], rel=1e-9)
    assert two.constraints == pytest.approx(one.constraints[:2], abs=1e-12)


def test_values_taken_apart_get_names_that_no_other_variable_has() -> None:
    named = PARTS.replace("    kick: {", "    slack_0: {").replace("    onset: {", "    slack_3: {")
    case = read_case(named)
    design = design_of(case)
    reduced, own, final, _ = final_of(case, np.array([0, 3, 5, 7]), design)
    names = [v.name for v in reduced.variables]
    assert len(set(names)) == len(names)
    gap = case.space.named(design)["slack"]
    law = {g.name: g.laws for g in final.members}
    assert [law[n][0].gap for n in ("port_0", "star_1", "port_3", "star_3")] == [gap[0], gap[1], gap[3], gap[3]]
    assert same_motion(reduced, own, final, final.start) < 1e-9


@pytest.mark.parametrize("more", [{}, {"solver.settle": "true"}])
def test_a_value_that_fixed_members_have_too_survives(more: dict[str, str]) -> None:
    both = "{group: [star, legs], parameter: stiffness, each: member, initial: 5000, lower: 1000, upper: 9000}"
    legs = "{from: left, to: {body: truck, at: [0.2, -1]}, law: {type: spring, stiffness: 3000, damping: 90}, "
    ground = "[{type: fixed, bodies: [truck, ground], at: [0, -1]}]"
    case = read_case(
        PARTS.replace("members:\n", f"members:\n  legs: {legs}design: false}}\n").replace(
            "gap: 0.01}, cost", "gap: 0.0}, cost"
        ),
        overrides={
            "design.variables": f"{{both: {both}}}",
            "constraints": "[{volume: all, limit: 9}]",
            "loads": "[{body: crate, force: [[0, 0, 0], [0.1, 200, 50]]}]",
            "joints": ground,
            **more,
        },
    )
    design = design_of(case)
    kept = np.array([0, 2, 4, 6])
    assert unlike(case, kept) == {"star", "legs"}
    reduced, own, final, told = final_of(case, kept, design)
    assert told == []
    stiff = design[8:]
    law = {g.name: g.laws[0] for g in final.members}
    assert [law[f"legs_{k}"].stiffness for k in range(4)] == list(stiff)
    assert [law[f"star_{k}"].stiffness for k in (0, 2)] == [design[4] * stiff[0], design[6] * stiff[2]]
    assert same_motion(reduced, own, final, final.start) < 1e-9
    whole = Evaluator(reduced).evaluate(own)
    assert Evaluator(final).evaluate(final.start).objectives["slide"] == pytest.approx(
        whole.objectives["slide"], rel=1e-9
    )


def test_groups_taken_apart_are_the_same_problem() -> None:
    case = load_case("parts.yaml", {"design.mirrored": "[[port, star]]", "design.shared": "[star]"})
    single = apart(case, {"port", "star"})
    design = design_of(case)
    design[:8] = 0.4
    assert len(single.members) == 9
    once, twice = (each.space.expand(each.space.reduce(design)) for each in (case, single))
    assert np.array_equal(once, twice)
    assert single.space.size == case.space.size == 1 + 4 + 2 + 1 + 1
    one, two = Evaluator(case).evaluate(design), Evaluator(single).evaluate(design)
    assert two.objectives["slide"] == pytest.approx(one.objectives["slide"], rel=1e-12)
    assert two.gradients["slide"] == pytest.approx(one.gradients["slide"], rel=1e-8)
    by = [np.concatenate(list(each.variable_gradients["slide"].values())) for each in (one, two)]
    assert by[1] == pytest.approx(by[0], rel=1e-8, abs=1e-10 * np.abs(by[0]).max())
    assert two.constraints == pytest.approx(one.constraints, rel=1e-13)
    for row, other in zip(case.constraints, single.constraints, strict=True):
        assert isinstance(row, VolumeRow)
        assert isinstance(other, VolumeRow)
        assert other.spent(design) == row.spent(design)


def test_what_looks_at_a_group_taken_apart_is_refused() -> None:
    case = load_case("parts.yaml", {"objectives.slide.response": "{member_force: {group: star}}"})
    design = design_of(case)
    design[:8] = [0.9, 0.1, 0.1, 0.9, 0.1, 0.9, 0.1, 0.9]
    with pytest.raises(CaseError, match=r"objectives\.slide: it looks at the members of 'star', of which others"):
        ready(case, design, None, 0.5)
    design[:8] = [0.1, 0.9, 0.1, 0.9, 0.1, 0.9, 0.1, 0.9]
    assert ready(case, design, None, 0.5)[0].tolist() == [1, 3, 5, 7]


def test_what_the_refusal_of_a_group_taken_apart_says_to_do_helps(capsys) -> None:
    forces = [
        "--set",
        "objectives.slide.response={member_force: {group: star}}",
        "--set",
        "objectives.slide.over_time=max",
    ]
    assert call(capsys, "run", "parts.yaml", "--out", "run.h5", "--quiet", *forces)[0] == 0
    status, _, err = call(capsys, "finalize", "run.h5", "--keep", "5")
    assert status == 2
    assert "keep the same, with --set design.mirrored=[[port, star]], or give" in " ".join(err.split())
    words = ["--set", "design.mirrored=[[port, star]]", "--json"]
    status, out, err = call(capsys, "finalize", "run.h5", "--keep", "1", *words)
    assert status == 0, err
    told = json.loads(out)
    ((group, one), (_, other)) = ((each["group"], each["member"]) for each in told["kept"])
    assert (group, one) == ("port", other)
    final = load_case("run.final.yaml")
    found = Evaluator(final).evaluate(final.start)
    assert found.objectives["slide"] == pytest.approx(told["designs"][2]["objectives"]["slide"], rel=1e-9)


def test_alphas_that_are_one_are_kept_together(capsys) -> None:
    slots = one_alpha(load_case("parts.yaml", {"design.mirrored": "[[port, star]]"}))
    alpha = np.array([0.1, 0.7, 0.5, 0.5] * 2)
    assert [chosen(alpha, k, None, slots).tolist() for k in (1, 2, 3)] == [[1, 5], [1, 5], [1, 2, 5, 6]]
    assert chosen(alpha, None, 0.5, slots).tolist() == [1, 2, 3, 5, 6, 7]
    words = ["--set", "design.mirrored=[[port, star]]", "--quiet"]
    assert call(capsys, "run", "parts.yaml", "--out", "run.h5", *words)[0] == 0
    status, out, err = call(capsys, "finalize", "run.h5", "--keep", "3", "--json")
    assert status == 0, err
    assert "1 more members are kept: they have one alpha (`shared`, `mirrored`) with the others" in err
    told = json.loads(out)
    sizes = {(each["group"], each["member"]): each["alpha"] for each in told["kept"]}
    assert len(sizes) == 4
    for group, k in sizes:
        assert sizes[group, k] == sizes["star" if group == "port" else "port", k]
    slack = [each["member"] for each in told["variables"] if each["name"] == "slack"]
    assert slack == sorted({k for _, k in sizes})
    final = load_case("run.final.yaml")
    found = Evaluator(final).evaluate(final.start)
    assert found.objectives["slide"] == pytest.approx(told["designs"][2]["objectives"]["slide"], rel=1e-9)
    assert told["difference"] < 1e-9


def test_a_shared_group_is_kept_or_not(capsys) -> None:
    words = ["--set", "design.shared=[straps]", "--quiet", "--set", "constraints[0].equals=9"]
    assert call(capsys, "run", "stiffness.yaml", "--out", "run.h5", *words)[0] == 0
    status, out, err = call(capsys, "finalize", "run.h5", "--keep", "2", "--json")
    assert status == 0, err
    told = json.loads(out)
    assert len(told["kept"]) == 12
    assert len({each["alpha"] for each in told["kept"]}) == 1


def test_a_case_without_members_to_choose_is_finalized_whole(capsys) -> None:
    words = ["--set", "members.port.design=false", "--set", "members.star.design=false", "--quiet"]
    assert call(capsys, "run", "parts.yaml", "--out", "run.h5", *words)[0] == 0
    status, out, err = call(capsys, "finalize", "run.h5", "--threshold", "0.1", "--json")
    assert status == 0, err
    told = json.loads(out)
    final = load_case("run.final.yaml")
    assert final.n_design == 0
    assert len(final.members) == 10
    found = Evaluator(final).evaluate(final.start)
    assert found.objectives["slide"] == pytest.approx(told["designs"][2]["objectives"]["slide"], rel=1e-9)
    assert all("parameters of laws, which are numbers now" in each for each in told["warnings"])


def test_a_law_whose_end_came_before_its_beginning_never_acts() -> None:
    case = load_case("parts.yaml", {"members.feet.law[0].active_until": "0.03"})
    design = design_of(case)
    design[case.space.parts["onset"]] = [0.01, 0.04]
    reduced, own, final, _ = final_of(case, np.arange(8), design)
    law = {g.name: g.laws[0] for g in final.members if not g.design}
    assert (law["feet_0"].active_from, law["feet_0"].active_until) == (0.01, 0.03)
    assert (law["feet_1"].active_from, law["feet_1"].active_until) == (0.2, None)
    assert same_motion(reduced, own, final, final.start) < 1e-9


def test_a_law_that_would_end_when_it_begins_is_written_so_that_it_can_be_read() -> None:
    case = load_case("parts.yaml")
    stated = {"type": "spring", "stiffness": 3000.0, "active_from": 0.03, "active_until": 0.03}
    assert with_valid_times(stated, case) == {"type": "spring", "stiffness": 3000.0, "active_from": 0.2}
    with pytest.raises(CaseError, match="active_until"):
        read_case(TIMED.replace("LAW", "{type: spring, stiffness: 3000, active_from: 0.03, active_until: 0.03}"))


def test_a_row_used_up_beside_costly_values_stays_so() -> None:
    row = VolumeRow(("a",), np.array([0.1, 0.2]), 40.0, "equals", np.array([1.0]))
    design = np.array([1.0, 0.5, 39.8 + 7e-15])
    assert bound_of(row, 2, design) == 0.2
    assert bound_of(row, 2, np.array([1.0, 0.5, 30.0])) == 10.0
    assert bound_of(VolumeRow(("a",), np.array([0.1]), 40.0, "limit"), 1, np.array([1.0])) == 40.0


def test_values_that_the_case_has_no_more_are_refused(capsys) -> None:
    assert call(capsys, "run", "stiffness.yaml", "--out", "run.h5", "--quiet")[0] == 0
    status, _, err = call(capsys, "finalize", "run.h5", "--keep", "5", "--set", "design={initial: 0.2}")
    assert status == 2
    assert "it holds values of the design variable k; the case has none" in err


def test_the_table_has_the_values(capsys) -> None:
    words = ["--set", "optimizer.max_iterations=2", "--quiet"]
    assert call(capsys, "run", "parts.yaml", "--out", "run.h5", *words)[0] == 0
    status, out, _ = call(capsys, "finalize", "run.h5", "--keep", "4")
    assert status == 0
    rows = [line.strip().split("  ")[0] for line in out.splitlines()]
    assert [row for row in rows if row.startswith(("slack", "onset", "kick", "k,"))] == [
        "slack, m",
        "onset, s",
        "kick, N",
        "k, N/m",
    ]
