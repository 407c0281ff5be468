"""Sizes from a catalogue as the last stage of a run: beside all choices, in the file, stopped and resumed, refused."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.engine import Evaluator
from mdstopo.plots.source import Source
from mdstopo.report.report_tables import constraint_rows, objective_rows
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus
from mdstopo.store.result_reader import read_result

CASE = """
format: 1
gravity: [0, -9.8]
time: {end: 0.2}
bodies:
  crate: {mass: 60, inertia: 10, position: [0, 0]}
  truck: {mass: 2000, inertia: 6000, position: [0, -1]}
points:
  edge: {body: crate, grid: {rectangle: {center: [0, 0], size: [0.5, 0.5], count: 4}}}
  bed: {body: truck, grid: {line: {from: [-0.8, -1], to: [0.8, -1], count: 2}}}
members:
  straps: {from: edge, to: bed, law: {type: spring, stiffness: 4000, damping: 20}}
loads:
  - {body: truck, acceleration: [9.8, 0], angular_acceleration: 20}
design: {initial: 0.3, lower: 0, catalogue: {straps: SIZES}}
objectives:
  G: {response: {displacement: {body: crate, relative_to: truck}}}
constraints:
  - {volume: all, limit: 3.5}
solver: {tolerance: 1e-8}
"""
PRICED = "{sizes: [0, 0.4, 1], prices: [0, 0.6, 1]}"


def case_with(sizes, **changes):
    text = CASE.replace("SIZES", sizes)
    for old, new in changes.get("replace", ()):
        assert old in text
        text = text.replace(old, new)
    return read_case(text)


def brute(case, sizes, kept, paid=None):
    """The best of all choices for some members, the others at the least size."""
    price = dict(zip(sizes, sizes if paid is None else paid, strict=True))
    evaluator, best, at = Evaluator(case), np.inf, None
    for choice in itertools.product(sizes, repeat=len(kept)):
        design = np.full(case.n_design, sizes[0])
        design[kept] = choice
        if sum(price[size] for size in design.tolist()) <= 3.5 + 1e-9:
            value = evaluator.evaluate(design, gradient=False).objectives["G"]
            if value < best:
                best, at = value, design.tolist()
    return best, at


def paid_by(outcome):
    """What the straps of a design cost, with the prices of PRICED."""
    return sum({0.0: 0.0, 0.4: 0.6, 1.0: 1.0}[size] for size in outcome.alpha.tolist())


def kept_of(outcome, sizes):
    """Members with half of the least size above 0, or more, in the continuous optimum."""
    continuous = run_session(replace(outcome.case, members=tuple(replace(g, sizes=()) for g in outcome.case.members)))
    kept = np.flatnonzero(continuous.alpha >= 0.5 * min(size for size in sizes if size))
    assert continuous.objectives["G"] == pytest.approx(outcome.sizes.continuous, rel=1e-12)
    return kept


@pytest.mark.parametrize("few", [300, 10], ids=["all choices", "branch and bound"])
def test_the_sizes_of_a_run_are_the_best_of_all_choices(few, tmp_path, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", few)
    case = case_with("[0, 0.4, 1]")
    outcome = run_session(case, path=tmp_path / "r.h5")
    kept = kept_of(outcome, [0.0, 0.4, 1.0])
    assert len(kept) == outcome.sizes.members == 5
    best, at = brute(case, [0.0, 0.4, 1.0], kept)
    assert outcome.status is RunStatus.CONVERGED
    assert outcome.objectives["G"] == pytest.approx(best, rel=1e-9)
    assert outcome.alpha.tolist() == at
    assert outcome.sizes.continuous < best
    assert outcome.sizes.exhaustive == (few == 300)
    assert outcome.initial_objectives["G"] > outcome.objectives["G"]
    assert sum(outcome.sizes.sizes["straps"].values()) == case.n_design
    view = read_result(tmp_path / "r.h5")
    assert view.finished
    assert view.alpha.tolist() == at
    assert "worse than the continuous optimum" in view.reason
    assert view.array("catalogue/continuous") == outcome.sizes.continuous


def test_few_choices_for_all_members_are_all_evaluated():
    case = case_with("[0, 1]")
    outcome = run_session(case)
    assert len(kept_of(outcome, [0.0, 1.0])) == 3
    assert outcome.reason.startswith("sizes of 8 members chosen: the best of all choices, ")
    best, at = brute(case, [0.0, 1.0], range(8))
    assert outcome.objectives["G"] == pytest.approx(best, rel=1e-9)
    assert outcome.alpha.tolist() == at


@pytest.mark.parametrize("few", [100, 10], ids=["all choices", "branch and bound"])
def test_behind_a_poor_choice_for_the_members_kept_others_are_allowed_sizes_too(few, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", few)
    monkeypatch.setattr("mdstopo.session.sizes.MUCH_WORSE", 0.01)
    monkeypatch.setattr("mdstopo.session.sizes.OTHERS", 3)
    case, said = case_with("[0, 1]"), []
    outcome = run_session(case, notify=said.append)
    kept = kept_of(outcome, [0.0, 1.0])
    alone, _ = brute(case, [0.0, 1.0], kept)
    worse = alone / outcome.sizes.continuous - 1.0
    assert said[-1].startswith("choosing sizes of 6 members of 8, 64 choices")
    assert (
        f"the best choice for the 3 kept is {worse:.3%} worse than the continuous optimum: "
        "now sizes of 6 members are chosen"
    ) in said
    assert outcome.sizes.members == 6
    assert outcome.sizes.exhaustive == (few == 100)
    assert outcome.objectives["G"] <= alone
    assert "the 2 other members were left at their least size, of which no choice was tried" in outcome.reason


def test_a_good_choice_says_nothing_of_the_other_members():
    better = run_session(case_with("[0, 0.4, 1]"))
    assert better.objectives["G"] < 1.05 * better.sizes.continuous
    assert better.sizes.members == 5
    assert "left at their least size" not in better.reason


def test_prices_bound_the_choice(tmp_path):
    case = case_with(PRICED)
    outcome = run_session(case, path=tmp_path / "r.h5")
    best, at = brute(case, [0.0, 0.4, 1.0], range(8), [0.0, 0.6, 1.0])
    assert outcome.sizes.members == 8
    alone, _ = brute(case, [0.0, 0.4, 1.0], kept_of(outcome, [0.0, 0.4, 1.0]), [0.0, 0.6, 1.0])
    assert alone > 1.05 * outcome.sizes.continuous
    assert outcome.objectives["G"] == pytest.approx(best, rel=1e-9)
    assert outcome.alpha.tolist() == at
    excess = paid_by(outcome) - 3.5
    assert outcome.constraints.tolist() == pytest.approx([excess], abs=1e-12)
    source = Source(tmp_path / "r.h5")
    assert source.view.array("iterations/constraints")[-1] == pytest.approx([excess], abs=1e-12)
    # the page has the design with its sizes, not the continuous optimum, which is better
    assert objective_rows(source)[0]["best"] == outcome.objectives["G"]
    assert constraint_rows(source)[0]["best"] == pytest.approx(excess + 3.5, abs=1e-12)


def test_prices_count_beside_limits_on_responses(tmp_path):
    limit = "limit: 3.5}\n  - {response: {angle: {body: crate}}, over_time: max_abs, limit: 3}"
    outcome = run_session(case_with(PRICED, replace=[("limit: 3.5}", limit)]), path=tmp_path / "r.h5")
    assert outcome.constraints[0] == pytest.approx(paid_by(outcome) - 3.5, abs=1e-12)
    last = read_result(tmp_path / "r.h5").array("iterations/constraints")[-1]
    assert last.tolist() == pytest.approx(outcome.constraints.tolist(), abs=1e-12)


@pytest.mark.parametrize("few", [300, 10], ids=["all choices", "branch and bound"])
def test_members_that_are_not_kept_pay_for_the_least_size(few, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", few)
    monkeypatch.setattr("mdstopo.session.sizes.MUCH_WORSE", 1.0)
    sizes, prices = [0.0, 0.4, 1.0], [0.2, 0.7, 1.2]
    case = case_with("{sizes: [0, 0.4, 1], prices: [0.2, 0.7, 1.2]}")
    outcome = run_session(case)
    assert outcome.sizes.members < case.n_design
    best, at = brute(case, sizes, kept_of(outcome, sizes), prices)
    assert outcome.objectives["G"] == pytest.approx(best, rel=1e-9)
    assert outcome.alpha.tolist() == at
    spent = sum(dict(zip(sizes, prices, strict=True))[size] for size in at)
    assert outcome.constraints.tolist() == pytest.approx([spent - 3.5], abs=1e-12)
    assert spent <= 3.5


def test_a_run_with_sizes_that_is_opened_again_stays_as_it_is(tmp_path):
    place, case = tmp_path / "r.h5", case_with(PRICED)
    whole = run_session(case, path=place)
    before = read_result(place)
    again = run_session(case, path=place, resume=True)
    after = read_result(place)
    assert again.sizes == whole.sizes
    assert (again.status, again.reason, again.objectives) == (whole.status, whole.reason, whole.objectives)
    assert again.constraints.tolist() == whole.constraints.tolist()
    for path in ("design/alpha", "catalogue/continuous", "catalogue/bound", "iterations/objectives"):
        assert np.array_equal(before.array(path), after.array(path)), path


def test_members_of_one_alpha_have_one_size():
    case = case_with("[0, 0.3, 1]", replace=[("design: {initial", "design: {shared: [straps], initial")])
    outcome = run_session(case)
    assert set(outcome.alpha.tolist()) == {0.3}
    assert outcome.sizes.members == 8
    assert outcome.sizes.choices == 3
    assert outcome.reason.startswith("sizes of 8 members chosen: the best of all choices, ")


@pytest.mark.parametrize("sizes", ["[0, 1]", "[0, 0.4, 1]"])
def test_a_choice_of_sizes_says_how_far_it_is_between_evaluations_too(sizes, monkeypatch):
    """Where all choices are tried there are no nodes; elsewhere the neighbours of the best are tried last."""
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    monkeypatch.setattr("mdstopo.session.sizes.SAID_EVERY", 0.0)
    monkeypatch.setattr("mdstopo.session.sizes.MUCH_WORSE", 1.0)
    told = []
    outcome = run_session(case_with(sizes), notify=told.append)
    rows = [sentence for sentence in told if sentence.startswith("choosing sizes: ")]
    assert outcome.sizes.exhaustive == (sizes == "[0, 1]")
    if outcome.sizes.exhaustive:
        assert len(rows) == outcome.sizes.choices == 8
    else:
        assert len(rows) > outcome.sizes.nodes + 8
    assert f" {outcome.sizes.evaluations:,} evaluations, " in rows[-1]


def test_a_long_choice_of_sizes_tells_its_nodes_and_the_best(monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    monkeypatch.setattr("mdstopo.session.sizes.SAID_EVERY", 0.0)
    told = []
    outcome = run_session(case_with("[0, 0.4, 1]"), notify=told.append)
    rows = [sentence for sentence in told if sentence.startswith("choosing sizes: ")]
    assert len(rows) >= outcome.sizes.nodes
    assert rows[-1] == (
        f"choosing sizes: {outcome.sizes.nodes:,} nodes, {outcome.sizes.evaluations:,} evaluations, "
        f"best choice {outcome.sizes.objective:.6g}"
    )


def test_a_stopped_choice_is_kept_and_goes_on(tmp_path, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    case = case_with("[0, 0.4, 1]")
    whole = run_session(case, path=tmp_path / "whole.h5")
    told, asked = [], []

    def stop():
        asked.append(0)
        return bool(told) and len(asked) - told[0] > 1

    def notify(sentence):
        if sentence.startswith("choosing sizes"):
            told.append(len(asked))

    part = run_session(case, path=tmp_path / "parts.h5", stop_requested=stop, notify=notify)
    assert part.status is RunStatus.INTERRUPTED
    view = read_result(tmp_path / "parts.h5")
    assert not view.finished
    assert np.array_equal(view.alpha, part.alpha)
    assert set(part.alpha.tolist()) <= {0.0, 0.4, 1.0}
    assert len(view.array("catalogue/search/open_bound")) > 0
    assert part.objectives["G"] == Evaluator(case).evaluate(part.alpha, gradient=False).objectives["G"]
    assert part.objectives["G"] == pytest.approx(part.sizes.objective, rel=1e-12)
    assert objective_rows(Source(tmp_path / "parts.h5")) == []
    resumed = run_session(case, path=tmp_path / "parts.h5", resume=True)
    assert np.array_equal(resumed.alpha, whole.alpha)
    assert resumed.objectives == whole.objectives
    assert resumed.sizes == whole.sizes


def test_a_run_without_any_choice_that_fits_says_so():
    outcome = run_session(case_with("[0.5, 0.7, 1]"))
    assert outcome.status is RunStatus.FAILED
    assert outcome.reason.startswith("no choice of sizes keeps the constraints")


TWO = "combine: {weights: {G: 1, H: 1}}\nobjectives:\n  H: {response: energy, over_time: mean}"
FIXED = [("law: {", "design: false, law: {"), ("  - {volume: all, limit: 3.5}", "  []")]
NARROW = [("lower: 0,", "lower: 0.001, upper: 0.3,"), ("initial: 0.3", "initial: 0.1")]
PLACE = "design.catalogue.straps"
MISTAKES = [
    ("[0.4, 0.2]", (), f"{PLACE}[1]", "found 0.2, allowed is > 0.4, the size before it"),
    ("[0, 0.4]", NARROW, f"{PLACE}[1]", "0.001 to 0.3"),
    ("{sizes: [0, 1], prices: [0]}", (), f"{PLACE}.prices", "found 1 prices, needed is one for each of 2 sizes"),
    ("{sizes: [0, 1], prices: [2, 1]}", (), f"{PLACE}.prices[1]", "allowed is at least 2"),
    ("[0, 1]", FIXED, PLACE, "design: false"),
    ("[0, 1]", [("objectives:", TWO)], "design.catalogue", "are several objectives"),
    (
        "[0, 1]",
        [("lower: 0,", "lower: 0.1, power: 0.5,")],
        f"{PLACE}[0]",
        "found 0, allowed is > 0 where power is below",
    ),
]


@pytest.mark.parametrize(("sizes", "changes", "place", "words"), MISTAKES, ids=range(len(MISTAKES)))
def test_mistakes_are_told_with_their_place(sizes, changes, place, words):
    with pytest.raises(CaseError) as error:
        case_with(sizes, replace=changes)
    assert any(each.path_key == place and words in each.message for each in error.value.mistakes), error.value


def test_lengths_that_vary_have_no_catalogue():
    moving = "bed: {body: truck, movable: {within: {line: {from: [-1, -1], to: [1, -1]}}},"
    case = case_with("[0, 1]", replace=[("bed: {body: truck,", moving), ("damping: 20}", "damping: 20}, cost: length")])
    with pytest.raises(CaseError, match="cost a length that varies"):
        run_session(case)


def test_prices_are_not_lost_in_a_sum_of_lengths_that_vary():
    wall = (
        "  wall: {body: truck, grid: {list: [[-1, 0.1]]}, movable: {within: {line: {from: [-1, -1], to: [-1, 1]}}}}\n"
    )
    ropes = "  ropes: {from: edge, to: wall, law: {type: spring, stiffness: 4000}, cost: length}\n"
    more = [("members:\n", f"{wall}members:\n"), ("loads:\n", f"{ropes}loads:\n")]
    with pytest.raises(CaseError, match=r"design\.catalogue\.straps: .* there prices have to be the sizes"):
        run_session(case_with("{sizes: [0, 1], prices: [0, 2]}", replace=more))


@pytest.mark.parametrize("sizes", ["[0, 0.5, 1]", "[0.5, 1]"])
def test_a_sum_that_is_to_be_equal_is_not_passed_where_all_members_have_their_least_size(sizes):
    """All alphas are 0.2, so that no member is kept: the volume would be 0, or 4, where 1.6 is asked for."""
    evenly = [("{initial: 0.3", "{shared: [straps], initial: 0.3"), ("limit: 3.5", "equals: 1.6")]
    outcome = run_session(case_with(sizes, replace=evenly))
    assert outcome.status is RunStatus.FAILED
    assert outcome.reason.startswith(
        "no choice of sizes keeps the constraints: no member is kept (none reaches half of its least size above 0), "
        "and all members at their least sizes do not keep the constraints"
    )
    assert outcome.alpha.tolist() == pytest.approx([0.2] * 8)
    assert outcome.constraints.tolist() == pytest.approx([0.0], abs=1e-12)


def test_members_whose_only_size_is_zero_are_left_out():
    outcome = run_session(case_with("[0]"))
    assert outcome.status is RunStatus.CONVERGED
    assert outcome.alpha.tolist() == [0.0] * 8
    assert outcome.sizes.sizes == {"straps": {0.0: 8}}


def test_a_choice_that_is_better_than_the_continuous_optimum_is_told_as_better():
    """With prices below the sizes more is built than alphas could pay."""
    outcome = run_session(case_with("{sizes: [0, 0.4, 1], prices: [0, 0.1, 0.3]}"))
    assert outcome.sizes.objective < outcome.sizes.continuous
    gain = (outcome.sizes.continuous - outcome.sizes.objective) / outcome.sizes.continuous
    assert outcome.reason.endswith(f"{gain:.3%} better than the continuous optimum")


#: two springs, one along each axis; that along y is hardly needed, and not at all dispensable
CROSSED = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
members:
  x: {from: {body: ground, at: [-5, 0]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 40, damping: 2}}
  y: {from: {body: ground, at: [0, -5]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 40, damping: 2}}
loads: [{body: a, force: [4, 0.5]}]
design: {initial: 0.5, lower: 0, catalogue: {x: [0, 0.4, 0.7, 1], y: [0, 0.4, 1]}}
objectives: {X: {response: {displacement: {body: a, component: x}}, over_time: max}}
constraints:
  - {response: {displacement: {body: a, component: y}}, over_time: max, limit: 0.18}
  - {volume: all, limit: 1.15}
solver: {tolerance: 1e-8}
"""


