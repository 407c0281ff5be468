"""The section `uncertainty` is read, and what is wrong in it is refused at its place, by name."""

import json
import re

import pytest

from mdstopo.case.methods.number_distributions import Normal
from mdstopo.case.objects.uncertain import Measure
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.evaluators import evaluator_of
from mdstopo.store.same_case import describe, differences
from tests.robust.scenes import PARAMETERS, SCENARIOS, read, scene, text, uncertain

BOUND = {"response": {"angle": {"body": "torso"}}, "over_time": "max_abs", "limit": 0.5}


def refused(section, overrides=None, **changes):
    with pytest.raises(CaseError) as caught:
        read(section, overrides, **changes)
    return [(mistake.path_key, mistake.message) for mistake in caught.value.mistakes]


def test_defaults_and_nominal_values():
    case = read({"parameters": PARAMETERS})
    found = case.uncertainty
    assert (found.sample, found.seed, found.validation) == (64, 0, 256)
    assert found.objectives["G"] == Measure("mean")
    assert [(number.key, number.nominal) for number in found.numbers] == [
        ("bodies.torso.mass", 60.0),
        ("members.belts.law.stiffness", 4000.0),
        ("loads[0].angular_acceleration", 20.0),
    ]
    assert found.numbers[0].distribution == Normal(60.0, 6.0)


def test_a_nominal_value_that_is_set_from_outside_counts():
    case = read({"parameters": PARAMETERS}, {"bodies.torso.mass": 50})
    assert case.uncertainty.numbers[0].distribution.mean == 50.0
    assert case.body("torso").mass == 50.0


def test_constraints_have_their_default_measures():
    rows = [{"volume": "all", "limit": 9}, BOUND, {**BOUND, "limit": None, "equals": 0.1}]
    rows[2].pop("limit")
    case = read({"parameters": PARAMETERS, "constraints": {"1": {"measure": "quantile"}}}, constraints=rows)
    assert case.uncertainty.constraints == {1: Measure("quantile", level=0.9), 2: Measure("mean")}


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("bodies.torsso.mass", "bodies states no 'torsso', did you mean 'torso'?"),
        ("body.torso.mass", "the case states no 'body'"),
        ("bodies.torso.angle", "bodies.torso states no 'angle'"),
        ("bodies.torso", "found a mapping with 'mass', 'inertia', 'position' at bodies.torso; a distribution belongs"),
        ("bodies.torso.position", "found a list of 2 at bodies.torso.position; a distribution belongs to one number"),
        ("bodies.torso.position[2]", "bodies.torso.position is a list of 2; '2' is none of its places"),
        ("loads[0].body", "found the text 'vehicle' at loads[0].body"),
        ("loads[0].body.mass", "loads[0].body is a single value; 'mass' is not in it"),
        ("loads[", "is no key path"),
        ("points.edge.grid.rectangle.count", "cannot be uncertain: `count` decides which members there are"),
        ("format", "cannot be uncertain: `format` is the format's version"),
        ("uncertainty.sample", "cannot be uncertain"),
        ("constraints[0].equals", "cannot be uncertain: a volume is as certain as the design"),
    ],
)
def test_a_key_that_is_no_number_of_the_scene_is_refused(key, words):
    (found,) = refused(uncertain(parameters={key: {"normal": {"deviation": 1}}}))
    assert words in found[1]
    assert found[0].startswith("uncertainty.parameters")


