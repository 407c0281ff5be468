"""`design.variables` in a case file: what is taken, and what is refused at its place."""

import pytest

from mdstopo.case.laws import LAWS
from mdstopo.case.laws.law import with_role
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.mechanics.laws.law_table import COMMON, kernels_of, place_of

SCENE = """
format: 1
time: {end: 1}
bodies: {m: {mass: 1, inertia: 1, position: [0, 0]}}
points: {two: {body: ground, grid: {list: [[1, 0], [2, 0]]}}}
members:
  belt: {from: two, to: {body: m, at: [0, 0]}, law: {type: spring, stiffness: 5}, design: false}
  both:
    from: {body: ground, at: [1, 1]}
    to: {body: m, at: [0, 0]}
    law: [{type: spring, stiffness: 5}, {type: gap, stiffness: 7, gap: 0.1}]
  motor: {from: two, to: {body: m, at: [0, 0]}, law: {type: actuator, proportional: 3}}
  curved: {from: two, to: {body: m, at: [0, 0]}, law: {type: curve, curve: [[0, 0], [1, 2]]}}
objectives: {G: {response: energy}}
design: {variables: {x: {VARIABLE}}}
constraints: [{volume: ROW, limit: LIMIT}]
"""


def read(variable, row="all", limit="100"):
    return read_case(SCENE.replace("VARIABLE", variable).replace("ROW", row).replace("LIMIT", limit))


def test_the_engine_has_a_place_for_every_parameter_that_can_vary():
    for law in LAWS.values():
        names = with_role(law, "varies")
        places = [place_of(law, name) for name in names]
        assert len(set(places)) == len(names)
        kernels = kernels_of(law)
        assert set(names) <= set(COMMON) or kernels.slopes is not None or kernels.inertial, law


def test_what_is_left_out_is_taken_from_the_law_and_the_only_law_that_has_the_parameter_is_meant():
    (variable,) = read("group: both, parameter: gap, lower: 0, upper: 1").variables
    assert (variable.laws, variable.initial, variable.count, variable.unit) == ((1,), 0.1, 1, "m")
    (variable,) = read("group: belt, parameter: stiffness, each: member, lower: 1, upper: 9, cost: 2").variables
    assert (variable.initial, variable.count) == (5.0, 2)


def test_a_group_without_alpha_is_in_a_volume_row_where_its_variables_cost_something():
    case = read("group: belt, parameter: stiffness, each: member, lower: 1, upper: 9, cost: 2", "belt", "30")
    (row,) = case.constraints
    assert row.prices.tolist() == [2.0, 2.0]
    assert not row.coefficients.any()
    assert row.spent(case.start) == 20.0


@pytest.mark.parametrize(
    ("variable", "place", "words"),
    [
        ("group: nobody, parameter: gap, lower: 0, upper: 1", "group", "no member group is called 'nobody'"),
        ("group: belt, parameter: gap, lower: 0, upper: 1", "parameter", "can be varied in no law of 'belt' (spring)"),
        ("group: belt, parameter: stifness, lower: 0, upper: 1", "parameter", "did you mean 'stiffness'?"),
        ("group: both, parameter: stiffness, lower: 0, upper: 9", "parameter", "say which with `law`, one of 0, 1"),
        ("group: both, parameter: gap, law: 0, lower: 0, upper: 9", "parameter", "no law of 'both' (spring)"),
        ("group: both, parameter: gap, law: 2, lower: 0, upper: 9", "law", "found 2, 'both' has 0 to 1"),
        ("group: belt, parameter: stiffness, lower: -1, upper: 9", "lower", "stiffness is a number >= 0"),
        ("group: belt, parameter: stiffness, lower: 7, upper: 9", "initial",
         "found 5 (the law's own), allowed is 7 to 9"),
        ("group: belt, parameter: stiffness, lower: 9, upper: 7", "lower", "allowed is at most upper 7"),
        ("group: belt, parameter: free_length, lower: 1, upper: 2", "", "the key 'initial' is missing"),
        ("group: motor, parameter: limit, initial: 1, lower: 0, upper: 2", "lower", "limit is a number > 0"),
        ("group: [belt, both], parameter: free_length, law: 0, each: member, initial: 1, lower: 1, upper: 2", "each",
         "belt has 2, both has 1; member k of each has the same value"),
        ("group: [belt, belt], parameter: damping, lower: 0, upper: 2", "group", "'belt' is in the list twice"),
        ("group: belt, parameter: damping, lower: 0", "", "the key 'upper' is missing"),
        ("group: belt, parameter: damping, lower: 0, upper: 1}, "
         "y: {group: belt, parameter: damping, lower: 0, upper: 1", "parameter",
         "damping of 'belt' is varied by 'x' already"),
    ],
)  # fmt: skip
def test_what_cannot_vary_is_refused_at_its_place(variable, place, words):
    with pytest.raises(CaseError) as caught:
        read(variable)
    name = "y" if "y: {" in variable else "x"
    path = f"design.variables.{name}.{place}".rstrip(".")
    found = [(mistake.path_key, mistake.message) for mistake in caught.value.mistakes]
    assert any(own == path and words in message for own, message in found), found


def test_rows_that_costs_make_infeasible_are_refused():
    with pytest.raises(CaseError, match="at the lower bounds the sum is 20 already"):
        read("group: belt, parameter: stiffness, each: member, lower: 5, upper: 9, cost: 2", "belt", "12")


def test_an_objective_cannot_have_the_name_under_which_results_keep_variables():
    text = SCENE.replace("VARIABLE", "group: belt, parameter: damping, lower: 0, upper: 1").replace("ROW", "all")
    with pytest.raises(CaseError, match="this name is taken where there are"):
        read_case(text.replace("LIMIT", "9").replace("{G: {", "{variables: {"))
