"""Gradients of measures over a sample agree with differences, by every method, for every measure and sense."""

from dataclasses import replace

import numpy as np
import pytest

from mdstopo.cli.gradient_numbers import differences
from mdstopo.evaluators import evaluator_of
from mdstopo.robust.ensemble import Ensemble
from mdstopo.status import Status
from tests.robust.scenes import SCENARIOS, read, uncertain

MEASURES = {
    "mean": {"measure": "mean"},
    "mean_deviation": {"measure": "mean_deviation", "factor": 2},
    "worst": {"measure": "worst"},
    "quantile": {"measure": "quantile", "level": 0.8},
    "nominal": {"measure": "nominal"},
}
#: the bar: relative to the largest entry of a gradient
BAR = 1e-6


def tight(case):
    return replace(case, solver=replace(case.solver, tolerance=1e-12))


def designs(case, count=1):
    rng = np.random.default_rng(8)
    return [rng.uniform(0.05, 0.6, case.n_design) for _ in range(count)]


def off(case, alpha, count=3):
    """The largest disagreement of gradients and differences, relative, by objective."""
    engine, exact = evaluator_of(case), evaluator_of(tight(case))
    gradients = engine.evaluate(alpha).gradients
    members = np.sort(np.random.default_rng(1).choice(case.n_design, count, replace=False))
    found = differences(lambda x: exact.evaluate(x, gradient=False).objectives, alpha, members)
    return {
        name: float(np.abs(gradient[members] - found[name]).max() / np.abs(gradient).max())
        for name, gradient in gradients.items()
    }


@pytest.mark.parametrize("name", MEASURES)
def test_gradients_agree_with_differences(name):
    case = read(uncertain(MEASURES[name]))
    for alpha in designs(case, 2):
        assert off(case, alpha)["G"] < BAR


@pytest.mark.parametrize("name", MEASURES)
def test_gradients_agree_with_differences_where_scenarios_meet_the_sample(name):
    case = read(uncertain(MEASURES[name], scenarios=SCENARIOS, sample=4))
    assert off(case, designs(case)[0])["G"] < BAR


@pytest.mark.parametrize("name", ["mean_deviation", "worst", "quantile"])
@pytest.mark.parametrize("over_time", ["max", "mean"])
def test_gradients_agree_with_differences_where_more_is_better(name, over_time):
    objectives = {"G": {"response": "energy", "over_time": over_time, "sense": "maximize"}}
    case = read(uncertain(MEASURES[name]), objectives=objectives)
    assert off(case, designs(case)[0])["G"] < BAR


@pytest.mark.parametrize("name", ["mean_deviation", "quantile"])
def test_the_methods_agree(name):
    case = read(uncertain(MEASURES[name]))
    engine = evaluator_of(case)
    alpha = designs(case)[0]
    adjoint, direct = (engine.evaluate(alpha, sensitivity=method) for method in ("adjoint", "direct"))
    assert adjoint.objectives == pytest.approx(direct.objectives, rel=1e-12)
    np.testing.assert_allclose(
        adjoint.gradients["G"], direct.gradients["G"], atol=1e-10 * np.abs(direct.gradients["G"]).max()
    )


def test_values_are_the_measures_of_the_points():
    sections = {name: uncertain(measure) for name, measure in MEASURES.items()}
    engines = {name: evaluator_of(read(section)) for name, section in sections.items()}
    one = engines["mean"]
    assert isinstance(one, Ensemble)
    alpha = designs(one.case)[0]
    points = [one.points[i].evaluate(alpha, gradient=False).objectives["G"] for i in range(8)]
    found = {name: engine.evaluate(alpha, gradient=False).objectives["G"] for name, engine in engines.items()}
    assert found["mean"] == pytest.approx(np.mean(points), rel=1e-14)
    assert found["mean_deviation"] == pytest.approx(np.mean(points) + 2.0 * np.std(points), rel=1e-14)
    assert found["worst"] == max(points)
    assert found["quantile"] == sorted(points)[6]  # 7 of 8 points are the first to be at least 80 %
    assert len(set(points)) == 8


def test_the_nominal_measure_is_the_certain_case():
    case = read(uncertain(MEASURES["nominal"]))
    alpha = designs(case)[0]
    found = evaluator_of(case).evaluate(alpha)
    certain = evaluator_of(replace(case, uncertainty=None)).evaluate(alpha)
    assert found.objectives == certain.objectives
    assert np.array_equal(found.gradients["G"], certain.gradients["G"])
    assert found.work == certain.work  # no point of the sample was computed


def test_error_estimates_are_those_of_the_points_weighted():
    case = read(uncertain(MEASURES["mean_deviation"]), solver={"tolerance": 1e-4})
    engine = evaluator_of(case)
    alpha = designs(case)[0]
    found = engine.with_errors(alpha, engine.evaluate(alpha))
    exact = evaluator_of(tight(case)).evaluate(alpha)
    error = abs(found.objectives["G"] - exact.objectives["G"])
    assert error <= found.errors["G"].value <= 1e-4 * found.objectives["G"]


def test_where_there_is_no_slope_there_is_still_a_value():
    case = read(uncertain(MEASURES["mean_deviation"]), design={"power": 0.5})
    engine, alpha = evaluator_of(case), np.full(40, 0.2)
    alpha[3] = 0.0
    found = engine.evaluate(alpha)
    assert found.status is Status.NO_GRADIENT
    assert found.message.startswith("alpha = 0 in group belts, whose power 0.5 is below 1, at point 0")
    assert found.objectives == engine.evaluate(alpha, gradient=False).objectives
    assert not found.gradients


def test_a_point_that_cannot_be_computed_fails_the_evaluation_by_name():
    # no step is short enough for the second of these
    values = {"loads[0].angular_acceleration": {"discrete": [[20, 0.5], [1e152, 0.5]]}}
    case = read(uncertain(MEASURES["mean"], parameters=values, sample=4))
    engine = evaluator_of(case)
    first = int(np.argmax(engine.sample.values[:, 0] > 20.0))
    found = engine.evaluate(case.initial)
    assert found.status.value == "the step became too small to move time on"
    words = f"at point {first} of the sample (loads[0].angular_acceleration = 1e+152)"
    assert found.message.endswith(words)
    assert np.isnan(found.objectives["G"])