@pytest.mark.parametrize(
    ("distribution", "key", "words"),
    [
        ({"normal": {"deviation": 0}}, "normal.deviation", "found 0, allowed is a number > 0"),
        ({"normal": {"mean": 3}}, "normal", "the key 'deviation' is missing"),
        ({"normal": {"deviation": 1, "from": 70, "to": 60}}, "normal.to", "allowed is a number above 70"),
        ({"normal": {"deviation": 1, "from": 90}}, "normal", "hardly any probability of the distribution"),
        ({"uniform": {"from": 2, "to": 2}}, "uniform.to", "found 2, allowed is a number above 2"),
        ({"lognormal": {"mean": -1, "deviation": 1}}, "lognormal.mean", "found -1, allowed is a number > 0"),
        ({"discrete": [[1, 0.5], [2, 0.4]]}, "discrete", "found probabilities of sum 0.9"),
        ({"discrete": [[1, 1.5], [2, -0.5]]}, "discrete", "allowed are such >= 0 of sum 1"),
        ({"normal": {"deviation": 1}, "uniform": {"from": 0, "to": 1}}, "", "needed is exactly one of"),
        ({"gauss": {"deviation": 1}}, "gauss", "unknown key 'gauss'"),
    ],
)
def test_a_distribution_that_is_none_is_refused(distribution, key, words):
    found = refused(uncertain(parameters={"bodies.torso.mass": distribution}))
    assert any(words in message for _, message in found)
    path = "uncertainty.parameters.'bodies.torso.mass'" + (f".{key}" if key else "")
    assert any(each == path for each, _ in found)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"scenarios": {"a": {"probability": 0.5}, "b": {}}}, "the probability of b is missing"),
        ({"scenarios": {"a": {"probability": 0.5}, "b": {"probability": 0.3}}}, "found probabilities of sum 0.8"),
        ({"scenarios": {"a": {"set": {"bodies.torso.mass": 3}}}}, "bodies.torso.mass has a distribution; it varies"),
        ({"scenarios": {"a": {"set": {"design.upper": 0.5}}}}, "cannot be uncertain: `design` says what is designed"),
        ({"scenarios": {"a": {"set": {"members.belts.min_length": 1}}}}, "`min_length` decides which members there"),
        ({"scenarios": {"all": {}}}, "the name 'all' is taken"),
        ({"objectives": {"H": {"measure": "mean"}}}, "no objective is called 'H'"),
        ({"objectives": {"G": {"measure": "wurst"}}}, "found the text 'wurst', did you mean 'worst'?"),
        ({"objectives": {"G": {"measure": "mean", "factor": 2}}}, "factor belongs to mean_deviation, not to mean"),
        ({"objectives": {"G": {"measure": "quantile", "level": 1.5}}}, "found 1.5, allowed is a number > 0 and <= 1"),
        ({"constraints": {"0": {"measure": "worst"}}}, "constraints[0] bounds a volume"),
        ({"constraints": {"7": {"measure": "worst"}}}, "found '7', allowed is a place below 1"),
        ({"validation": 10}, "found 10, allowed is 0 or at least 30"),
        ({"sample": 1}, "found 1, allowed is a whole number >= 2"),
        ({"parameters": None}, "needed is at least one of parameters, scenarios"),
        ({"parameters": {}}, "found {}, needed is at least one key of the case"),
        ({"sede": 3}, "unknown key 'sede', did you mean 'seed'?"),
    ],
)
def test_what_does_not_make_sense_is_refused(changes, words):
    messages = [message for _, message in refused(uncertain(**changes))]
    assert any(words in message for message in messages), messages


def test_an_equality_cannot_hold_at_every_point():
    rows = [{**BOUND, "equals": 0.1}]
    rows[0].pop("limit")
    (found,) = refused(uncertain(constraints={"0": {"measure": "worst"}}), constraints=rows)
    assert "allowed is mean or nominal: not every value can equal a bound" in found[1]


def test_mistakes_are_told_where_they_stand():
    written = "format: 1\n" + "\n".join(
        f"{key}: {json.dumps(value)}" for key, value in scene().items() if key != "format"
    )
    from mdstopo.case.reader import read_case

    with pytest.raises(CaseError) as caught:
        read_case(written + "\nuncertainty:\n  parameters:\n    bodies.torsso.mass: {normal: {deviation: 1}}\n")
    (mistake,) = caught.value.mistakes
    line = written.count("\n") + 4
    assert (mistake.line, mistake.column) == (line, 25)


def test_a_case_that_is_none_at_a_point_is_refused_with_the_point():
    case = read(uncertain(parameters={"bodies.torso.mass": {"normal": {"deviation": 60}}}, sample=16))
    with pytest.raises(CaseError) as caught:
        evaluator_of(case)
    words = str(caught.value)
    place = r"uncertainty\.parameters\.'bodies\.torso\.mass'"
    assert re.search(place + r": at point \d+ of the sample \(bodies\.torso\.mass = -", words)
    assert "bodies.torso.mass: found -" in words


def test_other_members_at_a_point_are_refused():
    members = {"belts": {**scene()["members"]["belts"], "max_length": 1.2}}
    moved = {"points.edge.grid.rectangle.center[0]": {"uniform": {"from": -0.3, "to": 0.3}}}
    with pytest.raises(CaseError, match=r"the group belts has .* a design would not fit both"):
        evaluator_of(read(uncertain(parameters=moved), members=members))


VARIED = {"power": 1, "variables": {"k": {"group": "belts", "parameter": "stiffness", "lower": 3000, "upper": 5000}}}


@pytest.mark.parametrize(
    "section",
    [
        {"parameters": {"members.belts.law.stiffness": {"normal": {"deviation": 400}}}},
        {"scenarios": {"soft": {"set": {"members.belts.law.stiffness": 3500}}}},
    ],
)
def test_what_the_design_decides_is_not_uncertain(section):
    (found,) = refused(section, design=VARIED)
    assert "it is the design variable k" in found[1]


SOFT = {"type": "spring", "stiffness": 3500}
HALVES = {name: {**scene()["members"]["belts"], "design": name == "belts"} for name in ("belts", "straps")}


@pytest.mark.parametrize(
    ("stated", "words", "changes"),
    [
        ({"members.belts.law": SOFT}, "it is the design variable k", {"design": VARIED}),
        ({"members.belts.design": False, "members.straps.design": True}, "belts is fixed", {"members": HALVES}),
        ({"objectives.G.over_time": "mean"}, "the objective G asks for something else", {}),
        ({"constraints[1].over_time": "final"}, "constraints[1] limits something else", {}),
    ],
)
def test_a_scenario_that_poses_another_problem_is_refused_before_anything_runs(stated, words, changes):
    rows = [{"volume": "all", "limit": 6}, BOUND]
    case = read({"scenarios": {"usual": {}, "other": {"set": stated}}}, **{"constraints": rows, **changes})
    with pytest.raises(CaseError) as caught:
        evaluator_of(case)
    assert words in str(caught.value)
    assert "uncertainty.scenarios.other" in str(caught.value)


