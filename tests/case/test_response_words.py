"""A response that is none: what is allowed is told as a whole, and where material belongs."""

import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.responses.response_kinds import RESPONSES
from mdstopo.case.responses.spatial_responses import SPATIAL_RESPONSES
from mdstopo.case.text.errors import CaseError

CASE = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
members: {m: {from: {body: ground, at: [0, 1]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 5}}}
objectives:
  G: {%s}
"""
IN_SPACE = (
    CASE.replace("format: 1", "format: 1\ndimension: 3").replace(", 1]", ", 1, 0]").replace("0]}, law", "0, 0]}, law")
)
IN_SPACE = IN_SPACE.replace("inertia: 1, position: [0, 0]", "inertia: [1, 1, 1], position: [0, 0, 0]")


def told(objective: str, case: str = CASE) -> str:
    with pytest.raises(CaseError) as refused:
        read_case(case % objective)
    return str(refused.value)


@pytest.mark.parametrize("objective", ["response: enrgi", "response: {stres: {body: a}}", "response: {}"])
@pytest.mark.parametrize(("case", "kinds"), [(CASE, RESPONSES), (IN_SPACE, SPATIAL_RESPONSES)])
def test_a_wrong_response_names_all_that_there_are(objective: str, case: str, kinds: dict[str, object]) -> None:
    message = told(objective, case)
    assert [word for word in kinds if word not in message] == []


def test_energy_with_keys_is_told_to_stand_alone() -> None:
    assert "unknown key 'energy': it stands alone: `response: energy`" in told("response: {energy: {group: m}}")


@pytest.mark.parametrize("word", ["volume", "mass", "material"])
@pytest.mark.parametrize("objective", ["response: {}", "response: {{{}: {{group: m}}}}", "{}: all"])
def test_material_as_an_objective_is_told_where_it_belongs(word: str, objective: str) -> None:
    message = told(objective.format(word))
    assert "which a constraint bounds, such as {volume: all, limit: 10}" in message
    assert "least-material" in message