def test_members_that_are_next_to_nothing_get_a_size_where_without_them_a_limit_is_broken(monkeypatch):
    """The run ended as failed: the spring along y has a size below half of 0.4, and was left out."""
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    case = read_case(CROSSED)
    without = run_session(replace(case, members=tuple(replace(group, sizes=()) for group in case.members)))
    assert 0.01 < without.alpha[1] < 0.2
    said = []
    outcome = run_session(case, notify=said.append)
    assert outcome.status is RunStatus.CONVERGED
    evaluator, best = Evaluator(case), {}
    for choice in itertools.product([0.0, 0.4, 0.7, 1.0], [0.0, 0.4, 1.0]):
        found = evaluator.evaluate(np.array(choice), gradient=False)
        if found.constraints.max() <= 1e-9:
            best[found.objectives["X"]] = list(choice)
    assert outcome.alpha.tolist() == best[min(best)] == [0.7, 0.4]
    assert outcome.sizes.members == 2
    assert any(
        "no sizes of the 1 kept keep the constraints: now sizes of 2 members are chosen" in each for each in said
    )


@pytest.mark.parametrize("stopped", [6, 9, 11, 14])
def test_a_choice_that_went_on_with_all_members_goes_on_where_it_was_stopped(tmp_path, stopped, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    case = read_case(CROSSED)
    whole = run_session(case, path=tmp_path / "whole.h5")
    asked = 0

    def stop():
        nonlocal asked
        asked += searching
        return asked > stopped

    searching = False

    def notify(said):
        nonlocal searching
        searching |= said.startswith("choosing sizes of")

    part = run_session(case, path=tmp_path / "part.h5", stop_requested=stop, notify=notify)
    assert part.status is RunStatus.INTERRUPTED
    resumed = run_session(case, path=tmp_path / "part.h5", resume=True)
    assert np.array_equal(resumed.alpha, whole.alpha)
    assert resumed.sizes == whole.sizes
    assert resumed.reason == whole.reason
    assert resumed.evaluations == whole.evaluations


@pytest.mark.parametrize("stopped", [2, 8, 40, 150])
def test_a_choice_that_went_on_behind_a_poor_one_goes_on_where_it_was_stopped(tmp_path, stopped, monkeypatch):
    monkeypatch.setattr("mdstopo.session.size_search.FEW_CHOICES", 10)
    monkeypatch.setattr("mdstopo.session.sizes.MUCH_WORSE", 0.01)
    case = case_with("[0, 1]")
    whole = run_session(case, path=tmp_path / "whole.h5")
    assert whole.sizes.members == 8
    asked = itertools.count()
    searching = []

    def notify(said):
        if said.startswith("choosing sizes of"):
            searching.append(said)

    part = run_session(
        case,
        path=tmp_path / "part.h5",
        stop_requested=lambda: bool(searching) and next(asked) > stopped,
        notify=notify,
    )
    assert part.status is RunStatus.INTERRUPTED
    assert len(searching) == (1 if stopped < 8 else 2)
    resumed = run_session(case, path=tmp_path / "part.h5", resume=True)
    assert np.array_equal(resumed.alpha, whole.alpha)
    assert (resumed.sizes, resumed.reason, resumed.evaluations) == (whole.sizes, whole.reason, whole.evaluations)


def test_a_continuous_optimum_of_next_to_nothing_is_told_beside_the_choice_and_not_as_a_share(monkeypatch):
    monkeypatch.setattr("mdstopo.session.sizes.MANY_TIMES", 0.01)
    outcome = run_session(case_with("[0, 1]"))
    words = f"{outcome.objectives['G']:.6g}, where the continuous optimum has {outcome.sizes.continuous:.6g}"
    assert outcome.reason.endswith(words)


def test_where_no_member_is_kept_few_choices_are_tried_all_the_same():
    """The run ended as failed, though a choice keeps the limit: the optimum needs less than half of the least size."""
    overrides = {"design.catalogue": {"x": [0, 1], "y": [0, 1]}, "objectives.X.sense": "maximize"}
    case = read_case(CROSSED, overrides=overrides)
    without = run_session(replace(case, members=tuple(replace(group, sizes=()) for group in case.members)))
    assert without.alpha.max() < 0.5
    outcome = run_session(case)
    assert outcome.status is RunStatus.CONVERGED
    assert outcome.alpha.tolist() == [0.0, 1.0]
    assert outcome.reason.startswith("sizes of 2 members chosen: the best of all choices, ")