@pytest.mark.parametrize("key", ["constraints", "objectives", "constraints[1]", "objectives.G"])
def test_a_scenario_sets_no_whole_aims(key):
    value = [BOUND] if key == "constraints" else {"response": "energy"}
    rows = [{"volume": "all", "limit": 6}, BOUND]
    (found,) = refused({"scenarios": {"other": {"set": {key: value}}}}, constraints=rows)
    assert "only single numbers in" in found[1]


def test_what_has_a_distribution_is_not_set_as_part_of_a_whole():
    whole = {"bodies.torso": {"mass": 30, "inertia": 10, "position": [0, 0]}}
    (found,) = refused(uncertain(scenarios={"light": {"set": whole}}))
    assert found[1] == "bodies.torso.mass has a distribution; it varies by itself or by scenario, not both"


def test_as_many_but_other_members_at_a_point_are_refused():
    members = {"belts": {**scene()["members"]["belts"], "max_length": 1.2}}
    points = {
        "edge": {"body": "torso", "grid": {"list": [[0, 0]]}},
        "deck": {"body": "vehicle", "grid": {"list": [[-0.5, -1], [1.5, -1]]}},
    }
    other = {"points.deck.grid.list": [[-1.5, -1], [0.5, -1]]}
    section = {"scenarios": {"usual": {}, "other": {"set": other}}}
    case = read(section, members=members, points=points, constraints=[])
    assert len(case.members[0]) == 1
    with pytest.raises(CaseError, match="the group belts has as many members, but others"):
        evaluator_of(case)


def test_joints_that_come_apart_at_a_point_are_refused_with_the_point():
    joint = [{"type": "revolute", "bodies": ["torso", "vehicle"], "at": [0, -0.5]}]
    speeds = {"bodies.torso.velocity[0]": {"uniform": {"from": 0.5, "to": 1.5}}}
    bodies = {name: {**body, "velocity": [1, 0]} for name, body in scene()["bodies"].items()}
    with pytest.raises(CaseError, match=r"at point \d+ of the sample .*velocit"):
        evaluator_of(read(uncertain(parameters=speeds, sample=2), joints=joint, bodies=bodies))


def test_what_is_set_from_outside_yields_to_the_point():
    whole = {"bodies.torso.mass": 61, "bodies.torso": {"mass": 60, "inertia": 10, "position": [0, 0]}}
    case = read(uncertain(parameters={"bodies.torso.mass": {"discrete": [[50, 0.5], [70, 0.5]]}}, sample=8), whole)
    found = {evaluator.case.bodies[0].mass for i, evaluator in evaluator_of(case).points.items() if i >= 0}
    assert found == {50.0, 70.0}


def test_the_quantile_of_level_1_is_the_worst():
    case = read(uncertain({"measure": "quantile", "level": 1}))
    assert case.uncertainty.objectives["G"] == Measure("worst")


def test_without_distributions_what_belongs_to_a_sample_is_ignored_with_a_warning():
    case = read(uncertain(parameters=None, scenarios=SCENARIOS))
    assert sorted(warning.path_key for warning in case.warnings) == ["uncertainty.sample", "uncertainty.validation"]


def test_a_certain_case_is_described_as_before_and_the_section_is_compared():
    certain, one = read({"parameters": PARAMETERS}), read({"parameters": PARAMETERS, "sample": 16})
    assert differences(describe(certain), one) == ("uncertainty.sample",)
    from mdstopo.case.reader import read_case

    plain = read_case(json.dumps(scene()))
    assert "uncertainty" not in describe(plain)
    assert text(uncertain()) != json.dumps(scene())


@pytest.mark.parametrize(
    "stated",
    [
        {"loads[0].acceleration": [{"table": {"file": "wave.csv"}}, 0]},
        {"loads[0].acceleration": [{"table": {"file": "missing.csv"}}, 0], "points.deck.grid.file": "wave.csv"},
    ],
)
def test_files_that_scenarios_name_are_part_of_the_case(tmp_path, stated):
    (tmp_path / "wave.csv").write_text("0, 1\n1, 2\n")
    section = {"scenarios": {"calm": {}, "storm": {"set": stated}}}
    case = read_case(text(section), path=tmp_path / "case.yaml")
    assert list(case.files) == ["wave.csv"]
    before = case.files["wave.csv"]
    (tmp_path / "wave.csv").write_text("0, 1\n1, 3\n")
    assert read_case(text(section), path=tmp_path / "case.yaml").files["wave.csv"] != before


def test_a_lognormal_deviation_whose_square_is_too_large_for_a_number_is_refused_at_its_place():
    section = {"parameters": {"bodies.torso.mass": {"lognormal": {"deviation": 1e300}}}}
    ((place, told),) = refused(section)
    assert place == "uncertainty.parameters.'bodies.torso.mass'.lognormal.deviation"
    assert told == "found 1e+300, allowed is at most 1e+100 times the mean 60"
