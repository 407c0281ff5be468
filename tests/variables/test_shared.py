"""Alphas that are one: shared by a group, mirrored between groups. What the optimiser sees is what the case says."""

import numpy as np
import pytest

import mdstopo
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.session.run_session import run_session
from tests.variables.support import FRAME_AND_LOAD, whole_and_resumed

SCENE = (
    FRAME_AND_LOAD
    + """\
members:
  lefts: {from: left, to: belt, law: {type: spring, stiffness: 2000}}
  rights: {from: right, to: belt, law: {type: spring, stiffness: 2000}}
  more: {from: left, to: belt, law: {type: spring, stiffness: 500}, cost: 2}
objectives:
  G: {response: energy, over_time: max}
constraints:
  - {volume: all, fraction: 0.3}
design: {initial: 0.2, lower: {lefts: 0.01, rights: 0.02, more: 0.001}, SHARING}
optimizer: {max_iterations: 8}
"""
)


def case_with(sharing: str, **overrides: str) -> mdstopo.Case:
    return read_case(SCENE.replace("SHARING", sharing), overrides=overrides)


def test_a_case_that_shares_nothing_hands_the_optimiser_alpha_itself():
    case = case_with("upper: 1")
    space, alpha = case.space, np.linspace(0.1, 0.9, case.n_design)
    assert space.identity
    assert space.expand(alpha) is alpha
    assert space.reduce(alpha) is alpha
    assert space.vjp(alpha) is alpha


@pytest.mark.parametrize(
    ("sharing", "size"),
    [
        ("shared: [more]", 6 + 6 + 1),
        ("mirrored: [[lefts, rights]]", 6 + 6),
        ("mirrored: [[rights, lefts], [more, lefts]]", 6),
        ("shared: [rights], mirrored: [[lefts, rights]]", 1 + 6),
        ("shared: [lefts, more], mirrored: [[lefts, rights, more]]", 1),
    ],
)
def test_as_many_variables_as_different_alphas_and_every_one_goes_there_and_back(sharing, size):
    case = case_with(sharing)
    space = case.space
    assert space.size == size
    x = np.random.default_rng(0).uniform(0.1, 0.9, size)
    alpha = space.expand(x)
    assert len(np.unique(alpha)) == size
    assert space.reduce(alpha).tobytes() == x.tobytes()
    parts = case.group_slices
    if "mirrored: [[lefts, rights]]" in sharing or size == 6:
        assert np.array_equal(alpha[parts["lefts"]], alpha[parts["rights"]])


def test_of_alphas_that_share_bounds_the_narrowest_counts():
    case = case_with("mirrored: [[lefts, rights]]")
    lower, upper = case.space.bounds(case.lower, case.upper)
    assert lower[:6].tolist() == [0.02] * 6
    assert lower[6:].tolist() == [0.001] * 6
    assert upper.tolist() == [1.0] * 12


def test_the_derivative_by_a_shared_alpha_is_that_of_all_its_members_together():
    case = case_with("shared: [more], mirrored: [[lefts, rights]]", **{"solver.tolerance": "1e-11"})
    problem = Evaluator(case).problem()
    x = np.random.default_rng(1).uniform(0.2, 0.8, case.space.size)
    sample = problem.evaluate(x)
    parts = case.group_slices
    gradient = mdstopo.evaluate(case, case.space.expand(x)).gradients["G"]
    assert sample.gradients[0][-1] == pytest.approx(gradient[parts["more"]].sum(), rel=1e-12)
    assert sample.gradients[0][:6] == pytest.approx(gradient[parts["lefts"]] + gradient[parts["rights"]], rel=1e-12)
    for i in (0, 3, 6):
        h = 1e-3
        slope = 0.0
        for m, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
            for sign in (1.0, -1.0):
                moved = x.copy()
                moved[i] += sign * m * h
                slope += sign * weight * problem.evaluate(moved, gradient=False).objective / h
        assert slope == pytest.approx(sample.gradients[0][i], rel=1e-7)


def test_volume_rows_count_every_member_that_shares():
    case = case_with("shared: [more], mirrored: [[lefts, rights]]")
    problem = Evaluator(case).problem()
    x = np.random.default_rng(2).uniform(0.2, 0.8, case.space.size)
    alpha = case.space.expand(x)
    assert problem.linear.excess(x)[0] == pytest.approx(case.cost @ alpha - 0.3 * case.cost.sum(), rel=1e-12)


def test_several_springs_that_share_an_alpha_are_designed_as_the_one_spring_they_are():
    text = """
format: 1
time: {end: 0.5}
bodies:
  m: {mass: 3, inertia: 0.1, position: [0, 0], velocity: [1, 0]}
points: {wall: {body: ground, grid: {list: [[2, 0], WALL]}}}
members:
  x: {from: {body: m, at: [0, 0]}, to: wall, law: {type: spring, stiffness: STIFFNESS}, cost: COST}
  y: {from: {body: m, at: [0, 0]}, to: {body: ground, at: [-2, 0]}, law: {type: spring, stiffness: 50}}
design: {initial: 0.3, SHARED}
objectives: {G: {response: energy, over_time: mean}}
constraints: [{volume: all, limit: 2}]
optimizer: {max_iterations: 10}
"""
    four = text.replace("WALL", "[2, 0], [2, 0], [2, 0]").replace("STIFFNESS", "100").replace("COST", "1")
    one = text.replace(", WALL", "").replace("STIFFNESS", "400").replace("COST", "4")
    several = mdstopo.optimize(read_case(four.replace("SHARED", "shared: [x]")))
    single = mdstopo.optimize(read_case(one.replace(", SHARED", "")))
    assert several.alpha.shape == (5,)
    assert several.alpha[1:4].tolist() == [several.alpha[0]] * 3
    assert several.alpha[[0, 4]] == pytest.approx(single.alpha, rel=1e-9)
    assert several.history["objectives"] == pytest.approx(single.history["objectives"], rel=1e-9)


