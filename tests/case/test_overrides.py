"""Keys set from outside the file."""

from __future__ import annotations

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.scene.refusals import refusals

from .scenes import SMALL, mistakes


def test_an_override_replaces_a_key_or_makes_it() -> None:
    case = read_case(
        SMALL,
        overrides={
            "solver.integrator": "generalized_alpha",
            "members.belts.law.stiffness": "1e3",
            "constraints[0].equals": "4",
            "bodies.a.position": "[0, 0.5]",
            "objectives.H": "{response: energy, over_time: mean}",
            "combine.weights": "{G: 1, H: 3}",
        },
    )
    assert case.solver.integrator == "generalized_alpha"
    assert case.members[0].laws[0].stiffness == 1e3  # type: ignore[attr-defined]
    assert case.constraints[0].bound == 4
    assert case.bodies[0].position == (0.0, 0.5)
    assert [o.name for o in case.objectives] == ["G", "H"]
    assert case.text == SMALL
    assert case.overrides["constraints[0].equals"] == "4"


def test_values_may_be_python_objects() -> None:
    overrides = {
        "solver.tolerance": 1e-6, "solver.assemble": False, "bodies.a.mass": np.float64(7), "title": "1e3",
        "bodies.a.position": np.array([1.0, 2.0]), "constraints.0": {"volume": "all", "limit": 3},
        "optimizer.seed": 3,
    }  # fmt: skip
    overrides["title"] = '"1e3"'
    case = read_case(SMALL, overrides=overrides)
    assert (case.solver.tolerance, case.bodies[0].mass, case.bodies[0].position) == (1e-6, 7.0, (1.0, 2.0))
    assert (case.title, case.optimizer.seed, case.constraints[0].sense) == ("1e3", 3, "limit")
    assert read_case(SMALL, overrides=case.overrides) == case  # the text kept is as good as the value


def test_a_number_with_a_unit_needs_no_quotation_marks_that_a_shell_takes_away() -> None:
    units = {"bodies.a.mass": "7000 g", "bodies.a.position": "[20 cm, 1]", "time": "{end: 300 ms}", "title": "3 kg"}
    case = read_case(SMALL, overrides=units)
    assert (case.bodies[0].mass, case.bodies[0].position, case.load_cases[0].end) == (7.0, (0.2, 1.0), 0.3)
    assert case.title == "3 kg"
    assert read_case(SMALL, overrides=case.overrides) == case


@pytest.mark.parametrize("value", ["null", None])
def test_null_removes_a_key_as_in_a_case_that_extends_another(value: str | None) -> None:
    text = SMALL.replace("to: q,", "to: q, max_length: 2.5,")
    without = read_case(text, overrides={"constraints": value, "members.belts.max_length": value})
    assert len(without.members[0]) == len(read_case(SMALL).members[0]) > len(read_case(text).members[0])
    assert read_case(SMALL).constraints
    assert without.constraints == ()
    assert read_case(text, overrides=without.overrides) == without
    found = mistakes(SMALL, {"bodies.a.mass": value})
    assert [m.message for m in found] == ["the key 'mass' is missing (mass, in kg)"]


@pytest.mark.parametrize(
    ("key", "path", "hint"),
    [
        ("members.belts.laws", "members.belts.laws", ", did you mean 'law'?"),
        ("membrs.belts.max_length", "membrs", ", did you mean 'members'?"),
        ("uncertainty.sample", "uncertainty", ""),
        ("combine.weights.G", "combine", ""),
    ],
)
@pytest.mark.parametrize("value", ["null", None])
def test_null_for_a_key_that_is_not_there_is_refused(value: str | None, key: str, path: str, hint: str) -> None:
    found = mistakes(SMALL, {key: value})
    assert [(m.path_key, m.message) for m in found] == [(path, f"there is no such key to remove{hint}")]
    assert found[0].located("x.yaml").startswith(f"--set {key}: ")


def test_null_in_braces_and_for_an_item_of_a_list_removes_nothing() -> None:
    assert [m.path_key for m in mistakes(SMALL, {"constraints[0]": "null"})] == ["constraints[0]"]
    assert [m.path_key for m in mistakes(SMALL, {"bodies.a": "{mass: null, inertia: 3, position: [0, 0]}"})] == [
        "bodies.a.mass"
    ]


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("solver.integrator", "gaus", ["'gaus'", "'gauss'"]),
        ("solvr.integrator", "gauss", ["'solvr'", "'solver'"]),
        ("bodies.a.mass", -1, ["-1", "> 0"]),
        ("bodies.a.mass", float("nan"), [".nan", "finite"]),
        ("bodies.a.mass", 10**400, ["finite"]),
        ("bodies.a.mass.x", "1", ["single value"]),
        ("bodies[0]", "1", ["mapping"]),
        ("constraints[1].equals", "1", ["list of 1", "below 1"]),
        ("constraints.first.equals", "1", ["'first'"]),
        ("", "1", ["key path"]),
        ("a..b", "1", ["key path"]),
        (".a", "1", ["key path"]),
        ("a[", "1", ["key path"]),
        ("title", "[1, 2", ["YAML"]),
        ("title", "&a [*a]", ["alias"]),
        ("title", "\ud800", ["UTF-8"]),
        ("title", "", ["nothing"]),
        ("title", b"x", ["x"]),
        ("title", object, ["x"]),
    ],
)
def test_a_mistake_in_an_override_is_placed_at_the_option(key: str, value: object, words: list[str]) -> None:
    if words == ["x"]:  # any object is at least text: nothing but CaseError may be raised
        read_case(SMALL, overrides={key: value})
        return
    found = mistakes(SMALL, {key: value})
    assert all(m.located("x.yaml").startswith(f"--set {key}: ") for m in found)
    for word in words:
        assert any(word in m.message for m in found)


def test_mistakes_of_the_file_come_before_those_of_overrides() -> None:
    with pytest.raises(CaseError) as caught:
        read_case(SMALL.replace("mass: 4", "mass: -4"), path="x.yaml", overrides={"bodies.a.mass": "-1"})
    first, second = str(caught.value).split("\n")
    assert first.startswith("x.yaml:5:13: bodies.b.mass: ")
    assert second.startswith("--set bodies.a.mass: bodies.a.mass: ")


def test_an_override_leaves_aliases_of_the_same_value_alone() -> None:
    text = SMALL.replace("mass: 2, inertia: 3, position: [0, 0]", "mass: 2, inertia: 3, position: &p [0, 0]")
    text = text.replace("force: [1, 0]", "force: [1, 0], at: *p")
    case = read_case(text, overrides={"bodies.a.position[0]": "9"})
    assert case.bodies[0].position == (9.0, 0.0)
    assert case.load_cases[0].loads[0].at_local == (-2.0, 0.0)


def test_a_refusal_of_an_overridden_key_names_the_option() -> None:
    overrides = {"members.belts.law": "{type: inerter, inertance: 1}", "solver.integrator": "gauss"}
    (refusal,) = refusals(read_case(SMALL, overrides=overrides))
    assert refusal.located("x.yaml").startswith("--set solver.integrator: solver.integrator: gauss does not compute")
    assert "the law inerter" in refusal.message
