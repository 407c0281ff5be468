"""Constraints on responses of uncertain cases: measures as rows, their gradients, bounds that vary, and runs that keep
them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import mdstopo
from mdstopo.cli.gradient_numbers import differences
from mdstopo.cli.output import Output
from mdstopo.cli.uncertain_numbers import say_result
from mdstopo.evaluators import evaluator_of
from tests.robust.scenes import read, text, uncertain

REACH = {"response": {"displacement": {"body": "torso", "relative_to": "vehicle"}}, "over_time": "max"}
#: a member whose law has a kink in its force, so that the general kernels see events too
FENDER = {"from": "edge", "to": "deck", "law": {"type": "gap", "stiffness": 3000, "gap": 0.01}, "max_length": 0.9}


def case_of(row, measure=None, objective=None, **changes):
    section = uncertain(objective or {"measure": "mean"}, sample=6, **changes.pop("section", {}))
    if measure is not None:
        section["constraints"] = {"1": measure}
    return read(section, constraints=[{"volume": "all", "limit": 30}, row], **changes)


def tight(case):
    return replace(case, solver=replace(case.solver, tolerance=1e-12))


@pytest.mark.parametrize(
    ("row", "measure"),
    [
        ({**REACH, "limit": 0.2}, None),
        ({**REACH, "limit": 0.2}, {"measure": "quantile", "level": 0.7}),
        ({**REACH, "limit": 0.2}, {"measure": "mean_deviation", "factor": 1.5}),
        ({**REACH, "at_least": 0.1}, {"measure": "quantile", "level": 0.7}),
        ({**REACH, "at_least": 0.1}, {"measure": "mean_deviation"}),
        ({**REACH, "equals": 0.1}, None),
        ({**REACH, "limit": 0.2}, {"measure": "nominal"}),
    ],
    ids=["worst", "quantile", "deviation", "least quantile", "least deviation", "equals", "nominal"],
)
def test_gradients_of_constraints_agree_with_differences(row, measure):
    case = case_of(row, measure)
    alpha = np.random.default_rng(3).uniform(0.1, 0.6, case.n_design)
    exact = evaluator_of(tight(case))
    gradient = evaluator_of(case).evaluate(alpha).constraint_gradients[1]
    members = np.array([2, 17])
    found = differences(lambda x: {"h": float(exact.evaluate(x, gradient=False).constraints[1])}, alpha, members)
    assert np.abs(gradient[members] - found["h"]).max() < 1e-6 * np.abs(gradient).max()


def test_values_are_the_measures_of_the_points_from_the_right_side():
    rows = {sense: {**REACH, sense: 0.1} for sense in ("limit", "at_least", "equals")}
    alpha = np.full(40, 0.3)
    found = {}
    for sense, row in rows.items():
        engine = evaluator_of(case_of(row))
        points = [engine.points[i].evaluate(alpha, gradient=False).constraints[1] for i in range(6)]
        found[sense] = engine.evaluate(alpha, gradient=False).constraints[1], points
    assert found["limit"][0] == max(found["limit"][1])
    assert found["at_least"][0] == min(found["at_least"][1])
    assert found["equals"][0] == pytest.approx(np.mean(found["equals"][1]))


def test_a_bound_that_varies_is_kept_by_the_distance_to_it():
    bounds = {
        "bodies.torso.mass": {"normal": {"deviation": 6}},
        "constraints[1].limit": {"normal": {"deviation": 0.02}},
    }
    engine = evaluator_of(case_of({**REACH, "limit": 0.2}, section={"parameters": bounds}))
    alpha = np.full(40, 0.3)
    found = engine.evaluate(alpha, gradient=False).constraints[1]
    excess = [engine.points[i].evaluate(alpha, gradient=False).constraints[1] for i in range(6)]
    assert found == pytest.approx(max(excess), abs=1e-15)
    assert len({engine.points[i].case.constraints[1].bound for i in range(6)}) == 6


def test_the_competing_points_of_a_constraint_are_rows_of_one_group_at_every_design():
    case = case_of({**REACH, "limit": 0.2})
    evaluator = evaluator_of(case)
    problem = evaluator.problem()
    for seed in range(3):
        alpha = np.random.default_rng(seed).uniform(0.1, 0.6, 40)
        sample = problem.evaluate(alpha)
        rows = len(sample.constraint_rows)
        assert rows >= 1
        assert sample.constraint_gradients.shape == (rows, 40)
        assert sample.constraint_groups.tolist() == [0] * rows
        assert sample.constraint_rows[0] == sample.constraint_rows.max()
        assert sample.constraint_rows[0] == pytest.approx(evaluator.evaluate(alpha).constraints[1] / 0.2, rel=1e-12)


def test_a_run_keeps_its_bound_at_the_share_of_points_that_it_asks_for():
    kept = {}
    for level in (0.6, 1.0):
        case = case_of({**REACH, "limit": 0.15}, {"measure": "quantile", "level": level})
        result = mdstopo.optimize(case)
        assert result.status == "converged"
        engine = evaluator_of(tight(case))
        excess = [engine.points[i].evaluate(result.alpha, gradient=False).constraints[1] for i in range(6)]
        kept[level] = int(np.count_nonzero(np.array(excess) <= 1e-6))
        assert result.conclusion.of("constraints[1]").kept is not None
    assert kept[1.0] == 6
    assert 4 <= kept[0.6] < 6


def test_scenarios_may_need_other_kernels_than_the_nominal_case(tmp_path):
    soft = {"type": "cubic", "stiffness": 3000, "cubic": 20000}
    section = uncertain(
        {"measure": "worst"}, sample=3, scenarios={"as-built": {}, "worn": {"set": {"members.belts.law": soft}}}
    )
    section["parameters"] = {"bodies.torso.mass": {"normal": {"deviation": 6}}}
    case = read(section, optimizer={"max_iterations": 4})
    engine = evaluator_of(case)
    assert [bool(each.members[0].laws[0].type == "cubic") for each in engine.kinds] == [True]
    one, two = (mdstopo.optimize(case, workers=workers) for workers in (1, 2))
    assert np.array_equal(one.alpha, two.alpha)
    assert one.objectives == two.objectives


def test_members_that_switch_and_compete_have_exact_gradients_too():
    objectives = {"F": {"response": {"member_force": {"group": "fenders"}}, "over_time": "max"}}
    members = {
        "belts": {"from": "edge", "to": "deck", "law": {"type": "spring", "stiffness": 4000, "damping": 20}},
        "fenders": FENDER,
    }
    section = {
        "parameters": {
            "bodies.torso.mass": {"normal": {"deviation": 6}},
            "members.fenders.law.gap": {"uniform": {"from": 0.005, "to": 0.02}},
        },
        "objectives": {"F": {"measure": "mean_deviation", "factor": 1}},
        "sample": 5,
    }
    case = read(section, members=members, objectives=objectives)
    alpha = np.random.default_rng(6).uniform(0.2, 0.6, case.n_design)
    engine, exact = evaluator_of(case), evaluator_of(tight(case))
    gradient = engine.evaluate(alpha).gradients["F"]
    members_ = np.array([3, case.n_design - 1])
    found = differences(lambda x: exact.evaluate(x, gradient=False).objectives, alpha, members_)["F"]
    assert np.abs(gradient[members_] - found).max() < 1e-6 * np.abs(gradient).max()


def test_what_is_told_of_a_constraint_says_what_it_bounds(capsys):
    section = uncertain({"measure": "mean"}, sample=6)
    stated = text(section, constraints=[{"volume": "all", "limit": 30}, {**REACH, "limit": 0.2}])
    names, numbers = ("G", "constraints[1]"), np.ones(2)
    parts = {"uncertainty": {"robust": numbers, "nominal": numbers}, "uncertainty/validation": {}}
    view = SimpleNamespace(
        arrays={"uncertainty/robust": numbers}, under=parts.__getitem__, array=lambda place: np.ones(6),
        lines=lambda place: names if place.endswith("results") else ("mean", "worst"),
        case_text=stated, case_path=None, settings={}, kind="simulate",
    )  # fmt: skip
    say_result(Output(), view)
    said = capsys.readouterr().out
    assert "constraints[1] (max displacement of torso relative to vehicle" in said
    view.case_text = "include: gone.yaml"
    say_result(Output(), view)  # a case that cannot be read any more
    assert "constraints[1]  " in capsys.readouterr().out