def test_a_design_that_differs_where_the_case_has_one_alpha_is_replaced_by_the_mean_with_a_notice():
    case = case_with("shared: [more]", **{"optimizer.max_iterations": "0"})
    initial = np.array(case.initial)
    initial[-6:] = np.linspace(0.05, 0.15, 6)
    said: list[str] = []
    outcome = run_session(case, initial=initial, notify=said.append)
    assert outcome.alpha[-6:] == pytest.approx([0.1] * 6, rel=1e-12)
    assert any("their mean is taken (largest change of alpha 0.05)" in line for line in said)


def test_a_shared_run_that_is_stopped_and_resumed_is_the_same_to_the_bit(tmp_path):
    case = case_with("shared: [more], mirrored: [[lefts, rights]]")
    whole, resumed = whole_and_resumed(case, tmp_path)
    assert resumed.alpha.tobytes() == whole.alpha.tobytes()
    assert resumed.history["objectives"].tobytes() == whole.history["objectives"].tobytes()
    assert mdstopo.evaluate(case, whole.alpha).objectives["G"] == whole.objectives["G"]


def test_mirrored_halves_of_a_symmetric_problem_find_an_optimum_next_to_that_of_both_together():
    """Two load cases that mirror each other: the combined problem is symmetric, and so is its mirrored optimum."""
    text = SCENE.replace("velocity: [1.5, 0], angular_velocity: 1", "").replace(
        "objectives:\n  G: {response: energy, over_time: max}",
        """load_cases:
  to_left: {loads: [{body: load, force: [-40, 0], at: [0, 1.1]}]}
  to_right: {loads: [{body: load, force: [40, 0], at: [0, 1.1]}]}
objectives:
  L: {response: energy, over_time: mean, load_case: to_left}
  R: {response: energy, over_time: mean, load_case: to_right}
combine: {method: weighted_sum, weights: {L: 1, R: 1}, normalize: false}""",
    )
    # the points of `rights` see the belt's ends in the other order
    text = text.replace("rights: {from: right, to: belt", "rights: {from: right, to: tleb")
    text = text.replace("  belt: {", "  tleb: {body: load, grid: {list: [[0.2, 1], [-0.2, 1]]}}\n  belt: {")
    text = text.replace("  more: {from: left, to: belt, law: {type: spring, stiffness: 500}, cost: 2}\n", "")
    text = text.replace("{lefts: 0.01, rights: 0.02, more: 0.001}", "0.01")
    text = text.replace("max_iterations: 8", "max_iterations: 60")
    free = mdstopo.optimize(read_case(text.replace(", SHARING", "")))
    mirrored = mdstopo.optimize(read_case(text.replace("SHARING", "mirrored: [[lefts, rights]]")))
    assert mirrored.objectives["L"] == pytest.approx(mirrored.objectives["R"], rel=1e-7)
    # with both halves free an optimum may be a little lower, by being no mirror image of itself
    whole, halves = (sum(each.objectives.values()) for each in (free, mirrored))
    assert whole <= halves <= 1.003 * whole


@pytest.mark.parametrize(
    ("sharing", "place", "words"),
    [
        ("shared: [nobody]", "design.shared[0]", "no member group is called 'nobody'"),
        ("shared: [more, more]", "design.shared[1]", "'more' is in the list already"),
        ("mirrored: [[lefts]]", "design.mirrored[0]", "needed are at least 2 member groups"),
        ("mirrored: [lefts, rights]", "design.mirrored[0]", "allowed is a list of member groups"),
        ("mirrored: [[lefts, few]]", "design.mirrored[0]", "lefts has 6, few has 1; member k of one goes with"),
        ("shared: [rigid]", "design.shared[0]", "'rigid' has `design: false`"),
        ("upper: {rights: 0.3}, mirrored: [[lefts, rights]]", "design.mirrored[0]", "bounds have nothing in common"),
    ],
)
def test_what_cannot_be_shared_is_refused_at_its_place(sharing, place, words):
    text = SCENE.replace(
        "objectives:",
        "  few: {from: {body: frame, at: [0, 0]}, to: {body: load, at: [0, 1]}, law: {type: spring, stiffness: 1}}\n"
        "  rigid: {from: {body: frame, at: [0, 0]}, to: {body: load, at: [0, 1]}, design: false, "
        "law: {type: spring, stiffness: 1}}\nobjectives:",
        1,
    )
    if "upper" in sharing:
        text = text.replace("lefts: 0.01", "lefts: 0.5").replace("initial: 0.2", "initial: {lefts: 0.6, rights: 0.2}")
    with pytest.raises(CaseError) as caught:
        read_case(text.replace("SHARING", sharing))
    found = [(mistake.path_key, mistake.message) for mistake in caught.value.mistakes]
    assert any(path == place and words in message for path, message in found), found


def test_bounds_that_only_a_chain_of_mirrors_ties_have_to_go_together():
    text = SCENE.replace("initial: 0.2", "initial: {lefts: 0.012, rights: 0.2, more: 0.2}")
    with pytest.raises(CaseError) as caught:
        read_case(text.replace("SHARING", "upper: {lefts: 0.015}, mirrored: [[rights, more], [more, lefts]]"))
    (mistake,) = caught.value.mistakes
    assert mistake.path_key == "design.mirrored[1]"
    assert "nothing in common: lower 0.02, upper 0.015 (of " in mistake.message
